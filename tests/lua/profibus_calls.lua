-- Reads frames of PROFIBUS, one in hexadecimal digits a line from stdin, and tells, a line of JSON for each,
-- what becomes of them: exchanges, calls, and the jobs that the pairing makes of these. "end" ends a line of
-- PROFIBUS and says what it counted; what follows is another one. The other side is
-- tests/python/test_lua_profibus.py.

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. package.path

local calls = require("ds47.acyclic.services")
local json = require("ds47.support.json")
local line = require("ds47.profibus.line")
local pairing = require("ds47.acyclic.pairing")
local parameter = require("ds47.profidrive.parameter")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")
local telegram = require("ds47.profibus.telegram")

local function or_null(value)
  if value == nil then return json.null end
  return value
end

local function tell(event, content)
  content.event = event
  io.write(json.encode(content), "\n")
end

local function mapped(items, change)
  local found = json.array({})
  for i, item in ipairs(items) do found[i] = change(item) end
  return found
end

local function frame_of(seen)
  return seen and seen.frame or json.null
end

local function half_of(half)
  if not half then return json.null end
  return {
    frame = half.frame, time_ns = half.time_ns, data = reader.hex(half.data), stated = half.stated or 0,
    missing = half.missing or 0, status = or_null(half.status),
  }
end

local function record_of(record)
  return {
    write = record.write, implicit = record.implicit, ar = reader.hex(record.ar), api = record.api,
    slot = record.slot, subslot = record.subslot, index = record.index, position = record.position,
    request = half_of(record.request), response = half_of(record.response),
  }
end

local function tell_exchange(exchange)
  tell("exchange", {
    request = exchange.request.frame, answer = frame_of(exchange.answer),
    again = exchange.again, silent = exchange.silent,
  })
end

-- The handlers of the calls, and the listener of the pairing.
local Ear = {}
Ear.__index = Ear

local function new_ear()
  local ear = setmetatable({numbers = {}, count = 0, peers = {}}, Ear)
  ear.pairing = pairing.new(tables.limits, ear)
  return ear
end

function Ear:peer(call)
  local key = call.master .. " " .. call.station
  local peer = self.peers[key] or {controller = tostring(call.master), device = tostring(call.station)}
  self.peers[key] = peer
  return peer
end

function Ear:call(event, call)
  tell(event, {
    call = self.numbers[call], master = call.master, station = call.station, sap = call.sap,
    fault = or_null(call.fault), record = record_of(call.record),
  })
end

-- An event of a job has one argument, that of a call too: a job knows its phase.
function Ear:asked(item)
  if item.phase then return end
  self.count = self.count + 1
  self.numbers[item] = self.count
  self:call("asked", item)
  local record = item.record
  if record.write then
    local message = parameter.decode_request(record.request.data)
    record.job = self.pairing:write_request(self:peer(item), record, message)
  else
    self.pairing:expected(self:peer(item), record)
  end
end

function Ear:answered(item)
  if item.phase then return end
  self:call("answered", item)
  local record = item.record
  if record.write then
    self.pairing:write_response(record.job, record.response)
  else
    self.pairing:read_response(self:peer(item), record)
  end
end

function Ear:failed(call)
  self:call("failed", call)
  if call.record.write then
    self.pairing:write_response(call.record.job, nil, true)
  end
end

function Ear:lost(call)
  self:call("lost", call)
  if not call.record.write then
    self.pairing:read_lost(self:peer(call), call.record)
  end
end

function Ear.unasked(_, call)
  tell("unasked", {
    master = call.master, station = call.station, sap = call.sap, record = record_of(call.record),
  })
end

function Ear.refused() end
function Ear.late() end
function Ear.nothing_to_read() end

function Ear.closed(_, job)
  tell("closed", {
    controller = job.peer.controller, device = job.peer.device, phase = job.phase, reason = job.reason,
    request = half_of(job:write_request()), write_response = half_of(job.write_response),
    refused = job.write_refused, read_request = half_of(job.read_request),
    read_response = half_of(job.read_response), reference = or_null(job:reference()),
    polls = mapped(job.polls, function(poll) return poll.response.frame end),
    rereads = mapped(job.rereads, function(read) return read.response.frame end),
    superseded_by = or_null(job.superseded_by),
  })
end

local function new_run()
  local ear = new_ear()
  return {ear = ear, line = line.Line.new(), calls = calls.CallTracker.new(ear), frame = 0}
end

local function over(run, ...)
  for _, exchange in ipairs({...}) do
    tell_exchange(exchange)
    run.calls:take(exchange)
  end
end

local run = new_run()
for text in io.lines() do
  if text == "end" then
    over(run, run.line.open)
    for _, call in ipairs(run.calls:unanswered()) do
      run.ear:lost(call)
    end
    for _, job in ipairs((run.ear.pairing:left_open())) do
      run.ear:closed(job)
    end
    tell("end", {unsure = run.line.unsure})
    run = new_run()
  elseif text == "cut" then
    run.cut = true -- the recording did not keep its frames whole
  else
    run.frame = run.frame + 1
    local item = telegram.decode(reader.unhex(text))
    over(run, run.line:take({frame = run.frame, time_ns = run.frame * 1000000, item = item}, run.cut))
  end
end
