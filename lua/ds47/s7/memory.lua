-- What is known of one memory of a partner: who wrote what, and which bytes somebody writes who was not
-- captured.
--
-- Bounded: of what is long over only the last values are kept. What is of one moment is decided in
-- consistency.lua, which says what an access is.

local consistency = require("ds47.s7.consistency")
local spans = require("ds47.support.spans")

local floor, max, min = math.floor, math.max, math.min
local insert, remove = table.insert, table.remove
local byte, sub = string.byte, string.sub
local is_over, is_later = consistency.is_over, consistency.is_later
local meets, share, sorted = consistency.meets, consistency.share, consistency.sorted
local span = spans.span

local M = {}

local MOST_LOST = 16 -- writes without an answer that are remembered by themselves
local MOST_BYTES = 0x20000 -- bytes that are remembered so: of accesses, and of reads
local PAGE = 256 -- bytes of a text of an image
local BLANK = ("\0"):rep(PAGE)

-- Values of bytes, as far as they are known: `pages` has their texts by their place, `known` which are known.
local Image = {}
Image.__index = Image

local function new_image()
  return setmetatable({pages = {}, known = spans.set()}, Image)
end

-- The same, to change.
local function copy_of(image)
  local pages = {}
  for page, text in pairs(image.pages) do pages[page] = text end
  return setmetatable({pages = pages, known = image.known:copy()}, Image)
end

--- From now on the bytes have these values.
function Image:put(access)
  local at = access.start
  while at < access.last do
    local page = floor(at / PAGE)
    local first, stop = page * PAGE, min(access.last, (page + 1) * PAGE)
    local old = self.pages[page] or BLANK
    local new = sub(access.data, at - access.start + 1, stop - access.start)
    self.pages[page] = sub(old, 1, at - first) .. new .. sub(old, stop - first + 1)
    at = stop
  end
  self.known:add(access.start, access.last)
end

--- The values of these bytes (spans) are not known.
function Image:forget(list)
  self.known:remove(list)
end

-- The values of bytes, known or not.
local function text(self, start, last)
  local found, page = {}, floor(start / PAGE)
  local first = page * PAGE
  while page * PAGE < last do
    found[#found + 1] = self.pages[page] or BLANK
    page = page + 1
  end
  return sub(table.concat(found), start - first + 1, last - first)
end

--- Whether what was read is what was known.
function Image:same(access)
  local start, last = access.start, access.last
  local known = self.known:within(start, last)
  return known[1] == start and known[2] == last and text(self, start, last) == access.data
end

--- Bytes that are known, and have another value than in this text, as spans.
function Image:others(start, values)
  local last = start + #values
  local found = consistency.differences(text(self, start, last), values, start)
  return spans.both(found, self.known:within(start, last))
end

--- Whether a byte is known to have a value.
function Image:has(at, value)
  return self.known:has(at) and byte(text(self, at, at + 1)) == value
end

local Memory = {}
Memory.__index = Memory

--- One area, or one data block, of a partner.
-- @param most  accesses that are kept by themselves
function M.new(most)
  return setmetatable({
    most = most, before = new_image(), latest = new_image(), history = {}, open = {}, lost = {},
    read_ones = {}, read_bytes = 0, -- the latest reads
    bytes = 0, -- of the history
    since = nil, -- all accesses that may have been in force after this time are known; nil for all times
    foreign = spans.set(), -- bytes that had a value which no captured write explains: others write them
  }, Memory)
end

-- Takes an open write out; false where it is none.
local function take(self, write)
  for number, each in ipairs(self.open) do
    if each.order == write.order then
      remove(self.open, number)
      return true
    end
  end
  return false
end

--- A write was asked for: it may come into force at any time.
function Memory:sent(write)
  insert(self.open, write)
end

--- A write has no answer: it may still come into force.
function Memory:gave_up(write)
  if not take(self, write) then return end
  insert(self.lost, write)
  local bytes = 0
  for _, each in ipairs(self.lost) do bytes = bytes + #each.data end
  if #self.lost > MOST_LOST or bytes > MOST_BYTES then
    local oldest = remove(self.lost, 1)
    self.foreign:add(oldest.start, oldest.last)
  end
end

local function is_known_since(self, time_ns)
  return self.since == nil or self.since < time_ns
end

local function later_of(one, other)
  return one == nil and other or other ~= nil and one < other and other or one
end

--- Until now the memory may have been written by somebody who was not heard.
function Memory:forget(time_ns)
  self.since = later_of(self.since, time_ns)
  self.before, self.latest, self.history = new_image(), new_image(), {}
  self.read_ones, self.read_bytes, self.bytes = {}, 0, 0
end

-- How many of the oldest accesses, which are sorted, were over before a time (nil for none) and before all
-- others, and those without an answer, began; `most` at the most.
local function cut_of(self, most, time_ns)
  local begins, latest, found = time_ns, nil, 0
  for _, each in ipairs(self.open) do
    if not begins or each.asked_ns < begins then begins = each.asked_ns end
  end
  for number = 1, most do
    latest = later_of(latest, self.history[number].answered_ns)
    if begins and latest >= begins then break end
    local following = self.history[number + 1]
    if not following or latest < following.asked_ns then found = number end
  end
  return found
end

-- Bytes of which nobody knows what accesses that are over left there.
local function unknown_of(accesses)
  local unknown = {}
  for number, each in ipairs(accesses) do
    if each.write and not (each.sure and each.known) then
      unknown = spans.union(unknown, span(each.start, each.last))
    end
    for behind = number + 1, #accesses do
      local other = accesses[behind]
      if is_over(each.answered_ns, other.asked_ns) then break end
      if (each.write or other.write) and meets(each, other) then
        unknown = spans.union(unknown, span(max(each.start, other.start), min(each.last, other.last)))
      end
    end
  end
  return unknown
end

-- Accesses, in the order of their requests, that are over: what they leave, as far as that is certain.
local function come_over(image, accesses)
  for _, each in ipairs(sorted(accesses, "answered_ns")) do image:put(each) end
  image:forget(unknown_of(accesses))
end

-- The first accesses of a list, and the others.
local function parted(list, count)
  local first, others = {}, {}
  for number, each in ipairs(list) do insert(number <= count and first or others, each) end
  return first, others
end

-- Keeps only the values of what was over before everything else began.
local function fold(self)
  local count = #self.history
  self.history = sorted(self.history, "asked_ns")
  local cut = cut_of(self, count - floor(min(self.most, count) / 2))
  if cut > 0 then
    local over
    over, self.history = parted(self.history, cut)
    come_over(self.before, over)
    for _, each in ipairs(over) do
      self.bytes = self.bytes - #each.data
      self.since = later_of(self.since, each.answered_ns)
    end
  elseif count > 4 * self.most or self.bytes > 4 * MOST_BYTES then
    local latest
    for _, each in ipairs(self.history) do latest = later_of(latest, each.answered_ns) end
    self:forget(latest)
  end
end

local function keep(self, access)
  insert(self.history, access)
  self.bytes = self.bytes + #access.data
  if #self.history > self.most or self.bytes > MOST_BYTES then fold(self) end
end

--- A write was answered.
function Memory:written(write)
  take(self, write)
  if not is_known_since(self, write.asked_ns) then
    self:forget(write.answered_ns)
    return
  end
  keep(self, write)
  if write.sure and write.known then
    self.latest:put(write)
  else
    self.latest:forget(span(write.start, write.last))
  end
end

-- Everything that is kept by itself.
local function all(self)
  local found = {}
  for _, list in ipairs({self.history, self.open, self.lost}) do
    for _, each in ipairs(list) do found[#found + 1] = each end
  end
  return found
end

-- What is known from before a time, and everything that may have been in force later.
local function settled(self, time_ns)
  self.history = sorted(self.history, "asked_ns")
  local before = copy_of(self.before)
  local over, later = parted(self.history, cut_of(self, #self.history, time_ns))
  come_over(before, over)
  for _, list in ipairs({self.open, self.lost}) do
    for _, each in ipairs(list) do later[#later + 1] = each end
  end
  return before, later
end

-- Whether a byte was written, and somebody but the read itself knows of the value.
local function explains(at, value, others, before)
  local is_written, is_known = false, before:has(at, value)
  for _, each in ipairs(others) do
    if each.start <= at and at < each.last then
      is_written = is_written or each.write
      is_known = is_known or not each.known or byte(each.data, at - each.start + 1) == value
    end
  end
  return is_written and is_known
end

-- Marks the bytes of a read whose values come from nobody who was captured.
local function unexplained(self, access)
  local differ = self.latest:others(access.start, access.data)
  differ = spans.minus(differ, self.foreign:within(access.start, access.last))
  if not differ[1] then return end
  local before, later = settled(self, access.asked_ns)
  local others = {}
  for _, each in ipairs(later) do others[#others + 1] = share(each, access) and each or nil end
  local question = consistency.new({access}, others, before)
  for _, at in ipairs(spans.numbers(differ)) do
    local value = byte(access.data, at - access.start + 1)
    if not (explains(at, value, others, before) and question:byte(at)) then self.foreign:add(at, at + 1) end
  end
end

--- Bytes were read; what says nothing new does not count as evidence.
function Memory:read(access)
  insert(self.read_ones, access)
  self.read_bytes = self.read_bytes + #access.data
  while #self.read_ones > self.most or self.read_bytes > MOST_BYTES do
    self.read_bytes = self.read_bytes - #remove(self.read_ones, 1).data
  end
  if self.latest:same(access) then return end
  unexplained(self, access)
  self.latest:put(access)
  if is_known_since(self, access.asked_ns) then keep(self, access) end
end

--- The latest writes that were answered: array.
function Memory:writes()
  local found = {}
  for _, each in ipairs(self.history) do found[#found + 1] = each.write and each or nil end
  return found
end

--- The latest reads that met a write: array.
function Memory:reads(whole)
  local found = {}
  for _, each in ipairs(self.read_ones) do
    if meets(each, whole) then found[#found + 1] = each end
  end
  return found
end

-- Whether somebody has had to do with the bytes of a write since it was asked for.
local function is_met(write, there)
  for _, each in ipairs(there) do
    local is_later_one = each ~= write and not is_over(each.answered_ns, write.asked_ns)
    if is_later_one and share(each, write) then return true end
  end
  return false
end

--- Writes whose values a read should have, as nobody wrote after them, and which no read has met before:
-- array.
function Memory:unread(access)
  local there, found = {}, {}
  for _, list in ipairs({all(self), self.read_ones}) do
    for _, each in ipairs(list) do there[#there + 1] = share(each, access) and each or nil end
  end
  for _, write in ipairs(self:writes()) do
    if write.sure and write.known and write.answered_ns < access.asked_ns and share(write, access)
      and not is_met(write, there) then
      found[#found + 1] = write
    end
  end
  return found
end

-- When the first of the parts of a read began, when the last one was over, and where its bytes are.
local function extent(parts)
  local first = parts[1]
  local begin, finish = first.asked_ns, first.answered_ns
  for _, each in ipairs(parts) do
    if each.asked_ns < begin then begin = each.asked_ns end
    if is_later(each.answered_ns, finish) then finish = each.answered_ns end
  end
  return begin, finish
end

-- Whether a write of any of the bytes was under way while they were read.
local function is_between(write, parts, begin, finish)
  if is_over(finish, write.asked_ns) or is_over(write.answered_ns, begin) then return false end
  for _, each in ipairs(parts) do
    if share(write, each) then return true end
  end
  return false
end

-- Whether a write that is none of those left out, or the one that wants to be one, was under way while its
-- bytes were read.
local function is_written(self, parts, put, left_out)
  local begin, finish = extent(parts)
  if put and is_between(put.whole, parts, begin, finish) then return true end
  for _, each in ipairs(all(self)) do
    if each.write and not left_out[each.order] and is_between(each, parts, begin, finish) then return true end
  end
  return false
end

-- The numbers of the parts of a read, and of those of a write that wants to be one: a set.
local function orders_of(parts, put)
  local found = {}
  for _, list in ipairs({parts, put and put.parts or {}}) do
    for _, each in ipairs(list) do found[each.order] = true end
  end
  return found
end

-- The first write that says that two bytes never were there together; one that came into force before others.
local function meant(others, begin, finish, first, second)
  local found
  for _, each in ipairs(others) do
    local has = each.start <= first and first < each.last or each.start <= second and second < each.last
    if each.write and has and not is_over(finish, each.asked_ns) and not is_over(each.answered_ns, begin) then
      local better = not found or each.sure and not found.sure
        or each.sure == found.sure and each.asked_ns < found.asked_ns
      found = better and each or found
    end
  end
  return found
end

--- What was read, if it never was in the memory at one moment.
-- @param parts  array of accesses of one read
-- @param put  nil, or a write in parts that wants to be one: {parts, whole}
-- @return {first, second, write}: two bytes that never were in the memory together, and a write that says so;
-- nil where they may have been
function Memory:mixed(parts, put)
  local begin, left_out = extent(parts), orders_of(parts, put)
  if put and put.whole.asked_ns < begin then begin = put.whole.asked_ns end
  if not is_known_since(self, begin) or not is_written(self, parts, put, left_out) then return nil end
  local before, later = settled(self, begin)
  local others, start, last = {}, parts[1].start, parts[1].last
  for _, each in ipairs(later) do others[#others + 1] = not left_out[each.order] and each or nil end
  others[#others + 1] = put and put.whole or nil
  for _, each in ipairs(parts) do start, last = min(start, each.start), max(last, each.last) end
  local question = consistency.new(parts, others, before, self.foreign:within(start, last))
  local first, second = question:mixed()
  local write = first and meant(others, question.begin, question.finish, first, second)
  return write and {first = first, second = second, write = write} or nil
end

return M
