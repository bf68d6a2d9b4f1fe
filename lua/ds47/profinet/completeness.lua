-- What of a conversation is not in the capture: one judgement, asked by every rule that says that
-- something did not come.
--
-- Lives here: the calls whose sequence numbers are missing, Writes whose requests are, and who was never
-- heard. A missing number shows that a call may be missing, and says nothing of responses; that none is
-- missing proves nothing across activities. What that means for a transaction is pairing.lua's business
-- (docs/pairing.md, P73).

local ordered = require("ds47.support.ordered")
local arrays = require("ds47.support.arrays")
local rpc = require("ds47.profinet.rpc")

local has, take_out = arrays.has, arrays.take_out
local key_of, min, max = rpc.pair, math.min, math.max
local WRITE = rpc.WRITE
local OF_RECORDS = {[rpc.READ] = true, [rpc.WRITE] = true, [rpc.READ_IMPLICIT] = true}

local M = {}

-- Holes of one activity and Writes without their request of a pair that are kept by themselves: older holes
-- are as one, and of the others the newest are asked for.
local KEPT = 64
-- One of so many calls is none of a habit.
local RARELY = 4

-- Sequence numbers: of one activity, as a set, because they may come out of order.

local Numbers = {}
Numbers.__index = Numbers

--- The numbers of an activity.
-- `lowest` and `highest`: of its numbers; `newest`: the request with the highest one; `following`: the number
-- behind the newest one that was there before, which tells that the client counts anew;
-- `answered`: the highest number that was answered, since its client counts so; `holes`: array of {after,
-- before (frames), first, last (numbers), over (true where its client counts anew since: what comes
-- is none of these)}, in the order of their frames; `below`: the same of numbers below the first one that
-- was there, which may have come before the capture began; `under`: the newest of those that were there;
-- `waited` and `ahead`: how many calls were answered before the next one was sent, and behind that; `passed`:
-- true if a call was answered before a call with a lower number.
-- @param pdu  the first request
function M.numbers(pdu)
  return setmetatable({
    lowest = pdu.seq, highest = pdu.seq, newest = pdu, anew = 0, answered = -1,
    holes = {}, below = {}, under = -1, waited = 0, ahead = 0,
  }, Numbers)
end

-- One more hole, if it has any numbers.
local function put(holes, place, after, before, first, last)
  if first <= last then
    table.insert(holes, place, {after = after, before = before, first = first, last = last})
  end
  if #holes > KEPT then
    local older = table.remove(holes, 1)
    local one = holes[1]
    one.after, one.first, one.last = older.after, min(older.first, one.first), max(older.last, one.last)
  end
end

-- Whether a number is missing in a hole that may still come.
local function lacks(hole, number) return hole.first <= number and number <= hole.last and not hole.over end

local function fill(holes, number)
  for place, hole in ipairs(holes) do
    if lacks(hole, number) then
      table.remove(holes, place)
      put(holes, place, hole.after, hole.before, number + 1, hole.last)
      put(holes, place, hole.after, hole.before, hole.first, number - 1)
      return true
    end
  end
  return false
end

--- The frame of the first call after a missing one; nil if none is known.
function Numbers:sent_before(number)
  for _, holes in ipairs({self.holes, self.below}) do
    for _, hole in ipairs(holes) do
      if lacks(hole, number) then return hole.before end
    end
  end
  return nil
end

--- Whether a number was missing up to now; now it is there.
function Numbers:fills(number) return fill(self.holes, number) or fill(self.below, number) end

--- One more number: that of a request, or of a response whose request is not there.
-- @param renewed  whether it stands for another call, if it was there before
function Numbers:add(pdu, renewed)
  local number, holes, below = pdu.seq, self.holes, self.below
  if number > self.highest then
    put(holes, #holes + 1, self.newest.frame, pdu.frame, self.highest + 1, number - 1)
    self.highest, self.newest = number, pdu
  elseif pdu == self.newest then
    return -- its first one
  elseif number < self.lowest then
    put(below, #below + 1, 0, pdu.frame, number + 1, self.lowest - 1)
    self.lowest, self.under = number, number
  elseif number == self.following then
    self.lowest, self.highest, self.newest, self.answered = number - 1, number, pdu, -1
    for place = 1, max(#holes, #below) do
      (holes[place] or {}).over, (below[place] or {}).over = true, true
    end
  elseif fill(below, number) then
    if number == self.under + 1 then self.following = number + 1 end -- it counts up from there
    self.under = number
  elseif not fill(holes, number) and renewed then
    self.following, self.answered = number + 1, -1
    if self.lowest < self.highest or self.anew == 0 then -- one number for all calls does not count
      self.anew = pdu.frame
    end
  end
end

--- A call is answered.
function Numbers:hears(number)
  if self.answered > -1 and number > self.answered + 1 then self.passed = true end
  local what = number < self.highest and "ahead" or "waited"
  self[what], self.answered = self[what] + 1, max(self.answered, number)
end

--- Whether one of its calls was answered.
function Numbers:heard() return self.waited + self.ahead > 0 end

--- Whether a message is of a call before the newest one, by its number and by the clock.
function Numbers:is_late(pdu) return pdu.seq < self.highest and pdu.time_ns < self.newest.time_ns end

--- Whether a number was there.
function Numbers:has(number)
  local there = number >= self.lowest and number <= self.highest
  for _, hole in ipairs(self.holes) do there = there and not lacks(hole, number) end
  return there
end

--- The numbers that are missing in a hole, for a sentence.
local function told(hole)
  if hole.first == hole.last then return ("%d"):format(hole.first) end
  return ("%d..%d"):format(hole.first, hole.last)
end

-- Pairs of stations

local Completeness = {}
Completeness.__index = Completeness

--- Of every client and server, what is missing between them.
-- @param most          pairs that are remembered; the oldest goes first
-- @param lost_on_line  station of PROFIBUS -> the newest frame before which something that was said with it
--   may be missing
function M.new(most, lost_on_line)
  return setmetatable({most = most, pairs = ordered.new(), lost_on_line = lost_on_line}, Completeness)
end

-- {activities = array of Numbers; since = frame since which all calls are of activities that were there
-- before; heard = whether the station that is called has said anything; unasked = frames of Writes that are
-- not there; lost = frames of calls of which only one half is there; disorder = the newest
-- frame that was sent before one that comes before it}
local function pair_of(self, client, server)
  local key = key_of(client, server)
  local pair = self.pairs:get(key)
  if pair == nil then
    local back = self.pairs:get(key_of(server, client))
    local heard = back ~= nil and back.activities[1] ~= nil
    pair = {activities = {}, since = 0, heard = heard, unasked = {}, lost = {}, disorder = 0}
    self.pairs:keep(key, pair, self.most)
  end
  return pair
end

--- The first call of an activity to a server.
function Completeness:began(pdu, numbers)
  local pair = pair_of(self, pdu.client, pdu.server)
  local activities = pair.activities
  if not has(activities, numbers) then
    activities[#activities + 1], pair.since = numbers, pdu.frame
    if #activities > KEPT then pair.heard = table.remove(activities, 1):heard() or pair.heard end
  end
  local back = self.pairs:get(key_of(pdu.server, pdu.client))
  if back then back.heard = true end
end

-- One more frame: the oldest one and the newest ones are kept.
local function keep(frames, frame)
  frames[#frames + 1] = frame
  if #frames > KEPT then table.remove(frames, 2) end
end

--- A response or fault whose request is not in the capture, as far as is known.
function Completeness:unasked(pdu)
  local pair = pair_of(self, pdu.client, pdu.server)
  pair.heard = true
  local placeless = pdu.opnum == WRITE or pdu.ptype ~= 2 -- a fault tells no place
  keep(placeless and pair.unasked or pair.lost, pdu.frame)
end

--- A call of which nobody knows where it goes: a Write that is cut, or a response without a record.
function Completeness:cut(pdu) keep(pair_of(self, pdu.client, pdu.server).unasked, pdu.frame) end

--- The request of a response that was heard of as one without its request.
function Completeness:asked_after_all(response)
  local pair = pair_of(self, response.client, response.server)
  take_out(pair.unasked, response.frame)
  take_out(pair.lost, response.frame)
end

--- A call of records stands behind one that was made later, by its number and by the clock.
function Completeness:disordered(pdu)
  if OF_RECORDS[pdu.opnum] then
    local pair = pair_of(self, pdu.client, pdu.server)
    pair.disorder = max(pair.disorder, pdu.frame)
  end
end

--- A response came once more, later than a mirror port brings one.
function Completeness:doubled(response) pair_of(self, response.client, response.server).doubled = true end

--- Whether a client usually waits for each response, on a wire that doubles or a capture with gaps. Then a
-- response after the client's next call may be the second copy, with the first one not captured.
function Completeness:waits(client, server)
  local pair, ahead, waited = self.pairs:get(key_of(client, server)), 0, 0
  local lacking = pair and (pair.doubled or pair.unasked[1] or pair.lost[1])
  for _, numbers in ipairs(pair and pair.activities or {}) do
    ahead, waited = ahead + numbers.ahead, waited + numbers.waited
    lacking = lacking or numbers.passed or numbers.holes[1]
  end
  return lacking and RARELY * ahead < waited
end

--- A call has no response.
function Completeness:lost(request)
  keep(pair_of(self, request.client, request.server).lost, request.frame)
end

--- The time of the newest call of a client to a server, by the numbers; nil for none.
function Completeness:spoke_ns(client, server)
  local pair, newest = self.pairs:get(key_of(client, server)), nil
  for _, numbers in ipairs(pair and pair.activities or {}) do
    local time_ns = numbers.newest.time_ns
    newest = newest and newest > time_ns and newest or time_ns
  end
  return newest
end

local function hears(pair)
  if pair.heard then return true end
  for _, numbers in ipairs(pair.activities) do
    if numbers:heard() then return true end
  end
  return false
end

-- What is missing behind a frame by the numbers; `across`: behind any.
local function hole_after(activities, since, across)
  for _, numbers in ipairs(activities) do
    local hole = numbers.holes[#numbers.holes]
    if hole and (across or hole.before > since) then
      local first = hole.after ~= 0 and hole.after or nil
      return {what = "calls", first = first, last = hole.before, numbers = told(hole)}
    end
  end
  return nil
end

-- Whether a number stands for another call behind a frame.
local function is_anew(activities, since)
  for _, numbers in ipairs(activities) do
    if numbers.anew > since then return true end
  end
  return false
end

--- What may be missing of the calls of a client behind a frame: {what = key of the words, first, last
-- (frames), numbers}; nil where nothing can be.
-- Of two activities nothing follows from their numbers. There it counts whether the capture lacks anything
-- of this pair.
-- @param lost  true: a call is open of which only the request is there; nil asks what was told
-- @param in_order  true: that calls are out of order does not count
function Completeness:missing_after(client, server, since, lost, in_order)
  local pair = self.pairs:get(key_of(client, server))
  if pair == nil or pair.activities[1] == nil then return {what = "requests"} end
  local across, unasked = since < pair.since, pair.unasked
  local hole = hole_after(pair.activities, since, across)
  if hole then return hole end
  if unasked[1] and (across or unasked[#unasked] > since) then return {what = "requests"} end
  if pair.disorder > 0 and pair.disorder >= since and not in_order then return {what = "halves"} end
  if is_anew(pair.activities, since) then return {what = "renewed"} end
  if not hears(pair) then return {what = "one_direction"} end
  if across and (lost or pair.lost[1]) then return {what = "halves"} end
  return nil
end

return M
