-- Times of a capture, in nanoseconds since the second that an analysis counts from.
--
-- A time is a plain number as long as a double holds it exactly, which is 104 days either way: all there is
-- in nearly every capture. A time that is further away (a clock that begins in 1970 and is set later) is a
-- table of seconds and nanoseconds. Times are only subtracted and compared, which is the same
-- for both: the difference of two times is a number, exact up to 2^53 and else the nearest one.

local floor = math.floor
local whole = rawget(math, "tointeger") or function(number) return number end -- as integers give it

local M = {}

local NEAR = 9007199 -- seconds; 2^53 nanoseconds are 0.25 s more
local EXACT = 2 ^ 53

local Far = {}

--- Seconds and nanoseconds of a time.
function M.split(time)
  if type(time) == "table" then return time.seconds, time.nanoseconds end
  local seconds = floor(time / 1000000000)
  return seconds, time - seconds * 1000000000
end

-- Seconds times 1e9 is a multiple of 2^9, so a double holds it for 136 years: only the sum is rounded, once.
function Far.__sub(later, earlier)
  local seconds, nanoseconds = M.split(later)
  local less_seconds, less = M.split(earlier)
  local difference = (seconds - less_seconds) * 1e9 + (nanoseconds - less)
  if difference <= EXACT and difference >= -EXACT then return whole(difference) end
  return difference
end

function Far.__lt(one, other) return one - other < 0 end

function Far.__le(one, other) return one - other <= 0 end

--- A time.
-- @param seconds, nanoseconds  whole numbers, 0 to 999999999 nanoseconds
function M.new(seconds, nanoseconds)
  if seconds < NEAR and seconds > -NEAR then return seconds * 1000000000 + nanoseconds end
  return setmetatable({seconds = seconds, nanoseconds = nanoseconds}, Far)
end

--- The time that is so many nanoseconds later.
function M.later(time, duration_ns)
  local seconds, nanoseconds = M.split(time)
  local more = floor((nanoseconds + duration_ns) / 1000000000)
  return M.new(seconds + more, nanoseconds + duration_ns - more * 1000000000)
end

--- Year, month and day of the Gregorian calendar, so many days after 1970-01-01.
function M.date(days)
  days = days + 719468 -- from 1 March of the year 0 on, so that a leap day is the last of its year
  local era, day = floor(days / 146097), days % 146097 -- 400 years
  local year = floor((day - floor(day / 1460) + floor(day / 36524) - floor(day / 146096)) / 365)
  day = day - (365 * year + floor(year / 4) - floor(year / 100))
  local month = floor((5 * day + 2) / 153)
  day = day - floor((153 * month + 2) / 5) + 1
  month = month < 10 and month + 3 or month - 9
  return year + era * 400 + (month <= 2 and 1 or 0), month, day
end

--- Whether a time is a plain number.
function M.is_near(time) return type(time) == "number" end

return M
