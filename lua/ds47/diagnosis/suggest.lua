-- Corrected requests: how they are made from the one that was sent, and how they are shown.
--
-- Which correction a request needs is decided elsewhere (transaction.lua, repair.lua, refusal.lua,
-- length.lua). Numbers of parameters begin with 1 here.

local notation = require("ds47.profidrive.notation")
local of_pkw = require("ds47.cyclic.notation")
local parameter = require("ds47.profidrive.parameter")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")

local byte, char, find, format, gsub = string.byte, string.char, string.find, string.format, string.gsub
local rep, sub = string.rep, string.sub
local concat, floor, max = table.concat, math.floor, math.max

local M = {}

local PER_ROW = 4 -- bytes in a row of SCL
local AXIS = 3 -- place of the axis byte, from 1
local ADDRESS = tables.layouts.ADDRESS_SIZE
local BITS_16 = 0xFFFF

-- How a request is shown ----------------------------------------------------------------------------------

--- The 16-bit words as a watch table takes them, the odd last byte on its own: array of `16#0301`.
function M.plc_words(data)
  local found = {}
  for at = 1, #data, 2 do found[#found + 1] = "16#" .. reader.hex(sub(data, at, at + 1)):upper() end
  return found
end

--- SCL that fills an array of bytes named `request`, and `length` for LEN of WRREC. Assignments, because TIA
-- Portal takes those wherever they are pasted in the body of a block.
function M.scl(data)
  local rows = {format("// #request : Array[0..%d] of Byte", max(#data - 1, 0))}
  for start = 0, #data - 1, PER_ROW do
    local row = {}
    for at = start, math.min(start + PER_ROW, #data) - 1 do
      row[#row + 1] = format("#request[%d] := 16#%02X;", at, byte(data, at + 1))
    end
    rows[#rows + 1] = concat(row, " ")
  end
  rows[#rows + 1] = format("#length := %d;", #data)
  return concat(rows, "\n")
end

-- As a POSIX shell takes it.
local function quoted(text)
  if not find(text, "[^%w_@%%+=:,./-]") then return text end
  return "'" .. gsub(text, "'", "'\"'\"'") .. "'"
end

--- The `ds47 encode` line that gives exactly these bytes; nil if none does.
-- @param family whose parameters the drive has; nil where no drive is named
function M.encode_command(data, family)
  local line = notation.request_line(parameter.decode_request(data), family)
  return line and "ds47 encode " .. quoted(line)
end

--- The same of the eight bytes of a request of PKW.
-- @param layout "cyclic" or "uss"
function M.pkw_command(data, layout, family)
  local line = of_pkw.line(data, layout, family)
  return line and "ds47 encode " .. (layout == "uss" and "--pkw-layout uss " or "") .. quoted(line)
end

-- How it is made ------------------------------------------------------------------------------------------

local function address_bytes(address, subindex, elements)
  subindex, elements = subindex or address.subindex, elements or address.element_count
  local number = reader.of_number(address.pnu, 2) .. reader.of_number(subindex, 2)
  return char(address.attribute, elements) .. number
end

local function block_bytes(block) return char(block.format, block.value_count) .. block.raw .. block.pad end

-- A request with the head of another one, of parts that are bytes.
local function encoded(message, addresses, blocks, rest)
  local head = char(message.request_reference, message.request_id, message.axis, #addresses)
  return head .. concat(addresses) .. concat(blocks) .. (rest or "")
end

--- Whether a request changes nothing that must never be changed on somebody's advice.
function M.is_harmless(request)
  if request.operation == "read" then return true end
  if request.operation ~= "change" then return false end
  local never = tables.known.never_written
  for number, address in ipairs(request.addresses) do
    for _, range in ipairs(never.ranges) do
      if address.pnu >= range[1] and address.pnu <= range[2] then return false end
    end
    local block = request.blocks[number]
    for _, value in ipairs(block and block.values or {}) do
      for _, each in ipairs(never.values) do
        if address.pnu == each[1] and value == each[2] then return false end
      end
    end
  end
  return true
end

--- The request with some of its parameters and nothing behind them.
-- @param message a decoded request with a whole header; a change with a block for each parameter
-- @param numbers array of those to keep, in their order
function M.only(message, numbers)
  local addresses, blocks = {}, {}
  for place, number in ipairs(numbers) do
    addresses[place] = address_bytes(message.addresses[number])
    local block = message.blocks[number]
    blocks[#blocks + 1] = block and block_bytes(block)
  end
  return encoded(message, addresses, blocks)
end

--- The request with all of its parameters and nothing behind them.
function M.without_rest(message)
  local numbers = {}
  for number = 1, #message.addresses do numbers[number] = number end
  return M.only(message, numbers)
end

--- The request for another drive object; a request without that byte stays as it is.
function M.with_axis(data, axis)
  if #data < AXIS then return data end
  return sub(data, 1, AXIS - 1) .. char(axis) .. sub(data, AXIS + 1)
end

-- The block with its first `count` values, as bytes; nil of a text or octets, of which no part is meant.
local function shortened(block, count)
  local there, row = block.value_count, tables.formats[block.meaning or block.format]
  if count > there or not row or row.whole or block.error then return nil end
  local raw = sub(block.raw, 1, floor(#block.raw / there) * count)
  return char(block.format, count) .. raw .. rep("\0", #raw % 2)
end

--- The request with another subindex and number of elements for one parameter. A change keeps as many values
-- as there are elements then (0 elements: one value).
-- @param message, data the decoded request and its bytes
-- @return nil where there is no such parameter, the fields do not fit, or the change has too few values or
--   does not decode
function M.with_elements(message, data, number, subindex, elements)
  local old = message.addresses[number]
  if not old or subindex > BITS_16 or elements > 0xFF then return nil end
  local address = address_bytes(old, subindex, elements)
  if message.operation ~= "change" then
    return sub(data, 1, old.offset) .. address .. sub(data, old.offset + ADDRESS + 1)
  elseif not message.shaped then
    return nil
  end
  local addresses, blocks = {}, {}
  for place, each in ipairs(message.addresses) do
    addresses[place] = place == number and address or address_bytes(each)
  end
  for place, each in ipairs(message.blocks) do
    local made = block_bytes(each)
    if place == number then made = shortened(each, max(elements, 1)) end
    if not made then return nil end
    blocks[place] = made
  end
  return encoded(message, addresses, blocks, message.rest)
end

return M
