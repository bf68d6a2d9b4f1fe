-- Control and status word of one drive along the time: words to events (docs/cyclic.md 6). One relation at a
-- time, fed with what was looked at; which bytes of which frame these words are is not here, and what is
-- wrong is said in operation.lua.
--
-- An event: {frame, time, name, word ("STW1", "ZSW1" or nil), before, after, state, overlays}; ids are
-- those of tables.pzd.events.

local bits = require("ds47.support.bits")
local filtered = require("ds47.support.arrays").filtered
local pzd = require("ds47.cyclic.pzd")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")
local trips = require("ds47.cyclic.trips")

local bit, floor, u16 = bits.bit, math.floor, reader.u16

local M = {}

local HEEDED = 10 -- bit of STW1: where it is 0, the drive ignores the whole word and keeps the one before
local REQUESTED = 9 -- bit of ZSW1: the drive wants to be controlled by the PLC
local RUNNING = 2 -- bit of ZSW1: operation enabled
local FAULT, NO_OFF2, NO_OFF3, INHIBITED = 3, 4, 5, 6 -- bits of ZSW1
-- From here on bits 12 to 15 of STW1 are set, which most controllers leave at 0: telegram 20, motor
-- potentiometers and some makers use them.
local FREE = 0x1000
-- Control words that lack bit 10 alone, without and with ON and acknowledgement.
local COMPLETE = {[0x007E] = true, [0x007F] = true, [0x00FE] = true, [0x00FF] = true}
local REACTION_NS = 2000000000 -- so soon after ON a drive has the next state
local LAST_TASK = 63 -- of traversing tasks, which telegram 7 has where telegram 1 has the setpoint
local LEGAL = {[1] = true, [3] = true, [7] = true} -- bits 2 to 0 of ZSW1 in the states S2 to S4
local ILLEGAL = {[2] = true, [4] = true, [6] = true} -- no drive without a fault has these
local COMMANDS, STATES = tables.pzd.stw1_edges, tables.pzd.zsw1_edges

local of_speed, of_reverse = {}, {} -- ids of events that only telegrams with a speed have, and of that bit
for _, edge in ipairs(COMMANDS) do
  if edge.speed then of_speed[edge.id] = true end
  if edge.speed and edge.bit == pzd.REVERSE then of_reverse[edge.id] = true end
end

local Recorder = {}
Recorder.__index = Recorder

--- A recorder.
-- @param operation is told of every frame, as long as the data of both sides is valid
-- @param trusted whether the words alone prove a drive; else only what it does after ON
-- @param speed whether the word behind STW1 is a setpoint of speed; nil where the lengths do not tell
-- @param fault where in the drive's data FAULT_CODE is, nil where the telegram has none
-- @param most events that are kept
-- @param own whether bit 11 of STW1 is one of another maker than Siemens: no direction, as far as is known
function M.new(operation, trusted, speed, fault, most, own)
  return setmetatable({
    operation = operation, trusted = trusted, speed = speed, fault = fault, most = most, own = own,
    events = {}, left_out = 0,
    faults = {}, -- {frame, code} at each change of the fault number
    proven = false, -- whether both words were seen as a drive has them that a PLC controls
    refuted = false, -- whether a word was seen that no drive has
    reacted = false, -- whether ON led to the next state
    -- Whether a control word has bits that few controllers use, and is none that a drive heeds; or both words
    -- are those of a request of PKW and its response.
    odd = false,
    failed = 0, ready = false, -- how many faults came, and whether a drive was ready before one
    legal = false, -- whether a status word was seen that shows a state of a drive
    fault_since = nil, -- since when a fault stands in its newest valid data, a frame; nil for none
    stw1 = nil, zsw1 = nil, heeded = nil, -- the words, and the last control word that the drive heeds
    on_time = nil, -- when ON was given to a drive that was ready for it
    lost_out = false, lost_in = false, -- whose data is not valid
    is_skipped = false, -- whether frames are missing before the next one of the drive
    trips = trips.new(operation.limits.trip_ns),
    setpoint = nil, actual = nil, -- raw, the setpoint as it is effective
    said_out = nil, said_in = nil, -- since when each side says what it says: {frame, time}
  }, Recorder)
end

-- Whether the second word is a speed: a number that no traversing task has shows it.
local function learnt(self, raw)
  if self.speed == nil and raw % 0x8000 > LAST_TASK then self.speed = true end
  return self.speed
end

-- `out`: by the controller. Both say so since the frame that is the later one by the clock.
local function tell(self, out, frame, time)
  if self.stw1 == nil or self.zsw1 == nil or self.lost_out or self.lost_in then return end
  local since, other = {frame = frame, time = time}, self[out and "said_in" or "said_out"]
  local back = other and other.time - time or 0
  if back > 0 and back < self.operation.limits.disorder_ns then since = other end
  self.operation:look({
    frame = frame, time = time, stw1 = self.stw1, heeded = self.heeded or self.stw1, zsw1 = self.zsw1,
    setpoint = self.setpoint, actual = self.actual, since = since,
  })
end

local function happened(self, name, frame, time, word, before, after)
  if #self.events >= self.most then
    self.left_out = self.left_out + 1
    return
  end
  local state, overlays
  if self.zsw1 and not self.lost_in then state, overlays = pzd.state(self.zsw1, self.heeded) end
  self.events[#self.events + 1] = {
    frame = frame, time = time, name = name, word = word, before = before, after = after,
    state = state, overlays = overlays or {},
  }
end

-- Events of a word that is another one now. All of its bits but HEEDED are compared with those of `heeded`.
local function tell_edges(self, word, edges, before, heeded, after, frame, time)
  if before == nil then
    happened(self, "first", frame, time, word, nil, after)
    return
  end
  for _, edge in ipairs(edges) do
    local from = edge.bit == HEEDED and before or heeded
    if bit(after, edge.bit) == edge.value and bit(from, edge.bit) ~= edge.value then
      happened(self, edge.id, frame, time, word, before, after)
    end
  end
end

local function is_healthy(zsw1) return bit(zsw1, NO_OFF2) == 1 and bit(zsw1, NO_OFF3) == 1 end

-- Whether a status word shows one of the states S1 to S4, or a fault; without OFF2 and OFF3 but in S1.
local function is_legal(zsw1)
  if bit(zsw1, INHIBITED) == 1 then return bit(zsw1, 1) == 0 and bit(zsw1, 2) == 0 end
  return (LEGAL[zsw1 % 8] or zsw1 % 16 == 8) and is_healthy(zsw1)
end

-- Whether a drive that wants to be controlled gets a fault, and is not ready: no more changes.
local function is_failure(before, zsw1)
  local comes = bit(before, FAULT) == 0 and zsw1 % 16 == 8
  local same = bit(before, REQUESTED) == 1 and floor(before / 256) == floor(zsw1 / 256)
  return comes and same and is_legal(before) and is_legal(zsw1)
end

--- Whether the words as a whole may be a control and a status word; false before both were seen.
function Recorder:has_sense() return self.legal and self.stw1 ~= nil and (self.reacted or not self.odd) end

-- Whether these words look like those of a drive under control.
local function look(self)
  local stw1, zsw1 = self.stw1, self.zsw1
  if stw1 == nil or zsw1 == nil then return end
  local number = stw1 % 0x800 -- of a parameter: the response has that of its request
  self.odd = self.odd or stw1 >= FREE and zsw1 >= FREE and number > 0 and zsw1 % 0x800 == number
  if self.proven or not self.trusted then return end
  local heeded = bit(stw1, HEEDED) == 1 and (self.reacted or stw1 < FREE) or COMPLETE[stw1] ~= nil
  self.proven = heeded and bit(zsw1, REQUESTED) == 1 and is_legal(zsw1)
end

local function back(self, by_controller, frame, time)
  local lost = by_controller and "lost_out" or "lost_in"
  if self[lost] then
    self[lost] = false
    self.trips.told = self.trips.told and not by_controller
    happened(self, by_controller and "output-back" or "input-back", frame, time)
  end
end

local function control(self, stw1, frame, time)
  local before, heeded, now = self.stw1, self.heeded, bit(stw1, HEEDED) == 1
  self.stw1 = stw1
  self.odd = self.odd or stw1 >= FREE and not now
  if now then
    self.heeded = stw1
    local on = bit(stw1, 0) == 1 and bit(heeded or 0, 0) == 0
    if on and (self.zsw1 or 0) % 8 == 1 then self.on_time = time end
  end
  self.trips:asked(self.heeded or stw1)
  look(self)
  back(self, true, frame, time)
  -- nothing happens where it is not heeded
  tell_edges(self, "STW1", COMMANDS, before, now and heeded or stw1, stw1, frame, time)
end

local function status(self, zsw1, frame, time)
  local before, running = self.zsw1, zsw1 % 8
  self.zsw1 = zsw1
  local seen = not (self.lost_in or self.is_skipped) -- else nobody knows what was in between
  local since = not self.lost_in and self.fault_since or frame -- before a gap in the frames it was seen
  self.fault_since = bit(zsw1, FAULT) == 1 and since or nil
  if bit(zsw1, FAULT) == 0 and (ILLEGAL[running] or bit(zsw1, INHIBITED) == 1 and running ~= 0) then
    self.refuted = true
  end
  if self.on_time and (before or 0) % 8 == 1 and (running == 3 or running == 7) then
    self.reacted = self.reacted or time - self.on_time <= REACTION_NS
    self.trusted = self.trusted or self.reacted
  end
  local standing = running == 0 or bit(zsw1, FAULT) == 1
  self.legal = self.legal or is_legal(zsw1) or standing and is_healthy(zsw1)
  if before then
    self.trips:said(before, zsw1, frame, time, seen)
    if is_failure(before, zsw1) then
      self.failed, self.ready = self.failed + 1, self.ready or before % 2 == 1
    end
  end
  look(self)
  back(self, false, frame, time)
  tell_edges(self, "ZSW1", STATES, before, before, zsw1, frame, time)
end

--- The words of the controller from a frame on.
function Recorder:sent(words, frame, time)
  local stw1, raw = u16(words, 0), u16(words, 2)
  if stw1 ~= self.stw1 or self.lost_out then self.said_out = {frame = frame, time = time} end
  if stw1 ~= self.stw1 or self.lost_out or self.lost_in then control(self, stw1, frame, time) end
  if learnt(self, raw) then
    local value = pzd.signed(raw)
    self.setpoint = pzd.turns(stw1, self.own) and -value or value
  end
  tell(self, true, frame, time)
end

--- The words of the drive from a frame on.
function Recorder:answered(words, frame, time)
  local zsw1, raw = u16(words, 0), u16(words, 2)
  if self.fault then
    local code, newest = u16(words, self.fault), self.faults[#self.faults]
    if code ~= (newest and newest.code or 0) and #self.faults < self.most then
      self.faults[#self.faults + 1] = {frame = frame, code = code}
    end
  end
  if zsw1 ~= self.zsw1 or self.lost_in then self.said_in = {frame = frame, time = time} end
  if zsw1 ~= self.zsw1 or self.lost_out or self.lost_in then status(self, zsw1, frame, time) end
  self.is_skipped = false
  if learnt(self, raw) then self.actual = pzd.signed(raw) end
  tell(self, false, frame, time)
end

--- Frames are missing from here on: what became of the words in them nobody knows.
function Recorder:skipped()
  self.is_skipped, self.on_time = true, nil
  self.trips:skipped()
  self.operation:skipped()
end

--- Data of one side is not valid from a frame on, as it was before.
function Recorder:lost(by_controller, frame, time)
  local lost = by_controller and "lost_out" or "lost_in"
  self[lost] = true
  if not by_controller and self.zsw1 then self.trips:lost(self.zsw1, time) end
  self.trips.told = self.operation:lost(frame, by_controller) or self.trips.told
  happened(self, by_controller and "output-lost" or "input-lost", frame, time)
end

--- Nothing more comes: a fault that came and stays shows a drive, though nobody controls it; one that was not
-- ready only where that is all that changed, and its telegram is `configured`.
function Recorder:finish(configured)
  local comes = self.ready or configured and self.failed == 1
  local free = self.stw1 == 0 or self.stw1 == 0x80
  self.proven = self.proven or self.trusted and comes and free and self.fault_since ~= nil
end

--- Whether an event is told: those of bits that are about a speed only where it is known to be one.
function Recorder:is_told(event)
  return (self.speed or not of_speed[event.name]) and not (self.own and of_reverse[event.name])
end

function Recorder:told()
  if self.speed and not self.own then return self.events end
  return filtered(self.events, function(event) return self:is_told(event) end)
end

--- The number of the fault that came with a frame: it stands there already, or comes soon.
function Recorder:fault_code(frame)
  local there, coming
  for _, each in ipairs(self.faults) do
    if each.frame <= frame then
      there = each.code
    elseif each.code ~= 0 then
      coming = coming or each.code
    end
  end
  if there and there ~= 0 then return there end
  return coming
end

--- Whether the drive ran in all frames from one to another; nil where it changed, or nobody knows.
function Recorder:running(first, last)
  local found, now, newest
  for _, event in ipairs(self.events) do
    local is_status = event.word == "ZSW1"
    if is_status or event.name == "input-lost" or event.name == "input-back" then
      if is_status then newest = bit(event.after, RUNNING) == 1 end
      now = newest
      if event.name == "input-lost" then now = nil end
      if event.frame <= first then
        found = now
      elseif event.frame <= last and now ~= found then
        return nil
      end
    end
  end
  return found
end

--- The frame in which it began to run, before or in this one; nil where it ran from the beginning on.
function Recorder:running_since(frame)
  local found
  for _, event in ipairs(self.events) do
    if event.name == "running" and event.frame <= frame then found = event.frame end
  end
  return found
end

--- The state of the drive in a frame; nil where nobody knows.
function Recorder:state_at(frame)
  local found
  for _, event in ipairs(self.events) do
    if event.frame <= frame then found = event.state end
  end
  return found
end

--- Forgets what was seen from a frame on.
function Recorder:cut(frame)
  local operation = self.operation
  local function is_before(item) return item.frame < frame end
  self.events, self.faults = filtered(self.events, is_before), filtered(self.faults, is_before)
  self.trips.frames = filtered(self.trips.frames, function(number) return number < frame end)
  operation.remarks = filtered(operation.remarks, is_before)
  self.fault_since = nil
end

return M
