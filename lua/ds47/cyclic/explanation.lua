-- Judgement: a change that was not accepted because the drive was in operation, or was not (DS530, DS531).
-- An error number about a state, and the state that the status word shows at that time. Only where it is
-- proven that both are of the same drive object; docs/cyclic.md 6.

local arrays = require("ds47.support.arrays")
local operation = require("ds47.cyclic.operation")
local tables = require("ds47.spec.tables")

local M = {}

local OF_SUBMODULE = 0xB02E -- record index that addresses the drive object of its submodule

-- The first parameter of a change whose error number is about a state; nil where there is none.
local function turned_down(item)
  local frames = item.frames
  if item.operation ~= "change" or not frames.write_request or not frames.read_response then return nil end
  return arrays.first(item.parameters, function(each)
    return each.error and each.error.code and tables.pzd.state_errors[each.error.code]
  end)
end

-- The drive in the slot that was asked, where no other one can be meant.
local function same(item, drives)
  local there, found, several = 0, nil, false
  for _, drive in ipairs(drives) do
    local relation = drive.relation
    if relation.device == item.device then
      there = there + 1
      if relation.slot == item.slot then several, found = found ~= nil, found or drive end
    end
  end
  local alone = there == 1 or item.index == OF_SUBMODULE or item.index == nil
  return not several and alone and found or nil
end

--- What the status word of the same drive object says of a transaction: a remark, or nil.
-- @param drives the proven ones
function M.explain(item, drives)
  local parameter = turned_down(item)
  local drive = parameter and same(item, drives)
  if not drive or not drive.recorder:has_sense() then return nil end
  local recorder, first, last = drive.recorder, item.frames.write_request, item.frames.read_response
  local replaced = drive.relation.replaced
  if replaced and replaced < first then return nil end -- of what a later Connect set up nothing is known
  local running = recorder:running(first, last)
  if running == nil then return nil end
  local args = {pnu = parameter.pnu, subindex = parameter.subindex, family = parameter.family}
  if running then
    args.since = recorder:running_since(first)
    args.what = args.since and "pzd_since" or "pzd_since_ever"
    return {rule = "DS530", frame = last, args = args}
  end
  args.what = operation.state_key(recorder:state_at(last) or "not ready")
  return {rule = "DS531", frame = last, args = args}
end

return M
