-- What arrays lack: an item is taken out by itself, not by its place; and which of the items are such ones.

local M = {}

--- Takes an item out of an array, the last one that equals it; none where there is none.
function M.take_out(array, item)
  for place = #array, 1, -1 do -- mostly it is the newest
    if array[place] == item then
      table.remove(array, place)
      return
    end
  end
end

--- A new array of those items for which `wanted` is true.
function M.filtered(array, wanted)
  local found = {}
  for _, item in ipairs(array) do
    if wanted(item) then found[#found + 1] = item end
  end
  return found
end

return M
