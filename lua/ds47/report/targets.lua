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

return M
