-- TCP segments to the bytes of each direction, in their order (docs/s7.md 2).
--
-- Copies and retransmissions are left out, and what comes too early waits, within bounds. What is lost is
-- known as such when the other side has acknowledged it and more is there: nobody will send it again. What
-- those bytes are is in tpkt.lua. Fragments of IP are not put together: TCP of a PLC has none.

local bit = require("ds47.support.bits").bit
local ordered = require("ds47.support.ordered")
local reader = require("ds47.support.bytes")

local floor, max, min = math.floor, math.max, math.min
local insert, remove = table.insert, table.remove
local sub = string.sub
local u16, u32 = reader.u16, reader.u32

local M = {FIN = 0, SYN = 1, RST = 2, ACK = 4} -- numbers of bits

local WINDOW = 0x10000 -- bytes of a direction that may wait, and how far before the first one some may come
local MOST_WAITING = 256 -- segments of a direction that may wait
local HOLES = 8 -- lost ranges of a direction that are remembered: late bytes belong there
local JUMP = 0x1000000 -- so far away are the sequence numbers of another connection
local OVERHEAD = 128
local HEADER = 20
local HALF, WHOLE = 0x80000000, 0x100000000

--- The segment in the payload of an IP packet.
-- @param source, destination  IP addresses as text
-- @param missing  bytes of the payload that the capture does not have
-- @return {source, destination, sequence, acknowledge, flags, data, length}, ends as {ip, port}; `length`
-- counts the bytes that were sent, of which the capture may lack the last ones. Nil where it is no segment
function M.parse(source, destination, payload, missing)
  if #payload < HEADER then return nil end
  local offset, flags = payload:byte(13, 14)
  local begin = floor(offset / 0x10) * 4
  if begin < HEADER or begin > #payload + missing then return nil end
  return {
    source = {ip = source, port = u16(payload, 0)}, destination = {ip = destination, port = u16(payload, 2)},
    sequence = u32(payload, 4), acknowledge = u32(payload, 8), flags = flags, data = sub(payload, begin + 1),
    length = max(0, #payload + missing - begin),
  }
end

--- How far a sequence number is behind another one; negative where it is before it.
function M.distance(one, other)
  return (one - other + HALF) % WHOLE - HALF
end

local distance = M.distance

-- What one end sends; places are bytes from the first one that was seen:
--   first    sequence number of the first byte; nil before it was seen
--   next     that of the byte which comes next,
--   place    and its place
--   fin      sequence number of the end
--   waiting  what came too early, in order: array of {place, data, at}
--   held     bytes that this takes
--   holes    places of what was lost: array of {from, up to}
-- Pieces are bytes in order: {data, at, lost, late}. `lost` are those that are missing before it, nil for
-- none; a `late` piece belongs in such a place. Who feeds gives an array for them.
local Direction = {}
Direction.__index = Direction
M.Direction = Direction

function Direction.new()
  return setmetatable({next = 0, place = 0, waiting = {}, held = 0, holes = {}}, Direction)
end

--- The first byte has this number; `seen`: the beginning of the connection is in the capture.
function Direction:begin(sequence, seen)
  self.first, self.next = sequence, sequence
  if not seen then insert(self.holes, {-WINDOW, 0}) end
end

local function pass(self, count)
  self.next = (self.next + count) % WHOLE
  self.place = self.place + count
end

local function wait(self, begin, data, at)
  local waiting = self.waiting
  local index = #waiting
  while index > 0 and waiting[index].place > begin do index = index - 1 end
  local before = waiting[index]
  if not before or before.place ~= begin or #before.data < #data then
    insert(waiting, index + 1, {place = begin, data = data, at = at})
    self.held = self.held + #data + OVERHEAD
  end
end

-- What waited and is in order now; before the first of it so many bytes are missing.
local function drain(self, lost, pieces)
  local waiting = self.waiting
  while waiting[1] and waiting[1].place <= self.place do
    local part = remove(waiting, 1)
    self.held = self.held - #part.data - OVERHEAD
    local fresh = sub(part.data, self.place - part.place + 1)
    if fresh ~= "" then
      pass(self, #fresh)
      pieces[#pieces + 1] = {data = fresh, at = part.at, lost = lost}
      lost = nil
    end
  end
end

-- What was lost comes after all: once.
local function late(self, begin, data, at, pieces)
  for number, hole in ipairs(self.holes) do
    local left, right = hole[1], hole[2]
    local first, last = max(begin, left), min(begin + #data, right)
    if first < last then
      remove(self.holes, number)
      if last < right then insert(self.holes, number, {last, right}) end
      if left < first then insert(self.holes, number, {left, first}) end
      pieces[#pieces + 1] = {data = sub(data, first - begin + 1, last - begin), at = at, late = true}
      return
    end
  end
end

--- Bytes of a segment; adds to `pieces` what is in order now.
function Direction:feed(sequence, data, at, pieces)
  local early = distance(sequence, self.next)
  if early < 0 then
    late(self, self.place + early, data, at, pieces)
    data, early = sub(data, 1 - early), 0
  end
  if data == "" then return end
  if early > 0 then
    wait(self, self.place + early, data, at)
    if self.held > WINDOW or #self.waiting > MOST_WAITING then self:give_up(pieces) end
    return
  end
  pass(self, #data)
  pieces[#pieces + 1] = {data = data, at = at}
  drain(self, nil, pieces)
end

--- The other side has everything before this number: what is missing there will not come any more.
function Direction:acknowledged(number, pieces)
  while self.waiting[1] and distance(number, self.next) > 0 do self:give_up(pieces) end
end

--- What is missing before the first bytes that wait is lost.
function Direction:give_up(pieces)
  if not self.waiting[1] then return end
  local have, begin = self.place, self.waiting[1].place
  if #self.holes >= HOLES then remove(self.holes, 1) end
  insert(self.holes, {have, begin})
  pass(self, begin - have)
  drain(self, begin - have, pieces)
end

-- A TCP connection:
--   client, server     ends
--   begun              whether its SYN was seen
--   forward, backward  what each sends
--   over, reset        nothing of it counts any more; whether by RST
--   owner, kept        whatever the listener keeps of it, and how many bytes that is, as he says
local Talk = {}
Talk.__index = Talk

local function new_talk(client, server, begun)
  return setmetatable({
    client = client, server = server, begun = begun, forward = Direction.new(), backward = Direction.new(),
    over = false, reset = false, kept = 0,
  }, Talk)
end

--- Bytes that it takes.
function Talk:held()
  return self.forward.held + self.backward.held + self.kept
end

--- What one end sends.
function Talk:of(from_client)
  return from_client and self.forward or self.backward
end

local Streams = {}
Streams.__index = Streams
M.Streams = Streams

--- All connections of the ports that are wanted.
-- @param ports  of servers, a set
-- @param listener  is given each piece, and told of a connection that is over, and whether by a RST of the
--   server: listener:take(talk, from_client, piece), listener:talk_over(talk, reset, at)
-- @param most  how many connections are followed at once; of more, the one that was silent for longest is
--   over
-- @param most_bytes  how many bytes of all of them may wait
function Streams.new(ports, listener, most, most_bytes)
  return setmetatable({
    ports = ports, listener = listener, most = most, most_bytes = most_bytes, talks = ordered.new(), held = 0,
    now = {frame = 0, time_ns = 0},
  }, Streams)
end

local function is(one, other)
  return one.port == other.port and one.ip == other.ip
end

local function has(segment, flag)
  return bit(segment.flags, flag) == 1
end

local function hand_on(self, talk, from_client, pieces)
  for _, piece in ipairs(pieces) do self.listener:take(talk, from_client, piece) end
end

local function close(self, talk, reset, by_server)
  if talk.over then return end
  for _, from_client in ipairs({true, false}) do
    local own = talk:of(from_client)
    while own.waiting[1] do
      local pieces = {}
      own:give_up(pieces)
      hand_on(self, talk, from_client, pieces)
    end
  end
  talk.over, talk.reset = true, reset
  self.listener:talk_over(talk, by_server or false, self.now)
end

local function begin(self, segment)
  local source, destination, syn = segment.source, segment.destination, has(segment, M.SYN)
  local answers, ports = syn and has(segment, M.ACK), self.ports
  if ports[destination.port] and not (answers and ports[source.port]) then
    return new_talk(source, destination, syn)
  end
  return new_talk(destination, source, syn)
end

-- Whether a segment of the same two ends belongs to another connection than the one before.
local function is_new(talk, segment)
  local own = talk:of(is(segment.source, talk.client))
  if has(segment, M.RST) then return false end
  if has(segment, M.SYN) then
    if talk.reset and not has(segment, M.ACK) then return true end -- tried again, with the same number
    return own.first ~= nil and own.first ~= (segment.sequence + 1) % WHOLE
  end
  local off = distance(segment.sequence, own.next)
  return own.first ~= nil and segment.data ~= "" and (off > JUMP or off < -JUMP)
end

local function key_of(segment)
  local source, destination = segment.source, segment.destination
  local one, other = source.ip .. " " .. source.port, destination.ip .. " " .. destination.port
  return one < other and one .. " " .. other or other .. " " .. one
end

-- The connection of a segment: the one of these ends, or a new one.
local function talk_of(self, segment)
  local key = key_of(segment)
  local talk = self.talks:get(key)
  if talk and is_new(talk, segment) then
    self.held = self.held - talk:held()
    close(self, talk, false)
    talk = nil
  end
  if not talk then
    talk = begin(self, segment)
    self.talks:set(key, talk)
  end
  self.talks:move_to_end(key)
  return talk
end

-- Whether one end has sent its FIN, and everything before it is there.
local function has_ended(way)
  return way.fin ~= nil and (way.first == nil or distance(way.fin, way.next) <= 0)
end

-- The first byte of a direction, where this segment tells; the number of its own first byte.
local function begin_direction(talk, own, segment)
  local sequence = segment.sequence
  if has(segment, M.SYN) then
    sequence = (sequence + 1) % WHOLE
    if own.first == nil then
      own:begin(sequence, true)
    elseif own.first == sequence then
      for number = #own.holes, 1, -1 do
        if own.holes[number][1] < 0 then remove(own.holes, number) end
      end
    end
  elseif own.first == nil and segment.data ~= "" then
    own:begin(sequence, talk.begun)
  end
  return sequence
end

local function take_segment(self, talk, from_client, segment, at)
  local own, other = talk:of(from_client), talk:of(not from_client)
  local sequence = begin_direction(talk, own, segment)
  if has(segment, M.ACK) and other.waiting[1] then
    local pieces = {}
    other:acknowledged(segment.acknowledge, pieces)
    hand_on(self, talk, not from_client, pieces)
  end
  if segment.data ~= "" then
    local pieces = {}
    own:feed(sequence, segment.data, at, pieces)
    hand_on(self, talk, from_client, pieces)
  end
  if has(segment, M.FIN) then own.fin = (sequence + segment.length) % WHOLE end
  if has_ended(own) and has_ended(other) then close(self, talk, false) end
end

local function bound(self)
  while self.talks.length > self.most or self.held > self.most_bytes do
    local _, talk = self.talks:pop_first()
    self.held = self.held - talk:held()
    close(self, talk, false)
  end
end

--- The next segment of the capture.
function Streams:feed(segment, at)
  if not self.ports[segment.source.port] and not self.ports[segment.destination.port] then return end
  self.now = at
  local talk = talk_of(self, segment)
  local before = talk:held()
  if has(segment, M.RST) then
    close(self, talk, true, not is(segment.source, talk.client))
  elseif not talk.over then
    take_segment(self, talk, is(segment.source, talk.client), segment, at)
  end
  self.held = self.held + talk:held() - before
  bound(self)
end

--- Nothing more comes.
function Streams:finish()
  for _, talk in self.talks:iterate() do close(self, talk, false) end
  self.talks = ordered.new()
end

return M
