-- RPC calls: which response belongs to which request (docs/pairing.md, RPC level, P4 to P11).
--
-- Tells copies, retransmissions and reused numbers apart and hands each call on exactly once. What a call
-- carries is records.lua's business; what it means for the parameter channel is pairing.lua's.
--
-- A call is {request = pdu, response = pdu or nil, in_part = true where fragments of a response were seen,
-- context = whatever the layer above keeps with it}.
--
-- An activity is {newest = sequence number of its newest request, by_seq = its calls, seqs = their sequence
-- numbers in the order of their requests, from 1 to `count`}: calls are few, and are forgotten in lots.

local ordered = require("ds47.support.ordered")

local M = {}

local CallTracker = {}
CallTracker.__index = CallTracker
M.CallTracker = CallTracker

--- Feeds on whole RPC messages in the order of the capture.
--
-- Memory is bounded by the limits; a call without response is reported as lost when it expires or at
-- `finish`, and as pushed out when there are too many.
-- @param limits the flat table of tables.lua (copy_ns, retransmission_ns, call_expiry_ns, datagrams,
--   activities, calls, answered_calls, rpc_messages)
-- @param handlers a table with methods request(call), response(call), orphan_response(pdu, certain),
--   retransmission(call, pdu), fault(call, pdu), lost(call), pushed_out(call, limit); each is called at most
--   once for one event. `certain`: that the request is not in the capture; `limit`: the name of the one that
--   pushed the call out, whose response may still come
function CallTracker.new(limits, handlers)
  return setmetatable({
    limits = limits, handlers = handlers, activities = ordered.new(),
    begun_requests = ordered.new(), -- requests of which fragments were seen, as far as is known
    datagrams = {}, datagram_count = 0, -- the newest ones by a key (`find_datagram`)
    -- Their keys and PDUs in the order in which they came, from `first` to `last`. A key that came again
    -- stands there twice, and counts where its PDU is the newest one.
    keys = {}, pdus = {}, first = 1, last = 0,
    long_keys = 0, -- how many keys of `datagrams` are texts
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

--- The same datagram from before, if it is remembered, and the key of this one: only where two have the same
-- number, all goes into a text.
local function find_datagram(self, key, before, pdu)
  local datagrams = self.datagrams
  if before and same_datagram(before, pdu) then
    return key, before
  end
  local long = ("%.0f"):format(key) .. pdu.activity .. pdu.seq .. "\0" .. pdu.source .. "\0"
    .. pdu.destination .. "\0" .. pdu.ptype .. "\0" .. pdu.fragment .. "\0" .. pdu.body
  local other = datagrams[long]
  if before or other then
    key = long
  end
  return key, other
end

local PASSED = 1024 -- keys that are passed before the others move to the front of their array

local function forget_oldest(self)
  local datagrams, keys, pdus = self.datagrams, self.keys, self.pdus
  local first = self.first
  local key = keys[first]
  while datagrams[key] ~= pdus[first] do
    first = first + 1
    key = keys[first]
  end
  datagrams[key] = nil
  self.datagram_count = self.datagram_count - 1
  if self.long_keys > 0 and type(key) == "string" then
    self.long_keys = self.long_keys - 1
  end
  self.first = first + 1
  if first < PASSED then
    return
  end
  for place = first + 1, self.last do
    keys[place - first], pdus[place - first] = keys[place], pdus[place]
  end
  for place = self.last - first + 1, self.last do
    keys[place], pdus[place] = nil, nil
  end
  self.first, self.last = 1, self.last - first
end

--- Whether the same datagram with the same IP id was here within the copy window (P6).
-- @param ip_id the identification of its IP header
-- @return that, and of a copy the frame of the first one
function CallTracker:is_copy(pdu, ip_id)
  -- A number of 52 bits that nearly always tells a datagram apart. The IP id is in it as it is.
  local seq, fragment, datagrams = pdu.seq, pdu.fragment, self.datagrams
  if fragment ~= 0 then
    seq = seq + 40503 * fragment
  end
  local key = pdu.digest + seq % 0x10000 * 0x10000 + ip_id
  local before = datagrams[key]
  if before or self.long_keys > 0 then
    key, before = find_datagram(self, key, before, pdu)
    if not before and type(key) == "string" then
      self.long_keys = self.long_keys + 1
    end
  end
  if before then
    local passed, window = pdu.time_ns - before.time_ns, self.limits.copy_ns
    if passed <= window and -passed <= window then
      self.counts.copies = self.counts.copies + 1
      return true, before.frame
    end
  else
    self.datagram_count = self.datagram_count + 1
  end
  local last = self.last + 1
  self.last, self.keys[last], self.pdus[last] = last, key, pdu
  datagrams[key] = pdu
  if self.datagram_count > self.limits.datagrams then
    forget_oldest(self)
  end
  return false
end

-- The call to which a PDU belongs; nil for none.
local function call_of(self, pdu)
  local activity = self.activities.values[pdu.conversation]
  return activity and activity.by_seq[pdu.seq]
end

local function append(activity, seq, call)
  local count = activity.count + 1
  activity.count, activity.seqs[count], activity.by_seq[seq] = count, seq, call
end

-- Forgets the calls of which `is_over(call)` is true: an array of them, oldest first.
local function sweep(activity, is_over)
  local seqs, by_seq, kept, over = activity.seqs, activity.by_seq, 0, {}
  for place = 1, activity.count do
    local seq = seqs[place]
    if is_over(by_seq[seq]) then
      over[#over + 1] = by_seq[seq]
      by_seq[seq] = nil
    else
      kept = kept + 1
      seqs[kept] = seq
    end
  end
  for place = kept + 1, activity.count do
    seqs[place] = nil
  end
  activity.count = kept
  return over
end

local function count(self, name)
  local counts = self.counts
  counts[name] = counts[name] + 1
end

--- Takes one whole message (not a copy, see `is_copy`).
function CallTracker:feed(pdu)
  local ptype, counts = pdu.ptype, self.counts
  if ptype == 0 then
    counts.requests = counts.requests + 1
    self:_request(pdu)
  elseif ptype == 2 then
    counts.responses = counts.responses + 1
    self:_response(pdu)
  elseif ptype == 3 or ptype == 6 then
    count(self, ptype == 3 and "faults" or "rejects")
    self:_fault(pdu)
  else
    count(self, ptype == 1 and "pings" or ptype == 4 and "working" or "others")
  end
end

local function begun_key(pdu)
  return pdu.conversation .. pdu.seq
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

--- The capture is over: every open call is lost.
function CallTracker:finish()
  while self.activities.length > 0 do
    local _, activity = self.activities:pop_first()
    for place = 1, activity.count do
      local call = activity.by_seq[activity.seqs[place]]
      if not call.response then
        self:_lose(call)
      end
    end
  end
end

function CallTracker:_request(pdu)
  local activities, seq = self.activities, pdu.seq
  local key = pdu.conversation
  local activity = activities.values[key]
  if activity then
    if activities.newest ~= key then
      activities:move_to_end(key)
    end
  else
    activity = {newest = seq, by_seq = {}, seqs = {}, count = 0}
    activities:set(key, activity)
    self:_make_room()
  end
  self:_expire(activity, pdu.time_ns)
  local call = activity.by_seq[seq]
  if call then
    if self:_is_retransmission(activity, call, pdu) then
      count(self, "retransmissions")
      self.handlers:retransmission(call, pdu)
      return
    end
    if not call.response then
      self:_lose(call)
    end
    local former = call
    sweep(activity, function(one) return one == former end)
  end
  activity.newest = seq
  call = {request = pdu, response = nil, context = nil}
  append(activity, seq, call)
  self.handlers:request(call)
end

function CallTracker:_is_retransmission(activity, call, pdu)
  local request, response = call.request, call.response
  if request.opnum ~= pdu.opnum or request.body ~= pdu.body then
    return false
  end
  if not response then
    return true
  end
  return pdu.time_ns - response.time_ns <= self.limits.retransmission_ns and activity.newest == pdu.seq
end

function CallTracker:_response(pdu)
  local activity, call = self.activities.values[pdu.conversation], nil
  if activity then
    self:_expire(activity, pdu.time_ns)
    call = activity.by_seq[pdu.seq]
  end
  if not call then
    self.handlers:orphan_response(pdu, self.begun_requests:get(begun_key(pdu)) == nil)
  elseif not call.response then
    call.response = pdu
    self.handlers:response(call)
  elseif call.response.body ~= pdu.body then
    self.handlers:orphan_response(pdu, true)
  end
end

function CallTracker:_fault(pdu)
  local call = call_of(self, pdu)
  if call and not call.response then
    call.response = pdu
    self.handlers:fault(call, pdu)
  end
end

--- Gives up what is too old or too much. The usual case, that there is nothing, is on the way of every call.
function CallTracker:_expire(activity, now)
  local limits, there = self.limits, activity.count
  local oldest = activity.by_seq[activity.seqs[1]]
  if oldest == nil or there <= 2 * limits.answered_calls and there <= limits.calls
    and now - oldest.request.time_ns <= limits.call_expiry_ns then
    return
  end
  self:_expire_unanswered(activity, now)
  local more = activity.count - limits.calls
  if more > 0 then
    local pushed = sweep(activity, function()
      more = more - 1
      return more >= 0
    end)
    for _, call in ipairs(pushed) do
      if not call.response then
        self.handlers:pushed_out(call, "calls")
      end
    end
  end
end

--- Loses the unanswered calls that are too old and forgets all but the newest answered ones.
function CallTracker:_expire_unanswered(activity, now)
  local expiry, spare = self.limits.call_expiry_ns, -self.limits.answered_calls
  for place = 1, activity.count do
    if activity.by_seq[activity.seqs[place]].response then
      spare = spare + 1
    end
  end
  local over = sweep(activity, function(call)
    if call.response then
      spare = spare - 1
      return spare >= 0
    end
    return now - call.request.time_ns > expiry
  end)
  for _, call in ipairs(over) do
    if not call.response then
      self:_lose(call)
    end
  end
end

function CallTracker:_make_room()
  while self.activities.length > self.limits.activities do
    local _, activity = self.activities:pop_first()
    for place = 1, activity.count do
      local call = activity.by_seq[activity.seqs[place]]
      if not call.response then
        self.handlers:pushed_out(call, "activities")
      end
    end
  end
end

function CallTracker:_lose(call)
  count(self, "unanswered")
  self.handlers:lost(call)
end

return M
