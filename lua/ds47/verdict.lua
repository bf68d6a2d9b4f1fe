--- The verdict on a capture, and what the capture cannot show (Python: ds47.report.verdict).
-- Counted from the result of an analysis; the words are those of tables.report_words.

local WRITE_MULTIPLE = require("ds47.records").WRITE_MULTIPLE
local words = require("ds47.report_words")

local say = words.say

local M = {}

-- States of a job that did not do what it was meant to do.
local FAILED = { "refused", "error", "partial", "mismatch" }
-- States of a job of which nobody knows what became of it.
local OPEN = { "unanswered", "superseded" }
local TOLD = { "refused", "error", "partial", "mismatch", "unanswered", "superseded", "orphan" }

local function bump(counts, key)
  counts[key] = (counts[key] or 0) + 1
end

-- Jobs whose answer nobody has seen.
local function open(counts)
  local number = 0
  for _, state in ipairs(OPEN) do
    number = number + (counts.states[state] or 0)
  end
  return number
end

--- What a verdict rests on: {unreadable, drives, jobs, states, operations, severities}.
function M.counts(result)
  local seen = {}
  local counts = {
    unreadable = result.complete == false and 1 or 0, drives = 0, jobs = #result.transactions,
    states = {}, operations = {}, severities = {},
  }
  for _, each in ipairs(result.transactions) do
    bump(counts.states, each.state)
    bump(counts.operations, each.operation)
    if not seen[each.device] then
      seen[each.device] = true
      counts.drives = counts.drives + 1
    end
  end
  for _, each in ipairs(result.findings) do
    bump(counts.severities, each.severity)
  end
  return counts
end

--- "none", "good", "warn" or "bad".
function M.level(counts)
  if counts.severities.error then
    return "bad"
  end
  for _, state in ipairs(FAILED) do
    if counts.states[state] then
      return "bad"
    end
  end
  if counts.severities.warning or counts.unreadable > 0 or open(counts) > 0 then
    return "warn"
  end
  return counts.jobs > 0 and "good" or "none"
end

--- What became of jobs that did not end well; where all did, that they are done: array of texts.
-- Of a capture with findings of severity error (`errors`) no more is said than that they were answered.
function M.told(states, errors, lang)
  local parts = {}
  for _, state in ipairs(TOLD) do
    if states[state] then
      parts[#parts + 1] = say(lang, "told_" .. state, { n = states[state] })
    end
  end
  if #parts == 0 then
    parts[1] = say(lang, errors and "told_all_answered" or "told_all_done")
  end
  return parts
end

--- One line: `NOT OK: 1 drive, 452 jobs, 412 refused`.
function M.verdict(counts, lang)
  local parts = {}
  if counts.jobs == 0 then
    parts[1] = say(lang, "verdict_no_jobs")
  else
    parts = M.told(counts.states, counts.severities.error, lang)
    table.insert(parts, 1, say(lang, "jobs", { n = counts.jobs }))
    table.insert(parts, 1, say(lang, "drives", { n = counts.drives }))
  end
  if counts.unreadable > 0 then
    parts[#parts + 1] = say(lang, "told_unreadable", { n = counts.unreadable })
  end
  local head = say(lang, "verdict_" .. M.level(counts))
  return head .. (lang == "zh" and "：" or ": ") .. words.joined(lang, parts)
end

-- Record calls on indices that carried no parameter channel. An IODWriteMultiple is none: it is opened, and
-- what is in it counts by its own index.
local function other_records(result)
  local ours, number = { [words.integer(WRITE_MULTIPLE)] = true }, 0
  for _, each in ipairs(result.transactions) do
    ours[words.integer(each.index)] = true
  end
  for index, kinds in pairs(result.records or {}) do
    if not ours[tostring(index)] then
      for _, count in pairs(kinds) do
        number = number + count
      end
    end
  end
  return number
end

--- What this capture, other than another one, cannot show: array of texts.
function M.blind(result, counts, lang)
  local lines = {}
  local function add(condition, key, number)
    if condition then
      lines[#lines + 1] = say(lang, key, { n = number })
    end
  end
  local nameless, other = 0, other_records(result)
  for _, each in ipairs(result.devices or {}) do
    nameless = nameless + ((each.station == nil or each.station == "") and 1 or 0)
  end
  local unseen = open(counts)
  local orphans, without_ar = counts.states.orphan or 0, 0
  for _, each in ipairs(orphans > 0 and result.transactions or {}) do
    without_ar = without_ar + (each.state == "orphan" and each.ar == nil and 1 or 0)
  end
  add(counts.operations.change, "blind_effect")
  add(result.dropped == nil, "blind_drops")
  add(nameless > 0, "blind_names", nameless)
  add(unseen > 0, "blind_open", unseen)
  add(orphans > without_ar, "blind_before", orphans - without_ar)
  add(without_ar > 0, "blind_without_ar", without_ar)
  add(other > 0, "blind_records", other)
  return lines
end

return M
