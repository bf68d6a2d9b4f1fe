-- From packets to transactions and findings: the pipeline.
--
--   packets -> RPC messages -> record calls -> jobs -> transactions with findings
--
-- Each step is a module of its own; here they are only joined, and it is kept what they said. Where the
-- packets come from (Wireshark, a test) is not known here, and no output format either.
--
-- A capture that is looked at may go on. So its end is judged from what is open (acyclic/ending.lua), and
-- the analysis itself stays as it was.

local later = require("ds47.support.later").module

local arrays = require("ds47.support.arrays")
local bus = require("ds47.profibus.bus")
local lists = require("ds47.parameters.naming")
local idents = require("ds47.profibus.idents")
local calls = require("ds47.profinet.calls")
local channels = require("ds47.cyclic.channels")
local completeness = require("ds47.profinet.completeness")
local conclusions = require("ds47.cyclic.conclusions")
local dictionary = require("ds47.profidrive.dictionary")
local ending = later("ds47.acyclic.ending")
local diagnosis = require("ds47.diagnosis.transaction")
local findings = require("ds47.findings.collection")
local Index47 = require("ds47.acyclic.index47").Index47
local ip = require("ds47.profinet.ip")
local learning = require("ds47.acyclic.learning")
local named = require("ds47.cyclic.named")
local ms1calls = require("ds47.acyclic.ms1_calls")
local stations = require("ds47.profinet.stations")
local pairing = require("ds47.acyclic.pairing")
local pkw = require("ds47.cyclic.transactions")
local ppo = require("ds47.cyclic.ppo")
local pkw_judge = require("ds47.cyclic.judge")
local parameter = require("ds47.profidrive.parameter")
local recordcalls = require("ds47.acyclic.record_calls")
local recordevents = require("ds47.acyclic.record_events")
local records = require("ds47.profinet.records")
local relations = require("ds47.cyclic.relations")
local rpc = require("ds47.profinet.rpc")
local rules = require("ds47.acyclic.judge")
local services = require("ds47.acyclic.services")
local status = require("ds47.spec.statuses")
local tables = require("ds47.spec.tables")
local new_time = require("ds47.support.times").new
local transactions = require("ds47.acyclic.transactions")

local parse, decode_response = rpc.parse, parameter.decode_response

local M = {}

local NONE = {}

local Analysis = {}
Analysis.__index = Analysis

--- A new analysis.
-- @param options what a user may choose; nil, or any of:
--   indices       set of further record indices that carry the parameter channel
--   forbid_47     true: index 47 never does
--   slow_ms       share of the drive from which a transaction is slow; nil for the shipped limit
--   ignore        array of rule ids or prefixes to leave out
--   codec         dialects of the parameter channel, as parameter.lua takes them
--   pkw_layout    layout of IND in PKW, "cyclic" or "uss" (docs/cyclic.md 2)
--   pkw_layouts   the same by the IP address of the device, where it is not that
--   cyclic        channels in cyclic frames that are named by hand, as named.lua takes them
--   ppos          numbers of PPO by the address of the station on PROFIBUS, where Chk_Cfg is missing
--   vendor_id     PROFINET vendor id of devices of which the capture shows none
--   frame_numbers  nil, or those that frames had before somebody chose them: every one of a watched channel
--                 is looked at then
--   frames_dropped  whether the capture says that frames are missing (docs/pairing.md P47)
function M.new(options)
  options = options or {}
  local limits = tables.limits
  local slow_ns = options.slow_ms and math.floor(options.slow_ms * 1e6) or limits.slow_ns
  local codec = options.codec or {} -- one table: by it, too, layouts of responses are known
  local self = setmetatable({
    base_seconds = nil, -- second since 1970 that all times are relative to: see `time_ns`
    options = options,
    codec = codec,
    findings = findings.new(options.ignore),
    diagnoses = diagnosis.new(codec),
    stations = stations.Stations.new(nil, options.vendor_id),
    reassembly = ip.Reassembler.new(limits),
    finished_jobs = transactions.store(codec),
    original = nil, -- the frame of which the last one is a mirror port's copy; nil of all others
    result = nil,
  }, Analysis)
  local function lost_on_line(station) return self.bus.line:lost(station) end
  self.completeness = completeness.new(limits.activities, lost_on_line)
  self.pairing = pairing.new(limits, self, self.completeness)
  self.index47 = Index47.new(options.indices, limits.waiting_calls, options.forbid_47)
  self.judge = rules.new(limits, slow_ns, function(peer, frame)
    return self.index47:waits(peer.device) or self.pairing:may_lack(peer, frame)
  end)
  self.dictionary = dictionary.new(self.judge.written.objects, limits.described_parameters)
  self.events = recordevents.RecordEvents.new(self.index47, self.pairing, self.codec, self)
  self.records = recordcalls.RecordCalls.new(
    self.events, self.pairing, self, self.stations, self.completeness)
  self.calls = calls.CallTracker.new(limits, self.records, self.completeness)
  local makers = idents.new(options.vendor_id)
  self.ms1 = ms1calls.new(self.events, self.findings, makers)
  self.services = services.CallTracker.new(self.ms1)
  self.start_ups = ms1calls.start_ups(self.pairing)
  self.cyclic = channels.new(self, limits, options.frame_numbers, self.stations)
  self.cyclic:name(named.relations(options.cyclic or NONE))
  local named_ppo = ppo.new(self.cyclic, options.ppos or NONE, makers)
  self.bus = bus.new({makers, self.start_ups, self.services, named_ppo})
  self.conclusions = conclusions.new(limits, self.cyclic)
  return self
end

-- What is fed

--- A time as `packet` and `fragment` take it, relative to the first second that was asked for (times.lua).
-- @param seconds, nanoseconds  since 1970, whole numbers
function Analysis:time_ns(seconds, nanoseconds)
  local base = self.base_seconds
  if base == nil then
    base = seconds
    self.base_seconds = base
  end
  return new_time(seconds - base, nanoseconds)
end

-- A frame comes: what the one before it did is forgotten.
local function begin(self, frame)
  local live = self.pairing
  self.result, self.original, self.ms1.newest, self.calls.newest = nil, nil, nil, nil
  live.frame, live.touched_count = frame, 0
end

--- Takes the PDU of a whole UDP datagram.
-- @param ip_id  the identification of its IP header
-- @param src_mac  whose frame it came in, or the one that completed it: text, nil where that is not known
function Analysis:datagram(pdu, ip_id, src_mac)
  begin(self, pdu.frame)
  self.original = self.calls:take(pdu, ip_id, src_mac)
end

--- Takes one whole UDP datagram: {payload, frame, time_ns, src_ip, dst_ip, src_port, ip_id, src_mac, cut},
-- see rpc.lua.
-- The table is not kept.
function Analysis:packet(packet)
  local pdu = parse(packet)
  if pdu == nil then return begin(self, packet.frame) end
  self:datagram(pdu, packet.ip_id, packet.src_mac)
end

--- Takes one IP fragment: {frame, time_ns, src_ip, dst_ip, ip_id, offset, more, data, cut}, see ip.lua.
function Analysis:fragment(fragment)
  begin(self, fragment.frame)
  local parts = self.reassembly
  local packet, given_up = parts:feed(fragment), parts.given_up
  self.original = parts.original
  if given_up[1] then
    parts.given_up = {}
    for _, part in ipairs(given_up) do self.records:given_up(part, "IP", self.calls) end
  end
  if packet ~= nil then
    self:packet(packet)
    return
  end
  local first = parts.begun(fragment)
  local pdu = first and parse(first)
  if pdu then self.calls:take_fragment(pdu) end
end

--- Takes a cyclic frame that is watched and is looked at (`is_news` of channels.lua).
-- @param row, at as `row_of` gives them
-- @param number, time_ns  of the frame
function Analysis:cyclic_frame(row, frame, at, number, time_ns)
  begin(self, number)
  self.cyclic:frame(row, frame, at, number, time_ns)
end

--- Takes a frame of PROFIBUS.
-- @param link_type  one of those that profibus/bus.lua knows
-- @param number, time_ns  of the frame
-- @param cut  true: the recording has not all of it
-- @return the frame as profibus/telegram.lua decodes it; nil where nothing proves that it is one
function Analysis:bus_frame(link_type, data, number, time_ns, cut)
  begin(self, number)
  return self.bus:take(link_type, data, number, time_ns, cut)
end

--- Takes what names a station: the payload of a DCP ("dcp", from the frame id on) or LLDP ("lldp") frame.
-- @param src_mac, dst_mac  text; nil where the link type has none
function Analysis:station(kind, payload, src_mac, dst_mac)
  self.result = nil
  self.stations:station(kind, payload, src_mac, dst_mac)
end

-- What the last packet did

-- The jobs that the last packet asks for are behind the others then. Index47 let the request of a record
-- pass that knows one; only a request that came again may find another one, or one at last.
local function add_asked(self, jobs, roles, count)
  local service, call, record, peer = self.ms1.newest, self.calls.newest, nil, nil
  if service then
    record, peer = service.record, ms1calls.peer(service.master, service.station)
  elseif call and call.response == nil then
    record, peer = call.context, self.calls.asks_again and recordcalls.peer(call.request, self.stations)
  end
  while record do
    if not record.write then
      local job = record.job
      if peer then
        local is_ours = self.index47:is_open(records.ar_key(peer, record), record.index)
        job = is_ours and self.pairing:expected(peer, record)
      end
      if job then
        count = count + 1
        jobs[count], roles[count] = job, "read_request"
      end
    end
    record = record.following
  end
  return count
end

--- The jobs that the last packet touched, and how; a role is one of "write_request", "write_response",
-- "read_request", "read_response", "poll", "reread", "empty_read".
-- @return an array of jobs, one of their roles, and how many of them count; only until the next packet
function Analysis:touched()
  local live, call = self.pairing, self.calls.newest
  local jobs, roles, count = live.touched_jobs, live.touched_roles, live.touched_count
  if call and call.response ~= nil and not self.ms1.newest then
    return jobs, roles, count -- nothing is asked for
  end
  return jobs, roles, add_asked(self, jobs, roles, count)
end

-- A transaction of PKW as far as it has got, with what the drive and the lists of a user say of it.
local function exchange(self, relation, job, layout)
  job.order = job.order or self.pairing:number()
  local item = pkw.build(relation, job, layout)
  self.dictionary:explain(item)
  lists.explain(item)
  return item
end

-- The findings of those remarks that are wanted, none of them kept.
local function findings_of(self, remarks)
  local wanted = arrays.filtered(remarks, function(remark) return self.findings:wanted(remark.rule) end)
  return arrays.mapped(wanted, function(remark) return self.findings:finding(remark) end)
end

--- The transactions of PKW that the last cyclic frame began or responded to, as far as they are proven:
-- array of {item = transaction as far as it has got, role, findings that are certain on that frame}.
function Analysis:cyclic_touched()
  local newest = self.pairing.frame
  return arrays.mapped(self.cyclic:touched(newest), function(each)
    local job, layout, certain = each.job, self:pkw_layout(each.relation.device), {}
    local item = exchange(self, each.relation, job, layout)
    for _, remark in ipairs(job.state and NONE or pkw_judge.remarks(each.relation, job, layout)) do
      remark.order, remark.of = job.order, each.relation
      if remark.frame == newest then certain[#certain + 1] = remark end
    end
    return {item = item, role = each.role, findings = findings_of(self, certain)}
  end)
end

--- What is certain of a job that has no answer yet: array of findings, none of them kept.
-- An answered job has none: those are kept already (`findings:at`).
function Analysis:peek(job)
  local remarks = job.phase ~= "closed" and not job.remarks and self.judge:certain(job) or NONE
  return remarks[1] and findings_of(self, remarks) or NONE
end

-- The end

--- The complete result, as if the capture ended here; the analysis goes on as if nothing was asked.
-- The same table until the next packet. {transactions, findings, devices, rpc, records, relations,
-- timelines}: transactions by `id`, findings by frame and rule, rpc and records (by index) as counts. Nobody
-- may change it, and of an older result only numbers may differ from a newer one: transactions that were
-- finished before are the same tables, with their newest `id` and `findings`.
function Analysis:ended()
  self.result = self.result or ending.result(self)
  return self.result
end

-- What pairing and the record calls tell

--- A transport finding.
-- @param job  the one that the call is of; may be nil
function Analysis:remark(remark, job)
  if job then
    job:note_call(remark.rule, remark.frame)
    remark.order = job.order
  end
  self.findings:add(remark)
end

--- A Write asks for something.
function Analysis:asked(job)
  self.judge:asked(job)
  learning.ask(self.dictionary, job) -- what is known when only the request is there
end

function Analysis:refused(job) self.judge:refused(job) end

function Analysis:connected(device, frame) self.judge:connected(device, frame) end

function Analysis:answered(job)
  local half = job.read_response
  if half ~= nil and half.data ~= "" then
    job.response = decode_response(half.data, job.message, self.codec, half.cut)
  end
  local remarks = self.judge:answered(job)
  job.remarks = remarks
  learning.answered(self.dictionary, job)
  if remarks[1] then self.findings:foresee(remarks) end
end

--- Nothing more can come for a job.
function Analysis:closed(job)
  local remarks = job.remarks
  job.remarks = nil
  if remarks == nil then
    remarks = self.judge:unanswered(job, false)
    local asked = job.limit and job:write_request()
    if asked then self.events:push_out(job.limit, asked.frame) end
    self.findings:foresee(remarks)
  end
  self:conclude(job, remarks)
end

--- A job is over: its remarks are kept, and what they were caused by is asked.
function Analysis:conclude(job, remarks)
  if job.response == nil then learning.ask(self.dictionary, job) end
  self.findings:keep(remarks)
  local refused = self.judge:closed(job)
  if refused then self.findings:add(refused) end
  local diagnoses = self.diagnoses:closed(job)
  for number = 1, #diagnoses do self.findings:add(diagnoses[number]) end
  self.finished_jobs:add(job)
  self:_explain(job.order)
end

-- Whether the state of its drive explains the transaction of this order, which is over.
function Analysis:_explain(order)
  if not self.cyclic:has_drives() then return end
  local remark = self.conclusions:transaction(self.finished_jobs:by_order(order))
  if remark then
    remark.order = order
    self.findings:add(remark)
  end
end

--- What a question alone had proved is no drive (docs/pairing.md P20): nothing of it was said.
-- @param ar  the key of the AR; what is open of it at index 47 is over
function Analysis:no_drive(ar) self.findings:withdraw(ar, self.finished_jobs:forget(ar)) end

--- A closed job is about to change: its transaction stays what it is.
function Analysis:late(job) self.finished_jobs:late(job) end

--- A Connect and its response.
function Analysis:set_up(request, response) self.cyclic:connected(request, response) end

--- The layout of IND in what a device says by PKW.
function Analysis:pkw_layout(device)
  local options = self.options
  return options.pkw_layouts and options.pkw_layouts[device] or options.pkw_layout or "cyclic"
end

-- The newest frame before which something that was said with a station was not seen.
local function unseen(self, device)
  local line, station = self.bus.line, tonumber(device:match("%d+$"))
  return math.max(line.unsure, line:lost(station))
end

--- A transaction of PKW is over.
function Analysis:exchanged(relation, job)
  self.cyclic:identify()
  local layout = self:pkw_layout(relation.device)
  if relations.is_bus(relation) then
    -- Else its response may be there.
    job.heard = job.heard and unseen(self, relation.device) < job.request.at.frame
  end
  self.finished_jobs:add_made(exchange(self, relation, job, layout))
  for _, remark in ipairs(self.conclusions:exchanged(relation, job, layout)) do
    remark.order = job.order
    self.findings:add(remark)
  end
  self:_explain(job.order)
end

--- A Read without record on a channel that has no request (docs/pairing.md P33).
-- @param missing  what may be missing of the requests (P73); nil where nothing can be
function Analysis:nothing_to_read(peer, record, missing)
  local half, device = record.response, peer.device
  if half == nil or half.status == nil then return end -- without a status it is DS108, the cause
  local args = {status = status.status_hex(half.status)}
  local never = peer.station and self.start_ups:seen(device, half.frame, unseen(self, device))
    and not self.ms1:was_written(device, record.index, half.frame)
  if never then -- what the capture shows since the start-up cannot lie before it
    args.device, args.index = device, record.index
  end
  local remark = missing and not never and rules.remark("DS110", half.frame, missing)
    or rules.remark(never and "DS808" or "DS206", half.frame, args)
  remark.ar = records.ar_of_47(peer, record)
  self.findings:add(remark)
end

return M
