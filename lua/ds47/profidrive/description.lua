-- What the attributes description (0x20) and text (0x30) say of a parameter (docs/protocol.md C; Python:
-- ds47.profidrive.description).
--
-- Made from the values that a message has, whatever format a drive puts them in: a whole description of 46
-- bytes, one element of it, entries of a text array. What is no description is nil, and no bytes raise.
-- Nothing is guessed: a limit whose bytes do not fit the type of the parameter, a type or a unit that no
-- table has, stay nil. Words are elsewhere.

local bit = require("ds47.support.bits").bit
local formats = require("ds47.profidrive.formats")
local numbers = require("ds47.support.numbers")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")

local concat, find, format = table.concat, string.find, string.format
local gsub, rep, sub = string.gsub, string.rep, string.sub

local M = {}

local WHOLE = 0 -- the subindex of a whole description
local LIMIT = 4 -- bytes of a limit
local LIMITED = { number = true, float = true, duration = true, time_of_day = true } -- kinds with limits

-- The row of a format in the tables, and its code; nil where it has none.
local function row_of(format_name)
  local code = format_name and formats.code_of(format_name)
  return code and tables.formats[code], code
end

local MOST = { number = 4, text = 16, octets = 16 } -- bytes of a value

-- What gives the bytes of one value, by kind of format; nil where the value is none of it.
local bytes_of = {}

function bytes_of.number(value, row)
  return type(value) == "number" and reader.of_number(value, row.size) or nil
end

function bytes_of.text(value, row)
  local text = type(value) == "string" and reader.from_latin1(value)
  if not text or (not row.whole and #text > row.size) then return nil end
  return row.whole and text or text .. rep(" ", row.size - #text)
end

function bytes_of.octets(value, row)
  if type(value) ~= "string" or find(value, "%X") or #value % 2 == 1 then return nil end
  if not row.whole and #value ~= 2 * row.size then return nil end
  return reader.unhex(value)
end

-- The bytes that these values were in the message; nil where that is not known.
local function octets(format_name, values)
  local row = row_of(format_name)
  local make = row and row.size and bytes_of[row.kind]
  if not make or #values == 0 or row.size > MOST[row.kind] then return nil end
  local found = {}
  for number, value in ipairs(values) do
    local raw = make(value, row)
    if raw == nil then return nil end
    found[number] = raw
  end
  return concat(found)
end

-- Whether the format says what the value of an element is: a factor or a limit, with more than its size.
local function says(format_name, element)
  local row, code = row_of(format_name)
  if not row or not LIMITED[row.kind] or (code >= 0x40 and code <= 0x44) then return false end
  return element == "low" or element == "high" or (element == "factor" and row.kind == "float")
end

local function text_of(raw) return reader.latin1((gsub(raw, "[\0 ]+$", ""))) end

-- The unit of a variable attribute: `kW`, `10^-1 °C`; nil where the tables do not know it.
local function unit_of(quantity, conversion)
  local known = tables.descriptions
  local own = known.units[quantity] and known.units[quantity][conversion]
  local row = known.quantities[quantity]
  if row == nil or own then return own end
  if conversion > known.powers or conversion < -known.powers - 1 then return nil end
  if conversion == 0 then return row.unit end
  local letter = row.prefix and known.prefixes[conversion]
  return letter and letter .. row.unit or format("10^%d %s", conversion, row.unit)
end

-- A limit as a value of the type: in all four bytes, or at their right end behind nothing but its sign.
local function limit(type_name, raw)
  local row, code = row_of(type_name)
  if not row or not LIMITED[row.kind] or not row.size or row.size > LIMIT then return nil end
  local front, value = sub(raw, 1, LIMIT - row.size), sub(raw, LIMIT - row.size + 1)
  local negative = find(row.pack or "", "^%l") and value:byte() >= 0x80
  local codec = formats.codec(code)
  if codec == nil or (find(front, "[^\0]") and not (negative and front == rep("\255", #front))) then
    return nil
  end
  return codec.decode(value, 1, codec.size)[1]
end

-- What puts an element where it belongs: (description, bytes).
local TAKE = {}

function TAKE.identifier(found, raw)
  local word, code, bits = reader.u16(raw, 0), raw:byte(2), tables.descriptions.bits
  local row = tables.formats[code]
  found.identifier, found.type = word, row and row.name or format("0x%02X", code)
  found.writable = bit(word, bits.read_only) == 0
  for _, name in ipairs({ "text_array", "changed", "reset_only", "array" }) do
    found[name] = bit(word, bits[name]) == 1
  end
end

function TAKE.factor(found, raw) found.factor = numbers.float32(raw, 0) end

function TAKE.variable(found, raw)
  local quantity, conversion = raw:byte(1, 2)
  found.quantity, found.conversion = quantity, conversion < 0x80 and conversion or conversion - 0x100
  found.unit = unit_of(quantity, found.conversion)
end

function TAKE.name(found, raw) found.name = text_of(raw) end

for _, name in ipairs({ "low", "high" }) do
  TAKE[name] = function(found, raw)
    found[name], found.limit_format = limit(found.type, raw), found.type
  end
end

function TAKE.normalisation(found, raw)
  local word, known = reader.u16(raw, 0), tables.descriptions.normalisation
  found.normalisation = word
  if bit(word, known.valid) == 1 then found.full_scale = 2 ^ (word % known.bits) end
end

for _, name in ipairs({ "elements", "extension", "reference" }) do
  TAKE[name] = function(found, raw) found[name] = reader.u16(raw, 0) end
end

-- Whether nothing is known from a description.
local function is_empty(found)
  for key in pairs(found) do
    if key ~= "limit_format" then return false end
  end
  return true
end

--- The description that these values are, nil where they are none: the keys of the JSON report, and
-- `limit_format`, the name of the format of its limits.
-- @param subindex    0 for all elements, else the number of one
-- @param values      as the decoder shows them
function M.describe(subindex, format_name, values)
  local raw, found = octets(format_name, values), {}
  for _, element in ipairs(tables.descriptions.elements) do
    local name, take = element.name, TAKE[element.name]
    if subindex == WHOLE then
      if raw == nil or #raw ~= tables.descriptions.length then
        return nil
      elseif take then
        take(found, sub(raw, element.offset + 1, element.offset + element.size))
      end
    elseif element.number == subindex then
      if #values == 1 and says(format_name, name) then
        found[name], found.limit_format = values[1], format_name
      elseif raw and #raw == element.size and take then
        take(found, raw)
      end
    end
  end
  if is_empty(found) then return nil end
  return found
end

--- The entries of a text array without the blanks at their end, nil where these values are no text.
function M.texts(format_name, values)
  local row, size = row_of(format_name), tables.descriptions.text_length
  if not row or (row.size ~= 1 and row.size ~= size) then return nil end
  local raw = octets(format_name, values)
  if raw == nil or raw == "" then return nil end
  local step, found = #raw % size == 0 and size or #raw, {}
  for at = 1, #raw, step do found[#found + 1] = text_of(sub(raw, at, at + step - 1)) end
  return found
end

return M
