-- Sets of whole numbers, as spans: what Python has bits of large integers for.
--
-- A list of spans is a flat array {first, last, first, last ...}, sorted; `last` is the first number behind a
-- span, and no two of them touch. Lists are never changed. `Set` is one that is, for numbers that lie far
-- apart.

local floor, max, min = math.floor, math.max, math.min

local M = {}

local NONE = {}

--- The numbers from one up to another, which is the first one behind.
function M.span(first, last)
  return first < last and {first, last} or NONE
end

--- The list of single numbers, which come sorted.
function M.of(numbers)
  local found, count = {}, 0
  for _, number in ipairs(numbers) do
    if count > 0 and found[count] == number then
      found[count] = number + 1
    else
      found[count + 1], found[count + 2], count = number, number + 1, count + 2
    end
  end
  return found
end

-- Adds a span that begins where no other one before it began.
local function append(found, first, last)
  local count = #found
  if count > 0 and found[count] >= first then
    found[count] = max(found[count], last)
  else
    found[count + 1], found[count + 2] = first, last
  end
end

--- What is in one or the other.
function M.union(one, other)
  if one[1] == nil then return other end
  if other[1] == nil then return one end
  local found, a, b = {}, 1, 1
  while one[a] or other[b] do
    if not other[b] or one[a] and one[a] <= other[b] then
      append(found, one[a], one[a + 1])
      a = a + 2
    else
      append(found, other[b], other[b + 1])
      b = b + 2
    end
  end
  return found
end

--- What is in both.
function M.both(one, other)
  local found, a, b = {}, 1, 1
  while one[a] and other[b] do
    local first, last = max(one[a], other[b]), min(one[a + 1], other[b + 1])
    if first < last then found[#found + 1], found[#found + 2] = first, last end
    if one[a + 1] < other[b + 1] then a = a + 2 else b = b + 2 end
  end
  return found
end

--- What is in one and not in the other.
function M.minus(one, other)
  if other[1] == nil then return one end
  local found, b = {}, 1
  for a = 1, #one, 2 do
    local first, last = one[a], one[a + 1]
    while other[b] and other[b + 1] <= first do b = b + 2 end
    local next_b = b
    while other[next_b] and other[next_b] < last do
      if other[next_b] > first then found[#found + 1], found[#found + 2] = first, other[next_b] end
      first = max(first, other[next_b + 1])
      next_b = next_b + 2
    end
    if first < last then found[#found + 1], found[#found + 2] = first, last end
  end
  return found
end

--- Whether both have a number in common.
function M.meet(one, other)
  return M.both(one, other)[1] ~= nil
end

--- The numbers, sorted.
function M.numbers(list)
  local found = {}
  for at = 1, #list, 2 do
    for number = list[at], list[at + 1] - 1 do found[#found + 1] = number end
  end
  return found
end

local PAGE = 256 -- numbers of a list of a set

-- A set that is changed: `pages` has lists of spans by their place.
local Set = {}
Set.__index = Set

--- An empty set of numbers from 0 on.
function M.set()
  return setmetatable({pages = {}}, Set)
end

--- The same, to change.
function Set:copy()
  local other = M.set()
  for page, list in pairs(self.pages) do other.pages[page] = list end
  return other
end

-- Replaces the list of each page that a span touches by what `change` makes of it and of the part of the span
-- there.
local function change_pages(self, first, last, change)
  local at = first
  while at < last do
    local page = floor(at / PAGE)
    local stop = min(last, (page + 1) * PAGE)
    local found = change(self.pages[page] or NONE, {at, stop})
    self.pages[page] = found[1] and found or nil
    at = stop
  end
end

--- Adds the numbers from one up to another.
function Set:add(first, last)
  change_pages(self, first, last, M.union)
end

--- Takes out the numbers of a list of spans.
function Set:remove(list)
  for at = 1, #list, 2 do change_pages(self, list[at], list[at + 1], M.minus) end
end

--- Those of it from one up to another, as a list of spans.
function Set:within(first, last)
  local found, wanted, at = NONE, M.span(first, last), first
  while at < last do
    local page = floor(at / PAGE)
    found = M.union(found, self.pages[page] or NONE)
    at = (page + 1) * PAGE
  end
  return M.both(found, wanted)
end

--- Whether a number is in it.
function Set:has(number)
  return self:within(number, number + 1)[1] ~= nil
end

return M
