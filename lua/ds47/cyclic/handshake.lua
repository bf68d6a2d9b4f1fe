-- Requests of PKW and what answers them: the words of both directions to transactions (docs/cyclic.md 4). One
-- channel at a time, fed with what changed in it; which bytes of which frame are a channel is not here.
--
-- A request stands until it is answered, an answer until the request changes. So an answer counts when it
-- changed after the request did: the answer to the request before it is still there, and may even be
-- allowed.
--
-- A job: request {data, at}, standing {data, at} (the answer when it began), began (false: it stood there
-- when the capture began), state, reason, answer {data, at}, settled (no edge told the answer), updates,
-- newest {data, at}, halves (frame), odd {data, at}, late (frame), ended (moment), heard (whether a frame
-- of the drive came while it stood), last (the moment in which it was looked at last), hole {first, last,
-- what} (where its response may be, though the capture has it not: frames are missing behind one and before
-- another; "cyclic_behind": it is in the first frame of the drive, `last`, behind that in which the request
-- ended; "ends": behind the end of the capture). A moment: {frame, time, cycle}.

local flat = require("ds47.support.flat").copy
local mapped = require("ds47.support.arrays").mapped
local tables = require("ds47.spec.tables")

local byte, char, floor, max, sub = string.byte, string.char, math.floor, math.max, string.sub

local M = {}

local ERROR, NO_RIGHTS = 7, 8
local NO_VALUE = "\0\0\0\0"
local WAITING = 16 -- jobs that wait for a frame of the drive; it says nothing any more where there are more
local UNNOTICED = 3 -- so many cycles may be missing, and nothing else shows it (channels.lua)

local Channel = {}
Channel.__index = Channel

--- A channel of PKW.
-- @param closed called with each job when its request ends, and of one without an answer the first frame of
--   the drive behind that is known; and with `owner`
-- @param owner nil, or whatever `closed` wants
-- @param fresh whether nothing was asked before the first words: they are those after a start-up
function M.new(closed, owner, fresh)
  return setmetatable({
    _closed = closed, _owner = owner, _echoes = true, _fresh = fresh or false,
    _slowest = 0, -- time that the slowest response took
    _newest = 0, -- the newest frame of the drive
    _over = {}, -- jobs that wait for the next one, in order
  }, Channel)
end

local function hole_of(first, last, what)
  return {first = first, last = last, what = what or "cyclic_frames"}
end

local function ak_of(data) return floor(byte(data) / 16) end

-- Without the toggle bit of spontaneous messages, which belongs to no request.
local function without_spm(data)
  local first = byte(data)
  if floor(first / 8) % 2 == 1 then first = first - 8 end
  return char(first) .. sub(data, 2, 8)
end

-- The parameter number on its page.
local function number(data)
  local high, low = byte(data, 1, 2)
  return high % 8 * 256 + low
end

local function access(data) return tables.pkw.requests[ak_of(data)].access end

local function is_refusal(data)
  local ak = ak_of(data)
  return ak == ERROR or ak == NO_RIGHTS
end

-- Whether an answer may be that of a request: its AK is allowed, and it names the same parameter.
local function fits(asked, data)
  local answer = ak_of(data)
  if is_refusal(data) then
    local kind = access(asked)
    if answer == NO_RIGHTS and kind ~= "change" and kind ~= "text" then return false end
    if number(data) == 0 then return true end -- Danfoss answers without the parameter
  elseif not tables.pkw.requests[ak_of(asked)].answers[answer] then
    return false
  end
  return number(asked) == number(data) and sub(asked, 3, 4) == sub(data, 3, 4)
end

local function cycles_between(first, last) return floor(last.cycle - first.cycle + 0.5) end

--- From the request to its answer in frames of one direction, and in the unit of the times; nil where no edge
-- told, and of the frames where somebody set the clock back meanwhile.
function M.duration(job)
  if not job.answer or job.settled or not job.began then return nil, nil end
  local cycles = cycles_between(job.request.at, job.answer.at)
  return cycles >= 0 and cycles or nil, job.answer.at.time - job.request.at.time
end

--- The time of that of the drive; nil where frames are missing right before its answer.
function M.reaction(job)
  local _, took = M.duration(job)
  return (not job.hole or job.hole.what == "ends") and took or nil
end

-- Whether words read as a request: AK, page and number are some that exist, and a read has no value.
local function is_request(data)
  local kind, index, page = access(data), byte(data, 3, 4)
  if kind ~= "read" and kind ~= "change" and kind ~= "count" then return false end
  if index % 4 > 0 and page % 4 > 0 then return false end -- no layout has such a page
  return number(data) > 0 and (kind == "change" or sub(data, 5) == NO_VALUE)
end

--- Whether a job that is over reads as a request, and a drive that said something did not respond, nor did
-- before.
function M.is_ignored(job)
  local asked, standing = job.request.data, job.standing
  local open = job.state == "unanswered" or job.state == "superseded"
  return job.heard and open and is_request(asked) and not (standing and fits(asked, standing.data))
end

--- The moment of the frame that ended a job, or of the last in which it was looked at.
function M.last_of(job) return job.ended or job.last or job.request.at end

--- Cycles from its first frame to that.
function M.stood(job) return cycles_between(job.request.at, M.last_of(job)) end

--- The request that stands, nil where there is none.
function Channel:open_job() return self._job end

--- The controller sends these eight bytes from now on; true where they are others than before.
function Channel:sent(bytes, at)
  local data, last = without_spm(bytes), self._out
  if last and last.data == data then
    if self._job then self._job.last = at end
    return false
  end
  self._out = {data = data, at = at}
  if self:_is_second_half(data, at) then return true end
  self._previous = last and last.data
  local wanted, job = ak_of(data) ~= 0, self._job
  local odd = job and job.odd == self._in and job.odd or nil
  if odd and wanted and fits(data, odd.data) and cycles_between(odd.at, at) <= UNNOTICED then
    job.hole = hole_of(job.request.at.frame, at.frame) -- this was sent before the answer to it
  end
  self:_end(at, not wanted)
  if wanted then
    self._job = {
      request = self._out, standing = self._in, began = last ~= nil or self._fresh, settled = false,
      updates = 0, moving = self._before ~= nil and self._before.updates > 0,
    }
  end
  self._fresh = false
  return true
end

--- The drive sends these eight bytes from now on.
function Channel:answered(bytes, at)
  local data, last, before = without_spm(bytes), self._in, self._newest
  local is_same = last ~= nil and last.data == data
  self._newest = at.frame
  if self._over[1] then self:_tell(not is_same and ak_of(data) > 0 and {data = data, at = at} or nil) end
  if is_same then return end
  self._in = {data = data, at = at}
  local job = self._job
  if not job or ak_of(data) == 0 then return end
  local asked = job.request.data
  if job.answer then
    self:_update(job)
  elseif self:_counts(job, data) then
    job.answer = self._in
    self._slowest = max(self._slowest, at.time - job.request.at.time)
    if job.hole and before >= job.hole.last then job.hole = nil end -- it did not stand there yet
    local changed = access(asked) == "change" and sub(asked, 5) ~= NO_VALUE
    if changed and sub(data, 5) == NO_VALUE then self._echoes = false end
  elseif self:_is_late(data) then
    job.late = at.frame
  elseif not fits(asked, data) then
    job.odd = job.odd or self._in
  end
end

--- Frames of the channel are missing between two frames; to be called before `answered` for the latter.
-- @param seen of a request that ended earlier, ns, a frame of the drive was seen behind its end
function Channel:skipped(first, last, seen)
  local hole, job = hole_of(first, last), self._job
  for _, each in ipairs(self._over) do
    if not (seen and each.ended and each.ended.time < seen) then each.hole = hole end
  end
  if job and not job.answer and job.request.at.frame <= first then job.hole = hole end
end

--- Data is not valid from now on: what is open stays without an answer, and nobody is to blame.
-- @param side "out" where it is that of the controller, "in" where that of the drive, nil for both; what the
--   other one says stands there as before
function Channel:lost(at, side)
  local job = self._job
  if job and not job.answer then
    self:_close(job, "unanswered", "io-lost", at)
  elseif job then
    self:_settle(job, at, "end")
  end
  self:_tell(nil)
  self._job, self._fresh = nil, false
  if side ~= "in" then self._out = nil end
  if side ~= "out" then self._in = nil end
end

--- The same channel as one that goes on alone, for another owner.
function Channel:apart(owner)
  local made = flat(self)
  made._owner, made._job, made._over = owner, self._job and flat(self._job), mapped(self._over, flat)
  return made
end

--- Nothing more comes; `within`: the capture ends, and to what was asked so shortly before, or no longer
-- before than the slowest response took, a response may come.
function Channel:finish(within)
  local job = self._job
  if job then
    local stood = (job.last or job.request.at).time - job.request.at.time
    if within and stood <= max(within, self._slowest) then job.hole = job.hole or {what = "ends"} end
    self:_settle(job, nil, "end")
  end
  self._job = nil
  self:_tell(nil)
end

function Channel:_end(at, withdrawn)
  if not self._job then return end
  self:_settle(self._job, at, withdrawn and "withdrawn" or nil)
  self._before, self._job = self._job, nil
end

-- The state of a job whose request ends; `reason` says why there is no answer, nil: another request came.
function Channel:_settle(job, at, reason)
  if not job.answer and self._in and self:_stands(job, self._in.data) then
    job.answer, job.settled = self._in, true
  end
  if job.answer then
    self:_close(job, is_refusal(job.answer.data) and "error" or "ok", nil, at)
  elseif job.odd then
    self:_close(job, "mismatch", nil, at)
  elseif not reason then
    self:_close(job, "superseded", nil, at)
  else
    self:_close(job, "unanswered", reason, at)
  end
end

function Channel:_close(job, state, reason, at)
  job.state, job.reason, job.ended = state, reason, at
  job.heard = self._in ~= nil and self._newest >= job.request.at.frame
  if not job.answer and job.hole and job.hole.last and job.last and job.last.frame > job.hole.last then
    job.hole = nil -- it stood there still, without a response
  end
  local over = self._over
  over[#over + 1] = job
  if job.answer and #over == 1 or #over > WAITING then self:_tell(nil) end
end

-- Tells of those that are over; `behind`: the first frame behind them, {data, at}, where it says something
-- new. A response that stands there may have stood in one before, which is missing.
function Channel:_tell(behind)
  local over = self._over
  self._over = {}
  for _, job in ipairs(over) do
    if not job.answer and job.reason ~= "io-lost" then
      if behind and job.ended and fits(job.request.data, behind.data) then
        job.hole = job.hole or hole_of(job.ended.frame, behind.at.frame, "cyclic_behind")
      end
      if job.hole then job.state = "incomplete" end
    end
    self._closed(job, self._owner)
  end
end

-- Whether a request goes on that was begun a cycle ago: first the parameter changed, then the value, or the
-- other way.
function Channel:_is_second_half(data, at)
  local job, old = self._job, self._previous
  if not job or job.answer or not old or access(data) ~= "change" then return false end
  local first = job.request.data
  local parameter_first = sub(first, 5) == sub(old, 5) and sub(first, 1, 4) == sub(data, 1, 4)
  local value_first = sub(first, 1, 4) == sub(old, 1, 4) and sub(first, 5) == sub(data, 5)
  if cycles_between(job.request.at, at) > 1 or not (parameter_first or value_first) then return false end
  job.halves, job.request = job.request.at.frame, {data = data, at = job.request.at}
  return true
end

-- Whether a changed answer is that of the open request, and not one before it that moved.
function Channel:_counts(job, data)
  local asked, standing = job.request.data, job.standing
  if not fits(asked, data) then return false end
  if access(asked) ~= "change" or is_refusal(data) or sub(data, 5) == sub(asked, 5) then return true end
  if job.moving and standing and sub(standing.data, 1, 4) == sub(data, 1, 4) then
    return false -- the value that was read goes on moving
  end
  return not self:_is_late(data) -- the read before it was not answered: this is what it asked for
end

-- Whether the answer that stands when a request ends may be its own, though no edge told it.
function Channel:_stands(job, data)
  if not fits(job.request.data, data) or is_refusal(data) then return false end
  if access(job.request.data) ~= "change" or job.moving or not self._echoes then return true end
  return sub(data, 5) == sub(job.request.data, 5)
end

function Channel:_is_late(data)
  local before = self._before
  return before ~= nil and not before.answer and fits(before.request.data, data)
end

-- The drive repeats an answer with the value of the moment.
function Channel:_update(job)
  if sub(self._in.data, 1, 4) == sub(job.answer.data, 1, 4) then
    job.updates, job.newest = job.updates + 1, self._in
  end
end

return M
