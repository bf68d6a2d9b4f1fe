-- Frames that wait for their analysis, in little room: a capture may have millions of them.
--
-- Of a frame whose form is known (glance.lua) only what the form leaves open is kept: IP identification, the
-- sequence numbers of call and record, and the data of the record. Frames of one form have data of one
-- length, so many of them stand in one string without anything between.

local char, concat, floor, sub = string.char, table.concat, math.floor, string.sub

local M = {}

local TOGETHER = 256 -- frames whose data stand in one string

local Waiting = {}
Waiting.__index = Waiting

--- An empty list.
function M.new()
  return setmetatable({
    count = 0, forms = {}, numbers = {}, times = {}, calls = {}, others = {},
    data = {}, pieces = {}, piece = 0,
  }, Waiting)
end

--- Adds a frame.
-- @param form    {identity, call, record, data (its length), little, source, destination, source_mac}
-- @param number, time_ns  of the frame
-- @param seq     sequence number of the call
-- @param others  IP identification * 65536 + sequence number of the record
-- @param data    of the record; nil where the form has none
function Waiting:add(form, number, time_ns, seq, others, data)
  local count = self.count + 1
  self.count = count
  self.forms[count], self.numbers[count], self.times[count] = form, number, time_ns
  self.calls[count], self.others[count] = seq, others
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
local function restored(self, place, data)
  local form, others = self.forms[place], self.others[place]
  local record = others % 65536
  packet.payload = form.identity .. sequence(self.calls[place], form.little) .. form.call
    .. char(floor(record / 256), record % 256) .. form.record .. data
  packet.frame, packet.time_ns = self.numbers[place], self.times[place]
  packet.ip_id = floor(others / 65536)
  packet.src_ip, packet.dst_ip, packet.src_mac = form.source, form.destination, form.source_mac
  return packet
end

--- Gives the frames to an analysis in their order; the list is to be thrown away then.
function Waiting:hand_over(analysis)
  local data, at = nil, 1
  for place = 1, self.count do
    if (place - 1) % TOGETHER == 0 then
      local together = self.data[floor((place - 1) / TOGETHER) + 1]
      data, at = together or concat(self.pieces, "", 1, self.piece), 1
    end
    local length = self.forms[place].data
    analysis:packet(restored(self, place, sub(data, at, at + length - 1)))
    at = at + length
  end
end

return M
