-- RPC calls to the records in them: passes the request and the response of each record to record_events.lua.
--
-- Takes RPC calls from calls.lua. Reports what is wrong with the transport of a record call (DS1xx, DS208).
-- Knows the address of a record, not its content.

local ordered = require("ds47.support.ordered")
local records = require("ds47.profinet.records")
local rpc = require("ds47.profinet.rpc")
local tables = require("ds47.spec.tables")

local byte = string.byte
local parse_request, without_block = records.parse_request, records.without_block
local parse_answers, parse_response = records.parse_answers, records.parse_response

local M = {}

local OPERATIONS = {[rpc.READ] = "Read", [rpc.WRITE] = "Write", [rpc.READ_IMPLICIT] = "ReadImplicit"}
local CONNECT, RELEASE = rpc.CONNECT, rpc.RELEASE
-- Limits that push out requests
local OF_REQUESTS = {calls = true, activities = true, pending_writes = true, unanswered_writes = true}

-- Peers, by what tells them apart.
local peers, peer_count, MOST_PEERS = {}, 0, 4096

local function who(pdu)
  local key = pdu.client .. "\0" .. pdu.server .. "\0" .. pdu.object_uuid
  local peer = peers[key]
  if peer == nil then
    local vendor_id, device_id = rpc.device_identity(pdu.object_uuid)
    peer = {controller = pdu.client, device = pdu.server, vendor_id = vendor_id, device_id = device_id}
    if peer_count >= MOST_PEERS then peers, peer_count = {}, 0 end
    peers[key], peer_count = peer, peer_count + 1
  end
  return peer
end

-- The same peer with the vendor that is known so far, or assumed.
local function with_vendor(peer, stations)
  local vendor_id, assumed = stations:vendor(peer.device)
  local known, only_assumed = peer.with_vendor, assumed and vendor_id or nil
  if known == nil or known.vendor_id ~= vendor_id or known.vendor_assumed ~= only_assumed then
    known = {
      controller = peer.controller, device = peer.device, vendor_id = vendor_id,
      vendor_assumed = only_assumed,
    }
    peer.with_vendor = known
  end
  return known
end

--- Who talks to whom: {controller, device, vendor_id, device_id}, and vendor_assumed, the same vendor, if it
-- is the user's assumption. Calls share this table, so it must not be changed.
-- @param stations knows the vendors of devices whose calls do not say it (stations.lua)
function M.peer(pdu, stations)
  local peer = pdu.peer
  if peer == nil then
    peer = who(pdu)
    if peer.vendor_id == nil and stations.vendor_id ~= nil then
      pdu.peer = with_vendor(peer, stations) -- of this PDU alone: the next one may know more
      return pdu.peer
    end
    getmetatable(pdu).peer = peer -- the head of its conversation
  end
  return peer
end

local peer_of = M.peer

-- The PDU, now with its peers: the origin of events.
local function placed(self, pdu)
  peer_of(pdu, self.stations)
  return pdu
end

local RecordCalls = {}
RecordCalls.__index = RecordCalls
M.RecordCalls = RecordCalls

--- The handlers of a `CallTracker`.
-- @param events  hears of every record that may be ours, and of connections that end (record_events.lua)
-- @param pairing  hears when a connection begins
-- @param listener  takes the transport findings: listener:remark({rule, frame, args, offset}, job or nil);
--   and hears of every answered Connect: listener:set_up(request, response)
-- @param stations  knows the vendors of devices whose calls do not say it (stations.lua)
-- @param completeness  hears of calls with an unknown place, because the capture cut them
function RecordCalls.new(events, pairing, listener, stations, completeness)
  return setmetatable({
    events = events, pairing = pairing, listener = listener, stations = stations,
    completeness = completeness, concerned = events.index47.concerned,
    alone = ordered.new(), -- frame -> DS102, for the newest responses without a request
    connections = ordered.new(), -- client and server -> the request that begins or ends an AR: `_goes_on`
    forgot_requests = false, -- whether a limit pushed out a request, so that its response may still come
    newest = 0, -- the frame of the newest response that concerns us
  }, RecordCalls)
end

function RecordCalls:message(pdu, src_mac) self.stations:message(pdu, src_mac) end

--- The first record in the beginning of a message; nil if it shows none that can be ours.
function RecordCalls:first_record(pdu)
  local record
  if pdu.fragment ~= 0 then return nil end
  if pdu.ptype == 0 then
    record = parse_request(pdu)
  elseif pdu.ptype == 2 then
    record = select(2, parse_response(pdu))
  end
  return record and self.concerned[record.index] and record or nil
end

-- This one or the next of its call that can be ours; nil for none. `record` may be nil.
local function ours_from(self, record)
  local ours = self.concerned
  while record and not ours[record.index] do record = record.following end
  return record
end

-- Tells what happened to each record of a call that can be ours: `event` is a method of record_events.lua.
local function tell_each(self, pdu, record, event, detail)
  record = ours_from(self, record)
  while record do
    self.events[event](self.events, placed(self, pdu), record, detail)
    record = ours_from(self, record.following)
  end
end

--- A message was given up before all its fragments were there.
-- @param pdu its first fragment, or the first one seen
-- @param have number of its fragments
-- @param kind "RPC" or "IP"
-- @param limit name of the limit that pushed it out: the others may have come later; nil for none
-- @param call  the call that it answers, if known; nil for none
function RecordCalls:incomplete(pdu, have, kind, limit, call)
  local asked = ours_from(self, call and call.context)
  local record = self:first_record(pdu) or asked
  if not record then return end
  if asked and (record == asked or not record.write) then record, pdu.peer = asked, call.request.peer end
  if limit then
    self.events:pushed_out(placed(self, pdu), record, limit)
    self.forgot_requests = self.forgot_requests or pdu.ptype == 0
  else
    local remark = {rule = "DS105", frame = pdu.frame, args = {have = have, kind = kind}}
    self.events[record.write and "remark" or "about"](self.events, placed(self, pdu), record, remark)
  end
end

--- The same as fragments.lua and ip.lua give it: {pdu or packet, have, limit}.
-- @param calls  those that are open
function RecordCalls:given_up(part, kind, calls)
  local pdu = part.pdu or rpc.parse(part.packet)
  if pdu ~= nil then self:incomplete(pdu, part.have, kind, part.limit, calls:open_call(pdu)) end
end

--- The capture is over: a remark for each limit that pushed something out (DS109). Not if it only pushed out
-- requests, and no response came since: then nothing was lost.
function RecordCalls:limits_reached()
  local found = {}
  for name, pushed in self.events.limits:iterate() do
    if not OF_REQUESTS[name] or self.newest > pushed.frame then
      local args = {limit = name, most = tables.limits[name], count = pushed.count}
      found[#found + 1] = {rule = "DS109", frame = pushed.frame, args = args}
    end
  end
  return found
end

--- A finding about an RPC call: once, and with the first job that it carries.
function RecordCalls:_about_call(call, remark)
  local record = ours_from(self, call.context)
  if record then self.events:about(placed(self, call.request), record, remark) end
end

-- Requests

-- An AR begins or ends, as the request says, or as a response without a request says.
function RecordCalls:_connection(pdu, opnum)
  local at = {frame = pdu.frame, time_ns = pdu.time_ns}
  if opnum == RELEASE then
    local ar = records.released_ar(pdu)
    if ar then self.events:released(records.ar_text(pdu.client, pdu.server, ar), at) end
  elseif opnum == CONNECT then
    local ar, only = records.connected_ar(pdu), records.is_only_ar(pdu)
    self.pairing:connected(pdu.client, pdu.server, at, ar, only)
  end
end

-- A connection begins or ends with the response, or with the next request of its client. Responses to earlier
-- requests may come in between, out of order (P79). Without either, nothing changes.
function RecordCalls:_goes_on(pdu)
  if self.connections.length == 0 then return end
  local key = rpc.pair(pdu.client, pdu.server)
  local begun = self.connections:get(key)
  if begun and (pdu.ptype ~= 0 or pdu.time_ns >= begun.time_ns) then
    self.connections:pop(key)
    self:_connection(begun, begun.opnum)
  end
end

-- A request that begins or ends an AR waits for its response; beyond a limit the oldest stops waiting.
function RecordCalls:_wait(pdu, opnum)
  local key = rpc.pair(pdu.client, pdu.server)
  if self.connections:get(key) then
    self:_connection(pdu, opnum) -- sent before the one that waits
  elseif opnum == CONNECT or opnum == RELEASE then
    self.connections:set(key, pdu)
  end
  if self.connections.length > tables.limits.activities then
    local _, oldest = self.connections:pop_first()
    self:_connection(oldest, oldest.opnum)
  end
end

function RecordCalls:asked(call)
  local pdu = call.request
  local opnum = pdu.opnum
  self:_goes_on(pdu)
  if not OPERATIONS[opnum] then
    self:_wait(pdu, opnum)
    return
  end
  local record, multiple, nested = parse_request(pdu)
  local events, pairing = self.events, self.pairing
  call.context = record
  if pdu.missing ~= 0 and (multiple or record == nil) then self.completeness:cut(pdu) end
  if multiple then events:wrote_multiple() end
  if pdu.peer == nil then peer_of(pdu, self.stations) end
  if pairing.any_replaced then pairing:goes_on(pdu.peer, record) end
  if nested then self.listener:remark({rule = "DS208", frame = pdu.frame, args = {}}) end
  while record do
    events:asked(pdu, record)
    record = record.following
  end
end

--- The request came after its response, which was already reported as one without a request.
function RecordCalls:late(call)
  local pdu, answer = call.request, call.response
  for _, alone in ipairs(self.alone:pop(answer.frame) or {}) do alone.withdrawn = true end
  local is_read = pdu.opnum == rpc.READ or pdu.opnum == rpc.READ_IMPLICIT
  local first = select(2, parse_response(answer))
  tell_each(self, pdu, first, "not_unasked")
  if not is_read or first == nil then
    self:asked(call)
    self:answered(call)
    return
  end
  local record = parse_request(pdu)
  while record do
    self.events:asked_late(placed(self, pdu), record, answer.frame)
    record = record.following
  end
end

function RecordCalls:again(call, pdu)
  self:_goes_on(pdu)
  local operation = OPERATIONS[pdu.opnum] or "?"
  local args = {operation = operation, first = call.request.frame}
  self:_about_call(call, {rule = "DS103", frame = pdu.frame, args = args})
end

function RecordCalls:lost(call)
  local context, pdu = call.context, call.request
  if not context then return end
  if not call.in_part then -- DS105 says what there is
    local args = {operation = OPERATIONS[pdu.opnum]}
    self:_about_call(call, {rule = "DS101", frame = pdu.frame, args = args})
  end
  tell_each(self, pdu, context, "lost")
end

--- A limit pushed out a call without a response: that may still come.
function RecordCalls:pushed_out(call, limit)
  local pdu, record = call.request, ours_from(self, call.context)
  if record then
    self.forgot_requests = true
    self.events:pushed_out(placed(self, pdu), record, limit)
  end
  tell_each(self, pdu, record, "lost")
end

-- Responses

function RecordCalls:answered(call)
  local pdu, record = call.response, call.context
  if not OPERATIONS[pdu.opnum] then
    self:_goes_on(pdu)
    if call.request.opnum == CONNECT then self.listener:set_up(call.request, pdu) end
  end
  if not record then return end
  local status, answered = parse_answers(pdu)
  local events, ours = self.events, self.concerned
  pdu.peer = call.request.peer -- from whatever address the response comes
  while record do
    if ours[record.place.index] then
      local half = answered or without_block(pdu, status, record.place.write)
      record.response, self.newest = half, pdu.frame
      if not (half.status or half.cut) then
        local remark = {rule = "DS108", frame = pdu.frame, args = {}}
        events:about(pdu, record, remark)
      end
      events:answered(pdu, record)
    end
    record, answered = record.following, answered and answered.following
  end
end

--- A response to no known call.
-- @param certain  that its request is not in the capture
-- @param before  the frame before which that was sent; nil if that is unknown
function RecordCalls:unasked(pdu, certain, before)
  local operation = OPERATIONS[pdu.opnum]
  if not operation then
    self:_goes_on(pdu)
    self:_connection(pdu, pdu.opnum)
    return
  end
  local first = select(2, parse_response(pdu))
  if first == nil then self.completeness:cut(pdu) end
  local record = ours_from(self, first)
  while record do
    self.newest, record.asked_before = pdu.frame, before
    if certain and not self.forgot_requests then
      local remark = {rule = "DS102", frame = pdu.frame, args = {operation = operation}}
      local alone = self.alone:get(pdu.frame) or {}
      alone[#alone + 1] = remark
      self.alone:keep(pdu.frame, alone, tables.limits.calls)
      self.events:about(placed(self, pdu), record, remark)
    end
    self.events:unasked(placed(self, pdu), record)
    record = ours_from(self, record.following)
  end
end

function RecordCalls:twice(call, pdu)
  local args = {
    operation = OPERATIONS[pdu.opnum] or "?", first = call.response.frame,
    has = call.again and "has_either" or "has_first",
  }
  self:_about_call(call, {rule = "DS111", frame = pdu.frame, args = args})
  local reads = pdu.opnum == rpc.READ or pdu.opnum == rpc.READ_IMPLICIT
  if call.again or reads then -- what that brought the device may have given away
    tell_each(self, call.request, call.context, "answered_twice")
  end
end

--- The first four bytes of a body as a number; fewer, if there are fewer.
local function fault_code(pdu)
  local code, length = 0, math.min(4, #pdu.body)
  for number = 1, length do
    code = code * 256 + byte(pdu.body, pdu.little and length + 1 - number or number)
  end
  return code
end

function RecordCalls:failed(call, pdu)
  local args = {kind = rpc.PTYPES[pdu.ptype], fault = fault_code(pdu)}
  self:_about_call(call, {rule = "DS104", frame = pdu.frame, args = args})
  if not call.context then self:_goes_on(pdu) end
  pdu.peer = call.request.peer
  tell_each(self, pdu, call.context, "failed")
end

return M
