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
local later = require("ds47.support.later").module
local description_tree = later("ds47_ws.description_tree")
local finding_tree = later("ds47_ws.finding_tree")
local pkw_tree = later("ds47_ws.pkw_tree")
local own_experts = require("ds47_ws.experts")
local passes = require("ds47_ws.passes")
local pzd_tree = later("ds47_ws.pzd_tree")
local reader = require("ds47.support.bytes")
local spec = require("ds47.spec.lookup")
local status = require("ds47.spec.statuses")
local tables = require("ds47.spec.tables")
local words = require("ds47.report.formatting")
local csv = require("ds47.report.csv")
local sentences = require("ds47.report.sentences")
local types = require("ds47_ws.types")
local wanted_fields = require("ds47_ws.wanted")

local find, format = string.find, string.format
local floor, huge = math.floor, math.huge
local VISIBLE, UNKNOWN = wanted_fields.VISIBLE, wanted_fields.UNKNOWN

local WINDOW = gui_enabled()

local M = {}

local NONE = {}

local fields, experts, protocol
local of_drives -- the protocol of what drives say

--- Tells the protocols, their fields and expert infos, as fields.lua makes them.
function M.configure(the_protocol, the_words, the_fields, the_experts)
  protocol, of_drives, fields, experts = the_protocol, the_words, the_fields, the_experts
  wanted_fields.configure(the_fields)
end

local codes = tables.codes

local find_bytes -- what finds bytes in the frame
-- Methods of all trees, and of all ranges: looking one up costs a quarter of what it does.
local add_item, set_generated, range_of, length_of
local wants -- what somebody wants of the tree of the frame (wanted.lua)
local language -- of its texts, "en" or "zh"
local marked -- whether it is seen where a value comes from
local newest -- the item of the frame that was made last with a value; nil before the first

-- Part of a record: `offset` counts in the record. Nil where the record is not in the frame.
local function part(record, offset, size)
  if record == nil or size <= 0 then return nil end
  range_of, length_of = range_of or record.range, length_of or record.len
  return offset + size <= length_of(record) and range_of(record, offset, size) or nil
end

-- Adds a field; nothing where there is no value, or nobody wants it. Who sees the tree sees it at its bytes:
-- they stand at an offset in the record, if that is in the frame.
local function add(parent, key, value, record, offset, size)
  local field = value ~= nil and wants[key]
  if not field then return nil end
  local range = marked and part(record, offset, size)
  if range then return add_item(parent, field, range, value) end
  newest = add_item(parent, field, value)
  return newest
end

-- The same of a value that stands nowhere in the frame: in brackets.
local function derive(parent, key, value)
  local field = value ~= nil and wants[key]
  if not field then return nil end
  newest = add_item(parent, field, value)
  if marked then set_generated(newest) end
  return newest
end

-- The same of a value that stands at its bytes where they are in this frame.
local function show(parent, key, value, here, record, offset, size)
  if here then return add(parent, key, value, record, offset, size) end
  return derive(parent, key, value)
end

-- Adds a field whose value is taken from its bytes, which have to be in the frame.
local function take(parent, key, record, offset, size)
  local range = record and wants[key] and part(record, offset, size)
  return range and add_item(parent, fields[key], range) or nil
end

-- The tree of a protocol; that of the frame where nobody wants the protocol itself.
local function own_tree(tree, owner, record, label)
  if not wants[owner] then return tree end
  return record and add_item(tree, owner, record, label) or add_item(tree, owner, label)
end

-- The protocol in a tree that nobody sees, behind what is wanted of its fields. Where somebody asks for those
-- alone, Wireshark makes none: before 4.6 only below another item. Then what it gives has no length, and is
-- not asked for again. The first record tells.
local function own_last(tree, owner, record)
  if marked or not wants[owner] then return end
  local root = own_tree(newest or tree, owner, record, "DS47")
  if record and wants[owner] == UNKNOWN then
    local is_made = root.len > 0
    if newest or not is_made then wants[owner] = is_made end
  end
end

local function mark_generated(item)
  if item and marked then set_generated(item) end
  return item
end

-- Adds a field whose value is that of bytes, which need not be in the frame.
local function point(parent, key, range) return mark_generated(add_item(parent, fields[key], range)) end

-- Bytes that another frame has, to point at. `name` is what Wireshark shows above them.
local function elsewhere(data, name) return types.range_of(data, name, find_bytes) end

-- For the trees of single things: pkw_tree.lua, finding_tree.lua and the like.
local adding = {
  wanted = function(key) return wants[key] end,
  add = add, derive = derive, show = show, take = take, point = point, elsewhere = elsewhere,
  own = function(tree, record, label) return marked and own_tree(tree, of_drives, record, label) or tree end,
  told = {}, -- texts that stand in the tree of the frame already -> what they were told of
}

-- Begins with the tree of a frame; `answers` and `kind` as wanted.lua takes them.
local function begin(tree, answers, kind, lang)
  add_item, set_generated = add_item or tree.add, set_generated or tree.set_generated
  language, wants = lang, wanted_fields.of(tree, answers, kind)
  newest, marked = nil, wants[VISIBLE]
end

-- What stands together (spec/wireshark.toml): of an array of keys it is asked at once whether one of them is
-- wanted.
local of = tables.fields.together

-- Values with the type of their format

local BYTES = { text = true, octets = true, with_status = true } -- kinds whose bytes say more than a number
local TIMES = { date = true, time_of_day = true }
local NUMBERS = { number = true, float = true } -- all but times, texts and octets

-- The physical value, which is text alone for dates and times of day.
local function physical(parent, kind, item, number)
  local scaled = item.scaled and item.scaled[number]
  if scaled == nil then return end
  local shown = parent
  if wants.scaled then shown = derive(parent, "scaled", words.value(scaled, item.format, true)) end
  if not TIMES[kind] then derive(shown, "scaled.number", types.number(scaled)) end
end

-- The bytes of a value at their place. Text that another frame has, and that is not shown as it is, has its
-- bytes as well, so that nothing of it is lost.
local function add_bytes_of_value(parent, kind, value, record, offset, size)
  if take(parent, "value.bytes", record, offset, size) or kind ~= "text" then return end
  if find(value, "[^ -~]") or find(value, '[\\"]') then
    point(parent, "value.bytes", elsewhere(reader.from_latin1(value), "Text"))
  end
end

-- One value of a parameter, in a format of a row (nil: of none). `block` and `record` say where it stands;
-- nil where it is not in this frame.
local function add_value(parent, item, number, row, block, record)
  local values, kind = item.values, row and row.kind
  local value, shown, offset, size = values[number], parent, nil, nil
  if block then
    size = #values > 1 and floor(#block.raw / #values) or #block.raw
    offset = block.offset + 2 + (number - 1) * size
  end
  if wants.value then
    local text = item.shown or words.value(value, item.format)
    shown = show(parent, "value", text, block, record, offset, size)
  end
  if block and kind == "float" and row.pack == "f" and wants["value.float"] then
    add(shown, "value.float", types.number(value), record, offset, size)
  end
  if NUMBERS[kind] and wants["value.number"] then
    show(shown, "value.number", types.number(value), block and record, record, offset, size)
  end
  if BYTES[kind] and wants["value.bytes"] then
    add_bytes_of_value(shown, kind, value, block and record, offset, size)
  end
  if item.scaled then physical(shown, kind, item, number) end
end

-- Parameters

-- Format and number of values of a block, as they stand in the frame.
local function add_block(parent, block, record)
  local shown = add(parent, "format", block.meaning or block.format, record, block.offset, 1)
  if shown and block.meaning then shown:append_text(format(", 0x%02X in the frame", block.format)) end
  add(parent, "value_count", block.value_count, record, block.offset + 1, 1)
end

-- The words of an error block: the number, the additional information, and what else there is.
-- `worded` is the error of the transaction, nil where the block belongs to none of its parameters.
local function add_error(parent, failed, worded, block, record)
  local at, shown = block.offset + 2, 0
  local text = worded and sentences.error_words(worded, language)
  if failed.code then
    local item = add(parent, "error.code", failed.code, record, at, 2)
    if item then item:set_text("Error number: " .. spec.error_hex(failed.code)) end
    add(parent, "error.text", text, record, at, 2)
    add(parent, "error.info", failed.info, record, at + 2, 2)
    shown = failed.info and 4 or 2
  else
    derive(parent, "error.text", text)
  end
  take(parent, "raw", record, at + shown, #block.raw - shown)
end

-- A block that belongs to no parameter of the transaction.
local function add_loose(parent, block, record)
  if wants[of.block] then add_block(parent, block, record) end
  if block.error then
    add_error(parent, block.error, nil, block, record)
  else
    take(parent, "raw", record, block.offset + 2, #block.raw)
  end
end

-- How many blocks of a message belong to the parameters of its view: none where the response is one of
-- another request, but for the values of a read, which are shown without an address.
local function owned(view, message)
  local item = view.item
  local bare = item.stray and (item.operation == "change" or item.state == "refused")
  if bare and view.role ~= "write_request" then return 0 end
  return math.min(#view.parameters, #message.blocks)
end

-- What a frame holds of the parameters of a view: their blocks (of which the first `most` are theirs), and
-- whether these have the values of the transaction: those of a change stand in its request. Blocks are made
-- of the bytes of a message when they are asked for: not where nobody wants what stands in them alone.
local function blocks_of(view)
  if not wants[of.blocks] then return NONE, 0, false end
  local message, change = view.message, view.item.operation == "change"
  if view.role == "write_request" then return message and message.blocks or NONE, huge, change end
  local response = view.response
  if response then return response.blocks, owned(view, response), not (change and message) end
  return NONE, 0, not (change and message)
end

-- Where the parameters of a view stand, as a function of a parameter and its number: {address = that of the
-- request, asked = whether it stands in this frame, block = its block in this frame, here = whether such
-- blocks have the values of the transaction, values = the block where it has, record}; all but `asked` and
-- `here` may be nil.
local function places(view, record)
  local blocks, most, here = blocks_of(view)
  local request, asking = view.message, view.role == "write_request"
  return function(item, number)
    local address = request and item.pnu and request.addresses[number] or nil
    local block = number <= most and blocks[number] or nil
    return {
      address = address, asked = asking and address ~= nil,
      block = block, here = here, values = here and block or nil, record = record,
    }
  end
end

local function add_values(_, shown, item, place)
  local count = #item.values
  local row = tables.formats[types.format_code(item.format)]
  for number = 1, count do add_value(shown, item, number, row, place.values, place.record) end
end

-- What an address shows. It stands in a request; for a response it is that of its request. `row` says what
-- the value is (of the parameter, and of the address; nil: what the parameter has of that name), and which
-- bytes of the address have it; nil where it stands nowhere.
local function add_of_address(row, shown, item, place)
  local key, value = row.field, row.value
  if value then
    value = value(item, place.address)
  else
    value = item[key]
  end
  if place.asked and row.at then
    add(shown, key, value, place.record, place.address.offset + row.at, row.size)
  else
    derive(shown, key, value)
  end
end

local function add_described_in(_, shown, item)
  local frames = item.described and item.described.frames or NONE
  for number = 1, #frames do derive(shown, "described_in", frames[number]) end
end

-- The error of a block, or its bytes where nothing else shows them.
local function add_rest(_, shown, item, place)
  local block, record = place.block, place.record
  if block and block.error and not place.asked then
    add_error(shown, block.error, item.error, block, record)
  elseif block and not (place.values and #item.values > 0) then
    take(shown, "raw", record, block.offset + 2, #block.raw)
  end
end

local reached -- the drive object that the view is about, which context.reached names

-- What all accesses to a parameter of a drive object have alike: a filter, at a click.
local function add_follow(parent, item)
  if item.pnu and reached then derive(parent, "follow", format("%s PNU %d", reached, item.pnu)) end
end

adding.follow = add_follow

-- What is shown of a parameter, in its order: `add` is a function of the row, the tree, the parameter, and
-- its place (see `places`).
local PARAMETER = wanted_fields.list({
  { field = "attribute", at = 0, size = 1, add = add_of_address, value = function(_, address)
    return address and address.attribute
  end },
  { field = "element_count", at = 1, size = 1, add = add_of_address },
  { field = "pnu", at = 2, size = 2, add = add_of_address },
  { field = "subindex", at = 4, size = 2, add = add_of_address },
  { field = "follow", rare = true, add = function(_, shown, item) add_follow(shown, item) end },
  { field = "name", add = add_of_address, value = function(item) return sentences.name(item, language) end },
  { field = "unit", add = add_of_address },
  { field = "family", add = add_of_address, value = function(item) return words.family(item) end },
  { field = "described_in", add = add_described_in },
  { field = "meaning", add = add_of_address, value = function(item)
    return words.meaning(item, language)
  end },
  { field = of.block, add = function(_, shown, _, place)
    if place.block then add_block(shown, place.block, place.record) end
  end },
  { field = of.written, add = function(_, shown, item, place) -- by the request of a response
    if not place.here then
      derive(shown, "written.format", types.format_code(item.format))
      derive(shown, "written.value_count", item.value_count)
    end
  end },
  { field = of.values, add = add_values },
  { field = of.description, rare = true, add = function(_, shown, item, place)
    local attribute = item.attribute
    if (attribute == "description" or attribute == "text") and wants[of.description] then
      description_tree.add(adding, shown, item, place.values, place.record)
    end
  end },
  { field = of.rest, add = add_rest },
})

-- The line of a parameter, below which all else of it stands.
local function add_label(parent, view, item, place)
  local asked, block = place.asked, place.block
  local from, size = asked and place.address or block, asked and 6 or block and 2 + #block.raw
  local label = words.parameter(item, view.item.operation == "change", language)
  local shown = add(parent, "parameter", label, from and place.record, from and from.offset, size)
  if not (asked or place.values or block and block.error) then mark_generated(shown) end
  return shown
end

-- The message in the frame

local HEADERS = { write_request = "request_id", read_response = "response_id", reread = "response_id" }

-- What belongs to no parameter.
local function add_others(parent, view, message, record)
  for number = owned(view, message) + 1, #message.blocks do
    add_loose(parent, message.blocks[number], record)
  end
  if record then take(parent, "raw", record, record:len() - #message.rest, #message.rest) end
end

local function add_parameters(parent, view, message, record)
  local parameters, place_of = view.parameters, wants[of.places] and places(view, record)
  local list, has_label = wants[PARAMETER], wants.parameter
  for number = 1, #parameters do
    local item = parameters[number]
    local place = place_of and place_of(item, number) or NONE
    local shown = has_label and add_label(parent, view, item, place) or parent
    for row_number = 1, #list do
      local row = list[row_number]
      row.add(row, shown, item, place)
    end
  end
  if message and wants[of.blocks] then add_others(parent, view, message, record) end
end

local function add_message(parent, view, record)
  local id = HEADERS[view.role]
  if id == nil then return end
  local message = view.role == "write_request" and view.message or view.response
  if message and wants[of.header] then
    add(parent, "request_reference", message.request_reference, record, 0, 1)
    add(parent, id, message[id], record, 1, 1)
    add(parent, "axis", message.axis, record, 2, 1)
    add(parent, "parameter_count", message.parameter_count, record, 3, 1)
  end
  if wants[of.parameters] then add_parameters(parent, view, message, record) end
end

-- The other frames, and the transaction

local function duration(nanoseconds)
  local rest = math.fmod(nanoseconds, 1e9)
  return NSTime.new((nanoseconds - rest) / 1e9, rest)
end

-- The number of the frame with a half of the transaction. Its job has it, as long as it is not complete: all
-- the frames of a transaction are dear to make.
local function frame_of(view, half)
  local job = view.job
  if job == nil then return view.item.frames[half] end
  local found = job[half]
  return found and found.frame
end

local function add_links(parent, view, context)
  if view.role ~= "write_request" and wants.request_in then
    derive(parent, "request_in", view.item.frames.write_request)
  end
  if view.role ~= "read_response" and wants.response_in then
    derive(parent, "response_in", frame_of(view, "read_response"))
  end
  if wants.time and view.role ~= "write_request" and view.item.frames.write_request then
    derive(parent, "time", duration(context.now_ns() - view.item.start_ns))
  end
end

-- Whether earlier frames prove the state: one pass does not know how an open transaction ends.
local function state_is_certain(view)
  local item = view.item
  if view.complete or frame_of(view, "read_response") then return true end
  return (item.write_status or 0) ~= 0
end

-- Says that later frames may say more of a transaction, where somebody wants what they say; in a window every
-- frame is shown again. Not where earlier frames prove how it ended.
local function add_second_pass(parent)
  if WINDOW then return end
  passes.partly = true
  if wants.second_pass then derive(parent, "second_pass", words.say(language, "second_pass")) end
end

-- Whether a view shows all of its transaction.
local function is_main(view)
  return view.role == "read_response"
    or (view.role == "write_request" and not frame_of(view, "read_response"))
end

-- A row of a transaction has the key of a field and `value`, a function of the transaction, the view, whether
-- its state is certain, and the context; or `add`, one of the tree, the transaction, the view, the record.

-- The message of this frame as the report has it: the words of PKW may change from frame to frame while a
-- request stands.
local function add_bytes(parent, item, view, record)
  local name = view.role == "write_request" and "request" or HEADERS[view.role] and "response"
  local data, key = name and item[name], name and "bytes." .. name
  if not data or not wants[key] then return end
  -- `TvbRange:raw` of 3.4 begins at the start of the frame, not of the range
  local here = record and record:bytes():raw() == data
  point(parent, key, here and record or elsewhere(data, "Message"))
end

local function add_frames_of_reads(parent, item, view)
  if item.channel ~= "ds47" or not is_main(view) or not wants[of.reads] then return end
  for _, name in ipairs({ "poll", "reread" }) do
    for _, read in ipairs(item.frames[name .. "s"]) do
      derive(parent, "frames." .. name .. ".request", read.request)
      derive(parent, "frames." .. name .. ".response", read.response)
    end
  end
end

local function add_peers(parent, item) types.add_peers(adding, parent, item) end

-- The row of a status with its words, as the Info column has them.
local function row_of_status(key, name)
  return { field = key, add = function(parent, item)
    local word = item[name]
    local shown = word and derive(parent, key, word)
    if shown and marked then shown:append_text(format(" (%s)", status.status_text(word, language))) end
  end }
end

-- A key of messages: what the message in the frame shows already is not shown again.
local function of_message(key)
  return function(item, view) return not HEADERS[view.role] and item[key] or nil end
end

-- By its key what is not shown as the transaction has it.
local VALUES = {
  state = function(item, _, certain) return certain and codes.states[item.state] or nil end,
  request_reference = of_message("request_reference"), axis = of_message("axis"),
  drive_object = function(item, view, _, known) return view.complete and known.drive_object(item) or nil end,
  polls = function(item) return item.channel == "ds47" and #item.frames.polls or nil end, -- its Reads
  duration_ms = function(item)
    local nanoseconds = item.duration_ns
    return nanoseconds and nanoseconds / 1000000
  end,
}

-- The row of a key with one value.
local function row_of(field)
  local key, names = field[1], field[3] == "code" and codes[field[4]]
  local value = names and function(item) return names[item[key]] end
  return { field = key, value = VALUES[key] or value or csv.reader(key) }
end

-- By their names the keys that have no such row, with those that they have instead.
local INSTEAD = {
  transaction = {}, -- below which all others stand
  controller = { { field = of.peers, rare = true, add = add_peers } },
  device = {}, station = {}, -- of which of.peers has both
  ar = { row_of({ "ar" }), row_of({ "vendor_assumed" }) },
  ["status.write"] = { row_of_status("status.write", "write_status") },
  ["status.read"] = {
    row_of_status("status.read", "read_status"), { field = of.bytes, rare = true, add = add_bytes },
  },
  polls = { row_of({ "polls" }), { field = of.reads, rare = true, add = add_frames_of_reads } },
}

-- What is shown of a transaction, in its order.
local function rows_of_transaction()
  local rows = {}
  for _, field in ipairs(tables.transaction_fields) do
    for _, row in ipairs(INSTEAD[field[1]] or { row_of(field) }) do rows[#rows + 1] = row end
  end
  return rows
end

local TRANSACTION = wanted_fields.list(rows_of_transaction())

-- `certain`: whether the state of the transaction is.
local function add_transaction(parent, view, certain, record, context)
  local item, shown, list = view.item, parent, wants[TRANSACTION]
  if wants.transaction then
    local number = view.complete and item.id or (view.job or item).order
    shown = derive(parent, "transaction", number) or parent
  end
  for number = 1, #list do
    local row = list[number]
    if row.add then
      row.add(shown, item, view, record)
    else
      derive(shown, row.field, row.value(item, view, certain, context))
    end
  end
end

local function add_events(tree, events, find_word, lang)
  local root = own_tree(tree, of_drives, nil, marked and "DS47 " .. info.events(events, lang) or "DS47 PZD")
  for _, each in ipairs(events) do
    local shown = pzd_tree.add_event(adding, root, each, find_word(each), lang)
    own_experts.add_event(shown or root, experts, each.event, lang)
  end
end

--- The words of drives, in a frame in which they need not have changed.
-- @param found as track.words gives them
function M.add_words(tree, tvb, found, lang)
  begin(tree, nil, "words", lang)
  for _, place in ipairs(found) do
    local record = tvb:range(place.offset, place.length)
    pzd_tree.add(adding, tree, place, record, lang)
    own_last(tree, of_drives, record)
  end
end

-- The frame

local function of_view(finding, view)
  if view.complete then return finding.transaction == view.item.id end
  return finding.order == view.item.order
end

-- The tree of a view; that of the frame where nobody sees it. The sentence of the Info column, which the root
-- says already, is there for fields and filters: from Wireshark 4.4 on `_ws.col.info` is taken before a
-- plugin comes.
local function add_root(tree, view, record)
  local root, sentence = tree, (marked or wants.info) and info.sentence(view, language)
  if marked then root = own_tree(tree, protocol, record, "DS47 " .. sentence) end
  local item = sentence and derive(root, "info", sentence)
  if item then item:set_hidden() end
  return root
end

-- Findings of the transaction that other frames have, each rule once a frame: a refused change is looked at
-- in its response, and what to send instead may stand at its request.
local function add_elsewhere(root, view, findings, context)
  local known = {}
  for _, finding in ipairs(findings) do known[finding] = true end
  for _, finding in ipairs(context.findings_of(view)) do
    local key = finding.rule .. finding.frame
    if not known[finding] and not known[key] then
      known[key] = true
      finding_tree.add_elsewhere(adding, root, finding, context.lang)
    end
  end
end

-- The record of a view in the frame, where somebody sees, or asks for, what is made of it.
local function record_of(view, context)
  local item, data = view.item, nil
  if item.channel == "ds47" and not wants[protocol] and not wants[of.record] then return nil end
  if view.role == "write_request" then
    data = item.request
  elseif HEADERS[view.role] then
    data = item.response
  end
  return data and context.find_record(data, view)
end

local function add_view(tree, view, findings, taken, context)
  local record = record_of(view, context)
  local root = add_root(tree, view, record)
  reached = wants.follow and HEADERS[view.role] and context.reached(view) -- others show no parameters
  if view.item.channel == "pkw" then
    pkw_tree.add(adding, root, view, record, language)
  else
    add_message(root, view, record)
  end
  if wants[of.links] then add_links(root, view, context) end
  local certain = view.complete or not wants[of.later_frames] or state_is_certain(view)
  if not certain then add_second_pass(root) end
  add_transaction(root, view, certain, record, context)
  for number = 1, #findings do
    local finding = findings[number]
    if not taken[number] and of_view(finding, view) then
      taken[number] = true
      finding_tree.add(adding, root, finding, experts, nil, context.lang)
    end
  end
  if wants["finding.elsewhere"] then add_elsewhere(root, view, findings, context) end
  own_last(tree, protocol, record)
end

--- Adds all that a frame shows.
-- @param views, findings, events as track.lua gives them
-- @param context {lang = "en" or "zh",
--   find_record = a function of a record and of the view that has it, which gives its TvbRange in this frame,
--   or nil; find_word = the same of an event; find_bytes = a function of bytes that does the same,
--   request_of = a function that gives the frame of the request of a finding's transaction, or nil,
--   findings_of = a function that gives all findings of the transaction of a view,
--   drive_object = one that gives the number of the drive object of a transaction of the complete result,
--   reached = one that names the drive object of a view, or gives nil,
--   now_ns = one that gives the time of the frame,
--   answers = what is known of what trees of this reading want (wanted.lua), or nil}
function M.add(tree, views, findings, events, context)
  local view = not findings[1] and views[1]
  begin(tree, context.answers, view and view.role or "other", context.lang)
  find_bytes = context.find_bytes
  local taken = findings[1] and {} or NONE
  if findings[1] then adding.told = {} end
  for number = 1, #views do add_view(tree, views[number], findings, taken, context) end
  if #events > 0 then add_events(tree, events, context.find_word, context.lang) end
  local rest
  for number = 1, #findings do
    local finding = findings[number]
    if not taken[number] then
      rest = rest or own_tree(tree, protocol, nil, "DS47")
      finding_tree.add(adding, rest, finding, experts, context.request_of(finding), context.lang)
    end
  end
end

return M
