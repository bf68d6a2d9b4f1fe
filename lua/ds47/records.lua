-- Record calls: the body of a Read, Write or ReadImplicit RPC to the records in it (docs/protocol.md E.3,
-- E.4).
--
-- Opens one level of IODWriteMultiple (0xE040). Knows nothing of DS47: `data` is opaque bytes here.
--
-- A Half is {frame, time_ns, data, stated, missing, status}: `stated` is the RecordDataLength (in a Read
-- request the most that is wanted), `missing` what of it the capture cut off, `status` the PNIOStatus with
-- ErrorCode first (nil where the PDU carries none).
-- A Record is {write, implicit, ar, api, slot, subslot, index, position, request, response}; `position` is 0,
-- or the place inside an IODWriteMultiple; `request` and `response` are halves or nil.

local rpc = require("ds47.rpc")

local byte, sub = string.byte, string.sub

local M = {}

local BLOCK_LENGTH = 64
local WRITE_MULTIPLE = 0xE040
local NIL_UUID = ("\0"):rep(16)
M.BLOCK_LENGTH, M.WRITE_MULTIPLE, M.NIL_UUID = BLOCK_LENGTH, WRITE_MULTIPLE, NIL_UUID

local WRITE, READ_IMPLICIT = rpc.WRITE, rpc.READ_IMPLICIT
local REQUEST_BLOCKS = {[rpc.READ] = 0x0009, [READ_IMPLICIT] = 0x0009, [WRITE] = 0x0008}
local RESPONSE_BLOCKS = {[rpc.READ] = 0x8009, [READ_IMPLICIT] = 0x8009, [WRITE] = 0x8008}
local RELEASE_BLOCKS = {[0x0114] = true, [0x0117] = true}

--- A half that carries no data.
function M.half(frame, time_ns, status)
  return {frame = frame, time_ns = time_ns, data = "", stated = 0, missing = 0, status = status}
end

--- The index and the stated data length of the block at the 0-based offset.
-- nil where the block is not whole or not of the expected type. Blocks are big-endian always (P13).
local function head(data, offset, expected)
  local t1, t2 = byte(data, offset + 1, offset + 2)
  if not t2 or t1 * 256 + t2 ~= expected or #data < offset + 40 then
    return nil
  end
  local i1, i2, l1, l2, l3, l4 = byte(data, offset + 35, offset + 40)
  return i1 * 256 + i2, ((l1 * 256 + l2) * 256 + l3) * 256 + l4
end

--- The record whose block, of which `head` read the index, stands at the 0-based offset.
local function record_at(pdu, data, offset, index, position)
  local a1, a2, a3, a4, s1, s2, u1, u2 = byte(data, offset + 25, offset + 32)
  local opnum = pdu.opnum
  local implicit = opnum == READ_IMPLICIT
  return {
    write = opnum == WRITE, implicit = implicit,
    ar = implicit and NIL_UUID or sub(data, offset + 9, offset + 24),
    api = ((a1 * 256 + a2) * 256 + a3) * 256 + a4, slot = s1 * 256 + s2, subslot = u1 * 256 + u2,
    index = index, position = position, request = nil, response = nil,
  }
end

--- Gives a record its request: what follows the block in a Write, only the wanted length in a Read.
local function fill(record, pdu, data, start, stated)
  local payload, missing = "", 0
  if record.write then
    payload = sub(data, start + 1, start + stated)
    missing = stated - #payload
  end
  record.request = {
    frame = pdu.frame, time_ns = pdu.time_ns, data = payload, stated = stated, missing = missing,
    status = nil,
  }
  return record
end

--- The records of a Read, Write or ReadImplicit request; what does not parse is absent.
-- @return {records, multiple, nested}: `nested` when an IODWriteMultiple stands inside another, whose records
--   are not opened (P18)
function M.parse_request(pdu)
  local body, records = pdu.body, {}
  local result = {records = records, multiple = false, nested = false}
  local expected = REQUEST_BLOCKS[pdu.opnum]
  local index, stated = head(body, 20, expected)
  if not index then
    return result
  end
  if index ~= WRITE_MULTIPLE or pdu.opnum ~= WRITE then
    records[1] = fill(record_at(pdu, body, 20, index, 0), pdu, body, 20 + BLOCK_LENGTH, stated)
    return result
  end
  result.multiple = true
  local inner = sub(body, 21 + BLOCK_LENGTH, 20 + BLOCK_LENGTH + stated)
  local offset, position = 0, 1
  index, stated = head(inner, 0, expected)
  while index do
    if index == WRITE_MULTIPLE then
      result.nested = true
    end
    local record = record_at(pdu, inner, offset, index, position)
    records[position] = fill(record, pdu, inner, offset + BLOCK_LENGTH, stated)
    offset = offset + BLOCK_LENGTH + stated + -stated % 4
    position = position + 1
    index, stated = head(inner, offset, expected)
  end
  return result
end

--- The PNIOStatus, the first four bytes of the NDR header; nil where they are not there.
local function status_of(pdu)
  local a, b, c, d = byte(pdu.body, 1, 4)
  if not d then
    return nil
  end
  if pdu.little then
    a, b, c, d = d, c, b, a
  end
  return ((a * 256 + b) * 256 + c) * 256 + d
end

--- The response of one block. The status of a Write is its own, unless the whole call failed.
local function answer(pdu, offset, stated, ndr_status)
  local body, data, status = pdu.body, "", ndr_status
  if pdu.opnum ~= WRITE then
    data = sub(body, offset + BLOCK_LENGTH + 1, offset + BLOCK_LENGTH + stated)
  else
    stated = 0
    if ndr_status == 0 then
      local a, b, c, d = byte(body, offset + 45, offset + 48)
      status = d and ((a * 256 + b) * 256 + c) * 256 + d
    end
  end
  return {
    frame = pdu.frame, time_ns = pdu.time_ns, data = data, stated = stated, missing = stated - #data,
    status = status,
  }
end

--- The halves of a response, in the order of its blocks.
-- @return the PNIOStatus of the NDR header (nil for an empty body); an array of halves; whether it is that of
--   an IODWriteMultiple, of which only the inner halves are told
function M.parse_halves(pdu)
  local body, halves = pdu.body, {}
  local ndr_status = status_of(pdu)
  if #body < 20 then
    return ndr_status, halves, false
  end
  local write, expected = pdu.opnum == WRITE, RESPONSE_BLOCKS[pdu.opnum]
  local offset, count = 20, 0
  local index, stated = head(body, offset, expected)
  local multiple = write and index == WRITE_MULTIPLE
  while index do
    count = count + 1
    halves[count] = answer(pdu, offset, stated, ndr_status)
    offset = offset + BLOCK_LENGTH
    index = nil
    if write then -- a Read has one block, and its data behind it
      index, stated = head(body, offset, expected)
    end
  end
  if multiple then
    local outer = table.remove(halves, 1)
    if count == 1 and outer.status and outer.status ~= 0 then
      ndr_status = outer.status
    end
  end
  return ndr_status, halves, multiple
end

--- The PNIOStatus of the NDR header (nil for an empty body) and the response blocks as records.
--
-- The blocks carry their own address, so that a response without its request can still be placed. An
-- IODWriteMultiple gives its inner responses only.
function M.parse_response(pdu)
  local ndr_status, halves, multiple = M.parse_halves(pdu)
  local records, offset, position = {}, 20, 0
  if multiple then
    offset, position = offset + BLOCK_LENGTH, 1
  end
  for number, half in ipairs(halves) do
    local index = head(pdu.body, offset, RESPONSE_BLOCKS[pdu.opnum])
    local record = record_at(pdu, pdu.body, offset, index, position)
    record.response = half
    records[number] = record
    offset, position = offset + BLOCK_LENGTH, position + 1
  end
  return ndr_status, records
end

--- The AR that a Release request ends, nil where its block does not parse.
function M.released_ar(pdu)
  local t1, t2 = byte(pdu.body, 21, 22)
  if #pdu.body < 44 or not RELEASE_BLOCKS[t1 * 256 + t2] then
    return nil
  end
  return sub(pdu.body, 29, 44)
end

return M
