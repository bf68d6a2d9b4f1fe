-- The conversation vectors under plain Lua: each case's UDP payloads through the analysis, and everything
-- that comes out against what the case expects. A second time each case is looked at after every step.
-- Usage: lua conversations.lua VECTORS. The last line says how many cases were run; exit status 1 for a
-- failure.

local root = arg[0]:match("^(.*[/\\])[^/\\]*$") or "./"
package.path = root .. "../../lua/?.lua;" .. root .. "?.lua;" .. package.path

local analysis = require("ds47.analysis")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local transactions = require("ds47.acyclic.transactions")
local unchanged = require("unchanged")
local unhex = require("ds47.support.bytes").unhex
local status = require("ds47.spec.statuses")

local failures = {}

local function fail(id, ...)
  failures[#failures + 1] = id .. ": " .. string.format(...)
end

-- A value as one text, the same for the same thing: keys in order, nothing left out.
local function dump(value)
  if type(value) ~= "table" then
    return type(value) == "number" and string.format("%.17g", value) or string.format("%q", tostring(value))
  end
  local parts = {}
  for key, item in pairs(value) do
    parts[#parts + 1] = dump(key) .. "=" .. dump(item)
  end
  table.sort(parts)
  return "{" .. table.concat(parts, ",") .. "}"
end

-- The first place where two values differ, as text; nil where they do not. JSON's null is Lua's nil.
local function difference(expected, found, where)
  if expected == json.null then
    expected = nil
  end
  if type(expected) ~= "table" or type(found) ~= "table" then
    if expected == found then
      return nil
    end
    return string.format("%s: expected %s, found %s", where, dump(expected), dump(found))
  end
  for key, value in pairs(expected) do
    local told = difference(value, found[key], where .. "." .. key)
    if told then
      return told
    end
  end
  for key, value in pairs(found) do
    if expected[key] == nil then
      return string.format("%s.%s: not expected, found %s", where, key, dump(value))
    end
  end
  return nil
end

-- A transaction and a finding in the words of a vector

local function hex(code)
  return code and status.status_hex(code)
end

local function shown(transaction)
  local result = {
    frames = transaction.frames,
    status = {write = hex(transaction.write_status), read = hex(transaction.read_status)},
    parameters = {},
  }
  for name in ("id operation state controller device ar api slot subslot index request_reference axis "
    .. "duration_ns"):gmatch("%S+") do
    result[name] = transaction[name]
  end
  for number, each in ipairs(transaction.parameters) do
    result.parameters[number] = {
      pnu = each.pnu, subindex = each.subindex, attribute = each.attribute, format = each.format,
      values = each.values, error = each.error and {code = each.error.code, info = each.error.info},
    }
  end
  return result
end

local function told(finding)
  local dropped = finding.args.dropped or nil
  return {
    rule = finding.rule, frame = finding.frame, transaction = finding.transaction, says_dropped = dropped,
  }
end

local function each(list, change)
  local result = {}
  for number, item in ipairs(list) do
    result[number] = change(item)
  end
  return result
end

-- Findings DS1xx to DS6xx, and the diagnoses DS7xx.
local function apart(findings)
  local symptoms, diagnoses = {}, {}
  for _, finding in ipairs(findings) do
    local list = finding.rule:sub(1, 3) == "DS7" and diagnoses or symptoms
    list[#list + 1] = finding
  end
  return symptoms, diagnoses
end

-- Running a case

local function new(case)
  local indices = {}
  for _, index in ipairs(case.options and case.options.indices or {}) do
    indices[index] = true
  end
  return analysis.new({indices = indices, frames_dropped = (case.dropped or 0) ~= 0})
end

local function feed(run, step, frame)
  local source, destination = step.client, step.server
  if step.direction == "response" then
    source, destination = destination, source
  end
  local payload = unhex(step.bytes)
  local captured = 42 + #payload
  run:packet({
    payload = payload, frame = frame, time_ns = run:time_ns(1767254400, step.t),
    src_ip = source, dst_ip = destination, ip_id = step.ip_id,
    cut = step.cut and {frame = frame, captured = captured, original = captured + step.cut} or nil,
  })
end

local function check(case)
  local run = new(case)
  for frame, step in ipairs(case.steps) do
    feed(run, step, frame)
  end
  local result = run:ended()
  local symptoms, diagnoses = apart(each(result.findings, told))
  local wrong = difference(case.expect.transactions, each(result.transactions, shown), "transactions")
    or difference(case.expect.findings, symptoms, "findings")
    or difference(case.expect.diagnoses or {}, diagnoses, "diagnoses")
  if wrong then
    fail(case.id, "%s", wrong)
  end
  return result
end

-- Looking at it on the way

local ROLES = {
  write_request = function(frames, frame) return frames.write_request == frame end,
  write_response = function(frames, frame) return frames.write_response == frame end,
  read_response = function(frames, frame) return frames.read_response == frame end,
  read_request = function() return true end, -- what comes of it is not known yet
  empty_read = function() return true end, -- no frame of the transaction names it
  poll = function(frames, frame)
    for _, poll in ipairs(frames.polls) do
      if poll.response == frame then
        return true
      end
    end
    return frames.read_response == frame -- too short, and no other brought its response (P34)
  end,
  reread = function(frames, frame)
    for _, reread in ipairs(frames.rereads) do
      if reread.response == frame then
        return true
      end
    end
    return false
  end,
}

local REFUSED = "DS203" -- the Write response itself says it, whatever comes later

local function waits_refused(job)
  local half = job.write_response
  return job.phase ~= "closed" and job.write_refused and half and half.status and not job.read_response
end

-- What is told of one step must be true in the end.
local function look(run, frame, seen)
  local jobs, roles, count = run:touched()
  for number = 1, count do
    local job, role = jobs[number], roles[number]
    seen.touched[#seen.touched + 1] = {order = job.order, role = role, frame = frame}
    local refused = role == "write_response" and waits_refused(job)
    for _, finding in ipairs(run:peek(job)) do
      seen.findings[#seen.findings + 1] = finding
      refused = refused and finding.rule ~= REFUSED
    end
    if refused then
      return "a refusal is not told while the job waits, in frame " .. frame
    end
    local finished = run.finished_jobs:by_order(job.order)
    if (finished ~= nil) ~= (job.phase == "closed") then
      return "finished() and the phase of a job differ in frame " .. frame
    end
  end
  for _, finding in ipairs(run.findings:at(frame)) do
    seen.findings[#seen.findings + 1] = finding
  end
end

-- The responses that a transaction names, and the request that began it, were told as they came. Not on
-- index 47, where they may have waited for a message that shows whose they are.
local function untold(transaction, touched)
  local frames, missing = transaction.frames, nil
  local function need(role, frame)
    if frame and not touched[role .. " " .. transaction.order .. " " .. frame] then
      missing = ("never touched: %s of transaction %d in frame %d"):format(role, transaction.id, frame)
    end
  end
  if transaction.index == 47 then
    return nil
  end
  for _, role in ipairs({"write_request", "write_response", "read_response"}) do
    need(role, frames[role])
  end
  for _, poll in ipairs(frames.polls) do
    need("poll", poll.response)
  end
  for _, reread in ipairs(frames.rereads) do
    need("reread", reread.response)
  end
  return missing
end

local function check_seen(result, seen)
  local by_order, findings, told_of = {}, {}, {}
  for _, transaction in ipairs(result.transactions) do
    by_order[transaction.order] = transaction
  end
  for _, touched in ipairs(seen.touched) do
    local transaction = by_order[touched.order]
    if not transaction or not ROLES[touched.role](transaction.frames, touched.frame) then
      return "touched: " .. dump(touched)
    end
    told_of[touched.role .. " " .. touched.order .. " " .. touched.frame] = true
  end
  for _, transaction in ipairs(result.transactions) do
    local missing = untold(transaction, told_of)
    if missing then
      return missing
    end
  end
  for _, finding in ipairs(result.findings) do
    findings[finding.rule .. " " .. finding.frame] = true
  end
  for _, finding in ipairs(seen.findings) do
    if not findings[finding.rule .. " " .. finding.frame] then
      return "told on the way: " .. dump(finding)
    end
  end
end

-- A result as one text, transactions with all their keys.
local function dump_result(result)
  local found = {}
  for key, value in pairs(result) do
    found[key] = value
  end
  found.transactions = each(result.transactions, transactions.whole)
  return dump(found)
end

local function check_on_the_way(case, expected)
  local run, seen = new(case), {touched = {}, findings = {}}
  for frame, step in ipairs(case.steps) do
    feed(run, step, frame)
    local wrong = look(run, frame, seen)
    if wrong then
      return wrong
    end
    local first
    local changed = unchanged.changed_by(run, function() first = run:ended() end)
    if changed then
      return ("ended() changes %s after frame %d"):format(changed, frame)
    end
    local text = dump_result(first)
    if run:ended() ~= first then
      return "ended() is not kept after frame " .. frame
    end
    run.result = nil -- as if something had come that changed nothing
    if dump_result(run:ended()) ~= text then
      return "ended() twice is not the same after frame " .. frame
    end
  end
  if dump_result(run:ended()) ~= expected then
    return "ended() after every step changes the result"
  end
  for _, flag in ipairs(case.flags) do
    if flag == "echo" then -- what was told on the way is taken back (P20)
      return nil
    end
  end
  return check_seen(run:ended(), seen)
end

local file = assert(io.open(arg[1], "rb"))
local vectors = read_json(file:read("*a"))
file:close()
for _, case in ipairs(vectors.cases) do
  local result = check(case)
  local wrong = check_on_the_way(case, dump_result(result))
  if wrong then
    fail(case.id, "%s", wrong)
  end
end
for _, failure in ipairs(failures) do
  print(failure)
end
print(#vectors.cases .. " cases")
os.exit(#failures == 0 and 0 or 1)
