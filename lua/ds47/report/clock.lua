--- Times of a capture as a person reads them: time of day, and seconds since the first frame (Python:
-- ds47.report.clock). Lua knows two zones: UTC, and that of this machine.

local times = require("ds47.support.times")
local words = require("ds47.report.formatting")

local M = {}

local floor, format = math.floor, string.format
local say = words.say

M.NO_DATE_BEFORE = 315532800 -- seconds since 1970 (1980-01-01): a clock before it was never set
local LONG = 30 * 86400 -- seconds: summer time may begin and end again in a longer capture

local Clock = {}
Clock.__index = Clock

-- Days of a date of the Gregorian calendar since 1970-01-01.
local function days_of(year, month, day)
  if month <= 2 then year, month = year - 1, month + 12 end
  return 365 * year + floor(year / 4) - floor(year / 100) + floor(year / 400)
    + floor((153 * (month - 3) + 2) / 5) + day - 719469
end

-- By how many seconds the clock of this machine is ahead of UTC then; 0 in years that it does not know.
local function local_offset(seconds)
  local known, there = pcall(os.date, "*t", seconds)
  if not known or type(there) ~= "table" then return 0 end
  local clock = there.hour * 3600 + there.min * 60 + there.sec
  return days_of(there.year, there.month, there.day) * 86400 + clock - seconds
end

--- The clock of a capture.
-- @param result what Analysis:ended() gives, with base_seconds, start_time and end_time where they are known
-- @param zone   nil for UTC, "local" for that of this machine
function M.new(result, zone)
  local self = setmetatable({ zone = zone, base = result.base_seconds or 0 }, Clock)
  self.first, self.last, self.ended = result.start_time, result.end_time, result.end_time
  for _, each in ipairs(result.transactions) do
    if result.start_time == nil and (self.first == nil or each.start_ns < self.first) then
      self.first = each.start_ns
    end
    local ended = times.later(each.start_ns, math.max(0, each.duration_ns or 0))
    if self.last == nil or self.last < ended then self.last = ended end
  end
  for _, timeline in ipairs(result.timelines or {}) do
    local event = timeline.events[#timeline.events]
    if event and (self.last == nil or self.last < event.time) then self.last = event.time end
  end
  self.known = self.first ~= nil and self.base + times.split(self.first) >= M.NO_DATE_BEFORE
  local from, till = self.first or 0, self.last or self.first or 0
  local _, date, offset = self:parts(from)
  local _, last_date, last_offset = self:parts(till)
  self.dated = date ~= last_date
  self.offset = offset ~= last_offset or till - from > LONG * 1e9
  return self
end

--- Time of day in milliseconds, date, how far ahead of UTC.
function Clock:parts(time)
  local seconds, nanoseconds = times.split(time)
  seconds = self.base + seconds
  local ahead = self.zone == "local" and local_offset(seconds) or 0
  seconds = seconds + ahead
  local days = floor(seconds / 86400)
  seconds = seconds - days * 86400
  local year, month, day = times.date(days)
  local minutes = floor(math.abs(ahead) / 60)
  return format("%02.0f:%02.0f:%02.0f.%03.0f", floor(seconds / 3600), floor(seconds / 60) % 60, seconds % 60,
    floor(nanoseconds / 1000000)), format("%04.0f-%02.0f-%02.0f", year, month, day),
    format("%s%02.0f:%02.0f", ahead < 0 and "-" or "+", floor(minutes / 60), minutes % 60)
end

--- `12:14:03.412`, with its date and offset where these are needed; nil where no time of day is known.
function Clock:at(time)
  if not self.known then return nil end
  local clock, date, offset = self:parts(time)
  return (self.dated and date .. " " or "") .. clock .. (self.offset and " " .. offset or "")
end

--- Seconds since the first frame, as in Wireshark: `0.412`. Cut to milliseconds, as times of day are.
function Clock:since(time)
  return format("%.3f", floor((time - (self.first or times.new(-self.base, 0))) / 1000000) / 1000)
end

--- The time of day, or the seconds since the first frame where none is known: `0.412 s`.
function Clock:moment(time)
  return self:at(time) or self:since(time) .. " s"
end

--- When the capture was taken; nil where it has no frame.
function Clock:span(lang)
  if self.first == nil then return nil end
  local clock, date, offset = self:parts(self.first)
  if not self.known then
    self.zone = nil -- what no zone has
    clock, date = self:parts(self.first)
    return say(lang, "time_unknown", { start = date .. " " .. clock:sub(1, 8) })
  end
  local start = format("%s %s %s (%s)", date, clock, offset, self.zone or "UTC")
  local last = self.ended or self.last
  if last == nil or last < self.first then return say(lang, "time_first", { start = start }) end
  local told = { start = start, ["end"] = self:at(last), length = words.duration(last - self.first) }
  return say(lang, self.ended and "time_span" or "time_span_known", told)
end

return M
