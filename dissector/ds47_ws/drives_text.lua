--- What happened to each drive as a table, in English or Chinese: time, frame, word, event, state.
-- Takes the result of Analysis:ended(); what is wrong with it is told by findings, not here. No line is wider
-- than the tables of ds47.report.statistics.

local append = require("ds47.support.arrays").append
local csv = require("ds47.report.csv")
local info = require("ds47_ws.info")
local sentences = require("ds47.report.sentences")
local statistics = require("ds47.report.statistics")
local words = require("ds47.report.formatting")

local concat = table.concat
local integer, say = words.integer, words.say

local M = {}

local BEFORE = 2 + 12 + 2 + 7 + 2 + 17 + 2 -- columns before the event

-- A text with blanks behind it, or before it where the width is negative.
local function padded(text, width)
  local blanks = (" "):rep(math.abs(width) - words.width(text))
  return width < 0 and blanks .. text or text .. blanks
end

-- `2026-01-01`, `08:00:04.994`
local function date_and_time(base_seconds, time)
  local text = csv.timestamp(base_seconds, time)
  return text:sub(1, 10), text:sub(12, 23)
end

-- One drive: a line about it, then its events.
local function add_drive(lines, relation, timeline, base_seconds, lang)
  local slot = relation.slot and sentences.slot_number(relation.slot, relation.subslot)
  local telegrams = concat(relation.telegrams, ", ")
  local function add(time, frame, word, event)
    local before = "  " .. padded(time, 12) .. "  " .. padded(frame, -7) .. "  " .. padded(word, 17) .. "  "
    append(lines, words.wrap(before .. event, statistics.WIDTH, BEFORE))
  end
  lines[#lines + 1] = ""
  lines[#lines + 1] = say(lang, "timeline_drive", {
    device = relation.device, slot = slot and say(lang, "timeline_slot", { slot = slot }) or "",
    telegram = telegrams ~= "" and say(lang, "timeline_telegram", { number = telegrams }) or "",
    number = integer(#timeline.events),
  })
  add(say(lang, "timeline_time"), say(lang, "timeline_frame"), say(lang, "timeline_word"),
    say(lang, "timeline_event"))
  local day
  for _, same in ipairs(info.together(timeline.events)) do
    local event = same[1]
    local date, time = date_and_time(base_seconds, event.time)
    if date ~= day then
      lines[#lines + 1] = "  " .. date
      day = date
    end
    add(time, integer(event.frame), event.word and info.word(event) or "", info.what(same, lang))
  end
  if timeline.left_out > 0 then
    lines[#lines + 1] = "  " .. say(lang, "timeline_more", { number = integer(timeline.left_out) })
  end
end

--- All drives of a capture.
-- @param result what Analysis:ended() gives, with base_seconds
function M.text(result, options)
  local lang = options and options.lang or "en"
  local lines, filter = { say(lang, "timeline_title") }, options and options.filter
  if filter then append(lines, words.wrap(statistics.filter_line(filter, lang), statistics.WIDTH, 2)) end
  local before = #lines
  for _, timeline in ipairs(result.timelines) do
    add_drive(lines, result.relations[timeline.relation], timeline, result.base_seconds, lang)
  end
  if #lines == before then lines[before + 1] = say(lang, "timeline_none") end
  return concat(lines, "\n") .. "\n"
end

return M
