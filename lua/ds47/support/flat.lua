-- A flat copy of a table: its own fields, and its metatable. What the fields hold is shared.

local M = {}

local NONE = {}

--- A flat copy.
-- @param own nil, or keys of tables that are copied, too: an array
function M.copy(original, own)
  local made = setmetatable({}, getmetatable(original))
  for key, value in next, original do made[key] = value end
  for _, key in ipairs(own or NONE) do made[key] = M.copy(made[key]) end
  return made
end

return M
