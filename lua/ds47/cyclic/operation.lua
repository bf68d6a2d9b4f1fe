-- Judgement: what a controller and a drive say in STW1 and ZSW1 to findings DS521 to DS529 and DS532
-- (docs/cyclic.md 6).
--
-- Why a drive does not start, who switched it off. Fed by timeline.lua with every frame that is looked at; a
-- rule is about an edge, or about something that stands for so long. Whether anybody wants to know (another
-- maker's drive, no proof) is decided elsewhere.
--
-- A look: {frame, time, stw1 (as it was sent), heeded (the last one that the drive heeds), zsw1, setpoint
-- (raw, as it is effective; nil where the telegram has none), actual, since (frame and time from which on
-- both say so)}. Nobody changes one.

local bits = require("ds47.support.bits")
local filtered = require("ds47.support.arrays").filtered
local flat = require("ds47.support.flat").copy
local json = require("ds47.support.json")
local pzd = require("ds47.cyclic.pzd")
local tables = require("ds47.spec.tables")

local all, any, bit, float = bits.all, bits.any, bits.bit, json.float
local abs, max, min = math.abs, math.max, math.min

local M = {}

local ON, ACKNOWLEDGE, CONTROL = 0, 7, 10 -- bits of STW1
local ON_CONTROL, COMPLETE, NO_OFF = {0, 1, 2, 10}, {0, 1, 2, 3, 10}, {1, 2}
local SETPOINT, JOG = {4, 5, 6}, {8, 9}
local RUNNING, FAULT, INHIBITED, NO_DEVIATION, REQUESTED = 2, 3, 6, 8, 9 -- bits of ZSW1
local BUSY = {RUNNING, FAULT, INHIBITED}
-- Bit of ZSW1, 0 while it is active; bit of STW1, 0 where the controller asks for it.
local OFF = {{active = 4, asked = 1, name = "OFF2"}, {active = 5, asked = 2, name = "OFF3"}}
local STANDING = {"idle", "inhibited", "acknowledged", "locked", "away"} -- what is said once it is over
local MOVED = tables.pzd.word * 0.01 -- by so much a setpoint has moved

local Operation = {}
Operation.__index = Operation

-- What has to stand for so long before it is said, and is said once, when it ends.
-- `told`: it was, and may stand still behind frames that are missing. `of_values`: values decide, which are
-- not looked at in each frame: it stood until it was seen last.
local function standing(rule, limit_ns, of_values)
  return {rule = rule, limit_ns = limit_ns, of_values = of_values, begun = nil, newest = nil, told = false}
end

--- What is wrong with the operation of one drive.
-- @param where arguments of every finding: {device, slot}
-- @param limits the flat table of tables.lua
function M.new(where, limits)
  return setmetatable({
    where = where, limits = limits, remarks = {},
    last = nil, -- the look before this one
    idle = standing("DS521", limits.not_running_ns), inhibited = standing("DS523", limits.inhibited_ns),
    acknowledged = standing("DS524", limits.acknowledge_ns), locked = standing("DS525", limits.locked_ns),
    away = standing("DS526", limits.deviation_ns, true),
    least = nil, most = nil, -- setpoints while it was locked
    was_equal = false,
    unheeded = {}, -- acknowledgements without control by PLC, until it is known that the fault did not go
    off = {}, -- OFF2 and OFF3 of the drive, until it is known that no control word asked for them
  }, Operation)
end

--- The key of the words for a state of the drive (tables.diagnosis_words).
function M.state_key(state) return "pzd_" .. state:gsub(" ", "_") end

local function say(self, rule, frame, args)
  args = args or {}
  for name, value in pairs(self.where) do args[name] = value end
  self.remarks[#self.remarks + 1] = {rule = rule, frame = frame, args = args}
end

-- What stands

-- The arguments of what stood and is over; nil where there is nothing to say.
local function args_of(self, stood, begun)
  if stood == self.idle then return {what = M.state_key((pzd.state(begun.zsw1, begun.heeded)))} end
  if stood == self.locked then
    if self.least == nil or self.most - self.least < MOVED then return nil end
    return {bits = filtered(SETPOINT, function(number) return bit(begun.heeded, number) == 0 end)}
  elseif stood == self.away then
    return {percent = self.limits.deviation_percent}
  end
  return {}
end

-- It ends now, whatever holds; true where it stood for long enough.
local function over(self, stood)
  local begun, newest = stood.begun, stood.newest
  stood.begun, stood.newest = nil, nil
  if begun == nil or newest == nil or newest.time - begun.since.time < stood.limit_ns then return false end
  local args = args_of(self, stood, begun)
  if args then
    args.seconds, args.limit = float((newest.time - begun.since.time) / 1e9), float(stood.limit_ns / 1e9)
    say(self, stood.rule, begun.since.frame, args)
  end
  return true
end

local function watch(self, stood, holds, now)
  if holds then
    if not stood.told then stood.begun, stood.newest = stood.begun or now, now end
    return
  end
  if stood.begun and not stood.of_values then stood.newest = now end -- it stood until this frame
  over(self, stood)
  stood.told = false
end

local function not_running(self, now)
  local on = all(now.stw1, ON_CONTROL)
  watch(self, self.inhibited, on and bit(now.zsw1, INHIBITED) == 1, now)
  watch(self, self.idle, all(now.stw1, COMPLETE) and not any(now.zsw1, BUSY), now)
end

-- From the edge of the acknowledgement on, as long as the fault is there.
local function fault_stays(self, last, now)
  local stood, fault = self.acknowledged, bit(now.zsw1, FAULT) == 1
  local edge = last and bit(now.stw1, ACKNOWLEDGE) == 1 and bit(last.stw1, ACKNOWLEDGE) == 0
    and bit(now.stw1, CONTROL) == 1
  if edge and fault and now.since.frame == now.frame then
    over(self, stood)
    stood.begun = now
  end
  watch(self, stood, stood.begun ~= nil and fault, now)
end

-- Acknowledgements that are none, because bit 10 is 0; where the fault goes, something else acknowledged.
local function not_taken(self, last, now)
  local left = {}
  if bit(now.zsw1, FAULT) == 1 then
    local rises = last and bit(now.stw1, ACKNOWLEDGE) == 1 and bit(last.stw1, ACKNOWLEDGE) == 0
    local counts = rises and bit(now.stw1, CONTROL) == 1 -- before that it would have gone
    for _, each in ipairs(self.unheeded) do
      if counts or now.time - each.time >= self.limits.acknowledge_ns then
        say(self, "DS532", each.frame, {word = each.stw1})
      else
        left[#left + 1] = each
      end
    end
    if rises and not counts then left[#left + 1] = now end
  end
  self.unheeded = left
end

local function setpoint(self, now)
  if now.setpoint == nil then return end
  local locked = bit(now.zsw1, RUNNING) == 1 and not all(now.heeded, SETPOINT) and not any(now.heeded, JOG)
  if locked then
    local value = now.setpoint
    self.least, self.most = min(self.least or value, value), max(self.most or value, value)
  end
  watch(self, self.locked, locked, now)
  if not locked then self.least, self.most = nil, nil end
end

local function deviation(self, now)
  if now.setpoint == nil or now.actual == nil then return end
  local driven = all(now.heeded, SETPOINT) and not any(now.heeded, JOG) and bit(now.zsw1, RUNNING) == 1
    and bit(now.heeded, ON) == 1 and all(now.heeded, NO_OFF)
  local apart = abs(now.setpoint - now.actual) > self.limits.deviation_percent / 100 * tables.pzd.word
  self.was_equal = driven and (self.was_equal or not apart)
  watch(self, self.away, apart and self.was_equal and bit(now.zsw1, NO_DEVIATION) == 0, now)
end

-- Edges

local function edges(self, last, now)
  local function rises(word, number) return bit(now[word], number) == 1 and bit(last[word], number) == 0 end
  local function falls(word, number) return bit(now[word], number) == 0 and bit(last[word], number) == 1 end
  local control, had_control = bit(now.stw1, CONTROL) == 1, bit(last.stw1, CONTROL) == 1
  if rises("stw1", ON) and not control then say(self, "DS522", now.frame, {word = now.stw1}) end
  if had_control and now.stw1 == 0 and bit(now.zsw1, RUNNING) == 1 then
    say(self, "DS528", now.frame, {what = "pzd_zero"})
  end
  if not control or not had_control then return end
  if falls("zsw1", REQUESTED) then say(self, "DS527", now.frame) end
  if bit(last.zsw1, FAULT) == 1 or bit(now.zsw1, FAULT) == 1 then return end
  for _, off in ipairs(OFF) do
    if falls("zsw1", off.active) and bit(now.heeded, off.asked) == 1 then
      self.off[#self.off + 1] = {begun = now, asked = off.asked, name = off.name}
    end
  end
end

-- OFF2 and OFF3 for which nobody asked, also not in a frame that the capture may have lost.
local function by_itself(self, now)
  local left = {}
  for _, each in ipairs(self.off) do
    if now.time - each.begun.time > self.limits.off_asked_ns then
      say(self, "DS529", each.begun.frame, {off = each.name})
    elseif bit(now.heeded, each.asked) == 1 then
      left[#left + 1] = each
    end
  end
  self.off = left
end

--- Both sides after a frame, while the data of both is valid.
function Operation:look(now)
  local last = self.last
  self.last = now
  if self.off[1] then by_itself(self, now) end
  if last then edges(self, last, now) end
  not_running(self, now)
  fault_stays(self, last, now)
  not_taken(self, last, now)
  setpoint(self, now)
  deviation(self, now)
end

--- The data of one side is not valid any more; true where that is said to stop a drive that runs.
function Operation:lost(frame, by_controller)
  local last = self.last
  local stops = by_controller and last and bit(last.zsw1, RUNNING) == 1 and bit(last.stw1, CONTROL) == 1
  if stops then say(self, "DS528", frame, {what = "pzd_invalid"}) end
  self:finish()
  self.last, self.least, self.most, self.unheeded = nil, nil, nil, {}
  return stops
end

--- Frames are missing from here on: what stands, stood until here at least, and no edge is one.
function Operation:skipped()
  for _, name in ipairs(STANDING) do self[name].told = over(self, self[name]) or self[name].told end
  self.last, self.least, self.most, self.unheeded, self.off, self.was_equal = nil, nil, nil, {}, {}, false
end

--- The same operation as one that goes on alone.
function Operation:apart()
  local made = flat(self, STANDING)
  made.remarks = flat(self.remarks)
  return made
end

--- Nothing more comes: what stands, stood until here.
function Operation:finish()
  for _, name in ipairs(STANDING) do over(self, self[name]) end
end

return M
