-- A finished job as the transaction of a report: its state, its parameters, its frames and times.
--
-- States and parameters follow docs/pairing.md; findings are made in judge.lua. Keys of a transaction
-- are those of python/ds47/model.py, and `order`, by which its job is known while the capture goes on.

local dictionary = require("ds47.profidrive.dictionary")
local family = require("ds47.profidrive.family")
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
local NOT_SUPPORTED = family.NOT_SUPPORTED

local M = {}

--- PROFINET vendor id of the drives whose own parameters parameters.toml names.
M.SIEMENS = dictionary.SIEMENS

local SIEMENS = M.SIEMENS
local NIL_UUID = ("\0"):rep(16)
local NO_API = records.NO_API

-- Operation and state

-- Response id -> what was asked; of two request ids the one with the smaller code counts.
local operation_of_response = {}
do
  local codes = {}
  for code in pairs(tables.request_ids) do
    codes[#codes + 1] = code
  end
  table.sort(codes, function(a, b) return a > b end)
  for _, code in ipairs(codes) do
    local known = tables.request_ids[code]
    operation_of_response[known.positive] = known.operation
    operation_of_response[known.negative] = known.operation
  end
end

--- What was asked; for an orphan what its response id says.
function M.operation(job)
  if job.message ~= nil then
    return job.message.operation
  end
  local response_id = job.response and job.response.response_id
  return response_id and operation_of_response[response_id] or "unknown"
end

local function refused(job)
  local read = job.read_response
  return job:write_refused() or (read ~= nil and read.status ~= nil and read.status ~= 0)
end

-- That of a response whose end the capture cut off; what stood there is not known.
local function outcome_as_far_as_seen(done, failed, negative)
  if failed == 0 and not negative then
    return "ok"
  end
  return done > 0 and "partial" or "error"
end

local function outcome(job)
  local response = job.response
  if response == nil or response.response_id == NOT_SUPPORTED then
    return "error"
  end
  local blocks = places_of(response)
  local known = tables.response_ids[response.response_id or 0]
  local negative = known ~= nil and known.negative or false
  if #blocks == 0 and known and known.body ~= "blocks" and not negative then
    return "ok" -- a positive response that has nothing to carry
  end
  local failed = 0
  for _, block in ipairs(blocks) do
    if block.error ~= nil then
      failed = failed + 1
    end
  end
  local done = #blocks - failed
  if response.cut and blocks[#blocks].error == nil then
    done = done - 1 -- the last value did not arrive whole
  end
  if job.read_response.cut then
    return outcome_as_far_as_seen(done, failed, negative)
  end
  if done == parameters_asked(job) then
    return negative and "error" or "ok"
  end
  return done > 0 and "partial" or "error"
end

--- The state of a closed job: the first of docs/pairing.md P39 to P46 that applies.
function M.state(job)
  local read = job.read_response
  if job.message == nil then
    return "orphan"
  elseif refused(job) then
    return "refused"
  elseif job.missing then
    return "incomplete"
  elseif read == nil then
    return job.superseded_by ~= nil and "superseded" or "unanswered"
  elseif is_mismatch(job) then
    return "mismatch"
  end
  return outcome(job)
end

-- Parameters

local NONE = {}

-- What a parameter has until it gets its own, where no request names it.
local NAMELESS = {values = NONE, in_format = {}}
NAMELESS.__index = NAMELESS

-- What is known of a parameter from its address alone. Stands with the address, which equal requests share;
-- the parameters of transactions have it as their metatable (`parameter.class`).
local function class_of(address, peer)
  local siemens, of = peer.vendor_id == SIEMENS, peer.family
  local class = address.class
  if class and class.siemens == siemens and class.said == of then
    return class
  end
  local whose = dictionary.family_of(siemens and SIEMENS or nil, of)
  local known = lookup.parameter(address.pnu, whose)
  class = {
    pnu = address.pnu, subindex = address.subindex, attribute = address.attribute_name,
    element_count = address.element_count, listed = known, unit = known and known.unit or nil,
    values = NONE, siemens = siemens, said = of, family = whose, in_format = {},
  }
  class.class, class.__index = class, class
  address.class = class
  return class
end

-- The same of a parameter whose values have the format of a block.
local function class_in_format(class, block)
  local of_block = block.of_format
  local found = class.in_format[of_block]
  if found == nil then
    found = {format = block.format_name}
    for key, value in pairs(class) do found[key] = value end
    found.words = nil
    found.unit = dictionary.unit_of(found.listed, found.format)
    found.__index = found
    class.in_format[of_block] = found
  end
  return found
end

-- Puts into a parameter what the drive has said of it; its class is one of its own, as its unit may be none.
local function explain(result, meaning)
  local told, class, own = dictionary.explained(result, meaning), getmetatable(result), {}
  for key, value in pairs(class) do own[key] = value end
  own.unit, own.described, own.class, own.words, own.__index = told.unit, told.described, own, nil, own
  result.scaled = told.scaled
  return setmetatable(result, own)
end

-- Puts into a parameter what lists of the user say of it, in the same way.
local function named(result, peer)
  local told = naming.explained(result, peer.vendor_id, peer.device_id)
  if told == nil then
    return result
  end
  local own = {}
  for key, value in pairs(getmetatable(result)) do own[key] = value end
  own.unit, own.described, own.class, own.words, own.__index = told.unit, told.described, own, nil, own
  result.told = told.told
  return setmetatable(result, own)
end

-- One parameter: `value` is the block with the values, `answer` the one that may hold an error, `meaning`
-- what the drive has said of it; each may be nil.
local function shown(job, address, value, answer, meaning)
  local class, result = address and class_of(address, job.peer) or NAMELESS
  if value and value.error == nil then
    result = {value_count = value.value_count, values = value.values, shown = nil}
    class = class_in_format(class, value)
    if value.scaled then
      result.scaled = value.scaled
    end
  else
    result = {}
  end
  if answer and answer.error ~= nil then
    result.error = {code = answer.error.code, info = answer.error.info, vendor_id = job.peer.vendor_id}
  end
  setmetatable(result, class)
  if meaning and address then
    explain(result, meaning)
  end
  return address and naming.is_used() and named(result, job.peer) or result
end

-- What is remembered of parameters: by the layout of a response, and by what equal requests share.
local of_layouts, of_requests = setmetatable({}, {__mode = "k"}), setmetatable({}, {__mode = "k"})

-- What is remembered of parameters counts for drives of one make and family: a new memory for those of a
-- peer, and whether one (or nil) is for them.
local function memory_for(peer)
  return {siemens = peer.vendor_id == SIEMENS, family = peer.family}
end

local function is_for(memory, peer)
  return memory and memory.siemens == (peer.vendor_id == SIEMENS) and memory.family == peer.family
end

-- The classes of the parameters of a read, by the places of the layout of its response.
local function classes_in(layout, request, peer)
  local classes = of_layouts[layout]
  if is_for(classes, peer) then
    return classes
  end
  classes = memory_for(peer)
  for number, address in ipairs(request.addresses) do -- of a request that the capture cut not all are there
    local place = layout.places[number]
    if place == nil then break end
    local class, in_format = {}, class_in_format(class_of(address, peer), place)
    for key, value in pairs(in_format) do class[key] = value end
    class.value_count, class.words, class.__index = place.value_count, nil, class
    classes[number] = class
  end
  of_layouts[layout] = classes
  return classes
end

-- A parameter of each of these classes, with its values. An open transaction, the `owner`, has them until it
-- becomes the one of another job: then the next one that has the same takes them over.
local function items_in(classes, values, owner)
  local items = classes.items
  if owner and items and rawget(classes.owner, "parameters") ~= items then
    for number = 1, #values do
      local item = items[number]
      item.values, item.shown = values[number], nil
    end
  else
    items = {nil, nil, nil, nil} -- so many places need not be added one by one
    for number = 1, #values do
      items[number] = setmetatable({values = values[number], shown = nil, scaled = nil}, classes[number])
    end
  end
  if owner then
    classes.items, classes.owner = items, owner
  end
  return items
end

-- The parameters of a read whose response has a layout; nil of all others, and where somebody has said of
-- single parameters what they are.
local function read_in_layout(job, owner)
  local request, response = job.message, job.response
  local layout = response and request and request.operation == "read" and response.layout
  if not layout or job.meanings or #layout.places ~= #request.addresses or naming.is_used()
    or is_mismatch(job) then
    return nil
  end
  local result = items_in(classes_in(layout, request, job.peer), response.value_lists, owner)
  if layout.is_scaled then
    for number, block in ipairs(response.blocks) do
      result[number].scaled = block.scaled
    end
  end
  return result
end

-- The parameters of an open read that nobody has answered, which equal requests share; nil as above.
local function read_asked(job, owner)
  local request, peer = job.message, job.peer
  local shared = owner and request and request.operation == "read" and not job.response and request.shared
  if not shared or job.meanings or naming.is_used() then
    return nil
  end
  local known = of_requests[shared]
  if is_for(known, peer) then
    return known
  end
  known = memory_for(peer)
  for number, address in ipairs(request.addresses) do
    known[number] = setmetatable({}, class_of(address, peer))
  end
  of_requests[shared] = known
  return known
end

--- The parameters of a job as a report shows them (docs/pairing.md P37, P43): an array of {pnu, subindex,
-- attribute, element_count, listed, unit, format, value_count, values, scaled, error, described}. In `shown`
-- a place is kept for the text of a single value, which the plugin keeps there.
-- @param owner the open transaction that they are for; nil where whoever asks may keep them
function M.parameters(job, owner)
  local found, request = read_in_layout(job, owner) or read_asked(job, owner), job.message
  if found then
    return found
  end
  local blocks = job.response and job.response.blocks or NONE
  local stray = is_mismatch(job)
  local change = request ~= nil and request.operation == "change"
  if stray and change then
    blocks = request.blocks
  end
  local result = {}
  if request == nil or (stray and not refused(job)) then
    for number = 1, #blocks do
      result[number] = shown(job, nil, blocks[number], blocks[number])
    end
    return result
  end
  local answers = stray and NONE or blocks
  local values, meanings = change and request.blocks or answers, job.meanings or NONE
  local addresses = request.addresses
  for number = 1, #addresses do
    result[number] = shown(job, addresses[number], values[number], answers[number], meanings[number])
  end
  return result
end

-- Frames

local function pairs_of_frames(reads)
  if #reads == 0 then
    return NONE
  end
  local result = {}
  for number, read in ipairs(reads) do
    result[number] = {request = read.request and read.request.frame, response = read.response.frame}
  end
  return result
end

local function frames_of(job)
  local write = job:write_request()
  return {
    write_request = write and write.frame,
    write_response = job.write_response and job.write_response.frame,
    read_request = job.read_request and job.read_request.frame,
    read_response = job.read_response and job.read_response.frame,
    polls = pairs_of_frames(job.polls),
    rereads = pairs_of_frames(job.rereads),
  }
end

--- Every frame in which a transaction shows, in no order; one may be there twice.
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

local function first_of_reads(reads, first)
  for number = 1, #reads do
    local read = reads[number]
    first = min(first, read.request or first, read.response or first)
  end
  return first
end

-- The first of them, 0 where there is none.
local function first_frame(frames)
  local first = min(frames.write_request or huge, frames.write_response or huge, frames.read_request or huge,
    frames.read_response or huge)
  first = first_of_reads(frames.rereads or NONE, first_of_reads(frames.polls or NONE, first))
  return first < huge and first or 0
end

local restored -- the closed job whose response was decoded last for its transaction

local function decode(job, codec)
  local read = job.read_response
  if job.phase == "closed" and job.response == nil and read ~= nil and read.data ~= "" then
    job.response = parameter.decode_response(read.data, job.message, codec)
    return true
  end
  return false
end

--- Gives a job that was closed its response again: see `Store:add`.
function M.restore(job, codec)
  decode(job, codec)
  if restored == job then
    restored = nil -- it is kept
  end
end

-- The same until another job needs its own.
local function restore_for_now(job, codec)
  if decode(job, codec) then
    if restored then
      restored.response = nil
    end
    restored = job
  end
end

-- The keys of a transaction, and what each is: a function of the transaction, as far as it is made, of the
-- job, and of the transaction once more where it is an open one.
local KEYS = {
  channel = function() return "ds47" end,
  order = function(_, job) return job.order end,
  operation = function(_, job) return M.operation(job) end,
  parameters = function(_, job, owner) return M.parameters(job, owner) end,
  state = function(_, job) return M.state(job) end,
  frames = function(_, job) return frames_of(job) end,
  drive_ns = function(_, job) return rules.drive_time_ns(job) end, -- for the statistics; no key of the report
  write_status = function(_, job) return job.write_response and job.write_response.status end,
  read_status = function(_, job) return job.read_response and job.read_response.status end,
  stray = function(_, job) return is_mismatch(job) end, -- its response is the one of another request
}

-- Keys that a part of the job has under the same name.
local PARTS = {slot = "record", index = "record", position = "record"}
for key in ("controller device vendor_id device_id vendor_assumed station family"):gmatch("%S+") do
  PARTS[key] = "peer"
end
for key, part in pairs(PARTS) do
  KEYS[key] = function(_, job) return job[part][key] end
end

for _, key in ipairs({"api", "subslot"}) do
  KEYS[key] = function(_, job) return job.record.api ~= NO_API and job.record[key] or nil end
end

-- Of the header of a message: that of the request, or of the response to an unknown one.
for _, key in ipairs({"request_reference", "axis"}) do
  KEYS[key] = function(_, job)
    local head = job.message or job.response
    return head and head[key]
  end
end

-- Of its parameters what the drive has said: for those that one of its frames shows.
function KEYS.meanings(_, job)
  return job.meanings
end

-- How a record is called that says of parameters that they failed: "error", or "partial" where others did
-- not; nil of one that says so of none. For who shows the record; no key of the report.
function KEYS.failing(_, job)
  local response = job.response
  if response == nil or response.layout then
    return nil
  end
  local blocks, failed = response.blocks, 0
  for number = 1, #blocks do
    if blocks[number].error then
      failed = failed + 1
    end
  end
  return failed > 0 and (failed < #blocks and "partial" or "error") or nil
end

function KEYS.ar(_, job)
  local ar = job.record.ar
  return ar ~= NIL_UUID and uuid_text(ar) or nil
end

function KEYS.start_ns(_, job)
  return (job:write_request() or job.read_request or job.read_response).time_ns
end

function KEYS.duration_ns(_, job)
  local write, read = job:write_request(), job.read_response
  return write and read and read.data ~= "" and read.time_ns - write.time_ns or nil
end

function KEYS.request(_, job)
  local write = job:write_request()
  return write and write.data
end

function KEYS.response(_, job)
  local read = job.read_response
  return read and read.data ~= "" and read.data or nil
end

-- What is dear to make, or asked for often, and is not made with the transaction; all else is made each time.
local KEPT = {parameters = true, state = true, frames = true, stray = true}

local Open = {}

function Open.__index(item, key)
  local make = KEYS[key]
  if make == nil then
    return nil
  end
  local value = make(item, item.job, item)
  if KEPT[key] then
    item[key], item.has_more = value, true
  end
  return value
end

--- The transaction of a job as far as the job has got: each key is made when it is asked for.
-- Times are those of the job: nanoseconds, relative to `base_seconds` of the analysis.
-- @param item  one that nobody needs any more, to become this one; nil for a new one
function M.open(job, item)
  if item == nil then
    item = setmetatable({
      channel = "ds47", job = nil, operation = nil, request_reference = nil, axis = nil, has_more = false,
    }, Open)
  elseif item.has_more then -- what another one was asked for
    item.parameters, item.state, item.frames, item.stray, item.has_more = nil, nil, nil, nil, false
  end
  local message = job.message
  local head = message or job.response
  item.job = job
  item.operation = message and message.operation or M.operation(job) -- of these three every frame tells
  item.request_reference, item.axis = head and head.request_reference, head and head.axis
  return item
end

-- What is made of the response, which a closed job has no more; without a request all of it is.
local OF_RESPONSE = {parameters = true, state = true, stray = true, failing = true}
local KEPT_CLOSED = {state = true, frames = true}

-- The metatable of the transactions of closed jobs: each key is made when it is asked for.
local function closed_class(codec)
  return {__index = function(item, key)
    local part, make, job = PARTS[key], KEYS[key], key ~= "job" and item.job
    if not job or make == nil then
      return nil
    elseif part then
      return job[part][key]
    elseif job.response == nil and (OF_RESPONSE[key] or job.message == nil) then
      restore_for_now(job, codec)
    end
    local value = make(item, job)
    if KEPT_CLOSED[key] then
      item[key] = value
    end
    return value
  end}
end

--- A transaction as a table of its own that has all its keys.
function M.whole(item)
  local result = {}
  for key, value in pairs(item) do
    result[key] = value
  end
  for key in pairs(result.job and KEYS or NONE) do
    result[key] = item[key]
  end
  result.job = nil
  return result
end

-- All finished transactions of an analysis
--
-- A job is kept as it was closed, without its decoded response, and becomes a transaction when somebody
-- asks: mostly nobody does while a file is read. Its keys are made when they are asked for: all of them are
-- three times as large.

local Store = {}
Store.__index = Store

--- An empty store for closed jobs; dialects as those of the analysis.
function M.store(codec)
  return setmetatable({
    codec = codec, closed = closed_class(codec),
    all = {}, -- transactions, or jobs of which nobody asked yet, in the order in which they were finished
    count = 0, -- of them
    places = {}, -- order of a job -> place in `all`
    below = nil,
  }, Store)
end

--- A store that begins with what this one holds; what is added to it stays its own.
function Store:on_top()
  local store = M.store(self.codec)
  store.below = self
  return store
end

--- Takes a job that was just closed. Its `response` is decoded anew when it is needed.
function Store:add(job)
  local place = self.count + 1
  self.count, self.all[place], self.places[job.order] = place, job, place
  job.response = nil
end

--- Takes a transaction that is made already, one of a channel that is not paired from record calls.
function Store:add_made(transaction)
  local place = self.count + 1
  self.count, self.all[place], self.places[transaction.order] = place, transaction, place
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
    for key, value in pairs(M.whole(item)) do
      item[key] = value
    end
    item.job = nil
  end
end

--- The transaction of a job, by the order in which the jobs began; nil where it is not finished.
function Store:by_order(order)
  local place = self.places[order]
  if place then
    return transaction_at(self, place)
  end
  return self.below and self.below:by_order(order)
end

-- Whether the transactions are in the order of their first frame, then of the position inside it, as they
-- mostly are: then nothing needs to be sorted.
local function in_order(all, firsts)
  for number = 2, #all do
    local before, after = firsts[all[number - 1]], firsts[all[number]]
    if before > after or (before == after and all[number - 1].position > all[number].position) then
      return false
    end
  end
  return true
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
  if not in_order(all, firsts) then
    table.sort(all, function(a, b)
      if firsts[a] ~= firsts[b] then
        return firsts[a] < firsts[b]
      elseif a.position ~= b.position then
        return a.position < b.position
      end
      return finished[a] < finished[b]
    end)
  end
  for number, transaction in ipairs(all) do
    transaction.id, transaction.findings = number, {}
  end
  return all
end

return M
