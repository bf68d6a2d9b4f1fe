-- A finished job as the transaction of a report: its state, its parameters, its frames and times.
--
-- States and parameters follow docs/pairing.md; judge.lua makes the findings. A transaction has the keys of
-- python/ds47/model.py, and `order`, the number of its job while the capture goes on.

local copy = require("ds47.support.flat").copy
local mapped = require("ds47.support.arrays").mapped
local dictionary = require("ds47.profidrive.dictionary")
local naming = require("ds47.parameters.naming")
local parameter = require("ds47.profidrive.parameter")
local places_of = require("ds47.profidrive.layouts").places
local records = require("ds47.profinet.records")
local rules = require("ds47.acyclic.judge")
local lookup = require("ds47.spec.lookup")
local tables = require("ds47.spec.tables")
local uuid_text = require("ds47.spec.units").uuid_text

local huge, min, setmetatable = math.huge, math.min, setmetatable
local is_mismatch, parameters_asked = rules.is_mismatch, rules.parameters_asked
local NOT_SUPPORTED = parameter.NOT_SUPPORTED

local M = {}

local NIL_UUID, NO_API = records.NIL_UUID, records.NO_API

-- Operation and state

local operation_of_response = {} -- response id -> what was asked
for _, known in pairs(tables.request_ids) do
  operation_of_response[known.positive] = known.operation
  operation_of_response[known.negative] = known.operation
end

-- The operation; for an orphan, according to its response id.
local function operation(job)
  if job.message ~= nil then return job.message.operation end
  local response_id = job.response and job.response.response_id
  return response_id and operation_of_response[response_id] or "unknown"
end

local function refused(job)
  local read = job.read_response
  return job.write_refused or (read ~= nil and read.status ~= nil and read.status ~= 0)
end

local function count_failed(blocks)
  local failed = 0
  for number = 1, #blocks do failed = failed + (blocks[number].error and 1 or 0) end
  return failed
end

-- The state if the capture cut off the end of the response, or the number of parameters asked for.
-- `sure`: if no parameter is seen to succeed, all have failed.
local function outcome_as_far_as_seen(done, failed, negative, sure)
  if failed == 0 and not negative then return "ok" end
  return done > 0 and "partial" or sure and "error" or "incomplete"
end

local function outcome(job)
  local response = job.response
  if response == nil or response.response_id == NOT_SUPPORTED then return "error" end
  local blocks = places_of(response)
  local known = tables.response_ids[response.response_id or 0]
  local negative = known ~= nil and known.negative or false
  if #blocks == 0 and known and known.body ~= "blocks" and not negative then
    return "ok" -- a positive response without content
  end
  local failed = count_failed(blocks)
  local done = #blocks - failed
  if response.cut and blocks[#blocks].error == nil then
    done = done - 1 -- the last value is incomplete
  end
  local asked, cut = parameters_asked(job), job.read_response.cut
  if (cut or asked == nil) and done + failed ~= asked then
    local fewer = asked ~= nil and (response.parameter_count or asked) < asked
    local sure = not cut or asked == 1 or asked == failed
    return outcome_as_far_as_seen(done, failed, negative or fewer, sure)
  end
  if done == asked then return negative and "error" or "ok" end
  return done > 0 and "partial" or "error"
end

-- The state of a closed job: the first of docs/pairing.md P39 to P46 that applies.
local function state(job)
  local read = job.read_response
  if job.message == nil then return "orphan" end
  if refused(job) then return "refused" end
  if job.missing then return "incomplete" end
  if read == nil then return job.superseded_by ~= nil and "superseded" or "unanswered" end
  if is_mismatch(job) then return "mismatch" end
  return outcome(job)
end

-- Parameters

local NONE = {}
local NAMELESS = {} -- in place of an address, where no request names the parameter

-- What is known about a parameter from its address and the format of its values (false: no values), on drives
-- of a family: the metatable of all such parameters. It is stored with the address, which equal requests
-- share.
local function new_class(address, whose, format)
  local classes, named = address.classes, address ~= NAMELESS
  if classes == nil or classes.whose ~= whose then
    classes = {whose = whose}
    address.classes = classes
  end
  local known = named and lookup.parameter(address.pnu, whose) or nil
  local class = {
    pnu = address.pnu, subindex = address.subindex, attribute = address.attribute_name,
    element_count = address.element_count, listed = known, unit = dictionary.unit_of(known, format or nil),
    format = format or nil, values = NONE, family = named and whose or nil,
  }
  class.__index, classes[format] = class, class
  return class
end

-- One parameter: `value` is the block with the values, `answer` the one that may hold an error; each may be
-- nil.
local function shown(peer, whose, address, value, answer)
  local result, format
  if value and value.error == nil then
    result = {value_count = value.value_count, values = value.values, scaled = value.scaled, shown = nil}
    format = value.format_name
  else
    result, format = {}, false
  end
  if answer and answer.error ~= nil then
    result.error = {code = answer.error.code, info = answer.error.info, vendor_id = peer.vendor_id}
  end
  local classes = address.classes
  local class = classes and classes.whose == whose and classes[format] or new_class(address, whose, format)
  return setmetatable(result, class)
end

-- Adds to a parameter what the drive or a list says. It then has its own metatable: its unit may be nil.
local function tell(item, told)
  local own = copy(getmetatable(item))
  own.unit, own.described, own.words, own.__index = told.unit, told.described, nil, own
  setmetatable(item, own)
end

-- Adds to the parameters what the drive and lists of the user say.
local function explain(items, meanings, peer)
  for number, item in ipairs(items) do
    local meaning = item.pnu and meanings[number]
    if meaning then
      local told = dictionary.explained(item, meaning)
      tell(item, told)
      item.scaled = told.scaled
    end
    local told = naming.explained(item, peer.vendor_id, peer.device_id)
    if told then
      tell(item, told)
      item.value_texts = told.value_texts
    end
  end
end

--- The parameters of a job as a report shows them (docs/pairing.md P37, P43): an array of {pnu, subindex,
-- attribute, element_count, listed, unit, format, value_count, values, scaled, error, described}. In `shown`
-- a place is kept for the text of a single value, which the plugin keeps there.
function M.parameters(job)
  local request, peer, stray, result = job.message, job.peer, is_mismatch(job), {}
  local whose = dictionary.family_of(peer.vendor_id, peer.family)
  local blocks = job.response and job.response.blocks or NONE
  local change = request ~= nil and request.operation == "change"
  if stray and change then blocks = request.blocks end
  if request == nil or (stray and not refused(job)) then
    for number = 1, #blocks do
      result[number] = shown(peer, whose, NAMELESS, blocks[number], blocks[number])
    end
    return result
  end
  local answers = stray and NONE or blocks
  local values, addresses = change and request.blocks or answers, request.addresses
  for number = 1, #addresses do
    result[number] = shown(peer, whose, addresses[number], values[number], answers[number])
  end
  if job.meanings or naming.is_used() then explain(result, job.meanings or NONE, peer) end
  return result
end

-- Frames

local function pair_of_frames(read)
  return {request = read.request and read.request.frame, response = read.response.frame}
end

local function pairs_of_frames(reads) return #reads > 0 and mapped(reads, pair_of_frames) or NONE end

local function frames_of(job)
  local write = job:write_request()
  return {
    write_request = write and write.frame, write_response = job.write_response and job.write_response.frame,
    read_request = job.read_request and job.read_request.frame,
    read_response = job.read_response and job.read_response.frame,
    polls = pairs_of_frames(job.polls), rereads = pairs_of_frames(job.rereads),
  }
end

--- Every frame of a transaction, in no order; one may be there twice.
function M.all_frames(frames)
  local list = {}
  for _, key in ipairs({"write_request", "write_response", "read_request", "read_response"}) do
    list[#list + 1] = frames[key]
  end
  for _, key in ipairs({"polls", "rereads"}) do
    for _, read in ipairs(frames[key] or NONE) do
      list[#list + 1] = read.request
      list[#list + 1] = read.response
    end
  end
  return list
end

-- The first of them, 0 for none.
local function first_frame(frames)
  local first = huge
  for _, frame in ipairs(M.all_frames(frames)) do first = min(first, frame) end
  return first < huge and first or 0
end

local restored -- the closed job whose response was decoded last for its transaction

local function decode(job, codec)
  local read = job.read_response
  if job.phase == "closed" and job.response == nil and read ~= nil and read.data ~= "" then
    job.response = parameter.decode_response(read.data, job.message, codec, read.cut)
    return true
  end
  return false
end

--- Gives a job that was closed its response again: see `Store:add`.
function M.restore(job, codec)
  decode(job, codec)
  if restored == job then restored = nil end -- it is kept
end

-- The same until another job needs its own.
local function restore_for_now(job, codec)
  if decode(job, codec) then
    if restored then restored.response = nil end
    restored = job
  end
end

-- The keys of a transaction, and what each is: a function of the job.
local KEYS = {
  operation = operation, parameters = M.parameters, state = state, frames = frames_of,
  stray = is_mismatch, -- its response belongs to another request
  drive_ns = rules.drive_time_ns, -- for the statistics; no key of the report
}

-- Keys that the job has under the same name: `meanings` is what the drive has said about its parameters.
for _, key in ipairs({"order", "meanings"}) do
  KEYS[key] = function(job) return job[key] end
end

-- The same for a part of the job.
for part, keys in pairs({
  record = {"slot", "index", "position"},
  peer = {"controller", "device", "vendor_id", "device_id", "vendor_assumed", "station", "family"},
}) do
  for _, key in ipairs(keys) do
    KEYS[key] = function(job) return job[part][key] end
  end
end

for _, key in ipairs({"api", "subslot"}) do
  KEYS[key] = function(job) return job.record.api ~= NO_API and job.record[key] or nil end
end

-- A header field: from the request, or from the response to an unknown one.
for _, key in ipairs({"request_reference", "axis"}) do
  KEYS[key] = function(job)
    local head = job.message or job.response
    return head and head[key]
  end
end

for key, half in pairs({write_status = "write_response", read_status = "read_response"}) do
  KEYS[key] = function(job) return job[half] and job[half].status end
end

-- The word for a record with failed parameters: "error", or "partial" if others did not fail; nil if none
-- failed. For those who show the record; no key of the report.
function KEYS.failing(job)
  local response = job.response
  local blocks = response and not response.layout and response.blocks or NONE -- with a layout none did
  local failed = count_failed(blocks)
  return failed > 0 and (failed < #blocks and "partial" or "error") or nil
end

function KEYS.ar(job)
  local ar = job.record.ar
  return ar ~= NIL_UUID and uuid_text(ar) or nil
end

function KEYS.start_ns(job) return (job:write_request() or job.read_request or job.read_response).time_ns end

function KEYS.duration_ns(job)
  local write, read = job:write_request(), job.read_response
  return write and read and read.data ~= "" and read.time_ns - write.time_ns or nil
end

function KEYS.request(job)
  local write = job:write_request()
  return write and write.data
end

function KEYS.response(job)
  local read = job.read_response
  return read and read.data ~= "" and read.data or nil
end

local Open = {}

function Open.__index(item, key)
  local make = KEYS[key]
  local value = make and make(item.job)
  item[key] = value
  return value
end

--- The transaction of a job so far: each key is made when it is asked for.
-- Times are those of the job: nanoseconds, relative to `base_seconds` of the analysis.
function M.open(job)
  local head = job.message or job.response
  return setmetatable({
    channel = "ds47", job = job, operation = operation(job), -- of this and the next two every frame tells
    request_reference = head and head.request_reference, axis = head and head.axis,
  }, Open)
end

-- Keys that need the response, which a closed job no longer has; without a request all keys need it.
local OF_RESPONSE = {parameters = true, state = true, stray = true, failing = true}
local KEPT = {state = true, frames = true} -- all else is made each time

-- The metatable of the transactions of closed jobs: each key is made when it is asked for.
local function closed_class(codec)
  return {__index = function(item, key)
    local make, job = KEYS[key], rawget(item, "job")
    if make == nil or job == nil then return nil end
    if job.response == nil and (OF_RESPONSE[key] or job.message == nil) then restore_for_now(job, codec) end
    local value = make(job)
    if KEPT[key] then item[key] = value end
    return value
  end}
end

--- A transaction as a table of its own that has all its keys.
function M.whole(item)
  local result = {}
  for key, value in pairs(item) do result[key] = value end
  for key in pairs(result.job and KEYS or NONE) do result[key] = item[key] end
  result.job = nil
  return result
end

-- All finished transactions of an analysis
--
-- A job is kept as it was closed, without its decoded response. It becomes a transaction when somebody asks
-- for it, which is rare while a file is read. Each key is made on request: all keys need three times as much
-- room.

local Store = {}
Store.__index = Store

--- An empty store for closed jobs, with the dialects of the analysis.
function M.store(codec)
  return setmetatable({
    codec = codec, closed = closed_class(codec),
    all = {}, -- transactions, or jobs that nobody has asked for yet, in the order in which they were finished
    places = {}, -- order of a job -> place in `all`
    below = nil,
  }, Store)
end

--- A store that begins with the content of this one; later additions do not change this one.
function Store:on_top()
  local store = M.store(self.codec)
  store.below = self
  return store
end

--- Takes a finished transaction of a channel without record calls.
function Store:add_made(transaction)
  local place = #self.all + 1
  self.all[place], self.places[transaction.order] = transaction, place
end

--- Takes a job that was just closed. Its `response` is decoded anew when it is needed.
function Store:add(job)
  self:add_made(job)
  job.response = nil
end

local function transaction_at(self, place)
  local found = self.all[place]
  if found.phase then -- still a job
    local message = found.message
    found = setmetatable({ -- what each frame asks for, and room for what is kept
      channel = "ds47", id = 0, findings = NONE, job = found, operation = message and message.operation,
      state = nil, frames = nil,
    }, self.closed)
    self.all[place] = found
  end
  return found
end

--- A closed job is about to change: its transaction stays what it is.
function Store:late(job)
  local item = self:by_order(job.order)
  if item and rawget(item, "job") then
    for key, value in pairs(M.whole(item)) do item[key] = value end
    item.job = nil
  end
end

--- Forgets the transactions of an AR at index 47; gives the orders of their jobs: {[order] = true}.
function Store:forget(ar)
  local all, gone = self.all, {}
  self.all, self.places = {}, {}
  for _, item in ipairs(all) do
    local job = item.phase and item or rawget(item, "job")
    if job and records.ar_of_47(job.peer, job.record) == ar then
      gone[job.order] = true
    else
      self:add_made(item)
    end
  end
  return gone
end

--- The transaction of a job, by the order in which the jobs began; nil if it is not finished.
function Store:by_order(order)
  local place = self.places[order]
  if place then return transaction_at(self, place) end
  return self.below and self.below:by_order(order)
end

--- All transactions in the order of their first frame, then of the position inside it (docs/pairing.md P49).
-- Gives them their ids, and empty lists of findings.
function Store:numbered()
  local all, firsts, finished = {}, {}, {}
  for _, store in ipairs({self.below or NONE, self}) do
    for place = 1, #(store.all or NONE) do
      local transaction = transaction_at(store, place)
      all[#all + 1] = transaction
      firsts[transaction], finished[transaction] = first_frame(transaction.frames), #all
    end
  end
  local function is_before(a, b)
    if firsts[a] ~= firsts[b] then return firsts[a] < firsts[b] end
    if a.position ~= b.position then return a.position < b.position end
    return finished[a] < finished[b]
  end
  for number = 2, #all do
    if is_before(all[number], all[number - 1]) then -- mostly all are in order
      table.sort(all, is_before)
      break
    end
  end
  for number, transaction in ipairs(all) do transaction.id, transaction.findings = number, {} end
  return all
end

return M
