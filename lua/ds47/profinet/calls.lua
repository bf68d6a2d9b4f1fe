-- RPC calls: which response belongs to which request (docs/pairing.md, RPC level, P4 to P11).
--
-- Tells copies, retransmissions and reused numbers apart and hands each call on exactly once. What a call
-- carries is records.lua's business; what it means for the parameter channel is pairing.lua's.
--
-- A call is {request = pdu, response = pdu or nil, in_part = true where fragments of a response were seen,
-- sent_ns = when the request was sent last, nil where it was sent once, context = whatever the layer above
-- keeps with it, later = the next one of its activity}.
--
-- An activity is {newest = sequence number of its newest request, by_seq = its calls, oldest and last = the
-- ends of their chain, which is in the order of their requests, count = how many there are, answered = how
-- many of them have a response, server = the one that was called last, numbers = its sequence numbers
-- (completeness.lua)}: calls are few, and are forgotten in lots.

local completeness = require("ds47.profinet.completeness")
local ordered = require("ds47.support.ordered")

local M = {}

local NONE = {}

local CallTracker = {}
CallTracker.__index = CallTracker
M.CallTracker = CallTracker

--- Feeds on whole RPC messages in the order of the capture.
--
-- Memory is bounded by the limits; a call without response is reported as lost when it expires, and as
-- pushed out when there are too many.
-- @param limits the flat table of tables.lua (copy_ns, retransmission_ns, call_expiry_ns, datagrams,
--   activities, calls, answered_calls, rpc_messages)
-- @param handlers a table with methods request(call), response(call), orphan_response(pdu, certain),
--   late_request(call) of one that comes behind its response and was sent before it,
--   retransmission(call, pdu), fault(call, pdu), lost(call), pushed_out(call, limit); each is called at most
--   once for one event. `certain`: that the request is not in the capture; `limit`: the name of the one that
--   pushed the call out, whose response may still come
-- @param missing  hears of what is not in the capture (completeness.lua)
function CallTracker.new(limits, handlers, missing)
  return setmetatable({
    limits = limits, handlers = handlers, activities = ordered.new(),
    completeness = missing or completeness.new(limits.activities),
    early = ordered.new(), -- the newest responses without a request
    given_up = ordered.new(), -- the newest requests whose responses did not come in time
    many_calls = math.min(2 * limits.answered_calls, limits.calls), -- up to so many nothing is forgotten
    begun_requests = ordered.new(), -- requests of which fragments were seen, as far as is known
    -- The newest datagrams by a key (`is_copy`), and those before them: when there are so many new ones that
    -- they are enough (no `room` is left), the others are forgotten in one go.
    recent = {}, earlier = {}, room = limits.datagrams,
    alike = 0, -- how often they have to be forgotten until none has a long key
    newest = nil, -- the call of the newest message; whoever feeds may forget it
    asks_again = false, -- whether that is one whose request came again
    counts = {
      requests = 0, responses = 0, faults = 0, rejects = 0, pings = 0, working = 0, others = 0,
      copies = 0, retransmissions = 0, unanswered = 0,
    },
  }, CallTracker)
end

local function same_datagram(one, other)
  return one.body == other.body and one.activity == other.activity and one.seq == other.seq
    and one.source == other.source and one.destination == other.destination
    and one.ptype == other.ptype and one.fragment == other.fragment
end

-- A key of all that tells a datagram apart, for one whose number is that of another one.
local function long_key(number, pdu)
  return ("%.0f"):format(number) .. pdu.activity .. pdu.seq .. "\0" .. pdu.source .. "\0"
    .. pdu.destination .. "\0" .. pdu.ptype .. "\0" .. pdu.fragment .. "\0" .. pdu.body
end

--- Whether the same datagram with the same IP id was here within the copy window (P6).
-- @param ip_id the identification of its IP header
-- @return that, and of a copy the frame of the first one
function CallTracker:is_copy(pdu, ip_id)
  -- A number of 52 bits that nearly always tells a datagram apart. The IP id is in it as it is.
  local seq, fragment, recent = pdu.seq, pdu.fragment, self.recent
  if fragment ~= 0 then
    seq = seq + 40503 * fragment
  end
  local number = pdu.digest + seq % 0x10000 * 0x10000 + ip_id
  local key, before = number, recent[number] or self.earlier[number]
  if before and not same_datagram(before, pdu) or not before and self.alike > 0 then
    local long = long_key(number, pdu)
    local other = recent[long] or self.earlier[long]
    key, before = (before or other) and long or number, other
  end
  if before then
    local passed, window = pdu.time_ns - before.time_ns, self.limits.copy_ns
    if passed <= window and -passed <= window then
      self.counts.copies = self.counts.copies + 1
      return true, before.frame
    end
  end
  local is_new = recent[key] == nil
  recent[key] = pdu
  if key ~= number then
    self.alike = 2
  end
  if is_new then
    self.room = self.room - 1
    if self.room == 0 then
      self.earlier, self.recent, self.room = recent, {}, self.limits.datagrams
      self.alike = math.max(self.alike - 1, 0)
    end
  end
  return false
end

-- The call to which a PDU belongs, nil for none, and its activity.
local function call_of(self, pdu)
  local activity = self.activities.values[pdu.conversation]
  return activity and activity.by_seq[pdu.seq], activity
end

local function append(activity, seq, call)
  local last = activity.last
  if last then
    last.later = call
  else
    activity.oldest = call
  end
  activity.last, activity.by_seq[seq], activity.count = call, call, activity.count + 1
end

-- Takes a call out of its activity; `before`: the one before it, nil for the oldest. Who still has the call
-- does not keep those behind it alive.
-- @return the one behind it
local function take_out(activity, before, call)
  local later = call.later
  call.later = nil
  if before then
    before.later = later
  else
    activity.oldest = later
  end
  if later == nil then
    activity.last = before
  end
  activity.by_seq[call.request.seq], activity.count = nil, activity.count - 1
  if call.response then
    activity.answered = activity.answered - 1
  end
  return later
end

-- Forgets a call, wherever it is.
local function forget(activity, call)
  local before, other = nil, activity.oldest
  while other ~= call do
    before, other = other, other.later
  end
  take_out(activity, before, call)
end

local function count(self, name)
  local counts = self.counts
  counts[name] = counts[name] + 1
end

local function lose(self, call, activity)
  count(self, "unanswered")
  self.completeness:lost(call.request, activity.numbers)
  self.handlers:lost(call)
end

-- Forgets so many answered calls, the oldest first.
local function forget_answered(activity, spare)
  local before, call = nil, activity.oldest
  while spare > 0 do
    if call.response then
      call, spare = take_out(activity, before, call), spare - 1
    else
      before, call = call, call.later
    end
  end
end

local function begun_key(pdu)
  return pdu.conversation .. pdu.seq
end

-- Loses the unanswered calls that are too old.
local function lose_old(self, activity, now)
  local expiry, before, call, lost = self.limits.call_expiry_ns, nil, activity.oldest, nil
  while call do
    if not call.response and now - call.request.time_ns > expiry then
      lost = lost or {}
      lost[#lost + 1] = call
      call = take_out(activity, before, call)
    else
      before, call = call, call.later
    end
  end
  for _, each in ipairs(lost or NONE) do
    self.given_up:keep(begun_key(each.request), true, self.limits.calls)
    lose(self, each, activity)
  end
end

-- Gives up what is too old or too much. The usual case, that there is nothing, is on the way of every call.
local function expire(self, activity, now)
  local limits, oldest = self.limits, activity.oldest
  if oldest == nil or activity.count <= self.many_calls
    and now - oldest.request.time_ns <= limits.call_expiry_ns then
    return
  end
  forget_answered(activity, activity.answered - limits.answered_calls)
  lose_old(self, activity, now)
  while activity.count > limits.calls do
    local call = activity.oldest
    take_out(activity, nil, call)
    if not call.response then
      self.handlers:pushed_out(call, "calls")
    end
  end
end

local function make_room(self)
  while self.activities.length > self.limits.activities do
    local _, activity = self.activities:pop_first()
    local call = activity.oldest
    while call do
      if not call.response then
        self.handlers:pushed_out(call, "activities")
      end
      call = call.later
    end
  end
end

local function is_retransmission(self, activity, call, pdu)
  local request, response = call.request, call.response
  if request.opnum ~= pdu.opnum or request.body ~= pdu.body then
    return false
  end
  if not response then
    return true
  end
  return pdu.time_ns - response.time_ns <= self.limits.retransmission_ns and activity.newest == pdu.seq
end

-- The activity of a PDU, which spoke last.
local function activity_of(self, pdu)
  local activities = self.activities
  local key = pdu.conversation
  local activity = activities.values[key]
  if activity then
    if activities.newest ~= key then
      activities:move_to_end(key)
    end
  else
    activity = {
      newest = pdu.seq, by_seq = {}, oldest = nil, last = nil, count = 0, answered = 0, server = nil,
      numbers = completeness.numbers(pdu),
    }
    activities:set(key, activity)
    make_room(self)
  end
  if activity.server ~= pdu.server then
    activity.server = pdu.server
    self.completeness:began(pdu, activity.numbers)
  end
  return activity
end

local function answer(self, activity, call, pdu)
  call.response, activity.answered, activity.numbers.heard = pdu, activity.answered + 1, true
  self.newest = call
end

-- The response that came before the request of a call, by their times the other way round; nil for none.
local function early_response(self, pdu)
  if self.early.length == 0 then
    return nil
  end
  local early = self.early:pop(begun_key(pdu))
  local passed = early and early.time_ns - pdu.time_ns
  return early and passed >= 0 and passed <= self.limits.call_expiry_ns and early or nil
end

local function request(self, pdu)
  local activity, seq = activity_of(self, pdu), pdu.seq
  expire(self, activity, pdu.time_ns)
  local call = activity.by_seq[seq]
  if call then
    if is_retransmission(self, activity, call, pdu) then
      count(self, "retransmissions")
      self.newest, self.asks_again = call, true
      self.handlers:retransmission(call, pdu)
      call.sent_ns = pdu.time_ns
      return
    end
    if not call.response then
      lose(self, call, activity)
    end
    forget(activity, call)
  end
  local before = activity.by_seq[activity.newest]
  if before and not before.response then
    self.completeness:went_on(before.request, pdu)
  end
  activity.numbers:add(pdu)
  activity.newest = seq
  call = {request = pdu, response = nil, context = nil, later = nil}
  append(activity, seq, call)
  self.newest, self.asks_again = call, false
  local early = early_response(self, pdu)
  if early then
    answer(self, activity, call, early)
    self.completeness:asked_after_all(early)
    if early.ptype == 2 then
      self.handlers:late_request(call)
    else
      self.handlers:request(call)
      self.handlers:fault(call, early)
    end
  else
    self.handlers:request(call)
  end
end

-- Hears of a response or fault without its request; whether that certainly is not in the capture.
local function unasked(self, pdu)
  local key, activity = begun_key(pdu), self.activities.values[pdu.conversation]
  local begun = self.begun_requests:get(key) ~= nil
  if not self.given_up:get(key) then
    self.early:keep(key, pdu, self.limits.calls)
    if activity and pdu.seq > activity.numbers.highest then
      activity.numbers:add(pdu)
    end
    self.completeness:unasked(pdu)
  end
  return not begun
end

local function response(self, pdu)
  local activity, call = self.activities.values[pdu.conversation], nil
  if activity then
    expire(self, activity, pdu.time_ns)
    call = activity.by_seq[pdu.seq]
  end
  if not call then
    self.handlers:orphan_response(pdu, unasked(self, pdu))
  elseif not call.response then
    answer(self, activity, call, pdu)
    self.handlers:response(call)
  elseif call.response.body ~= pdu.body then
    self.handlers:orphan_response(pdu, true)
  end
end

local function fault(self, pdu)
  local call, activity = call_of(self, pdu)
  if not call then
    unasked(self, pdu)
  elseif not call.response then
    answer(self, activity, call, pdu)
    self.handlers:fault(call, pdu)
  end
end

--- Takes one whole message (not a copy, see `is_copy`).
function CallTracker:feed(pdu)
  local ptype, counts = pdu.ptype, self.counts
  if ptype == 0 then
    counts.requests = counts.requests + 1
    request(self, pdu)
  elseif ptype == 2 then
    counts.responses = counts.responses + 1
    response(self, pdu)
  elseif ptype == 3 or ptype == 6 then
    count(self, ptype == 3 and "faults" or "rejects")
    fault(self, pdu)
  else
    count(self, ptype == 1 and "pings" or ptype == 4 and "working" or "others")
  end
end

--- Takes a call that is none of PROFINET: only its number counts.
function CallTracker:passes(pdu)
  activity_of(self, pdu).numbers:add(pdu)
end

--- Takes a fragment that completes no message: its call is not without request or response.
function CallTracker:begun(pdu)
  if pdu.ptype == 0 then
    local begun = self.begun_requests
    begun:set(begun_key(pdu), true)
    if begun.length > self.limits.rpc_messages then
      begun:pop_first()
    end
  elseif pdu.ptype == 2 then
    local call = call_of(self, pdu)
    if call then
      call.in_part = true
    end
  end
end

--- The call without a response to which a part of one belongs; nil for none.
function CallTracker:open_call(pdu)
  local call = pdu.ptype == 2 and call_of(self, pdu)
  return call and call.response == nil and call or nil
end

--- Of pairs of stations the first call that is open though its client went on: a table of its frames by
-- client .. "\0" .. server.
function CallTracker:halves()
  local found, activities = {}, self.activities.values
  for _, call in ipairs(self:unanswered()) do
    local asked = call.request
    if asked.seq < activities[asked.conversation].numbers.highest then
      local pair = asked.client .. "\0" .. asked.server
      found[pair] = math.min(found[pair] or asked.frame, asked.frame)
    end
  end
  return found
end

--- The calls without a response: those of the activity that spoke longest ago first, each in its order.
function CallTracker:unanswered()
  local found = {}
  for _, activity in self.activities:iterate() do
    local call = activity.oldest
    while call do
      if not call.response then
        found[#found + 1] = call
      end
      call = call.later
    end
  end
  return found
end

return M
