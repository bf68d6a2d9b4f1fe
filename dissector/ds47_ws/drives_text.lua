--- What happened to each drive as a table, in English or Chinese: time, frame, word, event, state.
-- Takes the result of Analysis:ended(); what is wrong with it is told by findings, not here. No line is wider
-- than the tables of ds47.report.statistics.

local csv = require("ds47.report.csv")
local info = require("ds47_ws.info")
local statistics = require("ds47.report.statistics")
local words = require("ds47.report.formatting")

local concat, format = table.concat, string.format

local M = {}

local TEXTS = {
  en = {
    title = "Drives: control and status word",
    none = "No drive was seen in the cyclic frames of this capture.",
    drive = "%s%s%s: %d events", slot = " slot %d.%d", telegram = ", telegram %s",
    more = "and %d more, which are not kept", time = "Time (UTC)", frame = "Frame", word = "Word",
    event = "Event: state from then on",
  },
  zh = {
    title = "驱动器：控制字和状态字", none = "此抓包的循环帧中没有驱动器。",
    drive = "%s%s%s：%d 个事件", slot = " 插槽 %d.%d", telegram = "，报文 %s",
    more = "还有 %d 个，未保留", time = "时间 (UTC)", frame = "帧", word = "字",
    event = "事件：此后的状态",
  },
}

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

local function word_of(event)
  if event.word == nil then
    return ""
  end
  local before = event.before and format("%04X -> ", event.before) or ""
  return format("%s %s%04X", event.word, before, event.after)
end

-- One drive: a line about it, then its events.
local function add_drive(lines, relation, timeline, base_seconds, lang)
  local texts = TEXTS[lang]
  local slot = relation.slot and format(texts.slot, relation.slot, relation.subslot) or ""
  local numbers = relation.telegrams
  local telegram = #numbers > 0 and format(texts.telegram, concat(numbers, ", ")) or ""
  local function add(time, frame, word, event)
    local before = "  " .. padded(time, 12) .. "  " .. padded(frame, -7) .. "  " .. padded(word, 17) .. "  "
    for _, line in ipairs(words.wrap(before .. event, statistics.WIDTH, BEFORE)) do
      lines[#lines + 1] = line
    end
  end
  lines[#lines + 1] = ""
  lines[#lines + 1] = format(texts.drive, relation.device, slot, telegram, #timeline.events)
  add(texts.time, texts.frame, texts.word, texts.event)
  local day
  for _, same in ipairs(info.together(timeline.events)) do
    local event = same[1]
    local date, time = date_and_time(base_seconds, event.time)
    if date ~= day then
      lines[#lines + 1] = "  " .. date
      day = date
    end
    add(time, format("%d", event.frame), word_of(event), info.what(same, lang))
  end
  if timeline.left_out > 0 then
    lines[#lines + 1] = "  " .. format(texts.more, timeline.left_out)
  end
end

--- All drives of a capture.
-- @param result what Analysis:ended() gives, with base_seconds
-- @param options {lang = "en" or "zh"}
function M.text(result, options)
  local lang = options and options.lang or "en"
  local lines = { TEXTS[lang].title }
  for _, timeline in ipairs(result.timelines) do
    add_drive(lines, result.relations[timeline.relation], timeline, result.base_seconds, lang)
  end
  if #lines == 1 then
    lines[2] = TEXTS[lang].none
  end
  return concat(lines, "\n") .. "\n"
end

return M
