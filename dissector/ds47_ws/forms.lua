-- How the frames of a conversation are built: the bytes by which a usual frame is known again.
--
-- A *form* is what is known of frames that are alike in all but what counts: what glance.lua puts there, and
--   identity, call, record  bytes in front of the sequence number of the call; from there to that of the
--                           record; and behind that one
--   offset, front, stop     where the IP header begins, how many bytes stand in front of the record's data,
--                           and where that ends
--   data                    its length
--   little                  whether the RPC header is little-endian
-- Not here: what such a frame says, and whether its turn has come (glance.lua).

local reader = require("ds47.reader")
local records = require("ds47.records")
local rpc = require("ds47.rpc")

local byte, find, sub = string.byte, string.find, string.sub
local u16, le16, u32, le32 = reader.u16, reader.le16, reader.u32, reader.le32
local unpack = table.unpack or unpack -- luacheck: ignore

local M = {}

-- 1-based places in a frame, as distances from the 0-based beginning of its IP header of 20 bytes. Between
-- the parts that are compared stand those that count or are sums: IP identification and checksum, UDP
-- checksum, the sequence numbers of call and record.
local IP_LENGTH, IP_END, FRAGMENT, FRAGMENT_END = 3, 4, 7, 10
local ADDRESSES, UDP_LENGTH, ADDRESSES_END = 13, 25, 26
local RPC, PTYPE, RPC_END, SEQUENCE, CALL, RPC_LENGTH = 29, 30, 92, 93, 97, 103
local NDR, BLOCK, CALL_END = 109, 129, 134
local BLOCK_COUNT, RECORD, RECORD_LENGTH, RECORD_END = 135, 137, 165, 192
local HEADERS = RECORD_END -- bytes from there to the data of the record
local IP_HEADER, UDP_HEADER = 20, 8
local VERSION, RESPONSE = 4, 2 -- of RPC, and the type of its message

--- Bytes of the NDR header and of the record block: what a body has in front of the data of its record.
M.BODY = 20 + records.BLOCK_LENGTH

-- What is looked for stands in an array, the shape of a form, so that all of it comes at once: parts of the
-- frame, each with its place; the next shape that begins alike, or false; the form.
local SHAPE, AFTER = 12, 11
-- Shapes of one beginning: Write responses, which are of one length, tell how long their requests were.
local MOST_ALIKE = 16

local Forms = {}
Forms.__index = Forms

--- No forms yet.
-- @param most how many there may be: beyond that none is made of another one
function M.new(most)
  return setmetatable({
    shapes = {}, -- by the bytes up to the IP length
    families = {}, -- a form each, by what frames of all lengths have in common
    count = 0, -- of both together
    most = most,
  }, Forms)
end

--- The sequence number of the call in a frame of this form.
function M.sequence(form, frame)
  local read = form.little and le32 or u32
  return read(frame, form.offset + SEQUENCE - 1)
end

-- Where the IP packet of a frame ends (0-based, exclusive), if an RPC message with a body of so many bytes
-- fills it, and a record block is in there; or nil.
local function end_with(body, frame, offset)
  local length = UDP_HEADER + rpc.HEADER_LENGTH + body
  local total = IP_HEADER + length
  if u16(frame, offset + IP_LENGTH - 1) ~= total or u16(frame, offset + UDP_LENGTH - 1) ~= length
    or #frame < offset + total or total < HEADERS then
    return nil
  end
  return offset + total
end

--- Where the IP packet of a frame ends (0-based, exclusive), if the RPC message fills it as usual; or nil.
-- @param offset where its IP header begins, from 0
function M.end_of(pdu, frame, offset)
  return byte(frame, offset + 1) == 0x45 and end_with(#pdu.body, frame, offset) or nil
end

-- Finding

-- All of a frame that does not depend on how much data its record has, but for what counts. Of the NDR header
-- nobody reads more than the status of a response.
local function family_of(frame, offset)
  local status = byte(frame, offset + PTYPE) == RESPONSE and sub(frame, offset + NDR, offset + NDR + 3) or ""
  return offset .. status .. sub(frame, 1, offset + IP_LENGTH - 1)
    .. sub(frame, offset + FRAGMENT, offset + FRAGMENT_END)
    .. sub(frame, offset + ADDRESSES, offset + UDP_LENGTH - 1) .. sub(frame, offset + RPC, offset + RPC_END)
    .. sub(frame, offset + CALL, offset + RPC_LENGTH - 1)
    .. sub(frame, offset + RPC_LENGTH + 2, offset + NDR - 1)
    .. sub(frame, offset + BLOCK, offset + BLOCK_COUNT - 1)
    .. sub(frame, offset + RECORD, offset + RECORD_LENGTH - 1)
    .. sub(frame, offset + RECORD_LENGTH + 4, offset + RECORD_END)
end

-- Where a frame ends that is as long as all its headers say, and whose record has data, or none, as that of
-- the form; or nil.
local function end_like(form, frame, offset)
  local read = form.little and le16 or u16
  local stop = end_with(read(frame, offset + RPC_LENGTH - 1), frame, offset)
  local data = stop and stop - offset - HEADERS
  if form.data > 0 then
    return stop and data > 0 and u32(frame, offset + RECORD_LENGTH - 1) == data and stop or nil
  end
  return data == 0 and stop or nil
end

-- Frames of one conversation and role differ in their lengths. One of a new length need not be analysed for
-- that alone: its form is that of another one, with lengths of its own.
function Forms:_of_another_length(frame, offset)
  if #frame < offset + HEADERS or byte(frame, offset + RPC) ~= VERSION or self.count > self.most then
    return nil
  end
  local known = self.families[family_of(frame, offset)]
  local stop = known and end_like(known, frame, offset)
  if not stop then
    return nil
  end
  local form = {}
  for key, value in pairs(known) do
    form[key] = value
  end
  self:_keep(form, frame, offset, stop)
  return form
end

--- The form of a frame; nil where none is known.
-- @param offset where its IP header begins, from 0
function Forms:find(frame, offset)
  local shape = self.shapes[sub(frame, 1, offset + IP_END)]
  while shape do
    -- Looks for each part in its place: cutting it out would leave a string behind for every frame.
    local record, record_at, identity, identity_at, call, call_at, addresses, addresses_at, fragment,
      fragment_at, after, form = unpack(shape, 1, SHAPE)
    if find(frame, record, record_at, true) == record_at
      and find(frame, identity, identity_at, true) == identity_at
      and find(frame, call, call_at, true) == call_at
      and find(frame, addresses, addresses_at, true) == addresses_at
      and find(frame, fragment, fragment_at, true) == fragment_at
      and #frame >= form.stop then
      return form
    end
    shape = after
  end
  return self:_of_another_length(frame, offset)
end

-- Adding

-- Whether two shapes that begin alike are the same.
local function same(one, other)
  for part = 1, AFTER - 2, 2 do
    if one[part] ~= other[part] then
      return false
    end
  end
  return true
end

-- Keeps a form with the bytes that its frame has, which ends at `stop`. Shapes that begin alike stand in a
-- chain; the newest comes first.
function Forms:_keep(form, frame, offset, stop)
  form.offset, form.front, form.stop = offset, offset + HEADERS, stop
  form.data = stop - form.front
  form.identity = sub(frame, offset + RPC, offset + RPC_END)
  form.call = sub(frame, offset + CALL, offset + CALL_END)
  form.record = sub(frame, offset + RECORD, offset + RECORD_END)
  local front = sub(frame, 1, offset + IP_END)
  local shape = {
    form.record, offset + RECORD, form.identity, offset + RPC, form.call, offset + CALL,
    sub(frame, offset + ADDRESSES, offset + ADDRESSES_END), offset + ADDRESSES,
    sub(frame, offset + FRAGMENT, offset + FRAGMENT_END), offset + FRAGMENT,
    self.shapes[front] or false, form,
  }
  local last, count = shape, 1
  while last[AFTER] do
    local after = last[AFTER]
    if count >= MOST_ALIKE or same(shape, after) then
      last[AFTER], self.count = after[AFTER], self.count - 1
    else
      last, count = after, count + 1
    end
  end
  self.shapes[front], self.count = shape, self.count + 1
end

--- Adds a form.
-- @param form    a table with `little` and what the caller wants to find in it again
-- @param frame, offset  a frame that has it
-- @param stop    where its IP packet ends (`end_of`)
function Forms:add(form, frame, offset, stop)
  self:_keep(form, frame, offset, stop)
  self.families[family_of(frame, offset)], self.count = form, self.count + 1
end

return M
