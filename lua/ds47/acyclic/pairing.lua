-- Pairing on the DS47 level: Writes and Reads of one channel to jobs (docs/pairing.md).
--
-- A job is a transaction in the making. Its life is the table `tables.phases`; the only thing decided here
-- is to which job a record call belongs. Nothing is decoded beyond what a caller hands in, and nothing is
-- judged: judge.lua does that when the listener is told `answered` and `closed`.

local kind_fits = require("ds47.profidrive.family").kind_fits
local flat = require("ds47.support.flat").copy
local ordered = require("ds47.support.ordered")
local records = require("ds47.profinet.records")
local tables = require("ds47.spec.tables")

local M = {}

--- State conflict on a Read: the response is not ready, read again (docs/protocol.md E.1).
M.STATUS_NOT_READY = 0xDE80B500
--- State conflict on a Write: the device still works on another request.
M.STATUS_IN_USE = 0xDF80B500
--- Polls, re-reads and empty reads of one transaction that are kept, of each.
M.MOST_READS = 4096

local ar_key, channel_key, know_peer = records.ar_key, records.channel_key, records.know_peer
local STATUS_NOT_READY, STATUS_IN_USE, MOST_READS = M.STATUS_NOT_READY, M.STATUS_IN_USE, M.MOST_READS
local PHASES = tables.phases
local setmetatable = setmetatable

-- Jobs: the halves of the record calls of one transaction, and what pairing learnt of it.
-- `response` is decoded by whoever is told of the answer; `message` is nil for an orphan.

local Job = {}
Job.__index = Job
M.Job = Job

-- What a job has until it gets its own.
local NONE = {}
local NO_KEYS = ordered.new()
Job.write_fault = false
Job.polls = NONE -- array of {request = half or nil, response = half}
Job.rereads = NONE -- the same
Job.empty_reads = NONE -- array of halves
Job.calls = NONE -- what was said of its calls (DS101, DS103, DS104, DS108): array of {rule, frame}
Job.reason = ""
Job.again = "" -- of the first re-read, how it came about: a key of tables.diagnosis_words
Job.accepted = false
-- Further: write_response, read_request, read_response, response, previous_reference, superseded_by; and
--   previous: frame of the request before it on its channel, whose reference that is
--   superseding: the request that displaced this one; until it is closed
--   rival: whose request was open when this one was turned away as in conflict with another; the same
--   repeats: frame of an earlier response that was read once more where a new one was due
--   ended: frame that ended the connection while the request was open
--   limit: name of the limit that pushed it out: a response may still come
--   passed: true for a Write that waited for its response when no request was said to be open (P28)
--   contested: true where a record that went to an older request may be the response to this one (P72)
--   remarks: what its answer says of it, until it is closed; whoever is told of the answer keeps it there
--   uncertain: true for an orphan whose request a limit may have pushed out

-- A job on a channel. A Write has the reference that was asked for before it there, and its frame.
local function new_job(self, channel, peer, record, message, previous_reference, previous)
  local order = self.count + 1
  self.count = order
  return setmetatable({
    peer = peer, -- {controller, device, vendor_id, device_id}
    record = record,
    message = message,
    phase = "asked",
    order = order,
    channel_key = message and channel.key,
    previous_reference = previous_reference,
    previous = previous,
    write_response = nil, -- a ninth: room for all that follow
  }, Job)
end

--- Notes what is said of a call of this job.
function Job:note_call(rule, frame)
  if self.calls == NONE then
    self.calls = {}
  end
  self.calls[math.min(#self.calls + 1, MOST_READS)] = {rule = rule, frame = frame}
end

--- The half of the Write request that asked; nil for an orphan.
function Job:write_request()
  if self.message ~= nil then
    return self.record.request
  end
  return nil
end

--- Whether the Write was answered with a negative status or an RPC fault.
function Job:write_refused()
  local half = self.write_response
  return self.write_fault or (half ~= nil and half.status ~= nil and half.status ~= 0)
end

--- The request reference that was sent; nil where it is not known.
function Job:reference()
  return self.message and self.message.request_reference
end

-- Keys

local function pair_key(controller, device)
  return controller .. "\0" .. device
end

-- What is one place of a device, whoever asks there.
local function place_key(peer, record)
  return record.api .. record.spot .. peer.device
end

-- Small things

local function read_event(half)
  local status = half.status
  if status == STATUS_NOT_READY then
    return "read_poll"
  elseif status ~= nil and status ~= 0 then
    return "read_refused"
  end
  return half.data ~= "" and "read_record" or "read_empty"
end

-- The newest Write without its response that a Read may ask for: none was accepted after it. nil for none.
local function waiting_of(channel)
  local newest = channel.asked[#channel.asked]
  return newest and not newest.passed and newest.order > channel.accepted and newest or nil
end

-- No request is open: of the Writes that wait for their responses none is answered any more.
local function pass_over(channel)
  for _, job in ipairs(channel.asked) do
    job.passed = true
  end
end

-- The bytes that were read last; nil without a job or a response.
local function bytes(job)
  return job and job.read_response and job.read_response.data
end

-- The reads of one transaction: of more than MOST_READS the first and the newest are kept.
local function keep(job, name, read)
  local reads = job[name]
  if reads == NONE then
    reads = {}
    job[name] = reads
  end
  local count = #reads
  reads[count < MOST_READS and count + 1 or count] = read
end

local function remove(jobs, job)
  local count = #jobs
  if jobs[count] == job then -- mostly it is the newest
    jobs[count] = nil
    return
  end
  for place = 1, count do
    if jobs[place] == job then
      table.remove(jobs, place)
      return
    end
  end
end

-- Pairing

local Pairing = {}
Pairing.__index = Pairing

--- Takes record calls in the order of the capture and keeps the jobs of every channel.
-- @param limits    the numbers of tables.limits
-- @param listener  told `asked(job)` of each Write request; `refused(job)` when a Write was refused;
--   `connected(device, frame)` of each Connect; `answered(job)`, once, when a job has its response;
--   `closed(job)`, once, when nothing more can come; `late(job)` before a Write response changes a closed
--   one; `nothing_to_read(record, device)` for a Read without record on a channel that has no request
function M.new(limits, listener)
  return setmetatable({
    limits = limits,
    expiry_ns = limits.transaction_expiry_ns,
    listener = listener,
    channels = ordered.new(), -- channel key -> channel, the one that was touched last goes last
    of_ar = {}, -- AR key -> its channel keys, in the order of first sight
    of_place = {}, -- place -> its channel keys, whoever asks there, in the order of first sight
    delivered = ordered.new(), -- place -> its newest accepted request whose response was read, whoever asked
    connects = ordered.new(), -- AR key -> frame of its newest Connect
    connected_ars = ordered.new(), -- controller and device -> the newest AR of which they have one
    replaced = {}, -- key of an AR with open requests that a Connect seems to have replaced -> its frame
    any_replaced = false, -- whether there may be one: seldom, and asked for every record
    forgot_requests = false, -- whether a limit pushed out requests whose responses may still come
    count = 0,
    -- What the caller's last step touched in its frame, and not in those of messages that waited for their AR
    -- to prove itself; he tells that frame, and sets the count to 0, before it.
    frame = nil,
    touched_count = 0,
    touched_jobs = {},
    touched_roles = {},
  }, Pairing)
end

-- For `Analysis:touched`: in arrays of its own, so that nothing is made for it on the way of a frame.
local function touch(self, job, role, half)
  if half.frame == self.frame then
    local count = self.touched_count + 1
    self.touched_count = count
    self.touched_jobs[count], self.touched_roles[count] = job, role
  end
end

local function end_job(self, job, event)
  job.phase = PHASES[job.phase][event]
  self.listener:closed(job)
  if job.rival then -- or a closed job would keep all that came after it
    job.rival = nil
  end
end

-- The frame of a Connect of its AR that came after the request of a job, nil for none.
local function connected_since(self, job)
  local asked = job:write_request()
  local key = ar_key(job.peer, job.record)
  local connect = asked and (self.replaced[key] or self.connects:get(key))
  return connect and connect > asked.frame and connect or nil
end

local function lose(self, job, reason, ended)
  if reason ~= "" then
    job.reason = reason
  end
  if job.read_response == nil then
    job.ended = ended or connected_since(self, job)
  end
  end_job(self, job, "lost")
end

-- Nothing more is known of a job from now on, and not because nothing came.
local function push_out(self, job, limit)
  if job.read_response == nil and not job:write_refused() then
    job.limit, self.forgot_requests = limit, true
  end
  lose(self, job, "")
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
  if keys.length == 0 then
    index[name] = nil
  end
end

-- Job -> why it has no response, where its channel went on before the capture ended. Of an accepted request
-- before a Write without its response nobody knows whether that displaced it.
local function at_the_end(channel)
  local why, newest = {}, channel.asked[#channel.asked]
  for _, job in ipairs(channel.asked) do
    why[job] = job ~= newest and "unseen" or nil
  end
  if newest == nil then
    return why
  end
  local asked = newest.record.request
  if newest.order < channel.accepted or asked and channel.heard > asked.frame then
    why[newest] = "unseen"
  end
  if channel.open and channel.open.order < newest.order then
    why[channel.open] = "later"
  end
  return why
end

-- What is not closed on a channel, in the order in which it is when nothing more comes.
local function jobs_of(channel)
  local jobs = {}
  jobs[#jobs + 1] = channel.last
  jobs[#jobs + 1] = channel.refused
  jobs[#jobs + 1] = channel.open
  for _, job in ipairs(channel.asked) do
    jobs[#jobs + 1] = job
  end
  return jobs
end

local function close_channel(self, channel, reason, ended, limit)
  take_out(self.of_ar, channel.ar_key, channel.key)
  take_out(self.of_place, channel.place, channel.key)
  self.channels:pop(channel.key)
  for _, job in ipairs(jobs_of(channel)) do
    if limit then
      push_out(self, job, limit)
    else
      lose(self, job, reason, ended)
    end
  end
  if self.of_ar[channel.ar_key] == nil then
    self.replaced[channel.ar_key] = nil
  end
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
    written = nil, -- and its frame
    accepted = 0, -- `order` of the newest Write that was accepted
    heard = 0, -- frame of the newest record that was read
    unasked = 0, -- frame of the newest Write response whose request is not in the capture
    ended = 0, -- frame of the newest Read response that ended a transaction
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
  if place.peer ~= peer then
    know_peer(place, peer)
  end
  local key = place.channel_key
  if self.any_replaced then
    goes_on(self, place.ar_key)
  end
  local channels, expiry = self.channels, self.expiry_ns
  local channel = channels.values[key]
  if channel ~= nil and now - channel.touched > expiry then
    close_channel(self, channel, "expired")
    channel = nil
  end
  channel = channel or new_channel(self, key, peer, record)
  channel.touched = now
  if channels.newest ~= key then
    channels:move_to_end(key)
  end
  while true do
    local oldest_key = channels.oldest
    if oldest_key == key then
      return channel
    end
    local oldest = channels.values[oldest_key]
    local old = now - oldest.touched > expiry
    if not old and channels.length <= self.limits.channels then
      return channel
    end
    close_channel(self, oldest, "expired", nil, not old and "channels" or nil)
  end
end

--- The number of the next transaction, by their beginnings.
function Pairing:number()
  self.count = self.count + 1
  return self.count
end

-- An accepted Write opens; it displaces what was open and ends the grace of a refused one.
local function accept(self, channel, job)
  job.accepted = true
  if job.order > channel.accepted then
    channel.accepted = job.order
  end
  if job.phase == "asked" then
    remove(channel.asked, job)
    local open = channel.open
    if open then
      open.superseded_by = job.record.request and job.record.request.frame
      open.superseding = job
      end_job(self, open, "displaced")
      open.superseding = nil -- for the same reason
    end
    if channel.refused then
      lose(self, channel.refused, "")
      channel.refused = nil
    end
    channel.open = job
  end
  job.phase = PHASES[job.phase].write_accepted
end

-- The newest request that is open at the place of another one, whoever asked; nil for none.
local function rival_of(self, channel, job)
  local keys, found = self.of_place[channel.place], nil
  for key in keys:newest_first(self.limits.users) do
    local held = self.channels:get(key).open
    if held and held ~= job and (found == nil or held.order > found.order) then
      found = held
    end
  end
  return found
end

local function refuse(self, channel, job)
  local before, half = job.phase, job.write_response
  if half and half.status == STATUS_IN_USE then
    job.rival = rival_of(self, channel, job)
  end
  job.phase = PHASES[before].write_refused
  if before == "answered" then
    return
  end
  if before == "asked" then
    remove(channel.asked, job)
  else
    channel.open = nil
  end
  if channel.refused then
    lose(self, channel.refused, "")
  end
  channel.refused = job
end

-- Writes without their response, newer than the open request and mirrored or not as it is; newest first.
local function newer_than(open, channel, reference)
  local asked, newer, mirrored = channel.asked, {}, open:reference() == reference
  for place = #asked, 1, -1 do
    local job = asked[place]
    if job.order > open.order and not job.passed and (job:reference() == reference) == mirrored then
      newer[#newer + 1] = job
    end
  end
  return newer, mirrored
end

-- Whose record it is where its reference does not tell: of the open request or of a newer Write (P71, P72).
-- Its kind tells, where it fits such a Write and not the open request. Where it does not tell the reverse
-- either, the newer Writes are contested.
local function by_kind(channel, open, record)
  local read, data = record.request, record.response.data
  local newer, mirrored = newer_than(open, channel, data:byte(1))
  if not mirrored and bytes(channel.last) == data then
    return open -- an old answer
  end
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

-- Whether a record may be for the Write that it mirrors: for one before an accepted one only by its kind.
local function may_be(channel, job, data)
  return job.order > channel.accepted or kind_fits(job.message, data)
end

-- The job a Read answers; a Write whose response was not seen counts when the answer fits.
local function addressee(channel, event, record)
  local open, asked = channel.open, channel.asked
  if open and not asked[1] then
    return open -- nothing else waits
  end
  local data = record.response.data
  local reference = data:byte(1)
  if event == "read_record" and not (open and open:reference() == reference) then
    for place = #asked, 1, -1 do
      local job = asked[place]
      if job:reference() == reference and not job.passed and may_be(channel, job, data) then
        return job
      end
    end
  end
  if open then
    return event == "read_record" and asked[1] and by_kind(channel, open, record) or open
  end
  local waiting = waiting_of(channel)
  if waiting then
    if event == "read_record" and bytes(channel.last) == data then
      return nil -- an old answer
    end
    return waiting
  end
  return channel.refused
end

-- A Read that ends the waiting of a job: with the record, or with a refusal.
local function answer(self, channel, job, record)
  local half = record.response
  job.read_request, job.read_response = record.request, half
  channel.ended = half.frame
  if channel.open == job then
    channel.open = nil
  end
  if channel.refused == job then
    channel.refused = nil
  end
  self.listener:answered(job)
  if half.data == "" then
    lose(self, job, "")
    if channel.last and not job:write_refused() then
      lose(self, channel.last, "") -- what is read from now on may be of either
      channel.last = nil
    end
    return
  end
  if channel.last then
    end_job(self, channel.last, "lost") -- it has its response
  end
  channel.last = job
  if job.message and not job:write_refused() then
    self.delivered:keep(channel.place, job, self.limits.channels)
  end
end

-- Whether a request that was refused is answered as the last one was. Of a Write without a Write response
-- nothing follows: two questions may have the same answer.
local function compare(last, job, half)
  if bytes(last) == half.data then
    job.repeats = last.read_response.frame
  end
end

-- What is read proves that a Write was accepted; its response is missing in the capture. It displaces no
-- newer one: the record of an older request came late.
local function presume(self, channel, job)
  if channel.open and channel.open.order > job.order then
    remove(channel.asked, job)
    job.phase = PHASES[job.phase].write_accepted
  else
    accept(self, channel, job)
  end
  job.accepted = false
end

local function read(self, channel, job, event, record)
  local half, phase = record.response, job.phase
  if phase == "refused" and event == "read_record" then
    compare(channel.last, job, half)
  elseif phase == "asked" and event ~= "read_empty" then
    presume(self, channel, job)
  end
  job.phase = PHASES[job.phase][event]
  if event == "read_poll" then
    keep(job, "polls", {request = record.request, response = half})
    touch(self, job, "poll", half)
  elseif event == "read_empty" then
    if half.status ~= nil then
      keep(job, "empty_reads", half)
    end
    touch(self, job, "empty_read", half)
  else
    touch(self, job, "read_response", half)
    answer(self, channel, job, record)
  end
end

-- Whose response a Read without a request may bring once more: that of its channel; without an AR that of
-- the place, whoever asked there.
local function last_response(self, channel, record)
  local last, delivered, data = channel.last, self.delivered:get(channel.place), record.response.data
  if not record.implicit or bytes(delivered) ~= data then
    return last
  end
  return delivered.phase == "closed" and bytes(last) == data and last or delivered
end

--- Whether a ReadImplicit brings the bytes of the last response of its place (P55). Changes nothing.
function Pairing:is_again(peer, record)
  local delivered = record.implicit and self.delivered:get(place_key(peer, record))
  return delivered and bytes(delivered) == record.response.data or false
end

local function reread(self, channel, job, record)
  job.phase = PHASES[job.phase].reread
  if not job.rereads[1] then
    local written = math.max(channel.written or 0, channel.unasked)
    local unaccepted = written > job.read_response.frame and "again_unaccepted"
    job.again = record.implicit and "again_without_ar" or unaccepted or "again"
  end
  keep(job, "rereads", {request = record.request, response = record.response})
  touch(self, job, "reread", record.response)
end

--- A Write that asks for something. Returns the job, for `write_response`.
function Pairing:write_request(peer, record, message)
  local channel = channel_of(self, peer, record, record.request.time_ns)
  local job = new_job(self, channel, peer, record, message, channel.reference, channel.written)
  local asked, half = channel.asked, record.request
  local count = #asked + 1
  asked[count] = job
  channel.reference, channel.written = message.request_reference, half.frame
  touch(self, job, "write_request", half)
  self.listener:asked(job)
  if count > self.limits.pending_writes then
    push_out(self, table.remove(asked, 1), "pending_writes")
  end
  return job
end

--- The answer to a Write: accepted (status 0), refused (any other status, or an RPC fault).
-- @param response  the half; may be nil
function Pairing:write_response(job, response, fault)
  if job.phase == "closed" then
    self.listener:late(job)
  end
  job.write_response = response
  if fault or job.write_fault then
    job.write_fault = fault or nil
  end
  if response then
    touch(self, job, "write_response", response)
  end
  local status = response and response.status
  if job.phase == "closed" or (status == nil and not fault) then
    return
  end
  local channel = self.channels.values[job.channel_key]
  if channel == nil then
    return
  end
  if status == 0 and not fault then
    accept(self, channel, job)
  else
    refuse(self, channel, job)
    if job.phase == "refused" then
      self.listener:refused(job)
    end
  end
end

--- The answer to a Write whose request is not in the capture. One that was accepted asks for something that
--- nobody knows: what is read from now on may be its response, also where that has the bytes of an
--- earlier one.
function Pairing:write_unasked(peer, record)
  local channel, half = self.channels:get(channel_key(peer, record)), record.response
  if channel == nil or half == nil then
    return
  end
  channel.unasked = half.frame
  local expiry = tables.limits.call_expiry_ns
  for _, job in ipairs(channel.asked) do
    if half.time_ns - job.record.request.time_ns > expiry then
      return -- the request may be there, and its call was given up before
    end
  end
  if channel.refused then
    lose(self, channel.refused, "")
    channel.refused = nil
  end
  if half.status ~= 0 then
    return
  end
  pass_over(channel)
  if channel.last then
    lose(self, channel.last, "")
    channel.last = nil
  end
end

--- The answer to a Read. Returns the job it went to, nil where there is none.
function Pairing:read_response(peer, record)
  local half = record.response
  local channel = channel_of(self, peer, record, half.time_ns)
  local event = read_event(half)
  if event == "read_record" then
    channel.heard = half.frame
  end
  local job = addressee(channel, event, record)
  if channel.refused and channel.refused ~= job then
    lose(self, channel.refused, "")
    channel.refused = nil
  end
  if job then
    read(self, channel, job, event, record)
    return job
  end
  if event ~= "read_record" then
    self.listener:nothing_to_read(record, peer.device)
    if half.status ~= nil then
      pass_over(channel)
    end
    return nil
  end
  local last = last_response(self, channel, record)
  if bytes(last) == half.data and last.phase ~= "closed" then
    reread(self, channel, last, record)
    return last
  end
  job = new_job(self, channel, peer, record, nil)
  job.phase, job.uncertain = "open", self.forgot_requests or nil
  if bytes(last) == half.data then
    job.repeats = last.read_response.frame
  end
  read(self, channel, job, event, record)
  return job
end

--- The job that waits for a Read that never got its RPC response; nil for none. Changes nothing.
function Pairing:waits_for(peer, record)
  local channel, lost = self.channels:get(channel_key(peer, record)), record.request
  local job = channel and (channel.open or waiting_of(channel) or channel.refused) or nil
  local asked = job and job:write_request()
  if not asked or not lost or asked.frame > lost.frame then
    return nil -- what the Read asked for is over: it came before the Write of this one
  end
  if channel.ended > lost.frame then
    return nil -- the same: another request was open then
  end
  return job
end

--- A Read that never got its RPC response. Returns the job that waits for it, or nil.
function Pairing:read_lost(peer, record)
  local job = self:waits_for(peer, record)
  if job and job.read_request == nil then
    job.read_request = record.request
  end
  return job
end

--- The job that a Read request asks for, as far as is known before its response; nil for none.
-- Changes nothing.
function Pairing:expected(peer, record)
  local channel = self.channels.values[channel_key(peer, record)]
  if channel == nil then
    return nil
  end
  return channel.open or waiting_of(channel) or channel.refused or nil
end

--- The AR is over with this frame: what is open on its channels, or on those of one index, stays unanswered.
function Pairing:release(controller, device, ar, frame, index)
  local of_ar = records.ar_text(controller, device, ar)
  local over = {}
  for key in (self.of_ar[of_ar] or NO_KEYS):iterate() do
    local channel = self.channels:get(key)
    over[#over + 1] = (index == nil or channel.index == index) and channel or nil
  end
  for _, channel in ipairs(over) do
    close_channel(self, channel, "release", frame)
  end
  if index then
    return
  end
  local pair = pair_key(controller, device)
  if self.connected_ars:get(pair) == of_ar then
    self.connected_ars:pop(pair)
  end
end

--- Something is said on the ARs of a record and of those that follow it; needed where `any_replaced` says so.
function Pairing:goes_on(peer, record)
  while record do
    goes_on(self, ar_key(peer, record))
    record = record.following
  end
end

-- Whether nothing on a channel waits for a response or for the end of its grace.
local function is_free(channel)
  return not (channel.open or channel.refused or channel.asked[1])
end

-- An AR of which the two have one is set up: it replaces the one before, if nothing more is said on that.
local function replace(self, pair, ar, frame)
  local before = self.connected_ars:get(pair)
  local siblings = before ~= nil and before ~= ar and self.of_ar[before]
  if not siblings then
    return
  end
  for key in siblings:iterate() do
    if not is_free(self.channels:get(key)) then
      self.replaced[before], self.any_replaced = frame, true
      return
    end
  end
end

--- An AR is set up: requests of the same AR that are open now have lost their connection.
-- @param ar  nil where it is not known
-- @param only  whether a controller has one of this kind with a device: it replaces the one before
function Pairing:connected(controller, device, frame, ar, only)
  if ar then
    local pair, key = pair_key(controller, device), records.ar_text(controller, device, ar)
    self.connects:keep(key, frame, self.limits.channels)
    if only then
      replace(self, pair, key, frame)
      self.connected_ars:keep(pair, key, self.limits.channels)
    end
  end
  self.listener:connected(device, frame)
end

-- A job as the end of the capture closes it; what it holds that may grow is its own.
local function left_open(self, job, why)
  local twin = flat(job)
  for _, name in ipairs({"polls", "rereads", "empty_reads", "calls"}) do
    twin[name] = job[name][1] and flat(job[name]) or nil
  end
  twin.reason = why[job] or "end"
  if job.read_response == nil then
    twin.ended = connected_since(self, job)
  end
  twin.phase = PHASES[job.phase].lost
  return twin
end

--- The jobs that are open, as the end of the capture closes them: copies, in that order.
-- @return an array of them, and each by the job that it is a copy of
function Pairing:left_open()
  local found, twins = {}, {}
  for _, channel in self.channels:iterate() do
    local why = at_the_end(channel)
    for _, job in ipairs(jobs_of(channel)) do
      twins[job] = left_open(self, job, why)
      found[#found + 1] = twins[job]
    end
  end
  return found, twins
end

return M
