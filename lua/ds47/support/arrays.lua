-- What arrays lack: an item is taken out by itself, not by its place.

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

return M
