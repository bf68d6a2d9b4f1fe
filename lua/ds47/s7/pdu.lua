-- One PDU of S7: its header, and what its parameter and its data say (docs/s7.md 3).
--
-- Here is one PDU whose bytes are in hand. What is wrong with it is a flaw with its offset, never an error;
-- which answer belongs to which job is in jobs.lua.

local model = require("ds47.s7.model")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")

local byte, sub = string.byte, string.sub
local ceil, floor, min = math.ceil, math.floor, math.min
local u16, u32 = reader.u16, reader.u32

local M = {
  PROTOCOL = 0x32, PLUS = 0x72, -- what a PDU of S7 begins with, and one of S7CommPlus
  JOB = 1, ACKNOWLEDGE = 2, ANSWER = 3, USER_DATA = 7,
  READ = 0x04, WRITE = 0x05, SETUP = 0xF0,
  CYCLIC = 2, CPU = 4, PROGRAM = 6, -- groups of user data
  PUSH = 0, REQUEST = 4, RESPONSE = 8, -- types of user data
}

local HEAD, ERRORS = 10, 2 -- bytes of a header, and of error class and code, which only answers have
local SPEC, S7ANY, R_ID, DB_READ = 0x12, 0x10, 0x13, 0xB0
local ITEM = 4 -- bytes in front of the data of an item
local METHODS = {[0x11] = true, [0x12] = true} -- request and response, which all user data has but USEND
local USER_HEAD = "\0\1\18"

local function add(pdu, kind, offset, args)
  pdu.flaws[#pdu.flaws + 1] = {kind = kind, offset = offset, args = args}
end

local function plain(data, kind, args)
  return {
    data = data, reference = 0, parameter = "", content = "", size = 0, head = HEAD, content_at = HEAD,
    flaws = {{kind = kind, offset = 0, args = args}},
  }
end

-- A PDU with its header.
local function headed(data)
  local kind, parameters, contents = byte(data, 2), u16(data, 6), u16(data, 8)
  local head = HEAD + ((kind == M.ACKNOWLEDGE or kind == M.ANSWER) and ERRORS or 0)
  local size = head + parameters + contents
  return {
    data = sub(data, 1, size), kind = kind, reference = u16(data, 4), parameter = "", content = "",
    size = size, head = head, content_at = head, flaws = {},
  }, parameters
end

--- The PDU at the beginning of some bytes.
-- @return {data (all of it, without what is behind it), kind (ROSCTR: JOB, ACKNOWLEDGE, ANSWER, USER_DATA),
-- reference, parameter, content (its data), error (error class and code of an answer as one word), size
-- (bytes that it says to have), head (where the parameter begins), content_at (where its data begins),
-- service (the function of a job, or of what answers one), flaws}; what it does not have, or what cannot be
-- known of it, is nil or empty
function M.decode(data)
  local first = byte(data)
  if first ~= M.PROTOCOL then
    return plain(data, first == M.PLUS and "plus" or "protocol", {byte = first or 0})
  end
  if #data < HEAD then return plain(data, "cut", {have = #data, want = HEAD}) end
  local pdu, parameters = headed(data)
  local head, size = pdu.head, pdu.size
  if not tables.s7.kind[pdu.kind] then
    add(pdu, "kind", 1, {code = pdu.kind})
    return pdu
  end
  if #data < size then
    add(pdu, "cut", #data, {have = #data, want = size})
  elseif #data > size then
    add(pdu, "rest", size, {n = #data - size})
  end
  if head > HEAD and #data >= head then pdu.error = u16(data, HEAD) end
  pdu.parameter = sub(data, head + 1, head + parameters)
  pdu.content = sub(data, head + parameters + 1, size)
  pdu.content_at = head + #pdu.parameter
  if pdu.kind ~= M.USER_DATA then pdu.service = byte(pdu.parameter) end
  return pdu
end

--- What a setup of communication, or its answer, says.
-- @return {calling, called, pdu_length}: parallel jobs of both ends, and the length of a PDU; nil where it is
-- too short
function M.setup(pdu)
  local parameter = pdu.parameter
  if #parameter < 8 then
    add(pdu, "parameter", pdu.head, {have = #parameter, want = 8})
    return nil
  end
  return {calling = u16(parameter, 2), called = u16(parameter, 4), pdu_length = u16(parameter, 6)}
end

-- Jobs: the items of a request

--- The address in nine bytes behind the syntax S7ANY.
-- @param at  number of the first one, from 0
function M.any_address(data, at)
  local transport, area, high = byte(data, at + 1), byte(data, at + 6, at + 7)
  local row, start = tables.s7.sizes[transport], high * 0x10000 + u16(data, at + 7)
  return model.address(area, u16(data, at + 3), start, row and row.bits or 0, u16(data, at + 1), transport)
end

local function put(found, item, group)
  local number = #found.items + 1
  found.items[number], found.groups[number] = item, group
end

-- The address in the bytes of the parameter from `at` up to `last`; one of syntax B0 is that of several
-- variables.
local function address(pdu, at, last, group, found)
  local parameter, length = pdu.parameter, last - at
  local first, _, third, count = byte(parameter, at + 1, at + 4)
  local syntax = first == SPEC and third or nil
  if syntax == S7ANY and length == 12 then
    put(found, model.item(M.any_address(parameter, at + 3)), group)
  elseif syntax == DB_READ and length > 3 and length == 4 + 5 * count then
    for each = at + 4, last - 1, 5 do
      local bytes, db, start = byte(parameter, each + 1), u16(parameter, each + 1), u16(parameter, each + 3)
      put(found, model.item(model.address(model.DB, db, 8 * start, 8, bytes)), group)
    end
  else
    add(pdu, "syntax", pdu.head + at, {code = syntax or first})
    put(found, model.item(nil, nil, nil, syntax or first), group)
  end
end

-- The entries of data that an answer to a read, a write or a USEND has: code, transport size, length, bytes,
-- and a fill byte behind all but the last. The length of one that failed says nothing (docs/s7.md 3): nothing
-- follows its four bytes. Gives the entries as {code, data}, and where they end; flaws go to `pdu`.
local function data_items(pdu, data, content_at, count, answer)
  local found, at = {}, 0
  while #found < count and at + ITEM <= #data do
    local code, transport, length = byte(data, at + 1), byte(data, at + 2), u16(data, at + 2)
    if answer and code ~= model.DONE then
      found[#found + 1] = {code = code}
      at = at + ITEM
    else
      local row = tables.s7.data_sizes[transport]
      if not row then
        add(pdu, "size", content_at + at + 1, {code = transport})
        break
      end
      local size, have = ceil(length * row.bits / 8), #data - at - ITEM
      if have < size then
        found[#found + 1] = {code = code}
        add(pdu, "data", content_at + #data, {have = have, want = size})
        return found, #data
      end
      found[#found + 1] = {code = code, data = sub(data, at + ITEM + 1, at + ITEM + size)}
      at = at + ITEM + size
      if size % 2 == 1 and #found < count then at = at + 1 end
    end
  end
  return found, at
end

--- The variables that a job reads or writes, with what it writes.
-- @return {items, groups}: of each item the number of its address in the request, from 0
function M.variables(pdu)
  local found, parameter = {items = {}, groups = {}}, pdu.parameter
  local says, at, group = byte(parameter, 2) or 0, 2, 0
  while group < says do
    local length = byte(parameter, at + 2) or 0
    local last = at + 2 + length
    if length < 1 or last > #parameter then
      add(pdu, "items", pdu.head + at, {says = says, there = group})
      break
    end
    address(pdu, at, last, group, found)
    at, group = last, group + 1
  end
  if group == says and at < #parameter then add(pdu, "more", pdu.head + at, {n = #parameter - at}) end
  if pdu.service == M.WRITE then
    local values = data_items(pdu, pdu.content, pdu.content_at, #found.items, false)
    for number, value in ipairs(values) do found.items[number].value = value.data end
  end
  return found
end

-- Answers

--- What the answer to a read or a write says, address by address: array of {code, data}.
function M.results(pdu)
  local content, says = pdu.content, byte(pdu.parameter, 2) or 0
  local values, at
  if pdu.service == M.READ then
    values, at = data_items(pdu, content, pdu.content_at, says, true)
  else
    values, at = {}, says
    for number = 1, min(says, #content) do values[number] = {code = byte(content, number)} end
  end
  if #values < says then
    add(pdu, "items", pdu.content_at + min(at, #content), {says = says, there = #values})
  elseif #content > at then
    add(pdu, "more", pdu.content_at + at, {n = #content - at})
  end
  return values
end

-- One result for several variables: their bytes one behind the other, if that fits.
local function share(items, result)
  local sum, at = 0, 0
  for _, item in ipairs(items) do sum = sum + (item.address and item.address:length() or 0) end
  for _, item in ipairs(items) do
    local length = item.address and item.address:length() or 0
    item.code = result.code
    if result.data and #result.data == sum then item.value = sub(result.data, at + 1, at + length) end
    at = at + length
  end
end

--- Puts results to the variables of their addresses.
-- @param found  as `variables` gives it
-- @return array of flaws: what does not fit
function M.settle(found, told)
  local items, groups = found.items, found.groups
  if #told == #items then
    for number, result in ipairs(told) do
      items[number].code = result.code
      if result.data then items[number].value = result.data end
    end
    return {}
  end
  if #told ~= (groups[#groups] or -1) + 1 then
    for number = 1, min(#items, #told) do
      local item, result = items[number], told[number]
      item.code = result.code
      if result.data and result.data ~= "" then item.value = result.data end
    end
    return {{kind = "items", offset = 0, args = {says = #items, there = #told}}}
  end
  local of = {}
  for number, group in ipairs(groups) do
    of[group] = of[group] or {}
    table.insert(of[group], items[number])
  end
  for group, result in ipairs(told) do share(of[group - 1] or {}, result) end
  return {}
end

-- User data

--- What user data says.
-- @return {type, group, subfunction, sequence, unit (number of a part), last (whether it is the last one; of
-- a BSEND its place among the segments), error, code, content (what stands behind the four bytes in front of
-- its data)}; nil where it is none of the known form. A USEND is not of that form
function M.user_data(pdu)
  local parameter, content = pdu.parameter, pdu.content
  if #parameter < 8 or sub(parameter, 1, 3) ~= USER_HEAD then return nil end
  local method, both, subfunction, sequence = byte(parameter, 5, 8)
  if not METHODS[method] then return nil end
  local found = {
    type = floor(both / 0x10), group = both % 0x10, subfunction = subfunction, sequence = sequence, unit = 0,
    last = true, error = 0, code = 0, content = "",
  }
  if #parameter >= 12 then
    found.unit, found.last = byte(parameter, 9), byte(parameter, 10) == 0
    found.error = u16(parameter, 10)
  end
  if #content >= ITEM then
    local length = u16(content, 2)
    found.code, found.content = byte(content), sub(content, ITEM + 1, ITEM + length)
    if #found.content < length then
      add(pdu, "data", pdu.content_at + #content, {have = #found.content, want = length})
    end
  end
  return found
end

-- The R_ID behind the bytes that announce one; nil where these are others.
local function r_id(data, at, front)
  local head = front .. string.char(R_ID, 0)
  if sub(data, at + 1, at + #head) ~= head or #data < at + #head + 4 then return nil end
  return u32(data, at + #head)
end

--- The segment of a BSEND in user data of that group. Sequence 0 is that of a first segment: the
-- acknowledgement gives those that follow their number.
-- @return {r_id, total (only in the first one), data, sequence, number, last}; nil where too little is there
function M.segment(pdu, told)
  local content, first = told.content, told.sequence == 0
  local at, found = first and 10 or 8, r_id(content, 0, "\18\6")
  if not found or #content < at then
    add(pdu, "data", pdu.content_at + ITEM, {have = #content, want = at})
    return nil
  end
  return {
    r_id = found, total = first and u16(content, 8) or nil, data = sub(content, at + 1),
    sequence = told.sequence, number = told.unit, last = told.last,
  }
end

--- A USEND.
-- @return {r_id, areas (array of bytes)}; nil where user data is none
function M.usend(pdu)
  local parameter, content = pdu.parameter, pdu.content
  if #parameter < 10 or sub(parameter, 1, 3) ~= USER_HEAD or byte(parameter, 4) ~= 6 then return nil end
  local id = r_id(parameter, 4, "")
  if not id or #content < ITEM then return nil end
  local says, behind = u16(content, 2), pdu.content_at + ITEM
  -- each area has four bytes in front of it as an entry of data has: the first of them means nothing here
  local found, at = data_items(pdu, sub(content, ITEM + 1), behind, says, false)
  if #found < says then add(pdu, "items", behind + at, {says = says, there = #found}) end
  local areas = {}
  for _, each in ipairs(found) do areas[#areas + 1] = each.data end
  return {r_id = id, areas = areas}
end

return M
