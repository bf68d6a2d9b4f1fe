-- The analysis under plain Lua, for a comparison with that in Python: packets in, the complete result out.
-- Usage: lua analysis.lua INPUT. Input is a JSON object a line, its `kind` says what it is:
--   begin          {lang, look, layouts, limits}: a new analysis, told in these languages ("en zh");
--                  `limits`: those that differ from spec/limits.toml from here on; `look`: ended()
--                  after every packet, which must not matter; `layouts` of IND by device, "" for all others
--   udp, fragment  a packet, as Analysis:packet and Analysis:fragment take it, bytes in hex, the time as
--                  seconds and nanoseconds; of a frame that is cut its lengths as `captured` and `original`
--   dcp, lldp      {payload, src_mac, dst_mac}
--   rt             {frame, seconds, nanoseconds, data}: a frame with its link header, in hex
--   end            {dropped}: prints the result, for each language as one line of JSON, keys as in schema
--                  ds47.report/2, but `start` as [second, nanosecond] and `duration_ns`, not `duration_ms`

local root = arg[0]:match("^(.*[/\\])[^/\\]*$") or "./"
package.path = root .. "../../lua/?.lua;" .. root .. "?.lua;" .. package.path

local described = require("described")
local analysis = require("ds47.analysis")
local drive_objects = require("ds47.profidrive.drive_objects")
local formats = require("ds47.profidrive.formats")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local unhex = require("ds47.support.bytes").unhex
local formatting = require("ds47.report.formatting")
local named = require("ds47.cyclic.named")
local ppo = require("ds47.cyclic.ppo")
local sentences = require("ds47.report.sentences")
local status = require("ds47.spec.statuses")
local suggest = require("ds47.diagnosis.suggest")
local tables = require("ds47.spec.tables")
local targets = require("ds47.report.targets")
local times = require("ds47.support.times")
local unchanged = require("unchanged")

local function hex(bytes)
  return bytes and (bytes:gsub(".", function(byte) return ("%02x"):format(byte:byte()) end))
end

local function null(value)
  if value == nil then
    return json.null
  end
  return value
end

local function list(items, change)
  local result = {}
  for number, item in ipairs(items) do
    result[number] = change(item)
  end
  return json.array(result)
end

-- A dictionary of what may be missing: `names` are its keys.
local function object(item, names)
  local result = {}
  for name in names:gmatch("%S+") do
    result[name] = null(item[name])
  end
  return result
end

local function values(items, format, scaled)
  return items and list(items, function(value)
    return type(value) ~= "number" and value
      or json.raw(formats.number_text(value, format, scaled))
  end)
end

local language -- of the texts

local function parameter(item)
  local result = object(item, "pnu subindex attribute element_count unit format value_count")
  result.name = null(sentences.name(item, language))
  result.values = values(item.values, item.format)
  result.scaled = null(values(item.scaled, item.format, true))
  result.error = json.null
  if item.error then
    result.error = object(item.error, "code info")
    result.error.text = sentences.error_words(item.error, language)
  end
  result.description = described.of(item)
  result.texts = described.texts(item)
  result.described_in = item.described and item.described.frames
  result.meaning = formatting.meaning(item, language)
  result.family = formatting.family(item)
  return result
end

local function reads(items)
  return list(items, function(read) return object(read, "request response") end)
end

local function word(code)
  return null(code and status.status_hex(code))
end

-- The keys of a transaction that are told as they are; those of SHAPED, and those inside others, are not.
local SHAPED = { transaction = true, polls = true, start = true, duration_ms = true, drive_object = true }
local plain = "id duration_ns"
for _, field in ipairs(tables.transaction_fields) do
  if not SHAPED[field[1]] and not field[1]:find(".", 1, true) then
    plain = plain .. " " .. field[1]
  end
end

local function transaction(item, run, whole)
  local result = object(item, plain)
  result.frames = object(item.frames, "write_request write_response read_request read_response")
  result.frames.polls, result.frames.rereads = reads(item.frames.polls), reads(item.frames.rereads)
  local seconds, nanoseconds = times.split(item.start_ns)
  result.start = {run.base_seconds + seconds, nanoseconds}
  result.drive_object = null(drive_objects.reached(whole, item))
  result.telegram = null(targets.telegram(whole, item))
  result.bytes = {request = null(hex(item.request)), response = null(hex(item.response))}
  result.status = {write = word(item.write_status), read = word(item.read_status)}
  result.parameters = list(item.parameters, parameter)
  result.findings = json.array(item.findings)
  return result
end

local run -- the analysis

local function finding(item)
  local result = object(item, "rule severity frame transaction offset")
  result.args, result.frames = item.args, json.array(item.frames)
  result.message = sentences.sentence(item, language)
  return result
end

-- The requests to send instead: rule, transaction and bytes -> what is offered.
local function instead(findings)
  local found = {}
  for _, item in ipairs(findings) do
    if item.corrected then
      local request, better = hex(item.corrected), item.corrected
      found[item.rule .. " " .. item.transaction .. " " .. request] = {
        request = request, words = json.array(suggest.plc_words(better)), scl = suggest.scl(better),
        encode = null(suggest.encode_command(better, item.args.family)), transaction = item.transaction,
      }
    end
  end
  return found
end

local function side(item)
  if #item.source == 2 then
    local mac = "dp" .. item.source:byte()
    return {mac = mac, frame_id = json.null, offset = item.offset, length = item.length}
  end
  return {mac = item.source:gsub(".", function(each) return ("%02x:"):format(each:byte()) end):sub(1, -2),
    frame_id = item.frame_id, offset = item.offset, length = item.length}
end

local function relation(item)
  local result = object(item, "channel controller device api slot subslot frame certainty")
  result.telegrams, result.cycle_ms = json.array(item.telegrams), json.null
  if item.input.cycle_ns > 0 then result.cycle_ms = json.float(item.input.cycle_ns / 1e6) end
  result.output, result.input = side(item.output), side(item.input)
  return result
end

local function event(item, base_seconds)
  local result = object(item, "frame name word before after state")
  local seconds, nanoseconds = times.split(item.time)
  result.time, result.overlays = {base_seconds + seconds, nanoseconds}, json.array(item.overlays)
  return result
end

local function timeline(item, base_seconds)
  return {
    relation = item.relation, events_left_out = item.left_out,
    events = list(item.events, function(each) return event(each, base_seconds) end),
  }
end

local function capture()
  local result, records = run:ended(), {}
  for index, counts in pairs(result.records) do
    records[("%d"):format(index)] = counts
  end
  return {
    rpc = result.rpc,
    records = records,
    devices = list(result.devices, function(item)
      local told = object(item, "ip mac station vendor_id device_id")
      told.assumed_vendor_id = item.assumed_vendor_id -- left out where there is none
      return told
    end),
    transactions = list(result.transactions, function(item) return transaction(item, run, result) end),
    findings = list(result.findings, finding), instead = instead(result.findings),
    relations = #result.relations > 0 and list(result.relations, relation) or nil,
    timelines = #result.timelines > 0 and list(result.timelines, function(item)
      return timeline(item, run.base_seconds)
    end) or nil,
  }
end

local look
local languages -- those in which the result is told

local function fed(line)
  for key, value in pairs(line) do
    if value == json.null then
      line[key] = nil
    end
  end
  line.time_ns = run:time_ns(line.seconds, line.nanoseconds)
  if line.original then
    line.cut = {frame = line.frame, captured = line.captured, original = line.original}
  end
  return line
end

local take = {}

function take.begin(line)
  for name, most in pairs(line.limits) do tables.limits[name] = most end
  local names = named.list(line.cyclic)
  run = analysis.new({
    pkw_layout = line.layouts[""], pkw_layouts = line.layouts, cyclic = names,
    vendor_id = line.vendor_id ~= json.null and line.vendor_id or nil,
    ppos = ppo.list(line.ppos),
  })
  languages, look = line.lang, line.look
end

function take.udp(line)
  line.payload = unhex(line.payload)
  run:packet(fed(line))
end

function take.fragment(line)
  line.data = unhex(line.data)
  run:fragment(fed(line))
end

function take.dcp(line)
  local text = fed(line)
  run:station(line.kind, unhex(text.payload), text.src_mac, text.dst_mac)
end

take.lldp = take.dcp

function take.rt(line)
  local frame = unhex(line.data)
  local row, at = run.cyclic:row_of(frame)
  if row and run.cyclic:is_news(row, frame, at, line.frame) then
    run:cyclic_frame(row, frame, at, line.frame, run:time_ns(line.seconds, line.nanoseconds))
  end
end

function take.bus(line)
  local time = run:time_ns(line.seconds, line.nanoseconds)
  run:bus_frame(line.link, unhex(line.data), line.frame, time, line.original ~= nil)
end

take["end"] = function(line)
  run.options.frames_dropped = line.dropped
  run.result = nil
  for each in languages:gmatch("%S+") do
    language = each
    print(json.encode(capture()))
  end
end

local count, EVERY = 0, 5 -- packets, and of how many one is watched more closely

for text in io.lines(arg[1]) do
  local line = read_json(text)
  take[line.kind](line)
  count = count + 1
  if look and line.kind ~= "end" then
    if count % EVERY == 0 then
      local changed = unchanged.changed_by(run, function() run:ended() end)
      assert(not changed, changed)
    end
    run:ended()
  end
end
