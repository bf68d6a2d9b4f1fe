-- Faults that stop a drive that runs, by its status words and what the controller asks for (cyclic.md 6).
--
-- A drive that trips need not say so in one frame: some leave operation first and show the fault a cycle
-- later, of others the data is not valid meanwhile. That it stopped of itself is known where nobody switched
-- it off.

local bits = require("ds47.support.bits")
local flat = require("ds47.support.flat").copy

local all, any, bit = bits.all, bits.any, bits.bit

local M = {}

local NO_OFF, ON_OR_JOG = {1, 2, 3}, {0, 8, 9} -- bits of STW1: all of the former, one of the latter
local RUNNING, FAULT = 2, 3 -- bits of ZSW1
local UNDER_CONTROL = {4, 5, 9} -- neither OFF2 nor OFF3 of the drive itself, and controlled by the PLC

local Trips = {}
Trips.__index = Trips

--- The faults that stopped one drive.
-- @param limit_ns from the first frame in which it does not run any more to its fault
function M.new(limit_ns)
  return setmetatable({
    limit_ns = limit_ns,
    frames = {}, -- those in which the faults came; their numbers may come later
    told = false, -- whether something else is said to have stopped it, as long as that lasts
    is_asked = false, -- whether it is asked to run
    anew = false, -- whether that is so since its last word alone: what was asked before may stop it still
    since = nil, -- since when it does not run, or its data is not valid, though nobody switched it off
  }, Trips)
end

local function stops(self, zsw1, time)
  self.since = self.is_asked and not (self.anew or self.told) and all(zsw1, UNDER_CONTROL) and time or nil
end

--- The control word that the drive heeds, whether or not its own data is valid.
function Trips:asked(heeded)
  self.anew = self.anew or not self.is_asked
  self.is_asked = all(heeded, NO_OFF) and any(heeded, ON_OR_JOG)
  if not self.is_asked then self.since = nil end
end

--- The data of the drive is not valid from a frame on; this was its last word.
function Trips:lost(zsw1, time)
  if bit(zsw1, RUNNING) == 1 then stops(self, zsw1, time) end
end

--- Frames are missing from here on.
function Trips:skipped() self.since = nil end

--- A status word, and the one before it.
-- @param seen whether its data was valid all the time between
function Trips:said(before, zsw1, frame, time, seen)
  local ran, fault = bit(before, RUNNING) == 1, bit(zsw1, FAULT) == 1
  if ran and seen then stops(self, before, time) end
  -- What its last valid data says of it is so near, however long there was none.
  local near = self.since and (ran or time - self.since <= self.limit_ns)
  if fault and bit(before, FAULT) == 0 and (ran and seen or near) and not self.told then
    self.frames[#self.frames + 1] = frame
  end
  if bit(zsw1, RUNNING) == 1 then self.anew = false end
  if bit(zsw1, RUNNING) == 1 or fault or not all(zsw1, UNDER_CONTROL) then self.since = nil end
end

--- The same as one that goes on alone.
function Trips:apart() return flat(self, {"frames"}) end

return M
