-- What is told to the judge and to the memory of drive objects, and what these say: that of a file against
-- that of Lua. Usage: lua judge.lua INPUT. Input is a JSON object a line, as tests/python/heard.py writes it:
--   {call = "judge" | "objects", of = number, args}       a new one, with this number
--   {call = name of a method, of = number, args, gives}   `gives` is compared, where there is one
--   {call = name of a function of rules or parameter, args, gives}
-- The last line says how many were compared; exit status 1 where something differs.

local root = arg[0]:match("^(.*[/\\])[^/\\]*$") or "./"
package.path = root .. "../../lua/?.lua;" .. root .. "?.lua;" .. package.path

local drive_objects = require("ds47.profidrive.drive_objects")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local pairing = require("ds47.acyclic.pairing")
local parameter = require("ds47.profidrive.parameter")
local rules = require("ds47.acyclic.judge")
local unhex = require("ds47.support.bytes").unhex

-- JSON's null is Lua's nil.
local function without_null(value)
  if value == json.null then
    return nil
  elseif type(value) ~= "table" then
    return value
  end
  local result = {}
  for key, each in pairs(value) do
    result[key] = without_null(each)
  end
  return result
end

-- A value as one text, the same for the same thing; the text of a number stands for the number.
local function dump(value)
  if type(value) == "table" and getmetatable(value) == getmetatable(json.raw("0")) then
    value = read_json(json.encode(value))
  end
  if type(value) ~= "table" then
    return type(value) == "number" and ("%.17g"):format(value) or ("%q"):format(tostring(value))
  end
  local parts = {}
  for key, each in pairs(value) do
    parts[#parts + 1] = dump(key) .. "=" .. dump(each)
  end
  table.sort(parts)
  return "{" .. table.concat(parts, ",") .. "}"
end

-- Jobs

local function half(told)
  if told then
    told.data = unhex(told.data)
    told.missing = told.missing ~= 0 and told.missing or nil
  end
  return told
end

local jobs = {} -- number -> job

-- The job with this number, as it is now; the bytes are decoded as the analysis does.
local function job_of(told)
  local job = jobs[told.id] or setmetatable({}, pairing.Job)
  jobs[told.id] = job
  for key in pairs(job) do
    job[key] = nil
  end
  job.order = told.id
  for _, name in ipairs({"write_response", "read_request", "read_response"}) do
    job[name] = half(told[name])
  end
  for _, name in ipairs({"phase", "write_refused", "previous_reference", "previous", "superseded_by",
    "reason", "repeats", "contested", "uncertain", "missing", "peer", "record"}) do
    job[name] = told[name]
  end
  job.limit = told.limit ~= "" and told.limit or nil
  job.record.request = half(told.request)
  local asked, read = job.record.request, job.read_response
  job.message = told.asked and parameter.decode_request(asked.data, nil, asked.cut) or nil
  job.response = told.answered and parameter.decode_response(read.data, job.message, nil, read.cut) or nil
  job.polls, job.empty_reads = {}, {}
  for number, each in ipairs(told.polls) do
    job.polls[number] = {request = half(each.request), response = half(each.response)}
  end
  for number, each in ipairs(told.empty_reads) do
    job.empty_reads[number] = half(each)
  end
  return job
end

local function remark(item)
  return {
    rule = item.rule, frame = item.frame, args = item.args or {}, offset = item.offset,
    job = item.order,
  }
end

-- What a call gives, in the words of the file.
local function shown(name, result)
  if name == "closed" then
    return {result and remark(result)}
  elseif name == "answered" or name == "unanswered" then
    local remarks = {}
    for number, each in ipairs(result) do
      remarks[number] = remark(each)
    end
    return remarks
  end
  return result
end

local of, compared, failures = {}, 0, {}

local waits -- what the call is told of record calls that wait, one after the other

local function next_waits()
  return table.remove(waits, 1)
end

local NEW = {
  judge = function(limits, slow_ns) return rules.new(limits, slow_ns, next_waits) end,
  objects = function() return drive_objects.new() end,
}

local JOBS = {
  asked = true, refused = true, answered = true, unanswered = true, closed = true, is_mismatch = true,
  drive_time_ns = true,
}

local function call(line)
  local name, args = line.call, line.args
  if NEW[name] then
    of[line.of] = NEW[name](args[1], args[2])
    return nil
  end
  local owner = of[line.of]
  if JOBS[name] and args[1].peer then
    args[1] = job_of(args[1])
  end
  if owner then
    return owner[name](owner, args[1], args[2], args[3])
  end
  return (rules[name] or parameter[name])(args[1], args[2])
end

for text in io.lines(arg[1]) do
  local raw = read_json(text)
  local line = without_null(raw)
  waits = line.waits
  local result = call(line)
  if raw.gives ~= nil then
    compared = compared + 1
    local expected, found = dump(line.gives), dump(shown(line.call, result))
    if expected ~= found then
      failures[#failures + 1] = ("%s: expected %s, found %s\n  %s"):format(line.call, expected, found, text)
    end
  end
end
for _, failure in ipairs(failures) do
  print(failure)
end
print(compared .. " compared")
os.exit(#failures == 0 and 0 or 1)
