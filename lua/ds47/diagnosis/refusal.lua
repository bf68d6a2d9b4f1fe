-- Diagnoses of what the drive refused: from error number and request to what has to be changed (DS701, 709,
-- 717 to 720).
--
-- One error block has one cause. What a repair of the whole request explains is not looked at here.

local dictionary = require("ds47.profidrive.dictionary")
local formats = require("ds47.profidrive.formats")
local rules = require("ds47.acyclic.judge")
local spec = require("ds47.spec.lookup")
local tables = require("ds47.spec.tables")

local later = require("ds47.support.later").module
local mapped = require("ds47.support.arrays").mapped
local parameter = require("ds47.profidrive.parameter")
local reader = require("ds47.support.bytes")
local suggest = later("ds47.diagnosis.suggest") -- only here: most captures need no correction

local is_cut_off, is_mismatch, NOT_SUPPORTED = rules.is_cut_off, rules.is_mismatch, parameter.NOT_SUPPORTED

local char, floor, max = string.char, math.floor, math.max

local M = {}

local SIEMENS = dictionary.SIEMENS
local WORD_ERRORS = {[0x05] = true, [0x17] = true} -- data type, format: a number where a connector belongs
local UNSIGNED_32 = "Unsigned32"
local NO_PARAMETER = 0x00
local NO_SUBINDEX = 0x03
local WRONG_COUNT = 0x18 -- of the errors of index and count the one that depends on the values, too
local NONE = {}
local NO_SUCH_ATTRIBUTE = {[0x09] = true, [0x0F] = true} -- no description, no text

M.NO_SUBINDEX = 0x03

--- The parameters of a job that the drive refused: array of {number, code, address, answer, value}.
-- `value` is the block that was to be written, nil for a read. Empty where the response is that of another
-- request.
function M.refusals(job)
  local request, response, found = job.message, job.response, {}
  if request == nil or response == nil or is_mismatch(job) then return found end
  for number, address in ipairs(request.addresses) do
    local block = response.blocks[number]
    if block == nil then break end
    if block.error and block.error.code then
      found[#found + 1] = {
        number = number, code = block.error.code, address = address, answer = block,
        value = request.blocks[number],
      }
    end
  end
  return found
end

-- Of what something is said: PNU, attribute with PNU, address, or that with the value.
local function signs_of(address, value)
  local pnu, subindex = reader.of_number(address.pnu, 2), reader.of_number(address.subindex, 2)
  local place = char(address.attribute, address.element_count) .. pnu .. subindex
  local whole = value and char(value.format, value.value_count) .. value.raw or ""
  return {pnu = pnu, attribute = char(address.attribute) .. pnu, place = place, whole = place .. "=" .. whole}
end

local BOTH = "" -- operations

-- Device and operation, the first key of what is remembered.
local function head(device, operation) return device .. "\0" .. operation end

--- What a refusal says of further requests, as two keys of a memory: device with operation, and of what.
-- Nil where it says nothing of the parameter.
function M.sign(device, request, response, refused)
  local code, known = refused.code, tables.known
  if code == known.axis_error or code == known.too_long or response.response_id == NOT_SUPPORTED then
    return nil
  end
  local found, whose = signs_of(refused.address, refused.value), head(device, request.operation)
  if code == NO_PARAMETER then return head(device, BOTH), found.pnu end
  if known.type_errors[code] or code == WRONG_COUNT then return whose, found.whole end
  if NO_SUCH_ATTRIBUTE[code] then return whose, found.attribute end
  return whose, known.index_errors[code] and found.place or found.pnu
end

--- Whether a memory of signs has one of a parameter of this request.
function M.is_signed(memory, device, request)
  local whose, both = head(device, request.operation), head(device, BOTH)
  for number, address in ipairs(request.addresses) do
    local found = signs_of(address, request.blocks[number])
    if memory:get(both, found.pnu) then return true end
    for _, sign in pairs(found) do
      if memory:get(whose, sign) then return true end
    end
  end
  return false
end

--- The subindex behind the last one that is asked for.
function M.stop(address) return address.subindex + max(1, address.element_count) end

--- Which parameters have an error block, by their place: also one that ends before its error number.
function M.failed(response)
  return mapped(response.blocks, function(block) return block.error and true or nil end)
end

--- The request for a parameter that is no array, as that of a simple one; nil where it is none. That one
-- alone where others were refused, or where the response ends before it says what became of them. Of several
-- values it is not known which is meant.
function M.without_index(job, number)
  local write, message, response = job:write_request(), job.message, job.response
  if not write or not message or not response then return nil end
  local block = message.blocks[number]
  if block and block.value_count ~= 1 then return nil end
  local whole = suggest.with_elements(message, write.data, number, 0, 1)
  if not whole then return nil end
  local others, request = M.failed(response), parameter.decode_request(whole)
  others[number] = nil
  if #response.blocks < #message.addresses or next(others) then return suggest.only(request, {number}) end
  -- bytes behind its end belong to no request
  return reader.only_zeros(request.rest, 0) and whole or suggest.without_rest(request)
end

-- Whether a value was written to what takes the source of a signal.
local function is_connector(refusal)
  local value = refusal.value
  if refusal.code == tables.known.connector_error then return true end
  return WORD_ERRORS[refusal.code] and tables.known.connectors[refusal.address.pnu]
    and value.format_name ~= UNSIGNED_32
end

-- Whether index or count can be what the drive means: an address without both has neither.
local function index_and_count(refusal)
  local address, code = refusal.address, refusal.code
  local either = address.subindex > 0 or address.element_count > 1
  if code == 0x04 or code == 0x18 then return true end
  return either and (code == 0x03 or address.pnu ~= 0)
end

-- Whether the drive knows no parameter of this number, which is the subindex of a PNU of its maker.
local function by_subindex(refusal, vendor_id)
  local maker = refusal.code == NO_SUBINDEX and spec.vendor(vendor_id)
  return maker and maker.by_subindex and maker.by_subindex[refusal.address.pnu]
end

local function rule_of(refusal, peer, change)
  local known, code, siemens = tables.known, refusal.code, peer.vendor_id == SIEMENS
  if code == known.axis_error then return "DS709" end
  if siemens and refusal.value and #refusal.value.values > 0 and is_connector(refusal) then return "DS720" end
  if siemens and known.commissioning[code] then return "DS718" end
  if change and (known.running[code] or siemens and known.running_siemens[code]) then return "DS719" end
  if known.index_errors[code] and index_and_count(refusal) and not by_subindex(refusal, peer.vendor_id) then
    return "DS717"
  end
  return nil
end

-- The PNU of the source that a connector was given; nil where it was given a number.
local function source_of(value)
  if value == nil or value.format_name ~= UNSIGNED_32 or value.values[1] == nil then return nil end
  local pnu = floor(value.values[1] / 65536)
  return pnu > 0 and pnu <= tables.known.source_most and pnu or nil
end

-- Whether the counts can be what 0x18 means; where they agree, how long record and message are.
local function counted(job, refusal)
  local value, half = refusal.value, job:write_request()
  local agree = value and value.value_count == max(1, refusal.address.element_count)
  if refusal.code ~= WRONG_COUNT or half == nil or not agree then return "counts" end
  local rest = #job.message.rest
  if (half.missing or 0) > 0 or rest == 0 then return "counts_agree" end
  return "record_longer", #half.data, #half.data - rest
end

-- What the rule carries, of all that a refusal shows.
local function args_of(job, rule, refusal)
  local address, value = refusal.address, refusal.value
  local source = source_of(value)
  local facts, args = {
    axis = job.message.axis, device = job.peer.device, vendor_id = job.peer.vendor_id, code = refusal.code,
    pnu = address.pnu, subindex = address.subindex, elements = address.element_count,
    format = value and value.format_name, value = value and formats.argument(value.values[1], value),
    source = source, case = source and "source_refused" or "no_source",
    state = tables.known.commissioning[refusal.code],
  }, {}
  if rule == "DS717" then facts.case, facts.have, facts.need = counted(job, refusal) end
  for name in pairs(tables.rules[rule].args) do args[name] = facts[name] end
  return args
end

--- Adds what the refusals of a job say: each parameter by itself, a missing drive object once.
-- @param refused  what `refusals` gave
-- @param suggested  a function of a remark and its refusal, which may give it a corrected request
function M.add(remarks, job, refused, suggested)
  local half, missing = job.read_response, false
  if half == nil then return end
  local change = job.message ~= nil and job.message.operation == "change"
  for _, refusal in ipairs(refused) do
    local rule = rule_of(refusal, job.peer, change)
    if rule and not (rule == "DS709" and missing) then
      missing = missing or rule == "DS709"
      local args = args_of(job, rule, refusal)
      rules.put(remarks, rule, half.frame, args, refusal.answer.offset)
      suggested(remarks[#remarks], refusal)
    end
  end
end

--- Adds a refusal that no status tells of, and of which nothing better can be said.
function M.not_seen(remarks, job)
  local half, response = job.read_response, job.response
  local id = response and response.response_id
  if half == nil or id == nil or id < 0x80 or id == NOT_SUPPORTED or is_mismatch(job) then return end
  local write = job.write_response
  if half.status ~= 0 or write and (write.status or 0) ~= 0 then return end
  if job.message == nil and job.repeats then return end -- told of the transaction that it repeats
  local failed, code, among = false, nil, false
  for _, block in ipairs(response.blocks) do
    local error = block.error or NONE
    failed = failed or block.error ~= nil and not is_cut_off(half, block)
    code = code or error.code
    among = among or error.code ~= nil and error.code ~= code
  end
  if failed then
    local polls = #job:not_ready()
    rules.put(remarks, "DS701", half.frame, {
      id = id, code = code, among = among, vendor_id = job.peer.vendor_id,
      case = polls > 0 and "status_zero_at_last" or "status_zero", polls = polls,
      asked = job.message and job.message.parameter_count,
    })
  end
end

return M
