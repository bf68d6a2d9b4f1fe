-- Which drive object a request reaches, and whether two requests reach the same one (docs/pairing.md, P60).
--
-- The same as python/ds47/profidrive/drive_objects.py, where it is explained. An access is {device,
-- record_index, slot, subslot, axis}; nothing is guessed: what is not proved is neither the same nor another
-- one.

local ordered = require("ds47.support.ordered")
local tables = require("ds47.spec.tables")

local find, format = string.find, string.format

local M = {}

--- Record index of local access: the submodule decides, not the axis byte (docs/protocol.md E.4).
M.LOCAL = 0xB02E
--- PNU of the DO identification; element 7 is the DO-ID (docs/protocol.md D.1).
M.DO_IDENTIFICATION = 975

local LOCAL = M.LOCAL
local DO_ID = 7
local MOST = 0xFFFF -- no DO-ID is greater

local DriveObjects = {}
DriveObjects.__index = DriveObjects

--- What a capture shows of the drive objects of its devices, up to now. Memory is bounded.
function M.new()
  return setmetatable({
    submodules = ordered.new(), -- device, slot and subslot -> DO-ID by PNU 975; false where two were read
    distinguishing = ordered.new(), -- devices that have refused an axis number: they look at it
    missing = ordered.new(), -- device and axis number that does not exist there
  }, DriveObjects)
end

local function put(memory, key, value) memory:keep(key, value, tables.known.history) end

local function submodule(access)
  return format("%s %s %s", access.device, tostring(access.slot), tostring(access.subslot))
end

local function axis_of(device, number) return format("%s %d", device, number) end

--- A parameter has a negative response with this error number.
function DriveObjects:refused(access, code)
  if code == tables.known.axis_error and access.record_index ~= LOCAL then
    put(self.distinguishing, access.device, true)
    if access.axis then put(self.missing, axis_of(access.device, access.axis), true) end
  end
end

--- PNU 975 was read, from element `first` on.
function DriveObjects:identified(access, first, values)
  local value = values[DO_ID - first + 1]
  if access.record_index ~= LOCAL or first > DO_ID or type(value) ~= "number" or value % 1 ~= 0
    or value < 0 or value > MOST
  then
    return
  end
  local key = submodule(access)
  local seen = self.submodules:get(key)
  put(self.submodules, key, (seen == nil or seen == value) and value)
end

--- The DO-ID of the drive object that a request reaches; nil where it is not proved. 0 names none.
function DriveObjects:number(access)
  if access.record_index == LOCAL then return self.submodules:get(submodule(access)) or nil end
  return access.axis ~= 0 and access.axis or nil
end

local function is_local(access) return access.record_index == LOCAL end

--- False where the device has said that there is no such drive object.
function DriveObjects:exists(device, number) return self.missing:get(axis_of(device, number)) == nil end

-- The same submodule, and where it counts the same axis byte: the same request twice.
local function is_same_way(one, other)
  return one.slot == other.slot and one.subslot == other.subslot and is_local(one) == is_local(other)
    and (is_local(one) or one.axis == other.axis)
end

-- Whether two DO-IDs tell two drive objects apart: a device that never looked at the axis byte may go by the
-- submodule alone.
local function counts(self, one, other)
  return is_local(one) and is_local(other) or self.distinguishing:get(one.device) ~= nil
end

--- Whether two requests for a parameter reach the same drive object, whatever is not known.
function DriveObjects:same(one, other, pnu)
  if one.device ~= other.device then return false end
  if tables.known.global_pnus[pnu] or is_same_way(one, other) then return true end
  local mine = self:number(one)
  return mine ~= nil and mine == self:number(other) and counts(self, one, other)
end

--- Whether they reach two drive objects, whatever is not known.
function DriveObjects:other(one, other, pnu)
  if one.device ~= other.device then return true end
  local mine, theirs = self:number(one), self:number(other)
  if tables.known.global_pnus[pnu] or mine == nil or theirs == nil or mine == theirs then return false end
  return counts(self, one, other)
end

local function new_access(device, index, place, axis)
  return {
    device = device, record_index = index, slot = place.slot, subslot = place.subslot,
    axis = index ~= LOCAL and axis or nil,
  }
end

--- How the request of a job reaches its parameters.
function M.access(job)
  return new_access(job.peer.device, job.record.index, job.record, job.message and job.message.axis)
end

--- How the request of a transaction reaches its parameters; one of PKW by its submodule.
function M.access_of(item) return new_access(item.device, item.index or LOCAL, item, item.axis) end

--- What a finished transaction shows; the response to another request proves nothing.
function DriveObjects:transaction(item)
  if item.state == "mismatch" or item.operation ~= "read" and item.operation ~= "change" then return end
  local access = M.access_of(item)
  for _, each in ipairs(item.parameters) do
    if each.error then
      self:refused(access, each.error.code)
    elseif each.pnu == M.DO_IDENTIFICATION and item.operation == "read" and each.attribute == "value"
      and each.subindex and not find(each.format or "", "^Float")
    then
      self:identified(access, each.subindex, each.values)
    end
  end
end

--- All that a whole capture shows.
function M.of(transactions)
  local shown = M.new()
  for _, each in ipairs(transactions) do shown:transaction(each) end
  return shown
end

--- The number of the drive object that a transaction reaches; nil where it is not known or does not exist.
function DriveObjects:reached(item)
  local number = self:number(M.access_of(item))
  return number and self:exists(item.device, number) and number or nil
end

--- The key `drive_object` of a transaction, by all of the result (Analysis:ended) that it stands in.
function M.reached(result, item)
  result.drive_objects = result.drive_objects or M.of(result.transactions)
  return result.drive_objects:reached(item)
end

return M
