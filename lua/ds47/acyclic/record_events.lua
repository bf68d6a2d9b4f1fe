-- What happens to a record that may be ours: tells the pairing once the record is known to be ours.
--
-- Takes records from record_calls.lua (RPC) and ms1_calls.lua (PROFIBUS). Holds back what is not known to be
-- ours yet (index47.lua), decodes each request once, and reports a wrong length of a record or a wrong order
-- of the capture (DS106, DS107, DS202).
--
-- What happens to a record is an event: one of the functions under "Events", with up to four arguments
-- (origin, record, detail, peer). The origin says where it happens: {frame, time_ns, peer, missing, cut}, of
-- RPC the PDU; `peer` is the one there. While its AR is open the function is called at once; a table is
-- made only for an event that has to wait. The record of a Write knows the job that was made of it
-- (`record.job`).

local json = require("ds47.support.json")
local index47s = require("ds47.acyclic.index47")
local parameter = require("ds47.profidrive.parameter")
local ordered = require("ds47.support.ordered")
local records = require("ds47.profinet.records")

local half_of, know_peer, is_cut_before_status = records.half, records.know_peer, records.is_cut_before_status
local ar_of = records.ar_of_47
local ALWAYS, SHARED_INDEX = index47s.ALWAYS, index47s.SHARED_INDEX
local passes = index47s.Index47.passes -- for every record

local M = {}

local RecordEvents = {}
RecordEvents.__index = RecordEvents
M.RecordEvents = RecordEvents

--- Tells the pairing what happens to records, once they are known to be ours.
--
-- `counts` says the record requests by index: {[index] = {read = n, write = n}}.
-- @param index47 decides which records are ours
-- @param pairing hears of every Write and Read that is ours
-- @param codec dialects of the messages (options of parameter.lua, or nil)
-- @param listener takes the findings: listener:remark({rule, frame, args, offset}, job or nil)
function RecordEvents.new(index47, pairing, codec, listener)
  return setmetatable({
    index47 = index47, pairing = pairing, codec = codec, listener = listener, counts = {},
    newest_ns = nil, newest_frame = 0, -- time and number of the newest frame of a call that is ours
    limits = ordered.new(), -- name of a limit -> what it pushed out: {frame = of the first, count}
    decode_request = parameter.remembering(codec),
  }, RecordEvents)
end

-- Events: what happens to a record once it is known to be ours

-- Notes the time of the capture; a finding if it steps back.
local function clock(self, origin, record)
  local newest, before, now = self.newest_ns, self.newest_frame, origin.time_ns
  if origin.frame < before then return end -- its AR proved itself late
  if newest and now < newest then
    local args = {milliseconds = json.float((newest - now) / 1e6), first = before}
    self.listener:remark({rule = "DS107", frame = origin.frame, args = args, ar = ar_of(origin.peer, record)})
  end
  self.newest_ns, self.newest_frame = now, origin.frame
end

local function event_remark(self, origin, record, remark)
  remark.ar = ar_of(origin.peer, record)
  self.listener:remark(remark)
end

local function event_pushed_out(self, origin, _, limit) self:push_out(limit, origin.frame) end

-- The Release of an AR: events that waited for its proof run before it.
local function event_release(self, at, _, of_ar) self.pairing:release(of_ar, at, SHARED_INDEX) end

local function event_about(self, origin, record, remark)
  remark.ar = ar_of(origin.peer, record)
  self.listener:remark(remark, record.job)
end

local function event_read_asked(self, origin, record, _, peer)
  clock(self, origin, record)
  record.job = self.pairing:expected(peer, record) -- for findings about the call
  if record.job then record.job:fetch(record.request) end
end

local function event_read_asked_late(self, _, record, answer, peer)
  self.pairing:read_asked_late(peer, record, answer)
end

local function event_answered_twice(_, _, record)
  if record.job then record.job.doubled_frame = record.request.frame end
end

-- A Read is over, whichever job gets its response.
local function event_read_over(self, _, record, _, peer) self.pairing:read_over(peer, record) end

local function event_write_asked(self, origin, record, message, peer)
  clock(self, origin, record)
  record.job = self.pairing:write_request(peer, record, message)
end

local function event_read_lost(self, _, record, _, peer) self.pairing:read_lost(peer, record) end

local function event_write_answered(self, origin, record)
  clock(self, origin, record)
  local job = record.job
  if job then self.pairing:write_response(job, record.response) end
end

local function event_write_unasked(self, _, record, _, peer) self.pairing:write_unasked(peer, record) end

local function event_read_answered(self, origin, record, _, peer)
  clock(self, origin, record)
  if is_cut_before_status(record.response) then
    self.pairing:read_cut_before_status(peer, record)
    return
  end
  local place, data = record.place, record.response.data
  if ALWAYS[place.index] and data ~= "" then self.index47:responded(peer.device, place, data, self.codec) end
  self.pairing:read_response(peer, record)
end

local function event_write_failed(self, origin, record)
  local job = record.job
  if job then self.pairing:write_response(job, half_of(origin.frame, origin.time_ns, nil), true) end
end

-- What is told

-- One more record request of this index.
local function count(self, index, kind)
  local counts = self.counts[index] or {read = 0, write = 0}
  self.counts[index], counts[kind] = counts, counts[kind] + 1
end

--- An IODWriteMultiple, whatever it holds.
function RecordEvents:wrote_multiple() count(self, records.WRITE_MULTIPLE, "write") end

-- Runs an event now, or when something proves its AR. Returns whether it waits.
-- `event`: a function under "Events". `proves`: a function of the same arguments, whether the message proves
-- its AR; called only if that would open the AR; nil: the event never does.
-- After a question an event runs now, and waits as well.
local function pass(self, event, proves, origin, record, detail)
  local peer, place, index47 = origin.peer, record.place, self.index47
  if place.peer ~= peer then know_peer(place, peer) end
  local ar = place.ar_key
  if passes(index47, ar, place.index) then
    event(self, origin, record, detail, peer)
    return false
  end
  if index47:is_of_drive(peer.device, place) or proves and proves(self, origin, record, detail) then
    index47:prove(ar, self)
    event(self, origin, record, detail, peer)
    return false
  end
  local held = {event = event, origin = origin, record = record, detail = detail}
  local asks = event == event_write_asked and index47:is_question_here(peer.device, place, detail)
  if index47:pass_on(ar, held, asks, self) then event(self, origin, record, detail, peer) end
  return true
end

--- Runs an event that was held back.
function RecordEvents:run(held)
  local origin = held.origin
  held.event(self, origin, held.record, held.detail, origin.peer)
end

--- A finding about a record that is ours, or will turn out to be.
function RecordEvents:remark(origin, record, remark) pass(self, event_remark, nil, origin, record, remark) end

--- The same, about the job of the record, if it has one then.
function RecordEvents:about(origin, record, remark) pass(self, event_about, nil, origin, record, remark) end

--- The call of a record, which is ours or will turn out to be, was pushed out by the limit of this name.
function RecordEvents:pushed_out(origin, record, limit)
  pass(self, event_pushed_out, nil, origin, record, limit)
end

--- A limit pushed out something of ours that began in this frame.
function RecordEvents:push_out(limit, frame)
  local pushed = self.limits:get(limit) or {frame = frame, count = 0}
  self.limits:set(limit, pushed)
  pushed.count = pushed.count + 1
end

--- An AR (its key) is over. If its events wait, its release waits behind them.
-- @param at  {frame, time_ns} of its Release
function RecordEvents:released(of_ar, at)
  self.pairing:release(of_ar, at)
  self.index47:follow(of_ar, {event = event_release, origin = at, detail = of_ar})
end

-- Whether the record of a Read proves the parameter channel, or repeats one that did.
local function proves_by_answer(self, origin, record)
  local half, place, index47 = record.response, record.place, self.index47
  if half.data == "" then return false end
  local ars = index47:echoed(place.ar_key, place, half.data)
  for _, ar in ipairs(ars or {}) do -- of a store nothing is judged: what is open is over
    self.pairing:release(ar, nil, SHARED_INDEX)
    self.listener:no_drive(ar)
  end
  know_peer(place, origin.peer) -- that of what was forgotten has been asked for meanwhile
  return not (ars or half.missing) and (index47:answers(place.ar_key, place, half.data, self.codec)
    or self.pairing:is_again(origin.peer, record))
end

-- A Write request that may be ours.
local function asked_to_write(self, origin, record)
  local half = record.request
  if half.missing then self:_length(origin, record, half) end
  local message, place = self.decode_request(half.data, half.cut), record.place
  if pass(self, event_write_asked, nil, origin, record, message) then
    self.index47:heard(place.ar_key, half.frame, true)
    self.index47:asked(place.ar_key, place, message, half.data)
  end
end

--- A request, ours or not.
function RecordEvents:asked(origin, record)
  local place = record.place
  count(self, place.index, place.write and "write" or "read")
  if not self.index47.concerned[place.index] then return end
  if place.write then
    asked_to_write(self, origin, record)
  elseif pass(self, event_read_asked, nil, origin, record) then
    self.index47:heard(place.ar_key, record.request.frame, true)
  end
end

--- The request of a Read came after its response.
function RecordEvents:asked_late(origin, record, answer)
  local index = record.place.index
  count(self, index, "read")
  if self.index47.concerned[index] and pass(self, event_read_asked_late, nil, origin, record, answer) then
    self.index47:heard(record.place.ar_key, answer, true)
  end
end

--- The request of a response came late: that response no longer counts as one without a request.
function RecordEvents:not_unasked(origin, record)
  if record.index == SHARED_INDEX then self.index47:unheard(records.ar_key(origin.peer, record)) end
end

--- A request with two responses: the client may have got either.
function RecordEvents:answered_twice(origin, record) pass(self, event_answered_twice, nil, origin, record) end

--- The response to a request.
function RecordEvents:answered(origin, record)
  if not record.place.write then
    self:_read_answered(origin, record, record.response)
    return
  elseif is_cut_before_status(record.response) then
    self:_length(origin, record, record.response)
  end
  pass(self, event_write_answered, nil, origin, record)
end

--- A response without its request.
function RecordEvents:unasked(origin, record)
  local waits
  if record.write then
    waits = pass(self, event_write_unasked, nil, origin, record)
  else
    waits = self:_read_answered(origin, record, record.response)
  end
  if waits then self.index47:heard(record.place.ar_key, record.response.frame) end
end

--- The findings about records that nothing shows to be ours (DS209), if nothing more comes: array of remarks.
function RecordEvents:unproven()
  local remarks = {}
  for number, each in ipairs(self.index47:unproven()) do
    local what = each.asks and "unproven_calls" or "unproven_responses"
    local args = {device = each.device, count = each.count, what = what}
    remarks[number] = {rule = "DS209", frame = each.first, args = args}
  end
  return remarks
end

--- A request that was refused before its record was looked at.
function RecordEvents:failed(origin, record)
  pass(self, record.write and event_write_failed or event_read_over, nil, origin, record)
end

--- A request that will get no response.
function RecordEvents:lost(origin, record)
  if not record.write then pass(self, event_read_lost, nil, origin, record) end
end

-- A record that is shorter than its stated length: cut by the capture, or wrong.
function RecordEvents:_length(origin, record, half)
  local cut = origin.missing ~= 0 and origin.cut
  if cut then
    local args = {
      captured = cut.captured, original = cut.original, length = half.missing and half.stated,
      completed = half.frame,
    }
    self:remark(origin, record, {rule = "DS106", frame = cut.frame, args = args})
  else
    local args = {stated = half.stated, present = #half.data}
    self:remark(origin, record, {rule = "DS202", frame = half.frame, args = args})
  end
end

function RecordEvents:_read_answered(origin, record, half)
  if half.missing or is_cut_before_status(half) then self:_length(origin, record, half) end
  return pass(self, event_read_answered, proves_by_answer, origin, record)
end

return M
