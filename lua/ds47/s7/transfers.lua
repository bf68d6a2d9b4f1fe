-- What programs send each other: BSEND with its segments and their acknowledgements, and USEND (docs/s7.md
-- 5).
--
-- A BSEND is known by its R_ID until its last segment is acknowledged; each acknowledgement has the PDU
-- reference of its segment. Whether a BRCV of this R_ID takes it, no frame says.

local model = require("ds47.s7.model")
local ordered = require("ds47.support.ordered")

local concat, insert = table.concat, table.insert

-- Segments of a BSEND; one of 65534 bytes has 290 where a PDU has 260 bytes.
local M = {MOST_SEGMENTS = 4096}

local MOST_BYTES = 0x10000

local Transfers = {}
Transfers.__index = Transfers

--- The open BSEND of all connections. One is {job, key, whole (whether its first segment was seen), data
-- (array of bytes), size}.
-- @param limits  how many may be open
-- @param listener  is told of each when it begins, and when nothing more comes of it, and of what comes
--   between: listener:job_asked(job), listener:job_settled(job), listener:job_touched(job, role)
function M.new(limits, listener)
  return setmetatable({
    limits = limits, listener = listener, open = ordered.new(),
    waiting = {}, -- {found, part} by the reference of a segment without acknowledgement
  }, Transfers)
end

-- By the number of the connection, whether its client sends, and the R_ID or the reference.
local function key_of(connection, from_client, number)
  return connection.number .. (from_client and " client " or " server ") .. number
end

local function close(self, found)
  local job = found.job
  self.open:pop(found.key)
  for _, part in ipairs(job.segments) do
    local key = key_of(job.connection, job.from_client, part.reference)
    if self.waiting[key] and self.waiting[key].found == found then self.waiting[key] = nil end
  end
  job.items = {model.item(nil, concat(found.data))}
  self.listener:job_settled(job)
  job.phase = "closed"
end

local function give_up(self, found)
  found.job.state = found.whole and "unanswered" or "orphan"
  close(self, found)
end

-- A new one; the open one of its R_ID, which comes to nothing, is told of behind it.
local function begin(self, key, connection, from_client, pdu, told, at)
  local job = model.job({
    operation = "bsend", connection = connection, from_client = from_client, reference = pdu.reference,
    asked = at, items = {}, r_id = told.r_id, total = told.total,
  })
  local before = self.open:get(key)
  local found = {job = job, key = key, whole = told.total ~= nil, data = {}, size = 0}
  self.listener:job_asked(job)
  if before then give_up(self, before) end
  self.open:set(key, found)
  if self.open.length > self.limits.s7_transfers then
    local _, oldest = self.open:first()
    give_up(self, oldest)
  end
  return found
end

--- A segment of a BSEND.
-- @param told  as pdu.lua has it
function Transfers:sent(connection, from_client, pdu, told, at)
  local key = key_of(connection, from_client, told.r_id)
  local found = self.open:get(key)
  if not found or told.total then found = begin(self, key, connection, from_client, pdu, told, at) end
  local job = found.job
  local part = {
    at = at, size = #told.data, number = told.number, sequence = told.sequence, last = told.last,
    pdu = #pdu.data, reference = pdu.reference,
  }
  insert(job.segments, part)
  for _, flaw in ipairs(pdu.flaws) do insert(job.flaws, flaw) end
  insert(found.data, told.data)
  found.size = found.size + #told.data
  if found.size > MOST_BYTES or #job.segments > M.MOST_SEGMENTS then
    give_up(self, found)
    return
  end
  self.waiting[key_of(connection, from_client, pdu.reference)] = {found = found, part = part}
  self.listener:job_touched(job, "segment")
end

--- An acknowledgement; false where nothing waits for it.
-- @param told  user data, as pdu.lua has it
-- @return whether something waited, and the job
function Transfers:acknowledged(connection, from_client, pdu, told, at)
  local key = key_of(connection, not from_client, pdu.reference)
  local waiting = self.waiting[key]
  if not waiting then return false end
  self.waiting[key] = nil
  local found, part = waiting.found, waiting.part
  local job = found.job
  part.acknowledged, part.assigned, part.error = at, told.sequence, told.error
  for _, flaw in ipairs(pdu.flaws) do insert(job.answer_flaws, flaw) end
  if told.error ~= 0 then
    job.state, job.error, job.answered = "refused", told.error, at
    close(self, found)
  elseif part.last then
    job.error, job.answered = 0, at
    local whole = found.whole and found.size == job.total
    job.state = whole and "ok" or found.whole and "partial" or "orphan"
    close(self, found)
  end
  self.listener:job_touched(job, "acknowledge")
  return true
end

--- A USEND: nothing answers it.
-- @param told  as pdu.lua has it
function Transfers:usend(connection, from_client, pdu, told, at)
  local items = {}
  for number, area in ipairs(told.areas) do items[number] = model.item(nil, area) end
  local job = model.job({
    operation = "usend", connection = connection, from_client = from_client, reference = pdu.reference,
    asked = at, items = items, request = pdu.data, r_id = told.r_id, state = "ok", flaws = pdu.flaws,
  })
  self.listener:job_asked(job)
  self.listener:job_settled(job)
  job.phase = "closed"
end

--- Bytes of a connection are lost: segments or acknowledgements may be among them.
function Transfers:lose(connection)
  for _, found in self.open:iterate() do
    if found.job.connection == connection then found.job.lost = true end
  end
end

--- A connection is over.
function Transfers:close(connection)
  local own = {}
  for _, found in self.open:iterate() do
    if found.job.connection == connection then own[#own + 1] = found end
  end
  for _, found in ipairs(own) do give_up(self, found) end
end

return M
