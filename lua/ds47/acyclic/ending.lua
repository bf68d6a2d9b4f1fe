-- The end of a capture, judged from what is open: the complete result, as if nothing more came.
--
-- A capture that is looked at may go on, so nothing of its analysis is changed here. What is open is closed
-- as a copy: jobs (pairing.lua) and channels of cyclic frames (channels.lua). What that shows lies on top of
-- what is finished, in memories of this one result.

local flat = require("ds47.support.flat").copy
local lose_read = require("ds47.acyclic.pairing").lose_read
local ms1calls = require("ds47.acyclic.ms1_calls")
local recordcalls = require("ds47.acyclic.record_calls")
local records = require("ds47.profinet.records")
local pair = require("ds47.profinet.rpc").pair

local M = {}

-- What happens to records at the end, in place of record_events.lua: nobody knows any more that one is ours
-- than before, so nothing waits.
local Events = {}
Events.__index = Events

local function is_ours(self, origin, record)
  local index47, peer = self.index47, origin.peer
  return index47:is_open(records.ar_key(peer, record), record.index)
    or index47:is_of_drive(peer.device, record.place)
end

function Events:remark(origin, record, remark)
  if is_ours(self, origin, record) then self.findings:add(remark) end
end

function Events:about(origin, record, remark)
  local job = record.job
  if job and is_ours(self, origin, record) then
    remark.order = job.order
    if self.twins[job] then self.twins[job]:note_call(remark.rule, remark.frame) end
  end
  self:remark(origin, record, remark)
end

function Events:lost(origin, record)
  if record.write or not is_ours(self, origin, record) then return end
  local twin = self.twins[record.job or false]
  if twin and twin.read_response == nil then lose_read(twin, record.request) end
end

-- Tells the jobs that are open which of their calls stay as they are; gives the counts of RPC then.
local function lose_calls(live, events)
  local calls, counts = live.calls:unanswered(), flat(live.calls.counts)
  local told = recordcalls.RecordCalls.new(events, nil, nil, live.stations)
  for _, part in ipairs(live.calls.fragments:unfinished()) do told:given_up(part, "RPC", live.calls) end
  for _, part in ipairs(live.reassembly:unfinished()) do told:given_up(part, "IP", live.calls) end
  for _, call in ipairs(calls) do told:lost(call) end
  local services = ms1calls.new(events, nil, live.ms1.idents)
  for _, call in ipairs(live.services:unanswered()) do services:lost(call) end
  counts.unanswered = counts.unanswered + #calls
  return counts
end

-- An analysis whose memories lie on top of those of another one.
local function on_top(live)
  local over = setmetatable({
    options = live.options, judge = live.judge, dictionary = live.dictionary,
    bus = live.bus, findings = live.findings:on_top(), diagnoses = live.diagnoses:apart(),
    finished_jobs = live.finished_jobs:on_top(),
    pairing = {count = live.pairing.count, number = live.pairing.number},
  }, getmetatable(live))
  over.cyclic = live.cyclic:apart(over)
  over.conclusions = live.conclusions:apart(over.cyclic)
  over.findings.frames_dropped = live.options.frames_dropped or false
  return over
end

local function add(findings, remarks)
  for _, remark in ipairs(remarks) do findings:add(remark) end
end

--- The complete result of an analysis (Analysis:ended), which goes on as if nothing was asked.
function M.result(live)
  live.cyclic:identify()
  local over = on_top(live)
  local halves = live.calls:halves()
  local jobs, twins = live.pairing:left_open(live.events.newest_ns, function(peer)
    return halves[pair(peer.controller, peer.device)]
  end)
  local findings = over.findings
  local events = {index47 = live.index47, findings = findings, twins = twins}
  local counts = lose_calls(live, setmetatable(events, Events))
  for _, job in ipairs(jobs) do
    over:conclude(job, job.remarks or live.judge:left_open(job, findings.frames_dropped))
  end
  add(findings, live.records:limits_reached())
  add(findings, live.events:unproven())
  over.cyclic:finish()
  add(findings, over.conclusions:finish(function(device) return live:pkw_layout(device) end))
  local numbered = over.finished_jobs:numbered()
  local found = findings:result(numbered, over.finished_jobs, over.diagnoses)
  return {
    transactions = numbered, findings = found,
    devices = live.stations:devices(), rpc = counts, records = live.events.counts,
    relations = over.cyclic:relations(), timelines = over.cyclic:timelines(),
  }
end

return M
