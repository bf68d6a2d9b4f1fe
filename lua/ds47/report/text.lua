--- Report as text: how many transactions have which state, then every finding with its frames and the advice
-- of its rule. What else a capture tells in words is the analyzer's (`ds47 report`). Takes the result of
-- Analysis:ended(); opens no file.

local arrays = require("ds47.support.arrays")
local tables = require("ds47.spec.tables")
local words = require("ds47.report.formatting")

local M = {}

local append, mapped = arrays.append, arrays.mapped
local concat, integer, say = table.concat, words.integer, words.say

local WIDTH = 100 -- columns of a line
local STATES = {
  "ok", "partial", "error", "mismatch", "refused", "unanswered", "superseded", "incomplete", "orphan",
}
local SEVERITIES = { "error", "warning", "note" } -- from serious to harmless
local RANK = { error = 1, warning = 2, note = 3 }

-- How many of these have each word of a key, as `told` says it: array of texts, in the order of the words.
local function parts_of(list, key, order, told)
  local counts, parts = {}, {}
  for _, each in ipairs(list) do counts[each[key]] = (counts[each[key]] or 0) + 1 end
  for _, word in ipairs(order) do
    if counts[word] then parts[#parts + 1] = told(counts[word], word) end
  end
  return parts
end

--- `84 ok`, `3 error`: how many transactions have each state, in the order of the table.
function M.by_state(transactions, lang)
  return parts_of(transactions, "state", STATES, function(count, state)
    return say(lang, "told_state", { n = count, state = words.state(lang, state) })
  end)
end

--- Findings by rule and severity: an array of arrays, the serious ones first, then by id.
function M.by_rule(findings)
  local rules, groups = {}, {}
  for _, each in ipairs(findings) do
    local about = each.rule .. each.severity
    arrays.push(rules, about, each)
    if #rules[about] == 1 then groups[#groups + 1] = rules[about] end
  end
  table.sort(groups, function(a, b)
    local left, right = RANK[a[1].severity], RANK[b[1].severity]
    return left < right or left == right and a[1].rule < b[1].rule
  end)
  return groups
end

-- The frames that a finding is about, and the transaction it belongs to: `frame 29, 31 #7`.
local function place_of(finding, lang)
  local frames = mapped(finding.frames, integer)
  local job = finding.transaction and " #" .. integer(finding.transaction) or ""
  return say(lang, "frame", { frame = concat(frames, ", ") }), job
end

local function add_group(add, group, lang)
  local first = group[1]
  local rule = tables.rules[first.rule]
  add("")
  add(say(lang, "findings_of_rule", {
    rule = first.rule, severity = say(lang, "severity_" .. first.severity), name = " " .. rule.name,
    findings = say(lang, "findings", { n = #group }),
  }))
  add("  -> " .. (lang == "zh" and rule.advice_zh or rule.advice), 5)
  for _, each in ipairs(group) do
    local frame, job = place_of(each, lang)
    add("  " .. say(lang, "finding_line", {
      frame = frame, job = job, message = words.escape(words.message(each, lang)),
    }), 4)
  end
end

-- `3 error`, `1 note`: how many findings are how serious.
local function by_severity(findings, lang)
  return parts_of(findings, "severity", SEVERITIES, function(count, severity)
    return integer(count) .. " " .. say(lang, "severity_" .. severity)
  end)
end

-- `12 transactions: 11 ok, 1 refused`
local function total(key, list, parts, lang)
  local text = say(lang, key, { n = #list })
  return #parts > 0 and words.joined(lang, { text, words.joined(lang, parts) }, ": ", "：") or text
end

--- The report of one capture.
-- @param result what Analysis:ended() gives
-- @param options nil or {path = name of the capture (nil where nobody knows it), frames = frames in the file,
--   lang = "en" or "zh"}
-- @return text, every line ended with LF
function M.report(result, options)
  options = options or {}
  local lang, lines = options.lang or "en", {}
  local function add(text, hanging) append(lines, words.wrap(text, WIDTH, hanging)) end
  local frames = say(lang, "frames", { n = options.frames or 0 })
  add(options.path and words.escape(options.path) .. ": " .. frames or frames)
  add(total("transactions", result.transactions, M.by_state(result.transactions, lang), lang), 2)
  add(total("findings", result.findings, by_severity(result.findings, lang), lang), 2)
  for _, group in ipairs(M.by_rule(result.findings)) do add_group(add, group, lang) end
  return concat(lines, "\n") .. "\n"
end

return M
