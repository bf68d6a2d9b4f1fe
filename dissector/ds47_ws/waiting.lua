-- Frames that wait for their analysis, in little room: a capture may have millions of them.
--
-- Of a frame whose form is known (glance.lua) only what the form leaves open is kept: IP identification, the
-- sequence numbers of call and record, and the data of the record. Frames of one form have data of one
-- length, so many of them stand in one string without anything between.

local char, concat, floor, sub = string.char, table.concat, math.floor, string.sub
local unpack = table.unpack or unpack -- luacheck: ignore

local M = {}

local TOGETHER = 256 -- frames whose data stand in one string
local NUMBERS = 5 -- of each frame: form, number, time, sequence number of the call, the other numbers

local Waiting = {}
Waiting.__index = Waiting

--- An empty list.
function M.new()
  return setmetatable({ count = 0, all = {}, last = 0, data = {}, pieces = {}, piece = 0 }, Waiting)
end

--- Adds a frame.
-- @param form    {identity, call, record, data (its length), little, source, destination, source_mac}
-- @param number, time_ns  of the frame
-- @param seq     sequence number of the call
-- @param others  IP identification * 65536 + sequence number of the record
-- @param data    of the record; nil where the form has none
function Waiting:add(form, number, time_ns, seq, others, data)
  local count, all, last = self.count + 1, self.all, self.last
  all[last + 1], all[last + 2], all[last + 3] = form, number, time_ns
  all[last + 4], all[last + 5] = seq, others
  self.count, self.last = count, last + NUMBERS
  if data then
    local piece = self.piece + 1
    self.pieces[piece], self.piece = data, piece
  end
  if count % TOGETHER == 0 then
    self.data[count / TOGETHER] = concat(self.pieces, "", 1, self.piece)
    self.piece = 0
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

--- Gives the frames to an analysis in their order; the list is to be thrown away then.
function Waiting:hand_over(analysis)
  local all, data, at = self.all, nil, 1
  for place = 0, self.count - 1 do
    if place % TOGETHER == 0 then
      data, at = self.data[place / TOGETHER + 1] or concat(self.pieces, "", 1, self.piece), 1
    end
    local first = place * NUMBERS + 1
    local form, number, time_ns, seq, others = unpack(all, first, first + NUMBERS - 1)
    analysis:packet(restored(form, number, time_ns, seq, others, sub(data, at, at + form.data - 1)))
    at = at + form.data
  end
end

return M
