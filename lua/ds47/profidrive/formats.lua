-- The formats of values (docs/protocol.md A.6): bytes to values, and the physical values of normalised
-- formats. One codec per format of tables.lua. Blocks, pads and what to do with unknown formats are in
-- parameter.lua.

local json = require("ds47.support.json")
local numbers = require("ds47.support.numbers")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")
local times = require("ds47.support.times")

local byte, format, sub = string.byte, string.format, string.sub
local abs, floor = math.abs, math.floor
local float32, float64 = numbers.float32, numbers.float64
local float_text, whole_text = numbers.float_text, numbers.whole_text

local M = {}

local NONE = {}
-- Float32 and Float64: what is nearer to zero is no number that anybody typed, nor is what is farther away
-- than ABSURD.
local LEAST_NORMAL = {[0x08] = 2 ^ -126, [0x0F] = 2 ^ -1022}
local ABSURD = 1e30

local DAY_MS = 86400000
local MS_RANGE = 268435456 -- times of day use 28 of their 32 bits
local DAYS_TO_1984 = 5113 -- from 1970-01-01

-- decode(raw, count, size) -> values: `count` whole values. Here one after the other: one(raw, offset, size)
-- -> value.
local function each(one)
  return function(raw, count, size)
    if count == 1 then return {(one(raw, 0, size))} end
    local values = {}
    for i = 1, count do values[i] = one(raw, (i - 1) * size, size) end
    return values
  end
end

local function bytes(raw, count) return {byte(raw, 1, count)} end

local function i8(raw, at)
  local value = byte(raw, at + 1)
  return value < 0x80 and value or value - 0x100
end

local function i16(raw, at)
  local high, low = byte(raw, at + 1, at + 2)
  local value = high * 0x100 + low
  return value < 0x8000 and value or value - 0x10000
end

local function i32(raw, at)
  local value = reader.u32(raw, at)
  return value < 0x80000000 and value or value - 0x100000000
end

local decode = { -- by `pack`
  B = bytes, b = each(i8), H = each(reader.u16), h = each(i16), I = each(reader.u32), i = each(i32),
  Q = each(numbers.unsigned), q = each(numbers.signed64), f = each(float32), d = each(float64),
}
local integers = each(numbers.unsigned)

local texts = each(function(raw, at, size) return reader.latin1(sub(raw, at + 1, at + size)) end)

local octets = each(function(raw, at, size) return reader.hex(sub(raw, at + 1, at + size)) end)

local function one_text(raw, count) return count > 0 and {reader.latin1(raw)} or {} end

local function one_octets(raw, count) return count > 0 and {reader.hex(raw)} or {} end

-- scale(values, raw, codec) -> physical values, one for each value: one(codec, value, raw, offset) -> value.
local function scaling(one)
  return function(values, raw, codec)
    local scaled = {}
    for i = 1, #values do scaled[i] = one(codec, values[i], raw, (i - 1) * codec.size) end
    return scaled
  end
end

local ratio = scaling(function(codec, value) return value * codec.multiply / codec.divide end)

local without_status = scaling(function(codec, _, raw, at)
  return codec.scaled_float and float32(raw, at) or byte(raw, at + 1)
end)

local function clock(milliseconds)
  local seconds = floor(milliseconds / 1000)
  local minutes = floor(seconds / 60)
  return format("%02d:%02d:%02d.%03d", floor(minutes / 60), minutes % 60, seconds % 60, milliseconds % 1000)
end

local time_of_day = scaling(function(codec, _, raw, at)
  local text = clock(reader.u32(raw, at) % MS_RANGE)
  if codec.size < 6 then return text end
  return format("%04d-%02d-%02d", times.date(DAYS_TO_1984 + reader.u16(raw, at + 4))) .. "T" .. text
end)

local duration = scaling(function(codec, _, raw, at)
  local days = codec.size == 6 and reader.u16(raw, at + 4) or 0
  return (days * DAY_MS + reader.u32(raw, at)) / 1000
end)

-- ISO 8601, unchecked: a month 13 stays visible. Years 84 to 99 are of the last century.
local date_and_time = scaling(function(_, _, raw, at)
  local milliseconds = reader.u16(raw, at)
  local minute, hour, day, month, year = byte(raw, at + 3, at + 7)
  year = year % 128
  return format("%04d-%02d-%02dT%02d:%02d:%02d.%03d", year + (year >= 84 and 1900 or 2000), month % 64,
    day % 32, hour % 32, minute % 64, floor(milliseconds / 1000), milliseconds % 1000)
end)

-- kind of tables.lua -> what of a codec does not stand in the row itself.
local make = {
  float = function(row) return {decode = decode[row.pack], float = true} end,
  text = function(row) return {decode = row.whole and one_text or texts} end,
  octets = function(row) return {decode = row.whole and one_octets or octets} end,
  with_status = function(row)
    return {decode = octets, scale = without_status, scaled_float = row.pack == "f"}
  end,
  date = function() return {decode = integers, scale = date_and_time} end,
  time_of_day = function() return {decode = integers, scale = time_of_day} end,
  duration = function() return {decode = integers, scale = duration, scaled_float = true} end,
  zero = function() return {decode = function() return {} end} end,
  number = function(row)
    return {decode = decode[row.pack], scale = row.divide and ratio, scaled_float = row.divide ~= nil}
  end,
}

--- The codec of a format code, nil where the length of its values cannot be known.
-- @param code a code of tables.formats, dialects already resolved
-- @param size bytes per value where the format has two sizes; its own otherwise
-- @return {size, decode, scale (nil: the format has none), whole, float (values are floats), scaled_float,
--   multiply, divide}; decode(raw, count, size) and scale(values, raw, codec) give arrays
function M.codec(code, size)
  local row = tables.formats[code]
  if not (row and row.size and make[row.kind]) then return nil end
  local codec = make[row.kind](row)
  codec.size, codec.whole = size or row.size, row.whole
  codec.multiply, codec.divide = row.multiply or 1, row.divide
  return codec
end

local codes -- format name -> code

--- The code of a format by its name; nil of a name that no format has.
function M.code_of(name)
  if not codes then
    codes = {}
    for code, row in pairs(tables.formats) do codes[row.name] = code end
  end
  return codes[name]
end

local function whole_or_float(number)
  if number % 1 ~= 0 then return float_text(number) end
  return whole_text(number)
end

-- Name of a format -> what makes the text of a number of it, of a physical value; nil where it is no float.
local float_texts, scaled_texts

local function prepare_texts()
  float_texts, scaled_texts = {}, {}
  for _, row in pairs(tables.formats) do
    local kind = row.kind
    float_texts[row.name] = kind == "float" and float_text or nil
    if kind == "number" or kind == "duration" or kind == "with_status" and row.pack == "f" then
      scaled_texts[row.name] = float_text -- plain ones by a description
    end
  end
end

--- What makes the text of the numbers of a format: a function of a number. A float always has a point or an
-- exponent there, an integer never, as in Python; the format says which it is: Lua 5.2 has one kind of number
-- only.
function M.text_of(format_name, scaled)
  if not float_texts then prepare_texts() end
  return (scaled and scaled_texts or float_texts)[format_name or ""] or whole_or_float
end

--- A number as Python shows it.
function M.number_text(number, format_name, scaled) return M.text_of(format_name, scaled)(number) end

--- A value of a block as an argument of a finding; nil stays nil.
function M.argument(value, block)
  if type(value) ~= "number" then return value end
  return json.raw(M.number_text(value, block.format_name))
end

--- Whether a block has floats for which no drive has a use: denormal, huge, not finite.
function M.is_absurd(block)
  local least = LEAST_NORMAL[block.format]
  for _, value in ipairs(least and block.values or NONE) do
    if type(value) == "string" then return true end -- NaN or infinite
    if value ~= 0 and (abs(value) < least or abs(value) > ABSURD) then return true end
  end
  return false
end

return M
