-- Record calls: the body of a Read, Write or ReadImplicit RPC to the records in it (docs/protocol.md E.3,
-- E.4).
--
-- Opens one level of IODWriteMultiple (0xE040). Knows nothing of DS47: `data` is opaque bytes here.
--
-- A Half is {frame, time_ns, data, stated, missing, status}. `data` is what a Write request or a response
-- carries ("" for nothing), `stated` the RecordDataLength, where that is another one than its length: in a
-- Read request the most that is wanted, else with `missing`, how much of it the capture cut off. `status` is
-- the PNIOStatus with ErrorCode first (nil where the PDU carries none).
-- A Record is {write, implicit, ar, api, slot, subslot, index, position, request, response, following};
-- `position` is 0, or the place inside an IODWriteMultiple; `request` and `response` are halves or nil.
-- Nearly every call has one record. The others of an IODWriteMultiple hang on it: `following` is the next one
-- of a call, nil of the last; the same of the halves of a response.
--
-- What records repeat stands in their metatable, `record.place`: a table with a few keys of its own is what
-- the plugin can afford for a frame. Halves have no metatable, and no key that says nothing.

local rpc = require("ds47.profinet.rpc")
local layout = require("ds47.spec.tables").layouts

local byte, char, find, sub = string.byte, string.char, string.find, string.sub
local floor, setmetatable = math.floor, setmetatable

local M = {}

local SIZE, NDR = layout.RECORD_SIZE, layout.NDR_SIZE
local AR, INDEX, HEAD = layout.RECORD_AR, layout.RECORD_INDEX, layout.RECORD_DATA + 4
local STATUS = layout.RECORD_STATUS
local WRITE_MULTIPLE = layout.RECORD_WRITE_MULTIPLE
local NIL_UUID = ("\0"):rep(16)
M.WRITE_MULTIPLE, M.NIL_UUID = WRITE_MULTIPLE, NIL_UUID
M.NO_API = -1 -- where there is neither API nor subslot: on PROFIBUS

local WRITE, READ_IMPLICIT = rpc.WRITE, rpc.READ_IMPLICIT

-- The blocks of an operation in one direction: the first two bytes of each, and those that were seen by what
-- they say from the AR up to the record data length or, where a block has one, the status (`new_block`). So
-- one look at 32 or 40 bytes tells all of a block. `sound` are the beginnings of bodies up to that type in
-- which there is no error.
local function blocks_of(type, upto)
  return {type = char(floor(type / 256), type % 256), upto = upto, known = {}, sound = {}}
end

local REQUEST_BLOCKS = {
  [rpc.READ] = blocks_of(layout.BLOCK_READ_REQUEST, HEAD),
  [READ_IMPLICIT] = blocks_of(layout.BLOCK_READ_REQUEST, HEAD),
  [WRITE] = blocks_of(layout.BLOCK_WRITE_REQUEST, HEAD),
}
local RESPONSE_BLOCKS = {
  [rpc.READ] = blocks_of(layout.BLOCK_READ_RESPONSE, HEAD),
  [READ_IMPLICIT] = blocks_of(layout.BLOCK_READ_RESPONSE, HEAD),
  [WRITE] = blocks_of(layout.BLOCK_WRITE_RESPONSE, STATUS + 4),
}
local known_count, MOST_KNOWN = 0, 16384 -- of all blocks and beginnings
local AR_BLOCK = layout.BLOCK_AR_REQUEST
local ONLY_ARS = {[0x0001] = true, [0x0010] = true}
local RELEASE_BLOCKS = {[layout.BLOCK_RELEASE_REQUEST] = true, [layout.BLOCK_RELEASE_OF_RSI] = true}
local FIRST_END = NDR + SIZE -- where the first block ends
local FIRST_AR = NDR + layout.BLOCK_AR -- where the AR stands in a Connect or Release

--- A half that carries no data.
function M.half(frame, time_ns, status)
  return {frame = frame, time_ns = time_ns, data = "", status = status}
end

-- The fields of a place are those of its records: `write` to `position`. With them stand `spot`, a text for
-- slot, subslot and index, and the keys of its AR and its channel for the peer that spoke of it last
-- (`ar_key`, `channel_key`), which is always the same one but for ReadImplicit.
local places, place_count, MOST_PLACES = {}, 0, 4096

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

-- The place that the bytes from the AR to the index name.
local function place_of(opnum, key)
  local known = places[opnum]
  if known == nil then
    known = {}
    places[opnum] = known
  end
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

local function remember(blocks, kind, key, value)
  if known_count >= MOST_KNOWN then
    for _, all in ipairs({REQUEST_BLOCKS, RESPONSE_BLOCKS}) do
      for _, each in pairs(all) do each.known, each.sound = {}, {} end
    end
    known_count = 0
  end
  blocks[kind][key], known_count = value, known_count + 1
end

-- Four bytes at a 1-based place as a number, big-endian as in blocks (P13); nil where not all are there.
local function number_at(data, at, little)
  local a, b, c, d = byte(data, at, at + 3)
  if little and d then
    a, b, c, d = d, c, b, a
  end
  return d and ((a * 256 + b) * 256 + c) * 256 + d
end

-- What a block says: {place, stated, status (of a Write response), multiple (of IODWriteMultiple)}; nil where
-- it is not whole.
local function new_block(blocks, opnum, key)
  local stated = number_at(key, INDEX + 3 - AR)
  if not stated then
    return nil
  end
  local place = place_of(opnum, sub(key, 1, INDEX + 2 - AR))
  local block = {
    place = place, stated = stated, status = number_at(key, STATUS + 1 - AR),
    multiple = opnum == WRITE and place.index == WRITE_MULTIPLE,
  }
  remember(blocks, "known", key, block)
  return block
end

-- The block at the 0-based offset, whose type is known; nil where it is not whole.
local function typed_block(blocks, opnum, data, offset)
  local key = sub(data, offset + AR + 1, offset + blocks.upto)
  return blocks.known[key] or new_block(blocks, opnum, key)
end

-- The same; nil too where it is not of the expected type.
local function block_at(blocks, opnum, data, offset)
  if blocks and sub(data, offset + 1, offset + 2) == blocks.type then
    return typed_block(blocks, opnum, data, offset)
  end
  return nil
end

--- What names an AR: controller, device, AR UUID (nil UUID for ReadImplicit).
function M.ar_text(controller, device, ar)
  return controller .. "\0" .. device .. "\0" .. ar
end

--- The device of an AR that is named by its `ar_text`; nil where it is no such name.
function M.device_of(ar)
  local at = find(ar, "\0", 1, true)
  local ends = at and find(ar, "\0", at + 1, true)
  return ends and sub(ar, at + 1, ends - 1)
end

--- Gives a place its keys for a peer, where it has not got those already (`place.peer`): `ar_key`, `ar_text`
-- of its AR, and `channel_key`, which names its channel (docs/pairing.md P14).
function M.know_peer(place, peer)
  local names = peer.controller .. "\0" .. peer.device
  place.peer, place.ar_key = peer, M.ar_text(peer.controller, peer.device, place.ar)
  place.channel_key = place.text .. names
end

local know_peer = M.know_peer

--- What names the AR of a record, between two peers: its `ar_text`.
function M.ar_key(peer, record)
  local place = record.place
  if place.peer ~= peer then
    know_peer(place, peer)
  end
  return place.ar_key
end

--- What names the channel of a record.
function M.channel_key(peer, record)
  local place = record.place
  if place.peer ~= peer then
    know_peer(place, peer)
  end
  return place.channel_key
end

-- Hangs something on the last one of its kind; the first and the last one then.
local function chained(first, last, item)
  if last then
    last.following = item
  end
  return first or item, item
end

-- The record that a block of a request asks for: with the data behind the block in a Write, with the wanted
-- length alone in a Read.
local function asked(pdu, opnum, block, data, start)
  local stated = block.stated
  if opnum ~= WRITE then
    return new_record(block.place, {frame = pdu.frame, time_ns = pdu.time_ns, stated = stated})
  end
  local payload = sub(data, start + 1, start + stated)
  local half = {frame = pdu.frame, time_ns = pdu.time_ns, data = payload}
  if #payload < stated then
    half.stated, half.missing = stated, stated - #payload
  end
  return new_record(block.place, half)
end

-- The records of an IODWriteMultiple.
local function parse_multiple(pdu, blocks, inner)
  local first, last, offset, position, nested = nil, nil, 0, 1, false
  local block = block_at(blocks, WRITE, inner, 0)
  while block do
    nested = nested or block.multiple
    local record = asked(pdu, WRITE, block, inner, offset + SIZE)
    record.position, position = position, position + 1
    first, last = chained(first, last, record)
    offset = offset + SIZE + block.stated + -block.stated % 4
    block = block_at(blocks, WRITE, inner, offset)
  end
  return first, true, nested
end

--- The records of a Read, Write or ReadImplicit request; what does not parse is absent.
-- @return the first of them (`record.following` is the next), nil for none; whether they are those of an
--   IODWriteMultiple, and whether another one stands inside it, whose records are not opened (P18)
function M.parse_request(pdu)
  local body, opnum = pdu.body, pdu.opnum
  local blocks = REQUEST_BLOCKS[opnum]
  local block = block_at(blocks, opnum, body, NDR)
  if not block then
    return nil, false, false
  elseif block.multiple then
    return parse_multiple(pdu, blocks, sub(body, FIRST_END + 1, FIRST_END + block.stated))
  end
  return asked(pdu, opnum, block, body, FIRST_END), false, false
end

-- The response of one block. The status of a Write is its own, unless the whole call failed.
local function answer(pdu, opnum, block, body, offset, status)
  if opnum == WRITE then
    if status == 0 then
      status = block.status
    end
    -- without data, but a Read may be answered so, too
    return {frame = pdu.frame, time_ns = pdu.time_ns, data = "", status = status}
  end
  local stated = block.stated
  local data = sub(body, offset + SIZE + 1, offset + SIZE + stated)
  local half = {frame = pdu.frame, time_ns = pdu.time_ns, data = data, status = status}
  if #data < stated then
    half.stated, half.missing = stated, stated - #data
  end
  return half
end

-- The PNIOStatus of a response (nil for an empty body), and its first block, nil for none.
local function beginning_of(pdu, blocks, opnum, body)
  local beginning = sub(body, 1, NDR + 2)
  if blocks and blocks.sound[beginning] then
    return 0, typed_block(blocks, opnum, body, NDR)
  end
  local status, block = number_at(body, 1, pdu.little), block_at(blocks, opnum, body, NDR)
  if status == 0 and block then
    remember(blocks, "sound", beginning, true)
  end
  return status, block
end

-- The halves of the blocks of a Write response, from the one at the offset on.
local function answers(pdu, blocks, offset, status)
  local first, last, body = nil, nil, pdu.body
  local block = block_at(blocks, WRITE, body, offset)
  while block do
    first, last = chained(first, last, answer(pdu, WRITE, block, body, offset, status))
    offset = offset + SIZE
    block = block_at(blocks, WRITE, body, offset)
  end
  return first
end

--- The halves of a response, in the order of its blocks.
-- @return the PNIOStatus of the NDR header (nil for an empty body); the first half (`half.following` is the
--   next), nil for none; whether they are those of an IODWriteMultiple, of which only the inner ones are told
function M.parse_halves(pdu)
  local body, opnum = pdu.body, pdu.opnum
  local blocks = RESPONSE_BLOCKS[opnum]
  local status, block = beginning_of(pdu, blocks, opnum, body)
  if not block then
    return status, nil, false
  end
  local half = answer(pdu, opnum, block, body, NDR, status)
  if opnum ~= WRITE then -- it has one block, and its data behind it
    return status, half, false
  end
  local others = #body >= FIRST_END + HEAD and answers(pdu, blocks, FIRST_END, status) or nil
  if not block.multiple then
    if others then
      half.following = others
    end
    return status, half, false
  end
  if not others and half.status and half.status ~= 0 then
    status = half.status
  end
  return status, others, true
end

--- The PNIOStatus of the NDR header (nil for an empty body) and the response blocks as records.
--
-- The blocks carry their own address, so that a response without its request can still be placed. An
-- IODWriteMultiple gives its inner responses only.
-- @return that, and the first record (`record.following` is the next), nil for none
function M.parse_response(pdu)
  local status, half, multiple = M.parse_halves(pdu)
  local first, last, offset, position = nil, nil, NDR, 0
  if multiple then
    offset, position = offset + SIZE, 1
  end
  while half do
    local block = block_at(RESPONSE_BLOCKS[pdu.opnum], pdu.opnum, pdu.body, offset)
    local record = new_record(block.place, nil, half)
    if position ~= 0 then
      record.position = position
    end
    first, last = chained(first, last, record)
    half, offset, position = half.following, offset + SIZE, position + 1
  end
  return status, first
end

--- The AR that a Release ends, by its request or response; nil where its block does not parse.
function M.released_ar(pdu)
  local t1, t2 = byte(pdu.body, NDR + 1, NDR + 2)
  if #pdu.body < FIRST_AR + 16 or not RELEASE_BLOCKS[t1 % 128 * 256 + t2] then
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

--- The AR that a Connect sets up, by its request or response; nil where its first block is no ARBlock.
function M.connected_ar(pdu)
  local t1, t2 = byte(pdu.body, NDR + 1, NDR + 2)
  if #pdu.body < FIRST_AR + 16 or t1 % 128 * 256 + t2 ~= AR_BLOCK then
    return nil
  end
  return sub(pdu.body, FIRST_AR + 1, FIRST_AR + 16)
end

return M
