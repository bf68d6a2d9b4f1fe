-- Modules that are loaded when they are used first.
--
-- Most captures need no repair, no statistics and no tree. What is not loaded takes no time to load, and a
-- collector that looks through everything that is alive (Lua 5.2) has less to look through: on cyclic frames
-- that is a good part of what the plugin costs.

local M = {}

--- What stands for a module until something of it is used.
-- @param name    as `require` takes it
-- @param prepare a function of the module, called once when it has been loaded; may be nil
function M.module(name, prepare)
  local function use(self, key)
    local module = require(name)
    if prepare then
      prepare(module)
      prepare = nil
    end
    local value = module[key]
    self[key] = value
    return value
  end
  return setmetatable({}, { __index = use })
end

return M
