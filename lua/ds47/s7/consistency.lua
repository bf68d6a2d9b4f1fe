-- Whether what was read was in the memory at one moment, as the captured writes make it (docs/s7.md 6).
--
-- A pure decision on accesses to one memory; which ones matter is known by memory.lua, and nothing is kept
-- here. What is decided is conservative: where it is open what a write did, and when, the data counts as
-- whole.
--
-- An access is an item of a GET or PUT; it takes effect at some moment from `asked_ns` to `answered_ns`, both
-- included:
--   order              tells accesses apart
--   connection, write, area, db
--   start, last, data  the first byte, the first one behind it, what was read or is written
--   asked_ns, answered_ns  nil where the answer was not seen: the write may come into force at any later time
--   request, response  the frame that completes the request, and that of the answer
--   sure               false for a write that may never have come into force: refused, or without an answer
--   known              false where only some bits of the bytes are written: they may then have any value
-- Its last moment, nil where there is no end to it, is `answered_ns`: here nil is later than all.

local spans = require("ds47.support.spans")

local byte, sub = string.byte, string.sub
local both, minus, span, union = spans.both, spans.minus, spans.span, spans.union

-- Events that are looked at to answer one question; where more would have to be, the data counts as whole.
local M = {MOST_STEPS = 20000}

local MASK = 4096 -- bytes that count as one step

--- Whether a last moment is before a time.
function M.is_over(last_ns, time_ns)
  return last_ns ~= nil and last_ns < time_ns
end

--- Whether one last moment is later than another one.
function M.is_later(one, other)
  if other == nil then return false end
  return one == nil or other < one
end

local is_over, is_later = M.is_over, M.is_later

--- Whether both have bytes in common.
function M.share(one, other)
  return one.start < other.last and other.start < one.last
end

--- Whether both have bytes in common, and it is open which of them was first.
function M.meets(one, other)
  return M.share(one, other) and not is_over(other.answered_ns, one.asked_ns)
    and not is_over(one.answered_ns, other.asked_ns)
end

--- Accesses in the order of one of their times, where equals stay in the order that they have.
function M.sorted(accesses, name)
  local places, found = {}, {}
  for place, each in ipairs(accesses) do places[each], found[place] = place, each end
  table.sort(found, function(a, b)
    if a[name] < b[name] then return true end
    return b[name] >= a[name] and places[a] < places[b]
  end)
  return found
end

-- Numbers of writes that meet another one: their bytes may take effect one by one. A set.
local function apart_of(others)
  local writes, found = {}, {}
  for _, each in ipairs(others) do writes[#writes + 1] = each.write and each or nil end
  writes = M.sorted(writes, "asked_ns")
  for number, each in ipairs(writes) do
    for behind = number + 1, #writes do
      local other = writes[behind]
      if is_over(each.answered_ns, other.asked_ns) then break end
      if M.meets(each, other) then found[each.order], found[other.order] = true, true end
    end
  end
  return found
end

local Question = {}
Question.__index = Question

-- Numbers of bytes of which two texts of the same length have different ones, as spans; `first` is that of
-- the first.
local function differences(one, other, first)
  local found = {}
  if one ~= other then
    for at = 1, #one do
      if byte(one, at) ~= byte(other, at) then found[#found + 1] = first + at - 1 end
    end
  end
  return spans.of(found)
end

M.differences = differences

-- What the decision has of an access: {asked, answered, sure, whole (whether all its bytes take effect at
-- once; else each at a moment of its own), cover, wrong (bytes to which it gives another value than was
-- read)}, spans of bytes.
local function event(self, access, apart)
  local whole = access.write and not apart[access.order]
  local first = math.max(access.start, self.start)
  local last = math.min(access.last, self.start + #self.values)
  local cover, wrong = both(span(first, last), self.all), {}
  if cover[1] and access.known then
    local given = sub(access.data, first - access.start + 1, last - access.start)
    local there = sub(self.values, first - self.start + 1, last - self.start)
    wrong = both(differences(given, there, first), cover)
  end
  return {
    asked = access.asked_ns, answered = access.answered_ns, sure = access.sure, whole = whole, cover = cover,
    wrong = wrong,
  }
end

-- What was read, part by part, as one text from the first byte on.
local function values_of(read, start, last)
  local values = ("\0"):rep(last - start)
  for _, each in ipairs(read) do
    values = sub(values, 1, each.start - start) .. each.data .. sub(values, each.last - start + 1)
  end
  return values
end

local function moments(self)
  local found = {self.begin}
  for _, each in ipairs(self.events) do
    for _, time in ipairs({each.asked, each.answered}) do
      if time >= self.begin and not is_over(self.finish, time) then found[#found + 1] = time end
    end
  end
  table.sort(found, function(a, b) return a < b end)
  local once = {}
  for _, moment in ipairs(found) do
    if not once[1] or once[#once] < moment then once[#once + 1] = moment end
  end
  return once
end

--- What was read, and everything else that happened to the same memory.
--
-- A write takes effect as a whole unless another one that it meets may come between; reads give evidence of
-- single bytes: that each had its value at some moment.
-- @param read  array of the parts of what was read, or of what was read in one job
-- @param others  writes, and further reads, from the beginning of the first part on. What may have come into
--   force earlier and is not among them is in `before`
-- @param before  image of memory.lua: bytes whose values are known from then
-- @param ignore  spans of bytes that are left out, because somebody writes them who was not captured
function M.new(read, others, before, ignore)
  local first = read[1]
  local self = setmetatable({
    begin = first.asked_ns, finish = first.answered_ns, start = first.start, all = {}, events = {},
  }, Question)
  local last, apart = first.last, apart_of(others)
  for _, each in ipairs(read) do
    if each.asked_ns < self.begin then self.begin = each.asked_ns end
    if is_later(each.answered_ns, self.finish) then self.finish = each.answered_ns end
    self.start, last = math.min(self.start, each.start), math.max(last, each.last)
    self.all = union(self.all, span(each.start, each.last))
  end
  self.all, self.values = minus(self.all, ignore or {}), values_of(read, self.start, last)
  self.before = before:others(self.start, self.values)
  self.steps, self.each = M.MOST_STEPS, 1 + math.floor(#self.values / MASK)
  for _, each in ipairs(others) do
    if not is_over(self.finish, each.asked_ns) then
      local found = event(self, each, apart)
      if found.cover[1] then self.events[#self.events + 1] = found end
    end
  end
  self.moments = moments(self)
  return self
end

-- An event that may be the last one of those left, and its bytes that may.
local function last_of(self, left, wanted, latest, earliest)
  local best, best_taken
  for number, each in ipairs(self.events) do
    local cover = left[number]
    local open = cover and not (latest and is_over(each.answered, latest))
      and not (earliest and earliest < each.asked)
    local wrong = open and both(both(each.wrong, wanted), cover)
    local taken = open and minus(cover, wrong)
    if open and taken[1] and not (each.whole and wrong[1])
      and (not best or is_later(each.answered, self.events[best].answered)) then
      best, best_taken = number, taken
    end
  end
  return best, best_taken
end

-- The events before a moment that have wanted bytes, and those among them that came into force.
local function before_moment(self, moment, wanted)
  local left, must, count, all = {}, {}, 0, 0
  for number, each in ipairs(self.events) do
    local cover = moment >= each.asked and both(each.cover, wanted)
    if cover and cover[1] then
      left[number], all = cover, all + 1
      if each.sure and is_over(each.answered, moment) then
        must[number], count = true, count + 1
      end
    end
  end
  return left, must, count, all
end

local function latest_of(self, must)
  local latest
  for number in pairs(must) do
    local asked = self.events[number].asked
    if not latest or latest < asked then latest = asked end
  end
  return latest
end

-- Whether the events before a moment have an order after which the wanted bytes are as they were read.
--
-- The order is built from its end: whatever may be the last event, and changes none of the bytes that are
-- still wanted, is the last one, and its bytes are wanted no more. Of several the one whose answer came last
-- is taken: it excludes the fewest.
local function is_possible(self, moment, wanted)
  local left, must, count, all = before_moment(self, moment, wanted)
  local earliest -- nil: later than all
  while count > 0 or spans.meet(wanted, self.before) do
    local number, taken = last_of(self, left, wanted, latest_of(self, must), earliest)
    self.steps = self.steps - self.each * (1 + all)
    if self.steps < 0 then return true end
    if not number then return false end
    local answered = self.events[number].answered
    if is_later(earliest, answered) then earliest = answered end
    wanted, left[number] = minus(wanted, taken), minus(left[number], taken)
    if not left[number][1] then
      left[number], all = nil, all - 1
      if must[number] then must[number], count = nil, count - 1 end
    end
  end
  return true
end

--- Whether there may have been a moment at which all these bytes (spans) had the values that were read.
function Question:held(wanted)
  for _, moment in ipairs(self.moments) do
    if is_possible(self, moment, wanted) then return true end
  end
  return false
end

--- The same of one byte.
function Question:byte(at)
  return self:held(span(at, at + 1))
end

-- Bytes of which `held` says no, as it does of all, and of which none can be left out.
local function fewest(self)
  local left = spans.numbers(self.all)
  local size = #left
  while size > 0 do
    local at = 1
    while at <= #left do
      local rest = {}
      for number, each in ipairs(left) do
        if number < at or number >= at + size then rest[#rest + 1] = each end
      end
      if self:held(spans.of(rest)) then at = at + size else left = rest end
    end
    size = math.floor(size / 2)
  end
  return left
end

--- Two bytes whose values never were in the memory together; nil where there may be such a moment.
function Question:mixed()
  if self:held(self.all) then return nil end
  local left = fewest(self)
  if #left ~= 2 then return nil end
  return left[1], left[2]
end

return M
