-- The time of the frame that is dissected, exact to the nanosecond.
--
-- Wireshark gives a script the time of a frame as a double, which is not exact, or as a field, which is, but
-- which makes two objects. So the field is asked for once, and the time since the first frame, as a double,
-- is added to that. Its nanoseconds are exact up to EXACT_SECONDS; where somebody sets another frame as the
-- reference of times, a gap shows, and the field is asked for again.

local tables = require("ds47.spec.tables")
local times = require("ds47.support.times")

local floor = math.floor

local M = {}

local EXACT_SECONDS, SAME_SECONDS = 1e6, 1e-6
local MOST = tables.limits.frame_times

local field -- the extractor of frame.time_epoch
local has_window -- then somebody may set another frame as the reference of times
local here, here_number -- what Wireshark knows of this frame, and its number
local newest_ns -- a frame without a time has that of the frame before it
local origin -- seconds since 1970 to which relative times are added, not exact; nil before the first
local origin_ns -- the same as the analysis counts, exact
local start_ns -- time of the first frame, before somebody set another one as the reference
local asked, count = {}, 0 -- the times that somebody asked for, by the numbers of the frames
local last_number, last_absolute, last_relative = 0 -- of the last frame, where a Listener hears of all

--- Tells where the exact time comes from: an extractor of frame.time_epoch; and whether there is a window.
function M.configure(extractor, window)
  field, has_window = extractor, window
end

--- Forgets all times: another analysis counts from another second.
function M.reset()
  origin, newest_ns, start_ns = nil, nil, nil
  asked, count = {}, 0
  last_number, last_absolute, last_relative = 0, nil, nil
end

--- Tells which frame is dissected.
-- @param pinfo what Wireshark knows of it
-- @param number the same as pinfo.number, which costs as much as all else here
function M.set(pinfo, number)
  here, here_number = pinfo, number
end

--- Whether the time of this frame can be told: in the first of two passes there may be no fields.
function M.is_ready()
  return origin ~= nil or field() ~= nil
end

local function exact(analysis, absolute, relative)
  local found = field()
  if found then
    local time = found.value
    newest_ns = analysis:time_ns(floor(time.secs), floor(time.nsecs))
    if times.is_near(newest_ns) then
      origin, origin_ns = absolute - relative, newest_ns - floor(relative * 1e9 + 0.5)
      start_ns = start_ns or origin_ns
    end
  end
  return newest_ns or analysis:time_ns(0, 0)
end

--- The time of the first frame as an analysis counts it; nil where nobody asked for a time yet.
function M.start()
  return start_ns
end

--- Tells of a frame, whatever it holds: a Listener that goes through all of them does.
-- @param pinfo what Wireshark knows of it
function M.passed(pinfo)
  local number = pinfo.number
  if number >= last_number then
    last_number, last_absolute, last_relative = number, pinfo.abs_ts, pinfo.rel_ts
  end
end

--- The time of the last frame as an analysis counts it; nil where nobody told of it, or not exactly.
function M.last()
  if not (origin and last_absolute) then
    return nil
  end
  local gap = last_absolute - last_relative - origin
  if math.abs(gap) > SAME_SECONDS or math.abs(last_relative) > EXACT_SECONDS then
    return nil
  end
  return origin_ns + floor(last_relative * 1e9 + 0.5)
end

--- The time of a frame that somebody asked for; nil of another one.
function M.of(number)
  return asked[number]
end

-- Whether the time of the frame is not the time since the first one, or nothing was asked for before.
local function has_gap(relative)
  local gap = origin and here.abs_ts - relative - origin
  return not gap or gap > SAME_SECONDS or gap < -SAME_SECONDS
end

--- The time of the frame as an analysis counts it (Analysis:time_ns).
function M.now(analysis)
  local relative, number = here.rel_ts, here_number
  local doubtful = has_window or not origin or relative == 0 -- which a frame without a time has, too
  local time
  if relative > EXACT_SECONDS or relative < -EXACT_SECONDS or doubtful and has_gap(relative) then
    time = exact(analysis, here.abs_ts, relative)
  else
    time = origin_ns + floor(relative * 1e9 + 0.5)
    newest_ns = time
  end
  if asked[number] == nil and count < MOST then
    count = count + 1
    asked[number] = time
  end
  return time
end

return M
