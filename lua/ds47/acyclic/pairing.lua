-- Pairing on the DS47 level: Writes and Reads of one channel to jobs (docs/pairing.md).
--
-- A job is a transaction in the making. Its life is the table `tables.phases`. This module only decides which
-- job a record call belongs to. It decodes nothing and judges nothing: judge.lua does that when the listener
-- hears `answered` and `closed`.

local kind_fits = require("ds47.profidrive.parameter").kind_fits
local flat = require("ds47.support.flat").copy
local take_from = require("ds47.support.arrays").take_out
local ordered = require("ds47.support.ordered")
local records = require("ds47.profinet.records")
local rpc = require("ds47.profinet.rpc")
local tables = require("ds47.spec.tables")

local M = {}

--- State conflict on a Read: the response is not ready, read again (docs/protocol.md E.1).
M.STATUS_NOT_READY = 0xDE80B500
--- Length error on a Read: the response is longer than the Read allows (docs/protocol.md E.1).
M.STATUS_SHORT = 0xDE80B100
--- State conflict on a Write: the device is still working on another request.
M.STATUS_IN_USE = 0xDF80B500

local ar_key, channel_key, know_peer = records.ar_key, records.channel_key, records.know_peer
local is_cut_before_status = records.is_cut_before_status
local STATUS_NOT_READY, STATUS_SHORT, STATUS_IN_USE = M.STATUS_NOT_READY, M.STATUS_SHORT, M.STATUS_IN_USE
local MOST_READS = tables.limits.reads
local PHASES = tables.phases
local KIND_END = 2 -- bytes of a message up to the end of its ID
local setmetatable = setmetatable

-- Jobs: the halves of the record calls of one transaction, and what pairing has found out about it.
-- The listener decodes `response`; `message` is nil for an orphan.

local Job = {}
Job.__index = Job
M.Job = Job

-- What a job has until it gets its own.
local NONE = {}
local NO_KEYS = ordered.new()
Job.write_refused = false -- whether the Write was answered with a negative status or an RPC fault
Job.polls = NONE -- Reads that left the job open: array of {request = half or nil, response = half}
Job.rereads = NONE -- the same
Job.empty_reads = NONE -- array of halves
Job.calls = NONE -- the findings about its calls (DS101, DS103, DS104, DS108): array of {rule, frame}
Job.reason = ""
Job.reread_cause = "" -- what led to the first re-read: a key of tables.diagnosis_words
-- Further: write_response, read_request, read_response, response, previous_reference, superseded_by; and
--   previous: frame of the previous captured request on its channel
--   superseding: the request that displaced this one; until it is closed
--   rival: the job that was open when this Write was refused with a state conflict; until it is closed
--   alone: true if this Write was refused with a state conflict although no request was open
--   refused_behind: a newer Write that was refused before the first Read: the Read may be for that one
--   repeats: frame of an earlier response that came again instead of a new one
--   between: the unanswered Write before the first re-read: the re-read may be for that Write
--   ended: frame that ended the connection while the request was open
--   limit: name of the limit that pushed it out: a response may still come
--   passed_over: true if it turned out, while this Write waited for its response, that no request is open
--     (P28)
--   contested: true if a record that went to an older request may be the response to this one (P72)
--   remarks: the findings about its response, until it is closed; the listener keeps them here
--   fetching: array of its Reads that have no response yet; nil for none
--   read_before: true if a missing or incomplete Read may have fetched the response earlier
--   uncounted: true for the first one on its channel, if another channel of its AR had its reference last
--   doubled_frame: frame of one of its calls with two responses: the client may have got either; nil for none
--   hasty: true if its Read came before its Write response, although its client usually waits
--   cut_frame: frame that the capture cut off before the request, or the outcome of a call, is known
--   rewritten_frame: frame of an accepted Write with the same request, sent while this one had no response
--   crossed: {first, last}, frames of two Writes, including this one, with responses in reverse order (P27)
--   missing: what the capture lacks, so that nobody knows the outcome: {what, first, last, numbers}
--     (completeness.lua, P73)
--   uncertain: true for an orphan if a limit may have pushed out its request

-- A job on a channel. A Write also has the reference and the frame of the request before it there.
local function new_job(self, channel, peer, record, message, previous_reference, previous)
  local order = self.count + 1
  self.count = order
  return setmetatable({
    peer = peer, -- {controller, device, vendor_id, device_id}
    record = record, message = message, phase = "asked", order = order, channel_key = message and channel.key,
    previous_reference = previous_reference, previous = previous,
    write_response = nil, -- a ninth: room for all that follow
  }, Job)
end

--- Notes a finding about a call of this job.
function Job:note_call(rule, frame)
  if self.calls == NONE then self.calls = {} end
  self.calls[math.min(#self.calls + 1, MOST_READS)] = {rule = rule, frame = frame}
end

--- A Read was sent for this job.
function Job:fetch(half)
  local fetching = self.fetching or {}
  fetching[#fetching + 1], self.fetching = half, fetching
end

--- A Read of this job is over.
function Job:fetched(half)
  local fetching = self.fetching
  if fetching then
    take_from(fetching, half)
    self.fetching = fetching[1] and fetching or nil
  end
end

--- The half of the Write request; nil for an orphan.
function Job:write_request() return self.message and self.record.request end

--- Whether the capture shows the answer to the Write.
function Job:write_told()
  return self.write_response ~= nil and not is_cut_before_status(self.write_response)
end

local function polls_with(job, status)
  local reads = {}
  for _, read in ipairs(job.polls) do reads[#reads + 1] = read.response.status == status and read or nil end
  return reads
end

--- The Reads that came before the response was ready.
function Job:not_ready() return polls_with(self, STATUS_NOT_READY) end

--- The Reads that asked for fewer bytes than the response has.
function Job:too_short() return polls_with(self, STATUS_SHORT) end

--- The request reference; nil if it is unknown.
function Job:reference() return self.message and self.message.request_reference end

-- Keys

-- The key of a place on a device, for any controller and AR.
local function place_key(peer, record) return record.api .. record.spot .. peer.device end

-- Small things

local function read_event(half)
  local status = half.status
  if status == STATUS_NOT_READY then return "read_poll" end
  if status == STATUS_SHORT then return "read_short" end
  if status ~= nil and status ~= 0 then return "read_refused" end
  if half.data ~= "" then return "read_record" end
  return half.cut and "read_cut" or "read_empty"
end

-- Whether the capture cut off the record so early that the kind of response is unknown.
local function is_headless(half) return half.cut and (half.status or 0) == 0 and #half.data < KIND_END end

-- The newest unanswered Write, if a Read may be for it: no later one was accepted. nil for none.
local function waiting_of(channel)
  local newest = channel.asked[#channel.asked]
  return newest and not newest.passed_over and newest.order > channel.accepted and newest or nil
end

-- No request is open: a Read no longer counts as the answer to a Write that waits for its response.
local function pass_over(channel)
  for _, job in ipairs(channel.asked) do job.passed_over = true end
end

-- The bytes that were read last; nil without a job or a response.
local function bytes(job) return job and job.read_response and job.read_response.data end

-- Whether two records have the same captured bytes, and lack equally many.
local function is_same(one, other) return one.data == other.data and one.missing == other.missing end

-- Whether a record repeats the last one of its channel, which may have been read only in part.
local function is_last(channel, half)
  local last = channel.last and channel.last.read_response
  local before = last and last.data or ""
  if before == "" then return false end
  return last.cut and is_same(last, half) or not last.cut and half.data:sub(1, #before) == before
end

-- Keeps a Read of a job; beyond MOST_READS the newest replaces the last one kept.
local function keep(job, name, read)
  local reads = job[name]
  if reads == NONE then
    reads = {}
    job[name] = reads
  end
  local count = #reads
  reads[count < MOST_READS and count + 1 or count] = read
end

-- Pairing

local Pairing = {}
Pairing.__index = Pairing

--- Takes record calls in the order of the capture and keeps the jobs of every channel.
-- @param limits    the numbers of tables.limits
-- @param listener  hears `asked(job)` for each Write request; `refused(job)` when a Write was refused;
--   `connected(device, frame)` for each Connect; `answered(job)`, once, when a job has its response;
--   `closed(job)`, once, when nothing more can come; `late(job)` before a Write response changes a closed
--   one; `nothing_to_read(peer, record, missing)` for a Read that brought no record, with no request open
-- @param completeness  knows what the capture lacks; nil: it lacks nothing
function M.new(limits, listener, completeness)
  return setmetatable({
    completeness = completeness, limits = limits, expiry_ns = limits.transaction_expiry_ns,
    listener = listener,
    channels = ordered.new(), -- channel key -> channel, the one that was touched last is last
    of_ar = {}, -- AR key -> its channel keys, in the order of first sight
    of_place = {}, -- place -> its channel keys for any controller and AR, in the order of first sight
    delivered = ordered.new(), -- place -> its newest accepted request that got its response, for any AR
    connects = ordered.new(), -- AR key -> its newest Connect, {frame, time_ns}
    starts = ordered.new(), -- PROFIBUS station -> when it last got its parameters, {frame, time_ns}
    connected_ars = ordered.new(), -- controller and device -> the newest AR of cyclic data
    unanswered = ordered.new(), -- order of a Write in `asked` of any channel -> its job
    replaced = {}, -- key of an AR with open requests that a Connect seems to have replaced -> the Connect
    any_replaced = false, -- whether there may be one: rare, but every record asks for it
    forgot_requests = false, -- whether a limit pushed out requests whose responses may still come
    count = 0,
    -- The jobs that the last step of the caller touched in `frame`, not in the frames of messages that waited
    -- for a proof of their AR. The caller sets `frame`, and the count to 0, before each step.
    frame = nil, touched_count = 0, touched_jobs = {}, touched_roles = {},
  }, Pairing)
end

-- For `Analysis:touched`. The arrays are reused, so that a frame creates no garbage.
local function touch(self, job, role, half)
  if half.frame == self.frame then
    local count = self.touched_count + 1
    self.touched_count = count
    self.touched_jobs[count], self.touched_roles[count] = job, role
  end
end

-- A job that lacks something shows the Read that was sent for it.
local function tell_read(job)
  if job.missing and job.fetching and job.read_request == nil then job.read_request = job.fetching[1] end
end

local function end_job(self, job, event)
  tell_read(job)
  job.phase = PHASES[job.phase][event]
  self.listener:closed(job)
  if job.rival or job.refused_behind or job.between then -- or a closed job would keep all that came after it
    job.rival, job.refused_behind, job.between = nil, nil, nil
  end
end

-- The Connect that set up the AR of a request again, {frame, time_ns}; nil if there is none, or none `before`
-- another request. If an AR proves itself late, its Connects are known before its requests.
local function connected_since(self, job, before)
  local asked = job:write_request()
  local key = ar_key(job.peer, job.record)
  local connect = asked and (self.replaced[key] or self.connects:get(key))
  if connect and connect.frame > asked.frame and not (before and connect.frame > before.frame) then
    return connect.frame
  end
  return nil
end

-- What is not in the capture (P73)

-- What may be missing of the controller's calls after a frame.
local function missing_after(self, peer, frame, lost, in_order)
  if not self.completeness then return nil end
  if peer.station then
    return self.completeness.lost_on_line(peer.station) > frame and {what = "line"} or nil
  end
  return self.completeness:missing_after(peer.controller, peer.device, frame, lost, in_order)
end

-- Whether the client usually waits, so that a response after its next call is a second copy.
local function waits(self, peer)
  local known = self.completeness
  return known and known:waits(peer.controller, peer.device)
end

--- Whether a call of a controller to a device may be missing after a frame.
function Pairing:may_lack(peer, frame) return missing_after(self, peer, frame) ~= nil end

-- What may be missing of the requests on a channel after a frame; 0: from before the capture.
local function requests_missing_after(self, peer, channel, since, in_order)
  if channel.unseen_frame > since then return {what = "requests"} end
  return since == 0 and {what = "begins"} or missing_after(self, peer, since, nil, in_order)
end

-- The newest frame before a Read at which nothing was open on a channel; 0 if none is known. The newest
-- Connect may be after the Read, if the AR proves itself late. It does not count then.
local function idle_since(self, channel, read)
  local connect = self.connects:get(channel.ar_key)
  return math.max(channel.ended_frame, connect and connect.frame < read.frame and connect.frame or 0)
end

-- Which missing request may be open on a channel, if the capture shows none (P78).
-- A program goes on reading after a Connect what it asked for before.
local function may_be_open(self, peer, channel, half)
  local since = channel.sought_frame > 0 and channel.sought_frame or idle_since(self, channel, half)
  local missing = requests_missing_after(self, peer, channel, since)
  for key in self.of_place[channel.place]:newest_first(self.limits.users) do
    local unseen = self.channels:get(key).unseen_frame > channel.ended_frame -- whoever asked there
    missing = missing or unseen and {what = "requests"} or nil
  end
  return missing
end

-- Whether the controller's calls end so soon after a request that its Read may still come.
local function ends_soon(self, peer, asked, newest_ns)
  if not peer.station and self.completeness then
    newest_ns = self.completeness:spoke_ns(peer.controller, peer.device)
  end
  return newest_ns == nil or newest_ns - asked.time_ns < self.limits.unread_ns
end

-- Why a request is over without its response -> the key of what the capture lacks.
local ENDS = {["end"] = "ends", expired = "unseen", later = "later", unseen = "unseen"}

-- The capture lacks the answer to a Write, or has cut it off.
local function unanswered(job, asked)
  local half = job.write_response
  return half and {what = "cut_off", first = half.frame} or {what = "write_answer", first = asked.frame}
end

-- Which call of a job, or which half of one, may be missing; PROFIBUS has no calls.
local function lacks_calls(self, job, asked, lost)
  if job.peer.station then return missing_after(self, job.peer, asked.frame) end
  if job.rewritten_frame then
    return {what = "written_again", first = asked.frame, last = job.rewritten_frame}
  end
  if job.crossed then return {what = "crossed", first = job.crossed.first, last = job.crossed.last} end
  if job.doubled_frame then return {what = "twice", first = job.doubled_frame} end
  if job.cut_frame then return {what = "cut_off", first = job.cut_frame} end
  if job.fetching and not job.limit then return {what = "read_answer", first = job.fetching[1].frame} end
  local found = missing_after(self, job.peer, asked.frame, lost)
  if found == nil and not (job:write_told() or job.limit) then return unanswered(job, asked) end
  return found
end

-- What the capture lacks, so that nobody knows whether the response of a job came; nil for nothing.
-- @param newest_ns, lost  at the end of the capture: its time, and whether a call is open
local function lacks(self, job, reason, newest_ns, lost)
  local asked = job:write_request()
  if asked == nil or job.read_response or job.write_refused then return nil end
  local found = lacks_calls(self, job, asked, lost)
  if found or job.limit then
    return found
  elseif (reason == "end" or reason == "expired")
    and (job.ended or not ends_soon(self, job.peer, asked, newest_ns)) then
    return nil
  end
  return ENDS[reason] and {what = ENDS[reason]} or nil
end

-- If a Read was too short and no later one brought the response, that refusal is the answer (P34).
-- @param lost  as for `lacks`
local function refused_at_last(self, job, lost)
  local short = job.read_response == nil and job.polls[1] and job:too_short() or NONE
  local last, asked = short[#short], job:write_request()
  local missing = last and asked and lacks_calls(self, job, asked, lost)
  if last and asked and (missing == nil or missing.what == "write_answer") then -- else it may have been read
    take_from(job.polls, last)
    job.read_request, job.read_response = last.request, last.response
  end
end

-- `at` is what ended its connection, {frame, time_ns}; nil where nothing is known of that.
local function close(self, job, reason, at)
  if at then job.ended = at.frame end
  if not job.missing then refused_at_last(self, job) end
  if reason ~= "" then job.reason = reason end
  if job.read_response == nil then
    if not at then job.ended = connected_since(self, job) end
    job.missing = job.missing or lacks(self, job, reason)
  end
  end_job(self, job, "lost")
end

-- Closes the last answered job: a missing one came after it, or the next record may be for either.
local function forget_last(self, channel)
  if channel.last then
    close(self, channel.last, "")
    channel.last = nil
  end
end

-- The Read was not for the refused Write: no later Read is either.
local function leave_refused(self, channel)
  close(self, channel.refused, "")
  channel.refused = nil
end

local function no_longer_asked(self, channel, job)
  take_from(channel.asked, job)
  self.unanswered:pop(job.order)
end

-- A limit closes a job: its response may still come.
local function push_out(self, job, limit)
  if job.read_response == nil and not job.write_refused then
    job.limit, self.forgot_requests = limit, true
  end
  close(self, job, "")
end

local function push_out_asked(self, job, limit)
  no_longer_asked(self, self.channels.values[job.channel_key], job)
  push_out(self, job, limit)
end

-- Indices of channels: a name -> the keys of its channels, in the order of first sight.

local function put_in(index, name, key)
  local keys = index[name]
  if keys == nil then
    keys = ordered.new()
    index[name] = keys
  end
  keys:set(key, true)
end

local function take_out(index, name, key)
  local keys = index[name]
  keys:pop(key)
  if keys.length == 0 then index[name] = nil end
end

-- Whether a Write without its response may have displaced the accepted request.
local function may_be_displaced(channel)
  local newest = channel.asked[#channel.asked]
  return channel.open ~= nil and newest ~= nil and channel.open.order < newest.order
end

-- Job -> why it has no response, for jobs whose channel went on before the capture ended.
local function at_the_end(channel)
  local why, newest = {}, channel.asked[#channel.asked]
  for _, job in ipairs(channel.asked) do why[job] = job ~= newest and "unseen" or nil end
  if newest == nil then return why end
  local asked = newest.record.request
  if newest.order < channel.accepted or asked and channel.heard_frame > asked.frame then
    why[newest] = "unseen"
  end
  if may_be_displaced(channel) then why[channel.open] = "later" end
  return why
end

-- What is not closed on a channel, in the order in which it is when nothing more comes.
local function jobs_of(channel)
  local jobs = {}
  jobs[#jobs + 1] = channel.last
  jobs[#jobs + 1] = channel.refused
  jobs[#jobs + 1] = channel.open
  for _, job in ipairs(channel.asked) do jobs[#jobs + 1] = job end
  return jobs
end

local function close_channel(self, channel, reason, at, limit)
  take_out(self.of_ar, channel.ar_key, channel.key)
  take_out(self.of_place, channel.place, channel.key)
  self.channels:pop(channel.key)
  for _, job in ipairs(channel.asked) do self.unanswered:pop(job.order) end
  for _, job in ipairs(jobs_of(channel)) do
    if limit then
      push_out(self, job, limit)
    else
      close(self, job, job == channel.open and may_be_displaced(channel) and "later" or reason, at)
    end
  end
  if self.of_ar[channel.ar_key] == nil then self.replaced[channel.ar_key] = nil end
end

local function new_channel(self, key, peer, record)
  local of_ar = ar_key(peer, record)
  local channel = {
    key = key,
    ar_key = of_ar,
    place = place_key(peer, record),
    index = record.index,
    touched = nil, -- time of the newest call
    asked = {}, -- Writes without a Write response, oldest first
    open = nil, -- the accepted request that nothing was read for
    refused = nil, -- the latest refused Write, until something is read
    last = nil, -- the job that was answered last
    reference = nil, -- that of the newest Write,
    written_frame = nil, -- and its frame
    accepted = 0, -- `order` of the newest Write that was accepted
    heard_frame = 0, -- frame of the newest record that was read
    unasked_frame = 0, -- frame of the newest Write response without a captured request
    unseen_frame = 0, -- the same, but only for an accepted Write: it displaced what was open
    ended_frame = 0, -- frame of the newest Read response that ended a known request, or found none open
    sought_frame = 0, -- frame of its request, or of the response if that is missing
    aside = nil, -- why the open request was set aside, until another was accepted
  }
  self.channels:set(key, channel)
  put_in(self.of_ar, of_ar, key)
  put_in(self.of_place, channel.place, key)
  return channel
end

local function goes_on(self, ar)
  local replaced = self.replaced
  replaced[ar] = nil
  self.any_replaced = next(replaced) ~= nil
end

local function channel_of(self, peer, record, now)
  local place = record.place
  if place.peer ~= peer then know_peer(place, peer) end
  local key = place.channel_key
  if self.any_replaced then goes_on(self, place.ar_key) end
  local channels, expiry = self.channels, self.expiry_ns
  local channel = channels.values[key]
  if channel ~= nil and now - channel.touched > expiry then
    close_channel(self, channel, "expired")
    channel = nil
  end
  channel = channel or new_channel(self, key, peer, record)
  channel.touched = now
  if channels.newest ~= key then channels:move_to_end(key) end
  while true do
    local oldest_key = channels.oldest
    if oldest_key == key then return channel end
    local oldest = channels.values[oldest_key]
    local old = now - oldest.touched > expiry
    if not old and channels.length <= self.limits.channels then return channel end
    close_channel(self, oldest, "expired", nil, not old and "channels" or nil)
  end
end

--- The number of the next transaction, in the order in which they begin.
function Pairing:number()
  self.count = self.count + 1
  return self.count
end

-- An accepted Write displaces a request without a response; that response may also be missing. A Read after
-- that Write is for it. After a Connect, it displaces nothing: the AR is new.
local function displace(self, channel, by)
  local job, asked = channel.open, by.record.request
  local reads = asked and job.fetching or NONE
  if asked then job.fetching = nil end
  for _, sent in ipairs(reads) do
    local whose = sent.frame < asked.frame and job or by
    whose:fetch(sent)
  end
  refused_at_last(self, job)
  if job.read_response or connected_since(self, job, asked) then
    close(self, job, may_be_displaced(channel) and "later" or "release")
    return
  end
  job.missing = lacks(self, job, "")
  if job.missing == nil then
    job.superseded_by = asked and asked.frame
    job.superseding = by
  end
  end_job(self, job, "displaced")
  job.superseding = nil -- for the same reason as in end_job
end

-- An accepted Write replaces older unanswered ones with the same request.
local function written_again(channel, job)
  local by = job:write_request()
  for _, each in ipairs(channel.asked) do
    if by and each.order < job.order and each:write_request().data == by.data then
      each.rewritten_frame = by.frame
    end
  end
end

-- An accepted Write opens its job. It displaces the open job, and closes the refused one.
local function accept(self, channel, job)
  if job.order > channel.accepted then channel.accepted = job.order end
  if job.phase == "asked" then
    no_longer_asked(self, channel, job)
    if job:write_told() then written_again(channel, job) end
    local open = channel.open
    if open then displace(self, channel, job) end
    if channel.refused then leave_refused(self, channel) end
    channel.open, channel.aside = job, nil
  end
  job.phase = PHASES[job.phase].write_accepted
end

-- Whether a later Write is open already: nobody knows which one the device executed last (P27).
local function cross(channel, job)
  local open, newer = channel.open, channel.last
  if open and open.order > job.order then newer = open end
  local other = newer and newer.order > job.order and newer:write_request()
  if job.phase ~= "asked" or not other then return false end
  job.crossed = {first = job:write_request().frame, last = other.frame}
  newer.crossed = job.crossed
  return newer == open
end

-- The newest other request at the place of a job, for any controller and AR, if it surely was open when the
-- Write of the job came, or came later itself; nil for none. Sure means: it was accepted, no Connect of its
-- AR ended it, and no pending Read may fetch its response. Also whether surely none is open there (P78).
local function rival_of(self, channel, job)
  local keys, found, came = self.of_place[channel.place], nil, job:write_request()
  for key in keys:newest_first(self.limits.users) do
    local held = self.channels:get(key).open
    local newer = held and held ~= job and (found == nil or held.order > found.order)
    if newer and not connected_since(self, held, came) then found = held end
  end
  local asked = found and found:write_request()
  if asked == nil then
    return nil, channel.ended_frame < came.frame and may_be_open(self, job.peer, channel, came) == nil
  elseif missing_after(self, found.peer, asked.frame) or missing_after(self, job.peer, asked.frame) then
    return nil
  end
  local fetched = found.fetching and found.fetching[1].frame < came.frame
  local sure = found:write_told() and not (fetched or found.doubled_frame)
  return (sure or asked.frame > came.frame) and found or nil
end

local function refuse(self, channel, job)
  local before, half = job.phase, job.write_response
  if half and half.status == STATUS_IN_USE then job.rival, job.alone = rival_of(self, channel, job) end
  job.phase = PHASES[before].write_refused
  if before == "answered" then return end
  if before == "asked" then
    no_longer_asked(self, channel, job)
  else
    channel.open = nil
  end
  if channel.refused then leave_refused(self, channel) end
  channel.refused = job
end

-- Unanswered Writes newer than the open request, newest first; the record mirrors all or none of them.
local function newer_than(open, channel, reference)
  local asked, newer, mirrored = channel.asked, {}, open:reference() == reference
  for place = #asked, 1, -1 do
    local job = asked[place]
    if job.order > open.order and not job.passed_over and (job:reference() == reference) == mirrored then
      newer[#newer + 1] = job
    end
  end
  return newer, mirrored
end

-- The job of a record if its reference does not decide: the open one, or a newer Write (P71, P72). A newer
-- Write gets it if the kind of the record fits that, and does not fit the open request. If the kind does not
-- decide for the open request either, the newer Writes are contested.
local function by_kind(channel, open, record)
  local read, half = record.request, record.response
  local data = half.data
  local newer, mirrored = newer_than(open, channel, data:byte(1))
  if not mirrored and is_last(channel, half) then return open end -- the last answer again
  local of_open = kind_fits(open.message, data)
  for _, job in ipairs(of_open == false and newer or NONE) do
    if kind_fits(job.message, data) and (read == nil or read.frame > job:write_request().frame) then
      return job
    end
  end
  for _, job in ipairs(newer) do
    job.contested = job.contested or not of_open or kind_fits(job.message, data) ~= false or nil
  end
  return open
end

-- Whether a record may be for the Write that it mirrors. If a later Write was accepted, it must also have the
-- right kind, and not repeat the last record.
local function may_be(channel, job, half)
  return job.order > channel.accepted or kind_fits(job.message, half.data) and not is_last(channel, half)
end

-- Whether the Write of a job was sent after the request of a Read, in the file and by the clock.
local function is_later(job, record)
  local asked, sent, before = job:write_request(), record.request, record.asked_before
  if asked == nil then return false end
  if sent == nil then return before ~= nil and before <= asked.frame end
  return asked.frame > sent.frame and asked.time_ns >= sent.time_ns
end

-- Whether a record has the reference and the kind of a request.
local function mirrors(job, data)
  return data ~= "" and job:reference() == data:byte(1) and kind_fits(job.message, data) ~= false
end

-- The job that a Read answers. An unanswered Write counts if the record fits it.
local function addressee(channel, event, record)
  local open, asked = channel.open, channel.asked
  if open and not asked[1] then return open end -- nothing else waits
  local half = record.response
  local data = half.data
  local reference = data:byte(1)
  if event == "read_record" and not (open and open:reference() == reference) then
    local mirrored
    for place = #asked, 1, -1 do -- the newest one with the kind of the record, if there are several
      local job = asked[place]
      if job:reference() == reference and not (job.passed_over or is_later(job, record))
        and may_be(channel, job, half) then
        if mirrors(job, data) then return job end
        mirrored = mirrored or job
      end
    end
    if mirrored then return mirrored end
  end
  if open then return event == "read_record" and asked[1] and by_kind(channel, open, record) or open end
  local waiting = waiting_of(channel)
  if waiting then
    if event == "read_record" and (is_last(channel, half) or not mirrors(waiting, data)) then
      return nil -- the last answer again
    end
    return waiting
  end
  return channel.refused
end

-- Whether a missing Read may have fetched the record earlier, so that the waiting time is unknown. The
-- missing call may also be a repetition of the request: then that one waited.
local function may_be_read(self, job)
  local asked = (job.polls[1] or job.fetching) and job:write_request()
  return asked and (job.fetching or missing_after(self, job.peer, asked.frame)) ~= nil or nil
end

-- A Read ends a job: it brings the record, or it is refused.
local function answer(self, channel, job, record)
  local half = record.response
  job.read_request, job.read_response = record.request, half
  job.read_before = may_be_read(self, job)
  if job.message then -- anything may be missing before an orphan
    channel.ended_frame, channel.sought_frame = half.frame, (record.request or half).frame
    if is_headless(half) and not job.write_refused then
      job.missing = {what = "cut_off", first = half.frame}
    end
  end
  if channel.open == job then channel.open = nil end
  if channel.refused == job then channel.refused = nil end
  self.listener:answered(job)
  if half.data == "" then
    close(self, job, "")
    if not job.write_refused then
      forget_last(self, channel) -- the next record may be for either
    end
    return
  end
  if channel.last then end_job(self, channel.last, "lost") end -- it has its response
  channel.last = job
  if job.message and not job.write_refused then
    self.delivered:keep(channel.place, job, self.limits.channels)
  end
end

-- Whether the answer to a refused request repeats the last one. An unanswered Write proves nothing: two
-- questions may have the same answer.
local function compare(self, last, job, half)
  local read = last and last.read_response
  if read and is_same(read, half) and missing_after(self, job.peer, read.frame) == nil then
    job.repeats = read.frame
  end
end

-- The record proves that the Write was accepted; the Write response is missing. The Write does not displace a
-- newer one: then the record came late.
local function presume(self, channel, job)
  if channel.open and channel.open.order > job.order then
    no_longer_asked(self, channel, job)
    job.phase = PHASES[job.phase].write_accepted
  else
    accept(self, channel, job)
  end
end

-- Ends a job with an unknown outcome.
local function set_aside(self, channel, job, missing)
  if channel.open == job then
    channel.open = nil
  elseif channel.refused == job then
    channel.refused = nil
  else
    no_longer_asked(self, channel, job)
  end
  if not (job.read_response or job.write_refused) then job.missing = missing end
  close(self, job, "")
end

local function read(self, channel, job, event, record)
  local half, phase, told, sent = record.response, job.phase, job.write_response, record.request
  if told and sent and sent.frame < told.frame then job.hasty = waits(self, job.peer) end
  if phase == "refused" and event == "read_record" then
    compare(self, channel.last, job, half)
  elseif phase == "asked" and event == "read_cut" then
    no_longer_asked(self, channel, job) -- accepted or not: the status is cut off, too
    channel.accepted = math.max(channel.accepted, job.order) -- no older Write waits any more
  elseif phase == "asked" and event ~= "read_empty" and event ~= "read_short" then
    presume(self, channel, job)
  end
  job.phase = PHASES[job.phase][event]
  if event == "read_poll" or event == "read_short" then
    keep(job, "polls", {request = record.request, response = half})
    touch(self, job, "poll", half)
  elseif event == "read_empty" then
    if half.status ~= nil then keep(job, "empty_reads", half) end
    touch(self, job, "empty_read", half)
  else
    touch(self, job, "read_response", half)
    answer(self, channel, job, record)
  end
end

-- The last response of a place, if a record has its bytes and came behind it, else nil: it may have waited.
local function repeated(self, place, half)
  local delivered = self.delivered:get(place)
  local before = delivered and delivered.read_response
  return before and half.frame > before.frame and is_same(before, half) and delivered or nil
end

-- The job with the response that a Read without a request may repeat: the last of the channel, for a
-- ReadImplicit the last of the place, for any controller and AR.
local function last_response(self, channel, record)
  local last, half = channel.last, record.response
  local delivered = record.implicit and repeated(self, channel.place, half)
  if not delivered then return last end
  return delivered.phase == "closed" and bytes(last) == half.data and last or delivered
end

--- Whether a ReadImplicit repeats the last response of its place (P55). Changes nothing.
function Pairing:is_again(peer, record)
  return record.implicit and repeated(self, place_key(peer, record), record.response) ~= nil
end

-- Whether a Read was sent before the response to the last request that was answered.
local function was_open(channel, record)
  local got, sent = channel.last and channel.last.read_response, record.request
  if sent == nil then return record.asked_before and record.asked_before <= channel.sought_frame end
  return sent and got and sent.frame < got.frame and sent.time_ns < got.time_ns
end

local function reread(self, channel, job, record)
  job.phase = PHASES[job.phase].reread
  if not job.rereads[1] and not was_open(channel, record) then
    job.between = waiting_of(channel)
    local written = math.max(channel.written_frame or 0, channel.unasked_frame)
    local unaccepted = written > job.read_response.frame and "again_unaccepted"
    job.reread_cause = record.implicit and "again_without_ar" or unaccepted or "again"
  end
  keep(job, "rereads", {request = record.request, response = record.response})
  touch(self, job, "reread", record.response)
end

-- Whether another channel of its AR had a reference last, where a channel has none yet.
local function is_uncounted(self, channel, reference)
  for key in (channel.written_frame and NO_KEYS or self.of_ar[channel.ar_key]):iterate() do
    if self.channels:get(key).reference == reference then return true end
  end
  return nil
end

--- Takes a Write request. Returns its job, for `write_response`.
function Pairing:write_request(peer, record, message)
  local channel = channel_of(self, peer, record, record.request.time_ns)
  local missing = channel.written_frame and missing_after(self, peer, channel.written_frame)
  local known = not missing or missing.what == "one_direction" -- the request before it
  local reference = known and channel.reference or nil
  local job = new_job(self, channel, peer, record, message, reference, channel.written_frame)
  local asked, half = channel.asked, record.request
  local count = #asked + 1
  job.uncounted = is_uncounted(self, channel, message.request_reference)
  job.cut_frame = half.cut and message.request_id == nil and half.frame or nil
  asked[count] = job
  channel.reference, channel.written_frame = message.request_reference, half.frame
  touch(self, job, "write_request", half)
  self.listener:asked(job)
  self.unanswered:set(job.order, job)
  if count > self.limits.pending_writes then push_out_asked(self, asked[1], "pending_writes") end
  if self.unanswered.length > self.limits.unanswered_writes then
    local _, oldest = self.unanswered:first()
    push_out_asked(self, oldest, "unanswered_writes")
  end
  return job
end

-- Whether a Read was sent after the Write of a job, and before its response, in the file and by the clock.
-- While an older request is open, the Read is taken for one of that.
local function is_read_before(open, job, response)
  local asked = job:write_request()
  for _, each in ipairs({job, asked and open and open.order < job.order and open or nil}) do
    local after = each == open and asked.frame or 0
    local function is_before(sent)
      return sent and sent.frame > after and sent.time_ns < response.time_ns
    end
    for _, sent in ipairs(each.fetching or NONE) do
      if is_before(sent) then return true end
    end
    for _, poll in ipairs(each.polls) do
      if is_before(poll.request) then return true end
    end
    if each == job and is_before(job.read_request) then return true end
  end
  return false
end

--- The answer to a Write: accepted (status 0), refused (any other status, or an RPC fault).
-- @param response  the half; may be nil
function Pairing:write_response(job, response, fault)
  if job.phase == "closed" then self.listener:late(job) end
  local asked, channel = job.record.request, self.channels.values[job.channel_key]
  local open = channel and channel.open
  local reads = open or job.fetching or job.read_request or job.polls[1]
  if response and reads and is_read_before(open, job, response) then job.hasty = waits(self, job.peer) end
  if job.hasty and (fault or response and response.status ~= 0) then
    job.doubled_frame = asked and asked.frame
    return -- the client got another response before, and the device has executed the call twice
  end
  job.write_response = response
  local status = response and response.status
  job.write_refused = fault or (status ~= nil and status ~= 0)
  if response then
    touch(self, job, "write_response", response)
    job.cut_frame = is_cut_before_status(response) and response.frame or job.cut_frame
  end
  if channel == nil or job.phase == "closed" or (status == nil and not fault) then return end
  if self.any_replaced then goes_on(self, channel.ar_key) end
  if status == 0 and not fault then
    if not cross(channel, job) then accept(self, channel, job) end
  else
    refuse(self, channel, job)
    if job.phase == "refused" then self.listener:refused(job) end
  end
end

--- The answer to a Write without its request in the capture. If it was accepted, its request is unknown: any
--- later record may be its response, even with the bytes of an earlier one.
function Pairing:write_unasked(peer, record)
  local half = record.response
  if half == nil then return end
  local channel = channel_of(self, peer, record, half.time_ns)
  channel.unasked_frame = half.frame
  local expiry = tables.limits.call_expiry_ns
  for _, job in ipairs(channel.asked) do
    if half.time_ns - job.record.request.time_ns > expiry then
      return -- the request may be there, and its call was given up before
    end
  end
  if channel.refused then leave_refused(self, channel) end
  if half.status ~= 0 and not is_cut_before_status(half) then return end
  channel.unseen_frame = half.frame
  pass_over(channel)
  forget_last(self, channel)
end

-- Whether a program seems to count its references: one more than before, or two, to skip 0. So does the first
-- request on a channel, unless it was refused, a call of it is incomplete, or another channel had its
-- reference last. A filtered capture may have no other request, but its calls are whole.
local function counts(job, record)
  local before, now = job.previous_reference, job:reference()
  local step = before and now and (now - before) % 256
  local first = before == nil and job.previous == nil
    and record.request and not (job.fetching or job.uncounted or job.write_refused)
  for _, poll in ipairs(first and job.polls or NONE) do first = first and poll.request ~= nil end
  return first or step == 1 or step == 2
end

-- Whether a Read may be for an unanswered Write that is newer than that of a job.
local function may_be_newer(channel, job, record)
  local half = record.response
  local data = half.data
  local strange = data == "" or kind_fits(job.message, data) == false
  strange = strange or job:reference() ~= data:byte(1) and is_last(channel, half)
  for _, each in ipairs(channel.asked) do
    local passed = each.passed_over or is_later(each, record)
    if each.order > job.order and not passed and (strange or mirrors(each, data)) then return true end
  end
  return false
end

-- The last unanswered Read of a job, if a Write after it was refused: the Read may have ended the job. It has
-- not, if the record mirrors the request of the job and not the refused one.
local function wrote_behind(channel, job, record)
  local refused, polled, data = channel.refused, job.polls[#job.polls], record.response.data
  if not (refused and job.fetching and refused.order > job.order) then return nil end
  if refused:reference() ~= data:byte(1) and mirrors(job, data) and kind_fits(job.message, data) then
    return nil
  end
  local last = nil
  for _, sent in ipairs(job.fetching) do
    last = sent.frame < refused:write_request().frame and sent.frame or last
  end
  local open = last and (polled == nil or last > polled.response.frame)
  return open and {what = "read_answer", first = last} or nil
end

-- Whether a record repeats the last one of its channel, which answered a newer request than that of a job. If
-- the wire doubles calls, the record may also be that of another channel: their indices share one buffer.
local function is_newer_again(self, channel, job, half)
  if is_last(channel, half) and channel.last.order > job.order then return true end
  for key in (waits(self, job.peer) and self.of_ar[channel.ar_key] or NO_KEYS):iterate() do
    local other = self.channels.values[key]
    if is_last(other, half) and other.last.order > job.order then return true end
  end
  return false
end

-- Why a record, or a refused Read, may belong to another Write than that of the job; nil: it does not.
-- A record with the reference of the request does not belong to a missing Write, if the program counts its
-- references: otherwise no request in a filtered capture would get its response. A missing Write that was
-- accepted on this channel is an exception. The record may be for a repetition of the same request.
local function of_another(self, channel, job, record)
  local half = record.response
  local asked, open, data = job:write_request(), channel.open, half.data
  local has_data = data ~= ""
  if asked == nil then return nil end
  local fits, other = mirrors(job, data), open ~= nil and open ~= job
  local unknown = not (job:write_told() or has_data) -- nobody knows whether its Write was accepted
  local over = (unknown or job == channel.refused) and half.status ~= STATUS_SHORT
  if job.peer.station then
    local since, refused = asked.frame, job == channel.refused
    if refused or over then -- a record may be older than a start-up
      local begun = self.starts:get(job.peer.device)
      local due = not has_data and begun and begun.frame < (record.request or half).frame
      since = due and math.max(channel.ended_frame, begun.frame) or channel.ended_frame
    end
    local found = requests_missing_after(self, job.peer, channel, since)
    if refused and not fits and has_data then found = found or missing_after(self, job.peer, 0) end
    if found and over and unknown then
      return requests_missing_after(self, job.peer, channel, asked.frame) or unanswered(job, asked)
    end
    return not (fits and kind_fits(job.message, data) and counts(job, record)) and found or nil
  end
  local rival = job.refused_behind and mirrors(job.refused_behind, data)
  local sought = record.request or half
  local doubtful = not fits or is_last(channel, half) and not counts(job, record)
  local brought = has_data or half.cut and job.write_response == nil
  if brought and (rival or not (fits or other)) and not job:write_told() then
    return unanswered(job, asked)
  elseif (has_data or half.cut) and doubtful and job.fetching and job.fetching[1].frame < sought.frame then
    return {what = "read_answer", first = job.fetching[1].frame}
  elseif not fits and is_newer_again(self, channel, job, half) then
    -- A device that executes a Read once more has the newest response.
    return {what = "read_answer", first = sought.frame}
  elseif may_be_newer(channel, job, record) then
    return {what = "later"}
  end
  local since = over and idle_since(self, channel, sought) or asked.frame
  local found = requests_missing_after(self, job.peer, channel, since, fits)
  if found == nil and job == channel.refused and has_data and not fits then
    found = channel.aside or missing_after(self, job.peer, 0) -- it may mirror a request before a Connect
  end
  if unknown and found then
    return requests_missing_after(self, job.peer, channel, asked.frame, fits) or unanswered(job, asked)
  elseif found == nil or not has_data or channel.unseen_frame > since then
    return found
  end
  local sure = fits and kind_fits(job.message, data) -- a record that is too short is not sure
  local first = found.what == "begins" and (sure or fits and not job.write_refused)
  if first and job.write_refused then -- a Write may be missing after the refused one
    found = missing_after(self, job.peer, asked.frame, nil, fits)
    first = found == nil
  end
  return not (first or sure and counts(job, record)) and found or nil
end

-- A Read that brought nothing, while no request is known to be open.
-- @param missing  why it may be for a request that was taken for open; nil: it is not
local function nothing(self, peer, channel, record, missing)
  local half, known = record.response, missing == nil
  if known and was_open(channel, record) then
    return -- its response comes after that to a later Read
  elseif known then
    missing = may_be_open(self, peer, channel, record.request or half)
  end
  self.listener:nothing_to_read(peer, record, missing)
  if half.status ~= nil and known then
    pass_over(channel)
    if missing == nil then
      channel.ended_frame, channel.sought_frame = half.frame, (record.request or half).frame
    end
  end
end

--- The answer to a Read. Returns the job that gets it, nil if none does.
function Pairing:read_response(peer, record)
  local half = record.response
  self:read_over(peer, record)
  local channel = channel_of(self, peer, record, half.time_ns)
  local event = read_event(half)
  if event == "read_record" or event == "read_cut" then channel.heard_frame = half.frame end
  local job = addressee(channel, event, record)
  local over = job and wrote_behind(channel, job, record)
  if over then
    set_aside(self, channel, job, over)
    channel.aside = over
    forget_last(self, channel) -- the missing response is newer
    job = addressee(channel, event, record)
    if job and half.data ~= "" and not mirrors(job, half.data) then
      job = nil -- the record may still belong to the job that was set aside
    end
  end
  local late = job and is_later(job, record)
  if late then job = nil end -- the request of the Read is over: its response came late
  if channel.refused and channel.refused ~= job then
    if job and channel.refused.order > job.order then job.refused_behind = channel.refused end
    leave_refused(self, channel)
  end
  local missing = job and event ~= "read_poll" and event ~= "read_empty"
    and of_another(self, channel, job, record) or nil
  if missing then
    set_aside(self, channel, job, missing)
    local other = channel.open
    if other then -- whichever job the record is for, it ends the open one
      local why = job.order < other.order and (of_another(self, channel, other, record) or missing)
      set_aside(self, channel, other, why or {what = "later"})
    end
    job = nil
  end
  if job then
    read(self, channel, job, event, record)
    return job
  end
  if event ~= "read_record" and event ~= "read_cut" then
    if not late then nothing(self, peer, channel, record, missing) end
    return nil
  end
  local last = last_response(self, channel, record)
  local first = last and (not record.implicit and last.read_request or last.read_response)
  local again = last and is_same(last.read_response, half) and missing == nil
    and missing_after(self, peer, first.frame) == nil
  if again and last.phase ~= "closed" then
    reread(self, channel, last, record)
    return last
  end
  if not (late or event == "read_cut" or is_last(channel, half)) then pass_over(channel) end
  job = new_job(self, channel, peer, record, nil, nil, channel.written_frame)
  job.phase, job.uncertain = "open", self.forgot_requests or nil
  if again then job.repeats = last.read_response.frame end
  read(self, channel, job, event, record)
  return job
end

--- The answer to a Read, cut off by the capture before its record: it counts as missing (P73).
function Pairing:read_cut_before_status(peer, record)
  local job, half = record.job, record.response
  channel_of(self, peer, record, half.time_ns)
  if job and job.phase ~= "closed" then
    job.cut_frame = half.frame
    touch(self, job, "empty_read", half)
  end
end

--- A Read that never got its RPC response: its job has the first one that brought nothing.
function Pairing.read_lost(_, _, record)
  local job = record.job
  if job and job.phase ~= "closed" and job.read_response == nil then M.lose_read(job, record.request) end
end

--- The same for a job, or the copy of one, that has no response.
function M.lose_read(job, sent)
  job.read_request = job.read_request or job.fetching and job.fetching[1] or sent
end

--- The request of a Read whose response was in an earlier frame.
function Pairing:read_asked_late(peer, record, answered)
  local channel = self.channels:get(channel_key(peer, record))
  local last = channel and channel.last
  if last and last.read_response and last.read_response.frame == answered then
    last.read_request = record.request
  end
end

--- A Read is over, whichever job gets its response. A job that was displaced has handed it on.
function Pairing:read_over(peer, record)
  local job = record.job
  if job and job.phase == "closed" then
    local channel = self.channels.values[channel_key(peer, record)]
    job = channel and channel.open
  end
  if job then job:fetched(record.request) end
end

--- The job that a Read request is for, as far as that is known before its response; nil for none.
-- Changes nothing.
function Pairing:expected(peer, record)
  local channel = self.channels.values[channel_key(peer, record)]
  if channel == nil then return nil end
  return channel.open or waiting_of(channel) or channel.refused or nil
end

--- An AR (its key) is over: open jobs on its channels, or on those of one index, stay unanswered.
-- @param at  {frame, time_ns} of what ends it
function Pairing:release(of_ar, at, index)
  local over = {}
  for key in (self.of_ar[of_ar] or NO_KEYS):iterate() do
    local channel = self.channels:get(key)
    over[#over + 1] = (index == nil or channel.index == index) and channel or nil
  end
  for _, channel in ipairs(over) do close_channel(self, channel, "release", at) end
  if index then return end
  local pair = of_ar:sub(1, -18) -- without the AR itself
  if self.connected_ars:get(pair) == of_ar then self.connected_ars:pop(pair) end
end

--- A message on the ARs of a record and of those that follow it; only needed if `any_replaced`.
function Pairing:goes_on(peer, record)
  while record do
    goes_on(self, ar_key(peer, record))
    record = record.following
  end
end

-- Whether a channel has no unanswered, open or refused Write.
local function is_free(channel) return not (channel.open or channel.refused or channel.asked[1]) end

-- An AR of cyclic data is set up: it replaces the one before, unless there is another message on that.
local function replace(self, pair, ar, at)
  local before = self.connected_ars:get(pair)
  local siblings = before ~= nil and before ~= ar and self.of_ar[before]
  if not siblings then return end
  for key in siblings:iterate() do
    if not is_free(self.channels:get(key)) then
      self.replaced[before], self.any_replaced = at, true
      return
    end
  end
end

--- An AR is set up: open requests of the same AR have lost their connection.
-- @param at  {frame, time_ns} of the Connect
-- @param ar  nil if unknown
-- @param only  whether a controller has only one of this kind with a device: it replaces the one before
function Pairing:connected(controller, device, at, ar, only)
  if ar then
    local pair, key = rpc.pair(controller, device), records.ar_text(controller, device, ar)
    self.connects:keep(key, at, self.limits.channels)
    if only then
      replace(self, pair, key, at)
      self.connected_ars:keep(pair, key, self.limits.channels)
    end
  end
  self.listener:connected(device, at.frame)
end

--- A PROFIBUS station got its parameters: it may have been switched off before.
function Pairing:started(station, at)
  self.starts:keep(station, at, self.limits.channels)
  self.listener:connected(station, at.frame)
end

-- A job as the end of the capture closes it; what it holds that may grow is its own.
local function left_open(self, job, why, newest_ns, lost)
  local twin = flat(job)
  for _, name in ipairs({"polls", "rereads", "empty_reads", "calls"}) do
    twin[name] = job[name][1] and flat(job[name]) or nil
  end
  twin.reason = why[job] or "end"
  refused_at_last(self, twin, lost and lost(job.peer))
  if twin.read_response == nil then
    twin.ended = connected_since(self, job)
    twin.missing = job.missing or lacks(self, twin, twin.reason, newest_ns, lost and lost(job.peer))
    tell_read(twin)
  end
  twin.phase = PHASES[job.phase].lost
  return twin
end

--- The jobs that are open, as the end of the capture closes them: copies, in that order.
-- @param newest_ns  time of the newest call that is ours; nil for none
-- @param lost  a function of a peer: the frame of its first call that is open though the client went on
-- @return an array of them, and each by the job that it is a copy of
function Pairing:left_open(newest_ns, lost)
  local found, twins = {}, {}
  for _, channel in self.channels:iterate() do
    local why = at_the_end(channel)
    for _, job in ipairs(jobs_of(channel)) do
      twins[job] = left_open(self, job, why, newest_ns, lost)
      found[#found + 1] = twins[job]
    end
  end
  return found, twins
end

return M
