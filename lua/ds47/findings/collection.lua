-- Remarks to findings: which are wanted, which transaction they belong to, which frames they are about.
--
-- Nothing is judged here; a remark comes from the judge, the diagnosis or the record calls. Nothing is worded
-- here either: that is sentences.lua. A remark may be `of` somebody: of the drive of a maker whose tables are
-- not known it is a note.

local arrays = require("ds47.support.arrays")
local flat = require("ds47.support.flat").copy
local tables = require("ds47.spec.tables")

local M = {}

local NONE = {}

local Findings = {}
Findings.__index = Findings

--- Collects remarks and makes findings of them.
-- @param ignore  array of rule ids or prefixes that are not wanted; nil for none
function M.new(ignore)
  return setmetatable({
    ignore = ignore or {},
    kept = {}, -- array of remarks; `below` is one that comes before it
    at_frame = {}, -- frame -> array of remarks, also of those that are not kept yet
    frames_dropped = false, -- whether the capture says that frames are missing (docs/pairing.md P47)
  }, Findings)
end

--- Findings that begin with what these hold; what is added to them stays their own.
function Findings:on_top()
  local findings = M.new(self.ignore)
  findings.kept.below = self.kept
  return findings
end

--- Whether the user wants to hear of a rule.
function Findings:wanted(rule)
  return not arrays.any(self.ignore, function(prefix) return rule:sub(1, #prefix) == prefix end)
end

--- Keeps a remark for `result`, if its rule is wanted.
function Findings:add(remark)
  self:foresee({remark})
  self:keep({remark})
end

--- Shows remarks in `at` that `keep` will keep later, when their job is closed.
function Findings:foresee(remarks)
  for _, remark in ipairs(remarks) do
    if self:wanted(remark.rule) then arrays.push(self.at_frame, remark.frame, remark) end
  end
end

--- Keeps remarks that were foreseen.
function Findings:keep(remarks)
  for _, remark in ipairs(remarks) do
    if self:wanted(remark.rule) then self.kept[#self.kept + 1] = remark end
  end
end

--- Takes back what was kept of an AR (`remark.ar`), and of jobs: {[order] = true}.
function Findings:withdraw(ar, orders)
  local function stays(remark) return remark.ar ~= ar and not orders[remark.order or 0] end
  self.kept = arrays.filtered(self.kept, stays)
  for frame, remarks in pairs(self.at_frame) do self.at_frame[frame] = arrays.filtered(remarks, stays) end
end

-- All frames that a finding is about, sorted, each once: the one that it stands on, and those that its
-- arguments name.
local function frames_of(rule, frame, args)
  local frames = {frame}
  for name, kind in pairs(tables.rules[rule].args or NONE) do
    frames[#frames + 1] = kind == "frame" and args and args[name] or nil
  end
  return arrays.in_order(frames)
end

--- The finding of a remark: {rule, severity, frame, frames, transaction (id or nil), order, offset, args}.
-- It has no words: sentences.lua has them.
function Findings:finding(remark, transaction)
  local args, kinds = remark.args, tables.rules[remark.rule].args or NONE
  if kinds.dropped and args.dropped == nil then -- those of unanswered requests know it
    args = flat(args)
    args.dropped = self.frames_dropped
  end
  return {
    rule = remark.rule,
    severity = remark.of and remark.of:is_foreign() and "note" or tables.rules[remark.rule].severity,
    frame = remark.frame, frames = frames_of(remark.rule, remark.frame, args),
    transaction = transaction, order = remark.order, offset = remark.offset, args = args or NONE,
  }
end

-- Sorts findings by frame, rule, transaction and offset; of equals the one that was told first comes first.
-- `owner` is the name of the field that tells the transaction.
local function sorted(findings, owner)
  local told = {}
  for number, finding in ipairs(findings) do told[finding] = number end
  local fields = {"frame", "rule", owner, "offset"}
  table.sort(findings, function(a, b)
    for _, field in ipairs(fields) do
      local one, other = a[field] or 0, b[field] or 0
      if one ~= other then return one < other end
    end
    return told[a] < told[b]
  end)
  return findings
end

local function stands(remark) return not remark.withdrawn end

--- What is known so far of a frame: array of findings in the order of a report, without transaction ids.
function Findings:at(frame)
  local remarks = self.at_frame[frame]
  if remarks == nil then return NONE end
  local function finding(remark) return self:finding(remark) end
  return sorted(arrays.mapped(arrays.filtered(remarks, stands), finding), "order")
end

local function add_all(self, remarks, store, result, offers)
  for _, remark in ipairs(arrays.filtered(remarks, stands)) do
    local owner = remark.order and store:by_order(remark.order)
    local finding = self:finding(remark, owner and owner.id)
    finding.corrected = remark.corrected and offers:offered(remark.corrected)
    result[#result + 1] = finding
    if owner then
      local rules = owner.findings
      if not arrays.has(rules, remark.rule) then rules[#rules + 1] = remark.rule end
    end
  end
end

--- All findings in the order of their frames; their transactions get to know their rules.
-- @param transactions  array of all transactions, with their ids
-- @param store         the transactions.Store that knows them by the order of their jobs
-- @param offers        what tells which corrected requests hold (`offered`): the diagnoses
-- @return findings; those with one have its bytes as `corrected`
function Findings:result(transactions, store, offers)
  local result = {}
  if self.kept.below then add_all(self, self.kept.below, store, result, offers) end
  add_all(self, self.kept, store, result, offers)
  for _, transaction in ipairs(transactions) do
    if #transaction.findings > 1 then table.sort(transaction.findings) end
  end
  return sorted(result, "transaction")
end

return M
