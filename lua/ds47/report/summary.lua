--- The first lines of the text report: verdict, drives, what to do, what the capture cannot show.
-- The lines of Python's ds47.report.summary, in English or Chinese. The words are those of
-- tables.report_words.

local filters = require("ds47.report.filters")
local grouping = require("ds47.findings.grouping")
local later = require("ds47.support.later").module
local sentences = require("ds47.report.sentences")
local suggest = later("ds47.diagnosis.suggest") -- not for captures without any correction
local todo = require("ds47.report.todo")
local verdict = require("ds47.report.verdict")
local words = require("ds47.report.formatting")

local escape, pad, say = words.escape, words.pad, words.say
local concat, format = table.concat, string.format

local M = {}

M.WIDTH = 100 -- columns of a line of text; what can be copied is never broken
M.DRIVES = 50 -- drives, and other devices, that are listed
M.OF_ONE_RULE = 3 -- diagnoses of one rule that are told one by one
M.LONGEST_SCL = 32 -- bytes of a corrected request that is shown as SCL as well

-- Drives

--- MAC, station name, vendor and device id of a device, as far as they are known.
function M.about(device, lang)
  local parts = {}
  local function add(text)
    parts[#parts + 1] = "  " .. text
  end
  if device.mac then
    add(escape(device.mac))
  end
  if device.station and device.station ~= "" then
    add('"' .. escape(device.station) .. '"')
  end
  if device.vendor_id then
    add(say(lang, "vendor_id", { id = format("%04X", device.vendor_id) }))
  elseif device.assumed_vendor_id then
    add(say(lang, "vendor_assumed", { id = format("%04X", device.assumed_vendor_id) }))
  end
  if device.device_id then
    add(say(lang, "device_id", { id = format("%04X", device.device_id) }))
  end
  return concat(parts)
end

-- `  8 transactions, 1 refused`: what became of the transactions of a drive.
local function counts_of(states, smooth, lang)
  local number = 0
  for _, count in pairs(states) do
    number = number + count
  end
  local parts = verdict.told(states, smooth, lang)
  table.insert(parts, 1, say(lang, "transactions", { n = number }))
  return "  " .. words.joined(lang, parts)
end

local function list_devices(add, context, keys, items, texts)
  local lang = context.lang
  if #items == 0 then
    return
  end
  add("")
  add(say(lang, keys.title))
  local width, shown = 0, math.min(#items, M.DRIVES)
  for i = 1, shown do
    width = math.max(width, words.length(escape(items[i].ip)))
  end
  for i = 1, shown do
    local address = pad(escape(items[i].ip), width)
    local line = "  " .. address .. M.about(items[i], lang) .. (texts and texts[i] or "")
    for _, each in ipairs(words.fitted((line:gsub(" +$", "")), context.width)) do add(each) end
  end
  if #items > shown then
    add("  " .. say(lang, keys.more, { n = #items - shown }))
  end
end

local function drives(add, result, smooth, context)
  local lang = context.lang
  local states, known, found, counts, others = {}, {}, {}, {}, {}
  for _, each in ipairs(result.devices or {}) do
    known[each.ip] = each
  end
  for _, each in ipairs(result.transactions) do
    local mine = states[each.device]
    if not mine and each.channel ~= "s7" then
      mine = {}
      states[each.device] = mine
      found[#found + 1] = known[each.device] or { ip = each.device }
    end
    if each.channel ~= "s7" then
      mine[each.state] = (mine[each.state] or 0) + 1
    end
  end
  for number, each in ipairs(found) do
    counts[number] = counts_of(states[each.ip], smooth, lang)
  end
  for _, each in ipairs(result.devices or {}) do
    if not states[each.ip] then
      others[#others + 1] = each
    end
  end
  list_devices(add, context, { title = "drives_head", more = "more_drives" }, found, counts)
  list_devices(add, context, { title = "other_devices_head", more = "more_devices" }, others)
end

-- What to do

local function add_fitted(add, text)
  for _, each in ipairs(words.fitted(text, M.WIDTH)) do add(each) end
end

local function name_of(rules, rule)
  return rules[rule] and rules[rule].name or ""
end

-- How often, as many as the filter shows frames; where these are two numbers, both.
local function times(item, lang)
  local frames = #item.frames + item.frames_left_out
  if item.count ~= 1 and item.count ~= frames then
    return say(lang, "cause_times_in", {
      times = say(lang, "times", { n = item.count }), frames = say(lang, "frames", { n = frames }),
    })
  end
  return item.count > 1 and say(lang, "cause_times", { n = item.count }) or ""
end

local function head(add, context, item, text)
  local lang = context.lang
  local line = say(lang, "cause_line", {
    rule = item.rule, severity = say(lang, "severity_" .. item.severity),
    name = name_of(context.rules, item.rule), message = text,
  })
  line = line .. (lang == "zh" and "" or " ") .. times(item, lang)
  for place, each in ipairs(words.wrap((line:gsub(" +$", "")), M.WIDTH - 4)) do
    add((place == 1 and "  " or "    ") .. each)
  end
end

local function advice(add, context, rule)
  local known = context.rules[rule]
  if known == nil then
    return
  end
  local text = context.lang == "zh" and known.advice_zh or known.advice
  for _, each in ipairs(words.wrap("-> " .. text, M.WIDTH - 4, 3)) do
    add("    " .. each)
  end
end

local function look(add, context, item)
  local lang, frames, job = context.lang, item.frames, item.transactions[1]
  if #frames == 0 then
    return
  end
  local filter, left_out = filters.display_filter(frames)
  local values = { frame = words.integer(frames[1]), filter = filter, job = job and words.integer(job) }
  local time = job and (context.starts[job] or 0) or context.times[frames[1]]
  values.time = time and context.clock:moment(time)
  left_out = left_out + item.frames_left_out
  add("    " .. say(lang, job and "look_at_job" or time and "look_at_time" or "look_at", values)
    .. (left_out > 0 and "  " .. say(lang, "frames_more", { n = left_out }) or ""))
end

-- What the status word of the drive says of it.
local function state(add, context, item)
  local found = todo.by_state(context.findings, item.transactions)
  if found then
    local said = escape(sentences.sentence(found, context.lang))
    local text = say(context.lang, "state_says", { job = words.integer(found.transaction), message = said })
    for _, each in ipairs(words.wrap(text, M.WIDTH - 4)) do
      add("    " .. each)
    end
  end
end

-- The request as it should have been.
local function corrected(add, lang, item)
  if item.corrected == nil then
    return
  end
  local better = suggest.corrected(item.corrected, item.args.family)
  if item.count > 1 and item.corrected_in then
    local job = words.integer(item.corrected_in)
    add("    " .. say(lang, "instead_of", { job = job, hex = better.hex }))
  else
    add("    " .. say(lang, "instead", { hex = better.hex }))
  end
  for _, line in ipairs(words.wrap(concat(better.words, " "), M.WIDTH - 6)) do
    add("      " .. line)
  end
  for line in (#item.corrected <= M.LONGEST_SCL and better.scl or ""):gmatch("[^\n]+") do
    add("      " .. line)
  end
  if better.encode then
    add("      " .. better.encode)
    if better.block then
      add("      " .. say(lang, "as_function_block"))
    end
  end
end

local function diagnosis(add, context, item, advised)
  local text = escape(sentences.sentence(item, context.lang))
  if context.several and item.device and not text:find(item.device, 1, true) then
    text = say(context.lang, "cause_device", { device = escape(item.device), message = text })
  end
  head(add, context, item, text)
  if advised ~= item.rule then
    advice(add, context, item.rule)
  end
  local axes = todo.answering(context.transactions, item)
  if axes then
    add_fitted(add, "    " .. say(context.lang, "answering", { list = axes }))
  end
  state(add, context, item)
  look(add, context, item)
  corrected(add, context.lang, item)
end

local function more(add, context, item)
  local lang = context.lang
  add_fitted(add, "  " .. say(lang, "more_causes", {
    rule = item.rule, name = name_of(context.rules, item.rule), n = item.causes,
    times = say(lang, "times", { n = item.findings }),
  }))
end

-- The findings that no diagnosis covers, by what they have in common.
local function other_findings(add, context, rest)
  local advised
  for _, each in ipairs(todo.causes(grouping.headlines(rest), M.OF_ONE_RULE)) do
    if each.more then
      more(add, context, each)
    else
      local text = sentences.of_all(each, context.lang)
        or say(context.lang, "first_of", { message = sentences.sentence(each.first, context.lang) })
      head(add, context, each, escape(text))
      if advised ~= each.rule then
        advice(add, context, each.rule)
      end
      state(add, context, each)
      look(add, context, each)
      advised = each.rule
    end
  end
end

local function to_do(add, context, diagnoses, rest)
  add("")
  add(say(context.lang, "to_do_head"))
  local advised
  for _, each in ipairs(todo.causes(diagnoses, M.OF_ONE_RULE)) do
    if each.more then
      more(add, context, each)
    else
      diagnosis(add, context, each, advised)
      advised = each.rule
    end
  end
  if #rest > 0 and #diagnoses > 0 then
    add("  " .. say(context.lang, "other_findings_head"))
  end
  other_findings(add, context, rest)
end

-- What the capture cannot show

local function blind(add, result, lang)
  local lines = verdict.blind(result, lang)
  if #lines == 0 then
    return
  end
  add("")
  add(say(lang, "blind"))
  for _, text in ipairs(lines) do
    for place, each in ipairs(words.wrap(text, M.WIDTH - 4)) do
      add((place == 1 and "  " or "    ") .. each)
    end
  end
end

local function is_serious(diagnoses)
  for _, each in ipairs(diagnoses) do
    if each.severity ~= "note" then
      return true
    end
  end
  return false
end

--- Everything behind the verdict, each part with an empty line before it.
-- @param add     takes a line
-- @param result  what Analysis:ended() gives
-- @param counts  what verdict.counts says of it
-- @param context {lang, rules, clock, width = columns of a line that may be longer than one of prose}
function M.lines(add, result, counts, context)
  drives(add, result, verdict.smooth(counts), context)
  local diagnoses = result.diagnoses or {}
  local rest = todo.uncovered(result)
  context.several, context.transactions = counts.drives > 1, result.transactions
  context.findings, context.starts, context.times = result.findings, {}, {}
  for _, each in ipairs(result.transactions) do context.starts[each.id] = each.start_ns end
  for _, each in ipairs(result.findings) do context.times[each.frame] = each.time_ns end
  if #diagnoses > 0 or #rest > 0 then
    to_do(add, context, diagnoses, rest)
  end
  local level = verdict.level(counts)
  if #rest > 0 or is_serious(diagnoses) or level == "bad" or level == "warn" then
    blind(add, result, context.lang)
  end
end

return M
