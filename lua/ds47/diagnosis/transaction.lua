-- Diagnoses: what went wrong and what to change, from findings, frames and their history
-- (docs/diagnoses.md).
--
-- A finding names a symptom, a diagnosis its cause. Diagnoses are rules like the others (DS7xx) and made when
-- a job is closed: order.lua (frames), length.lua, refusal.lua (error numbers)
-- and repair.lua (what the bytes were meant to be). Those that need the whole capture are the analyzer's
-- alone.

local dictionary = require("ds47.profidrive.dictionary")
local arrays = require("ds47.support.arrays")
local formats = require("ds47.profidrive.formats")
local later = require("ds47.support.later").module
local length = later("ds47.diagnosis.length")
local memory = require("ds47.diagnosis.memory")
local order = require("ds47.diagnosis.order")
local parameter = require("ds47.profidrive.parameter")
local places_of = require("ds47.profidrive.layouts").places
local reader = require("ds47.support.bytes")
local refusal = later("ds47.diagnosis.refusal")
local repair = later("ds47.diagnosis.repair")
local rules = require("ds47.acyclic.judge")
local suggest = later("ds47.diagnosis.suggest")
local tables = require("ds47.spec.tables")

local any, filtered, min = arrays.any, arrays.filtered, math.min
local code_of, is_absurd = formats.code_of, formats.is_absurd

local M = {}

local VALUE = tables.layouts.ADDRESS_VALUE
local PNU_ACCESS_IDENTIFICATION = rules.PNU_ACCESS_IDENTIFICATION
local USUAL = {[0x01] = true, [0x02] = true} -- response ids without a refusal
local LEARNT = {[0x01] = true, [0x02] = true, [0x81] = true, [0x82] = true}

local CUT = {DS315 = true} -- the flaw of a message that ends too soon
local LOCAL = 0xB02E -- index of local access: the slot decides, not the axis byte
local SEVERAL = -1 -- in place of a format: a PNU is read in several
local NONE = {}
local ONLY = 0 -- second key of a memory that needs none
local NO_END = 2 ^ 17 -- behind every subindex

-- As which type the drive has described a parameter of a request, and where: {format, frame}.
local function described(job, pnu)
  for number, meaning in pairs(job.meanings or NONE) do
    if job.message.addresses[number].pnu == pnu and meaning.type then
      return {format = code_of(meaning.type.value), frame = meaning.type.frame}
    end
  end
  return nil
end

-- The way of a request to its drive object, as one text: device, slot, subslot, and the axis byte where it
-- counts. Two requests that go the same way reach the same drive object, whatever the device makes of them.
-- @param record what has `index`, `slot` and `subslot`
local function way(device, record, axis)
  axis = record.index ~= LOCAL and axis or -1
  return device .. "\0" .. (record.slot * 65536 + record.subslot) * 257 + axis
end

local function way_of(job) return way(job.peer.device, job.record, job.message.axis) end

local MEMORIES = {
  "formats", -- way, PNU -> {format, frame}: the format in which it was read last, and where first
  "anywhere", -- device, PNU -> the format in which it is read, or SEVERAL
  "limits", -- device, PNU 974 -> bytes of its longest message
  "longest", -- device, ONLY -> bytes of its longest response
  "axes", -- device, ONLY -> set of the axes that answered where the axis byte counts,
  "missing", -- and of those that it has not
  "refused", -- what a device refused, by the keys of refusal.sign
  "ends", -- device, PNU -> least end of subindices that was refused
}

local Diagnoses = {}
Diagnoses.__index = Diagnoses

--- Takes jobs as they are closed.
function M.new(codec)
  local diagnoses = setmetatable({codec = codec}, Diagnoses)
  for _, name in ipairs(MEMORIES) do diagnoses[name] = memory.new(tables.known.history) end
  return diagnoses
end

--- The same diagnoses as ones that go on alone.
function Diagnoses:apart()
  local diagnoses = M.new(self.codec)
  for _, name in ipairs(MEMORIES) do diagnoses[name] = self[name]:apart() end
  return diagnoses
end

-- Whether a job that was answered well may have something to be repaired all the same.
local function is_odd(job)
  local message = job.message
  if message == nil then return false end
  if message.flaws[1] then return true end
  if message.operation == "read" then -- the response may have been too long
    return #places_of(job.response) < #message.addresses
  end
  return any(message.blocks, is_absurd)
end

-- Whether a job has a response that nothing is to be said of, as nearly all have.
local function is_answered_well(job, response)
  return response and USUAL[response.response_id or 0] and not response.flaws[1] and not is_odd(job)
end

--- What a closed job shows, and the findings it has, were caused by: an array of remarks, for reading only.
function Diagnoses:closed(job)
  local read, message, response, device = job.read_response, job.message, job.response, job.peer.device
  local longest = self.longest.values[device]
  local bytes = read and (read.cut and read.stated or #read.data) or 0
  if bytes > (longest and longest[ONLY] or 0) then self.longest:put(device, ONLY, bytes) end
  local in_order, well = order.is_usual(job), is_answered_well(job, response)
  local remarks = NONE
  if not (in_order and well) then
    remarks = {}
    if not in_order then
      order.add(remarks, job)
      length.read_too_short(remarks, job)
    end
    if not well and not job.missing then self:_cause(remarks, job) end
    for number = 1, #remarks do
      local remark = remarks[number]
      remark.order = job.order
      if tables.rules[remark.rule].args.family then
        remark.args.family = dictionary.family_of(job.peer.vendor_id, job.peer.family)
      end
      self:_offer(job, remark)
    end
  end
  if message and response then self:_learn(job) end
  return remarks
end

-- One cause explains a job: a repair all of it, or lengths; else each refusal has its own.
function Diagnoses:_cause(remarks, job)
  local refused = refusal.refusals(job)
  self:_learn_refused(job, refused)
  local found, device, before = self:_repair(job, refused), job.peer.device, #remarks
  if found and not found.each then
    self:_repaired(remarks, job, found)
    return
  elseif found then
    refused = self:_retyped(remarks, job, found, refused)
  end
  local function size_of(pnu) return self:_size(job, pnu) end
  local function read(pnu) return self:_read_size(job, pnu) end
  length.request_too_short(remarks, job, refused)
  length.answer_cut(remarks, job, read)
  length.read_refused(remarks, job, size_of)
  local stated = self.limits:get(device, PNU_ACCESS_IDENTIFICATION)
  length.answer_too_long(remarks, job, stated, self.longest:get(device, ONLY) or 0, size_of, read)
  refusal.add(remarks, job, refused, function(remark, each) self:_suggest(job, remark, each) end)
  if #remarks == before then refusal.not_seen(remarks, job) end
end

-- The error numbers of what was refused, by the numbers of the parameters.
local function errors_of(refused)
  local errors = {}
  for _, each in ipairs(refused) do errors[each.number] = each.code end
  return errors
end

function Diagnoses:_repair(job, refused)
  local half, message = job:write_request(), job.message
  if half == nil or half.missing then return nil end
  local peer = job.peer
  local function is_known(pnu)
    return dictionary.is_known(pnu, peer.vendor_id, peer.family) or self.anywhere:get(peer.device, pnu) ~= nil
  end
  local function format_of(pnu) return self:_format(job, pnu) end
  local options = {
    legacy_g120_formats = self.codec.legacy_g120_formats, profile_v3_types = self.codec.profile_v3_types,
    vendor_id = job.peer.vendor_id, family = dictionary.family_of(peer.vendor_id, peer.family),
  }
  return repair.find(half.data, message, errors_of(refused), is_known, format_of, options)
end

-- Adds that a request was meant as a whole in another way (DS715, DS716).
function Diagnoses:_repaired(remarks, job, found)
  found.args.what = found.what
  rules.put(remarks, found.rule, job:write_request().frame, found.args)
  local request = parameter.decode_request(found.request, self.codec)
  local proven = found.what ~= "values"
  for number = 1, #request.blocks do proven = proven and self:_is_proven(job, request, number) end
  if request.operation == "read" or proven then remarks[#remarks].corrected = found.request end
end

-- Which of the values under another format are proven: a set, and whether the whole corrected request is,
-- because nothing else of it was refused or is not answered.
function Diagnoses:_sure(job, found, request)
  local sure, whole, response = {}, true, job.response
  local failed = response and refusal.failed(response) or {}
  for _, each in ipairs(found.each) do
    sure[each.number] = each.bits ~= "number_other" and self:_is_proven(job, request, each.number) or nil
    whole = whole and sure[each.number]
  end
  for number in pairs(failed) do whole = whole and sure[number] end
  return sure, whole and (response and #response.blocks or 0) >= #request.addresses
end

-- Adds the values under a format that is not that of the parameter, each by itself (DS714).
-- @return the parameters that were refused besides
function Diagnoses:_retyped(remarks, job, found, refused)
  local frame, told, errors = job:write_request().frame, {}, errors_of(refused)
  local request, from = parameter.decode_request(found.request, self.codec), way_of(job)
  local sure, whole = self:_sure(job, found, request)
  for _, each in ipairs(found.each) do
    local args = each.args
    local seen, said = self.formats:get(from, args.pnu), described(job, args.pnu)
    if seen or said or self:_agrees(job, args.pnu, args.code) then
      told[each.number] = true
      args.better_code, args.bits, args.code = args.code, each.bits, errors[each.number]
      args.seen = seen and seen.frame or said and said.frame
      args.case = seen and "format_read" or said and "format_described"
        or self:_listed(job, args.pnu) and "format_listed" or "format_bits"
      rules.put(remarks, found.rule, frame, args)
      if sure[each.number] then
        remarks[#remarks].corrected = whole and found.request or suggest.only(request, {each.number})
      end
    end
  end
  return filtered(refused, function(each) return not told[each.number] end)
end

-- Whether the parameter was read in this format, in the way in which the request goes, or is described so.
function Diagnoses:_is_proven(job, request, number)
  local address, block = request.addresses[number], request.blocks[number]
  if not block then return false end -- the request ends before this value
  local seen = self.formats:get(way(job.peer.device, job.record, request.axis), address.pnu)
    or request.axis == job.message.axis and described(job, address.pnu) or nil
  return seen ~= nil and seen.format == block.format
end

-- What may be offered instead

-- What is to be sent instead of what the drive refused, as far as one can tell.
function Diagnoses:_suggest(job, remark, refused)
  local half, message = job:write_request(), job.message
  if remark.rule == "DS709" then
    -- A read may be asked of the only drive object that answers; a change never goes elsewhere.
    if half and message.operation == "read" and job.record.index ~= LOCAL then
      remark.corrected, remark.elsewhere = half.data, true
    end
  elseif remark.rule == "DS717" and refused.code == tables.known.no_array then
    -- A parameter that is no array; a change only where its format is proven.
    if not message.blocks[1] or self:_is_proven(job, message, refused.number) then
      remark.corrected = refusal.without_index(job, refused.number)
    end
  end
end

-- Makes an offer of a corrected request: whether the capture speaks against it is known at its end.
function Diagnoses:_offer(job, remark)
  local request, elsewhere, record = remark.corrected, remark.elsewhere, job.record
  remark.corrected, remark.elsewhere = nil, nil
  if request == nil then return end
  if not elsewhere and not suggest.is_harmless(parameter.decode_request(request, self.codec)) then return end
  remark.corrected = {
    bytes = request, elsewhere = elsewhere, device = job.peer.device,
    record = {index = record.index, slot = record.slot, subslot = record.subslot},
  }
end

--- What of an offer holds at the end of the capture: the bytes of a request, or nil.
function Diagnoses:offered(offer)
  if offer.elsewhere then return self:_only_axis(offer) end
  return self:_unless_refused(offer, offer.bytes, parameter.decode_request(offer.bytes, self.codec))
end

-- The only axis of a device that answered; nil where it is none, or several. 0 names none.
function Diagnoses:_axis_of(device)
  local missing, found = self.missing:get(device, ONLY) or NONE, nil
  for axis in pairs(self.axes:get(device, ONLY) or NONE) do
    if not missing[axis] then
      if found then return nil end
      found = axis
    end
  end
  return found ~= 0 and found or nil
end

-- The request for the only drive object that answered up to now, which read all of it.
function Diagnoses:_only_axis(offer)
  local axis = self:_axis_of(offer.device)
  if not axis then return nil end
  local there = suggest.with_axis(offer.bytes, axis)
  local request = parameter.decode_request(there, self.codec)
  if not reader.only_zeros(request.rest, 0) then -- bytes behind its end belong to no request
    there = suggest.without_rest(request)
  end
  local from = way(offer.device, offer.record, request.axis)
  for _, address in ipairs(request.addresses) do
    if address.attribute ~= VALUE or not self.formats:get(from, address.pnu) then return nil end
  end
  return self:_unless_refused(offer, there, request)
end

function Diagnoses:_unless_refused(offer, bytes, request)
  local device = offer.device
  local missing = offer.record.index ~= LOCAL and self.missing:get(device, ONLY) or NONE
  if missing[request.axis or -1] or refusal.is_signed(self.refused, device, request) then return nil end
  for _, address in ipairs(request.addresses) do
    if refusal.stop(address) >= (self.ends:get(device, address.pnu) or NO_END) then return nil end
  end
  return not parameter.has_one_of(request.flaws, CUT) and bytes or nil
end

function Diagnoses:_learn_refused(job, refused)
  local device, request, response = job.peer.device, job.message, job.response
  for _, each in ipairs(refused) do
    local whose, of_what = refusal.sign(device, request, response, each)
    if whose then self.refused:put(whose, of_what, true) end
    if each.code == refusal.NO_SUBINDEX then
      local pnu, stop = each.address.pnu, refusal.stop(each.address)
      self.ends:put(device, pnu, min(stop, self.ends:get(device, pnu) or stop))
    end
  end
end

-- What was seen before

-- Keeps the axis of a request that was answered where the axis byte counts, or one that does not exist.
function Diagnoses:_learn_axis(job)
  local device, axis, refused = job.peer.device, job.message.axis, false
  if job.record.index == LOCAL or axis == nil then return end
  local places = places_of(job.response)
  for number = 1, #places do
    local failure = places[number].error
    refused = refused or failure ~= nil and failure.code == tables.known.axis_error
  end
  local kept = refused and self.missing or self.axes
  local before = kept:get(device, ONLY)
  if before and before[axis] or rules.is_mismatch(job) then return end
  local axes = {[axis] = true}
  for each in pairs(before or NONE) do axes[each] = true end
  kept:put(device, ONLY, axes)
end

-- Keeps what an answer tells; nearly every one tells what is known.
function Diagnoses:_learn(job)
  local request, response = job.message, job.response
  if not LEARNT[response.response_id] then return end
  self:_learn_axis(job)
  if request.operation == "read" then self:_learn_formats(job) end
end

-- One look for each block, and no more.
function Diagnoses:_learn_formats(job)
  local request, response = job.message, job.response
  local from, addresses, places = way_of(job), request.addresses, places_of(response)
  local known = self.formats:of(from)
  for number = 1, min(#addresses, #places) do
    local address = addresses[number]
    local pnu = address.pnu
    local seen = known[pnu]
    if not seen or seen.format ~= places[number].format or pnu == PNU_ACCESS_IDENTIFICATION then
      if rules.is_mismatch(job) then return end
      self:_learn_block(job.peer.device, from, address, response.blocks[number], job.read_response.frame)
    end
  end
end

function Diagnoses:_learn_block(device, from, address, block, frame)
  local pnu = address.pnu
  if block.error ~= nil or address.attribute ~= VALUE then return end
  local seen = self.formats:get(from, pnu)
  if not seen or seen.format ~= block.format then
    self.formats:put(from, pnu, {format = block.format, frame = frame})
    local before = self.anywhere:get(device, pnu)
    self.anywhere:put(device, pnu, (not before or before == block.format) and block.format or SEVERAL)
  end
  if pnu == PNU_ACCESS_IDENTIFICATION and address.subindex == 0 then self:_learn_limit(device, block) end
end

function Diagnoses:_learn_limit(device, block)
  local longest = block.values[1]
  if type(longest) == "number" and not block.float and longest > 0 then
    self.limits:put(device, PNU_ACCESS_IDENTIFICATION, longest)
  end
end

-- Whether nothing that was read of the device speaks against a format.
function Diagnoses:_agrees(job, pnu, code)
  local read = self.anywhere:get(job.peer.device, pnu)
  return read == nil or read == code
end

-- The format by the list of parameters, where nothing that was read of the device differs from it.
function Diagnoses:_listed(job, pnu)
  local row = dictionary.listed(pnu, job.peer.vendor_id, job.peer.family)
  local code = row and code_of((row.type:gsub("%[%]$", "")))
  return code and self:_agrees(job, pnu, code) and code or nil
end

function Diagnoses:_format(job, pnu)
  local shown = self.formats:get(way_of(job), pnu) or described(job, pnu)
  return shown and shown.format or self:_listed(job, pnu)
end

-- Bytes of one value, as it was read, or by the list of parameters.
function Diagnoses:_size(job, pnu)
  local read = self:_read_size(job, pnu)
  if read or self.formats:get(way_of(job), pnu) then return read end
  local row = tables.formats[self:_listed(job, pnu)]
  return row and row.size
end

-- Bytes of one value, as it was read in the way of a request; nil of a format that has two sizes.
function Diagnoses:_read_size(job, pnu)
  local seen = self.formats:get(way_of(job), pnu)
  local codec = seen and parameter.sound_codec(seen.format, self.codec)
  return codec and codec.size > 0 and codec.size or nil
end

return M
