-- IPv4: UDP datagrams put together from fragments.
--
-- Not here: whole datagrams (rpc.lua takes their payload as it is), and the header of a packet: whoever
-- feeds has read it.

local ordered = require("ds47.support.ordered")

local byte, sub = string.byte, string.sub

local M = {}

-- Datagrams that became whole and are remembered, to know a mirror port's copies of their fragments.
local MOST_DONE = 64
local COPY_NS = 1000000
local LONGEST = 65535
local UNIT = 8 -- bytes in which offsets count

-- What is known of an unfinished datagram:
--   first_ns, frame, time_ns   of the first fragment; of the newest one
--   total                      nil until the last fragment was seen
--   pieces                     offset -> {data = captured bytes, length = on the wire, frame}
--   count, bytes               of the pieces, and of their captured bytes
--   cut                        the first frame that the capture cut, as rpc.parse takes it
--   reach, looked              there is no hole up to `reach`; up to which offset pieces are in it
--   again                      set of the offsets of pieces of which copies came when it was whole

local function add(entry, offset, data, length, more, cut, frame)
  local known = entry.pieces[offset]
  if not known or known.length < length then
    entry.pieces[offset] = {data = data, length = length, frame = frame}
    entry.bytes = entry.bytes + #data - (known and #known.data or 0)
    entry.cut = entry.cut or cut
    if offset < entry.looked then entry.reach = math.max(entry.reach, offset + length) end
  end
  if not more and not entry.total then entry.total = offset + length end
  if not known then entry.count = entry.count + 1 end
end

--- Whether no hole is left up to the last fragment.
local function covered(entry)
  local pieces = entry.pieces
  while pieces[entry.reach] do -- mostly one begins where the one before it ends
    entry.reach = entry.reach + pieces[entry.reach].length
  end
  while entry.reach < entry.total and entry.looked <= entry.reach do
    local piece = pieces[entry.looked]
    if piece then entry.reach = math.max(entry.reach, entry.looked + piece.length) end
    entry.looked = entry.looked + UNIT
  end
  return entry.reach >= entry.total
end

--- The captured bytes from offset 0 up to the first hole.
local function head(entry)
  local offsets, parts, at = {}, {}, 0
  for offset in pairs(entry.pieces) do offsets[#offsets + 1] = offset end
  table.sort(offsets)
  for _, offset in ipairs(offsets) do
    local piece = entry.pieces[offset]
    if offset > at then break end
    local part = sub(piece.data, at - offset + 1)
    parts[#parts + 1] = part
    at = at + #part
    if #piece.data < piece.length then break end
  end
  local data = table.concat(parts)
  return entry.total and sub(data, 1, entry.total) or data
end

--- Bytes on the wire of the fragments seen, without the IP headers.
local function have(entry)
  local sum = 0
  for _, piece in pairs(entry.pieces) do sum = sum + piece.length end
  return sum
end

--- The UDP payload of a datagram as a packet; nil without a whole UDP header.
-- @param entry {frame, time_ns, src_ip, dst_ip, ip_id, cut}
-- @param length bytes of the datagram on the wire, of which `data` was captured
local function packet_of(entry, data, length)
  local p1, p2, _, _, l1, l2 = byte(data, 1, 6)
  if #data < 8 then return nil end
  local stated = l1 * 256 + l2
  if stated < 8 then stated = length end -- 0 where the sender left it to its card
  local payload = sub(data, 9, stated)
  return {
    payload = payload, frame = entry.frame, time_ns = entry.time_ns, src_ip = entry.src_ip,
    dst_ip = entry.dst_ip, src_port = p1 * 256 + p2, ip_id = entry.ip_id, src_mac = nil,
    missing = math.max(0, stated - 8 - #payload), cut = entry.cut,
  }
end

local Reassembler = {}
Reassembler.__index = Reassembler
M.Reassembler = Reassembler

--- Puts fragments together, whatever their order; copies of a fragment are tolerated.
--
-- Memory is bounded: the oldest unfinished datagram goes first. One that is not whole `fragment_expiry_ns` of
-- capture time after its first fragment is given up. Whoever feeds takes what is in `given_up`, and empties
-- it: an array as of `unfinished`; `limit` is the name of the one that pushed it out, nil where its time was
-- over.
-- @param limits the flat table of tables.lua (fragment_expiry_ns, ip_datagrams, ip_fragments, fragment_bytes)
function Reassembler.new(limits)
  return setmetatable({
    expiry_ns = limits.fragment_expiry_ns, most_datagrams = limits.ip_datagrams,
    most_fragments = limits.ip_fragments, most_bytes = limits.fragment_bytes,
    open = ordered.new(), done = ordered.new(), fragments = 0, bytes = 0, now_ns = nil,
    given_up = {},
    original = nil, -- the frame of which the fragment that was taken last is a copy
  }, Reassembler)
end

-- The datagram that was whole last, if this is a piece of it once more, and that piece; else nil.
local function known(self, key, offset, data, length)
  local done = self.done:get(key)
  local piece = done and done.pieces[offset]
  if piece and piece.data == data and piece.length == length then return done, piece end
  return nil
end

-- Adds what came of a whole datagram once more: that was no mirror port's where more of it follows so late.
local function add_again(entry, done)
  for offset in pairs(done.again) do
    local piece = done.pieces[offset]
    local finish, cut = offset + piece.length, #piece.data < piece.length and done.cut or nil
    add(entry, offset, piece.data, piece.length, finish ~= done.total, cut, piece.frame)
  end
end

--- Takes a fragment; the packet (as rpc.parse takes it) when this one completes the datagram, else nil.
-- @param part {frame, time_ns, src_ip, dst_ip, ip_id, src_mac, offset, more, data, missing, cut}: `offset` in
--   bytes, `more` the flag that more fragments follow, `data` the IP payload as it was captured, `missing`
--   (nil for 0) the bytes at its end that were not, `cut` as rpc.parse takes it; where the snap length cut
--   fragments, the payload ends at the first cut
function Reassembler:feed(part)
  local time_ns, offset, data = part.time_ns, part.offset, part.data
  local length = #data + (part.missing or 0)
  self.now_ns = time_ns
  local key = part.src_ip .. "\0" .. part.dst_ip .. "\0" .. part.ip_id
  self.original = nil
  if length == 0 or offset + length > LONGEST then return nil end
  local done, piece = known(self, key, offset, data, length)
  -- Later than that it is a new datagram with a reused identification, or the same once more.
  if done and math.abs(time_ns - done.time_ns) <= COPY_NS then
    done.again[offset], self.original = true, piece.frame
    return nil
  end
  self:_expire()
  local entry = self.open:get(key)
  if not entry then
    entry = {
      src_ip = part.src_ip, dst_ip = part.dst_ip, ip_id = part.ip_id, first_ns = time_ns,
      total = nil, pieces = {}, count = 0, bytes = 0, reach = 0, looked = 0, again = {},
    }
    self.open:set(key, entry)
  end
  local before, bytes_before = entry.count, entry.bytes
  if done and before == 0 then add_again(entry, done) end
  add(entry, offset, data, length, part.more, part.cut, part.frame)
  self.fragments = self.fragments + entry.count - before
  self.bytes = self.bytes + entry.bytes - bytes_before
  entry.frame, entry.time_ns = part.frame, time_ns
  if not entry.total or not covered(entry) then
    self:_make_room(key)
    return nil
  end
  self:_close(key)
  self.done:set(key, entry)
  if self.done.length > MOST_DONE then self.done:pop_first() end
  local packet = packet_of(entry, head(entry), entry.total)
  if packet then packet.src_mac = part.src_mac end
  return packet
end

--- Adds {packet, have, limit} to an array, if the datagram is one of UDP as far as it goes.
local function tell(found, entry)
  local packet = packet_of(entry, head(entry), entry.total or have(entry))
  if packet then found[#found + 1] = {packet = packet, have = entry.count, limit = entry.limit} end
end

--- What a fragment that completes no datagram tells alone: a packet; nil where it is not the beginning.
function Reassembler.begun(part)
  if part.offset ~= 0 then return nil end
  return packet_of(part, part.data, #part.data + (part.missing or 0))
end

--- What is still waited for, oldest first: an array of {packet, have}.
-- The packet holds the payload up to the first hole, its frame and time are those of the last fragment seen
-- and its MAC address is not kept; `have` counts the fragments seen.
function Reassembler:unfinished()
  local found = {}
  for _, entry in self.open:iterate() do tell(found, entry) end
  return found
end

function Reassembler:_close(key)
  local entry = self.open:pop(key)
  self.fragments = self.fragments - entry.count
  self.bytes = self.bytes - entry.bytes
  return entry
end

--- The order of first fragments is nearly the order of time, so the oldest one decides. The clock may have
-- stepped back: what began far ahead of it is as old as what began long ago.
function Reassembler:_expire()
  while self.open.length > 0 do
    local key, entry = self.open:first()
    if math.abs(self.now_ns - entry.first_ns) <= self.expiry_ns then return end
    self:_give_up(key, nil)
  end
end

--- The name of the limit that is passed, nil for none.
function Reassembler:_over()
  if self.open.length > self.most_datagrams then return "ip_datagrams" end
  if self.fragments > self.most_fragments then return "ip_fragments" end
  return self.bytes > self.most_bytes and "fragment_bytes" or nil
end

function Reassembler:_make_room(newest)
  local open, limit = self.open, self:_over()
  while limit and open.oldest ~= newest do
    self:_give_up(open.oldest, limit)
    limit = self:_over()
  end
end

function Reassembler:_give_up(key, limit)
  local entry = self:_close(key)
  if entry.pieces[0] then -- without the beginning nobody can tell whose it was
    entry.limit = limit
    tell(self.given_up, entry)
  end
end

return M
