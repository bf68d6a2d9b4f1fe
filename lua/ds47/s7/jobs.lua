-- Reads and writes of variables with their answers (docs/s7.md 4).
--
-- An answer belongs to the open job of its connection that the other end asked with the same PDU reference.
-- References have no order to rely on, and some clients use one for all: a new job ends the open one of the
-- same.

local model = require("ds47.s7.model")
local ordered = require("ds47.support.ordered")
local pdus = require("ds47.s7.pdu")

local abs, max = math.abs, math.max

local M = {OPERATIONS = {[pdus.READ] = "get", [pdus.WRITE] = "put"}}

local OPERATIONS = M.OPERATIONS

local Jobs = {}
Jobs.__index = Jobs

--- The open jobs of all connections.
-- @param limits  how many may be open, how long, and how many bytes they may take
-- @param listener  is told of each job when it is asked, and when nothing more comes of it:
--   listener:job_asked(job), listener:job_settled(job)
function M.new(limits, listener)
  return setmetatable({
    limits = limits, listener = listener,
    open = ordered.new(), -- in the order in which they were asked
    sides = {}, -- of an end of a connection its open jobs, in the same order
    bytes = 0, number = 0,
  }, Jobs)
end

-- One end of a connection, and a job of it: number of the connection, whether its client asks, reference.
local function side_of(connection, from_client)
  return connection.number * 2 + (from_client and 1 or 0)
end

local function key_of(side, reference)
  return side * 0x10000 + reference
end

local function take(self, key)
  local job = self.open:pop(key)
  if job then
    self.bytes = self.bytes - #job.request
    self.sides[side_of(job.connection, job.from_client)]:pop(key)
  end
  return job
end

local function close(self, job)
  self.listener:job_settled(job)
  job.phase = "closed"
end

local function give_up(self, key)
  local job = take(self, key)
  if job then
    job.state = "unanswered"
    close(self, job)
  end
end

local function expire(self, now)
  while self.open.length > 0 do
    local key, job = self.open:first()
    if abs(now.time_ns - job.asked.time_ns) <= self.limits.call_expiry_ns then return end
    give_up(self, key)
  end
end

-- Keeps a job; of too many, or too many bytes, the oldest goes.
local function keep(self, side, key, job)
  local own = self.sides[side] or ordered.new()
  self.sides[side] = own
  self.open:set(key, job)
  own:set(key, job)
  self.number = self.number + 1
  job.number = self.number
  self.bytes = self.bytes + #job.request
  local connection = job.connection
  connection.most_open = max(connection.most_open, own.length)
  self.listener:job_asked(job)
  if own.length > self.limits.s7_jobs then give_up(self, own.oldest) end
  while self.bytes > self.limits.s7_bytes do give_up(self, self.open.oldest) end
end

--- A read or a write.
function Jobs:asked(connection, from_client, pdu, at)
  local found, side = pdus.variables(pdu), side_of(connection, from_client)
  local key = key_of(side, pdu.reference)
  give_up(self, key)
  expire(self, at)
  keep(self, side, key, model.job({
    operation = OPERATIONS[pdu.service], connection = connection, from_client = from_client,
    reference = pdu.reference, asked = at, items = found.items, request = pdu.data, groups = found.groups,
    flaws = pdu.flaws,
  }))
end

-- An answer to which there is no job.
local function orphan(self, connection, from_client, pdu, at)
  local items = {}
  for number, each in ipairs(pdus.results(pdu)) do items[number] = model.item(nil, each.data, each.code) end
  close(self, model.job({
    operation = OPERATIONS[pdu.service], connection = connection, from_client = not from_client,
    reference = pdu.reference, items = items, answered = at, response = pdu.data, error = pdu.error,
    state = "orphan", answer_flaws = pdu.flaws,
  }))
end

-- What came of a job whose answer says something of its items.
local function state_of(items)
  local done = 0
  for _, item in ipairs(items) do
    if item.code == model.DONE then done = done + 1 end
  end
  if done == #items then return "ok" end
  return done > 0 and "partial" or "error"
end

-- An answer and its job.
local function settle(job, pdu, at)
  job.answered, job.response, job.error = at, pdu.data, pdu.error
  local told = pdu.service and pdus.results(pdu) or {}
  job.answer_flaws = pdu.flaws
  if pdu.error and pdu.error ~= 0 then
    job.state = "refused"
    return
  end
  for _, flaw in ipairs(pdus.settle(job, told)) do table.insert(job.answer_flaws, flaw) end
  job.state = state_of(job.items)
end

--- An answer; false where it is none to a read or a write.
function Jobs:answered(connection, from_client, pdu, at)
  local key = key_of(side_of(connection, not from_client), pdu.reference)
  local job, operation = self.open:get(key), OPERATIONS[pdu.service]
  if operation and (not job or operation ~= job.operation) then
    orphan(self, connection, from_client, pdu, at)
    return true
  end
  if not job or pdu.service and not operation then return false end
  take(self, key)
  settle(job, pdu, at)
  close(self, job)
  return true
end

--- Bytes of a connection are lost: the answers to its open jobs may be among them.
function Jobs:lose(connection)
  for _, from_client in ipairs({true, false}) do
    local own = self.sides[side_of(connection, from_client)]
    if own then
      for _, job in own:iterate() do job.lost = true end
    end
  end
end

--- A connection is over.
function Jobs:close(connection)
  local sides, jobs = {side_of(connection, true), side_of(connection, false)}, {}
  for _, side in ipairs(sides) do
    for _, job in (self.sides[side] or ordered.new()):iterate() do jobs[#jobs + 1] = job end
  end
  table.sort(jobs, function(a, b) return a.number < b.number end)
  for _, job in ipairs(jobs) do
    give_up(self, key_of(side_of(connection, job.from_client), job.reference))
  end
  for _, side in ipairs(sides) do self.sides[side] = nil end
end

return M
