-- What is made, or loaded, when it is used first.
--
-- Most captures need no repair, no statistics and no tree. What is not loaded takes no time to load, and a
-- collector that looks through everything that is alive (Lua 5.2) has less to look through: on cyclic frames
-- that is a good part of what the plugin costs.

local M = {}

--- A table whose entries are made when they are asked for.
-- @param make a function of the key that gives the entry
-- @param most how many are kept: behind that many it begins anew; nil keeps all
function M.entries(make, most)
  local count = 0
  return setmetatable({}, { __index = function(entries, key)
    if count == most then
      for known in pairs(entries) do entries[known] = nil end
      count = 0
    end
    local value = make(key)
    entries[key], count = value, count + 1
    return value
  end })
end

--- What stands for a module until something of it is used.
-- @param name    as `require` takes it
-- @param prepare a function of the module, called once when it has been loaded; may be nil
function M.module(name, prepare)
  return M.entries(function(key)
    local module = require(name)
    if prepare then
      prepare(module)
      prepare = nil
    end
    return module[key]
  end)
end

return M
