-- Whether frames of a sender are missing between two of them that were looked at, by the
-- steps from one to the next.
--
-- Not every frame is looked at, so a step is many cycles wide, and how wide steps are the capture shows. One
-- that is much wider than nearly all others is a hole. Of a frame or two that are missing it says nothing.

local floor, max = math.floor, math.max

local M = {}

local TICK_NS = 31250
local COUNTERS = 0x10000
local USUAL = 4 -- cycles of the widest steps, as long as no wider ones are known
local WIDER = 2 -- later in a long capture half as many frames are looked at
local HOLES = 8 -- steps that are wider than usual because of holes, before they are taken for usual ones

local Steps = {}
Steps.__index = Steps

--- The steps between the frames of one sender, by its cycle counter, or by the time where that does not tell.
-- @param cycle_ns from one frame to the next
function M.new(cycle_ns)
  local cycle = max(floor(cycle_ns / TICK_NS), 1)
  local widest = {} -- of all steps up to now, in order
  for place = 1, HOLES do widest[place] = USUAL * cycle end
  return setmetatable({cycle = cycle, counter = nil, time = nil, widest = widest}, Steps)
end

--- Whether more frames lie between the last one and this one than usual.
function Steps:skips(counter, time)
  local before, since = self.counter, self.time
  self.counter, self.time = counter, time
  if before == nil then return false end
  local step, passed = (counter - before) % COUNTERS, floor((time - since) / TICK_NS)
  local counts = step > 0 and passed < COUNTERS / 2
  if counts and step >= COUNTERS / 2 then return false end -- out of order, or it began anew
  local width = counts and step or passed
  local widest = self.widest
  local usual = widest[1]
  if width > usual then
    widest[1] = width
    table.sort(widest)
  end
  return width > WIDER * usual + self.cycle
end

return M
