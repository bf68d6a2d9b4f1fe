-- Frames that wait for their analysis, in little room: a capture may have millions of them.
--
-- Of a frame whose form is known (glance.lua) only what the form leaves open is kept: IP identification, the
-- sequence numbers of call and record, and the data of the record. Frames of one form have data of one
-- length, so many of them stand in one string without anything between. So do their numbers, where something
-- packs them: a collector looks through arrays again and again, but not into strings.

local byte, char, concat, floor, sub = string.byte, string.char, table.concat, math.floor, string.sub
local unpack = table.unpack or unpack -- luacheck: ignore
local Struct = Struct -- luacheck: ignore (Wireshark's; for Lua 5.2, which packs nothing itself)

local M = {}

-- Of each frame: its form, its number, its time, the sequence number of its call, and its IP identification
-- with the sequence number of its record: whole numbers, 8 bytes each.
local NUMBERS, SIZE = 5, 8
local TOGETHER = 128 -- frames that are put away together
local FULL = TOGETHER * NUMBERS
-- Places of the last two, from 1, as distances from the beginning of the IP header, from 0.
local IP_ID, RECORD_SEQUENCE = 5, 135

-- Functions that make one string of many numbers, and take some from it, and the format of a number: those of
-- Lua 5.3 and later, or of Wireshark; Lua 5.2 alone keeps them in an array.
local pack, unpacked, format = rawget(string, "pack"), rawget(string, "unpack"), "j"
if pack == nil and Struct then
  pack, unpacked, format = Struct.pack, Struct.unpack, "d"
elseif pack == nil then
  function pack(_, ...)
    return { ... }
  end
  function unpacked(_, numbers, at)
    local before = (at - 1) / SIZE
    return unpack(numbers, before + 1, before + NUMBERS)
  end
end
local ONE, ALL = string.rep(format, NUMBERS), string.rep(format, FULL)

local Waiting = {}
Waiting.__index = Waiting

--- An empty list.
function M.new()
  return setmetatable({
    forms = {}, known = 0, -- forms by their number
    numbers = {}, data = {}, put = 0, -- of the frames that were put away
    last = {}, filled = 0, -- the numbers of the frames behind them
    pieces = {}, piece = 0, -- and their data
  }, Waiting)
end

-- Puts the last frames away; the arrays in which they were collected are used again.
function Waiting:_put_away()
  local place = self.put + 1
  self.put, self.numbers[place] = place, pack(ALL, unpack(self.last, 1, FULL))
  self.data[place] = concat(self.pieces, "", 1, self.piece)
  self.filled, self.piece = 0, 0
end

-- The number of a form in this list.
function Waiting:_number_of(form)
  if form.list ~= self then
    self.known = self.known + 1
    self.forms[self.known] = form
    form.list, form.place = self, self.known
  end
  return form.place
end

--- Adds a frame.
-- @param form    {identity, call, record, data (its length), little, source, destination, source_mac}; the
--                list notes its own number of it there
-- @param number, time_ns  of the frame
-- @param seq     sequence number of the call
-- @param data    of the record; nil where the form has none
-- @param frame   the bytes of the frame
-- @param offset  where its IP header begins
function Waiting:add(form, number, time_ns, seq, data, frame, offset)
  local last, filled = self.last, self.filled
  local a, b = byte(frame, offset + IP_ID, offset + IP_ID + 1)
  local c, d = byte(frame, offset + RECORD_SEQUENCE, offset + RECORD_SEQUENCE + 1)
  last[filled + 1], last[filled + 2], last[filled + 3] = self:_number_of(form), number, time_ns
  last[filled + 4], last[filled + 5] = seq, ((a * 256 + b) * 256 + c) * 256 + d
  filled = filled + NUMBERS
  self.filled = filled
  if data then
    local piece = self.piece + 1
    self.pieces[piece], self.piece = data, piece
  end
  if filled == FULL then
    self:_put_away()
  end
end

--- Whether no frame waits.
function Waiting:is_empty()
  return self.put == 0 and self.filled == 0
end

local function sequence(seq, little)
  local a, b = floor(seq / 16777216), floor(seq / 65536) % 256
  local c, d = floor(seq / 256) % 256, seq % 256
  if little then
    return char(d, c, b, a)
  end
  return char(a, b, c, d)
end

local packet = {}

-- The packet of a frame, as `Analysis:packet` takes it.
local function restored(form, number, time_ns, seq, others, data)
  local record = others % 65536
  packet.payload = form.identity .. sequence(seq, form.little) .. form.call
    .. char(floor(record / 256), record % 256) .. form.record .. data
  packet.frame, packet.time_ns, packet.ip_id = number, time_ns, floor(others / 65536)
  packet.src_ip, packet.dst_ip, packet.src_mac = form.source, form.destination, form.source_mac
  return packet
end

function Waiting:_hand_over(analysis, count, numbers, data)
  local at = 1
  for place = 0, count - 1 do
    local known, number, time_ns, seq, others = unpacked(ONE, numbers, place * NUMBERS * SIZE + 1)
    local form = self.forms[known]
    analysis:packet(restored(form, number, time_ns, seq, others, sub(data, at, at + form.data - 1)))
    at = at + form.data
  end
end

--- Gives the frames to an analysis in their order; the list is to be thrown away then.
function Waiting:hand_over(analysis)
  for place = 1, self.put do
    self:_hand_over(analysis, TOGETHER, self.numbers[place], self.data[place])
  end
  local numbers = pack(string.rep(format, self.filled), unpack(self.last, 1, self.filled))
  self:_hand_over(analysis, self.filled / NUMBERS, numbers, concat(self.pieces, "", 1, self.piece))
end

return M
