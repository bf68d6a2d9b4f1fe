-- Frames of a line in their order: which answer belongs to which request, and which request is a retry
-- (docs/profibus.md 6).
--
-- On a line one station asks at a time, and the answer follows at once. What is asked and answered is not
-- looked at.
--
-- What is seen is {frame, time_ns, item}, a frame as telegram.lua decoded it with its place in the capture.
-- An exchange is a request and what became of it:
--   request  what was seen of it
--   answer   the same; nil where none came, or nobody answers such a request
--   again    whether it repeats the exchange before: the master has no answer to that
--   silent   whether nobody answers such a request
--   hole     the newest request to its station before which an exchange was not seen: it has the FCB of the
--            one that was, and does not repeat that; 0 for none
--   due      whether its answer may still come: no token came behind it, nor a frame that the recording cut

local ALL_STATIONS = require("ds47.profibus.telegram").ALL_STATIONS
local tables = require("ds47.spec.tables")

local M = {}

local Line = {}
Line.__index = Line
M.Line = Line

--- Takes the frames of one line and gives their exchanges, each when it is over.
--
-- Damaged frames are none: a request behind whose answer was damaged stays without it. `unsure` is the last
-- frame behind which something may have been that was not seen: a damaged one, or an answer for which nobody
-- asked.
function Line.new()
  return setmetatable({
    open = nil, -- the exchange that waits for its answer
    last = nil, -- the bytes of the request before, where nothing but its answer stands behind it
    counted = {}, -- who asks whom -> the FCB of the newest request, where that counts
    before = nil, -- the bytes of the frame before,
    same = false, -- whether the frame has them, too,
    echo = false, -- and whether it is so the second of two, the fourth of four and so on
    answers = 0, -- how many there are,
    echoes = 0, -- and those that nobody asked for and that stand directly behind the same answer
    unsure = 0,
    holes = {}, -- station -> the newest request before which an exchange was not seen
    gone = {}, -- station -> the last frame before which something that was said with it was not seen
  }, Line)
end

-- A frame of which nothing is proved: it may be an answer, or a request that nobody knows then. One that the
-- recording cut is sound on the line: where no answer is due any more, it is a request.
local function damage(self, seen, cut)
  local open, short = self.open, false
  for _, flaw in ipairs(seen.item.flaws) do short = short or cut and flaw.kind == "cut" end
  self.unsure = seen.frame
  local station = seen.item.sa
  if seen.item.request then station = seen.item.da end
  if short and station then self.gone[station] = seen.frame end
  if not open then
    self.last = nil
  elseif short and open.due then
    open.due = false
  elseif short and not (self.echo and 0 < self.answers and self.answers <= 3 * self.echoes) then -- no copy
    self.last, self.open = nil, nil
    return open
  end
  return nil
end

--- A frame.
-- @param cut  whether the recording did not keep all of it
-- @return the exchange that is over with it, nil for none
function Line:take(seen, cut)
  local item = seen.item
  self.same = item.data == self.before
  self.echo = self.same and not self.echo
  self.before = item.data
  if item.flaws[1] then
    return damage(self, seen, cut)
  elseif item.kind == "SD4" then
    self.last = nil
    if self.open then self.open.due, self.open.gone_ns = false, seen.time_ns end
  elseif item.request then
    return self:_request(seen)
  else
    return self:_answer(seen)
  end
  return nil
end

function Line:_request(seen)
  local item, open = seen.item, self.open
  if open and open.request.item.data == item.data and (item.fcv == 1 or self.same) then
    open.due, open.retried, open.gone_ns = true, true, nil
    return nil
  end
  local row, key = tables.profibus.request[item.code], item.sa * 0x100 + item.da
  if item.da == ALL_STATIONS or row ~= nil and row.silent then -- the one before may be repeated behind it
    self.last = nil
    if open then open.due = false end
    return {request = seen, answer = nil, due = true, again = false, silent = true, hole = 0}
  end
  self.open = nil
  local last = self.counted[key]
  if open and open.request.item.fcv == 1 and not open.retried then
    self.gone[open.request.item.da] = seen.frame
  end
  local again = item.fcv == 1 and self.last == item.data
  if last and item.fcv == 1 and last == item.fcb and not again then
    self.gone[item.da], self.holes[item.da] = seen.frame, seen.frame
  end
  self.counted[key] = item.fcv == 1 and item.fcb or nil
  local exchange = {
    request = seen, answer = nil, due = true, again = again, silent = false, hole = self.holes[item.da] or 0,
  }
  self.last, self.open = item.data, exchange
  return open
end

-- Whether an answer is one to a request: SC names nobody, others have stations and SAPs turned round.
local function fits(request, answer)
  if answer.kind == "SC" then return true end
  if answer.sa ~= request.da or answer.da ~= request.sa then return false end
  return answer.ssap == request.dsap and answer.dsap == request.ssap or not answer.ssap and not answer.dsap
end

-- Whether an answer was sent behind a request and before the token went on; frames may be out of order.
local function in_time(asked, answer)
  return answer.time_ns >= asked.request.time_ns and not (asked.gone_ns and answer.time_ns >= asked.gone_ns)
end

function Line:_answer(seen)
  local over, item = self.open, seen.item
  self.answers = self.answers + 1
  if not over or not in_time(over, seen) or not fits(over.request.item, item) then
    if self.echo then self.echoes = self.echoes + 1 end
    self.unsure = seen.frame
    self.last = nil -- between the two was a request that was not seen: nothing repeats that before it
    return nil
  end
  self.open, over.answer = nil, seen
  return over
end

--- The last frame before which something that was said with a station was not seen; 0 for none.
-- A master repeats a request without an answer, and turns the FCB round with each new one.
function Line:lost(station) return self.gone[station] or 0 end

return M
