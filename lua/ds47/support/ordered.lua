-- A dictionary that knows the order in which its keys came: the bounded memories of the analysis.
--
-- Lives here: the order. Not here: what is too old or too much (whoever keeps the memory decides).
--
-- Each key's neighbours stand in two tables, so that no node is made for a key.

local M = {}

local Ordered = {}
Ordered.__index = Ordered

--- An empty one. `length` is a field: the number of keys.
-- `newer` and `older` hold one entry that never goes. Without it a memory of 2^n keys would fill them exactly
-- whenever a key comes before the oldest one leaves, and Lua would build the whole table anew each time.
function M.new()
  return setmetatable({
    values = {}, newer = {[true] = true}, older = {[true] = true}, oldest = nil, newest = nil, length = 0,
  }, Ordered)
end

function Ordered:get(key) return self.values[key] end

--- Sets a value (not nil). A new key goes last, a known one keeps its place.
function Ordered:set(key, value)
  local values = self.values
  if values[key] == nil then
    local newest = self.newest
    if newest == nil then
      self.oldest = key
    else
      self.newer[newest], self.older[key] = key, newest
    end
    self.newest = key
    self.length = self.length + 1
  end
  values[key] = value
end

--- Puts a key that is there behind all others.
function Ordered:move_to_end(key)
  local newest = self.newest
  if key == newest then return end
  local newer, older = self.newer, self.older
  local before, after = older[key], newer[key]
  if before == nil then
    self.oldest = after
  else
    newer[before] = after
  end
  older[after] = before
  newer[newest] = key
  older[key] = newest
  newer[key] = nil
  self.newest = key
end

--- Removes a key; its value, nil where the key was not there.
function Ordered:pop(key)
  local value = self.values[key]
  if value == nil then return nil end
  local newer, older = self.newer, self.older
  local before, after = older[key], newer[key]
  if before == nil then
    self.oldest = after
  else
    newer[before], older[key] = after, nil
  end
  if after == nil then
    self.newest = before
  else
    older[after], newer[key] = before, nil
  end
  self.values[key] = nil
  self.length = self.length - 1
  return value
end

--- The oldest key and its value; nil when empty.
function Ordered:first()
  local key = self.oldest
  if key ~= nil then return key, self.values[key] end
end

--- Removes the oldest key; the key and its value, nil when empty.
function Ordered:pop_first()
  local key = self.oldest
  if key ~= nil then return key, self:pop(key) end
end

--- Keeps a value as the newest one; of more keys than `most` the oldest goes.
function Ordered:keep(key, value, most)
  local values = self.values
  if values[key] == nil then
    self:set(key, value)
    if self.length > most then self:pop_first() end
    return
  end
  values[key] = value
  if self.newest ~= key then self:move_to_end(key) end
end

local function following(self, key)
  if key == nil then
    key = self.oldest
  else
    key = self.newer[key]
  end
  if key ~= nil then return key, self.values[key] end
end

--- For a `for` loop: keys and values, the oldest first. No key may be removed or moved meanwhile.
function Ordered:iterate() return following, self, nil end

--- For a `for` loop: the newest keys, the newest first, `most` of them at the most. None may be removed or
-- moved meanwhile.
function Ordered:newest_first(most)
  local key, count = nil, 0
  return function()
    key = count == 0 and self.newest or self.older[key]
    count = count + 1
    return count <= most and key or nil
  end
end

return M
