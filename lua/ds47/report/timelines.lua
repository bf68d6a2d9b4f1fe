--- The events of a drive as the text tells them: what came in one frame, and how long after its command
-- (Python: ds47.report.timelines).
--
-- Only what a drive proves is joined: that it runs after ON, that it does not after an OFF, that a fault is
-- gone after it was acknowledged. What is wrong is told by findings.

local cyclic = require("ds47.spec.cyclic")
local words = require("ds47.report.formatting")

local format = string.format
local duration, integer, joined, say = words.duration, words.integer, words.joined, words.say

local M = {}

-- What a command brings about.
local CAUSES = {
  running = { "on" }, stopped = { "off1", "off2", "off3" }, ["fault-cleared"] = { "acknowledge" },
}
local REFERENCE = 2000 -- p2000, the reference value: what 100 % of a setpoint is

-- The newest command that brings about an event, unless the opposite happened since.
local function cause_of(event, newest)
  local command
  for _, name in ipairs(CAUSES[event.name] or {}) do
    local each = newest[name]
    if each and (command == nil or each.time > command.time) then command = each end
  end
  local stopped = event.name == "running" and newest.stopped
  if command and stopped and stopped.time > command.time then return nil end
  return command
end

--- The events of a drive, those of one word in one frame together: array of {events, last, cause}; `cause` is
-- the command before it that brought about one of them.
function M.rows(timeline)
  local found, newest = {}, {}
  for _, event in ipairs(timeline.events) do
    local row = found[#found]
    if row == nil or row.last.frame ~= event.frame or row.last.word ~= event.word then
      row = { events = {} }
      found[#found + 1] = row
    end
    row.events[#row.events + 1], row.last = event, event
    newest[event.name] = event
    row.cause = row.cause or cause_of(event, newest)
  end
  return found
end

-- A time as people say it of a drive: `32.1 ms`, `1.22 s`, `99.1 s`.
local function time_text(nanoseconds)
  local seconds = nanoseconds / 1e9
  return seconds >= 1 and seconds < 10 and format("%.2f s", seconds) or duration(nanoseconds)
end

--- What happened: `running, 1.2 s after ON`.
function M.words(row, lang)
  local told = {}
  for number, each in ipairs(row.events) do
    told[number] = cyclic.event_text(each.name, lang)
  end
  local text = joined(lang, told)
  if row.cause == nil then return text end
  local command = cyclic.event_text(row.cause.name, lang)
  local after = { time = time_text(row.last.time - row.cause.time), command = command }
  return joined(lang, { text, say(lang, "after_command", after) }, ", ", "，")
end

--- The word before and after, as PLC tables print it: `STW1 047E -> 047F`; empty where there is none.
function M.change(row)
  local last = row.last
  if last.word == nil or last.after == nil then return "" end
  local before = last.before and format("%04X -> ", last.before) or ""
  return last.word .. " " .. before .. format("%04X", last.after)
end

--- The state of the drive from then on, with what is shown beside it; empty where it is not known.
function M.standing(row, lang)
  local last = row.last
  return last.state and cyclic.state_text(last.state, last.overlays, lang) or ""
end

--- What 100 % is of a drive: p2000 as it was read last, as a line; nil where nobody says.
function M.reference(result, device, lang)
  for number = #result.transactions, 1, -1 do
    local item = result.transactions[number]
    local read = item.operation == "read" and (item.state == "ok" or item.state == "partial")
    for _, each in ipairs(read and item.device == device and item.parameters or {}) do
      local value = each.values[1]
      local told = each.attribute == "value" and not each.error and type(value) == "number"
      if each.pnu == REFERENCE and told then
        local frame = integer(item.frames.read_response)
        return say(lang, "reference_read", { value = format("%.4g", value), frame = frame })
      end
    end
  end
  return nil
end

return M
