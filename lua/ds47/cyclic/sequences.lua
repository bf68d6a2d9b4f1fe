-- Whether the frames of one sender and frame id to one receiver are one sequence, by their cycle counters.
--
-- A counter goes on by a cycle from frame to frame, and keeps up with the time. Where two recordings were
-- put into one file, two sequences take turns, and there are more frames than cycles: nobody can tell what
-- belongs to which. A counter that does not count, or a sender that starts again, is no second sequence:
-- both have to go on, in turn.

local abs, floor, max, min = math.abs, math.floor, math.max, math.min
local insert, remove = table.insert, table.remove

local M = {}

local TICK_NS = 31250
local COUNTERS = 65536
local SLACK = 1024 -- ticks by which a counter and the time may differ between two frames: 32 ms
local MOST = 4 -- sequences that are followed
-- What a turn to another sequence counts for; each frame that goes on with the same one takes 1 away.
local TURN, ENOUGH = 2, 6
local FRAMES = 10 -- frames of one sender do not come in less than three quarters of their cycles
local QUIET = 8 -- frames of one sequence after which another one is over

local Sequences = {}
Sequences.__index = Sequences

--- The sequences of counters among such frames, as far as they are looked at.
-- @param cycle_ns from one frame to the next
function M.new(cycle_ns)
  return setmetatable({
    cycle = max(floor(cycle_ns / TICK_NS), 1),
    heads = {}, -- the newest frame of each: {counter, time, data, frame}; the newest of all stands last
    since = nil, -- the last frame before there was a second one
    turns = 0,
    alone = 0, -- frames that went on with one sequence
    times = {}, -- of the newest frames
  }, Sequences)
end

-- By how much a counter differs from whole cycles and the time; nil where it is none that comes later.
local function off_by(self, head, counter, time)
  local step, cycle = (counter - head.counter) % COUNTERS, self.cycle
  local passed = floor((time - head.time) / TICK_NS)
  local ahead = (step - passed + COUNTERS / 2) % COUNTERS - COUNTERS / 2
  local is_later = step >= floor(cycle / 2) and step < COUNTERS / 2 or passed >= COUNTERS / 2
  if abs(ahead) > SLACK or not is_later then return nil end
  return min(step % cycle, -step % cycle) + abs(ahead)
end

-- Which sequence a frame goes on with: the one that it fits best, of several the newest.
local function continued(self, counter, time)
  local best, least
  for at = #self.heads, 1, -1 do
    local off = off_by(self, self.heads[at], counter, time)
    if off and (best == nil or off < least) then best, least = at, off end
  end
  return best
end

-- Whether there are more frames than cycles.
local function are_many(self)
  local times = self.times
  local least = floor((FRAMES - 1) * self.cycle * 3 / 4)
  return #times == FRAMES and floor((times[FRAMES] - times[1]) / TICK_NS) < least
end

--- Whether there was a second one just now: what is found meanwhile may be of both.
function Sequences:are_doubtful() return #self.heads > 1 end

--- Whether it is proven with this frame that there are several, in turn.
-- @param time as times.lua has it
function Sequences:are_several(counter, time, data, frame)
  local heads, times = self.heads, self.times
  local head = {counter = counter, time = time, data = data, frame = frame}
  local newest = heads[#heads]
  if newest and (time < newest.time or newest.counter == counter and newest.data == data) then
    return false -- out of order, or a copy
  end
  insert(times, time)
  if #times > FRAMES then remove(times, 1) end
  if #heads == 1 then
    self.since = newest
    if off_by(self, newest, counter, time) then
      heads[1] = head
      return false
    end
  end
  local at = continued(self, counter, time)
  if at == nil then
    self.turns, self.alone = 0, 0
    if #heads == MOST then remove(heads, 1) end
  elseif at < #heads then
    self.turns, self.alone = self.turns + TURN, 0
    remove(heads, at)
  else
    self.turns, self.alone = max(self.turns - 1, 0), self.alone + 1
    if self.alone < QUIET then remove(heads) else self.heads = {} end
  end
  insert(self.heads, head)
  return self.turns >= ENOUGH and are_many(self)
end

return M
