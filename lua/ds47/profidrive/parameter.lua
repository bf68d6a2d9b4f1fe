-- The parameter channel, both directions: requests and responses (docs/protocol.md A).
--
-- Decoding takes any bytes and never raises: what is wrong becomes a flaw, what cannot be decoded stays in
-- `rest`. How single values look is in formats.lua; what a response says about its request is judged in
-- acyclic/judge.lua. Names are those of python/ds47/profidrive/model.py:
--   Flaw     {rule, offset, args}
--   Address  {attribute, element_count, pnu, subindex, offset, attribute_name}
--   Block    {format, value_count, values, scaled, error, raw, offset, pad, meaning, format_name,
--             float, scaled_float, sound_codec}   whether the numbers in `values` and `scaled` are floats;
--             the codec where the format byte alone tells it
--   error    {code, info, words}
--   Request  {request_reference, request_id, axis, parameter_count, addresses, blocks, flaws, rest, length,
--             operation, shaped}
--   Response {request_reference, response_id, axis, parameter_count, blocks, flaws, rest, length, shaped,
--             layout}   layout (layouts.lua) where it is like an earlier one

local entries = require("ds47.support.later").entries
local formats = require("ds47.profidrive.formats")
local layouts = require("ds47.profidrive.layouts")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")

local byte, format, sub, setmetatable = string.byte, string.format, string.sub, setmetatable
local floor, min = math.floor, math.min
local only_zeros = reader.only_zeros
local limits, request_ids, response_ids = tables.limits, tables.request_ids, tables.response_ids

local M = {}

--- Response id of a device that does not know the request id.
M.NOT_SUPPORTED = 0x80
local NOT_SUPPORTED = M.NOT_SUPPORTED

local layout = tables.layouts
local VALUE, ERROR = layout.ADDRESS_VALUE, layout.VALUE_ERROR
local SINGLE = 0x23 -- the error number of a drive that takes one parameter a request
local HEADER, ADDRESS = layout.MESSAGE_SIZE, layout.ADDRESS_SIZE
local SHAPELESS = {DS309 = true, DS313 = true, DS315 = true} -- unknown format, bytes left over or missing
local BROKEN = {DS309 = true, DS315 = true}

local attribute_names, known_attributes = {}, {}
for code = 0, 255 do
  local known = tables.attributes[code]
  attribute_names[code] = known and known.name or format("0x%02X", code)
  known_attributes[code] = known ~= nil or tables.vendor_attributes[code] ~= nil
end

-- Dialects ----------------------------------------------------------------------------------------------

-- How a format byte is read: {meaning = code whose meaning it has if that is another one, codec, class}. The
-- class is the metatable of its blocks, with what they have in common.
local function choice(code, meaning, size)
  local row, codec = tables.formats[meaning or code], formats.codec(meaning or code, size)
  local class = {
    format = code, meaning = meaning, format_name = row and row.name or format("0x%02X", code), pad = "",
    float = codec and codec.float, scaled_float = codec and codec.scaled_float,
  }
  class.__index = class
  return {meaning = meaning, codec = codec, class = class}
end

-- Format bytes that are found with another size too, or with the meaning of profile V3 (A.6).
local function alternatives(usual, v3_types)
  local other = {}
  for code = 0, 255 do
    local meaning = usual[code].meaning or code
    local row = tables.formats[meaning]
    if row and row.other_size then other[code] = choice(code, meaning, row.other_size) end
  end
  if not v3_types then
    for code, meaning in pairs(tables.dialects.profile_v3_types) do other[code] = choice(code, meaning) end
  end
  return other
end

local function new_dialect(legacy_g120, v3_types)
  local usual = {}
  for code = 0, 255 do
    local meaning = v3_types and tables.dialects.profile_v3_types[code]
      or legacy_g120 and tables.dialects.legacy_g120_formats[code] or nil
    usual[code] = choice(code, meaning)
  end
  local other = alternatives(usual, v3_types)
  for code, found in pairs(usual) do found.class.sound_codec = not other[code] and found.codec or nil end
  return {usual = usual, other = other}
end

-- By the sum of the flags below.
local dialects = entries(function(flags) return new_dialect(flags % 2 == 1, flags >= 2) end)

local function dialect_of(options)
  local legacy_g120, v3_types = options and options.legacy_g120_formats, options and options.profile_v3_types
  return dialects[(legacy_g120 and 1 or 0) + (v3_types and 2 or 0)]
end

--- The codec of a format code in a dialect, nil where the length of its values cannot be known.
function M.codec(code, options) return dialect_of(options).usual[code].codec end

--- The same, nil too where its values have two lengths.
function M.sound_codec(code, options) return dialect_of(options).usual[code].class.sound_codec end

-- Flaws -------------------------------------------------------------------------------------------------

local function flaw(flaws, rule, offset, args)
  flaws[#flaws + 1] = {rule = rule, offset = offset, args = args or {}}
end

local function missing(flaws, offset, need, what) flaw(flaws, "DS315", offset, {need = need, what = what}) end

--- Whether flaws are there of one of these rules, a set.
function M.has_one_of(flaws, rules)
  for i = 1, #flaws do
    if rules[flaws[i].rule] then return true end
  end
  return false
end

local has_one_of = M.has_one_of

local function is_shaped(known, message)
  local count = message.parameter_count
  return known ~= nil and count ~= nil and count > 0 and not has_one_of(message.flaws, SHAPELESS)
end

-- Value blocks ------------------------------------------------------------------------------------------
--
-- A body is the state of decoding the blocks of one message:
-- {data, size, offset, count, dialect, chosen, vendor, flaws, blocks, rest, cut_off}

-- Where the blocks end that are still expected from `at` on, if the message does not end before them.
local function end_of_blocks(body, at)
  local data, size, usual, chosen = body.data, body.size, body.dialect.usual, body.chosen
  for _ = #body.blocks + 1, body.count do
    if at + 2 > size then return nil end
    local code, count = byte(data, at + 1, at + 2)
    local codec = (chosen and chosen[code] or usual[code]).codec
    if code ~= ERROR and not codec then return nil end
    local length = count * (codec and codec.size or 2)
    at = at + 2 + length
    if at > size then return nil end
    at = min(size, at + length % 2)
  end
  return at
end

-- Whether the blocks still expected end with the message or in zeros.
local function fits(body, at)
  local stop = end_of_blocks(body, at)
  return stop ~= nil and only_zeros(body.data, stop)
end

-- 2: with this choice the message ends where it should; 1: it does and zeros follow; 0: it does not.
local function fits_with(body, code, at, choose)
  body.chosen[code] = choose
  local stop = end_of_blocks(body, at)
  body.chosen[code] = nil
  if stop == body.size then return 2 end
  return stop and only_zeros(body.data, stop) and 1 or 0
end

-- Of two sizes the one with which the message comes out even (A.6), once per message.
local function choose_size(body, code, at, usual, other)
  local usual_fits = fits_with(body, code, at, usual)
  local other_fits = fits_with(body, code, at, other)
  local found, exact = usual, true
  if usual_fits ~= 2 then
    exact = other_fits == 2
    if exact then found = other end
  end
  local row = tables.formats[other.meaning or code]
  local sure = exact and (found == usual or row ~= nil and row.other_size ~= nil)
  if found.codec and not sure and not (usual_fits == 1 and other_fits == 0) then
    flaw(body.flaws, "DS317", at, {format = format("0x%02X", code), size = found.codec.size})
  end
  return found
end

-- How a format is read; where the end of the message is cut off, nobody knows it of one that has two sizes.
local function choice_for(body, code, at)
  local dialect = body.dialect
  local usual, other = dialect.usual[code], dialect.other[code]
  if not other then return usual end
  if body.cut_off then return {class = usual.class, undecided = true} end
  body.chosen = body.chosen or {}
  body.chosen[code] = body.chosen[code] or choose_size(body, code, at, usual, other)
  return body.chosen[code]
end

-- The value bytes of a block, and whether all are there.
local function take(body, start, size)
  local raw = sub(body.data, start + 3, start + 2 + size)
  local there = #raw
  body.offset = start + 2 + there
  if there == size then return raw, true end
  body.cut = true
  missing(body.flaws, body.offset, size - there, format("values of block %d", #body.blocks + 1))
  return raw, false
end

local function error_block(body, start, count)
  local raw, whole = take(body, start, 2 * count)
  local words = {}
  for i = 1, floor(#raw / 2) do words[i] = reader.u16(raw, 2 * i - 2) end
  if count < 1 or count > 2 then flaw(body.flaws, "DS318", start + 1, {count = count}) end
  local failure = {words = words}
  -- The whole word is the number: 0x0811 of one maker is not the profile's 0x11. In a vendor message a word
  -- up to 0xFF would be taken for a number of the profile: it has none.
  if words[1] and not (body.vendor and words[1] <= 0xFF) then
    failure.code, failure.info = words[1], words[2]
  end
  body.blocks[#body.blocks + 1] = {
    format = ERROR, value_count = count, values = {}, error = failure, raw = raw, offset = start, pad = "",
  }
  return whole
end

local function pad_of(body, block)
  local data, at = body.data, body.offset
  local pad = byte(data, at + 1)
  if body.cut_off and (pad or 0) ~= 0 then
    body.rest, body.offset = sub(data, at + 1), body.size
    return false
  end
  if not pad or pad ~= 0 and fits(body, at) and not fits(body, at + 1) then
    flaw(body.flaws, "DS311", at)
    return true
  end
  block.pad = sub(data, at + 1, at + 1)
  body.offset = at + 1
  if pad ~= 0 then flaw(body.flaws, "DS312", at, {pad = format("0x%02X", pad)}) end
  return true
end

local function unknown_block(body, start, code, count, found)
  local data = body.data
  if not found.undecided then flaw(body.flaws, "DS309", start, {format = format("0x%02X", code)}) end
  body.blocks[#body.blocks + 1] = setmetatable({
    value_count = count, values = {}, raw = "", offset = start,
  }, found.class)
  body.rest, body.offset = sub(data, start + 3), body.size
end

-- Decodes one block; false where decoding cannot go on behind it.
local function block_at(body)
  local start = body.offset
  local code, count = byte(body.data, start + 1, start + 2)
  if not count then
    missing(body.flaws, body.size, 1, "block header")
    body.rest, body.offset = sub(body.data, start + 1), body.size
    return false
  end
  if code == ERROR then return error_block(body, start, count) end
  local found = choice_for(body, code, start)
  local codec = found.codec
  if not codec then
    unknown_block(body, start, code, count, found)
    return false
  end
  local size = codec.size
  local raw, whole = take(body, start, count * size)
  -- A string of which a part is missing is no string: nobody takes it for one that is whole.
  local values = codec.decode(raw, whole and count or codec.whole and 0 or floor(#raw / size), size)
  local block = setmetatable({value_count = count, values = values, raw = raw, offset = start}, found.class)
  if codec.scale then block.scaled = codec.scale(values, raw, codec) end
  body.blocks[#body.blocks + 1] = block
  return whole and (#raw % 2 == 0 or pad_of(body, block))
end

local function counted_blocks(body)
  local count, size = body.count, body.size
  for number = 1, count do
    local need = body.offset + 2 - size
    if need > 0 then
      local only = need == 2 and number == 2 and body.blocks[1].error
      if only and only.code == SINGLE then return end -- a drive with single access sends no other (A.2)
      missing(body.flaws, size, need, format("value block %d of %d", number, count))
      body.rest, body.offset = sub(body.data, body.offset + 1), size
      return
    end
    if not block_at(body) then return end
  end
end

local function left_over(body)
  local rule = only_zeros(body.data, body.offset) and "DS314" or "DS313"
  body.rest = sub(body.data, body.offset + 1)
  flaw(body.flaws, rule, body.offset, {count = #body.rest})
end

-- Decodes by the kind of spec/ids.toml; "all" means blocks while bytes remain.
local function decode_body(body, kind)
  if kind == "blocks" or kind == "free" and not body.cut_off and fits(body, body.offset) then
    counted_blocks(body)
  elseif kind == "all" then
    repeat
      local code = byte(body.data, body.offset + 1)
    until not code or code == 0 or not block_at(body)
  end
  if body.offset < body.size then left_over(body) end
end

-- Requests ----------------------------------------------------------------------------------------------

local function request_header_flaws(request, known)
  local flaws, count = request.flaws, request.parameter_count
  if request.request_reference == 0 then flaw(flaws, "DS301", 0) end
  if not known then flaw(flaws, "DS302", 1, {id = format("0x%02X", request.request_id)}) end
  if count == 0 then
    flaw(flaws, "DS303", 3)
  elseif count > limits.parameters then
    flaw(flaws, "DS304", 3, {count = count, limit = limits.parameters})
  end
end

-- Flaws of one address of a standard request; vendors use the fields for other things.
local function address_flaws(flaws, address)
  local at, count, attribute = address.offset, address.element_count, address.attribute
  if not known_attributes[attribute] then
    flaw(flaws, "DS305", at, {attribute = format("0x%02X", attribute)})
  end
  if address.pnu == 0 then flaw(flaws, "DS306", at + 2) end
  if count > limits.elements then flaw(flaws, "DS307", at + 1, {count = count, limit = limits.elements}) end
  if address.subindex + count > 65536 then
    flaw(flaws, "DS308", at + 4, {subindex = address.subindex, count = count})
  end
end

-- Decodes the addresses that are there; returns where the rest of the message begins.
local function decode_addresses(request, data, check)
  local count = request.parameter_count
  local whole = min(count, floor((#data - HEADER) / ADDRESS))
  local offset, addresses = HEADER, request.addresses
  for number = 1, whole do
    local attribute, elements, high, low, index_high, index_low = byte(data, offset + 1, offset + ADDRESS)
    local address = {
      attribute = attribute, element_count = elements, pnu = high * 256 + low,
      subindex = index_high * 256 + index_low, offset = offset, attribute_name = attribute_names[attribute],
    }
    addresses[number] = address
    if check then address_flaws(request.flaws, address) end
    offset = offset + ADDRESS
  end
  if whole < count then
    local what = format("address %d of %d", whole + 1, count)
    missing(request.flaws, #data, HEADER + ADDRESS * count - #data, what)
    request.rest = sub(data, offset + 1)
  end
  return offset
end

-- Values given against elements addressed; descriptions and texts count otherwise (C).
local function value_counts(request)
  for i, address in ipairs(request.addresses) do
    local block = request.blocks[i]
    if not block then return end
    local elements = address.element_count
    if elements == 0 then elements = 1 end
    if address.attribute == VALUE and block.value_count ~= elements then
      flaw(request.flaws, "DS310", block.offset + 1, {values = block.value_count, elements = elements})
    end
  end
end

local function decode_blocks(message, data, offset, kind, vendor, options, cut_off)
  local body = {
    data = data, size = #data, offset = offset, count = message.parameter_count, vendor = vendor,
    cut_off = cut_off, dialect = dialect_of(options), rest = "", flaws = message.flaws,
    blocks = message.blocks,
  }
  decode_body(body, kind)
  if body.rest ~= "" then message.rest = body.rest end
  if body.cut then message.cut = true end
end

local function request_body(request, data, known, options, cut_off)
  local vendor = known ~= nil and known.vendor
  local offset = decode_addresses(request, data, not vendor)
  if #request.addresses < request.parameter_count then return end
  decode_blocks(request, data, offset, known and known.body or "free", vendor, options, cut_off)
  if known and known.operation == "change" then value_counts(request) end
end

--- Decodes the data of a Write record (docs/protocol.md A.1). Never raises.
-- @param data string: the record, without the 64-byte header of the record block
-- @param options {legacy_g120_formats, profile_v3_types} or nil: dialects
-- @param cut_off true where the capture cut off its end. What only the whole message tells stays undecided
--   then, with all that stands behind it: which of two sizes a format has, and whether a byte is a pad
-- @return Request; header fields are nil where the message ends before them
function M.decode_request(data, options, cut_off)
  local reference, id, axis, count = byte(data, 1, 4)
  local known = id and request_ids[id]
  local request = {
    request_reference = reference, request_id = id, axis = axis, parameter_count = count, addresses = {},
    blocks = {}, flaws = {}, rest = "", length = #data, operation = known and known.operation or "unknown",
  }
  if count then
    request_header_flaws(request, known)
    request_body(request, data, known, options, cut_off)
  else
    missing(request.flaws, #data, HEADER - #data, "header")
  end
  request.shaped = is_shaped(known, request)
  return request
end

local MOST_REMEMBERED, LONGEST_REMEMBERED = 1024, 240

--- `decode_request` that decodes equal requests once: a function of the data and `cut_off`, with the options
-- bound.
-- Programs ask the same again and again, but for the reference. So all of a message but that is shared with
-- its equals, and stands in its metatable (`message.shared`). Requests that differ in their values, too,
-- share what is known of their responses (`message.question`) and of their parameters (the addresses).
function M.remembering(options)
  local questions = entries(function() return layouts.question(options) end, MOST_REMEMBERED)
  local known = entries(function(behind)
    local class = M.decode_request("\1" .. behind, options)
    class.shared, class.__index = class, class
    local count = #class.addresses
    if count == class.parameter_count then
      local question = questions[sub(behind, 1, HEADER + ADDRESS * count - 1)]
      question.addresses = question.addresses or class.addresses
      class.question, class.addresses = question, question.addresses
    end
    return class
  end, MOST_REMEMBERED)
  return function(data, cut_off)
    local reference = byte(data, 1)
    if not reference or reference == 0 or cut_off or #data > LONGEST_REMEMBERED then
      return M.decode_request(data, options, cut_off)
    end
    return setmetatable({request_reference = reference}, known[sub(data, 2)])
  end
end

-- Responses ---------------------------------------------------------------------------------------------

--- Whether a response id belongs to a request id (docs/protocol.md A.3).
function M.family_fits(request_id, response_id)
  local known = request_ids[request_id]
  if response_id == NOT_SUPPORTED then return true end
  if known == nil then return response_id % 128 == request_id % 128 end
  return response_id == known.positive or response_id == known.negative
end

--- Whether a response is of the family of a request, of its axis, and has as many parameters.
-- nil where either lacks a part of its header. What stands behind the id 0x80 is not documented, and its
-- number says nothing.
function M.kind_fits(request, data)
  local asked, count = request.request_id, request.parameter_count
  if asked == nil or count == nil or #data < HEADER then return nil end
  local _, id, axis, got = data:byte(1, HEADER)
  return M.family_fits(asked, id) and axis == request.axis and (got == count or id == NOT_SUPPORTED)
end

local Response = {rest = ""}
Response.__index = Response

-- Bit 7 of the response id says whether an error is inside (A.2).
local function sign(response, negative)
  local failed = false
  local blocks = response.blocks
  for i = 1, #blocks do failed = failed or blocks[i].error ~= nil end
  if negative == false and failed then
    flaw(response.flaws, "DS411", 1)
  elseif negative and not failed and response.blocks[1] and not has_one_of(response.flaws, BROKEN) then
    flaw(response.flaws, "DS412", 1)
  end
end

local function response_body(response, data, known, request, options, cut_off)
  local id, count, flaws = response.response_id, response.parameter_count, response.flaws
  if not known then flaw(flaws, "DS319", 1, {id = format("0x%02X", id)}) end
  local unsupported = id == NOT_SUPPORTED
  if count == 0 and not unsupported then flaw(flaws, "DS303", 3) end
  -- What a drive answers that does not know the request is the profile's.
  local vendor = known and known.vendor or not unsupported and request and request.operation == "vendor"
  local kind = unsupported and "all" or known and known.body or "free"
  decode_blocks(response, data, HEADER, kind, vendor, options, cut_off)
  if known and not unsupported then sign(response, known.negative) end
end

local function decode_response(data, request, options, cut_off)
  local reference, id, axis, count = byte(data, 1, 4)
  local known = id and response_ids[id]
  local response = setmetatable({
    request_reference = reference, response_id = id, axis = axis, parameter_count = count,
    blocks = {}, flaws = {}, length = #data, shaped = nil,
  }, Response)
  if count then
    response_body(response, data, known, request, options, cut_off)
  else
    missing(response.flaws, #data, HEADER - #data, "header")
  end
  response.shaped = is_shaped(known, response)
  return response
end

--- Decodes the data of a Read record (docs/protocol.md A.2). Never raises.
-- @param data string: the record, without the 64-byte header of the record block
-- @param request the Request it answers, or nil. The error words in the answer to a vendor request are no
--   error numbers of the profile, unless the answer is that it is not supported. Reference, axis and count
--   are not compared here. One that is remembered (M.remembering) knows the layouts of its responses.
-- @param options {legacy_g120_formats, profile_v3_types} or nil: dialects
-- @param cut_off as for `decode_request`
-- @return Response; header fields are nil where the message ends before them
function M.decode_response(data, request, options, cut_off)
  local question = request and request.question
  if question == nil or question.options ~= options or cut_off then
    return decode_response(data, request, options, cut_off)
  end
  local response = layouts.find(question, data)
  if response == nil then
    response = decode_response(data, request, options)
    layouts.learn(question, data, response)
  end
  return response
end

return M
