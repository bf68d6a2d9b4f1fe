-- Remarks to findings: which are wanted, what they say in words, which transaction they belong to.
--
-- Nothing is judged here; a remark comes from rules.lua or recordcalls.lua. Words are made when somebody asks
-- for them, not on the way of a frame.

local grouping = require("ds47.grouping")
local tables = require("ds47.tables")

local floor, format = math.floor, string.format

local M = {}

local WITHOUT_REQUEST = "DS403"
local NONE = {}

local Findings = {}
Findings.__index = Findings
M.Findings = Findings

--- Collects remarks and words them.
-- @param lang    "en" or "zh"
-- @param select  array of rule ids or prefixes that are wanted; nil or empty for all
-- @param ignore  array of rule ids or prefixes that are not
function M.new(lang, select, ignore)
  return setmetatable({
    lang = lang,
    select = select or {},
    ignore = ignore or {},
    decided = {}, -- rule id -> whether it is wanted
    kept = {}, -- array of remarks; `below` is one that comes before it
    at_frame = {}, -- frame -> array of remarks, also of those that are not kept yet
    frames_dropped = false, -- whether the capture says that frames are missing (docs/pairing.md P47)
  }, Findings)
end

--- For a copy of the analysis: what is kept is shared, what the copy adds stays its own.
function Findings:copied(known)
  known[self.kept] = {below = self.kept}
  known[self.at_frame] = {}
end

local function begins_with_one(rule, prefixes)
  for _, prefix in ipairs(prefixes) do
    if rule:sub(1, #prefix) == prefix then
      return true
    end
  end
  return false
end

--- Whether the user wants to hear of a rule.
function Findings:wanted(rule)
  local wanted = self.decided[rule]
  if wanted == nil then
    wanted = (#self.select == 0 or begins_with_one(rule, self.select))
      and not begins_with_one(rule, self.ignore)
    self.decided[rule] = wanted
  end
  return wanted
end

local function show(self, remark)
  local there = self.at_frame[remark.frame]
  if there == nil then
    there = {}
    self.at_frame[remark.frame] = there
  end
  there[#there + 1] = remark
end

local function keep(self, remark)
  local job = remark.job
  if job then
    remark.order, remark.job = job.order, nil -- the job itself need not be kept
  end
  self.kept[#self.kept + 1] = remark
end

--- Keeps a remark for `result`, if its rule is wanted.
function Findings:add(remark)
  if self:wanted(remark.rule) then
    show(self, remark)
    keep(self, remark)
  end
end

--- Shows remarks in `at` that `keep` will keep later, when their job is closed.
function Findings:foresee(remarks)
  for _, remark in ipairs(remarks) do
    if self:wanted(remark.rule) then
      show(self, remark)
    end
  end
end

--- Keeps remarks that were foreseen.
function Findings:keep(remarks)
  for _, remark in ipairs(remarks) do
    if self:wanted(remark.rule) then
      keep(self, remark)
    end
  end
end

-- Words

-- Templates as arrays: text, name of an argument, text, ...
local templates = {}

local function pieces(template)
  local found = templates[template]
  if found == nil then
    found = {}
    local at = 1
    for before, name, after in template:gmatch("([^{]*){([^}]*)}()") do
      found[#found + 1] = before
      found[#found + 1] = name
      at = after
    end
    found[#found + 1] = template:sub(at)
    templates[template] = found
  end
  return found
end

local function argument(value)
  if value == nil then
    return "?"
  elseif type(value) == "number" and value == floor(value) then
    return format("%d", value)
  end
  return tostring(value)
end

-- A template with its arguments; a question mark for one that is not known.
local function fill(template, args)
  local parts, text = pieces(template), {}
  for number, part in ipairs(parts) do
    if number % 2 == 1 then
      text[number] = part
    else
      text[number] = argument(args and args[part])
    end
  end
  return table.concat(text)
end

local function words_of(self, remark)
  local message = remark.message
  if message == nil then
    local rule = tables.rules[remark.rule]
    message = fill(self.lang == "zh" and rule.message_zh or rule.message, remark.args)
    remark.message = message
  end
  if self.frames_dropped and remark.rule == WITHOUT_REQUEST then
    return message .. " (" .. self:_reason("dropped") .. ")"
  end
  return message
end

--- The finding of a remark: {rule, severity, message, frame, transaction (id or nil), order, offset}.
function Findings:word(remark, transaction)
  return {
    rule = remark.rule,
    severity = tables.rules[remark.rule].severity,
    message = words_of(self, remark),
    frame = remark.frame,
    transaction = transaction,
    order = remark.job and remark.job.order or remark.order,
    offset = remark.offset,
  }
end

function Findings:_reason(name)
  local words = tables.reasons[name]
  return self.lang == "zh" and words.zh or words.en
end

--- Why a request stayed without its response, in words.
function Findings:reason(name)
  local text = self:_reason(name)
  return self.frames_dropped and text .. "; " .. self:_reason("dropped") or text
end

-- Results

-- Sorts findings by frame, rule, transaction and offset; of equals the one that was told first comes first.
-- `owner` is the name of the field that tells the transaction.
local function sorted(findings, owner)
  local told = {}
  for number, finding in ipairs(findings) do
    told[finding] = number
  end
  table.sort(findings, function(a, b)
    if a.frame ~= b.frame then
      return a.frame < b.frame
    elseif a.rule ~= b.rule then
      return a.rule < b.rule
    end
    local first, second = a[owner] or 0, b[owner] or 0
    if first ~= second then
      return first < second
    end
    first, second = a.offset or 0, b.offset or 0
    if first ~= second then
      return first < second
    end
    return told[a] < told[b]
  end)
  return findings
end

--- What is known so far of a frame: array of findings without transaction ids.
function Findings:at(frame)
  local remarks = self.at_frame[frame]
  if remarks == nil then
    return NONE
  end
  local result = {}
  for number, remark in ipairs(remarks) do
    result[number] = self:word(remark)
  end
  return sorted(result, "order")
end

local function add_all(self, remarks, store, result, causes)
  for _, remark in ipairs(remarks) do
    local owner = remark.order and store:by_order(remark.order)
    local finding = self:word(remark, owner and owner.id)
    result[#result + 1] = finding
    if grouping.is_diagnosis(remark.rule) then
      local args = remark.args or {}
      causes[#causes + 1] = {finding = finding, device = owner and owner.device or args.device, args = args}
    end
    if owner then
      local rules = owner.findings
      local known = false
      for _, rule in ipairs(rules) do
        known = known or rule == remark.rule
      end
      if not known then
        rules[#rules + 1] = remark.rule
      end
    end
  end
end

-- The diagnoses of findings with what they are told apart by; the first frame of a cause gives its message.
local function grouped(causes)
  for number, each in ipairs(causes) do
    each.told = number
  end
  table.sort(causes, function(a, b)
    if a.finding.frame ~= b.finding.frame then
      return a.finding.frame < b.finding.frame
    end
    return a.told < b.told
  end)
  local groups = grouping.new()
  for _, each in ipairs(causes) do
    groups:add(each.finding, each.device, each.args)
  end
  return groups:result()
end

--- All findings in the order of their frames; their transactions get to know their rules.
-- @param transactions  array of all transactions, with their ids
-- @param store         the transactions.Store that knows them by the order of their jobs
-- @return findings, diagnoses
function Findings:result(transactions, store)
  local result, causes = {}, {}
  if self.kept.below then
    add_all(self, self.kept.below, store, result, causes)
  end
  add_all(self, self.kept, store, result, causes)
  for _, transaction in ipairs(transactions) do
    if #transaction.findings > 1 then
      table.sort(transaction.findings)
    end
  end
  return sorted(result, "transaction"), grouped(causes)
end

return M
