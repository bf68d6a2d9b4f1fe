-- Frames that wait for their analysis, in little room: a capture may have millions of them.
--
-- Of a frame whose form is known (forms.lua) only what the form leaves open is kept: IP identification, the
-- sequence numbers of call and record, and the data of the record. Frames of one form have data of one
-- length, so many of them stand in one string without anything between. So do their numbers: a collector
-- looks through arrays again and again, but not into strings. It visits each string, though: so many of them
-- become one.

local byte, char, format, rep, sub = string.byte, string.char, string.format, string.rep, string.sub
local concat, floor = table.concat, math.floor
local unpack = table.unpack or unpack -- luacheck: ignore
local pack_string, unpack_string = rawget(string, "pack"), rawget(string, "unpack")
local Struct = Struct -- luacheck: ignore (Wireshark's; for Lua 5.2, which packs nothing itself)

local M = {}

-- Of each frame: its form, its number, its time, the sequence number of its call, and its IP identification
-- with the sequence number of its record: whole numbers.
local NUMBERS = 5
local TOGETHER = 128 -- frames that are put away together
local FULL = TOGETHER * NUMBERS
local EACH = 5 -- what is kept of a frame until then
local MERGED = 32 -- strings of which one is made
-- Places in a frame, from 1, as distances from the beginning of its IP header, from 0.
local IP_ID, RECORD_SEQUENCE = 5, 135

local function from_digits(_, numbers, at)
  local found = {}
  for each = 1, NUMBERS do
    found[each] = tonumber(sub(numbers, at + (each - 1) * 20, at + each * 20 - 1))
  end
  return unpack(found)
end

-- Functions that make one string of many numbers, and take some from it; the format of a number, and its
-- length. Lua 5.2 packs nothing; Wireshark does it there, and without Wireshark they are digits.
local pack, unpacked, number_format, size = format, from_digits, "%20.0f", 20
if pack_string then
  pack, unpacked, number_format, size = pack_string, unpack_string, "j", 8
elseif Struct then
  pack, unpacked, number_format, size = Struct.pack, Struct.unpack, "d", 8
end
local ONE, ALL = rep(number_format, NUMBERS), rep(number_format, FULL)

local Waiting = {}
Waiting.__index = Waiting

--- An empty list.
function M.new()
  return setmetatable({
    forms = {}, known = {}, -- forms by their number, and their numbers
    numbers = {}, data = {}, put = 0, merged = 0, -- of the frames that were put away; how many are merged
    bytes = 0, -- in these strings
    last = {}, filled = 0, -- of the frames behind them: form, number, time, sequence number, bytes
  }, Waiting)
end

-- The number of a form in this list.
local function number_of(self, form)
  local number = self.known[form]
  if number == nil then
    number = #self.forms + 1
    self.forms[number], self.known[form] = form, number
  end
  return number
end

local function merge(strings, first, last)
  strings[first] = concat(strings, "", first, last)
  for place = first + 1, last do
    strings[place] = nil
  end
end

local function keep(self, numbers, data)
  local place = self.put + 1
  self.put, self.numbers[place], self.data[place] = place, numbers, data
  self.bytes = self.bytes + #numbers + #data
  if place == self.merged + MERGED then
    local first = self.merged + 1
    self.merged, self.put = first, first
    merge(self.numbers, first, place)
    merge(self.data, first, place)
  end
end

local packed, pieces = {}, {} -- what is put away now; the same arrays each time

-- Puts the last frames away, many at once: what is kept of them becomes two strings.
local function put_away(self)
  local last, at, piece = self.last, 0, 0
  for each = 1, self.filled, EACH do
    local form, frame = last[each], last[each + 4]
    local offset = form.offset
    local a, b = byte(frame, offset + IP_ID, offset + IP_ID + 1)
    local c, d = byte(frame, offset + RECORD_SEQUENCE, offset + RECORD_SEQUENCE + 1)
    packed[at + 1], packed[at + 2] = number_of(self, form), last[each + 1]
    packed[at + 3], packed[at + 4] = last[each + 2], last[each + 3]
    packed[at + 5] = ((a * 256 + b) * 256 + c) * 256 + d
    at = at + NUMBERS
    if form.data > 0 then
      piece = piece + 1
      pieces[piece] = sub(frame, form.front + 1, form.stop)
    end
  end
  local all = at == FULL and ALL or rep(number_format, at)
  self.filled = 0
  keep(self, pack(all, unpack(packed, 1, at)), concat(pieces, "", 1, piece))
end

--- Adds a frame.
-- @param form    as in forms.lua, with {source, destination, source_mac}
-- @param number, time_ns  of the frame
-- @param seq     sequence number of its call
-- @param frame   its bytes
function Waiting:add(form, number, time_ns, seq, frame)
  local last, filled = self.last, self.filled
  last[filled + 1], last[filled + 2], last[filled + 3] = form, number, time_ns
  last[filled + 4], last[filled + 5] = seq, frame
  filled = filled + EACH
  self.filled = filled
  if filled == EACH * TOGETHER then
    put_away(self)
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

local function hand_over(self, analysis, numbers, data)
  local at = 1
  for place = 1, #numbers, NUMBERS * size do
    local known, number, time_ns, seq, others = unpacked(ONE, numbers, place)
    local form = self.forms[known]
    analysis:packet(restored(form, number, time_ns, seq, others, sub(data, at, at + form.data - 1)))
    at = at + form.data
  end
end

--- Gives the frames to an analysis in their order; the list is to be thrown away then.
function Waiting:hand_over(analysis)
  if self.filled > 0 then
    put_away(self)
  end
  for place = 1, self.put do
    hand_over(self, analysis, self.numbers[place], self.data[place])
  end
end

return M
