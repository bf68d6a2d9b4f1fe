-- What was written last to a parameter, and whether a later read brings something else (DS417).
--
-- The same as python/ds47/acyclic/readback.py, where it is explained: there is a finding only if the last
-- written value is the same in every order that the capture allows, and for every drive object that a request
-- may have reached.

local dictionary = require("ds47.profidrive.dictionary")
local drive_objects = require("ds47.profidrive.drive_objects")
local argument = require("ds47.profidrive.formats").argument
local kept = require("ds47.support.arrays").filtered
local has_one_of = require("ds47.profidrive.parameter").has_one_of
local ordered = require("ds47.support.ordered")
local places_of = require("ds47.profidrive.layouts").places
local tables = require("ds47.spec.tables")

local floor, huge, max, sub = math.floor, math.huge, math.max, string.sub

local M = {}

local DO_IDENTIFICATION = drive_objects.DO_IDENTIFICATION
local VALUE = tables.layouts.ADDRESS_VALUE
local NEVER = huge -- a frame number beyond every capture
local KEPT = 8 -- how many Writes may compete for the last value of a parameter; with more it is unknown
local BROKEN = {DS309 = true, DS313 = true} -- of a message not decoded to its end
local BROKEN_OR_CUT = {DS309 = true, DS313 = true, DS315 = true}
local OF_CHANGES = {[0x02] = true, [0x82] = true, [0x42] = true, [0xC2] = true} -- response IDs of changes
local NEGATIVE = 0x80 -- the first response id that is negative
local NONE = {}

local ReadBack = {}
ReadBack.__index = ReadBack

--- Remembers what was written, and compares what is read.
-- @param most   how many parameters to remember; the one written longest ago is forgotten first
-- @param unseen  unseen(peer, frame): whether an unknown change may have come after a frame: a call to the
--   device is missing, or waits until its AR has proved itself
function M.new(most, unseen)
  return setmetatable({
    unseen = unseen,
    most = most,
    objects = drive_objects.new(),
    written = ordered.new(), -- device, PNU and subindex -> array of writes
    open = {}, -- changes without a response -> array of {key, number, write}, number of the parameter from 1
    devices = ordered.new(), -- address -> {forgotten = frame, recomputing = set of jobs, count}
    pnus = {}, -- all PNUs written so far: most reads are of other PNUs
  }, ReadBack)
end

-- Elements of blocks

-- The number of elements and the bytes of each, for a block whose elements can be told apart; 0 for
-- errors, texts and strings.
local function elements(address, block)
  local count = #block.values
  if address.attribute ~= VALUE or count == 0 or count ~= block.value_count then return 0 end
  return count, floor(#block.raw / count)
end

local function key_of(device, pnu, subindex) return device .. "\0" .. pnu .. "\0" .. subindex end

-- Devices

local function forget_device(self, device)
  local gone = {}
  for key in self.written:iterate() do
    if sub(key, 1, #device + 1) == device .. "\0" then gone[#gone + 1] = key end
  end
  for _, key in ipairs(gone) do self.written:pop(key) end
end

function ReadBack:_device(device)
  local found = self.devices:get(device)
  if found == nil then
    found = {forgotten = 0, recomputing = {}}
    self.devices:set(device, found)
    if self.devices.length > tables.known.history then forget_device(self, (self.devices:pop_first())) end
  end
  return found
end

--- A Connect: the drive may have been switched off and on before it.
function ReadBack:connected(device, frame) self:_device(device).forgotten = frame end

-- Changes

local function remember(self, key, write)
  local there = self.written:get(key) or {}
  if #there == KEPT then -- too many at once: the value is unknown now
    write = {
      access = write.access, raw = "", format = write.format, value = "", asked = write.asked, upto = NEVER,
    }
    there = {}
  end
  there[#there + 1] = write
  self.written:keep(key, there, self.most)
end

local function note(self, told, access, place, address, block, frame)
  local count, size = elements(address, block)
  for number = 0, count - 1 do
    local subindex = address.subindex + number
    local key = key_of(access.device, address.pnu, subindex)
    local write = {
      access = access, raw = sub(block.raw, number * size + 1, (number + 1) * size), format = block.format,
      value = block.values[number + 1], block = block, asked = frame, upto = NEVER,
    }
    told[#told + 1] = {key = key, number = place, write = write}
    remember(self, key, write)
  end
  self.pnus[address.pnu] = true
end

--- A Write request asks for something.
function ReadBack:asked(job)
  local message, half = job.message, job:write_request()
  if message.operation ~= "change" then return end
  local access, told = drive_objects.access(job), {}
  if has_one_of(message.flaws, BROKEN_OR_CUT) then
    self:_device(access.device).recomputing[job] = true -- its values are unknown
  end
  for number, block in ipairs(message.blocks) do
    local address = message.addresses[number]
    if tables.known.recomputing[address.pnu] then self:_device(access.device).recomputing[job] = true end
    if not dictionary.changes_itself(address.pnu, job.peer.vendor_id, job.peer.family) then
      note(self, told, access, number, address, block, half.frame)
    end
  end
  self.open[job] = told
end

-- From this frame on a change is in force, or never will be.
local function end_of(job)
  if job.read_response then return job.read_response.frame end
  return job.superseded_by or NEVER
end

-- The last frame of a job without a fetched response.
local function last_frame(job) return (job.write_response or job:write_request()).frame end

-- Whether not even the blocks of a response are sure.
local function is_doubtful(job, response)
  local half = job.read_response
  return has_one_of(response.flaws, BROKEN) or half.missing or half.status ~= nil and half.status ~= 0
end

-- Which parameters (from 1) did not take effect, nil: all; and for how many, from the first, that is sure.
-- A request may name a parameter twice.
local function outcome(job, stray)
  local failed, message, response = {}, job.message, job.response
  if job.write_refused then return nil, 0 end
  if response == nil or response.response_id == nil or stray or is_doubtful(job, response) then
    return failed, 0
  end
  for number, block in ipairs(response.blocks) do failed[number] = block.error ~= nil end
  local whole = response.response_id < NEGATIVE and not has_one_of(response.flaws, BROKEN_OR_CUT)
  return failed, whole and #message.addresses or #response.blocks
end

local function same_access(one, other)
  return one.record_index == other.record_index and one.slot == other.slot and one.subslot == other.subslot
    and one.axis == other.axis
end

-- A value was accepted: earlier values written in the same way no longer count. If one differed, a read that
-- was open then may return it (`replaces`).
local function in_force(self, key, write)
  write.certain = true
  local there = self.written:get(key)
  if there then
    self.written:set(key, kept(there, function(each)
      if not same_access(each.access, write.access) or each.upto >= write.asked then return true end
      write.replaces = write.replaces or each.replaces or each.raw ~= write.raw
      return false
    end))
  end
end

local function drop(self, key, write)
  local there = self.written:get(key)
  if there then self.written:set(key, kept(there, function(each) return each ~= write end)) end
end

--- A response without its request: if it may be that of a change, an unknown value has changed.
function ReadBack:unasked(job)
  local half, response = job.read_response, job.response
  local id = response and response.response_id
  if id and OF_CHANGES[id] or not id and half.cut then
    local device = self:_device(job.peer.device)
    device.forgotten = max(device.forgotten, half.frame)
  end
end

--- A change has its response, or is over without one.
-- @param stray  whether the response belongs to another request
function ReadBack:settled(job, stray)
  local told, device = self.open[job], self:_device(job.peer.device)
  local frame = end_of(job)
  self.open[job] = nil
  if device.recomputing[job] then
    device.recomputing[job] = nil
    device.forgotten = max(device.forgotten, frame == NEVER and last_frame(job) or frame)
  end
  if job.response and not stray then self:_refusals(job) end
  local failed, sure = outcome(job, stray)
  for _, each in ipairs(told or NONE) do
    each.write.upto = frame
    if failed == nil or failed[each.number] then
      drop(self, each.key, each.write)
    elseif each.number <= sure then
      in_force(self, each.key, each.write)
    end
  end
end

function ReadBack:_refusals(job)
  for _, block in ipairs(job.response.blocks) do
    if block.error then self.objects:refused(drive_objects.access(job), block.error.code) end
  end
end

-- Reads

-- The value that was written last between frames `since` and `asked`; nil if that is not sure.
function ReadBack:_last(key, pnu, access, since, asked)
  local objects, last = self.objects, nil
  local near = kept(self.written:get(key) or NONE, function(each)
    return not objects:other(access, each.access, pnu)
  end)
  local same = kept(near, function(each)
    return since < each.asked and each.upto < asked and objects:same(access, each.access, pnu)
  end)
  for _, each in ipairs(same) do
    if each.certain and (last == nil or each.asked > last.asked) then last = each end
  end
  for _, each in ipairs(last and near or NONE) do
    if each.raw ~= last.raw and each.upto >= last.asked then return nil end -- may have come later
    if each.replaces and each.upto >= asked then
      return nil -- the value that it replaced may have come later, too
    end
  end
  for _, each in ipairs(last and same or NONE) do
    if each.raw == last.raw and each.asked > last.asked then
      last = each -- nobody knows whether it was accepted, but it wrote the same
    end
  end
  return last
end

local function differs(last, block, raw, value)
  return #last.raw == #raw and last.raw ~= raw and not (last.format ~= block.format and last.value == value)
end

function ReadBack:_compared(found, job, access, address, block)
  local device = self:_device(access.device)
  if next(device.recomputing) ~= nil then return end
  local count, size = elements(address, block)
  for number = 0, count - 1 do
    local subindex, value = address.subindex + number, block.values[number + 1]
    local key = key_of(access.device, address.pnu, subindex)
    local last = self:_last(key, address.pnu, access, device.forgotten, job:write_request().frame)
    local raw = sub(block.raw, number * size + 1, (number + 1) * size)
    if last and differs(last, block, raw, value) and not self.unseen(job.peer, last.asked) then
      self.written:set(key, kept(self.written:get(key), function(each) return each.upto == NEVER end))
      found[#found + 1] = {
        offset = block.offset,
        args = {
          pnu = address.pnu, subindex = subindex, read = argument(value, block),
          written = argument(last.value, last.block), by = last.asked,
          family = dictionary.family_of(job.peer.vendor_id, job.peer.family),
        },
      }
    end
  end
end

--- The values of a read that differ from the last written ones: array of {offset, args of DS417}.
function ReadBack:read(job)
  local request, response = job.message, job.response
  if response == nil or request == nil or request.operation ~= "read" then return NONE end
  local found, access, places, addresses, pnus = NONE, nil, places_of(response), request.addresses, self.pnus
  for number = 1, math.min(#places, #addresses) do
    local address = addresses[number]
    local pnu = address.pnu
    if pnus[pnu] or pnu == DO_IDENTIFICATION or places[number].error then
      if access == nil then found, access = {}, drive_objects.access(job) end
      self:_look(found, job, access, address, response.blocks[number])
    end
  end
  return found
end

function ReadBack:_look(found, job, access, address, block)
  if block.error then
    self.objects:refused(access, block.error.code)
  elseif address.pnu == DO_IDENTIFICATION and address.attribute == VALUE and not block.float then
    self.objects:identified(access, address.subindex, block.values)
  end
  if self.pnus[address.pnu] then self:_compared(found, job, access, address, block) end
end

return M
