-- Bytes of a string as whole numbers and as text: what every decoder needs. Offsets count from 0, as on the
-- wire. Bytes that are not there are the caller's mistake; floats and 64-bit numbers are in numbers.lua.

local entries = require("ds47.support.later").entries

local byte, char, find, format, gsub = string.byte, string.char, string.find, string.format, string.gsub

local concat, floor = table.concat, math.floor

local M = {}

-- Each byte as two hexadecimal digits, and as the UTF-8 of the Latin-1 character it is.
local HEX = entries(function(character) return format("%02x", byte(character)) end)
local UTF8 = entries(function(character)
  local code = byte(character)
  return char(code < 192 and 194 or 195, code < 192 and code or code - 64)
end)

--- Unsigned, 16 bits, big-endian.
-- @param offset number of the first byte, from 0
function M.u16(data, offset)
  local a, b = byte(data, offset + 1, offset + 2)
  return a * 256 + b
end

--- Unsigned, 32 bits, big-endian.
function M.u32(data, offset)
  local a, b, c, d = byte(data, offset + 1, offset + 4)
  return ((a * 256 + b) * 256 + c) * 256 + d
end

--- A whole number below 2^53 in so many bytes, big-endian; a negative one as its two's complement.
function M.of_number(number, size)
  local parts = {}
  for place = size, 1, -1 do
    parts[place] = char(number % 256)
    number = floor(number / 256)
  end
  return concat(parts)
end

--- All bytes as hexadecimal digits, lower case, nothing between them.
function M.hex(data) return (gsub(data, ".", HEX)) end

--- The bytes that hexadecimal digits (an even number, nothing else) stand for.
function M.unhex(text) return (gsub(text, "%x%x", function(pair) return char(tonumber(pair, 16)) end)) end

--- Latin-1 text as UTF-8, which is what a value that is text is kept as.
function M.latin1(data) return (gsub(data, "[\128-\255]", UTF8)) end

--- The Latin-1 bytes of such a text; nil where it has other characters.
function M.from_latin1(text)
  if find(text, "[^\0-\127\194\195\128-\191]") then return nil end
  return (gsub(text, "([\194\195])([\128-\191])", function(first, second)
    return char((byte(first) - 194) * 64 + byte(second))
  end))
end

--- Whether no byte from an offset on is anything but zero.
function M.only_zeros(data, offset) return not find(data, "[^\0]", offset + 1) end

return M
