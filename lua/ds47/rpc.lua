-- DCE/RPC connectionless v4: one UDP payload to one PDU, fragments to one message (docs/protocol.md E.2).
--
-- Recognised by content (version 4 and a PNIO interface UUID), never by port. Each PDU states its own byte
-- order; what leaves this file is normalised, so that a request and its answer compare equal.
-- Which response belongs to which request is decided in calls.lua.

local ordered = require("ds47.ordered")
local tables = require("ds47.tables")

local byte, char, sub = string.byte, string.char, string.sub

local M = {}

M.HEADER_LENGTH = 80
M.PTYPES = {
  [0] = "request", "ping", "response", "fault", "working", "nocall", "reject", "ack", "cancel", "fack",
  "cancel_ack",
}
M.CONNECT, M.RELEASE, M.READ, M.WRITE, M.CONTROL, M.READ_IMPLICIT = 0, 1, 2, 3, 4, 5

local MOST_PTYPE = 10

-- The interface UUIDs of a device, a controller, a supervisor and a parameter server, by byte order.
local BIG_INTERFACES, LITTLE_INTERFACES = {}, {}
for number = 1, 4 do
  local tail = "\x82\x71\x00\xa0\x24\x42\xdf\x7d"
  BIG_INTERFACES["\xde\xa0\x00" .. char(number) .. "\x6c\x97\x11\xd1" .. tail] = true
  LITTLE_INTERFACES[char(number) .. "\x00\xa0\xde\x97\x6c\xd1\x11" .. tail] = true
end

-- Whose calls it is: a request, ping, cancel or fack comes from the client.
local FROM_CLIENT = {[0] = true, [1] = true, [8] = true, [9] = true}

--- A little-endian UUID at a 1-based place, in network order.
local function swapped(data, at)
  local a, b, c, d, e, f, g, h = byte(data, at, at + 7)
  return char(d, c, b, a, f, e, h, g) .. sub(data, at + 8, at + 15)
end

--- The PDU in a UDP packet; nil where it is not PNIO RPC or its header is cut off.
--
-- `body` is what follows the 80-byte header, `missing` the bytes of it that the capture cut off. UUIDs are in
-- network order whatever the PDU used; `little` tells the order of the NDR header.
-- @param packet {payload, frame, time_ns, src_ip, dst_ip, ip_id, src_mac}: a whole UDP payload
function M.parse(packet)
  local data = packet.payload
  local version, ptype, flags, _, order = byte(data, 1, 5)
  if version ~= 4 or #data < 80 then
    return nil
  end
  ptype = ptype % 32
  if ptype > MOST_PTYPE then
    return nil
  end
  local little = order % 32 >= 16
  local interface = sub(data, 25, 40)
  local s1, s2, s3, s4, o1, o2, _, _, _, _, l1, l2, f1, f2 = byte(data, 65, 78)
  local object, activity, seq, opnum, length, fragment
  if little then
    if not LITTLE_INTERFACES[interface] then
      return nil
    end
    object, activity = swapped(data, 9), swapped(data, 41)
    seq = ((s4 * 256 + s3) * 256 + s2) * 256 + s1
    opnum, length, fragment = o2 * 256 + o1, l2 * 256 + l1, f2 * 256 + f1
  else
    if not BIG_INTERFACES[interface] then
      return nil
    end
    object, activity = sub(data, 9, 24), sub(data, 41, 56)
    seq = ((s1 * 256 + s2) * 256 + s3) * 256 + s4
    opnum, length, fragment = o1 * 256 + o2, l1 * 256 + l2, f1 * 256 + f2
  end
  local body = sub(data, 81, 80 + length)
  local source, destination = packet.src_ip, packet.dst_ip
  local client, server = source, destination
  if not FROM_CLIENT[ptype] then
    client, server = destination, source
  end
  return {
    ptype = ptype, little = little, object_uuid = object, activity = activity, seq = seq, opnum = opnum,
    fragment = fragment, last = flags % 4 >= 2, fragmented = flags % 8 >= 4,
    body = body, missing = length - #body, frame = packet.frame, time_ns = packet.time_ns,
    source = source, destination = destination, client = client, server = server,
    ip_id = packet.ip_id, source_mac = packet.src_mac,
  }
end

--- Vendor id and device id out of an RPC object UUID (docs/protocol.md E.2); nil for a foreign one.
function M.device_identity(object_uuid)
  if sub(object_uuid, 1, 8) ~= "\xde\xa0\x00\x00\x6c\x97\x11\xd1" then
    return nil
  end
  local d1, d2, v1, v2 = byte(object_uuid, 13, 16)
  return v1 * 256 + v2, d1 * 256 + d2
end

local Fragments = {}
Fragments.__index = Fragments
M.Fragments = Fragments

--- Puts fragmented RPC messages together; bounded in number and in capture time.
-- @param expiry_ns how long an incomplete message is kept, nanoseconds of capture time
-- @param limit how many incomplete messages are kept, and how many given up ones; nil (here and below) for
--   the shipped limit
-- @param fragments how many fragments of incomplete messages are kept; the oldest message goes first
-- @param most_bytes how many bytes of such fragments
function Fragments.new(expiry_ns, limit, fragments, most_bytes)
  local limits = tables.limits
  return setmetatable({
    expiry_ns = expiry_ns, limit = limit or limits.rpc_messages,
    most_fragments = fragments or limits.rpc_fragments, most_bytes = most_bytes or limits.fragment_bytes,
    partial = ordered.new(), fragments = 0, bytes = 0,
    given_up = {}, gave_up = 0, -- a ring: the newest `limit` messages, and how many there ever were
  }, Fragments)
end

--- Takes a fragment, once; what stands behind the last one is none of this message.
local function add(partial, pdu)
  local parts, number = partial.parts, pdu.fragment
  if pdu.last and not partial.last then
    partial.last = number
    for other in pairs(parts) do
      if other > number then
        partial.bytes = partial.bytes - #parts[other].body
        parts[other] = nil
        partial.count = partial.count - 1
      end
    end
  end
  if (not partial.last or number <= partial.last) and not parts[number] then
    parts[number] = pdu
    partial.count = partial.count + 1
    partial.bytes = partial.bytes + #pdu.body
  end
  partial.newest_ns = pdu.time_ns
end

local function join(partial, newest)
  local parts, bodies, missing = partial.parts, {}, 0
  for number = 0, partial.last do
    bodies[number + 1] = parts[number].body
    missing = missing + parts[number].missing
  end
  local whole = {}
  for name, value in pairs(parts[0]) do -- the fragment itself is still needed to know its copies
    whole[name] = value
  end
  whole.body, whole.missing = table.concat(bodies), missing
  whole.frame, whole.time_ns = newest.frame, newest.time_ns
  whole.fragmented = false
  return whole
end

--- The whole message, as soon as there is one. Its frame and time are the completing frame's.
function Fragments:feed(pdu)
  if not pdu.fragmented then
    return pdu
  end
  local key = pdu.source .. "\0" .. pdu.activity .. pdu.seq .. "\0" .. pdu.ptype
  local partial = self.partial:get(key)
  if not partial then
    self:_make_room(pdu.time_ns)
    partial = {first = pdu, parts = {}, count = 0, bytes = 0, last = nil, newest_ns = pdu.time_ns}
    self.partial:set(key, partial)
  end
  local before, bytes_before = partial.count, partial.bytes
  add(partial, pdu)
  self.fragments = self.fragments + partial.count - before
  self.bytes = self.bytes + partial.bytes - bytes_before
  if not partial.last or partial.count <= partial.last then
    while self.fragments > self.most_fragments or self.bytes > self.most_bytes do
      self:_give_up()
    end
    return nil
  end
  self.partial:pop(key)
  self.fragments = self.fragments - partial.count
  self.bytes = self.bytes - partial.bytes
  return join(partial, pdu)
end

function Fragments:_make_room(now)
  local partials = self.partial
  while partials.length > 0 do
    local _, oldest = partials:first()
    if now - oldest.newest_ns <= self.expiry_ns and partials.length < self.limit then
      return
    end
    self:_give_up()
  end
end

local function beginning(partial)
  return {pdu = partial.parts[0] or partial.first, have = partial.count}
end

function Fragments:_give_up()
  local _, partial = self.partial:pop_first()
  self.fragments = self.fragments - partial.count
  self.bytes = self.bytes - partial.bytes
  self.given_up[self.gave_up % self.limit + 1] = beginning(partial)
  self.gave_up = self.gave_up + 1
end

--- What never became whole, oldest first: an array of {pdu = first fragment (or first seen), have = number}.
function Fragments:unfinished()
  local found = {}
  for number = math.max(0, self.gave_up - self.limit), self.gave_up - 1 do
    found[#found + 1] = self.given_up[number % self.limit + 1]
  end
  for _, partial in self.partial:iterate() do
    found[#found + 1] = beginning(partial)
  end
  return found
end

return M
