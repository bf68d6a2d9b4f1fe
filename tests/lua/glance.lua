-- Frames at a glance against frames that are analysed one by one: the same sentences and findings on every
-- frame, and the same result in the end.
-- Usage: lua glance.lua INPUT. Input is a JSON object a line, its `kind` says what it is:
--   begin  {name, options, most}: a new capture; options as ds47.analysis takes them; `most`: what the glance
--          may know
--   frame  {seconds, nanoseconds, offset (of the IP header), data (hex), look}; `look`: somebody clicks on
--          this frame then, which must not matter
--   end    prints {name, frames, glanced, differences (array of texts)} as one line of JSON

local root = arg[0]:match("^(.*[/\\])[^/\\]*$") or "./"
package.path = root .. "../../dissector/?.lua;" .. root .. "../../lua/?.lua;" .. package.path

local glance = require("ds47_ws.glance")
local info = require("ds47_ws.info")
local json = require("ds47.json")
local sentences = require("ds47.sentences")
local unhex = require("ds47.reader").unhex

local options, usually = {}, glance.MOST

-- A tracker of its own: the module has the state of one open file.
local function tracker()
  package.loaded["ds47_ws.track"] = nil
  local track = require("ds47_ws.track")
  track.configure(function() return options end)
  return track
end

local quick, careful = tracker(), tracker()

-- A web of tables as text, keys in order; a table that was met before is named by its number only.
local function text_of(value, met)
  if type(value) ~= "table" then
    return type(value) .. " " .. tostring(value)
  elseif met[value] then
    return "(" .. met[value] .. ")"
  end
  met.count = (met.count or 0) + 1
  met[value] = met.count
  local keys, parts = {}, {}
  for key in pairs(value) do
    keys[#keys + 1] = key
  end
  table.sort(keys, function(one, other) return tostring(one) < tostring(other) end)
  for _, key in ipairs(keys) do
    parts[#parts + 1] = tostring(key) .. "=" .. text_of(value[key], met)
  end
  return "{" .. table.concat(parts, ", ") .. "}"
end

local run

local function differ(what, got, wanted)
  local one, other = text_of(got, {}), text_of(wanted, {})
  if one ~= other then
    run.differences[#run.differences + 1] = what .. ": " .. one .. " instead of " .. other
  end
end

-- What a frame shows when it is analysed: its text and its findings; nil where it is none of our business.
local function fed(track, line, clock, alone)
  if not track.feed(run.frames, line.data, line.offset, clock, alone, #line.data) then
    return nil
  end
  local views, findings = track.live_views(false)
  return #views > 0 and info.text(views) or nil, findings
end

-- What an expert info shows of findings. At a glance nobody knows yet of which job they are (`order`).
local function shown(findings)
  local list = {}
  for number, finding in ipairs(findings or {}) do
    list[number] = {
      finding.rule, finding.severity, finding.frame, finding.offset or false, finding.frames, finding.args,
      sentences.sentence(finding, options.lang),
    }
  end
  return list
end

local take = {}

function take.begin(line)
  options = line.options
  glance.MOST = line.most or usually
  quick.reset()
  careful.reset()
  run = { name = line.name, frames = 0, glanced = 0, differences = json.array({}) }
end

function take.frame(line)
  run.frames = run.frames + 1
  line.data = unhex(line.data)
  local function clock(analysis)
    return analysis:time_ns(line.seconds, line.nanoseconds)
  end
  local text, findings = quick.glance(run.frames, line.data, line.offset, clock)
  if text then
    run.glanced = run.glanced + 1
  else
    text, findings = fed(quick, line, clock, true)
  end
  local wanted_text, wanted_findings = fed(careful, line, clock, false)
  differ("text of frame " .. run.frames, text, wanted_text)
  differ("findings of frame " .. run.frames, shown(findings), shown(wanted_findings))
  if line.look then
    differ("a click on frame " .. run.frames, { quick.complete_views(run.frames) },
      { careful.complete_views(run.frames) })
  end
end

take["end"] = function()
  local got, wanted = quick.result(), careful.result()
  for name, part in pairs(wanted) do
    differ(name, got[name], part)
  end
  print(json.encode(run))
end

for text in io.lines(arg[1]) do
  local line = json.decode(text)
  take[line.kind](line)
end
