-- Cyclic frames to PKW transactions: which bytes of which frame are a channel, and what changed in them.
-- What a change of the bytes means is the business of handshake.lua.
--
-- Relations come from Connects; a later Connect of the same stations replaces what an earlier one said.
-- Transactions are handed out when a relation is proven: a request and the response that followed it were
-- seen.
--
-- A line is one relation at work, an end one direction of it: {line, side, sent (by the controller), words
-- and valid (what was there last)}. Ends are found by the bytes that all their frames begin with: a frame
-- costs one look-up, a comparison of ten bytes where it is watched, and no more as long as nothing changes
-- in it.

local connect = require("ds47.profinet.connect")
local handshake = require("ds47.cyclic.handshake")
local relations = require("ds47.cyclic.relations")
local rpc = require("ds47.profinet.rpc")

local byte, char, floor, max, sub = string.byte, string.char, math.floor, math.max, string.sub
local concat, find, gsub, rep = table.concat, string.find, string.gsub, string.rep

local M = {}

local ETHERTYPE, TAG = "\x88\x92", "\x81\x00"
local DCP = 0xFE -- first byte of frame ids that are not cyclic
local KEPT = 256 -- transactions that wait for the proof

local Channels = {}
Channels.__index = Channels

--- All parameter channels of a capture.
-- @param listener listener:exchanged(relation, job) is told of each transaction of a proven relation when
--   it is over
-- @param most relations that are kept
function M.new(listener, most)
  return setmetatable({
    listener = listener, most = most, lines = {},
    rows = {}, -- source, EtherType and frame id -> {ends, need = length of data, standing, at = of `is_news`}
    any = false, -- whether there are rows
    relations = {}, -- all that there were, those that a later Connect replaced too
    candidates = 0, -- how many, of process data too
    moved = {}, -- ends in which the last frame changed something
  }, Channels)
end

-- Relations

-- A transaction is over; it waits until one of them proves the relation. Not a closure: an analysis is
-- copied.
local function over(job, line)
  local relation, waiting = line.relation, line.waiting
  local responded = job.state == "ok" or job.state == "error"
  if responded and job.began and not job.settled then -- with an edge of its own
    relation.certainty = relations.SEEN
  end
  if #waiting < KEPT then
    waiting[#waiting + 1] = job
  end
  if relation.certainty == relations.SEEN then
    line.waiting = {}
    for _, each in ipairs(waiting) do
      line.owner.listener:exchanged(relation, each)
    end
  end
end

local function add(self, relation)
  self.relations[#self.relations + 1] = relation
  local line = {relation = relation, owner = self, waiting = {}}
  line.channel = handshake.new(over, line)
  line.ends = {
    {line = line, side = relation.output, sent = true}, {line = line, side = relation.input, sent = false},
  }
  self.lines[#self.lines + 1] = line
end

-- The stations set up all their channels anew, in this frame.
local function replace(self, controller, device, frame)
  local left = {}
  for _, line in ipairs(self.lines) do
    if line.relation.output.source == controller and line.relation.input.source == device then
      line.channel:finish()
      line.relation.replaced = frame
    else
      left[#left + 1] = line
    end
  end
  self.lines = left
end

local function watch(self)
  self.rows, self.any, self.moved = {}, false, {}
  for _, line in ipairs(self.lines) do
    for _, each in ipairs(line.ends) do
      local side = each.side
      local id = side.frame_id
      if floor(id / 256) ~= DCP then
        local key = side.source .. ETHERTYPE .. char(floor(id / 256), id % 256)
        local row = self.rows[key] or {need = 0}
        self.rows[key], self.any, row[#row + 1] = row, true, each
        row.need = max(row.need, side.offset + side.length, (side.iops or 0) + 1, side.status + 1)
      end
    end
  end
end

--- A Connect and its response; nothing happens where it was refused, or sets up no such channel.
function Channels:connected(request, response)
  local asked = connect.parse_request(request)
  local ar, device_mac, frame_ids = connect.parse_response(response)
  if not asked or ar ~= asked.ar then return end
  connect.answered(asked, frame_ids)
  replace(self, asked.controller_mac, device_mac, response.frame)
  local vendor_id = rpc.device_identity(response.object_uuid)
  for _, found in ipairs(relations.channels(asked)) do
    if self.candidates >= self.most then break end
    self.candidates = self.candidates + 1
    local item = found.submodule
    if found.channel == relations.PKW then
      add(self, {
        channel = found.channel, controller = request.client, device = request.server,
        vendor_id = vendor_id, ar = ar, api = item.api, slot = item.slot, subslot = item.subslot,
        telegrams = found.telegrams,
        output = relations.side(item.output, asked.controller_mac),
        input = relations.side(item.input, device_mac),
        frame = response.frame, certainty = relations.LENGTHS,
      })
    end
  end
  watch(self)
end

-- Frames

--- The row of an Ethernet frame and where its data begins, behind the frame id; nil of one that is not
-- watched. At most one VLAN tag: cyclic frames have no more.
function Channels:row_of(frame)
  local row = self.rows[sub(frame, 7, 16)]
  if row then return row, 16 end
  if sub(frame, 13, 14) == TAG then
    row = self.rows[sub(frame, 7, 12) .. sub(frame, 17, 20)]
    if row then return row, 20 end
  end
  return nil
end

-- What an end says in this frame: its words, and whether they are valid.
local function said(each, frame, at)
  local side = each.side
  local first = at + side.offset
  local valid = floor(byte(frame, at + side.status + 1) / 4) % 2 == 1
    and (not side.iops or byte(frame, at + side.iops + 1) >= 0x80)
  return sub(frame, first + 1, first + side.length), valid
end

-- What a frame looks like in which nothing changed, as a pattern: one call tells nearly all frames apart. Nil
-- where two channels share bytes.
local function pattern_of(row, frame, at)
  local parts, stop, places = {"^"}, 0, {}
  for _, each in ipairs(row) do
    local side = each.side
    places[#places + 1] = {at + side.offset, side.length}
    places[#places + 1] = {at + side.status, 1}
    if side.iops then places[#places + 1] = {at + side.iops, 1} end
  end
  table.sort(places, function(a, b) return a[1] < b[1] end)
  for number, place in ipairs(places) do
    local same = number > 1 and place[1] == places[number - 1][1] and place[2] == 1
    if not same then
      if place[1] < stop then return nil end
      local bytes = sub(frame, place[1] + 1, place[1] + place[2])
      parts[#parts + 1] = rep(".", place[1] - stop) .. gsub(bytes, "%W", "%%%0")
      stop = place[1] + place[2]
    end
  end
  return concat(parts)
end

--- Whether a watched frame says something else than the one before it; one that the capture cut says nothing.
function Channels:is_news(row, frame, at)
  if row.at == at and find(frame, row.standing) then return false end
  if #frame < at + row.need then return false end
  for number = 1, #row do
    local each = row[number]
    local words, valid = said(each, frame, at)
    if words ~= each.words or valid ~= each.valid then return true end
  end
  return false
end

-- Half of an even number goes down, as Python rounds.
local function rounded(number)
  local whole = floor(number)
  local rest = number - whole
  if rest > 0.5 or rest == 0.5 and whole % 2 == 1 then return whole + 1 end
  return whole
end

local function take(each, moment, words, valid)
  local channel, was_valid = each.line.channel, each.valid
  each.words, each.valid = words, valid
  if valid and each.sent then
    channel:sent(words, moment)
  elseif valid then
    channel:answered(words, moment)
  elseif was_valid then
    channel:lost(moment, each.sent and "out" or "in")
  end
end

--- Takes a watched frame that says something else than the one before it (`is_news`).
-- @param row, at as `row_of` gives them
-- @param number, time  of the frame; a time as times.lua has it
function Channels:frame(row, frame, at, number, time)
  self.moved = {}
  for place = 1, #row do
    local each = row[place]
    local words, valid = said(each, frame, at)
    if words ~= each.words or valid ~= each.valid then
      local line = each.line
      line.start = line.start or time
      local cycle = rounded((time - line.start) / max(each.side.cycle_ns, 1))
      take(each, {frame = number, time = time, cycle = cycle}, words, valid)
      self.moved[#self.moved + 1] = each
    end
  end
  row.standing = pattern_of(row, frame, at)
  row.at = row.standing and at
end

-- Whether a relation is proven, or will be by this request.
local function is_proven(line, job)
  return line.relation.certainty == relations.SEEN or (job.answer and job.began and not job.settled)
end

--- What the last frame began or responded to, as far as it is proven: array of {relation, job, role}, a role
-- being "write_request" or "read_response".
-- @param number of the frame
function Channels:touched(number)
  local found = {}
  for _, each in ipairs(self.moved) do
    local job = each.line.channel:open_job()
    if job and is_proven(each.line, job) then
      local sight = job.answer
      if each.sent then sight = job.request end
      if sight and sight.at.frame == number then
        local role = each.sent and "write_request" or "read_response"
        found[#found + 1] = {relation = each.line.relation, job = job, role = role}
      end
    end
  end
  return found
end

--- The ends of relations whose words are in a frame: array of {relation, side, sent}. Those that a later
-- Connect replaced count for the frames before it.
-- @param source, frame_id  of the frame: MAC address and number
function Channels:ends_in(number, source, frame_id)
  local found = {}
  for _, relation in ipairs(self.relations) do
    if relation.frame < number and (relation.replaced == nil or number <= relation.replaced) then
      for _, way in ipairs({"output", "input"}) do
        local side = relation[way]
        if side.source == source and side.frame_id == frame_id then
          found[#found + 1] = {relation = relation, side = side, sent = way == "output"}
        end
      end
    end
  end
  return found
end

--- The capture ends.
function Channels:finish()
  for _, line in ipairs(self.lines) do
    line.channel:finish()
  end
end

return M
