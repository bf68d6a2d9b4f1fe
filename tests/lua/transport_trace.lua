-- Reads frames from standard input and tells, a line of JSON for each, what the transport modules of lua/ds47
-- make of them: PDUs, records, and the events that pairing would hear. test_lua_transport.py compares the
-- lines with what the Python modules say.
--
-- Input: tab-separated lines; bytes are hexadecimal, "-" stands for nil.
--   packet    frame time_ns src_ip dst_ip ip_id src_mac captured original payload src_port
--   fragment  frame time_ns src_ip dst_ip ip_id src_mac captured original offset more(0/1) missing data
--   station   kind src_mac dst_mac payload
--   end       the capture is over; what follows is another one
-- Usage: lua transport_trace.lua LUA_FOLDER [forbid_47]

package.path = arg[1] .. "/?.lua;" .. package.path

local calls = require("ds47.profinet.calls")
local completeness = require("ds47.profinet.completeness")
local connect = require("ds47.profinet.connect")
local dcp = require("ds47.profinet.dcp")
local Index47 = require("ds47.acyclic.index47").Index47
local ip = require("ds47.profinet.ip")
local json = require("ds47.support.json")
local lldp = require("ds47.profinet.lldp")
local stations = require("ds47.profinet.stations")
local recordcalls = require("ds47.acyclic.record_calls")
local recordevents = require("ds47.acyclic.record_events")
local records = require("ds47.profinet.records")
local rpc = require("ds47.profinet.rpc")
local tables = require("ds47.spec.tables")

local function hex(text)
  return text and (text:gsub(".", function(letter) return ("%02x"):format(letter:byte()) end))
end

local function bytes(text)
  return (text:gsub("..", function(pair) return string.char(tonumber(pair, 16)) end))
end

local function tell(kind, content)
  content.event = kind
  print(json.encode(content))
end

local function half_of(half)
  local data = half and half.data or ""
  return half and {
    frame = half.frame, time_ns = half.time_ns, data = hex(data), stated = half.stated or #data,
    missing = half.missing or 0, status = half.status,
  }
end

local function record_of(record)
  return {
    write = record.write, implicit = record.implicit, ar = hex(record.ar), api = record.api,
    slot = record.slot, subslot = record.subslot, index = record.index, position = record.position,
    request = half_of(record.request), response = half_of(record.response),
  }
end

local function list_of(record)
  local result = json.array({})
  while record do
    result[#result + 1], record = record_of(record), record.following
  end
  return result
end

local function tell_pdu(pdu, kind, packet)
  local body = hex(pdu.body)
  local vendor_id, device_id = rpc.device_identity(pdu.object_uuid)
  tell(kind, {
    ptype = pdu.ptype, little = pdu.little, object_uuid = hex(pdu.object_uuid), activity = hex(pdu.activity),
    seq = pdu.seq, opnum = pdu.opnum, fragment = pdu.fragment, last = pdu.last, fragmented = pdu.fragmented,
    body = body, missing = pdu.missing, frame = pdu.frame, time_ns = pdu.time_ns, source = pdu.source,
    destination = pdu.destination, client = pdu.client, server = pdu.server,
    source_mac = packet.src_mac, vendor_id = vendor_id, device_id = device_id,
  })
end

local function tell_records(pdu)
  local first, multiple, nested = records.parse_request(pdu)
  local status, answers = records.parse_response(pdu)
  tell("records", {
    multiple = multiple, nested = nested, requests = list_of(first), status = status,
    answers = list_of(answers), released = hex(records.released_ar(pdu)),
  })
end

-- Stands for pairing and for whoever takes the findings: tells what it hears.
local Ear = {}
Ear.__index = Ear

function Ear:write_request(peer, record, message)
  self.jobs = self.jobs + 1
  tell("write_request", {job = self.jobs, peer = peer, record = record_of(record), shaped = message.shaped})
  return {number = self.jobs}
end

function Ear.write_response(_, job, half, fault)
  tell("write_response", {job = job.number, half = half_of(half), fault = fault or false})
end

function Ear.read_response(_, peer, record)
  tell("read_response", {peer = peer, record = record_of(record)})
end

function Ear.expected()
  return nil
end

function Ear.read_over() end

function Ear.read_lost(_, peer, record)
  tell("read_lost", {peer = peer, record = record_of(record)})
end

function Ear.read_asked_late(_, peer, record, answer)
  tell("read_asked_late", {peer = peer, record = record_of(record), answer = answer})
end

function Ear.release(_, of_ar, at, index)
  local controller, device, ar = of_ar:match("^([^%z]*)%z([^%z]*)%z(.*)$")
  tell("release", {controller = controller, device = device, ar = hex(ar), frame = at.frame, index = index})
end

function Ear.write_unasked(_, peer, record)
  tell("write_unasked", {peer = peer, record = record_of(record)})
end

function Ear.is_again()
  return false
end

function Ear.goes_on()
end

local function data_of(data)
  return data and {
    reference = data.reference, frame_id = data.frame_id, offset = data.offset, length = data.length,
    iops = data.iops, cycle_ns = data.cycle_ns, frame_length = data.frame_length,
  }
end

-- A Connect with the frame ids that the device gave.
function Ear.set_up(_, request, response)
  local asked = connect.parse_request(request)
  local ar, mac, ids = connect.parse_response(response)
  if asked == nil or ar == nil then
    tell("set_up", {asked = asked ~= nil, told = ar ~= nil})
    return
  end
  connect.answered(asked, ids)
  local found = {}
  for number, each in ipairs(asked.submodules) do
    found[number] = {
      api = each.api, slot = each.slot, subslot = each.subslot, ident = each.ident,
      input = data_of(each.input), output = data_of(each.output),
    }
  end
  table.sort(found, function(a, b)
    if a.api ~= b.api then return a.api < b.api end
    return a.slot < b.slot or a.slot == b.slot and a.subslot < b.subslot
  end)
  tell("set_up", {
    asked = hex(asked.ar), told = hex(ar), controller_mac = hex(asked.controller_mac), device_mac = hex(mac),
    submodules = json.array(found),
  })
end

function Ear.connected(_, controller, device, at, _, only)
  tell("connected", {controller = controller, device = device, frame = at.frame, only = only or false})
end

function Ear.remark(_, remark, job)
  tell("remark", {
    rule = remark.rule, frame = remark.frame, args = remark.args, offset = remark.offset,
    job = job and job.number,
  })
end

local function new_run()
  local ear = setmetatable({jobs = 0}, Ear)
  local index47 = Index47.new({}, tables.limits.waiting_calls, arg[2] == "forbid_47")
  local events = recordevents.RecordEvents.new(index47, ear, nil, ear)
  local missing = completeness.new(tables.limits.activities)
  local run = {
    events = events, records = recordcalls.RecordCalls.new(events, ear, ear, nil, missing),
    stations = stations.Stations.new(), reassembly = ip.Reassembler.new(tables.limits),
    given_up = {}, packet = nil, fragmented = false,
  }
  function run.records.message(_, whole, src_mac)
    if run.fragmented then tell_pdu(whole, "whole", run.packet) end
    tell_records(whole)
    run.stations:message(whole, src_mac)
  end
  function run.records.given_up(_, part) run.given_up[#run.given_up + 1] = part end
  run.calls = calls.CallTracker.new(tables.limits, run.records, missing)
  return run
end

local function feed(run, packet)
  local pdu = rpc.parse(packet)
  if not pdu then
    return
  end
  tell_pdu(pdu, "pdu", packet)
  run.packet, run.fragmented = packet, pdu.fragmented
  run.calls:take(pdu, packet.ip_id, packet.src_mac)
end

local function finish(run)
  for _, parts in ipairs({run.given_up, run.calls.fragments:unfinished()}) do
    for _, part in ipairs(parts) do
      run.records:incomplete(part.pdu, part.have, "RPC", part.limit)
    end
  end
  for _, parts in ipairs({run.reassembly.given_up, run.reassembly:unfinished()}) do
    for _, part in ipairs(parts) do
      local pdu = rpc.parse(part.packet)
      if pdu then
        tell_pdu(pdu, "unfinished", part.packet)
        run.records:incomplete(pdu, part.have, "IP", part.limit)
      end
    end
  end
  local unanswered, rpc_counts = run.calls:unanswered(), run.calls.counts
  rpc_counts.unanswered = rpc_counts.unanswered + #unanswered
  for _, call in ipairs(unanswered) do
    run.records:lost(call)
  end
  for _, remark in ipairs(run.records:limits_reached()) do
    run.records.listener:remark(remark)
  end
  local counts = {}
  for index, count in pairs(run.events.counts) do
    counts[tostring(index)] = count
  end
  tell("end", {rpc = rpc_counts, records = counts, devices = json.array(run.stations:devices())})
end

local function fields(line)
  local result = {}
  for field in (line .. "\t"):gmatch("(.-)\t") do
    result[#result + 1] = field
  end
  return result
end

local function whole_number(text)
  return math.floor(tonumber(text)) -- an integer also where Lua has them
end

local function text_or_nil(text)
  return text ~= "-" and text or nil
end

local run = new_run()
for line in io.lines() do
  local f = fields(line)
  if f[1] == "station" then
    local payload, src_mac, dst_mac = bytes(f[5]), text_or_nil(f[3]), text_or_nil(f[4])
    local parse = f[2] == "dcp" and dcp.parse or lldp.parse
    tell("station", {station = parse(payload, src_mac, dst_mac)})
    run.stations:station(f[2], payload, src_mac, dst_mac)
  elseif f[1] == "end" then
    finish(run)
    run = new_run()
  else
    local part = {
      frame = whole_number(f[2]), time_ns = whole_number(f[3]), src_ip = f[4], dst_ip = f[5],
      ip_id = whole_number(f[6]), src_mac = text_or_nil(f[7]),
    }
    local captured, original = whole_number(f[8]), whole_number(f[9])
    part.cut = original > captured and {frame = part.frame, captured = captured, original = original} or nil
    if f[1] == "packet" then
      part.payload, part.src_port = bytes(f[10]), whole_number(f[11])
      feed(run, part)
    else
      part.offset, part.more = whole_number(f[10]), f[11] == "1"
      part.missing, part.data = whole_number(f[12]), bytes(f[13])
      local packet = run.reassembly:feed(part)
      if packet then
        feed(run, packet)
      end
    end
  end
end
