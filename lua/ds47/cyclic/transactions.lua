-- A finished request of PKW as the transaction of a report: its state, its parameter, its frames and times.
-- What was wrong with it is not said here. Keys of a transaction are those of acyclic/transactions.lua.

local flat = require("ds47.support.flat").copy
local handshake = require("ds47.cyclic.handshake")
local dictionary = require("ds47.profidrive.dictionary")
local lookup = require("ds47.spec.lookup")
local pkw = require("ds47.cyclic.pkw")
local relations = require("ds47.cyclic.relations")
local tables = require("ds47.spec.tables")
local uuid_text = require("ds47.spec.units").uuid_text

local M = {CHANNEL = "pkw"}

local NONE = {}
local OPERATIONS = {read = "read", description = "read", count = "read", text = "read", change = "change"}
local ATTRIBUTES = {description = "description", text = "text"}
local FORMATS = {[16] = "Word", [32] = "DoubleWord"}

local function access_of(asked) return tables.pkw.requests[asked.ak].access end

local function format_of(source)
  if source.float then return "Float32" end
  return FORMATS[tables.pkw[source.answer and "answers" or "requests"][source.ak].width or 16]
end

-- The parameter, with the value that was written or is answered.
local function parameter(relation, asked, told)
  local access, siemens = access_of(asked), relation.vendor_id == relations.SIEMENS
  local failed
  if told and told.error then
    failed = {code = told.error.code, vendor_id = relation.vendor_id, ak = told.ak}
  end
  local source = access == "change" and asked or told
  local value
  if source and not (failed and access ~= "change") then value = source.value end
  local family = relations.drives(relation)
  local known = siemens and asked.pnu and lookup.parameter(asked.pnu, family) or nil
  -- the number of elements is no value of the parameter
  local format_name = value ~= nil and access ~= "count" and format_of(source) or nil
  return {
    pnu = asked.pnu, subindex = asked.subindex, attribute = ATTRIBUTES[access] or "value",
    listed = known, unit = dictionary.unit_of(known, format_name), format = format_name,
    value_count = value ~= nil and 1 or nil, values = {value}, error = failed,
    family = family,
  }
end

--- The parameter as the request alone names it: without what only its response says.
function M.asked(item, operation)
  local asked = flat(item)
  asked.error = nil
  if operation ~= "change" then
    asked.format, asked.value_count, asked.values, asked.scaled, asked.value_texts = nil, nil, NONE, nil, nil
  end
  return asked
end

--- The request of a job, and its response as far as there is one that counts: as pkw.lua decodes them.
function M.decoded(job, layout)
  local answer = job.answer
  return pkw.decode(job.request.data, false, layout), answer and pkw.decode(answer.data, true, layout) or nil
end

-- The state: that of a job that is over, else what the response says that is there.
local function state_of(job, told) return job.state or told and (told.error and "error" or "ok") or nil end

--- The transaction of a request, over or not. `places` says where its words are in its frames, behind the
-- frame ids.
-- @param relation as relations.lua has it
-- @param job as handshake.lua has it, with its `order`
-- @param layout "cyclic" or "uss"
function M.build(relation, job, layout)
  local asked, told = M.decoded(job, layout)
  local answer = job.answer or (job.state == "mismatch" and job.odd) or nil
  local cycles, duration = handshake.duration(job)
  if relation.input.cycle_ns == 0 then cycles = nil end -- not known
  return {
    id = 0, findings = {}, order = job.order, channel = M.CHANNEL, cycles = cycles, position = 0,
    layout = layout,
    operation = OPERATIONS[access_of(asked)] or "unknown", state = state_of(job, told),
    controller = relation.controller, device = relation.device, vendor_id = relation.vendor_id,
    family = relation.family, ar = relation.ar and uuid_text(relation.ar), api = relation.api,
    slot = relation.slot, subslot = relation.subslot, station = relations.station(relation),
    frames = {
      write_request = job.request.at.frame, read_response = answer and answer.at.frame,
      polls = NONE, rereads = NONE,
    },
    places = {write_request = relation.output.offset, read_response = relation.input.offset},
    start_ns = job.request.at.time, duration_ns = duration,
    request = job.request.data, response = answer and answer.data,
    parameters = {parameter(relation, asked, told)},
  }
end

return M
