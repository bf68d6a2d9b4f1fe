-- One readable line per request, as `ds47 encode` takes it: change ref 2 axis 2 p50304=Float32:100.0
-- The notation is described in python/ds47/profidrive/notation.py. Here lines are written only; hexadecimal
-- text and reading a line are the command line's.

local formats = require("ds47.profidrive.formats")
local json = require("ds47.support.json")
local naming = require("ds47.profidrive.naming")
local numbers = require("ds47.support.numbers")
local tables = require("ds47.spec.tables")

local concat, format, gsub = table.concat, string.format, string.gsub

local M = {}

local VALUE = tables.layouts.ADDRESS_VALUE
local READ, CHANGE = 0x01, 0x02
local OPERATIONS = {[READ] = "read", [CHANGE] = "change"}
local NAN = {f = "\127\192\0\0", d = "\127\248\0\0\0\0\0\0"} -- the one that is written as "NaN"

-- Latin-1 as JSON writes it, in ASCII.
local function quoted(text) return '"' .. gsub(text, '[\0-\31\127-\255"\\]', json.ESCAPES) .. '"' end

local function value_text(value, float)
  if type(value) == "string" then return quoted(value) end
  return float and numbers.float_text(value) or format("%.0f", value)
end

-- Texts come from the bytes: `values` has them as UTF-8.
local function texts(block, row, codec)
  local size, parts = row.whole and #block.raw or codec.size, {}
  for i = 1, #block.values do parts[i] = quoted(block.raw:sub((i - 1) * size + 1, i * size)) end
  return parts
end

-- Whether the values give the same bytes again.
local function writable(block, row, codec)
  if block.error or block.meaning or #block.raw ~= block.value_count * codec.size then return false end
  if not row.whole and #block.values ~= block.value_count then return false end
  if block.pad ~= (#block.raw % 2 == 1 and "\0" or "") then return false end
  for i, value in ipairs(block.values) do
    local at = (i - 1) * codec.size
    if value == "NaN" and row.kind == "float" and block.raw:sub(at + 1, at + codec.size) ~= NAN[row.pack] then
      return false
    end
  end
  return true
end

local function show_block(block)
  local row, codec = tables.formats[block.format], formats.codec(block.format)
  if not codec or not writable(block, row, codec) then return nil end
  local parts = {}
  if row.kind == "text" then
    parts = texts(block, row, codec)
  else
    for i, value in ipairs(block.values) do parts[i] = value_text(value, block.float) end
  end
  return row.name .. ":" .. concat(parts, ",")
end

local function show_parameter(address, block, family)
  local plain = address.attribute == VALUE
  local indexed = address.subindex > 0 or plain and not block and address.element_count > 0
  local implied = block and block.value_count or (indexed or not plain) and 1 or 0
  local text = naming.spelling(address.pnu, family)
  if indexed then text = text .. format("[%d]", address.subindex) end
  if address.element_count ~= implied then text = text .. format("*%d", address.element_count) end
  if not plain then text = text .. "." .. address.attribute_name end
  return text
end

-- Header, addresses and blocks as many as they should be, nothing behind them.
local function is_whole(request)
  local count, blocks = #request.addresses, #request.blocks
  if request.rest ~= "" or count == 0 or count ~= request.parameter_count then return false end
  return blocks == 0 and request.request_id ~= CHANGE or blocks == count and request.request_id ~= READ
end

--- The readable line of a request.
-- @param family whose parameters the drive has; nil where no drive is named
-- @return string, or nil where no line gives the same bytes: cut, bytes left over, odd in its pads, dialects
function M.request_line(request, family)
  if not is_whole(request) then return nil end
  local addresses, blocks = request.addresses, request.blocks
  local bare = not blocks[1]
  local parts = {
    OPERATIONS[request.request_id] or format("0x%02X", request.request_id),
    format("ref %d axis %d", request.request_reference, request.axis),
  }
  for i, address in ipairs(addresses) do
    local shown = bare or show_block(blocks[i])
    if not shown then return nil end
    parts[#parts + 1] = show_parameter(address, blocks[i], family) .. (bare and "" or "=" .. shown)
  end
  return concat(parts, " ")
end

return M
