-- The time of the frame that is dissected, exact to the nanosecond.
--
-- Wireshark gives a script the time of a frame as a double, which is not exact, or as a field, which is, but
-- which makes two objects. So the field is asked for once, and the time since the first frame, as a double,
-- is added to that. Its nanoseconds are exact up to EXACT_SECONDS; where somebody sets another frame as the
-- reference of times, a gap shows, and the field is asked for again.

local times = require("ds47.support.times")

local floor = math.floor

local M = {}

local EXACT_SECONDS, SAME_SECONDS = 1e6, 1e-6

local field -- the extractor of frame.time_epoch
local has_window -- then somebody may set another frame as the reference of times
local here -- what Wireshark knows of this frame
local newest_ns -- a frame without a time has that of the frame before it
local origin -- seconds since 1970 to which relative times are added, not exact; nil before the first
local origin_ns -- the same as the analysis counts, exact

--- Tells where the exact time comes from: an extractor of frame.time_epoch; and whether there is a window.
function M.configure(extractor, window) field, has_window = extractor, window end

--- Forgets all times: another analysis counts from another second.
function M.reset() origin, newest_ns = nil, nil end

--- Tells which frame is dissected.
-- @param pinfo what Wireshark knows of it
function M.set(pinfo) here = pinfo end

--- Whether the time of this frame can be told: in the first of two passes there may be no fields.
function M.is_ready() return origin ~= nil or field() ~= nil end

local function exact(analysis, absolute, relative)
  local found = field()
  if found then
    local time = found.value
    newest_ns = analysis:time_ns(floor(time.secs), floor(time.nsecs))
    if times.is_near(newest_ns) then
      origin, origin_ns = absolute - relative, newest_ns - floor(relative * 1e9 + 0.5)
    end
  end
  return newest_ns or analysis:time_ns(0, 0)
end

-- Whether the time of the frame is not the time since the first one, or nothing was asked for before.
local function has_gap(relative)
  local gap = origin and here.abs_ts - relative - origin
  return not gap or gap > SAME_SECONDS or gap < -SAME_SECONDS
end

--- The time of the frame as an analysis counts it (Analysis:time_ns).
function M.now(analysis)
  local relative = here.rel_ts
  local doubtful = has_window or not origin or relative == 0 -- which a frame without a time has, too
  if relative > EXACT_SECONDS or relative < -EXACT_SECONDS or doubtful and has_gap(relative) then
    return exact(analysis, here.abs_ts, relative)
  end
  newest_ns = origin_ns + floor(relative * 1e9 + 0.5)
  return newest_ns
end

return M
