--- What is to be done: the diagnoses of a capture, and the findings that none of them says already (Python:
-- ds47.report.todo). Which findings a diagnosis covers stands in tables.covers.

local grouping = require("ds47.findings.grouping")
local tables = require("ds47.spec.tables")
local targets = require("ds47.report.targets")

local M = {}

local SERIOUS = { error = 1, warning = 2, note = 3 }

local WRONG_DRIVE_OBJECT = "DS709"
local OF_STATE = { DS530 = true, DS531 = true } -- what the status word says of a change that was not accepted
local ANSWERED = { ok = true, partial = true }

--- What the status word of the drive says of the first of these transactions of which it says something: a
-- finding, or nil.
function M.by_state(findings, transactions)
  local wanted = {}
  for _, id in ipairs(transactions) do
    wanted[id] = true
  end
  for _, each in ipairs(findings) do
    if OF_STATE[each.rule] and wanted[each.transaction] then
      return each
    end
  end
  return nil
end

--- The drive objects of its device that answer, for a request to one that does not exist; else nil.
function M.answering(all, item)
  if item.rule ~= WRONG_DRIVE_OBJECT then
    return nil
  end
  local seen, axes, names = {}, {}, targets.new(all)
  for _, each in ipairs(all) do
    local axis = each.device == item.device and ANSWERED[each.state] and names:drive_object(each)
    if axis and not seen[axis] then
      seen[axis] = true
      axes[#axes + 1] = axis
    end
  end
  table.sort(axes)
  return #axes > 0 and table.concat(axes, ", ") or nil
end

-- Whether a diagnosis of this rule names the rule of a finding: how is "job", "word" or "whole".
local function names(how, rule, finding)
  for _, start in ipairs(tables.covers[how][rule] or {}) do
    if finding.rule:sub(1, #start) == start then
      return true
    end
  end
  return false
end

-- Whether both are about the same error number, or about the same status.
local function same_code(diagnosis, finding)
  if not names("word", diagnosis.rule, finding) then
    return false
  end
  local ours, others = diagnosis.args, finding.args
  return others.code ~= nil and ours.code == others.code
    or others.status ~= nil and ours.status == others.status
end

-- What decides which findings a diagnosis covers.
local function what_of(finding)
  local args = finding.args
  return table.concat({ finding.rule, args.device or "", args.code or "", args.status or "" }, "\0")
end

-- What the diagnoses of a result cover: {devices of jobs, diagnoses of jobs, diagnoses of the whole capture}.
local function covered_by(result)
  local devices, jobs, of_jobs, whole, seen = {}, {}, {}, {}, {}
  for _, each in ipairs(result.transactions) do
    devices[each.id] = each.device
  end
  for _, each in ipairs(result.findings) do
    if each.transaction and grouping.is_diagnosis(each.rule) then
      jobs[each.transaction] = jobs[each.transaction] or {}
      table.insert(jobs[each.transaction], each)
      of_jobs[each.rule] = true
    end
  end
  for _, each in ipairs(result.findings) do
    if grouping.is_diagnosis(each.rule) and not of_jobs[each.rule] then
      local what = what_of(each)
      whole[#whole + 1] = not seen[what] and each or nil
      seen[what] = true
    end
  end
  return { devices = devices, jobs = jobs, whole = whole }
end

local function covers(about, finding)
  for _, each in ipairs(about.jobs[finding.transaction or 0] or {}) do
    if names("job", each.rule, finding) or same_code(each, finding) then
      return true
    end
  end
  local device = about.devices[finding.transaction or 0]
  for _, each in ipairs(about.whole) do
    local elsewhere = device and each.args.device and device ~= each.args.device
    if not elsewhere and (names("whole", each.rule, finding) or same_code(each, finding)) then
      return true
    end
  end
  return false
end

--- Errors and warnings that no diagnosis covers, in their order.
function M.uncovered(result)
  local about, found = covered_by(result), {}
  for _, each in ipairs(result.findings) do
    local serious = each.severity ~= "note" and not grouping.is_diagnosis(each.rule)
    if serious and not covers(about, each) then
      found[#found + 1] = each
    end
  end
  return found
end

--- Findings by rule: an array of arrays, the serious rules first, then by id.
function M.by_rule(findings)
  local rules, groups = {}, {}
  for _, each in ipairs(findings) do
    local group = rules[each.rule]
    if not group then
      group = {}
      rules[each.rule] = group
      groups[#groups + 1] = group
    end
    group[#group + 1] = each
  end
  table.sort(groups, function(a, b)
    local left, right = SERIOUS[a[1].severity], SERIOUS[b[1].severity]
    return left < right or left == right and a[1].rule < b[1].rule
  end)
  return groups
end

-- What stands for the diagnoses of one rule behind the first `most`.
local function rest_of(diagnoses, most)
  local more = { more = true, rule = diagnoses[1].rule, causes = #diagnoses - most, findings = 0 }
  for place = most + 1, #diagnoses do
    more.findings = more.findings + diagnoses[place].count
  end
  return more
end

--- The diagnoses in their order, but no more than `most` of one rule: the rest of it stands behind the last,
-- as {more = true, rule, causes, findings}.
function M.causes(diagnoses, most)
  local of_rule, told, list = {}, {}, {}
  for _, each in ipairs(diagnoses) do
    of_rule[each.rule] = of_rule[each.rule] or {}
    table.insert(of_rule[each.rule], each)
  end
  for _, each in ipairs(diagnoses) do
    local all, number = of_rule[each.rule], (told[each.rule] or 0) + 1
    told[each.rule] = number
    if number <= most then
      list[#list + 1] = each
    end
    if number == most and #all > most then
      list[#list + 1] = rest_of(all, most)
    end
  end
  return list
end

return M
