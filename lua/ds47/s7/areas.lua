-- What jobs read and write: bytes of memories, and areas that are split over jobs (docs/s7.md 6).
--
-- What happened to these bytes is known by memory.lua; whether a split area is whole is decided in
-- consistency.lua, which says what an access is.

local addresses = require("ds47.s7.addresses")
local model = require("ds47.s7.model")
local room = require("ds47.spec.s7").room

local floor, insert = math.floor, table.insert

local M = {}

local BITS, INSTANCE = 0x83, 0x85
local MEMORIES = {[BITS] = true, [model.DB] = true, [INSTANCE] = true} -- areas that keep what is written
local MOST = 0x10000 -- bytes of a memory: addresses behind it are looked at no more
local FULL = 90 -- percent of the room of its PDU from which a job is a part of a larger area

--- One byte as text: DB1.DBB7.
function M.byte_text(area, db, at)
  return addresses.text(model.address(area, db, 8 * at, 8, 1))
end

-- One address for areas of which each begins where the one before ends.
local function joined(found)
  local first, count, bytes = found[1], 0, 0
  for _, each in ipairs(found) do count, bytes = count + each.count, bytes + each:length() end
  if model.ELEMENTS[first.area] then
    return model.address(first.area, first.db, first.start, first.size, count)
  end
  return model.address(first.area, first.db, first.start, 8, bytes)
end

-- Accesses

--- Whether it is known which bytes a PUT writes.
function M.is_clear(job)
  for _, each in ipairs(job.items) do
    local address = each.address
    if not address or address.size == 0 or each.value == nil and MEMORIES[address.area] then return false end
  end
  return true
end

local function access_of(job, item, address, number)
  local write, done = job.operation == "put", item.code == model.DONE and job.answered ~= nil
  local whole = address.size >= 8 and address.start % 8 == 0
  if not job.asked or not item.value or not (write or done and whole) then return nil end
  local start, last, data = floor(address.start / 8), floor((address:last() + 7) / 8), item.value
  if last > MOST then return nil end
  if not whole or #data ~= last - start then
    if not write then return nil end
    data, whole = ("\0"):rep(last - start), false
  end
  local answer = job.answered
  return {
    order = number, connection = job.connection.number, write = write,
    area = address.area == INSTANCE and model.DB or address.area, db = address.db, start = start, last = last,
    data = data, asked_ns = job.asked.time_ns, answered_ns = answer and answer.time_ns or nil,
    request = job.asked.frame, response = answer and answer.frame or nil, sure = done, known = whole,
  }
end

--- What a GET or PUT with a request does to memories that keep what is written: array.
-- @param job  with its answer, or still without one
-- @param first  the number of the first access
function M.accesses(job, first)
  local found = {}
  for number, item in ipairs(job.items) do
    local address = item.address
    if address and MEMORIES[address.area] and address.size > 0 then
      insert(found, access_of(job, item, address, first + number - 1))
    end
  end
  return found
end

-- Areas that are split. A part is {job, first (the number of its first access)}.

-- An area that was read or written by several jobs, one after the other.
local Whole = {}
Whole.__index = Whole

-- The number among the items of a part of the one that belongs to the area: the one at its border.
local function border(self, part)
  return part == self.parts[1] and #part.job.items or 1
end

--- All of it.
function Whole:address()
  local found = {}
  for _, part in ipairs(self.parts) do insert(found, part.job.items[border(self, part)].address) end
  return joined(found)
end

--- What its parts do to a memory; not of each there is one.
function Whole:accesses()
  local found = {}
  for _, part in ipairs(self.parts) do
    local number = part.first + border(self, part) - 1
    for _, each in ipairs(M.accesses(part.job, part.first)) do
      if each.order == number then insert(found, each) end
    end
  end
  return found
end

local function whole_of(parts)
  if #parts < 2 then return nil end
  for _, each in ipairs(parts) do
    if each.job.state ~= "ok" then return nil end
  end
  return setmetatable({parts = parts}, Whole)
end

-- Whether a job has so much data that its PDU has no room for more; never without the setup.
local function fills(job)
  local length, bytes, operation = job.connection.pdu_length, 0, job.operation
  if not length or operation ~= "get" and operation ~= "put" or not job.items[1] then return false end
  for _, each in ipairs(job.items) do bytes = bytes + (each.address and each.address:length() or 0) end
  local most = room(operation, length, #job.items)
  return most > 0 and 100 * bytes >= FULL * most
end

local Splits = {}
Splits.__index = Splits

--- Finds areas that one side of a connection splits over jobs.
-- @param most_ns  from the answer of a part to the request of the next at the most
-- @param most  parts of an area at the most
function M.splits(most_ns, most)
  return setmetatable({most_ns = most_ns, most = most, parts = {}}, Splits)
end

-- Whether the last part of an area is one, as far as a job behind it can tell.
local function is_part(self, last)
  if not fills(last) or #self.parts > 1 and #last.items > 1 then return false end
  return last.state == "ok" or last.state == "unanswered" and last.phase == "open"
end

-- Whether a job begins where the one before ends, and that one filled its PDU.
local function continues(self, job)
  local last = self.parts[#self.parts].job
  if job.operation ~= last.operation or not job.items[1] or not is_part(self, last) then return false end
  local since = last.answered or last.asked
  if not since or not job.asked or job.asked.time_ns - since.time_ns > self.most_ns then return false end
  local before, behind = last.items[#last.items].address, job.items[1].address
  if not before or not behind or before.size == 0 then return false end
  if not model.ELEMENTS[behind.area] and behind:last() > 8 * MOST then return false end
  return before:memory() == behind:memory() and before:last() == behind.start
end

--- A GET or PUT was asked for; the area that is complete by that, nil for none.
function Splits:asked(part)
  local before = self.parts
  if before[1] and #before < self.most and continues(self, part.job) then
    insert(before, part)
    return nil
  end
  self.parts = {part}
  return whole_of(before)
end

--- A job is over; the area of which it is the last part, as it does not fill its PDU. Nil for none.
function Splits:over(job)
  local last = self.parts[#self.parts]
  if not last or last.job ~= job or job.state == "ok" and fills(job) then return nil end
  return self:finish()
end

--- Nothing more comes; the area that is complete, nil for none.
function Splits:finish()
  local parts = self.parts
  self.parts = {}
  return whole_of(parts)
end

return M
