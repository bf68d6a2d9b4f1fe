-- What the diagnoses remember of devices: a bounded memory of values with two keys, the oldest goes first.
--
-- Most answers tell what is known already, and that is looked up in `of` without making a key.

local ordered = require("ds47.support.ordered")

local M = {}

local NONE = {}

local Memory = {}
Memory.__index = Memory

--- An empty memory of at most `limit` entries.
function M.new(limit)
  return setmetatable({
    limit = limit,
    values = {}, -- first key -> second key -> value
    order = ordered.new(), -- both keys as one text -> {first key, second key}
  }, Memory)
end

--- The same memory as one that goes on alone.
function Memory:apart()
  local memory = M.new(self.limit)
  for _, entry in self.order:iterate() do memory:put(entry[1], entry[2], self:get(entry[1], entry[2])) end
  return memory
end

--- What is known of a first key, for reading only: second key -> value.
function Memory:of(first) return self.values[first] or NONE end

--- The value of two keys, nil where there is none.
function Memory:get(first, second) return self:of(first)[second] end

local function forget(self)
  local _, entry = self.order:pop_first()
  local values = self.values[entry[1]]
  values[entry[2]] = nil
  if next(values) == nil then self.values[entry[1]] = nil end
end

--- Keeps a value (not nil), which is the newest then.
function Memory:put(first, second, value)
  local values = self.values[first] or {}
  self.values[first], values[second] = values, value
  local order, key = self.order, first .. "\0" .. second
  if order:get(key) then
    order:move_to_end(key)
    return
  end
  order:set(key, {first, second})
  if order.length > self.limit then forget(self) end
end

return M
