-- Connections of S7: TPDUs and PDUs to what was agreed, to jobs, and to what the ends say of themselves.
--
-- Takes the segments of TCP (tcp.lua, tpkt.lua), gives each PDU to jobs.lua, transfers.lua or szl.lua, and
-- counts the rest. What is wrong with it is said elsewhere.

local jobs = require("ds47.s7.jobs")
local model = require("ds47.s7.model")
local pdus = require("ds47.s7.pdu")
local szl = require("ds47.s7.szl")
local tcp = require("ds47.s7.tcp")
local tpkt = require("ds47.s7.tpkt")
local transfers = require("ds47.s7.transfers")

local M = {}

local ONE_BSEND = 1 -- subfunction of a BSEND in its group
local READ_SZL = 1 -- subfunction of reading an SZL in the group of the CPU
local EVIDENCE = 8 -- what is kept of what a server says of itself
local OPERATIONS = jobs.OPERATIONS
local CR, DR, DT = tpkt.CR, tpkt.DR, tpkt.DT
local TOLD = {[tpkt.CR] = true, [tpkt.CC] = true, [tpkt.DR] = true, [tpkt.DT] = true}

local Connections = {}
Connections.__index = Connections

--- All connections of a capture.
-- @param ports  of servers, a set
-- @param limits  how much is kept
-- @param listeners  array; each hears, in the order of the frames, of what it has a method for:
--   opened(connection)   a connection has its first S7 PDU, CR or CC
--   agreed(connection)   the setup was answered: `pdu_length` and `parallel` are there
--   refused(connection, why, at, code)  nothing comes of a connection: "no_confirm" (CR without CC),
--                        "disconnect" (DR), "reset" (RST of the server), "setup"; the frame;
--                          reason of DR, error
--                        class and code of the setup, else 0
--   pdu(told)            each whole S7 PDU before anything is made of it: {connection, from_client, at, kind,
--                        size, reference}
--   asked(job)           a request, or the first segment, was seen
--   over(job)            nothing more comes of a job. One that `asked` told of is told to be over later, in
--                        the order in which answers come; an answer without a request is only told to be over
--   touched(job, role)   a "segment" of a BSEND, or an "acknowledge" of one, whose job may be over by that
--   evidence(connection, found)  the server said what it is
--   closed(connection)   a connection is over, or the capture is; its open jobs were told of before
function M.new(ports, limits, listeners)
  local self = setmetatable({
    limits = limits, listeners = listeners, number = 0, all_ = {},
    left_out = 0, -- connections for which there was no room
    frame = 0, place = 0, -- the frame of the last PDU, and its place in it
  }, Connections)
  self.streams = tcp.Streams.new(ports, self, limits.s7_connections, limits.s7_bytes)
  self.jobs = jobs.new(limits, self)
  self.transfers = transfers.new(limits, self)
  return self
end

local function tell(self, name, ...)
  for _, listener in ipairs(self.listeners) do
    if listener[name] then listener[name](listener, ...) end
  end
end

--- The next segment of TCP.
function Connections:feed(segment, at)
  self.streams:feed(segment, at)
end

--- Nothing more comes.
function Connections:finish()
  self.streams:finish()
end

-- Whether a PDU of S7 or S7CommPlus was seen.
local function is_s7(connection)
  local counts = connection.counts
  return connection.plus > 0 or connection.cyclic > 0 or connection.other > 0 or connection.setup ~= nil
    or (connection.asked_pdu or 0) > 0 or counts.jobs > 0 or counts.orphans > 0
end

--- Those of S7, in the order of their first frames; connections of other protocols on its port are none.
function Connections:all()
  local found = {}
  for _, each in ipairs(self.all_) do
    if each.foreign == 0 or is_s7(each) then found[#found + 1] = each end
  end
  return found
end

-- From bytes to PDUs. What is kept of a TCP connection, its `owner`, is a line: {forward, backward (readers),
-- connection, refused, asked (CR), asked_setup (reference of the setup that was not answered yet)}

local function new_line()
  return {forward = tpkt.Reader.new(), backward = tpkt.Reader.new(), refused = false}
end

local function connection_of(self, talk, line, at)
  self.number = self.number + 1
  line.connection = model.connection(self.number, talk, at)
  if #self.all_ < self.limits.s7_told then
    self.all_[#self.all_ + 1] = line.connection
  else
    self.left_out = self.left_out + 1
  end
  tell(self, "opened", line.connection)
  return line.connection
end

local function refuse(self, line, connection, why, at, code)
  if not line.refused then
    line.refused = true
    tell(self, "refused", connection, why, at, code or 0)
  end
end

-- What a PDU is

local function take_job(self, line, connection, from_client, pdu, at)
  if OPERATIONS[pdu.service] then
    self.jobs:asked(connection, from_client, pdu, at)
    return true
  end
  local found = pdu.service == pdus.SETUP and pdus.setup(pdu)
  if not found then return false end
  connection.asked_pdu, connection.asked_parallel = found.pdu_length, found.calling
  line.asked_setup = pdu.reference
  return true
end

local function take_answer(self, line, connection, from_client, pdu, at)
  if self.jobs:answered(connection, from_client, pdu, at) then return true end
  if (pdu.error or 0) ~= 0 and pdu.reference == line.asked_setup then
    line.asked_setup = nil
    refuse(self, line, connection, "setup", at, pdu.error)
    return true
  end
  local found = pdu.service == pdus.SETUP and pdus.setup(pdu)
  if not found then return false end
  line.asked_setup = nil
  connection.pdu_length, connection.parallel, connection.setup = found.pdu_length, found.calling, at
  tell(self, "agreed", connection)
  return true
end

local function take_szl(self, connection, told, at)
  for _, found in ipairs(szl.evidence(told, at)) do
    local known = #connection.evidence >= EVIDENCE
    for _, each in ipairs(connection.evidence) do known = known or each.name == found.name end
    if not known then
      connection.evidence[#connection.evidence + 1] = found
      tell(self, "evidence", connection, found)
    end
  end
end

-- A segment of a BSEND, or an acknowledgement.
local function take_bsend(self, connection, from_client, pdu, told, at)
  if told.type ~= pdus.REQUEST then
    return self.transfers:acknowledged(connection, from_client, pdu, told, at)
  end
  local part = pdus.segment(pdu, told)
  if part then self.transfers:sent(connection, from_client, pdu, part, at) end
  return part ~= nil
end

local function take_user_data(self, connection, from_client, pdu, at)
  local sent = pdus.usend(pdu)
  if sent then
    self.transfers:usend(connection, from_client, pdu, sent, at)
    return true
  end
  local told = pdus.user_data(pdu)
  if not told then return false end
  if told.group == pdus.PROGRAM and told.subfunction == ONE_BSEND then
    return take_bsend(self, connection, from_client, pdu, told, at)
  elseif told.group == pdus.CYCLIC then
    connection.cyclic = connection.cyclic + 1
    return true
  elseif told.group == pdus.CPU and told.subfunction == READ_SZL and told.type == pdus.RESPONSE then
    take_szl(self, connection, told, at)
  end
  return false
end

local function take_data(self, line, connection, from_client, whole)
  local first, at = whole.data:byte(), whole.at
  if first ~= pdus.PROTOCOL then
    local name = first == pdus.PLUS and "plus" or "foreign"
    connection[name] = connection[name] + 1
    return
  end
  self.place = at.frame == self.frame and self.place + 1 or 0
  self.frame = at.frame
  local pdu, known = pdus.decode(whole.data), false
  if pdu.kind then
    tell(self, "pdu", {
      connection = connection, from_client = from_client, at = at, kind = pdu.kind, size = pdu.size,
      reference = pdu.reference,
    })
    if pdu.kind == pdus.JOB then
      known = take_job(self, line, connection, from_client, pdu, at)
    elseif pdu.kind == pdus.ACKNOWLEDGE or pdu.kind == pdus.ANSWER then
      known = take_answer(self, line, connection, from_client, pdu, at)
    elseif pdu.kind == pdus.USER_DATA then
      known = take_user_data(self, connection, from_client, pdu, at)
    end
  end
  connection.other = connection.other + (known and 0 or 1)
end

-- CR or CC.
local function take_opening(line, connection, tpdu, at)
  connection.client_tsap = (tpdu.calling or "") ~= "" and tpdu.calling or connection.client_tsap
  connection.server_tsap = (tpdu.called or "") ~= "" and tpdu.called or connection.server_tsap
  connection.tpdu_size = tpdu.size or connection.tpdu_size
  if tpdu.kind == CR then
    connection.begun, line.asked = true, at
  else
    connection.confirmed = at
  end
end

local function take_tpdu(self, talk, line, from_client, whole)
  local tpdu, at = whole.tpdu, whole.at
  local kind = tpdu.kind
  if not TOLD[kind or 0] or kind == DT and whole.data == "" then return end
  local connection = line.connection or connection_of(self, talk, line, at)
  if at.frame > connection.last.frame then connection.last = at end
  if kind == DT then
    take_data(self, line, connection, from_client, whole)
  elseif kind == DR then
    if line.asked and not connection.confirmed then
      refuse(self, line, connection, "disconnect", at, tpdu.reason)
    end
  else
    take_opening(line, connection, tpdu, at)
  end
end

--- A piece of what an end sends, as tcp.lua tells of it.
function Connections:take(talk, from_client, piece)
  local line = talk.owner or new_line()
  talk.owner = line
  local reader = from_client and line.forward or line.backward
  local before = reader.lost
  for _, whole in ipairs(reader:take(piece)) do take_tpdu(self, talk, line, from_client, whole) end
  local connection = line.connection
  if reader.lost > before and connection then
    connection.lost_bytes = connection.lost_bytes + reader.lost - before
    self.jobs:lose(connection)
    self.transfers:lose(connection)
  end
  talk.kept = line.forward:held() + line.backward:held()
end

--- A TCP connection is over, as tcp.lua tells of it.
function Connections:talk_over(talk, reset, at)
  local line = talk.owner
  if not line then
    if reset and talk.begun then
      line = new_line()
      talk.owner = line
      refuse(self, line, connection_of(self, talk, line, at), "reset", at)
    end
    return
  end
  local connection = line.connection
  if not connection then return end
  if line.asked and not connection.confirmed and not is_s7(connection) then
    refuse(self, line, connection, reset and "reset" or "no_confirm", line.asked)
  end
  self.jobs:close(connection)
  self.transfers:close(connection)
  connection.closed = true
  tell(self, "closed", connection)
  talk.owner = nil
end

-- What becomes of jobs

--- A job begins, as jobs.lua and transfers.lua tell.
function Connections:job_asked(job)
  job.place = self.place
  tell(self, "asked", job)
end

-- One more job is over.
local function count(counts, job)
  local state, operation, size = job.state, job.operation, 0
  local function add(name, yes) counts[name] = counts[name] + (yes and 1 or 0) end
  add("jobs", state ~= "orphan")
  add("refused", state == "error" or state == "partial" or state == "refused")
  add("unanswered", state == "unanswered")
  add("orphans", state == "orphan")
  for _, item in ipairs(job.items) do
    local done = item.code == model.DONE or item.code == nil and operation ~= "put"
    if done and item.value then size = size + #item.value end
  end
  local name = operation == "get" and "read" or operation == "put" and "written" or "sent"
  counts[name] = counts[name] + size
  local took = job:duration_ns()
  if took then
    counts.least_ns = (counts.timed == 0 or took < counts.least_ns) and took or counts.least_ns
    counts.most_ns = (counts.timed == 0 or took > counts.most_ns) and took or counts.most_ns
    counts.timed, counts.total_ns = counts.timed + 1, counts.total_ns + took
  end
end

--- Something of a job that is open, as transfers.lua tells.
function Connections:job_touched(job, role)
  tell(self, "touched", job, role)
end

--- A job is over, as jobs.lua and transfers.lua tell.
function Connections:job_settled(job)
  if job.state == "orphan" and not job.segments[1] then job.place = self.place end
  count(job.connection.counts, job)
  tell(self, "over", job)
end

return M
