-- Diagnoses: what went wrong and what to change, from findings, frames and their history
-- (docs/diagnoses.md).
--
-- A finding names a symptom, a diagnosis its cause. Diagnoses are rules like the others (DS7xx) and made when
-- a job is closed: order.lua (frames), length.lua, refusal.lua (error numbers)
-- and repair.lua (what the bytes were meant to be). Those that need the whole capture are the analyzer's
-- alone.

local later = require("ds47.support.later").module
local length = later("ds47.diagnosis.length")
local memory = require("ds47.diagnosis.memory")
local order = require("ds47.diagnosis.order")
local refusal = later("ds47.diagnosis.refusal")
local repair = later("ds47.diagnosis.repair")
local rules = require("ds47.acyclic.judge")
local tables = require("ds47.spec.tables")
local transactions = require("ds47.acyclic.transactions")

local abs, min = math.abs, math.min

local M = {}

local SIEMENS = transactions.SIEMENS
local VALUE = tables.layouts.ADDRESS_VALUE
local PNU_ACCESS_IDENTIFICATION = rules.PNU_ACCESS_IDENTIFICATION
-- Float32 and Float64: what is nearer to zero is no number that anybody typed, nor is what is farther away
-- than MOST.
local LEAST_NORMAL = {[0x08] = 2 ^ -126, [0x0F] = 2 ^ -1022}
local MOST = 1e30
local USUAL = {[0x01] = true, [0x02] = true} -- response ids without a refusal
local LEARNT = {[0x01] = true, [0x02] = true, [0x81] = true, [0x82] = true}

local LOCAL = 0xB02E -- index of local access: the slot decides, not the axis byte
local SEVERAL = -1 -- in place of a format: a PNU is read in several
local NONE = {}
local LENGTH = 0 -- second key of a memory that needs none

local codes = {} -- name of a format -> its code
for code, row in pairs(tables.formats) do
  codes[row.name] = code
end

-- The format of a parameter by the list of parameters; nil where the list says nothing of this device.
local function listed(pnu, siemens)
  local row = tables.parameters[pnu]
  if not row or row.family ~= "profile" and not siemens then
    return nil
  end
  return codes[(row.type:gsub("%[%]$", ""))]
end

-- The way of a request to its drive object, as one text: device, slot, subslot, and the axis byte where it
-- counts. Two requests that go the same way reach the same drive object, whatever the device makes of them.
local function way_of(job)
  local record = job.record
  local axis = record.index ~= LOCAL and job.message.axis or -1
  return job.peer.device .. "\0" .. (record.slot * 65536 + record.subslot) * 257 + axis
end

local Diagnoses = {}
Diagnoses.__index = Diagnoses

--- Takes jobs as they are closed.
-- @param codec  dialects of the messages
function M.new(codec)
  return setmetatable({
    codec = codec,
    -- way, PNU -> {format, frame}: the format in which it was read last, and where first
    formats = memory.new(tables.known.history),
    anywhere = memory.new(tables.known.history), -- device, PNU -> the format in which it is read, or SEVERAL
    limits = memory.new(tables.known.history), -- device, PNU 974 -> bytes of its longest message
    longest = memory.new(tables.known.history), -- device, LENGTH -> bytes of its longest response
  }, Diagnoses)
end

--- For a copy of the analysis: what is known is shared, what the copy learns stays its own.
function Diagnoses:copied(known)
  known[self.formats] = self.formats:on_top()
  known[self.anywhere] = self.anywhere:on_top()
  known[self.limits] = self.limits:on_top()
  known[self.longest] = self.longest:on_top()
end

-- Whether a job that was answered well may have something to be repaired all the same.
local function is_odd(job)
  local message = job.message
  if message == nil then
    return false
  elseif message.flaws[1] then
    return true
  elseif message.operation == "read" then -- the response may have been too long
    return #job.response.blocks < #message.addresses
  end
  for _, block in ipairs(message.blocks) do
    local least = LEAST_NORMAL[block.format]
    for _, value in ipairs(least and block.values or NONE) do
      if type(value) == "string" then -- NaN or infinite
        return true
      elseif value ~= 0 and (abs(value) < least or abs(value) > MOST) then
        return true
      end
    end
  end
  return false
end

-- Whether a job has a response that nothing is to be said of, as nearly all have.
local function is_answered_well(job)
  local response = job.response
  return response and USUAL[response.response_id or 0] and not response.flaws[1] and not is_odd(job)
end

--- What a closed job shows, and the findings it has, were caused by: an array of remarks, for reading only.
function Diagnoses:closed(job)
  if job.read_response then
    self:_learn_length(job.peer.device, #job.read_response.data)
  end
  local in_order, well = order.is_usual(job), is_answered_well(job)
  local remarks = NONE
  if not (in_order and well) then
    remarks = {}
    if not in_order then
      order.add(remarks, job)
    end
    if not well then
      self:_cause(remarks, job)
    end
    for number = 1, #remarks do
      remarks[number].job = job
    end
  end
  if job.response and job.message then
    self:_learn(job)
  end
  return remarks
end

-- One cause explains a job: a repair all of it, or lengths; else each refusal has its own.
function Diagnoses:_cause(remarks, job)
  local refused = refusal.refusals(job)
  local found, device, before = self:_repair(job, refused), job.peer.device, #remarks
  if found and not found.each then
    found.args.what = found.what
    rules.put(remarks, found.rule, job:write_request().frame, found.args)
    return
  elseif found then
    refused = self:_retyped(remarks, job, found, refused)
  end
  local function size_of(pnu)
    return self:_size(job, pnu)
  end
  length.request_too_short(remarks, job, refused)
  length.answer_cut(remarks, job, size_of)
  local stated = self.limits:get(device, PNU_ACCESS_IDENTIFICATION)
  length.answer_too_long(remarks, job, stated, self.longest:get(device, LENGTH) or 0, size_of)
  refusal.add(remarks, job, refused)
  if #remarks == before then
    refusal.not_seen(remarks, job)
  end
end

function Diagnoses:_repair(job, refused)
  local half, message = job:write_request(), job.message
  if half == nil or half.missing ~= 0 then
    return nil
  end
  local device, errors = job.peer.device, {}
  for _, each in ipairs(refused) do
    errors[each.number] = each.code
  end
  local function is_known(pnu)
    return tables.parameters[pnu] ~= nil or self.anywhere:get(device, pnu) ~= nil
  end
  local function format_of(pnu)
    return self:_format(job, pnu)
  end
  local options = {
    legacy_g120_formats = self.codec.legacy_g120_formats, profile_v3_types = self.codec.profile_v3_types,
    vendor_id = job.peer.vendor_id,
  }
  return repair.find(half.data, message, errors, is_known, format_of, options)
end

-- Adds the values under a format that is not that of the parameter, each by itself (DS714).
-- @return the parameters that were refused besides
function Diagnoses:_retyped(remarks, job, found, refused)
  local frame, told, errors, others = job:write_request().frame, {}, {}, {}
  for _, each in ipairs(refused) do
    errors[each.number] = each.code
  end
  local way = way_of(job)
  for _, each in ipairs(found.each) do
    local args = each.args
    local seen = self.formats:get(way, args.pnu)
    if seen or self:_agrees(job, args.pnu, args.code) then
      told[each.number] = true
      args.better_code, args.bits, args.code = args.code, each.bits, errors[each.number]
      args.seen = seen and seen.frame
      args.case = seen and "format_read" or self:_listed(job, args.pnu) and "format_listed" or "format_bits"
      rules.put(remarks, found.rule, frame, args)
    end
  end
  for _, each in ipairs(refused) do
    if not told[each.number] then
      others[#others + 1] = each
    end
  end
  return others
end

-- What was seen before

-- Nearly every answer tells what is known: one look for each block, and no more.
function Diagnoses:_learn(job)
  local request, response = job.message, job.response
  if request.operation ~= "read" or not LEARNT[response.response_id] then
    return
  end
  local way, addresses, blocks = way_of(job), request.addresses, response.blocks
  local known = self.formats:of(way)
  for number = 1, min(#addresses, #blocks) do
    local address, block = addresses[number], blocks[number]
    local pnu = address.pnu
    local seen = known[pnu]
    if not seen or seen.format ~= block.format or pnu == PNU_ACCESS_IDENTIFICATION then
      if rules.is_mismatch(job) then
        return
      end
      self:_learn_block(job.peer.device, way, address, block, job.read_response.frame)
    end
  end
end

function Diagnoses:_learn_block(device, way, address, block, frame)
  local pnu = address.pnu
  if block.error ~= nil or address.attribute ~= VALUE then
    return
  end
  local seen = self.formats:get(way, pnu)
  if not seen or seen.format ~= block.format then
    self.formats:put(way, pnu, {format = block.format, frame = frame})
    local before = self.anywhere:get(device, pnu)
    self.anywhere:put(device, pnu, (not before or before == block.format) and block.format or SEVERAL)
  end
  if pnu == PNU_ACCESS_IDENTIFICATION and address.subindex == 0 then
    self:_learn_limit(device, block)
  end
end

function Diagnoses:_learn_length(device, bytes)
  if bytes > (self.longest:get(device, LENGTH) or 0) then
    self.longest:put(device, LENGTH, bytes)
  end
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
  local code = listed(pnu, job.peer.vendor_id == SIEMENS)
  return code and self:_agrees(job, pnu, code) and code or nil
end

function Diagnoses:_format(job, pnu)
  local seen = self.formats:get(way_of(job), pnu)
  return seen and seen.format or self:_listed(job, pnu)
end

function Diagnoses:_size(job, pnu)
  local row = tables.formats[self:_format(job, pnu)]
  return row and row.size
end

return M
