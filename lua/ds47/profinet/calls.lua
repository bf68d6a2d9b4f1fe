-- RPC calls: which response belongs to which request (docs/pairing.md, RPC level, P4 to P11).
--
-- Drops copies, joins fragments, tells retransmissions and reused numbers apart, and hands each call on
-- exactly once. records.lua parses what a call carries; pairing.lua knows what it means for the parameter
-- channel.
--
-- A call is {request = pdu, response = pdu or nil, in_part = true if fragments of a response were seen,
-- sent_ns = when the request was last sent, nil if it was sent once, context = the records that it carries,
-- set by the layer above, later = the next call of its activity}.
--
-- An activity is {by_seq = its calls without a response, oldest and last = the ends of their list, in the
-- order of their requests, count = how many there are, server = the server that it called last, numbers = its
-- sequence numbers (completeness.lua), anew = the frame that used a number for another call: the client
-- counts anew from there, doubled = the frame of a response that came again without its request: a request
-- is missing, or a new call; anew and doubled are 0 for none}.

local completeness = require("ds47.profinet.completeness")
local ordered = require("ds47.support.ordered")
local rpc = require("ds47.profinet.rpc")

local pair = rpc.pair

local M = {}

local NONE = {}

local CallTracker = {}
CallTracker.__index = CallTracker
M.CallTracker = CallTracker

--- Takes PDUs in the order of the capture.
--
-- Memory is bounded by the limits. A call without a response is reported as lost when it expires, and as
-- pushed out when there are too many.
-- @param limits the flat table of tables.lua (copy_ns, call_expiry_ns, datagrams, activities, calls,
--   answered_calls, rpc_messages)
-- @param handlers a table with methods for what happens to a call, in the order of the capture:
--   message(pdu, src_mac), each whole message before what it does;
--   asked(call); answered(call), by its response; failed(call, pdu), by a fault or reject; again(call, pdu),
--   its request was repeated; late(call), its request came after its response, but was sent before;
--   twice(call, pdu), a second response with other bytes; lost(call), its response did not come in time;
--   unasked(pdu, certain, before), a response without its request, sent before that frame; `certain` if the
--   capture has no part of it;
--   pushed_out(call, limit), the limit of that name gave it up: its response may still come;
--   given_up(part, "RPC", tracker), a message without all its fragments
-- @param missing  hears what the capture lacks (completeness.lua)
function CallTracker.new(limits, handlers, missing)
  return setmetatable({
    limits = limits, handlers = handlers, activities = ordered.new(),
    completeness = missing or completeness.new(limits.activities),
    fragments = rpc.Fragments.new(limits.fragment_expiry_ns),
    early = ordered.new(), -- the newest responses without a request
    given_up = ordered.new(), -- the newest requests without a response in time
    answered = ordered.new(), -- answered calls that may still be repeated: the newest is last
    forgot = false, -- whether some were forgotten because there were too many
    connects = ordered.new(), -- `rpc.pair` of client and server -> the frame of the newest Connect
    begun_requests = ordered.new(), -- incomplete requests: only fragments were seen
    -- The newest datagrams by a key (`copied`), and those before them. When there are enough (no `room` is
    -- left), the newest ones become the earlier ones.
    recent = {}, earlier = {}, room = limits.datagrams,
    alike = 0, -- after how many such changes none has a long key
    newest = nil, -- the call of the newest message; the caller may forget it
    asks_again = false, -- whether its request came again
    counts = {
      requests = 0, responses = 0, faults = 0, rejects = 0, pings = 0, working = 0, others = 0,
      copies = 0, retransmissions = 0, unanswered = 0,
    },
  }, CallTracker)
end

local function same_datagram(one, other)
  return one.body == other.body and one.activity == other.activity and one.seq == other.seq
    and one.port == other.port and one.boot == other.boot
    and one.source == other.source and one.destination == other.destination
    and one.ptype == other.ptype and one.fragment == other.fragment
end

-- A key of all fields that tell a datagram apart, if another one has the same number.
local function long_key(number, pdu)
  return ("%.0f"):format(number) .. pdu.activity .. pdu.seq .. "\0" .. pdu.source .. "\0"
    .. pdu.destination .. "\0" .. pdu.ptype .. "\0" .. pdu.fragment .. "\0"
    .. (pdu.port or 0) .. "\0" .. pdu.boot .. pdu.body
end

local function key_of(pdu) return pdu.conversation .. pdu.seq end

-- The call that a PDU belongs to, nil for none, and its activity.
local function call_of(self, pdu)
  local activity = self.activities.values[pdu.conversation]
  return activity and activity.by_seq[pdu.seq], activity
end

-- The wire doubled a message. A device that does not remember its responses executes a request again.
local function came_again(self, pdu)
  if pdu.ptype ~= 0 then return self.completeness:doubled(pdu) end
  local call = self.answered:get(key_of(pdu)) or call_of(self, pdu)
  if call then call.again = pdu.frame end
end

-- The frame of the same datagram with the same IP id: it came twice, or is in the file twice (P6). nil if
-- this one is no copy. An IP id of 0 says nothing: then only the copy window counts.
local function copied(self, pdu, ip_id)
  -- A number of 52 bits that nearly always tells a datagram apart. The IP id is in it as it is.
  local seq, fragment, recent = pdu.seq, pdu.fragment, self.recent
  if fragment ~= 0 then seq = seq + 40503 * fragment end
  local number = pdu.digest + seq % 0x10000 * 0x10000 + ip_id
  local key, before = number, recent[number] or self.earlier[number]
  if before and not same_datagram(before, pdu) or not before and self.alike > 0 then
    local long = long_key(number, pdu)
    local other = recent[long] or self.earlier[long]
    key, before = (before or other) and long or number, other
  end
  if before then
    local passed, window = pdu.time_ns - before.time_ns, self.limits.copy_ns
    if ip_id ~= 0 or passed <= window and -passed <= window then
      self.counts.copies = self.counts.copies + 1
      if passed > window then came_again(self, pdu) end
      return before.frame
    end
  end
  local is_new = recent[key] == nil
  recent[key] = pdu
  if key ~= number then self.alike = 2 end
  if is_new then
    self.room = self.room - 1
    if self.room == 0 then
      self.earlier, self.recent, self.room = recent, {}, self.limits.datagrams
      self.alike = math.max(self.alike - 1, 0)
    end
  end
  return nil
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

-- Takes a call out of its activity; `before`: the call before it, nil for the oldest. A reference to the
-- removed call does not keep the later ones alive.
-- @return the call after it
local function take_out(activity, before, call)
  local later = call.later
  call.later = nil
  if before then
    before.later = later
  else
    activity.oldest = later
  end
  if later == nil then activity.last = before end
  activity.by_seq[call.request.seq], activity.count = nil, activity.count - 1
  return later
end

-- Forgets a call, wherever it is.
local function forget(activity, call)
  local before, other = nil, activity.oldest
  while other ~= call do before, other = other, other.later end
  take_out(activity, before, call)
end

local function lose(self, call)
  self.counts.unanswered = self.counts.unanswered + 1
  self.completeness:lost(call.request)
  self.handlers:lost(call)
end

-- Loses a call: if its response still comes, it is too late.
local function give_up(self, call)
  self.given_up:keep(key_of(call.request), true, self.limits.calls)
  lose(self, call)
end

-- Whether the last datagram of a call is so old that its client no longer repeats it.
local function is_old(self, call, now)
  local newest, response = call.sent_ns or call.request.time_ns, call.response
  if response and response.time_ns > newest then newest = response.time_ns end
  return now - newest > self.limits.call_expiry_ns
end

-- Loses the calls that are too old.
local function lose_old(self, activity, pdu)
  local before, call, lost = nil, activity.oldest, nil
  while call do
    if is_old(self, call, pdu.time_ns) then
      lost = lost or {}
      lost[#lost + 1] = call
      call = take_out(activity, before, call)
    else
      before, call = call, call.later
    end
  end
  for _, each in ipairs(lost or NONE) do give_up(self, each) end
end

-- Gives up calls that are too old or too many. Every call passes here; usually nothing is open.
local function expire(self, activity, pdu)
  if activity.oldest == nil then return end
  lose_old(self, activity, pdu)
  while activity.count > self.limits.calls do
    local call = activity.oldest
    take_out(activity, nil, call)
    if call.request.seq < activity.numbers.answered then
      give_up(self, call)
    else
      self.handlers:pushed_out(call, "calls")
    end
  end
end

local function make_room(self)
  while self.activities.length > self.limits.activities do
    local _, activity = self.activities:pop_first()
    local call = activity.oldest
    while call do
      self.handlers:pushed_out(call, "activities")
      call = call.later
    end
  end
end

-- Whether the number of a call may now belong to another one, even with the same bytes.
local function is_used_anew(self, activity, call, pdu)
  return activity ~= nil and activity.anew > call.request.frame or is_old(self, call, pdu.time_ns)
end

-- Whether there is a Connect of its client to its server after a frame.
local function is_begun_since(self, pdu, frame)
  return (self.connects:get(pair(pdu.client, pdu.server)) or 0) > frame
end

-- Whether the number of a call may now belong to another one: its client no longer repeats it (P8, P9).
local function is_over(self, activity, call, pdu)
  return is_begun_since(self, pdu, call.request.frame) or is_used_anew(self, activity, call, pdu)
end

-- Whether a number that was there before is the same call (P7).
local function is_retransmission(self, activity, call, pdu)
  local asked = call.request
  local same = asked.opnum == pdu.opnum and asked.body == pdu.body and asked.port == pdu.port
  return same and not is_over(self, activity, call, pdu)
end

-- The activity of a PDU, now the newest one.
local function activity_of(self, pdu)
  local activities = self.activities
  local key = pdu.conversation
  local activity = activities.values[key]
  if activity then
    if activities.newest ~= key then activities:move_to_end(key) end
  else
    activity = {
      by_seq = {}, oldest = nil, last = nil, count = 0, server = nil,
      numbers = completeness.numbers(pdu), anew = 0, doubled = 0,
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

-- A call is answered: it is remembered as long as its client may repeat it.
local function answer(self, activity, call, pdu)
  call.response = pdu
  if pdu.seq < activity.numbers.answered and activity.numbers:is_late(pdu) then
    self.completeness:disordered(pdu)
  end
  activity.numbers:hears(pdu.seq)
  self.newest = call
  forget(activity, call)
  local answered = self.answered
  answered:keep(key_of(pdu), call, math.huge)
  while is_old(self, answered.values[answered.oldest], pdu.time_ns) do answered:pop_first() end
  if answered.length > self.limits.answered_calls then
    answered:pop_first()
    self.forgot = true
  end
end

-- The response that came before the request of a call, nil for none; and whether their times have the right
-- order.
local function early_response(self, pdu)
  if self.early.length == 0 then return nil end
  local early = self.early:pop(key_of(pdu))
  local passed = early and early.time_ns - pdu.time_ns
  return early, passed and passed >= 0 and passed <= self.limits.call_expiry_ns
end

-- Whether a Read is repeated, its first request is missing, and its response was captured before.
local function was_read(self, pdu, early)
  local passed, reads = pdu.time_ns - early.time_ns, pdu.opnum == rpc.READ or pdu.opnum == rpc.READ_IMPLICIT
  reads = reads and early.opnum == pdu.opnum and not is_begun_since(self, pdu, early.frame)
  return reads and passed > 0 and passed <= self.limits.call_expiry_ns
end

-- A call is sent again.
local function repeated(self, call, pdu)
  self.counts.retransmissions = self.counts.retransmissions + 1
  self.newest, self.asks_again = call, true
  self.handlers:again(call, pdu)
  call.sent_ns, call.again = pdu.time_ns, pdu.frame
  if call.response then self.answered:move_to_end(key_of(pdu)) end
end

local function request(self, pdu)
  local activity, seq = activity_of(self, pdu), pdu.seq
  expire(self, activity, pdu)
  local call = activity.by_seq[seq] or self.answered:get(key_of(pdu))
  if call then
    if is_retransmission(self, activity, call, pdu) then
      repeated(self, call, pdu)
      return
    end
    activity.anew, activity.numbers.answered = pdu.frame, -1
    if not call.response then
      lose(self, call)
      forget(activity, call)
    end
  end
  if activity.numbers:is_late(pdu) or seq < activity.numbers.answered then
    self.completeness:disordered(pdu)
  end
  if pdu.opnum == rpc.CONNECT then
    self.connects:keep(pair(pdu.client, pdu.server), pdu.frame, self.limits.activities)
  end
  local early, late = early_response(self, pdu)
  activity.numbers:add(pdu, not early)
  call = {request = pdu, response = nil, context = nil, later = nil, again = nil}
  append(activity, seq, call)
  self.newest, self.asks_again = call, false
  if early and not late and was_read(self, pdu, early) then
    answer(self, activity, call, early)
    repeated(self, call, pdu)
  elseif early and late then
    answer(self, activity, call, early)
    self.completeness:asked_after_all(early)
    if early.ptype == 2 then
      self.handlers:late(call)
    else
      self.handlers:asked(call)
      self.handlers:failed(call, early)
    end
  else
    self.handlers:asked(call)
  end
end

-- Notes a response or fault without its request. Returns whether no part of the request was captured.
local function unasked(self, pdu)
  local key, activity = key_of(pdu), self.activities.values[pdu.conversation]
  local begun = self.begun_requests:get(key) ~= nil
  if not self.given_up:get(key) then
    self.early:keep(key, pdu, self.limits.calls)
    if activity and not activity.numbers:fills(pdu.seq) and pdu.seq > activity.numbers.highest then
      activity.numbers:add(pdu)
    end
    self.completeness:unasked(pdu)
  end
  return not begun
end

-- Whether a response or fault is a second one of a call. Reports `twice` if its bytes differ.
local function answers_again(self, activity, pdu)
  local key = key_of(pdu)
  local call = self.answered:get(key)
  local before = call == nil and activity and self.early:get(key)
  if before then
    -- Of the same call, but its request is missing.
    return pdu.time_ns - before.time_ns <= self.limits.call_expiry_ns
  elseif call == nil then -- of a forgotten call only the number is known
    return self.forgot and activity ~= nil and not self.given_up:get(key) and activity.numbers:has(pdu.seq)
  elseif is_used_anew(self, activity, call, pdu) then
    return false
  end
  if call.response.body == pdu.body then -- late, even after a Connect
    self.completeness:doubled(pdu)
    if activity and not call.again then activity.doubled = pdu.frame end
  elseif is_over(self, activity, call, pdu) then
    return false
  elseif activity == nil or activity.doubled < call.request.frame then
    self.newest, self.asks_again = call, false
    self.handlers:twice(call, pdu)
  end
  return true
end

local function response(self, pdu)
  local activity, call = self.activities.values[pdu.conversation], nil
  if activity then
    expire(self, activity, pdu)
    call = activity.by_seq[pdu.seq]
  end
  if call then
    answer(self, activity, call, pdu)
    self.handlers:answered(call)
  elseif not answers_again(self, activity, pdu) then
    local before = activity and activity.numbers:sent_before(pdu.seq)
    self.handlers:unasked(pdu, unasked(self, pdu), before)
  end
end

local function fault(self, pdu)
  local call, activity = call_of(self, pdu)
  if call then
    answer(self, activity, call, pdu)
    self.handlers:failed(call, pdu)
  elseif not answers_again(self, activity, pdu) then
    unasked(self, pdu)
  end
end

-- Type of a PDU -> what takes it, and the name that counts it.
local TAKE = {[0] = request, [2] = response, [3] = fault, [6] = fault}
local COUNTED = {[0] = "requests", "pings", "responses", "faults", "working", [6] = "rejects"}

-- The message that an RPC fragment completes, nil where it completes none.
local function joined(self, pdu)
  local fragments = self.fragments
  local whole, given_up = fragments:feed(pdu), fragments.given_up
  if given_up[1] then
    fragments.given_up = {}
    for _, part in ipairs(given_up) do self.handlers:given_up(part, "RPC", self) end
  end
  if whole == nil then self:take_fragment(pdu) end
  return whole
end

--- Takes the next PDU. Nothing happens for a copy.
-- @param ip_id the identification of its IP header
-- @param src_mac of the frame that it came in, or that completed it: text, nil where that is not known
-- @return the frame of the first one for a copy, else nil
function CallTracker:take(pdu, ip_id, src_mac)
  if pdu.mapper then -- calls of the endpoint mapper share the sequence numbers
    if pdu.ptype == 0 then activity_of(self, pdu).numbers:add(pdu) end
    return nil
  end
  local original = copied(self, pdu, ip_id)
  if original then return original end
  local whole = pdu
  if pdu.fragmented then whole = joined(self, pdu) end
  if whole == nil then return nil end
  self.handlers:message(whole, src_mac)
  local counts, name, take = self.counts, COUNTED[whole.ptype] or "others", TAKE[whole.ptype]
  counts[name] = counts[name] + 1
  if take then take(self, whole) end
  return nil
end

--- Takes a fragment that completes no message: its request or response is not entirely missing.
function CallTracker:take_fragment(pdu)
  if pdu.ptype == 0 then
    local begun = self.begun_requests
    begun:set(key_of(pdu), true)
    if begun.length > self.limits.rpc_messages then begun:pop_first() end
  elseif pdu.ptype == 2 then
    local call = call_of(self, pdu)
    if call then call.in_part = true end
  end
end

--- The open call that a part of a response belongs to; nil if there is none.
function CallTracker:open_call(pdu)
  local call = pdu.ptype == 2 and call_of(self, pdu)
  return call or nil
end

--- `rpc.pair` of two stations -> the frame of their first open call, if its client went on.
function CallTracker:halves()
  local found, activities = {}, self.activities.values
  for _, call in ipairs(self:unanswered()) do
    local asked = call.request
    if asked.seq < activities[asked.conversation].numbers.highest then
      local key = pair(asked.client, asked.server)
      found[key] = math.min(found[key] or asked.frame, asked.frame)
    end
  end
  return found
end

--- The calls without a response, those of the least recent activity first, each in its order.
function CallTracker:unanswered()
  local found = {}
  for _, activity in self.activities:iterate() do
    local call = activity.oldest
    while call do
      found[#found + 1] = call
      call = call.later
    end
  end
  return found
end

return M
