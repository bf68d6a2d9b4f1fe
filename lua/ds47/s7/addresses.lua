-- Addresses as the programs of a PLC write them: DB1.DBB0..443, DB1.DBX0.3, MW10, T5 (docs/s7.md 3).
--
-- What one stands for is in model.lua; nothing is read here.

local tables = require("ds47.spec.tables")

local floor, format = math.floor, string.format

local M = {}

local BYTE = 8

-- An address with its size and its count, as a pointer of the type ANY.
local function pointer(front, address)
  local size = tables.s7.sizes[address.transport]
  local name = size and size.id or format("size %02X", address.transport)
  local letter = front:find(".", 1, true) and "X" or ""
  return format("P#%s%s%d.%d %s %d", front, letter, floor(address.start / BYTE), address.start % BYTE, name,
    address.count)
end

local function elements(row, address)
  local more = address.count > 1 and format("..%d", address.start + address.count - 1) or ""
  return format("%s%d%s", row.letter, address.start, more)
end

-- One element with its own letter; nil for none that has one.
local function single(row, front, address)
  local size = address.count == 1 and tables.s7.sizes[address.transport]
  local byte, bit = floor(address.start / BYTE), address.start % BYTE
  if not size then return nil end
  if size.bits == 1 then return format("%s%s%d.%d", front, row.numbered and "X" or "", byte, bit) end
  return size.letter and bit == 0 and format("%s%s%d", front, size.letter, byte) or nil
end

--- An address as text: one element with its own letter, several as bytes from and up to. What has no such
-- notation is written as a pointer: P#DB1.DBX0.3 BYTE 4.
function M.text(address)
  local row = tables.s7.areas[address.area]
  if not row then return format("area %02X, %s", address.area, pointer("", address)) end
  if row.elements then return elements(row, address) end
  local front = row.numbered and format("%s%d.%s", row.letter, address.db, row.letter) or row.letter
  local one = single(row, front, address)
  if one then return one end
  local bits, byte = address.count * address.size, floor(address.start / BYTE)
  if address.start % BYTE ~= 0 or bits == 0 or bits % BYTE ~= 0 then return pointer(front, address) end
  return format("%sB%d..%d", front, byte, byte + address:length() - 1)
end

return M
