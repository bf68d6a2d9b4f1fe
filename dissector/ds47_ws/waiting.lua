-- Frames that wait for their analysis, in little room: a capture may have millions of them.
--
-- Of a frame whose form is known (glance.lua) only what the form leaves open is kept: IP identification, the
-- sequence numbers of call and record, and the data of the record. Frames of one form have data of one
-- length, so many of them stand in one string without anything between, and their numbers in one array. These
-- are never touched again until they are handed over: a collector need not look through them anew.

local byte, char, concat, floor, sub = string.byte, string.char, table.concat, math.floor, string.sub
local unpack = table.unpack or unpack -- luacheck: ignore

local M = {}

-- Of each frame: its form, its number, its time, the sequence number of its call, and its IP identification
-- with the sequence number of its record.
local NUMBERS = 5
local FULL = 128 * NUMBERS -- when they are put away together
-- Places of the last two, from 1, as distances from the beginning of the IP header, from 0.
local IP_ID, RECORD_SEQUENCE = 5, 135

local Waiting = {}
Waiting.__index = Waiting

--- An empty list.
function M.new()
  return setmetatable({
    numbers = {}, data = {}, put = 0, -- of the frames that were put away: arrays of numbers, strings
    last = {}, filled = 0, -- the numbers of the frames behind them
    pieces = {}, piece = 0, -- and their data
  }, Waiting)
end

-- Puts the last frames away; the arrays in which they were collected are used again.
function Waiting:_put_away()
  local place = self.put + 1
  self.put, self.numbers[place] = place, { unpack(self.last, 1, self.filled) }
  self.data[place] = concat(self.pieces, "", 1, self.piece)
  self.filled, self.piece = 0, 0
end

--- Adds a frame.
-- @param form    {identity, call, record, data (its length), little, source, destination, source_mac}
-- @param number, time_ns  of the frame
-- @param seq     sequence number of the call
-- @param data    of the record; nil where the form has none
-- @param frame   the bytes of the frame
-- @param offset  where its IP header begins
function Waiting:add(form, number, time_ns, seq, data, frame, offset)
  local last, filled = self.last, self.filled
  local a, b = byte(frame, offset + IP_ID, offset + IP_ID + 1)
  local c, d = byte(frame, offset + RECORD_SEQUENCE, offset + RECORD_SEQUENCE + 1)
  last[filled + 1], last[filled + 2], last[filled + 3] = form, number, time_ns
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

local function hand_over(analysis, numbers, filled, data)
  local at = 1
  for first = 1, filled, NUMBERS do
    local form, number, time_ns, seq, others = unpack(numbers, first, first + NUMBERS - 1)
    analysis:packet(restored(form, number, time_ns, seq, others, sub(data, at, at + form.data - 1)))
    at = at + form.data
  end
end

--- Whether no frame waits.
function Waiting:is_empty()
  return self.put == 0 and self.filled == 0
end

--- Gives the frames to an analysis in their order; the list is to be thrown away then.
function Waiting:hand_over(analysis)
  for place, numbers in ipairs(self.numbers) do
    hand_over(analysis, numbers, #numbers, self.data[place])
  end
  hand_over(analysis, self.last, self.filled, concat(self.pieces, "", 1, self.piece))
end

return M
