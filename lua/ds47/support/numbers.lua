-- Numbers of the wire as Lua numbers, and the text by which they are shown: floats, and integers that a
-- double cannot hold. The same numbers and the same texts as in Python. Which format has which of them is in
-- formats.lua.
--
-- Lua 5.2 knows no integers. The caller knows whether 10 is shown as 10 or as 10.0: it calls float_text for
-- floats and text for the rest.

local entries = require("ds47.support.later").entries

local byte, find, format, gsub, match = string.byte, string.find, string.format, string.gsub, string.match
local rep, sub = string.rep, string.sub
local floor = math.floor

local M = {}

local EXACT_HIGH = 2097152 -- upper half of 2^53, beyond which a double no longer holds every whole number
local SMALLEST_NORMAL = 2.2250738585072014e-308

-- POWER[e] is 2^e, by doubling and halving, because pow() need not be exact. Made when it is asked for.
local POWER = entries(function(exponent)
  local value = 1.0
  for _ = 1, exponent do value = value * 2 end
  for _ = -1, exponent, -1 do value = value / 2 end
  return value
end)

local function not_finite(fraction, negative)
  if fraction ~= 0 then return "NaN" end
  return negative and "-Infinity" or "Infinity"
end

local SHORTER = {"%.1g", "%.2g", "%.3g", "%.4g", "%.5g", "%.6g", "%.7g", "%.8g"}
local NORMAL32 = POWER[-126] -- below it a Float32 has fewer digits
local SMALLEST32 = POWER[-149] -- the scale of those
local LEAST = 8388608 -- the fraction of a power of two

-- The least power of ten that brings nine digits or more of a Float32 of an exponent before its point; nil
-- where a double does not hold it exactly, or the Float32 has more of them.
local function tenfold(exponent)
  local least, power = POWER[exponent - 127], 1.0
  while least * power < 1e8 do power = power * 10 end
  return power <= 1e22 and exponent <= 156 and power or nil
end

local DOUBT = 1e-5 -- more than rounding can move a product of ten digits

-- What all Float32 with the same upper nine bits have in common: {negative, special (NaN and infinite),
-- lift (what makes their fraction of the lower three bytes), scale (by which it is multiplied)}, and where
-- arithmetic is exact {power (of ten), factor (scale and power, with the sign), reach (by how much a decimal
-- times the power may be off)}.
local function class_of(first, odd)
  local exponent, negative = first % 128 * 2 + (odd and 1 or 0), first >= 128
  local normal = exponent > 0 and LEAST or 0
  local scale, power = POWER[(exponent > 0 and exponent or 1) - 150], tenfold(exponent)
  local whole = power and scale * power
  return {
    negative = negative, special = exponent == 255, lift = normal - (odd and LEAST or 0), scale = scale,
    power = power, factor = whole and (negative and -whole or whole), reach = whole and whole * 0.5,
  }
end

-- By the first byte: where the next one is less than 128, and where it is not.
local EVEN = entries(function(first) return class_of(first, false) end)
local ODD = entries(function(first) return class_of(first, true) end)

-- The shortest decimal of the Float32 fraction * scale by printing and reading, without the sign. What lies
-- between `low` and `high` rounds to it; where it is even they do so, too. Below a power of two the next one
-- is nearer.
local function shortest(fraction, scale)
  local number = fraction * scale
  if number < 16777216 and number % 1 == 0 then return number end
  local narrow = fraction == LEAST and scale > SMALLEST32
  local low, high = number - scale * (narrow and 0.25 or 0.5), number + scale * 0.5
  for i = number >= NORMAL32 and 6 or 1, 8 do
    local short = tonumber(format(SHORTER[i], number))
    if short >= low and short <= high and (short > low and short < high or fraction % 2 == 0) then
      return short + 0.0
    end
  end
  return tonumber(format("%.9g", number)) + 0.0
end

local function by_printing(fraction, class)
  if class.special then return not_finite(fraction - LEAST, class.negative) end
  local number = shortest(fraction, class.scale)
  if class.negative then return -number end
  return number
end

--- A Float32 as the shortest decimal that gives it again; "NaN", "Infinity" and "-Infinity" as text.
-- Mostly by arithmetic: printing and reading would cost ten times as much. A whole number divided by a power
-- of ten is exactly the double of that decimal. A multiple of ten is always in reach. By printing where
-- rounding leaves it in doubt: next to the middle between two decimals, or to the end of what rounds to the
-- Float32.
-- @param offset number of the first byte, from 0
function M.float32(data, offset)
  local a, b, c, d = byte(data, offset + 1, offset + 4)
  local class = b < 128 and EVEN[a] or ODD[a]
  local fraction, factor = (b * 256 + c) * 256 + d + class.lift, class.factor
  if factor == nil then return by_printing(fraction, class) end
  local scaled, reach = fraction * factor, class.reach
  local off, unit, most = scaled % 1000, 1000, reach + DOUBT
  if off > most and 1000 - off > most then
    off, unit = scaled % 100, 100
    if off > most and 100 - off > most then off, unit = scaled % 10, 10 end
  end
  if off + off > unit then off = off - unit end
  if fraction == LEAST then reach = reach * 0.5 end
  if reach + reach > unit then reach = unit * 0.5 end
  if off < reach - DOUBT and off > DOUBT - reach then return (scaled - off) / class.power end
  return by_printing(fraction, class)
end

--- A Float64; "NaN", "Infinity" and "-Infinity" as text.
function M.float64(data, offset)
  local a, b, c, d, e, f, g, h = byte(data, offset + 1, offset + 8)
  local negative = a >= 128
  local exponent = a % 128 * 16 + floor(b / 16)
  local fraction = (((((b % 16 * 256 + c) * 256 + d) * 256 + e) * 256 + f) * 256 + g) * 256 + h
  if exponent == 2047 then return not_finite(fraction, negative) end
  if exponent == 0 then
    exponent = 1
  else
    fraction = fraction + 4503599627370496
  end
  local number = fraction * POWER[exponent - 1075]
  if negative then return -number end
  return number
end

-- high * 2^32 + low in decimal digits, by three digits groups of seven.
local function decimal(high, low)
  local top, middle, bottom = 0, 0, high
  for _ = 1, 4 do -- 2^32 at once would leave what a double holds
    bottom = bottom * 256
    middle = middle * 256 + floor(bottom / 10000000)
    bottom = bottom % 10000000
    top = top * 256 + floor(middle / 10000000)
    middle = middle % 10000000
  end
  bottom = bottom + low
  middle = middle + floor(bottom / 10000000)
  top = top + floor(middle / 10000000)
  local text = format("%d%07d%07d", top, middle % 10000000, bottom % 10000000)
  return (gsub(text, "^0+(%d)", "%1"))
end

local function value(high, low, negative)
  if high < EXACT_HIGH or high == EXACT_HIGH and low == 0 then
    local number = high * 4294967296 + low
    if negative then return -number end
    return number
  end
  return (negative and "-" or "") .. decimal(high, low)
end

--- The unsigned integer of 1 to 8 big-endian bytes: a number, or its digits where it is beyond 2^53.
function M.unsigned(data, offset, size)
  local high, low = 0, 0
  for i = offset + 1, offset + size - 4 do high = high * 256 + byte(data, i) end
  for i = offset + (size > 4 and size - 3 or 1), offset + size do low = low * 256 + byte(data, i) end
  return value(high, low, false)
end

--- The signed integer of 8 big-endian bytes: a number, or its digits where it is beyond 2^53 either way.
function M.signed64(data, offset)
  local a, b, c, d, e, f, g, h = byte(data, offset + 1, offset + 8)
  local high, low = ((a * 256 + b) * 256 + c) * 256 + d, ((e * 256 + f) * 256 + g) * 256 + h
  if a < 128 then return value(high, low, false) end
  if low == 0 then return value(4294967296 - high, 0, true) end
  return value(4294967295 - high, 4294967296 - low, true)
end

-- Digits and exponent laid out as Python's repr does.
local function layout(sign, digits, exponent)
  digits = gsub(digits, "(%d)0+$", "%1")
  if exponent >= -4 and exponent < 0 then return sign .. "0." .. rep("0", -exponent - 1) .. digits end
  if exponent >= 0 and exponent < 16 then
    digits = digits .. rep("0", exponent + 1 - #digits)
    local behind = sub(digits, exponent + 2)
    return sign .. sub(digits, 1, exponent + 1) .. "." .. (behind == "" and "0" or behind)
  end
  local behind = sub(digits, 2)
  local tail = format("e%s%02d", exponent < 0 and "-" or "+", math.abs(exponent))
  return sign .. sub(digits, 1, 1) .. (behind == "" and "" or "." .. behind) .. tail
end

-- The decimal that is one higher in its last digit.
local function next_decimal(text)
  local head, digit, nines, tail = match(text, "^(.-)([0-8])(9*)(e.*)$")
  return head and head .. format("%d", digit + 1) .. rep("0", #nines) .. tail or text
end

-- The fewest digits that read back as the same double. Next to a power of two the nearest decimal may not do
-- that while the one above does, as doubles lie closer below than above.
local function fewest(number)
  local text
  local normal = number >= SMALLEST_NORMAL or number <= -SMALLEST_NORMAL
  for digits = normal and 14 or 0, 16 do -- behind the first one
    text = format("%." .. digits .. "e", number)
    if tonumber(text) == number then break end
    text = next_decimal(text)
    if tonumber(text) == number then break end
  end
  -- Any one character for the point: what it is depends on the locale of the program around us.
  local sign, first, others, exponent = match(text, "^(-?)(%d)%D?(%d*)e([-+]%d+)$")
  return layout(sign, first .. others, tonumber(exponent))
end

--- The text of a float: shortest that reads back the same, always with a point or an exponent (10.0, 1e-05).
function M.float_text(number)
  if number ~= number then return "NaN" end
  if number == math.huge then return "Infinity" end
  if number == -math.huge then return "-Infinity" end
  local text = format("%.15g", number)
  if find(text, "^-?%d+%.%d+$") and tonumber(text) == number then return text end
  if find(text, "e", 1, true) or tonumber(text) ~= number then return fewest(number) end
  if not find(text, "%D", 2) then return text .. ".0" end
  return (gsub(text, ",", "."))
end

--- The digits of a whole number. "%d" of Lua 5.2 holds only 32 bits on Windows, "%.0f" takes twice as long.
function M.whole_text(number)
  local is_short = number > -2147483648 and number < 2147483648 and (number ~= 0 or 1 / number > 0)
  return format(is_short and "%d" or "%.0f", number)
end

--- The text of a number that is a whole number if it looks like one.
function M.text(number)
  if number % 1 == 0 and number >= -9007199254740992 and number <= 9007199254740992 then
    return M.whole_text(number)
  end
  return M.float_text(number)
end

return M
