-- A copy of a web of tables, for looking at the end of something that goes on.
--
-- Knows nothing of what it copies. Works through a list instead of calling itself, so that no chain of
-- tables is too long; what is met twice is copied once; metatables are kept as they are.

local tables = require("ds47.spec.tables")

local M = {}

-- Tables that nobody changes: those of tables.lua, found once and only when something is copied.
local constant

local function constants()
  local found, list, done = {[tables] = true}, {tables}, 0
  while done < #list do
    done = done + 1
    for _, value in pairs(list[done]) do
      if type(value) == "table" and not found[value] then
        found[value] = true
        list[#list + 1] = value
      end
    end
  end
  return found
end

--- A copy of `root` and of every table that can be reached from it.
-- Not copied but referred to: metatables, the tables of tables.lua, loaded modules, and what `known` and
-- `unchanging` name.
-- @param root        a table
-- @param known       table -> what stands in its place in the copy (itself, to share it); grows on the way
-- @param unchanging  set of keys; what stands under such a key is shared
-- @return the copy
function M.copy(root, known, unchanging)
  constant = constant or constants()
  for _, module in pairs(package.loaded) do
    if type(module) == "table" and known[module] == nil then
      known[module] = module
    end
  end
  local waiting, count, done = {}, 0, 0
  local function twin(original)
    if constant[original] then
      return original
    end
    local made = known[original]
    if made == nil then
      made = setmetatable({}, getmetatable(original))
      known[original] = made
      count = count + 1
      waiting[count] = original
    end
    return made
  end
  local result = twin(root)
  while done < count do
    done = done + 1
    local original = waiting[done]
    waiting[done] = false
    local made = known[original]
    for key, value in next, original do
      if type(value) == "table" and not unchanging[key] then
        value = twin(value)
      end
      if type(key) == "table" then
        key = twin(key)
      end
      rawset(made, key, value)
    end
  end
  return result
end

return M
