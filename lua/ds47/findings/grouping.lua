--- Findings to headlines: one for each cause, with a count, the frames, and what is true of all
-- (docs/diagnoses.md; Python: ds47.diagnosis.grouping). A cause is a rule, a device and those arguments that
-- the rule names in `group`. A headline is {rule, severity, args, differs, device, count, frames,
-- frames_left_out, transactions, corrected (bytes), corrected_in}: of the arguments it keeps those that are
-- the same in all of its cases, and `differs` names the others. It is worded in sentences.lua.

local json = require("ds47.support.json")
local tables = require("ds47.spec.tables")

local concat, sort = table.concat, table.sort

local M = {}

M.FAMILY = "DS7"

local OFFERED = 8 -- corrected requests of a cause of which it is asked whether they hold

local RANK = { error = 1, warning = 2, note = 3 }

--- The frames in which what a finding says happened: those of a rule that counts, else its own alone.
function M.counted(finding)
  local frames = finding.args and finding.args.frames
  return frames and #frames > 0 and frames or { finding.frame }
end

--- Whether a rule is a diagnosis.
function M.is_diagnosis(rule)
  return rule:sub(1, #M.FAMILY) == M.FAMILY
end

local function plain(value)
  return type(value) == "table" and json.encode(value) or tostring(value)
end

--- What a cause is told apart by, as text.
function M.key_of(rule, device, args)
  local parts, row = { rule, device or "" }, tables.rules[rule]
  for _, name in ipairs(row and row.group or {}) do
    parts[#parts + 1] = args[name] == nil and "" or plain(args[name])
  end
  return concat(parts, "\0")
end

local function has(list, wanted)
  for _, each in ipairs(list) do
    if each == wanted then
      return true
    end
  end
  return false
end

-- Puts a number into a sorted list.
local function insert(list, number)
  local place = #list + 1
  while place > 1 and list[place - 1] > number do
    place = place - 1
  end
  table.insert(list, place, number)
end

-- Keeps a frame in a sorted list, each once; false where it has no room.
local function keep(list, number)
  local last, most = list[#list], tables.known.frames
  if last == nil or last < number then
    if #list < most then
      list[#list + 1] = number
      return true
    end
    return false
  elseif last == number or has(list, number) then
    return true
  end
  insert(list, number)
  if #list > most then
    list[#list] = nil
    return false
  end
  return true
end

local function same(one, other)
  if type(one) == "table" and type(other) == "table" then
    return plain(one) == plain(other)
  end
  return one == other
end

-- Takes from a headline what is not the same in a further case.
local function agree(group, args)
  local differs = {}
  for name, value in pairs(group.args) do
    if not same(value, args[name]) then
      differs[#differs + 1] = name
    end
  end
  for name in pairs(args) do
    if group.args[name] == nil and not has(group.differs, name) then
      differs[#differs + 1] = name
    end
  end
  for _, name in ipairs(differs) do
    group.args[name] = nil
    group.differs[#group.differs + 1] = name
  end
  sort(group.differs)
end

local function copy(args)
  local mine = {}
  for name, value in pairs(args) do
    mine[name] = value
  end
  return mine
end

local function new_group(finding, device, key)
  return {
    rule = finding.rule, severity = finding.severity, args = copy(finding.args or {}), differs = {},
    device = device, count = 0, frames = {}, frames_left_out = 0, transactions = {}, key = key,
  }
end

-- A further case.
local function count(group, finding)
  group.count = group.count + 1
  agree(group, finding.args or {})
  for _, frame in ipairs(M.counted(finding)) do
    if not keep(group.frames, frame) and group.last ~= frame then
      group.last = frame -- it may come again
      group.frames_left_out = group.frames_left_out + 1
    end
  end
  local jobs, job = group.transactions, finding.transaction
  if job and #jobs < tables.known.frames and not has(jobs, job) then
    jobs[#jobs + 1] = job
  end
end

local Grouping = {}
Grouping.__index = Grouping

--- Counts findings by their causes; memory is bounded, whatever the capture holds.
function M.new()
  return setmetatable({ groups = {}, all = {} }, Grouping)
end

local function group_of(self, finding, device)
  local key = M.key_of(finding.rule, device, finding.args or {})
  local group = self.groups[key]
  if group == nil and #self.all >= tables.known.groups then -- too many to tell apart: by rule alone
    key, device = finding.rule .. "\0", nil
    group = self.groups[key]
  end
  if group == nil then
    group = new_group(finding, device, key)
    self.groups[key] = group
    self.all[#self.all + 1] = group
  end
  return group
end

-- Keeps the corrected request of the first case that has one that holds.
local function offer(group, finding)
  group.offers = (group.offers or 0) + 1
  if group.corrected == nil and group.offers <= OFFERED then
    group.corrected, group.corrected_in = finding.corrected, finding.corrected and finding.transaction
  end
end

--- Counts a finding, with its transaction where it has one.
-- @param device address of the device, or nil
-- @param offered whether a corrected request was made for it, which may not hold
function Grouping:add(finding, device, offered)
  local group = group_of(self, finding, device)
  count(group, finding)
  if offered then
    offer(group, finding)
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

--- Findings that no diagnosis says, by their causes, each with its `first` finding: the serious rules first,
-- then by id; of one rule the most frequent cause first.
function M.headlines(findings)
  local groups, all = {}, {}
  for _, each in ipairs(findings) do
    local key = M.key_of(each.rule, nil, each.args or {})
    if groups[key] == nil then
      groups[key] = new_group(each, nil, key)
      groups[key].first, groups[key].place = each, #all
      all[#all + 1] = groups[key]
    end
    count(groups[key], each)
  end
  sort(all, function(a, b)
    if RANK[a.severity] ~= RANK[b.severity] then
      return RANK[a.severity] < RANK[b.severity]
    elseif a.rule ~= b.rule then
      return a.rule < b.rule
    elseif a.count ~= b.count then
      return a.count > b.count
    end
    local first = before(a.frames, b.frames)
    if first == nil then
      return a.place < b.place
    end
    return first
  end)
  return all
end

return M
