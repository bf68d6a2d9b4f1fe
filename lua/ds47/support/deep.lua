-- A deep copy of a table: with all tables that can be reached from it. Metatables are shared.

local M = {}

--- A deep copy.
-- @param copies what stands for a table in the copy: those that are shared, or that are replaced; those that
--   are copied are added, so that what was one table is one
function M.copy(original, copies)
  if type(original) ~= "table" then return original end
  local made = copies[original]
  if made == nil then
    made = setmetatable({}, getmetatable(original))
    copies[original] = made
    for key, value in next, original do
      made[key] = M.copy(value, copies)
    end
  end
  return made
end

return M
