-- DCE/RPC connectionless v4: one UDP payload to one PDU, fragments to one message (docs/protocol.md E.2).
--
-- Recognised by content (version 4 and a PNIO interface UUID), never by port. Each PDU states its own byte
-- order; what leaves this file is normalised, so that a request and its answer compare equal.
-- Which response belongs to which request is decided in calls.lua.
-- Other than in Python, what the header of a conversation repeats is read once (`heads`): every frame of ours
-- passes here while Wireshark reads a file, and making things is what costs time in Lua.

local entries = require("ds47.support.later").entries
local flat = require("ds47.support.flat").copy
local ordered = require("ds47.support.ordered")
local tables = require("ds47.spec.tables")

local byte, char, gsub, sub = string.byte, string.char, string.gsub, string.sub

local M = {}

local layout = tables.layouts

M.HEADER_LENGTH, M.VERSION = layout.RPC_SIZE, layout.RPC_VERSION_4
M.PTYPES = {
  [0] = "request", "ping", "response", "fault", "working", "nocall", "reject", "ack", "cancel", "fack",
  "cancel_ack",
}
M.CONNECT, M.RELEASE, M.READ = layout.RPC_CONNECT, layout.RPC_RELEASE, layout.RPC_READ
M.WRITE, M.CONTROL, M.READ_IMPLICIT = layout.RPC_WRITE, layout.RPC_CONTROL, layout.RPC_READ_IMPLICIT

local MOST_PTYPE = 10
local FRAGMENT_END = layout.RPC_FRAGMENT + 2

-- The end of every UUID of PROFINET, which has no byte order.
local NODE = "\x82\x71\x00\xa0\x24\x42\xdf\x7d"

-- The interface UUIDs of a device, a controller, a supervisor and a parameter server, by byte order.
local BIG_INTERFACES, LITTLE_INTERFACES = {}, {}
for number = 1, 4 do
  BIG_INTERFACES["\xde\xa0\x00" .. char(number) .. "\x6c\x97\x11\xd1" .. NODE] = true
  LITTLE_INTERFACES[char(number) .. "\x00\xa0\xde\x97\x6c\xd1\x11" .. NODE] = true
end

-- That of the endpoint mapper, whose calls are numbered with those of PROFINET.
local MAPPERS = {
  [false] = "\xe1\xaf\x83\x08\x5d\x1f\x11\xc9\x91\xa4\x08\x00\x2b\x14\xa0\xfa",
  [true] = "\x08\x83\xaf\xe1\x1f\x5d\xc9\x11\x91\xa4\x08\x00\x2b\x14\xa0\xfa",
}

-- Whose calls it is: a request, ping, cancel or fack comes from the client.
local FROM_CLIENT = {[0] = true, [1] = true, [8] = true, [9] = true}

--- A little-endian UUID at a 1-based place, in network order.
local function swapped(data, at)
  local a, b, c, d, e, f, g, h = byte(data, at, at + 7)
  return char(d, c, b, a, f, e, h, g) .. sub(data, at + 8, at + 15)
end

-- What the PDUs of a conversation in one direction have in common, by the first 64 bytes of the header, which
-- they repeat, so that those are read once: by what stands before the activity, and by the rest (of two that
-- only differ in their addresses the newer one counts). A head holds a copy of itself for each operation
-- number, with that: the metatable of its PDUs, which have but four keys of their own then. A capture made to
-- have many must not fill memory.
local heads, head_count, MOST_HEADS = {}, 0, 4096
local MOST_OPERATIONS = 8 -- of one head; PROFINET has six
local COMMON = layout.RPC_SEQUENCE -- which is the first that changes from call to call
local OBJECT, INTERFACE, ACTIVITY = layout.RPC_OBJECT, layout.RPC_INTERFACE, layout.RPC_ACTIVITY
local SIZE, VERSION, LITTLE = layout.RPC_SIZE, layout.RPC_VERSION_4, layout.RPC_LITTLE

-- A number of 20 bits for a text, the same one always, times 2^32: a sequence number and an IP id go below.
local function digest_of(text)
  local digest = 0
  for place = 1, #text do digest = (digest * 31 + byte(text, place)) % 1048573 end
  return digest * 4294967296
end

-- The head for a header and the addresses of a packet; nil where it is no RPC of PROFINET or of the
-- endpoint mapper.
local function new_head(header, source, destination)
  local version, ptype, flags, _, order = byte(header, 1, 5)
  ptype = ptype % 32
  local little = order % (2 * LITTLE) >= LITTLE
  local interface = sub(header, INTERFACE + 1, ACTIVITY)
  local mapper = interface == MAPPERS[little]
  if version ~= VERSION or ptype > MOST_PTYPE
    or not (mapper or (little and LITTLE_INTERFACES or BIG_INTERFACES)[interface]) then
    return nil
  end
  local client, server = source, destination
  if not FROM_CLIENT[ptype] then client, server = destination, source end
  local activity = little and swapped(header, ACTIVITY + 1) or sub(header, ACTIVITY + 1, ACTIVITY + 16)
  local head = {
    ptype = ptype, little = little, last = flags % 4 >= 2, fragmented = flags % 8 >= 4,
    object_uuid = little and swapped(header, OBJECT + 1) or sub(header, OBJECT + 1, INTERFACE),
    activity = activity,
    source = source, destination = destination, client = client, server = server,
    -- Short: of 32 bytes and more Lua 5.2 hashes every second one, and keys with a number share places.
    conversation = gsub(client, "(%d+)%.?", char) .. activity,
    mapper = mapper or nil, -- true: what is said to the endpoint mapper
    boot = sub(header, ACTIVITY + 17, ACTIVITY + 20), -- when the server started, as it says itself
    digest = digest_of(source .. "\0" .. destination .. "\0" .. activity), -- to know a datagram again
    fragment = 0, missing = 0, -- of most PDUs; the others have their own
  }
  head.operations = entries(function(opnum)
    local class = flat(head)
    class.opnum, class.operations, class.__index = opnum, nil, class
    return class
  end, MOST_OPERATIONS)
  return head
end

--- What the PDUs have in common whose header begins at the 0-based offset `at`, of which 64 bytes are there,
-- and that go from one address to another; nil where it is not PNIO RPC.
function M.head(data, at, source, destination)
  local beginning, rest = sub(data, at + 1, at + ACTIVITY), sub(data, at + ACTIVITY + 1, at + COMMON)
  local known = heads[beginning]
  local head = known and known[rest]
  if head and head.source == source and head.destination == destination then return head end
  head = new_head(beginning .. rest, source, destination)
  if head then
    if head_count >= MOST_HEADS then heads, head_count = {}, 0 end
    heads[beginning] = heads[beginning] or {}
    heads[beginning][rest], head_count = head, head_count + 1
  end
  return head
end

--- The PDU of a head.
--
-- `body` is what follows the 80-byte header, `missing` the bytes of it that are not there. Where the capture
-- cut the frame, the caller adds that as `cut`; else the header says more than the datagram holds. UUIDs are
-- in network order whatever the PDU used; `little` tells the order of the NDR header; `conversation` names
-- client and activity. What a conversation repeats stands in the metatable of the PDU.
-- @param at, stop  0-based offsets of its beginning and its end in the data; all of its header is there
function M.pdu(head, data, at, stop, frame, time_ns)
  local s1, s2, s3, s4, o1, o2, _, _, _, _, l1, l2, f1, f2 = byte(data, at + COMMON + 1, at + FRAGMENT_END)
  local seq, opnum, length, fragment
  if head.little then
    seq = ((s4 * 256 + s3) * 256 + s2) * 256 + s1
    opnum, length, fragment = o2 * 256 + o1, l2 * 256 + l1, f2 * 256 + f1
  else
    seq = ((s1 * 256 + s2) * 256 + s3) * 256 + s4
    opnum, length, fragment = o1 * 256 + o2, l1 * 256 + l2, f1 * 256 + f2
  end
  local begin = at + SIZE
  local stated = begin + length
  local pdu = setmetatable({
    seq = seq, body = sub(data, begin + 1, stated < stop and stated or stop),
    frame = frame, time_ns = time_ns,
  }, head.operations[opnum])
  if stated > stop then pdu.missing = stated - stop end
  if fragment ~= 0 then pdu.fragment = fragment end
  return pdu
end

--- The PDU in a UDP packet; nil where it is not PNIO RPC or its header is cut off.
-- @param packet {payload, frame, time_ns, src_ip, dst_ip, src_port, cut}: a whole UDP payload. `cut` is nil,
--   or {frame = number, captured = bytes, original = bytes} of a frame that the capture cut.
function M.parse(packet)
  local data = packet.payload
  local head = #data >= SIZE and M.head(data, 0, packet.src_ip, packet.dst_ip)
  if not head then return nil end
  local pdu = M.pdu(head, data, 0, #data, packet.frame, packet.time_ns)
  pdu.port = packet.src_port
  if pdu.missing ~= 0 then pdu.cut = packet.cut end
  return pdu
end

--- What names two stations: client and server.
function M.pair(client, server) return client .. "\0" .. server end

--- Vendor id and device id out of an RPC object UUID (docs/protocol.md E.2); nil for a foreign one.
function M.device_identity(object_uuid)
  if sub(object_uuid, 1, 8) ~= "\xde\xa0\x00\x00\x6c\x97\x11\xd1" then return nil end
  local d1, d2, v1, v2 = byte(object_uuid, 13, 16)
  return v1 * 256 + v2, d1 * 256 + d2
end

local Fragments = {}
Fragments.__index = Fragments
M.Fragments = Fragments

--- Puts fragmented RPC messages together; bounded in number and in capture time.
-- @param expiry_ns how long an incomplete message is kept, nanoseconds of capture time
-- Whoever feeds takes what is in `given_up`, and empties it: an array as of `unfinished`; `limit` is the name
-- of the one that pushed it out, nil where its time was over.
-- @param limit how many incomplete messages are kept; nil (here and below) for the shipped limit
-- @param fragments how many fragments of incomplete messages are kept; the oldest message goes first
-- @param most_bytes how many bytes of such fragments
function Fragments.new(expiry_ns, limit, fragments, most_bytes)
  local limits = tables.limits
  return setmetatable({
    expiry_ns = expiry_ns, limit = limit or limits.rpc_messages,
    most_fragments = fragments or limits.rpc_fragments, most_bytes = most_bytes or limits.fragment_bytes,
    partial = ordered.new(), fragments = 0, bytes = 0,
    given_up = {},
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
  local parts, bodies, length, cut, first_cut = partial.parts, {}, 0, false, nil
  for number = 0, partial.last do
    local part = parts[number]
    -- What stands behind a hole is at no known place in the record: it counts as missing too.
    bodies[number + 1] = cut and "" or part.body
    length, cut = length + #part.body + part.missing, cut or part.missing > 0
    first_cut = first_cut or part.cut
  end
  local whole = flat(parts[0]) -- the fragment itself is still needed to know its copies
  whole.body = table.concat(bodies)
  whole.missing = length - #whole.body
  whole.cut = first_cut
  whole.frame, whole.time_ns = newest.frame, newest.time_ns
  whole.fragmented, whole.peer = false, nil -- of its peer more may be known than when the end was asked for
  return whole
end

--- The whole message, as soon as there is one. Its frame and time are the completing frame's.
function Fragments:feed(pdu)
  if not pdu.fragmented then return pdu end
  local key = pdu.source .. "\0" .. pdu.activity .. pdu.seq .. "\0" .. pdu.ptype
  local partial = self.partial:get(key)
  if partial and self:_is_old(partial, pdu.time_ns) then
    self:_give_up(key, nil) -- the sequence number came round: this is another message
    partial = nil
  end
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
    local limit = self:_over()
    while limit do
      self:_give_up(self.partial.oldest, limit)
      limit = self:_over()
    end
    return nil
  end
  return join(self:_close(key), pdu)
end

function Fragments:_close(key)
  local partial = self.partial:pop(key)
  self.fragments = self.fragments - partial.count
  self.bytes = self.bytes - partial.bytes
  return partial
end

--- The clock may have stepped back, so far ahead of it is old too.
function Fragments:_is_old(partial, now) return math.abs(now - partial.newest_ns) > self.expiry_ns end

function Fragments:_make_room(now)
  local partials = self.partial
  while partials.length > 0 do
    local key, oldest = partials:first()
    local old = self:_is_old(oldest, now)
    if not old and partials.length < self.limit then return end
    self:_give_up(key, not old and "rpc_messages" or nil)
  end
end

--- The name of the limit that is passed, nil for none.
function Fragments:_over()
  if self.fragments > self.most_fragments then return "rpc_fragments" end
  return self.bytes > self.most_bytes and "fragment_bytes" or nil
end

local function beginning(partial, limit)
  return {pdu = partial.parts[0] or partial.first, have = partial.count, limit = limit}
end

function Fragments:_give_up(key, limit)
  self.given_up[#self.given_up + 1] = beginning(self:_close(key), limit)
end

--- What is still waited for, oldest first: an array of {pdu = first fragment (or first seen), have = number}.
function Fragments:unfinished()
  local found = {}
  for _, partial in self.partial:iterate() do found[#found + 1] = beginning(partial) end
  return found
end

return M
