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
--
-- What halves and records repeat stands in their metatables (`half.missing`, `record.place`): a table with a
-- few keys of its own is what the plugin can afford for a frame.

local rpc = require("ds47.profinet.rpc")
local layout = require("ds47.spec.tables").layouts

local byte, find, sub = string.byte, string.find, string.sub

local M = {}

local SIZE, NDR = layout.RECORD_SIZE, layout.NDR_SIZE
local AR, INDEX, HEAD = layout.RECORD_AR, layout.RECORD_INDEX, layout.RECORD_DATA + 4
local STATUS = layout.RECORD_STATUS
local WRITE_MULTIPLE = layout.RECORD_WRITE_MULTIPLE
local NIL_UUID = ("\0"):rep(16)
M.WRITE_MULTIPLE, M.NIL_UUID = WRITE_MULTIPLE, NIL_UUID
M.NO_API = -1 -- where there is neither API nor subslot: on PROFIBUS

local WRITE, READ_IMPLICIT = rpc.WRITE, rpc.READ_IMPLICIT
local REQUEST_BLOCKS = {
  [rpc.READ] = layout.BLOCK_READ_REQUEST, [READ_IMPLICIT] = layout.BLOCK_READ_REQUEST,
  [WRITE] = layout.BLOCK_WRITE_REQUEST,
}
local RESPONSE_BLOCKS = {
  [rpc.READ] = layout.BLOCK_READ_RESPONSE, [READ_IMPLICIT] = layout.BLOCK_READ_RESPONSE,
  [WRITE] = layout.BLOCK_WRITE_RESPONSE,
}
local AR_BLOCK = layout.BLOCK_AR_REQUEST
local ONLY_ARS = {[0x0001] = true, [0x0010] = true}
local RELEASE_BLOCKS = {[layout.BLOCK_RELEASE_REQUEST] = true, [layout.BLOCK_RELEASE_OF_RSI] = true}
local FIRST_AR = NDR + layout.BLOCK_AR -- where the AR stands in a Connect or Release

local HALF = {data = "", stated = 0, missing = 0}
HALF.__index = HALF

-- Those of a response to a Read without an error.
local GOOD = {data = "", stated = 0, missing = 0, status = 0}
GOOD.__index = GOOD

--- A half that carries no data.
function M.half(frame, time_ns, status)
  return setmetatable({frame = frame, time_ns = time_ns, status = status}, HALF)
end

-- The fields of a place are those of its records: `write` to `position`. With them stand `spot`, a text for
-- slot, subslot and index, and the keys of its AR and its channel for the peer that spoke of it last
-- (`ar_key`, `channel_key`), which is always the same one but for ReadImplicit.
local places, place_count, MOST_PLACES = {}, 0, 4096

--- Makes a place of a table with the fields `write` to `position`.
function M.place(place)
  place.spot = "\0" .. place.slot * 65536 + place.subslot .. "\0" .. place.index .. "\0"
  place.text = place.api .. place.spot .. place.ar
  place.place, place.__index = place, place
  return place
end

--- A record at a place, with one half or the other.
local function new_record(place, request, response)
  -- the job that record_calls.lua puts there is named to be given room at once
  return setmetatable({request = request, response = response, job = nil}, place)
end
M.record = new_record

local function new_place(opnum, key)
  local a1, a2, a3, a4, s1, s2, u1, u2, _, _, i1, i2 = byte(key, 17, 28)
  local implicit = opnum == READ_IMPLICIT
  return M.place({
    write = opnum == WRITE, implicit = implicit, ar = implicit and NIL_UUID or sub(key, 1, 16),
    api = ((a1 * 256 + a2) * 256 + a3) * 256 + a4, slot = s1 * 256 + s2, subslot = u1 * 256 + u2,
    index = i1 * 256 + i2, position = 0,
  })
end

-- The place of the block at the 0-based offset.
local function place_at(opnum, data, offset)
  local known = places[opnum]
  if known == nil then
    known = {}
    places[opnum] = known
  end
  local key = sub(data, offset + AR + 1, offset + INDEX + 2)
  local place = known[key]
  if place == nil then
    place = new_place(opnum, key)
    if place_count >= MOST_PLACES then
      places, place_count = {[opnum] = {[key] = place}}, 1
    else
      known[key], place_count = place, place_count + 1
    end
  end
  return place
end

--- What names an AR: controller, device, AR UUID (nil UUID for ReadImplicit).
function M.ar_text(controller, device, ar)
  return controller .. "\0" .. device .. "\0" .. ar
end

--- Whether an AR, named by its `ar_text`, is one with a device.
function M.is_of(ar, device)
  local at = find(ar, "\0", 1, true)
  return at ~= nil and sub(ar, at + 1, at + #device + 1) == device .. "\0"
end

local function know_peer(place, peer)
  local names = peer.controller .. "\0" .. peer.device
  place.peer, place.ar_key = peer, M.ar_text(peer.controller, peer.device, place.ar)
  place.channel_key = place.text .. names
end

--- What names the AR of a record, between two peers: its `ar_text`.
function M.ar_key(peer, record)
  local place = record.place
  if place.peer ~= peer then
    know_peer(place, peer)
  end
  return place.ar_key
end

--- What names the channel of a record (docs/pairing.md P14).
function M.channel_key(peer, record)
  local place = record.place
  if place.peer ~= peer then
    know_peer(place, peer)
  end
  return place.channel_key
end

--- The index and the stated data length of the block at the 0-based offset.
-- nil where the block is not whole or not of the expected type. Blocks are big-endian always (P13).
local function head(data, offset, expected)
  local t1, t2 = byte(data, offset + 1, offset + 2)
  if not t2 or t1 * 256 + t2 ~= expected or #data < offset + HEAD then
    return nil
  end
  local i1, i2, l1, l2, l3, l4 = byte(data, offset + INDEX + 1, offset + HEAD)
  return i1 * 256 + i2, ((l1 * 256 + l2) * 256 + l3) * 256 + l4
end

--- The record whose block stands at the 0-based offset, with one half or the other.
local function record_at(pdu, data, offset, position, request, response)
  local record = new_record(place_at(pdu.opnum, data, offset), request, response)
  if position ~= 0 then
    record.position = position
  end
  return record
end

--- The half of a request: what follows the block in a Write, only the wanted length in a Read.
local function asked(pdu, data, start, stated)
  local half = {frame = pdu.frame, time_ns = pdu.time_ns, stated = stated, data = nil}
  if pdu.opnum == WRITE then
    local payload = sub(data, start + 1, start + stated)
    half.data = payload
    if #payload < stated then
      half.missing = stated - #payload
    end
  end
  return setmetatable(half, HALF)
end

-- The records of one request.
local Body = {multiple = false, nested = false}
Body.__index = Body

--- The records of a Read, Write or ReadImplicit request; what does not parse is absent.
-- @return array of them, with the keys multiple and nested: `nested` when an IODWriteMultiple stands inside
--   another, whose records are not opened (P18)
function M.parse_request(pdu)
  local body, result = pdu.body, setmetatable({nil}, Body) -- given room for one at once
  local expected = REQUEST_BLOCKS[pdu.opnum]
  local index, stated = head(body, NDR, expected)
  if not index then
    return result
  end
  if index ~= WRITE_MULTIPLE or pdu.opnum ~= WRITE then
    result[1] = record_at(pdu, body, NDR, 0, asked(pdu, body, NDR + SIZE, stated))
    return result
  end
  result.multiple = true
  local inner = sub(body, NDR + SIZE + 1, NDR + SIZE + stated)
  local offset, position = 0, 1
  index, stated = head(inner, 0, expected)
  while index do
    if index == WRITE_MULTIPLE then
      result.nested = true
    end
    local half = asked(pdu, inner, offset + SIZE, stated)
    result[position] = record_at(pdu, inner, offset, position, half)
    offset = offset + SIZE + stated + -stated % 4
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
  local body = pdu.body
  if pdu.opnum == WRITE then
    local status = ndr_status
    if ndr_status == 0 then
      local a, b, c, d = byte(body, offset + STATUS + 1, offset + STATUS + 4)
      status = d and ((a * 256 + b) * 256 + c) * 256 + d
    end
    return M.half(pdu.frame, pdu.time_ns, status)
  end
  local data = sub(body, offset + SIZE + 1, offset + SIZE + stated)
  local half = {frame = pdu.frame, time_ns = pdu.time_ns, data = data, stated = stated}
  if #data < stated then
    half.missing = stated - #data
  end
  if ndr_status == 0 then
    return setmetatable(half, GOOD)
  end
  half.status = ndr_status
  return setmetatable(half, HALF)
end

--- The halves of a response, in the order of its blocks.
-- @return the PNIOStatus of the NDR header (nil for an empty body); an array of halves; whether it is that of
--   an IODWriteMultiple, of which only the inner halves are told
function M.parse_halves(pdu)
  local body, halves = pdu.body, {nil} -- given room for one at once
  local ndr_status = status_of(pdu)
  if #body < NDR then
    return ndr_status, halves, false
  end
  local write, expected = pdu.opnum == WRITE, RESPONSE_BLOCKS[pdu.opnum]
  local offset, count = NDR, 0
  local index, stated = head(body, offset, expected)
  local multiple = write and index == WRITE_MULTIPLE
  while index do
    count = count + 1
    halves[count] = answer(pdu, offset, stated, ndr_status)
    offset = offset + SIZE
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
  local records, offset, position = {}, NDR, 0
  if multiple then
    offset, position = offset + SIZE, 1
  end
  for number, half in ipairs(halves) do
    records[number] = record_at(pdu, pdu.body, offset, position, nil, half)
    offset, position = offset + SIZE, position + 1
  end
  return ndr_status, records
end

--- The AR that a Release request ends, nil where its block does not parse.
function M.released_ar(pdu)
  local t1, t2 = byte(pdu.body, NDR + 1, NDR + 2)
  if #pdu.body < FIRST_AR + 16 or not RELEASE_BLOCKS[t1 * 256 + t2] then
    return nil
  end
  return sub(pdu.body, FIRST_AR + 1, FIRST_AR + 16)
end

--- Whether a Connect request with an AR sets up one of which a controller has one with a device.
-- That is the AR of cyclic data (IOCARSingle, also with IRT); supervisors' ARs may stand beside it.
function M.is_only_ar(pdu)
  local t1, t2 = byte(pdu.body, FIRST_AR - 1, FIRST_AR)
  return t2 ~= nil and ONLY_ARS[t1 * 256 + t2] or false
end

--- The AR that a Connect request sets up, nil where its first block is no ARBlockReq.
function M.connected_ar(pdu)
  local t1, t2 = byte(pdu.body, NDR + 1, NDR + 2)
  if #pdu.body < FIRST_AR + 16 or t1 * 256 + t2 ~= AR_BLOCK then
    return nil
  end
  return sub(pdu.body, FIRST_AR + 1, FIRST_AR + 16)
end

return M
