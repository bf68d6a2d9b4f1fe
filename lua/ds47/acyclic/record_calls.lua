-- Record calls to DS47 events: what an RPC call carries, whether it is ours, and who hears of it.
--
-- Sits between the RPC calls (calls.lua) and the jobs (pairing.lua), and reports what is wrong with the
-- transport of a record call (DS1xx, DS202, DS208). Decodes a message once; compares nothing.
--
-- What happens to a record is an event: one of the methods under "Events", with up to three arguments (pdu,
-- record, detail). While the gate is open the method is called at once; a table is made only for an event
-- that has to wait. The record of a Write knows the job that was made of it (`record.job`).

local json = require("ds47.support.json")
local ordered = require("ds47.support.ordered")
local parameter = require("ds47.profidrive.parameter")
local records = require("ds47.profinet.records")
local rpc = require("ds47.profinet.rpc")
local tables = require("ds47.spec.tables")

local byte = string.byte
local SHARED_INDEX = require("ds47.acyclic.index47").SHARED_INDEX
local ar_key, half_of, parse_request = records.ar_key, records.half, records.parse_request
local decode_response = parameter.decode_response
local parse_halves, parse_response = records.parse_halves, records.parse_response

local M = {}

local OPERATIONS = {[rpc.READ] = "Read", [rpc.WRITE] = "Write", [rpc.READ_IMPLICIT] = "ReadImplicit"}

local RecordCalls = {}
RecordCalls.__index = RecordCalls
M.RecordCalls = RecordCalls

--- The handlers of a `CallTracker`.
--
-- `counts` says the record requests by index: {[index] = {read = n, write = n}}.
-- @param gate which records are ours
-- @param pairing hears of every Write and Read that is ours
-- @param codec dialects of the messages (options of parameter.lua, or nil)
-- @param listener takes the transport findings: listener:remark({rule, frame, args, offset, job}), and
--   hears of every answered Connect: listener:set_up(request, response)
function RecordCalls.new(gate, pairing, codec, listener)
  return setmetatable({
    gate = gate, pairing = pairing, codec = codec, listener = listener, counts = {},
    newest_ns = nil, newest_frame = 0, -- time and number of the newest frame of a call that is ours
    decode_request = parameter.remembering(codec),
    forgot_requests = false, -- whether a limit pushed out a request whose response may still come
    limits = ordered.new(), -- name of a limit -> what it pushed out: {frame = of the first, count}
  }, RecordCalls)
end

--- The first record in the beginning of a message; nil where that tells of none that can be ours.
function RecordCalls:first_record(pdu)
  local record
  if pdu.fragment ~= 0 then
    return nil
  elseif pdu.ptype == 0 then
    record = parse_request(pdu).records[1]
  elseif pdu.ptype == 2 then
    local _, answers = parse_response(pdu)
    record = answers[1]
  end
  return record and self.gate:concerns(record.index) and record or nil
end

-- The first record that a call asks for and that can be ours; nil for none.
function RecordCalls:_asked_by(call)
  for _, record in ipairs(call and call.context and call.context.records or {}) do
    if self.gate:concerns(record.index) then
      return record
    end
  end
  return nil
end

--- A message whose fragments did not become whole.
-- @param pdu its beginning, or the first that was seen of it
-- @param have number of its fragments
-- @param kind "RPC" or "IP"
-- @param limit name of the limit that pushed it out: the others may have come later; nil for none
-- @param call  the call that it answers, as far as that is known; nil for none
function RecordCalls:incomplete(pdu, have, kind, limit, call)
  local record = self:first_record(pdu) or self:_asked_by(call)
  if not record then
    return
  end
  if limit then
    self:_pass("_event_pushed_out", false, pdu, record, limit)
    self.forgot_requests = self.forgot_requests or pdu.ptype == 0
  else
    local remark = {rule = "DS105", frame = pdu.frame, args = {have = have, kind = kind}}
    local asked = call and call.context and not record.write and call.context.records[1]
    self:_pass(asked and "_event_call_remark" or "_event_remark", false, pdu, asked or record, remark)
  end
end

--- A limit pushed out something of ours that began in this frame.
function RecordCalls:limit_reached(limit, frame)
  local pushed = self.limits:get(limit)
  if not pushed then
    pushed = {frame = frame, count = 0}
    self.limits:set(limit, pushed)
  end
  pushed.count = pushed.count + 1
end

--- The capture is over: tells of each limit that pushed something out, once.
function RecordCalls:finish()
  for name, pushed in self.limits:iterate() do
    local args = {limit = name, most = tables.limits[name], count = pushed.count}
    self.listener:remark({rule = "DS109", frame = pushed.frame, args = args})
  end
end

-- Small things

-- Peers that were told, by what tells them apart.
local peers, peer_count, MOST_PEERS = {}, 0, 4096

local function known_peer(pdu)
  local key = pdu.client .. "\0" .. pdu.server .. "\0" .. pdu.object_uuid
  local peer = peers[key]
  if peer == nil then
    local vendor_id, device_id = rpc.device_identity(pdu.object_uuid)
    peer = {controller = pdu.client, device = pdu.server, vendor_id = vendor_id, device_id = device_id}
    if peer_count >= MOST_PEERS then
      peers, peer_count = {}, 0
    end
    peers[key], peer_count = peer, peer_count + 1
  end
  return peer
end

--- Who talks to whom: {controller, device, vendor_id, device_id}.
-- The same table again while it stays the same, so nobody may change it.
function M.peer(pdu)
  local peer = pdu.peer
  if peer == nil then
    peer = known_peer(pdu)
    getmetatable(pdu).peer = peer -- the head of its conversation
  end
  return peer
end

local peer_of = M.peer

local function count(self, index, write)
  local counts = self.counts[index]
  if not counts then
    counts = {read = 0, write = 0}
    self.counts[index] = counts
  end
  local name = write and "write" or "read"
  counts[name] = counts[name] + 1
end

--- Runs an event, now or when a shaped message of the same AR comes; never if none does.
function RecordCalls:_pass(method, shaped, pdu, record, detail)
  local ar = ar_key(peer_of(pdu), record)
  if self.gate:admit(ar, record.index, shaped, self) then
    self[method](self, pdu, record, detail)
  else
    self.gate:hold(ar, {method = method, pdu = pdu, record = record, detail = detail})
  end
end

--- Runs an event that the gate held back.
function RecordCalls:run(event)
  self[event.method](self, event.pdu, event.record, event.detail)
end

--- A finding about a record that is ours, or will turn out to be.
function RecordCalls:_about(pdu, record, remark)
  self:_pass("_event_remark", false, pdu, record, remark)
end

--- A finding about an RPC call: once, and with the first job that it carries.
function RecordCalls:_about_call(call, remark)
  local context = call.context
  if not context then
    return
  end
  for _, record in ipairs(context.records) do
    if self.gate:concerns(record.index) then
      self:_pass("_event_call_remark", false, call.request, record, remark)
      return
    end
  end
end

--- A record that is shorter than its stated length: cut by the capture, or wrong.
function RecordCalls:_length(pdu, record, half)
  if half.missing == 0 then
    return
  end
  local cut = pdu.missing ~= 0 and pdu.cut
  if cut then
    half.cut = true -- by the capture
    local args = {
      captured = cut.captured, original = cut.original, length = half.stated, completed = half.frame,
    }
    self:_about(pdu, record, {rule = "DS106", frame = cut.frame, args = args})
  else
    local args = {stated = half.stated, present = #half.data}
    self:_about(pdu, record, {rule = "DS202", frame = half.frame, args = args})
  end
end

-- Requests

function RecordCalls:request(call)
  local pdu = call.request
  local opnum = pdu.opnum
  if opnum == rpc.RELEASE then
    local ar = records.released_ar(pdu)
    if ar then
      self.pairing:release(pdu.client, pdu.server, ar, pdu.frame)
      local of_ar = records.ar_text(pdu.client, pdu.server, ar)
      self.gate:follow(of_ar, {method = "_event_release", pdu = pdu, record = ar})
    end
  elseif opnum == rpc.CONNECT then
    local ar, only = records.connected_ar(pdu), records.is_only_ar(pdu)
    self.pairing:connected(pdu.client, pdu.server, pdu.frame, ar, only)
  end
  if not OPERATIONS[opnum] then
    return
  end
  local body = parse_request(pdu)
  call.context = body
  local list = body.records
  if body.multiple then
    count(self, records.WRITE_MULTIPLE, true)
  end
  for number = 1, #list do
    count(self, list[number].index, list[number].write)
    self.pairing:goes_on(ar_key(peer_of(pdu), list[number]))
  end
  if body.nested then
    self.listener:remark({rule = "DS208", frame = pdu.frame, args = {}})
  end
  for number = 1, #list do
    local record = list[number]
    if self.gate:concerns(record.index) then
      self:_length(pdu, record, record.request)
      if record.write then
        local message = self.decode_request(record.request.data)
        self:_pass("_event_write_request", message.shaped, pdu, record, message)
      else
        self:_pass("_event_read_request", false, pdu, record)
      end
    end
  end
end

function RecordCalls:retransmission(call, pdu)
  local operation = OPERATIONS[pdu.opnum] or "?"
  local args = {operation = operation, first = call.request.frame}
  self:_about_call(call, {rule = "DS103", frame = pdu.frame, args = args})
end

function RecordCalls:lost(call)
  local context, pdu = call.context, call.request
  if not context then
    return
  end
  if not call.in_part then -- DS105 says what there is
    local args = {operation = OPERATIONS[pdu.opnum]}
    self:_about_call(call, {rule = "DS101", frame = pdu.frame, args = args})
  end
  self:_reads_lost(pdu, context)
end

--- A call without a response that a limit pushed out: one may still come.
function RecordCalls:pushed_out(call, limit)
  local context, pdu = call.context, call.request
  if not context then
    return
  end
  for _, record in ipairs(context.records) do
    if self.gate:concerns(record.index) then
      self.forgot_requests = true
      self:_pass("_event_pushed_out", false, pdu, record, limit)
      break
    end
  end
  self:_reads_lost(pdu, context)
end

function RecordCalls:_reads_lost(pdu, context)
  for _, record in ipairs(context.records) do
    if not record.write and self.gate:concerns(record.index) then
      self:_pass("_event_read_lost", false, pdu, record)
    end
  end
end

-- Responses

function RecordCalls:response(call)
  local pdu, context = call.response, call.context
  if pdu.opnum == rpc.CONNECT then
    self.listener:set_up(call.request, pdu)
  end
  if not context then
    return
  end
  local status, halves = parse_halves(pdu)
  local list = context.records
  for number = 1, #list do
    local record = list[number]
    if self.gate:concerns(record.index) then
      -- without a block of its own the status of the NDR header counts
      local half = halves[number] or half_of(pdu.frame, pdu.time_ns, status)
      record.response = half
      if not half.status then
        local remark = {rule = "DS108", frame = pdu.frame, args = {}}
        self:_pass("_event_call_remark", false, pdu, record, remark)
      end
      if record.write then
        self:_pass("_event_write_answered", false, pdu, record)
      else
        self:_read_answered(pdu, record, half)
      end
    end
  end
end

function RecordCalls:_read_answered(pdu, record, half)
  self:_length(pdu, record, half)
  local shaped = false
  if half.data ~= "" and half.missing == 0
    and self.gate:needs_proof(ar_key(peer_of(pdu), record), record.index) then
    shaped = decode_response(half.data, nil, self.codec).shaped
      or self.pairing:is_again(peer_of(pdu), record)
  end
  self:_pass("_event_read_answered", shaped, pdu, record)
end

--- A response to no known call; `certain`: that its request is not in the capture.
function RecordCalls:orphan_response(pdu, certain)
  local operation = OPERATIONS[pdu.opnum]
  if not operation then
    return
  end
  local _, answers = parse_response(pdu)
  for _, record in ipairs(answers) do
    if self.gate:concerns(record.index) then
      if certain and not self.forgot_requests then
        self:_about(pdu, record, {rule = "DS102", frame = pdu.frame, args = {operation = operation}})
      end
      if record.write then
        self:_pass("_event_write_unasked", false, pdu, record)
      else
        self:_read_answered(pdu, record, record.response)
      end
    end
  end
end

--- The first four bytes of a body as a number, fewer where fewer are there.
local function fault_code(pdu)
  local code, length = 0, math.min(4, #pdu.body)
  for number = 1, length do
    code = code * 256 + byte(pdu.body, pdu.little and length + 1 - number or number)
  end
  return code
end

function RecordCalls:fault(call, pdu)
  local args = {kind = rpc.PTYPES[pdu.ptype], fault = fault_code(pdu)}
  self:_about_call(call, {rule = "DS104", frame = pdu.frame, args = args})
  local context = call.context
  if not context then
    return
  end
  for _, record in ipairs(context.records) do
    if record.write and self.gate:concerns(record.index) then
      self:_pass("_event_write_failed", false, pdu, record)
    end
  end
end

-- Events: what happens to a record once it is known to be ours

--- Time of the capture; a finding where it steps backwards.
local function clock(self, pdu)
  local newest, before, now = self.newest_ns, self.newest_frame, pdu.time_ns
  if pdu.frame < before then -- that of an AR that proved itself late
    return
  end
  if newest and now < newest then
    local args = {milliseconds = json.float((newest - now) / 1e6), first = before}
    self.listener:remark({rule = "DS107", frame = pdu.frame, args = args})
  end
  self.newest_ns, self.newest_frame = now, pdu.frame
end

function RecordCalls:_event_remark(_, _, remark)
  self.listener:remark(remark)
end

function RecordCalls:_event_pushed_out(pdu, _, limit)
  self:limit_reached(limit, pdu.frame)
end

function RecordCalls:_event_call_remark(_, record, remark)
  remark.job = record.job
  self.listener:remark(remark)
end

function RecordCalls:_event_read_request(pdu, record)
  clock(self, pdu)
  record.job = self.pairing:expected(peer_of(pdu), record) -- for what is said of the call
end

function RecordCalls:_event_write_request(pdu, record, message)
  clock(self, pdu)
  record.job = self.pairing:write_request(peer_of(pdu), record, message)
end

function RecordCalls:_event_read_lost(pdu, record)
  self.pairing:read_lost(peer_of(pdu), record)
end

function RecordCalls:_event_write_answered(pdu, record)
  clock(self, pdu)
  local job = record.job
  if job then
    self.pairing:write_response(job, record.response)
  end
end

function RecordCalls:_event_write_unasked(pdu, record)
  self.pairing:write_unasked(peer_of(pdu), record)
end

-- What waited for its AR to prove itself is behind a Release then, as all else was when that came.
function RecordCalls:_event_release(pdu, ar)
  self.pairing:release(pdu.client, pdu.server, ar, pdu.frame, SHARED_INDEX)
end

function RecordCalls:_event_read_answered(pdu, record)
  clock(self, pdu)
  self.pairing:read_response(peer_of(pdu), record)
end

function RecordCalls:_event_write_failed(pdu, record)
  local job = record.job
  if job then
    self.pairing:write_response(job, half_of(pdu.frame, pdu.time_ns, nil), true)
  end
end

M.OPERATIONS = OPERATIONS
return M
