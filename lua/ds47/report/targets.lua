--- What requests address, in words: a drive object only where the capture proves that it is one.
-- Which two requests reach the same drive object is drive_objects.lua; here it gets a name (Python:
-- ds47.report.targets).

local drive_objects = require("ds47.profidrive.drive_objects")
local sentences = require("ds47.report.sentences")

local format = string.format

local M = {}

local Targets = {}
Targets.__index = Targets

--- The names in one capture.
function M.new(transactions) return setmetatable({ shown = drive_objects.of(transactions) }, Targets) end

--- `DO 2`, `axis 0`; empty where only the submodule is known.
function Targets:words(item)
  local number, axis = self.shown:reached(item), drive_objects.access_of(item).axis
  if number then return format("DO %d", number) end
  return axis and format("axis %d", axis) or ""
end

--- The same with the slot in front, if that is wanted or where the submodule decides.
function Targets:place(item, with_slot)
  local parts = {}
  if with_slot or drive_objects.access_of(item).record_index == drive_objects.LOCAL then
    parts[1] = item.slot and "slot " .. sentences.slot_number(item.slot, item.subslot) or nil
  end
  local words = self:words(item)
  parts[#parts + 1] = words ~= "" and words or nil
  parts[#parts + 1] = item.channel ~= "ds47" and item.channel:upper() or nil
  return table.concat(parts, " ")
end

-- Telegrams: p0922 as it was read or written last, else the only one that has the lengths of the cyclic data.

local SELECTION = 922 -- the parameter that says it; 999 is free configuration
local UNSURE = { odd = true, refuted = true }

-- The number that a parameter says; nil of any other.
local function told(parameter)
  local value = parameter.values and parameter.values[1]
  if parameter.pnu == SELECTION and not parameter.error and parameter.attribute == "value"
    and type(value) == "number" and value % 1 == 0 and value > 0 and value <= 999
  then
    return value
  end
end

-- {access, number} of each that is said, the last one first.
local function said(transactions)
  local found = {}
  for _, item in ipairs(transactions) do
    local whole = item.state == "ok" or item.state == "partial"
    if whole and (item.operation == "read" or item.operation == "change") then
      for _, each in ipairs(item.parameters) do
        local number = told(each)
        if number then table.insert(found, 1, { access = drive_objects.access_of(item), number = number }) end
      end
    end
  end
  return found
end

local function place(device, slot) return device .. " " .. tostring(slot) end

local function lengths(relations)
  local found = {}
  for _, each in ipairs(relations or {}) do
    if each.channel == "pzd" and #each.telegrams == 1 and not UNSURE[each.certainty] then
      found[place(each.device, each.slot)] = each.telegrams[1]
    end
  end
  return found
end

--- The key `telegram` of a transaction, by all of the result (Analysis:ended) that it stands in.
function M.telegram(result, item)
  local known = result.telegrams
  if not known then
    known = { said = said(result.transactions), lengths = lengths(result.relations) }
    result.telegrams = known
  end
  if known.said[1] then
    result.drive_objects = result.drive_objects or drive_objects.of(result.transactions)
    local access = drive_objects.access_of(item)
    for _, each in ipairs(known.said) do
      if result.drive_objects:same(access, each.access, SELECTION) then return each.number end
    end
  end
  return known.lengths[place(item.device, item.slot)]
end

return M
