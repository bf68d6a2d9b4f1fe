-- A flat copy of a table: its own fields, and its metatable. What the fields hold is shared.

local M = {}

--- A flat copy.
function M.copy(original)
  local made = setmetatable({}, getmetatable(original))
  for key, value in next, original do made[key] = value end
  return made
end

return M
