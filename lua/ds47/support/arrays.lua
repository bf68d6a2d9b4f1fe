-- What arrays lack: an item is found and taken out by itself, not by its place; which items are such ones,
-- and what is made of each. A function that is made for one call is dear: not on the way of every frame.

local M = {}

--- Whether an item is in an array.
function M.has(array, item)
  for _, each in ipairs(array) do
    if each == item then return true end
  end
  return false
end

--- Takes an item out of an array, the last one that equals it; none where there is none.
function M.take_out(array, item)
  for place = #array, 1, -1 do -- mostly it is the newest
    if array[place] == item then
      table.remove(array, place)
      return
    end
  end
end

--- The first item for which `wanted` is true; nil for none.
function M.first(array, wanted)
  for _, item in ipairs(array) do
    if wanted(item) then return item end
  end
  return nil
end

--- Whether `wanted` is true for one of the items.
function M.any(array, wanted) return M.first(array, wanted) ~= nil end

--- Adds the items of another array.
function M.append(array, more)
  for place = 1, #more do array[#array + 1] = more[place] end
end

--- A new array of what is made of each item.
function M.mapped(array, make)
  local made = {}
  for place, item in ipairs(array) do made[place] = make(item) end
  return made
end

--- Puts an item behind those of a key; nothing where there is no key.
function M.push(lists, key, item)
  if key == nil then return end
  lists[key] = lists[key] or {}
  table.insert(lists[key], item)
end

--- A new array of those items for which `wanted` is true.
function M.filtered(array, wanted)
  local found = {}
  for _, item in ipairs(array) do
    if wanted(item) then found[#found + 1] = item end
  end
  return found
end

--- Numbers in their order, each once; the array itself is sorted, too.
function M.in_order(numbers)
  local found = {}
  table.sort(numbers)
  for _, number in ipairs(numbers) do
    if number ~= found[#found] then found[#found + 1] = number end
  end
  return found
end

--- The place of the last entry {number, ...} that is not behind a number; 0 before the first one.
-- @param entries in the order of their numbers
function M.last_until(entries, number)
  local low, high = 0, #entries
  while low < high do
    local middle = math.ceil((low + high) / 2)
    if entries[middle][1] <= number then
      low = middle
    else
      high = middle - 1
    end
  end
  return low
end

return M
