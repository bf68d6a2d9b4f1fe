-- What is known of S7 communication: addresses, items, jobs, connections (docs/s7.md).
--
-- Plain values only, which every other module of this room fills or reads; nothing is decoded, paired or
-- judged here. A frame is {frame, time_ns} wherever something stands in the capture: called `at`. A flaw is
-- {kind, offset, args}, its words are in spec/s7.lua; an end of a connection is {ip, port}.

local floor = math.floor

local M = {
  DB = 0x84, -- the area of data blocks; all others have no number
  DONE = 0xFF, -- the return code of an item that went well
  ELEMENTS = {[0x1C] = true, [0x1D] = true}, -- areas whose addresses are numbers of elements
}

-- What an item names: `start` counts bits, in timers and counters elements; `count` elements of `size` bits,
-- 0 where that is not known; `transport` is the transport size of the item.
local Address = {}
Address.__index = Address

function M.address(area, db, start, size, count, transport)
  return setmetatable({
    area = area, db = db, start = start, size = size, count = count, transport = transport or 2,
  }, Address)
end

--- What two addresses have in common that can overlap: a number.
function Address:memory()
  return self.area * 0x10000 + self.db
end

--- The first bit behind it, in timers and counters the first element.
function Address:last()
  return self.start + self.count * (M.ELEMENTS[self.area] and 1 or self.size)
end

--- Bytes of its data.
function Address:length()
  return floor((self.count * self.size + 7) / 8)
end

--- One variable of a job, or one area of a USEND; the data of a BSEND is one item.
-- @param address  nil where nothing of the request is known, where its syntax is an unknown one, and in what
--   is sent
-- @param value  what was read, written or sent; nil where it is not there
-- @param code  what the partner answered; nil without an answer, and in what is sent
-- @param syntax  of the address, where it is an unknown one
function M.item(address, value, code, syntax)
  return {address = address, value = value, code = code, syntax = syntax}
end

return M
