-- What the diagnoses remember of devices: a bounded memory of values with two keys, the oldest goes first.
--
-- Most answers tell what is known already, and that is looked up in `of` without making a key. A capture that
-- goes on is looked at with `on_top`: a memory that begins with what this one holds and keeps to itself what
-- it learns.

local ordered = require("ds47.support.ordered")

local M = {}

local NONE = {}

local Memory = {}
Memory.__index = Memory

--- An empty memory of at most `limit` entries.
function M.new(limit)
  return setmetatable({
    limit = limit,
    values = {}, -- first key -> second key -> value; false: below, but no longer known
    order = ordered.new(), -- both keys as one text -> {first key, second key}
    length = 0,
    below = nil, -- the memory that this one stands on
    oldest_below = nil, -- where to look for its oldest entry that is still known
  }, Memory)
end

--- A memory on top of this one, which nobody may change as long as the other one is used.
function Memory:on_top()
  local memory = M.new(self.limit)
  memory.below, memory.length, memory.oldest_below = self, self.length, self.order.oldest
  return memory
end

local function own(self, first, second)
  local values = self.values[first]
  return values and values[second]
end

--- What this memory itself holds for a first key, for reading only: second key -> value. What is not there,
-- or false, `get` may still know.
function Memory:of(first)
  return self.values[first] or NONE
end

--- The value of two keys, nil where there is none.
function Memory:get(first, second)
  local value = own(self, first, second)
  if value == nil and self.below then
    value = own(self.below, first, second)
  end
  return value or nil
end

local function set(self, first, second, value)
  local values = self.values[first]
  if values == nil then
    values = {}
    self.values[first] = values
  end
  values[second] = value
end

-- Forgets the oldest of those below that were not put anew since then; false where none is left.
local function forget_below(self)
  local order = self.below.order
  while self.oldest_below ~= nil do
    local entry = order:get(self.oldest_below)
    self.oldest_below = order.newer[self.oldest_below]
    if own(self, entry[1], entry[2]) == nil then
      set(self, entry[1], entry[2], false)
      return true
    end
  end
  return false
end

local function forget(self)
  self.length = self.length - 1
  if self.below and forget_below(self) then
    return
  end
  local _, entry = self.order:pop_first()
  local values = self.values[entry[1]]
  values[entry[2]] = nil
  if self.below then
    values[entry[2]] = false
  elseif next(values) == nil then
    self.values[entry[1]] = nil
  end
end

--- Keeps a value (neither nil nor false), which is the newest then.
function Memory:put(first, second, value)
  local known = self:get(first, second) ~= nil
  local key = first .. "\0" .. second
  set(self, first, second, value)
  if self.order:get(key) then
    self.order:move_to_end(key)
  else
    self.order:set(key, {first, second})
  end
  if not known then
    self.length = self.length + 1
    if self.length > self.limit then
      forget(self)
    end
  end
end

return M
