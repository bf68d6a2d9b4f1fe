--- The verdict on a capture, and what the capture cannot show (Python: ds47.report.verdict).
-- Counted from the result of an analysis; the words are those of tables.report_words.

local WRITE_MULTIPLE = require("ds47.profinet.records").WRITE_MULTIPLE
local words = require("ds47.report.formatting")

local NOT_OTHER = { WRITE_MULTIPLE, 0xB02E, 0xB02F } -- the indices that are no "other" ones

local say = words.say

local M = {}

--- The states of a transaction, in the order in which they are told.
M.STATES = { "ok", "partial", "error", "mismatch", "refused", "unanswered", "superseded", "orphan" }
-- States of a transaction that did not do what it was meant to do.
local FAILED = { "refused", "error", "partial", "mismatch" }
-- States of a transaction of which nobody knows what became of it.
local OPEN = { "unanswered", "superseded" }
-- Rules about a record call that brought nothing: where one did, not all is done.
local CALLS = { DS101 = true, DS104 = true, DS105 = true, DS108 = true, DS207 = true }

local function bump(counts, key)
  counts[key] = (counts[key] or 0) + 1
end

-- Transactions whose response nobody has seen.
local function open(counts)
  local number = 0
  for _, state in ipairs(OPEN) do
    number = number + (counts.states[state] or 0)
  end
  return number
end

-- How many drives are followed in their cyclic frames.
local function watched(result)
  local seen, number = {}, 0
  for _, each in ipairs(result.timelines or {}) do
    local device = result.relations[each.relation].device
    number = number + (seen[device] and 0 or 1)
    seen[device] = true
  end
  return number
end

--- What a verdict rests on: {unreadable, drives, watched, connections (of S7), jobs, states, operations,
-- severities, calls}; `calls` is true where a record call brought nothing.
function M.counts(result)
  local seen = {}
  local counts = {
    unreadable = result.complete == false and 1 or 0, drives = 0, jobs = #result.transactions,
    watched = watched(result),
    connections = #(result.connections or {}) + (result.connections_left_out or 0),
    states = {}, operations = {}, severities = {},
  }
  for _, each in ipairs(result.transactions) do
    bump(counts.states, each.state)
    bump(counts.operations, each.operation)
    if not seen[each.device] and each.channel ~= "s7" then
      seen[each.device] = true
      counts.drives = counts.drives + 1
    end
  end
  for _, each in ipairs(result.findings) do
    bump(counts.severities, each.severity)
    counts.calls = counts.calls or CALLS[each.rule]
  end
  return counts
end

--- Whether nothing went wrong on the way: no finding of severity error, every record call with its record.
function M.smooth(counts)
  return not counts.severities.error and not counts.calls
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
  return (counts.jobs > 0 or counts.watched > 0) and "good" or "none"
end

--- `84 ok`, `3 error`: how many transactions have each state, in the order of the table; `but` is left out.
function M.by_state(states, lang, but)
  local parts = {}
  for _, state in ipairs(M.STATES) do
    if states[state] and state ~= but then
      parts[#parts + 1] = say(lang, "told_state", { n = states[state], state = words.state(lang, state) })
    end
  end
  return parts
end

--- What became of transactions that did not end well; where all did, that they are done: array of texts.
-- Of a capture that is not `smooth` no more is said than that all have a response.
function M.told(states, smooth, lang)
  local parts = M.by_state(states, lang, "ok")
  return #parts > 0 and parts or { say(lang, smooth and "told_all_done" or "told_all_answered") }
end

--- One line: `NOT OK: 1 drive, 452 transactions, 412 refused`.
function M.verdict(counts, lang)
  local parts = {}
  if counts.jobs == 0 then
    parts[1] = counts.watched > 0 and say(lang, "verdict_watched", { n = counts.watched }) or nil
    parts[#parts + 1] = say(lang, "verdict_no_jobs")
  else
    parts = M.told(counts.states, M.smooth(counts), lang)
    table.insert(parts, 1, say(lang, "transactions", { n = counts.jobs }))
    if counts.connections > 0 then
      table.insert(parts, 1, say(lang, "verdict_s7", { n = counts.connections }))
    end
    if counts.drives > 0 or counts.connections == 0 then
      table.insert(parts, 1, say(lang, "drives", { n = counts.drives }))
    end
  end
  if counts.unreadable > 0 then
    parts[#parts + 1] = say(lang, "told_unreadable", { n = counts.unreadable })
  end
  local head = say(lang, "verdict_" .. M.level(counts))
  return head .. (lang == "zh" and "：" or ": ") .. words.joined(lang, parts)
end

-- Record calls on indices that carried no parameter channel, and are not there for one. An IODWriteMultiple
-- is none: it is opened, and what is in it counts by its own index.
local function other_records(result)
  local ours, number = {}, 0
  for _, index in ipairs(NOT_OTHER) do
    ours[words.integer(index)] = true
  end
  for _, each in ipairs(result.transactions) do
    if each.index then
      ours[words.integer(each.index)] = true
    end
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

-- How many transactions a test holds for.
local function count(transactions, test)
  local number = 0
  for _, each in ipairs(transactions) do
    number = number + (test(each) and 1 or 0)
  end
  return number
end

-- Whether nobody has seen the response of a record call.
local function unseen_record(item)
  return item.channel == "ds47" and (item.state == OPEN[1] or item.state == OPEN[2])
end

-- Whether the drive accepted at least one value that was written.
local function accepted(item)
  return item.operation == "change" and (item.state == "ok" or item.state == "partial")
end

local function of_s7(item)
  return item.channel == "s7"
end

-- Whether there is a response alone.
local function orphaned(item)
  return item.state == "orphan" and item.channel ~= "s7"
end

-- Whether the request was sent before the capture or lost by it. A Read without an AR has none of its own.
local function orphaned_with_ar(item)
  return orphaned(item) and (item.ar ~= nil or item.station ~= nil)
end

--- What this capture, other than another one, cannot show: array of texts.
function M.blind(result, lang)
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
  local unseen = count(result.transactions, unseen_record)
  local orphans = count(result.transactions, orphaned)
  local without_ar = orphans - count(result.transactions, orphaned_with_ar)
  add(count(result.transactions, accepted) > 0, "blind_effect")
  add(result.dropped == nil, "blind_drops")
  add(nameless > 0, "blind_names", nameless)
  add(unseen > 0, "blind_open", unseen)
  add(count(result.transactions, of_s7) > 0, "blind_s7")
  add(orphans > without_ar, "blind_before", orphans - without_ar)
  add(without_ar > 0, "blind_without_ar", without_ar)
  add(other > 0, "blind_records", other)
  return lines
end

return M
