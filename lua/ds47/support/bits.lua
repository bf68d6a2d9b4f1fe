-- Bits of words: no Lua of Wireshark before 4.4 has operators for them. Nothing of the wire is known here.

local floor = math.floor

local M = {}

--- A bit of a word: 0 or 1.
function M.bit(word, number) return floor(word / 2 ^ number) % 2 end

local bit = M.bit

--- Whether all of these bits of a word are 1.
function M.all(word, numbers)
  for _, number in ipairs(numbers) do
    if bit(word, number) == 0 then return false end
  end
  return true
end

--- Whether one of these bits of a word is 1.
function M.any(word, numbers)
  for _, number in ipairs(numbers) do
    if bit(word, number) == 1 then return true end
  end
  return false
end

return M
