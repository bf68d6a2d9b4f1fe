--- Findings DS7xx to diagnoses: one for each cause, with a count and the first frames (docs/diagnoses.md).
-- A cause is a rule, a device and those arguments that the rule names in `group` (Python:
-- ds47.diagnosis.grouping). A diagnosis is {rule, severity, args, device, count, frames, transactions}.

local tables = require("ds47.tables")

local concat, sort = table.concat, table.sort

local M = {}

M.FAMILY = "DS7"

local RANK = { error = 1, warning = 2, note = 3 }

--- Whether a rule is a diagnosis.
function M.is_diagnosis(rule)
  return rule:sub(1, #M.FAMILY) == M.FAMILY
end

-- Keeps the least numbers, sorted, each once.
local function insert(list, number)
  for _, known in ipairs(list) do
    if known == number then
      return
    end
  end
  list[#list + 1] = number
  sort(list)
  list[tables.known.frames + 1] = nil
end

local Grouping = {}
Grouping.__index = Grouping

--- Counts findings by their causes; memory is bounded, whatever the capture holds.
function M.new()
  return setmetatable({ groups = {}, all = {} }, Grouping)
end

local function key_of(rule, device, args)
  local parts = { rule, device or "" }
  for _, name in ipairs(tables.rules[rule].group) do
    parts[#parts + 1] = tostring(args[name] == nil and "" or args[name])
  end
  return concat(parts, "\0")
end

local function group_of(self, finding, device, args)
  local key = key_of(finding.rule, device, args)
  local group = self.groups[key]
  if group == nil and #self.all >= tables.known.groups then -- too many to tell apart: by rule alone
    key, device = finding.rule .. "\0", nil
    group = self.groups[key]
  end
  if group == nil then
    group = {
      rule = finding.rule, severity = finding.severity, args = finding.args, device = device,
      count = 0, frames = {}, transactions = {}, key = key,
    }
    self.groups[key] = group
    self.all[#self.all + 1] = group
  end
  return group
end

--- A finding of a cause, with its transaction where it has one.
-- @param device address of the device, or nil
function Grouping:add(finding, device)
  local group = group_of(self, finding, device, finding.args)
  group.count = group.count + 1
  insert(group.frames, finding.frame)
  if finding.transaction then
    insert(group.transactions, finding.transaction)
  end
end

-- Whether an array of numbers comes before another one; nil where they are alike.
local function before(left, right)
  for place = 1, math.max(#left, #right) do
    local a, b = left[place] or -1, right[place] or -1
    if a ~= b then
      return a < b
    end
  end
  return nil
end

local function worse(a, b)
  if RANK[a.severity] ~= RANK[b.severity] then
    return RANK[a.severity] < RANK[b.severity]
  elseif a.count ~= b.count then
    return a.count > b.count
  elseif a.rule ~= b.rule then
    return a.rule < b.rule
  end
  local first = before(a.frames, b.frames)
  if first == nil then
    return M.bytes_before(a.key, b.key)
  end
  return first
end

--- Whether a text comes before another one by its bytes, whatever the locale.
function M.bytes_before(left, right)
  return before({ left:byte(1, -1) }, { right:byte(1, -1) }) or false
end

--- The diagnoses, worst first, then the most frequent.
function Grouping:result()
  sort(self.all, worse)
  return self.all
end

return M
