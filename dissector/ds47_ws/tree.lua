-- The protocol tree of a frame: its views and findings as ds47.* fields.
--
-- What a view is stands in info.lua. The tree shows the message that is in the frame, the parameters with
-- what is known of them, the links to the other frames, and the transaction. What is in the frame is marked
-- at its bytes; what another frame has is in brackets (generated). Once per transaction (in its
-- Read response, or else in its Write request) stands everything that the JSON report says of it.
--
-- Nobody looks at most trees: a filter, or a column, asks for a few fields of it. Then those alone are made,
-- and what would have stood below another one stands below what there is. Of a tree that is visible every
-- field is wanted.

local info = require("ds47_ws.info")
local later, entries = require("ds47.support.later").module, require("ds47.support.later").entries
local description_tree = later("ds47_ws.description_tree")
local finding_tree = later("ds47_ws.finding_tree")
local pkw_tree = later("ds47_ws.pkw_tree")
local own_experts = require("ds47_ws.experts")
local passes = require("ds47_ws.passes")
local plc = require("ds47.report.plc")
local pzd_tree = later("ds47_ws.pzd_tree")
local reader = require("ds47.support.bytes")
local spec = require("ds47.spec.lookup")
local status = require("ds47.spec.statuses")
local tables = require("ds47.spec.tables")
local words = require("ds47.report.formatting")
local csv = require("ds47.report.csv")
local s7_tree = later("ds47_ws.s7_tree")
local sentences = require("ds47.report.sentences")
local types = require("ds47_ws.types")

local byte, find, format, sub = string.byte, string.find, string.format, string.sub
local floor, huge = math.floor, math.huge

local WINDOW = gui_enabled()

local M = {}

local NONE = {}

local fields, experts, protocol
local of_drives -- the protocol of what drives say
local of_s7 -- that of jobs of S7

--- Tells the protocols, their fields and expert infos, as fields.lua makes them.
function M.configure(the_protocol, the_words, the_fields, the_experts, s7)
  protocol, of_drives, fields, experts, of_s7 = the_protocol, the_words, the_fields, the_experts, s7
end

local codes = tables.codes

-- Small things

local find_bytes -- what finds bytes in the frame
local frame_tree, referenced -- the tree of the frame, and its method of that name
local wants -- by field, or by an array of fields: whether somebody wants it, or one of them; by a
-- LIST: what of it
local language -- of its texts, "en" or "zh"
local marked -- whether it is seen where a value comes from

-- Lists of what an address, and a transaction, show: each {field = the field, or an array of fields, ...}.
local ADDRESS, TRANSACTION
local LISTS = {}

local function ask(key)
  if type(key) == "string" then
    return referenced(frame_tree, fields[key])
  elseif LISTS[key] then
    local found = {}
    for number = 1, #key do
      found[#found + 1] = wants[key[number].field] and key[number] or nil
    end
    return found
  end
  for number = 1, #key do
    if wants[key[number]] then
      return true
    end
  end
  return false
end

-- Keeps what a tree says, so that it is asked once.
local KEEPING = {}

function KEEPING.__index(answers, key)
  local answer = ask(key)
  answers[key] = answer
  return answer
end

--- What `context.answers` of M.add is: what trees have said, which is asked once.
function M.answers()
  return setmetatable({}, KEEPING)
end

-- The same of one frame, where the next one's tree may say something else: one table, emptied.
local of_frame = M.answers()

local function asked_anew()
  for key in next, of_frame do
    of_frame[key] = nil
  end
  return of_frame
end

-- Whether somebody wants a field.
local function wanted(key)
  return wants[key]
end

-- Part of a record: `offset` counts in the record. Nil where the record is not in the frame.
local function part(record, offset, size)
  if record == nil or size == 0 or offset + size > record:len() then
    return nil
  end
  return record:range(offset, size)
end

-- Adds a field; nothing where there is no value, or nobody wants it. Its bytes stand at an offset in the
-- record, if that is in the frame; where nobody sees the tree, nobody sees where they stand.
local function add(parent, key, value, record, offset, size)
  if value == nil or not wants[key] then
    return nil
  end
  local range = marked and record and part(record, offset, size)
  if range then
    return parent:add(fields[key], range, value)
  end
  return parent:add(fields[key], value)
end

-- Adds a field whose value is taken from its bytes, which have to be in the frame.
local function take(parent, key, record, offset, size)
  local range = wants[key] and part(record, offset, size)
  return range and parent:add(fields[key], range) or nil
end

local function mark_generated(item)
  if item and marked then
    item:set_generated()
  end
end

-- Adds a field whose value stands nowhere in the frame.
local function derive(parent, key, value)
  if value == nil or not wants[key] then
    return nil
  end
  local item = parent:add(fields[key], value)
  if marked then
    item:set_generated()
  end
  return item
end

-- Adds a field at its bytes where they are in this frame, else in brackets.
local function show(parent, key, value, here, record, offset, size)
  if here then
    return add(parent, key, value, record, offset, size)
  end
  return derive(parent, key, value)
end

-- Adds a field whose value is that of bytes, which need not be in the frame.
local function point(parent, key, range)
  local item = parent:add(fields[key], range)
  mark_generated(item)
  return item
end

-- Bytes that another frame has, to point at. `name` is what Wireshark shows above them.
local function elsewhere(data, name)
  return types.range_of(data, name, find_bytes)
end

-- For the trees of single things: pkw_tree.lua, finding_tree.lua and the like.
local adding = {
  wanted = wanted, add = add, take = take, derive = derive, show = show, point = point,
  elsewhere = elsewhere,
}

-- Values with the type of their format

local function low_and_high(bytes)
  local a, b, c, d, e, f, g, h = byte(bytes, 1, 8)
  return ((e * 256 + f) * 256 + g) * 256 + h, ((a * 256 + b) * 256 + c) * 256 + d
end

local SIGNED = { b = true, h = true, i = true, q = true }

-- Kind of a format -> what adds the typed value: (parent, row, value, bytes, record, offset), where the
-- bytes stand in the record.
local typed = {}

function typed.number(parent, row, value, bytes, record, offset)
  local signed = SIGNED[row.pack]
  local key = signed and "value.signed" or "value.unsigned"
  if not wants[key] then
    return
  end
  local class = signed and Int64 or UInt64
  local number
  if #bytes == 8 then
    number = class.new(low_and_high(bytes))
  else
    number = class.new(value)
  end
  add(parent, key, number, record, offset, #bytes)
end

function typed.float(parent, row, value, bytes, record, offset)
  local key = row.pack == "f" and "value.float" or "value.double"
  add(parent, key, types.number(value), record, offset, #bytes)
end

function typed.text(parent, _, value, bytes, record, offset)
  add(parent, "value.string", words.escape(value), record, offset, #bytes)
end

function typed.octets(parent, _, _, bytes, record, offset)
  local range = wants["value.bytes"] and part(record, offset, #bytes)
  if range then
    parent:add(fields["value.bytes"], range)
  end
end

typed.with_status = typed.octets

local TIMES = { date = true, time_of_day = true }
local NUMBERS = { number = true, float = true }

-- The value as a number, whatever its format: of all formats but those of times, texts and octets.
local function add_number(parent, kind, value, record, offset, size)
  if NUMBERS[kind] then
    show(parent, "value.number", type(value) == "number" and value or types.number(value), record, record,
      offset, size)
  end
end

-- The physical value, which is text for dates and times of day and a number for all others.
local function physical(parent, kind, item, number)
  local scaled = item.scaled and item.scaled[number]
  if scaled == nil then
    return
  end
  local shown = parent
  if wants.scaled then
    shown = derive(parent, "scaled", words.value(scaled, item.format, true))
  end
  if TIMES[kind] then
    derive(parent, "value.time", tostring(scaled))
  else
    derive(shown, "scaled.number", types.number(scaled))
  end
end

-- Text that is not shown as it is has its bytes as well, so that nothing of it is lost; `range` is where they
-- stand.
local function text_bytes(parent, item, value, range)
  if type(value) ~= "string" or not words.is_text(item.format) then
    return
  elseif find(value, "[^ -~]") or find(value, '[\\"]') then
    point(parent, "value.hex", range or elsewhere(reader.from_latin1(value), "Text"))
  end
end

-- The row of a format by its name; false where it has none.
local ROWS = entries(function(name)
  return tables.formats[types.format_code(name)] or false
end)

local OF_TYPED = {
  "value.signed", "value.unsigned", "value.float", "value.double", "value.string", "value.bytes",
}

-- One value of a parameter. `block` and `record` say where it stands; nil where it is not in this frame.
local function add_value(parent, item, number, block, record)
  local values = item.values
  local value = values[number]
  local row = ROWS[item.format or ""]
  local kind = row and row.kind
  local offset, size
  if block then
    size = #values > 1 and floor(#block.raw / #values) or #block.raw
    offset = block.offset + 2 + (number - 1) * size
  end
  local here = block and record or nil
  local shown = parent
  if wants.value then
    local text = item.shown or words.value(value, item.format)
    shown = show(parent, "value", text, block, record, offset, size)
  end
  if block and typed[kind] and wants[OF_TYPED] then
    typed[kind](shown, row, value, sub(block.raw, (number - 1) * size + 1, number * size), record, offset)
  end
  if wants["value.number"] then
    add_number(shown, kind, value, here, offset, size)
  end
  if wants["value.hex"] then
    text_bytes(shown, item, value, here and part(here, offset, size))
  end
  if item.scaled then
    physical(shown, kind, item, number)
  end
end

-- Parameters

-- What an address shows, in its order: a field, its value (of the parameter, and of the address in the
-- request; nil: what the parameter has of that name), and the bytes of the address that have it; nil where it
-- stands nowhere.
ADDRESS = {
  { field = "attribute", at = 0, size = 1, value = function(_, address)
    return address and address.attribute
  end },
  { field = "element_count", at = 1, size = 1, value = nil },
  { field = "pnu", at = 2, size = 2, value = nil },
  { field = "subindex", at = 4, size = 2, value = nil },
  { field = "name", value = function(item) return sentences.name(item, language) end },
  { field = "unit", value = nil },
  { field = "family", value = function(item) return words.family(item) end },
  { field = "described_in", value = function(item) return item.described and item.described.frames end },
  { field = "meaning", value = function(item) return words.meaning(item, language) end },
}

LISTS[ADDRESS] = true

-- The address. It stands in a request; for a response it is that of its request.
local function add_address(parent, item, address, asked, record)
  local shown = wants[ADDRESS]
  for number = 1, #shown do
    local each = shown[number]
    local value, at = each.value, each.at
    if value then
      value = value(item, address)
    else
      value = item[each.field]
    end
    if type(value) == "table" then
      for place = 1, #value do
        derive(parent, each.field, value[place])
      end
    elseif asked and at then
      add(parent, each.field, value, record, address.offset + at, each.size)
    else
      derive(parent, each.field, value)
    end
  end
end

local OF_BLOCK = { "format", "value_count" }

-- Format and number of values of a block, as they stand in the frame.
local function add_block(parent, block, record)
  local shown = add(parent, "format", block.meaning or block.format, record, block.offset, 1)
  if shown and block.meaning then
    shown:append_text(format(", 0x%02X in the frame", block.format))
  end
  add(parent, "value_count", block.value_count, record, block.offset + 1, 1)
end

-- Bytes that have no field of their own.
local function add_raw(parent, record, offset, size)
  local range = size > 0 and wants.raw and part(record, offset, size)
  if range then
    parent:add(fields.raw, range)
  end
end

-- The words of an error block: the number, the additional information, and what else there is.
-- `worded` is the error of the transaction, nil where the block belongs to none of its parameters.
local function add_error(parent, failed, worded, block, record)
  local at, shown = block.offset + 2, 0
  local text = worded and sentences.error_words(worded, language)
  if failed.code then
    local item = add(parent, "error.code", failed.code, record, at, 2)
    if item then
      item:set_text("Error number: " .. spec.error_hex(failed.code))
    end
    add(parent, "error.text", text, record, at, 2)
    add(parent, "error.info", failed.info, record, at + 2, 2)
    shown = failed.info and 4 or 2
  else
    derive(parent, "error.text", text)
  end
  add_raw(parent, record, at + shown, #block.raw - shown)
end

-- A block that belongs to no parameter of the transaction.
local function add_loose(parent, block, record)
  if wants[OF_BLOCK] then
    add_block(parent, block, record)
  end
  if block.error then
    add_error(parent, block.error, nil, block, record)
  else
    add_raw(parent, record, block.offset + 2, #block.raw)
  end
end

-- How many blocks of a message belong to the parameters of its view: none where the response is one of
-- another request, but for the values of a read, which are shown without an address.
local function owned(view, message)
  local item = view.item
  local bare = item.stray and (item.operation == "change" or item.state == "refused")
  if bare and view.role ~= "write_request" then
    return 0
  end
  return math.min(#view.parameters, #message.blocks)
end

-- What a frame holds of the parameters of a view: their blocks (of which the first `most` are theirs), and
-- whether these have the values of the transaction: those of a change stand in its request.
local function places(view)
  local message, change = view.message, view.item.operation == "change"
  if view.role == "write_request" then
    return message and message.blocks or NONE, huge, change
  end
  local response = view.response
  if response then
    return response.blocks, owned(view, response), not (change and message)
  end
  return NONE, 0, not (change and message)
end

local OF_WRITTEN = { "written.format", "written.value_count" }

-- What the request of a response wrote.
local function add_written(parent, item)
  derive(parent, "written.format", types.format_code(item.format))
  derive(parent, "written.value_count", item.value_count)
end

-- All that stands below a value, and it.
local OF_VALUES = {
  "value", "value.number", "value.signed", "value.unsigned", "value.float", "value.double", "value.string",
  "value.bytes", "value.time", "value.hex", "scaled", "scaled.number",
}

local function add_values(parent, item, block, record)
  for place = 1, #item.values do
    add_value(parent, item, place, block, record)
  end
end

-- A parameter, its address in the request, its block in this frame, and whether that has its values; address
-- and block may be nil.
local function add_parameter(parent, view, item, address, block, here, record)
  local asked = address ~= nil and view.role == "write_request"
  local shown = parent
  if wants.parameter then
    local place, size = asked and address or block, asked and 6 or block and 2 + #block.raw
    local label = words.parameter(item, view.item.operation == "change", language)
    shown = add(parent, "parameter", label, place and record, place and place.offset, size)
    if not asked and not (block and here) then
      mark_generated(shown)
    end
  end
  add_address(shown, item, address, asked, record)
  if block and wants[OF_BLOCK] then
    add_block(shown, block, record)
  end
  if not here and wants[OF_WRITTEN] then
    add_written(shown, item)
  end
  if wants[OF_VALUES] then
    add_values(shown, item, here and block or nil, record)
  end
  local attribute = item.attribute
  if attribute == "description" or attribute == "text" then
    description_tree.add(adding, shown, item, here and block or nil, record)
  end
  if block and block.error and not asked then
    add_error(shown, block.error, item.error, block, record)
  elseif block and wants.raw and not (here and #item.values > 0) then
    add_raw(shown, record, block.offset + 2, #block.raw)
  end
end

-- The message in the frame

local HEADERS = {
  write_request = "request_id", read_response = "response_id", reread = "response_id",
}

-- All that stands below the header of a message.
local OF_PARAMETERS = {
  "pnu", "parameter", "subindex", "attribute", "element_count", "name", "unit", "family", "described_in",
  "format", "value_count", "meaning", "written.format", "written.value_count", "error.code", "error.text",
  "error.info", "raw",
}
for _, key in ipairs(OF_VALUES) do
  OF_PARAMETERS[#OF_PARAMETERS + 1] = key
end
for _, row in ipairs(require("ds47_ws.description_fields")) do
  OF_PARAMETERS[#OF_PARAMETERS + 1] = row[1]
end

-- The same without what ADDRESS has.
local BESIDE_ADDRESS = {}
do
  local of_address = {}
  for _, each in ipairs(ADDRESS) do
    of_address[each.field] = true
  end
  for _, key in ipairs(OF_PARAMETERS) do
    BESIDE_ADDRESS[#BESIDE_ADDRESS + 1] = not of_address[key] and key or nil
  end
end

local function add_addresses(parent, parameters, request, asked, record)
  for number = 1, #parameters do
    local item = parameters[number]
    local address = request and item.pnu and request.addresses[number] or nil
    add_address(parent, item, address, asked and address ~= nil, record)
  end
end

local function add_parameters(parent, view, message, record)
  if not wants[OF_PARAMETERS] then
    return
  end
  local parameters, request = view.parameters, view.message
  if not wants[BESIDE_ADDRESS] then
    add_addresses(parent, parameters, request, view.role == "write_request", record)
    return
  end
  local blocks, most, here = places(view)
  for number = 1, #parameters do
    local item = parameters[number]
    local address = request and item.pnu and request.addresses[number] or nil
    add_parameter(parent, view, item, address, number <= most and blocks[number] or nil, here, record)
  end
  if message then
    for number = owned(view, message) + 1, #message.blocks do
      add_loose(parent, message.blocks[number], record)
    end
    if record then
      add_raw(parent, record, record:len() - #message.rest, #message.rest)
    end
  end
end

local OF_HEADER = { "request_reference", "request_id", "response_id", "axis", "parameter_count" }

local function add_message(parent, view, record)
  local id = HEADERS[view.role]
  if id == nil then
    return
  end
  local message = view.role == "write_request" and view.message or view.response
  if message and wants[OF_HEADER] then
    add(parent, "request_reference", message.request_reference, record, 0, 1)
    add(parent, id, message[id], record, 1, 1)
    add(parent, "axis", message.axis, record, 2, 1)
    add(parent, "parameter_count", message.parameter_count, record, 3, 1)
  end
  add_parameters(parent, view, message, record)
end

-- The other frames, and the transaction

local function duration(nanoseconds)
  local seconds = floor(math.abs(nanoseconds) / 1e9)
  local rest = math.abs(nanoseconds) - seconds * 1e9
  local sign = nanoseconds < 0 and -1 or 1
  return NSTime.new(sign * seconds, floor(sign * rest))
end

local function add_links(parent, view)
  if view.role ~= "write_request" and wants.request_in then
    derive(parent, "request_in", view.item.frames.write_request)
  end
  if view.role ~= "read_response" and wants.response_in then
    derive(parent, "response_in", view.item.frames.read_response)
  end
  if wants.time and view.item.duration_ns then
    derive(parent, "time", duration(view.item.duration_ns))
  end
end

local function add_reads(parent, name, reads)
  for _, read in ipairs(reads) do
    derive(parent, "frames." .. name .. ".request", read.request)
    derive(parent, "frames." .. name .. ".response", read.response)
  end
end

-- Whether earlier frames prove the state: one pass does not know how an open transaction ends.
local function state_is_certain(view)
  local item = view.item
  return view.complete or item.frames.read_response ~= nil or item.operation == "usend"
    or (item.write_status ~= nil and item.write_status ~= 0)
end

-- What later frames say of a transaction.
local OF_LATER_FRAMES = {
  "second_pass", "state", "response_in", "time", "transaction", "cycles", "polls", "duration_ms",
  "bytes.response", "status.write", "status.read", "plc", "frames.write_response", "frames.read_request",
  "frames.read_response", "frames.poll.request", "frames.poll.response", "frames.reread.request",
  "frames.reread.response", "finding", "finding.severity", "finding.message", "finding.transaction",
  "finding.elsewhere",
}

-- Says that later frames may say more of a transaction, where somebody wants what they say; in a window every
-- frame is shown again. Not where earlier frames prove how it ended.
local function add_second_pass(parent, view)
  if not WINDOW and not view.complete and wants[OF_LATER_FRAMES] and not state_is_certain(view) then
    passes.shown_partly()
    derive(parent, "second_pass", words.say(language, "second_pass"))
  end
end

-- Whether a view shows all of its transaction.
local function is_main(view)
  return view.role == "read_response" or (view.role == "write_request" and not view.item.frames.read_response)
end

local CHANNEL = { "vendor_assumed", "api", "slot", "subslot", "index" }
local HALVES = {
  "frames.write_request", "frames.write_response", "frames.read_request", "frames.read_response",
}
local FRAMES = {
  "frames.write_request", "frames.write_response", "frames.read_request", "frames.read_response", "polls",
  "frames.poll.request", "frames.poll.response", "frames.reread.request", "frames.reread.response",
}

-- A message as the report has it: the words of PKW may change from frame to frame while a request stands.
local function add_bytes_of(parent, key, data, record, name)
  local here = record and record:bytes():raw() == data
  point(parent, key, here and record or elsewhere(data, name))
end

local OF_BYTES = { "bytes.request", "bytes.response" }

-- The messages: one is the record of this frame, the other one stands in another frame.
local function add_bytes(parent, view, record)
  local item, main, asked = view.item, is_main(view), view.role == "write_request"
  if item.request and (main or asked) and wants["bytes.request"] then
    local name = types.source_name("Request", item.frames.write_request)
    add_bytes_of(parent, "bytes.request", item.request, asked and record, name)
  end
  if item.response and (main or view.role == "reread") and wants["bytes.response"] then
    local name = types.source_name("Response", item.frames.read_response)
    add_bytes_of(parent, "bytes.response", item.response, not asked and record, name)
  end
end

-- What WRREC and RDREC showed, once it is known how the transaction ended.
local function add_plc(parent, view, lang)
  local item = view.item
  local over = view.complete or item.frames.read_response
  if item.channel == "ds47" and over and is_main(view) then
    local witness = view.witness or plc.witness_of(item, view.job)
    derive(parent, "plc", witness:text(item, lang))
  end
end

local function add_frames(parent, view)
  local frames = view.item.frames
  for number = 1, #HALVES do
    derive(parent, HALVES[number], frames[sub(HALVES[number], #"frames." + 1)])
  end
  if view.item.channel ~= "ds47" then
    return -- nothing is polled
  end
  derive(parent, "polls", #frames.polls)
  if is_main(view) then
    add_reads(parent, "poll", frames.polls)
    add_reads(parent, "reread", frames.rereads)
  end
end

-- Adds a field that has the name of a key of the transaction, which is made only where it is wanted.
local function derive_key(parent, item, key)
  if wants[key] then
    derive(parent, key, item[key])
  end
end

-- A status with its words, as the Info column has them.
local function add_status(parent, key, word)
  local shown = word and derive(parent, key, word)
  if shown and marked then
    shown:append_text(format(" (%s)", status.status_text(word, language)))
  end
end

local OF_CHANNEL = {
  "controller", "controller.mac", "master", "device", "device.mac", "station", "ar", "vendor_assumed", "api",
  "slot", "subslot", "index",
}

local function add_channel(parent, item)
  types.add_peers(adding, parent, item)
  if item.ar and wants.ar then
    mark_generated(types.add_uuid(parent, fields.ar, item.ar, find_bytes))
  end
  for number = 1, #CHANNEL do
    derive_key(parent, item, CHANNEL[number])
  end
end

-- What is shown of a transaction, in its order.
TRANSACTION = {
  { field = "channel", add = function(shown, item)
    derive(shown, "channel", codes.channels[item.channel])
  end },
  { field = "operation", add = function(shown, item)
    derive(shown, "operation", codes.operations[item.operation])
  end },
  { field = "state", add = function(shown, item, view)
    derive(shown, "state", state_is_certain(view) and codes.states[item.state] or nil)
  end },
  { field = OF_CHANNEL, add = add_channel },
  { field = { "request_reference", "axis" }, add = function(shown, item, view)
    if not HEADERS[view.role] and item.channel ~= "s7" then -- whose references have 16 bits
      derive_key(shown, item, "request_reference")
      derive_key(shown, item, "axis")
    end
  end },
  { field = FRAMES, add = function(shown, _, view) add_frames(shown, view) end },
  { field = "start", add = function(shown, item, _, _, context)
    derive(shown, "start", csv.timestamp(context.base_seconds, item.start_ns))
  end },
  { field = "duration_ms", add = function(shown, item)
    local nanoseconds = item.duration_ns
    derive(shown, "duration_ms", nanoseconds and nanoseconds / 1000000)
  end },
  { field = "cycles", add = function(shown, item) derive(shown, "cycles", item.cycles) end },
  { field = "status.write", add = function(shown, item)
    add_status(shown, "status.write", item.write_status)
  end },
  { field = "status.read", add = function(shown, item)
    add_status(shown, "status.read", item.read_status)
  end },
  { field = OF_BYTES, add = function(shown, _, view, record) add_bytes(shown, view, record) end },
  { field = "plc", add = function(shown, _, view, _, context) add_plc(shown, view, context.lang) end },
}
LISTS[TRANSACTION] = true

local function add_transaction(parent, view, record, context)
  local item, shown, list = view.item, parent, wants[TRANSACTION]
  if wants.transaction then
    shown = derive(parent, "transaction", view.complete and item.id or item.order) or parent
  end
  for number = 1, #list do
    list[number].add(shown, item, view, record, context)
  end
end

-- Drives

local function add_events(tree, events, find_word, lang)
  local root = tree:add(of_drives, marked and "DS47 " .. info.events(events, lang) or "DS47 PZD")
  for _, each in ipairs(events) do
    local shown = pzd_tree.add_event(adding, root, each, find_word(each), lang)
    shown = shown or root
    local key, text = own_experts.of_event(each.event, lang)
    shown:add_proto_expert_info(experts[key], text)
  end
end

--- The words of drives, in a frame in which they need not have changed.
-- @param tree the tree of the frame
-- @param found as track.words gives them
function M.add_words(tree, tvb, found, lang)
  frame_tree, referenced, marked, language = tree, tree.referenced, tree.visible, lang
  wants = asked_anew()
  for _, place in ipairs(found) do
    pzd_tree.add(adding, tree, place, tvb:range(place.offset, place.length), lang)
  end
end

-- The frame

local function of_view(finding, view)
  if view.complete then
    return finding.transaction == view.item.id
  end
  return finding.order == view.item.order
end

-- The sentence of the Info column, which the root says already: for fields and filters. From Wireshark 4.4 on
-- `_ws.col.info` is taken before a plugin comes.
local function add_info(root, sentence)
  local item = derive(root, "info", sentence)
  if item then
    item:set_hidden()
  end
end

-- The tree of a view, and in it what is in the frame.
local function add_root(tree, view, record)
  local s7 = view.item.channel == "s7"
  local sentence = not s7 and (marked or wants.info) and info.sentence(view, language)
  local label = marked and "DS47 " .. (sentence or "S7 " .. s7_tree.label(view, language)) or "DS47"
  local owner = s7 and of_s7 or protocol
  local root = record and tree:add(owner, record, label) or tree:add(owner, label)
  if sentence then
    add_info(root, sentence)
  end
  if s7 then
    s7_tree.add(adding, root, view, is_main(view), duration, language)
    return root
  elseif view.item.channel == "pkw" then
    pkw_tree.add(adding, root, view, record, language)
  else
    add_message(root, view, record)
  end
  add_links(root, view)
  return root
end

-- Findings of the transaction that other frames have, each rule once a frame: a refused change is looked at
-- in its response, and what to send instead may stand at its request.
local function add_elsewhere(root, view, findings, context)
  if not wants["finding.elsewhere"] then
    return
  end
  local known = {}
  for _, finding in ipairs(findings) do
    known[finding] = true
  end
  for _, finding in ipairs(context.findings_of(view)) do
    local key = finding.rule .. finding.frame
    if not known[finding] and not known[key] then
      known[key] = true
      finding_tree.add_elsewhere(adding, root, finding, context.lang)
    end
  end
end

local function add_view(tree, view, findings, taken, record, context)
  local root = add_root(tree, view, record)
  add_second_pass(root, view)
  add_transaction(root, view, record, context)
  for number = 1, #findings do
    local finding = findings[number]
    if not taken[number] and of_view(finding, view) then
      taken[number] = true
      finding_tree.add(adding, root, finding, experts, nil, context.lang)
    end
  end
  add_elsewhere(root, view, findings, context)
end

local NONE_TAKEN = {} -- of no findings

--- Adds all that a frame shows.
-- @param tree the tree of the frame
-- @param views, findings, events as track.lua gives them
-- @param finders {record = a function of a record and of the view that has it, which gives its TvbRange in
--   this frame, or nil; word = the same of an event; bytes = a function of bytes that does the same}
-- @param context {base_seconds = second since 1970 that the times are relative to, lang = "en" or "zh",
--   request_of = a function that gives the frame of the request of a finding's transaction, or nil,
--   findings_of = a function that gives all findings of the transaction of a view,
--   answers = what M.answers gives, shared by frames whose trees answer the same, or nil}
function M.add(tree, views, findings, events, finders, context)
  frame_tree, referenced, marked, language = tree, tree.referenced, tree.visible, context.lang
  find_bytes, wants = finders.bytes, context.answers or asked_anew()
  local taken = findings[1] and {} or NONE_TAKEN
  for number = 1, #views do
    local view, data = views[number], nil
    if view.role == "write_request" then
      data = view.item.request
    elseif HEADERS[view.role] then
      data = view.item.response
    end
    add_view(tree, view, findings, taken, data and finders.record(data, view), context)
  end
  if #events > 0 then
    add_events(tree, events, finders.word, context.lang)
  end
  local rest
  for number = 1, #findings do
    local finding = findings[number]
    if not taken[number] then
      rest = rest or tree:add(of_s7 and sub(finding.rule, 1, 3) == "DS9" and of_s7 or protocol, "DS47")
      finding_tree.add(adding, rest, finding, experts, context.request_of(finding), context.lang)
    end
  end
end

return M
