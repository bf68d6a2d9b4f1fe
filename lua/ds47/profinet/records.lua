-- Record calls: the body of a Read, Write or ReadImplicit RPC to the records in it (docs/protocol.md E.3,
-- E.4).
--
-- Opens one level of IODWriteMultiple (0xE040). Knows nothing of DS47: `data` is opaque bytes here.
--
-- A Half is {frame, time_ns, data, stated, missing, status, cut}. `data` is what a Write request or a
-- response carries ("" for nothing). `stated` is the RecordDataLength, if it differs from the length of
-- `data`: in a Read request the most bytes wanted, else with `missing`, the missing bytes of the record.
-- `status` is the PNIOStatus with ErrorCode first (nil if the PDU carries none). `cut` is true if the
-- capture cut off a part of the message: these bytes, or something before them.
-- A Record is {write, implicit, ar, api, slot, subslot, index, position, request, response, following};
-- `position` is 0, or the place inside an IODWriteMultiple; `request` and `response` are halves or nil.
-- Nearly every call has one record. The records of an IODWriteMultiple are a linked list: `following` is the
-- next one, nil for the last. So are the halves of its response.
--
-- What records repeat is in their metatable, `record.place`: the plugin can afford only a few keys for each
-- frame. Halves have no metatable, and leave out keys without information.

local entries = require("ds47.support.later").entries
local reader = require("ds47.support.bytes")
local rpc = require("ds47.profinet.rpc")
local layout = require("ds47.spec.tables").layouts

local byte, find, setmetatable, sub = string.byte, string.find, setmetatable, string.sub

local M = {}

local SIZE, NDR = layout.RECORD_SIZE, layout.NDR_SIZE
local AR, INDEX, STATUS = layout.RECORD_AR, layout.RECORD_INDEX, layout.RECORD_STATUS
local WRITE_MULTIPLE = layout.RECORD_WRITE_MULTIPLE
local NIL_UUID = ("\0"):rep(16)
M.WRITE_MULTIPLE, M.NIL_UUID = WRITE_MULTIPLE, NIL_UUID
M.NO_API = -1 -- on PROFIBUS, which has neither API nor subslot

local WRITE, READ_IMPLICIT = rpc.WRITE, rpc.READ_IMPLICIT

local function bytes_of(type) return reader.of_number(type, 2) end

-- The types of the blocks of an operation in one direction, as bytes.
local REQUEST_TYPES = {
  [rpc.READ] = bytes_of(layout.BLOCK_READ_REQUEST), [READ_IMPLICIT] = bytes_of(layout.BLOCK_READ_REQUEST),
  [WRITE] = bytes_of(layout.BLOCK_WRITE_REQUEST),
}
local RESPONSE_TYPES = {
  [rpc.READ] = bytes_of(layout.BLOCK_READ_RESPONSE), [READ_IMPLICIT] = bytes_of(layout.BLOCK_READ_RESPONSE),
  [WRITE] = bytes_of(layout.BLOCK_WRITE_RESPONSE),
}
local ONLY_ARS = {[0x0001] = true, [0x0010] = true}
local CONNECT_BLOCKS = {[layout.BLOCK_AR_REQUEST] = true}
local RELEASE_BLOCKS = {[layout.BLOCK_RELEASE_REQUEST] = true, [layout.BLOCK_RELEASE_OF_RSI] = true}
local FIRST_END = NDR + SIZE -- where the first block ends
local FIRST_AR = NDR + layout.BLOCK_AR -- where the AR stands in a Connect or Release

--- Whether the capture cut this response off before it shows the outcome of the call.
function M.is_cut_before_status(half) return half.cut and not half.missing and (half.status or 0) == 0 end

--- The response to a record without a response block: it has the status of the NDR header. If the capture
-- cut the block of a Write off, only a negative status counts: the block may hold a refusal.
function M.without_block(pdu, status, write)
  local half = M.half(pdu.frame, pdu.time_ns, status)
  if pdu.cut then
    half.cut = true
    half.status = (not write or status ~= 0) and status or nil
  end
  return half
end

--- A half that carries no data.
function M.half(frame, time_ns, status)
  return {frame = frame, time_ns = time_ns, data = "", status = status}
end

-- A place has the fields `write` to `position` of its records. It also has `spot`, a text for slot, subslot
-- and index, and the keys of its AR and its channel (`ar_key`, `channel_key`) for the last peer that used it.
-- That peer changes only for ReadImplicit.

--- Makes a place of a table with the fields `write` to `position`.
function M.place(place)
  place.spot = "\0" .. place.slot * 65536 + place.subslot .. "\0" .. place.index .. "\0"
  place.text = place.api .. place.spot .. place.ar
  place.__index = place
  return place
end

--- A record at a place, with one half or the other.
local function new_record(place, request, response)
  -- three keys, so that there is room for the job that record_events.lua puts there
  return setmetatable({request = request, response = response, place = place}, place)
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

-- The places that the bytes from the AR to the index name, by operation.
local MOST_PLACES = 4096
local places = entries(function(opnum)
  return entries(function(key) return new_place(opnum, key) end, MOST_PLACES)
end)

-- Four bytes at a 1-based place as a number, big-endian as in blocks (P13); nil where not all are there.
local function number_at(data, at, little)
  local a, b, c, d = byte(data, at, at + 3)
  if little and d then a, b, c, d = d, c, b, a end
  return d and ((a * 256 + b) * 256 + c) * 256 + d
end

-- The place and the RecordDataLength in the block of this type at the 0-based offset; nil where no such block
-- is there as far as that.
local function block_at(type, opnum, data, offset)
  local stated = sub(data, offset + 1, offset + 2) == type and number_at(data, offset + INDEX + 3)
  if not stated then return nil end
  return places[opnum][sub(data, offset + AR + 1, offset + INDEX + 2)], stated
end

--- What names an AR: controller, device, AR UUID (nil UUID for ReadImplicit).
function M.ar_text(controller, device, ar) return controller .. "\0" .. device .. "\0" .. ar end

--- The device in an `ar_text`; nil for any other text.
function M.device_of(ar)
  local at = find(ar, "\0", 1, true)
  local ends = at and find(ar, "\0", at + 1, true)
  return ends and sub(ar, at + 1, ends - 1)
end

--- Gives a place its keys for a peer: `ar_key` is the `ar_text` of its AR, `channel_key` names its channel
-- (docs/pairing.md P14). `place.peer` is the peer that they are for.
function M.know_peer(place, peer)
  local names = peer.controller .. "\0" .. peer.device
  place.peer, place.ar_key = peer, M.ar_text(peer.controller, peer.device, place.ar)
  place.channel_key = place.text .. names
end

-- The place of a record, with its keys for a peer.
local function place_for(peer, record)
  local place = record.place
  if place.peer ~= peer then M.know_peer(place, peer) end
  return place
end

--- What names the AR of a record, between two peers: its `ar_text`.
function M.ar_key(peer, record) return place_for(peer, record).ar_key end

--- The same for a record at index 47; nil for any other.
function M.ar_of_47(peer, record) return record.index == 47 and M.ar_key(peer, record) or nil end

--- What names the channel of a record.
function M.channel_key(peer, record) return place_for(peer, record).channel_key end

-- Appends an item to a linked list; returns the new first and last item.
local function chained(first, last, item)
  if last then last.following = item end
  return first or item, item
end

-- A half with the data from the 0-based offset on, as far as the capture has it.
local function carrying(pdu, data, start, stated, status)
  local payload = sub(data, start + 1, start + stated)
  local half = {frame = pdu.frame, time_ns = pdu.time_ns, data = payload, status = status}
  if #payload < stated then
    half.stated, half.missing = stated, stated - #payload
    half.cut = pdu.cut and true
  end
  return half
end

-- The records of an IODWriteMultiple.
local function parse_multiple(pdu, type, inner)
  local first, last, offset, position, nested = nil, nil, 0, 1, false
  local place, stated = block_at(type, WRITE, inner, 0)
  while place do
    nested = nested or place.index == WRITE_MULTIPLE
    local record = new_record(place, carrying(pdu, inner, offset + SIZE, stated))
    record.position, position = position, position + 1
    first, last = chained(first, last, record)
    offset = offset + SIZE + stated + -stated % 4
    place, stated = block_at(type, WRITE, inner, offset)
  end
  return first, true, nested
end

--- The records of a Read, Write or ReadImplicit request; what does not parse is left out.
-- @return the first record (`record.following` is the next), nil for none; whether they are those of an
--   IODWriteMultiple, and whether another one is inside it, which stays a single record (P18)
function M.parse_request(pdu)
  local body, opnum = pdu.body, pdu.opnum
  local type = REQUEST_TYPES[opnum]
  local place, stated = block_at(type, opnum, body, NDR)
  if not place then return nil, false, false end
  if opnum ~= WRITE then -- the wanted length alone
    return new_record(place, {frame = pdu.frame, time_ns = pdu.time_ns, stated = stated}), false, false
  elseif place.index == WRITE_MULTIPLE then
    return parse_multiple(pdu, type, sub(body, FIRST_END + 1, FIRST_END + stated))
  end
  return new_record(place, carrying(pdu, body, FIRST_END, stated)), false, false
end

-- The halves of the blocks of a Write response. Their status is their own, unless the whole call failed.
local function written(pdu, type, status)
  local first, last, offset, body = nil, nil, NDR, pdu.body
  repeat
    local own = status
    if status == 0 then own = number_at(body, offset + STATUS + 1) end
    first, last = chained(first, last, M.half(pdu.frame, pdu.time_ns, own))
    last.cut = own == nil and pdu.cut and true or nil
    offset = offset + SIZE
  until not block_at(type, WRITE, body, offset)
  return first
end

--- The halves of a response, in the order of its blocks.
-- @return the PNIOStatus of the NDR header (nil for an empty body); the first half (`half.following` is the
--   next), nil for none; whether they are the inner halves of an IODWriteMultiple
function M.parse_answers(pdu)
  local body, opnum = pdu.body, pdu.opnum
  local type, status = RESPONSE_TYPES[opnum], number_at(body, 1, pdu.little)
  local place, stated = block_at(type, opnum, body, NDR)
  if not place then return status, nil, false end
  if opnum ~= WRITE then -- it has one block, and its data behind it
    return status, carrying(pdu, body, FIRST_END, stated, status), false
  end
  local half = written(pdu, type, status)
  if place.index ~= WRITE_MULTIPLE then return status, half, false end
  if not half.following and half.status and half.status ~= 0 then status = half.status end
  return status, half.following, true
end

--- The PNIOStatus of the NDR header (nil for an empty body) and the response blocks as records.
--
-- The blocks carry their own address, so that even a response without its request has one. An
-- IODWriteMultiple gives its inner responses only.
-- @return that, and the first record (`record.following` is the next), nil for none
function M.parse_response(pdu)
  local status, half, multiple = M.parse_answers(pdu)
  local first, last, offset, position = nil, nil, NDR, 0
  if multiple then offset, position = offset + SIZE, 1 end
  while half do
    local place = block_at(RESPONSE_TYPES[pdu.opnum], pdu.opnum, pdu.body, offset)
    local record = new_record(place, nil, half)
    if position ~= 0 then record.position = position end
    first, last = chained(first, last, record)
    half, offset, position = half.following, offset + SIZE, position + 1
  end
  return status, first
end

-- The AR in the first block of a message; nil if the block has another type or does not parse.
local function first_ar(pdu, types)
  local t1, t2 = byte(pdu.body, NDR + 1, NDR + 2)
  if #pdu.body < FIRST_AR + 16 or not types[t1 % 128 * 256 + t2] then return nil end
  return sub(pdu.body, FIRST_AR + 1, FIRST_AR + 16)
end

--- The AR that a Release ends, from its request or response; nil if its block does not parse.
function M.released_ar(pdu) return first_ar(pdu, RELEASE_BLOCKS) end

--- Whether a Connect request sets up the AR of cyclic data (IOCARSingle, also with IRT). A controller has
-- only one of these with a device. ARs of supervisors may exist beside it.
function M.is_only_ar(pdu)
  local t1, t2 = byte(pdu.body, FIRST_AR - 1, FIRST_AR)
  return t2 ~= nil and ONLY_ARS[t1 * 256 + t2] or false
end

--- The AR that a Connect sets up, from its request or response; nil if its first block is no ARBlock.
function M.connected_ar(pdu) return first_ar(pdu, CONNECT_BLOCKS) end

return M
