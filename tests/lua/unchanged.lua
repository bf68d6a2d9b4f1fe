-- Whether something changes what can be reached from a table, as asking an analysis for its end does not.

local M = {}

-- What may change: the result that is kept, the transactions that are finished, which have their newest ids,
-- and what is made when it is asked for.
local MAY = {}
for key in ("result finished_jobs blank place peer blocks"):gmatch("%S+") do
  MAY[key] = true
end

local function walk(root)
  local fields, waiting = {}, {root}
  while waiting[1] do
    local each = table.remove(waiting)
    if not fields[each] and rawget(each, "phase") ~= "closed" then -- such a job has its response for a while
      fields[each] = {}
      for key, value in next, each do
        if not MAY[key] then
          fields[each][key] = value
          waiting[#waiting + 1] = type(value) == "table" and value or nil
        end
      end
    end
  end
  return fields
end

--- Calls a function.
-- @return the name of a field that is another one then, in a table that can be reached from the root, or nil
function M.changed_by(root, call)
  local before = walk(root)
  call()
  for each, fields in pairs(before) do
    for key, value in pairs(fields) do
      if rawget(each, key) ~= value then
        return tostring(key)
      end
    end
    for key in next, each do
      if fields[key] == nil and not MAY[key] then
        return tostring(key)
      end
    end
  end
  return nil
end

return M
