-- The usual frame at a glance: its sentence, before anybody has analysed it.
--
-- While a file is read most frames need nothing but the text of their Info column, and nearly all belong
-- to transactions of four frames that are built alike. A glance knows such a frame by its bytes, follows the
-- transaction, and says what the analysis would say of the frame now. The frame itself waits (waiting.lua):
-- it is analysed when somebody asks for more, or when a frame comes that is not usual (`catch_up`). So
-- nothing here has to be complete: what is in doubt is no usual frame. It must only never be wrong.
--
-- What the glance knows it learns from frames that were analysed: how the frames of a conversation are built
-- (forms.lua), and which channels are free. Sentences of messages are in gist.lua.

local forms = require("ds47_ws.forms")
local gist = require("ds47_ws.gist")
local info = require("ds47_ws.info")
local records = require("ds47.records")
local recordcalls = require("ds47.recordcalls")
local rpc = require("ds47.rpc")
local is_near = require("ds47.times").is_near
local waiting = require("ds47_ws.waiting")

local byte, floor, sub = string.byte, math.floor, string.sub
local DIGITS = info.DIGITS
local WRITE_ACCEPTED, FETCH_RESPONSE = info.PROTOCOL .. info.ACCEPTED, info.PROTOCOL .. info.FETCHED
local sequence = forms.sequence

local M = {}

--- Forms, channels and conversations that are known together; then all are learnt again.
M.MOST = 8192

local FREE, ASKED, ACCEPTED, FETCHED, UNKNOWN = 1, 2, 3, 4, 5
local NONE = {}
local NOTHING = false -- asked for: the next frame is to be a request

local Glance = {}
Glance.__index = Glance

--- Knows nothing yet of the capture that an analysis reads (ds47.analysis).
function M.new(analysis)
  local limits = analysis.judge.limits
  local self = setmetatable({
    analysis = analysis, judge = analysis.judge, gist = gist.new(analysis),
    -- Nothing that is older can be part of a usual transaction; far from where the analysis gives up.
    patience_ns = floor(limits.call_expiry_ns / 2), copy_ns = limits.copy_ns,
    most_activities = floor(limits.activities / 2),
    waiting = waiting.new(),
  }, Glance)
  self:reset()
  return self
end

--- Forgets everything, as after a frame that the glance was not shown.
function Glance:reset()
  if self.written == nil and self.forms then
    return -- nothing learnt since the last time
  end
  self.forms = forms.new(M.MOST)
  self.channels, self.activities = {}, {}
  self.known = 0 -- of these two together
  self.newest_ns = -math.huge -- nothing that is older is usual
  self.written = nil -- PNUs that a change may have written
  self.changes = (self.changes or 0) + 1 -- how often that grew or began anew
end

-- Looking

local steps = {}

-- What a frame of this form says; nil where it does not come as usual.
function Glance:_usual(form, number, frame, clock)
  local activity, channel, answers = form.activity, form.channel, form.answers
  local seq = sequence(form, frame)
  if activity.seq ~= seq or activity.asked ~= answers then
    return nil
  end
  local time_ns = clock(self.analysis)
  if not is_near(time_ns) or time_ns < self.newest_ns or time_ns - channel.time_ns > self.patience_ns then
    return nil
  end
  local text, found = form.step(self, channel, form, number, time_ns, frame)
  if text then
    activity.asked = form.asks
    if answers then
      activity.seq = seq + 1
    end
    self.newest_ns, channel.time_ns = time_ns, time_ns
    self.waiting:add(form, number, time_ns, seq, frame)
  end
  return text, found
end

--- What a frame says, or nil where that has to be found out with care; then `learn` from it.
-- @param number, frame  its number and its bytes
-- @param offset where its IP header begins, from 0, if it has one
-- @param clock  a function of the analysis that gives its time
-- @return the text of its Info column; an array of findings
function Glance:look(number, frame, offset, clock)
  local form = self.forms:find(frame, offset)
  if form then
    return self:_usual(form, number, frame, clock)
  end
  return nil
end

--- How many bytes of frames that wait stand in long strings.
function Glance:bytes()
  return self.waiting.bytes
end

--- Gives the frames that wait to the analysis. Whether there were any.
function Glance:catch_up()
  local list = self.waiting
  if list:is_empty() then
    return false
  end
  self.waiting = waiting.new()
  list:hand_over(self.analysis)
  return true
end

-- Notes that these PNUs may be written now.
local function note_written(self, pnus)
  for _, pnu in ipairs(pnus) do
    if not self.written[pnu] then
      self.written[pnu], self.changes = true, self.changes + 1
    end
  end
end

-- Whether values that somebody wrote may come back with the answer: they are compared then.
local function may_read_back(self, question)
  if question.checked ~= self.changes then
    question.checked, question.reads_back = self.changes, false
    for _, pnu in ipairs(question.pnus) do
      question.reads_back = question.reads_back or self.written[pnu] or false
    end
  end
  return question.reads_back
end

function steps.write_request(self, channel, form, number, time_ns, frame)
  local front, length, peer = form.front, form.data, form.peer
  local reference = byte(frame, front + 1)
  local limit = self.judge.longest:get(peer.device)
  if channel.state ~= FREE or reference == 0 or reference == channel.reference
    or limit and length > limit then
    return nil
  end
  local question, text = self.gist:request(frame, front, length, peer, channel.question)
  if not question or not question.change and may_read_back(self, question) then
    return nil
  elseif question.change then
    note_written(self, question.pnus)
  end
  channel.state, channel.reference, channel.question = ASKED, reference, question
  channel.number, channel.frame, channel.front, channel.length = number, frame, front, length
  channel.asked_ns = time_ns
  return text, NONE
end

function steps.write_response(_, channel, _, _, time_ns)
  if channel.state ~= ASKED then
    return nil
  end
  channel.state, channel.accepted_ns = ACCEPTED, time_ns
  return WRITE_ACCEPTED .. DIGITS[channel.reference], NONE
end

function steps.read_request(_, channel, _, _, time_ns)
  if channel.state ~= ACCEPTED then
    return nil
  end
  channel.state, channel.fetched_ns = FETCHED, time_ns
  return FETCH_RESPONSE .. DIGITS[channel.reference] .. channel.question.object, NONE
end

function steps.read_response(self, channel, form, number, time_ns, frame)
  local front = form.front
  if channel.state ~= FETCHED or byte(frame, front + 1) ~= channel.reference then
    return nil
  end
  local drive_ns = time_ns - channel.fetched_ns + channel.accepted_ns - channel.asked_ns
  channel.state = FREE
  return self.gist:answer(channel, number, time_ns, frame, front, form.data, drive_ns > self.judge.slow_ns)
end

-- Learning

--- Takes note of a frame that was analysed just now.
-- @param frame, time_ns its bytes and its time
-- @param offset where its IP header begins; nil where the message was put together from fragments
function Glance:learn(frame, offset, time_ns)
  local live = self.analysis
  local pdu = live.last_pdu
  if self.known + self.forms.count > M.MOST then
    self:reset()
  end
  if not is_near(time_ns) then
    self:reset()
    return
  end
  self.newest_ns = math.max(self.newest_ns, time_ns)
  self.written = self.written or self.judge:written_pnus()
  if pdu == nil then
    return
  elseif pdu.opnum == rpc.CONNECT or pdu.opnum == rpc.RELEASE then
    self:reset()
    return
  elseif live.last_call == nil then -- a response before its request: its copy is no answer
    self.newest_ns = math.max(self.newest_ns, time_ns + self.copy_ns + 1)
  end
  local touched, count = live:touched()
  for each = 1, count do
    self:_settle(touched[each].job, time_ns)
  end
  local form = count == 1 and offset and self:_form(pdu, touched[1], frame, offset) or nil
  self:_follow(pdu, form)
end

-- Of a job that was touched: whether its channel is free now, and what it may have written.
function Glance:_settle(job, time_ns)
  local message = job.message
  if message and message.operation == "change" then
    note_written(self, gist.pnus(message))
  end
  local key = records.channel_key(job.peer, job.record)
  local channel, live = self.channels[key], self.analysis.pairing.channels:get(key)
  if channel == nil then
    channel = { state = UNKNOWN, read = {}, write = {} } -- the calls are known by a table of their own
    self.channels[key], self.known = channel, self.known + 1
  end
  local free = live and live.last and not live.open and not live.refused and #live.asked == 0
  channel.state, channel.reference = free and FREE or UNKNOWN, live and live.reference
  channel.time_ns = time_ns
end

-- Where the conversation of a frame stands after it: the sequence number of the next request and NOTHING, or
-- of the request that is open and what its form asks; nil where it is not usual.
local function stands(calls, pdu, form)
  local top, open = -1, nil
  for seq, call in calls:iterate() do
    top = math.max(top, seq)
    if call.response == nil then
      if open or call.request ~= pdu then
        return nil, NOTHING
      end
      open = seq
    end
  end
  if open then
    return form and open, form and form.asks
  end
  return top + 1, NOTHING
end

function Glance:_activity(conversation)
  local activity = self.activities[conversation]
  if activity == nil then
    activity = { seq = nil, asked = NOTHING }
    self.activities[conversation], self.known = activity, self.known + 1
  end
  return activity
end

function Glance:_follow(pdu, form)
  local activities = self.analysis.calls.activities
  local known, activity = activities:get(pdu.conversation), self:_activity(pdu.conversation)
  activity.seq, activity.asked = nil, NOTHING
  if known and activities.length <= self.most_activities then
    activity.seq, activity.asked = stands(known.calls, pdu, form)
  end
end

-- Roles of usual frames -> begin of the record block, whether the record has data, which call they ask or
-- answer.
local ROLES = {
  write_request = { block = "\0\8", data = true, asks = "write", opnum = rpc.WRITE },
  write_response = { block = "\128\8", answers = "write", opnum = rpc.WRITE },
  read_request = { block = "\0\9", asks = "read", opnum = rpc.READ },
  read_response = { block = "\128\9", data = true, answers = "read", opnum = rpc.READ },
}

-- The one record of a call whose frame is built as usual; nil for all others.
local function usual_record(live, pdu, role)
  local call = live.last_call
  local list = call and call.context and call.context.records or NONE
  local record, body = list[1], pdu.body
  if #list ~= 1 or record.position ~= 0 or pdu.opnum ~= role.opnum or pdu.missing ~= 0 or pdu.fragmented
    or sub(body, 21, 22) ~= role.block then
    return nil
  end
  local half = role.answers and record.response or record.request
  if half.missing ~= 0 or role.answers and (half.status ~= 0 or sub(body, 1, 4) ~= "\0\0\0\0") then
    return nil
  elseif role.data then
    return #half.data > 0 and #half.data == #body - forms.BODY and record or nil
  end
  return #body == forms.BODY and record or nil
end

-- Takes the form of a frame that touched one job; nil where it is not built as usual.
function Glance:_form(pdu, touched, frame, offset)
  local role, job = ROLES[touched.role], touched.job
  local stop = role and usual_record(self.analysis, pdu, role) and forms.end_of(pdu, frame, offset)
  if not stop then
    return nil
  end
  local channel = self.channels[records.channel_key(job.peer, job.record)]
  local form = {
    step = steps[touched.role], channel = channel, activity = self:_activity(pdu.conversation),
    asks = role.asks and channel[role.asks] or NOTHING,
    answers = role.answers and channel[role.answers] or NOTHING,
    peer = recordcalls.peer(self.analysis.last_call.request), little = pdu.little,
    source = pdu.source, destination = pdu.destination, source_mac = pdu.source_mac,
  }
  self.forms:add(form, frame, offset, stop)
  return form
end

return M
