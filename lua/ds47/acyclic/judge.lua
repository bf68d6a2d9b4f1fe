-- Judgement: a job, its request and its response to findings (spec/rules.toml has the catalogue).
--
-- Compares a request with its response, and a transaction with its history. The codec finds what is wrong
-- inside one message (flaws); that is only passed on. record_calls.lua and record_events.lua report what is
-- wrong with the transport.
--
-- A remark is a finding in the making: {rule, frame, args, offset, order of its job}. The args of each rule
-- are in spec/rules.toml.

local dictionary = require("ds47.profidrive.dictionary")
local parameter = require("ds47.profidrive.parameter")
local json = require("ds47.support.json")
local places_of = require("ds47.profidrive.layouts").places
local ordered = require("ds47.support.ordered")
local readback = require("ds47.acyclic.readback")
local status = require("ds47.spec.statuses")
local tables = require("ds47.spec.tables")

local floor, huge, max = math.floor, math.huge, math.max

local M = {}

--- r0974[0] is the longest message the device takes (docs/protocol.md A.5, D.1).
M.PNU_ACCESS_IDENTIFICATION = 974

local PNU_ACCESS_IDENTIFICATION, NOT_SUPPORTED = M.PNU_ACCESS_IDENTIFICATION, parameter.NOT_SUPPORTED
local VALUE = tables.layouts.ADDRESS_VALUE
local NONE = {} -- no remarks; most jobs have none
local WRONG_COUNT = 0x18 -- the number of values does not fit (docs/protocol.md A.7)
local TOO_MANY = "DS304" -- more parameters than usual
-- Flaws that do not count in a message cut by the capture: pad, bytes left over or missing, error block.
local ABSENT = {DS311 = true, DS313 = true, DS314 = true, DS315 = true, DS412 = true}

--- A remark. `args` may be nil; `offset` is the 0-based byte of the message, nil where there is none.
function M.remark(rule, frame, args, offset)
  return {rule = rule, frame = frame, args = args, offset = offset}
end

--- Adds a remark to others.
function M.put(remarks, rule, frame, args, offset)
  remarks[#remarks + 1] = {rule = rule, frame = frame, args = args, offset = offset}
end

local put = M.put

--- How many parameters a request asks for; one that the capture cut, by its header; nil without that.
function M.parameters_asked(job)
  local request = job.message
  if job.record.request.cut then return request.parameter_count end
  return #request.addresses
end

-- Whether bytes of a request and of its response are there, and differ.
local function differ(sent, got) return sent ~= got and sent ~= nil and got ~= nil end

--- Whether the response cannot be the answer to the request (docs/pairing.md, states). Header fields that the
-- capture cut off do not count.
function M.is_mismatch(job)
  local request, response = job.message, job.response
  if request == nil or response == nil then
    return false
  elseif differ(request.request_reference, response.request_reference)
    or differ(request.axis, response.axis) then
    return true
  end
  local asked, sent, got = M.parameters_asked(job), request.request_id, response.response_id
  if asked ~= nil and #places_of(response) > asked then return true end
  if sent ~= nil and got ~= nil then return not parameter.family_fits(sent, got) end
  return sent == nil and not job.record.request.cut or got == nil and not job.read_response.cut
end

--- Whether the capture cut off the error number of an error block.
function M.is_cut_off(half, block)
  return half.cut and block.error ~= nil and block.value_count > 0 and block.error.words[1] == nil
end

local is_mismatch = M.is_mismatch

--- The drive's share of the duration, in nanoseconds: without the pause of the program before its first Read.
-- nil if the duration, the time of the Write response or that of the first Read request is unknown.
function M.drive_time_ns(job)
  local accepted, read = job.write_response, job.read_response
  local write = job.message and job.record.request
  if not write or accepted == nil or read == nil then return nil end
  local first, poll = job.read_request, job.polls[1]
  if poll then first = poll.request end
  if first == nil then return nil end
  if first.time_ns > accepted.time_ns then -- the parts are exact, whatever the pause
    return read.time_ns - first.time_ns + (accepted.time_ns - write.time_ns)
  end
  return read.time_ns - write.time_ns
end

-- Adds what is wrong inside a message; what the capture cut off is not its fault.
-- `most`: the most parameters that the device is known to take; nil for the usual number.
local function put_flaws(remarks, flaws, half, most)
  for number = 1, #flaws do
    local flaw = flaws[number]
    local args, silent = flaw.args, half.cut and ABSENT[flaw.rule]
    if flaw.rule == TOO_MANY and most then
      silent = silent or args.count <= most
      args = {count = args.count, limit = most}
    end
    if not silent then put(remarks, flaw.rule, half.frame, args, flaw.offset) end
  end
end

-- The judge

local Judge = {}
Judge.__index = Judge

--- Judges jobs; keeps the little history that some rules need.
-- @param limits   the numbers of tables.limits
-- @param slow_ns  a transaction is slow if the drive's share is longer, nanoseconds
-- @param unseen   whether an unknown change may have come after a frame (readback.lua)
function M.new(limits, slow_ns, unseen)
  return setmetatable({
    limits = limits,
    slow_ns = slow_ns,
    written = readback.new(limits.written_values, unseen),
    longest = ordered.new(), -- device -> longest message it takes
    most = ordered.new(), -- device -> most parameters of one request
    misfits = ordered.new(), -- place -> the last change that was refused for its number of values
    blank = {}, -- where the remarks of the next job go; made anew only when it had some
  }, Judge)
end

-- The remarks in `blank`, as those of the job.
local function owned(self, job)
  local remarks = self.blank
  if remarks[1] == nil then return NONE end
  self.blank = {}
  for _, remark in ipairs(remarks) do remark.order = job.order end
  return remarks
end

-- The findings about a job, by topic

-- The most parameters of one request that the device is known to take; nil if unknown.
local function most_parameters(self, job)
  local request, response, most = job.message, job.response, self.most:get(job.peer.device)
  if request == nil or response == nil or is_mismatch(job) then return most end
  local answered = #places_of(response)
  if answered == #request.addresses and answered == request.parameter_count then return answered end
  return most
end

-- `most`: how many parameters are not too many; nil: as many as the device is known to take.
local function put_request(self, remarks, job, most)
  local message = job.message
  local half = message and job.record.request
  if not half then return end
  if message.flaws[1] then put_flaws(remarks, message.flaws, half, most or most_parameters(self, job)) end
  local limit, reference = self.longest.values[job.peer.device], message.request_reference
  local length = #half.data + (half.missing or 0)
  if limit and length > limit then put(remarks, "DS316", half.frame, {length = length, limit = limit}, 0) end
  if reference ~= nil and reference == job.previous_reference then
    put(remarks, "DS415", half.frame, {reference = reference, first = job.previous})
  end
end

local function put_reads(remarks, job)
  for _, short in ipairs(job.polls[1] and job:too_short() or NONE) do
    put(remarks, "DS201", short.response.frame, {status = status.status_hex(short.response.status)})
  end
  local half = job.read_response
  local code = half and half.status
  if code and code ~= 0 then put(remarks, "DS201", half.frame, {status = status.status_hex(code)}) end
  local empty_reads = job.empty_reads
  for number = 1, #empty_reads do put(remarks, "DS207", empty_reads[number].frame) end
end

-- Why a response has no request: a key of tables.diagnosis_words, and the request before it.
local function unasked(job)
  if job.record.implicit then return {case = job.repeats and "unasked_again" or "unasked_without_ar"} end
  return {case = job.previous and "unasked_behind" or "unasked", first = job.previous}
end

local function put_if_other(remarks, rule, frame, sent, got)
  if differ(sent, got) then put(remarks, rule, frame, {sent = sent, got = got}) end
end

local function put_mirror(remarks, frame, job)
  local request, response = job.message, job.response
  put_if_other(remarks, "DS404", frame, request.request_reference, response.request_reference)
  put_if_other(remarks, "DS406", frame, request.axis, response.axis)
  put_if_other(remarks, "DS407", frame, request.parameter_count, response.parameter_count)
  local sent, got = request.request_id, response.response_id
  if sent == nil or got == nil then return end
  if got == NOT_SUPPORTED then
    put(remarks, "DS418", frame, {id = sent})
  elseif not parameter.family_fits(sent, got) then
    put(remarks, "DS405", frame, {sent = sent, got = got})
  end
end

local function family_of(peer) return dictionary.family_of(peer.vendor_id, peer.family) end

-- Finds fewer or more values than requested. Count 0 asks for a whole parameter without index: at least one
-- value; a string has one for each character.
local function put_count(remarks, frame, job, block, address)
  local asked, got, rule = max(1, address.element_count), block.value_count, nil
  if got < asked then
    rule = "DS408"
  elseif got > asked and address.element_count ~= 0 then
    rule = "DS409"
  end
  if rule and address.attribute == VALUE then
    local args = {asked = asked, got = got, pnu = address.pnu, family = family_of(job.peer)}
    put(remarks, rule, frame, args, block.offset)
  end
end

local function error_args(job, block, address)
  local code, info = block.error.code, block.error.info
  return {
    pnu = address and address.pnu, subindex = address and address.subindex, code = code, info = info,
    vendor_id = job.peer.vendor_id, family = family_of(job.peer),
  }
end

local function put_blocks(remarks, half, job, stray)
  local request, blocks, frame = job.message, places_of(job.response), half.frame
  local addresses = request and not stray and request.addresses
  local counted = addresses and request.operation == "read"
  local told = request == nil and job.repeats ~= nil
  for number = 1, #blocks do
    local block = blocks[number]
    local address = addresses and addresses[number] or nil
    if block.error ~= nil and not (told or M.is_cut_off(half, block)) then
      put(remarks, "DS410", frame, error_args(job, block, address), block.offset)
    elseif block.error == nil and address and counted then
      put_count(remarks, frame, job, block, address)
    end
  end
end

local function put_response(self, remarks, job, stray)
  local half, response = job.read_response, job.response
  if response and response.flaws[1] then
    put_flaws(remarks, response.flaws, half, most_parameters(self, job))
  end
  if job.message == nil and not job.uncertain then put(remarks, "DS403", half.frame, unasked(job)) end
  if response == nil then return end
  if job.message then put_mirror(remarks, half.frame, job) end
  put_blocks(remarks, half, job, stray)
end

local function put_polls(self, remarks, half, polls, read_before)
  if not polls[1] then return end -- too short, all of them
  if #polls >= self.limits.polls then put(remarks, "DS204", half.frame, {count = #polls}) end
  local since = half.time_ns - (polls[1].request or polls[1].response).time_ns
  if since > self.limits.polling_ns and not read_before then
    local args = {milliseconds = json.float(since / 1e6), limit = floor(self.limits.polling_ns / 1000000)}
    put(remarks, "DS205", half.frame, args)
  end
end

local function put_time(self, remarks, job)
  local half, polls, write = job.read_response, job.polls, job.message and job.record.request
  if polls[1] then put_polls(self, remarks, half, job:not_ready(), job.read_before) end
  local quick = not write or half.time_ns - write.time_ns <= self.slow_ns -- the drive's share is never more
  if quick or half.data == "" or job.read_before then return end
  local share = M.drive_time_ns(job)
  if share ~= nil and share > self.slow_ns then
    local args = {milliseconds = json.float(share / 1e6), limit = floor(self.slow_ns / 1000000)}
    put(remarks, "DS416", half.frame, args)
  end
end

-- Keeps a value of r0974 in one of the two memories of that.
local function learn(self, memory, device, value)
  if type(value) == "number" and value > 0 then memory:keep(device, value, self.limits.longest_messages) end
end

local function learn_limit(self, job)
  local request, response = job.message, job.response
  if response == nil then return end
  local addresses = request.addresses
  for number = 1, math.min(#places_of(response), #addresses) do
    local address = addresses[number]
    if address.pnu == PNU_ACCESS_IDENTIFICATION and address.attribute == VALUE then
      local block = response.blocks[number]
      if not block.float then
        learn(self, self.longest, job.peer.device, block.values[1 - address.subindex])
        learn(self, self.most, job.peer.device, block.values[2 - address.subindex])
      end
    end
  end
end

-- Finds an accepted change that differs from a refused one only in its length (DS419).
local function put_other_length(self, remarks, job)
  local record, response = job.record, job.response
  local half, id = record.request, response and response.response_id
  if not half or id == nil or half.missing then return end
  local spot = record.slot * 65536 + record.subslot .. "\0" .. record.index
  local place = job.peer.device .. "\0" .. record.api .. "\0" .. spot
  if id >= 0x80 then
    for _, block in ipairs(places_of(response)) do
      if block.error and block.error.code == WRONG_COUNT then
        self.misfits:keep(place, half, self.limits.longest_messages)
      end
    end
    return
  end
  local before = self.misfits:pop(place)
  if before == nil or #before.data == #half.data then return end
  local length = math.min(#before.data, #half.data)
  if before.data:sub(2, length) == half.data:sub(2, length) then
    put(remarks, "DS419", half.frame, {first = before.frame, refused = #before.data, accepted = #half.data})
  end
end

-- What is told

local function is_change(job) return job.message ~= nil and job.message.operation == "change" end

--- A Write request asks for something. To be called in the order of the capture.
function Judge:asked(job)
  if job.message.operation == "change" then self.written:asked(job) end
end

--- A Write was refused.
function Judge:refused(job)
  if is_change(job) then self.written:settled(job, false) end
end

--- A Connect to a device.
function Judge:connected(device, frame) self.written:connected(device, frame) end

--- The findings about the response of a job and its values: an array of remarks.
-- To be called in the order of the capture.
function Judge:answered(job)
  local remarks, stray, request = self.blank, is_mismatch(job), job.message
  put_request(self, remarks, job)
  put_reads(remarks, job)
  put_response(self, remarks, job, stray)
  put_time(self, remarks, job)
  local operation = request and request.operation
  if request == nil then
    self.written:unasked(job)
  elseif operation == "change" then
    self.written:settled(job, stray)
    if not stray then put_other_length(self, remarks, job) end
  elseif operation == "read" and not stray then
    local found = self.written:read(job) -- values that differ from the last written ones
    for number = 1, #found do
      put(remarks, "DS417", job.read_response.frame, found[number].args, found[number].offset)
    end
    learn_limit(self, job)
  end
  if job.missing and request then put(remarks, "DS110", job:write_request().frame, job.missing) end
  return owned(self, job)
end

--- The findings about a job that is closed without a response: an array of remarks.
-- @param dropped  whether the capture says that frames are missing
function Judge:unanswered(job, dropped)
  if is_change(job) then self.written:settled(job, false) end
  return self:left_open(job, dropped)
end

--- The same for a job that is open when the capture ends; changes nothing.
function Judge:left_open(job, dropped)
  local remarks = self.blank
  put_request(self, remarks, job)
  put_reads(remarks, job)
  local write = job:write_request()
  if job.read_response then return owned(self, job) end -- refused (P34)
  if write and job.missing then
    put(remarks, "DS110", write.frame, job.missing)
  elseif write and not job.write_refused and not job.contested then
    local change = is_change(job)
    if job.superseded_by ~= nil then
      local args = {request = write.frame, by = job.superseded_by}
      put(remarks, change and "DS414" or "DS413", job.superseded_by, args)
    elseif not job.limit then -- else a response may have come later
      local args = {reason = job.reason ~= "" and job.reason or nil, dropped = dropped}
      put(remarks, change and "DS402" or "DS401", write.frame, args)
    end
  end
  return owned(self, job)
end

--- The findings that are certain for a job that still waits: an array of remarks.
function Judge:certain(job)
  local remarks = self.blank
  put_request(self, remarks, job, huge) -- the drive may yet answer all of them
  put_reads(remarks, job)
  remarks[#remarks + 1] = self:closed(job)
  return owned(self, job)
end

--- The finding about the Write response of a job, which may come after the Read; nil for none.
function Judge:closed(job)
  local half = job.write_response
  if half == nil or half.status == nil or half.status == 0 then return nil end
  local remark = M.remark("DS203", half.frame, {status = status.status_hex(half.status)})
  remark.order = job.order
  return remark
end

return M
