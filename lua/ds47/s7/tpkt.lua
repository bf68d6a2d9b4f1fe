-- TPKT and COTP: bytes in order to TPDUs, and the parts of a PDU put together (docs/s7.md 2).
--
-- `Reader` takes what one end sends, finds its place again behind lost bytes, and gives what COTP carries.
-- What that is, S7 or another protocol, is not known here.

local u16 = require("ds47.support.bytes").u16

local byte, find, sub = string.byte, string.find, string.sub
local floor = math.floor

local M = {VERSION = 3, HEADER = 4, CR = 0xE0, CC = 0xD0, DR = 0x80, DT = 0xF0}

local HEADER = M.HEADER -- bytes of a TPKT header
local CR, CC, DR, DT = M.CR, M.CC, M.DR, M.DT
local KINDS = {}
for _, kind in ipairs({CR, CC, DR, DT, 0xC0, 0x10, 0x20, 0x50, 0x60, 0x70}) do KINDS[kind] = true end
local FIXED = {[CR] = 7, [CC] = 7, [DR] = 7, [DT] = 3} -- bytes of the fixed part, its length byte included
local EOT = 0x80
local SIZE, CALLING, CALLED = 0xC0, 0xC1, 0xC2
local LEAST = 7 -- bytes of the least TPKT that has a TPDU of S7
local LONGEST = 0x10000 -- bytes of a PDU; more is nobody's

local NO_FLAWS = {}

local function flawed(kind, name, offset, args)
  return {kind = kind, data = "", last = true, flaws = {{kind = name, offset = offset, args = args}}}
end

-- The parameters of a TPDU by their codes; of two with one code the last one counts.
local function parameters(data, at, last)
  local found = {}
  while at + 2 <= last do
    local code, length = byte(data, at + 1, at + 2)
    if at + 2 + length > last then break end
    found[code] = sub(data, at + 3, at + 2 + length)
    at = at + 2 + length
  end
  return found
end

--- The TPDU in the payload of a TPKT.
-- @param offset  where that lies in what flaws count from; nil for 0
-- @return {kind (CR, CC, DR, DT, another code, or nil), data (what DT carries), last (whether DT ends a PDU),
-- calling (TSAP of the end that opens the connection), called (that of the other one), size (bytes of a
-- TPDU), reason (of DR), flaws}; what its kind does not have is nil or empty
function M.decode(data, offset)
  offset = offset or 0
  local length, code, third = byte(data, 1, 3)
  if #data < 2 or length + 1 > #data or length < 1 then
    return flawed(nil, "cotp", offset, {length = length and length + 1 or 0, have = #data})
  end
  local last, kind = length + 1, code - code % 0x10
  if not KINDS[kind] then return flawed(nil, "cotp_kind", offset + 1, {code = code}) end
  if last < (FIXED[kind] or 2) then return flawed(kind, "cotp", offset, {length = last, have = last}) end
  local found = {kind = kind, data = sub(data, last + 1), last = true, flaws = NO_FLAWS}
  if kind == DT then
    found.last = third >= EOT
    return found
  end
  if kind == DR then found.reason = byte(data, 7) end
  local told = parameters(data, FIXED[kind] or last, last)
  local size = told[SIZE] and #told[SIZE] == 1 and byte(told[SIZE])
  if size and size >= 7 and size <= 13 then found.size = floor(2 ^ size) end
  found.calling, found.called = told[CALLING], told[CALLED]
  return found
end

--- Whether a TPKT can begin here, as far as bytes are there: TPKT header, then a TPDU that fits into it.
-- @param at  number of the byte, from 0
function M.begins(data, at)
  local version, reserved, high, low, length, code, third = byte(data, at + 1, at + 7)
  if version ~= M.VERSION or (reserved or 0) ~= 0 then return false end
  if not low then return true end
  local whole = high * 0x100 + low
  if whole < LEAST or length and (length < 1 or length > whole - HEADER - 1) then return false end
  if not code or code ~= DT then return not code or KINDS[code - code % 0x10] or false end
  return length == 2 and (third or 0) % EOT == 0
end

local begins = M.begins

-- What one end sends, as TPDUs:
--   lost    bytes that were passed over or never there
--   synced  whether the beginning of a TPKT is known
--   buffer  bytes of a TPKT that is not whole; `at` their last frame, `newest` that of the last ones
--   parts   of a PDU that is not whole: `parts_size` bytes, `parts_at` their last frame
-- A TPDU that is whole is {tpdu, data, at, late}; of DT it is the last one of a PDU, with the data of all.
local Reader = {}
Reader.__index = Reader
M.Reader = Reader

function Reader.new()
  return setmetatable({lost = 0, synced = false, buffer = "", parts = {}, parts_size = 0}, Reader)
end

--- Bytes that are kept.
function Reader:held()
  return #self.buffer + self.parts_size
end

-- The parts of a PDU are not kept any more.
local function forget(self)
  self.parts, self.parts_size, self.parts_at = {}, 0, nil
end

--- So many bytes are missing: what was begun never becomes whole.
function Reader:lose(count)
  self.lost = self.lost + count + self:held()
  self.synced, self.buffer = false, ""
  forget(self)
end

local function take_tpdu(self, tpdu, found)
  if tpdu.kind ~= DT or tpdu.last and self.parts_size == 0 then
    found[#found + 1] = {tpdu = tpdu, data = tpdu.data, at = self.at}
    return
  end
  if tpdu.data == "" and not tpdu.last then return end
  self.parts[#self.parts + 1] = tpdu.data ~= "" and tpdu.data or nil
  self.parts_size = self.parts_size + #tpdu.data
  if not self.parts_at or self.at.frame > self.parts_at.frame then self.parts_at = self.at end
  if self.parts_size > LONGEST then
    self.lost = self.lost + self.parts_size
    forget(self)
  elseif tpdu.last then
    found[#found + 1] = {tpdu = tpdu, data = table.concat(self.parts), at = self.parts_at}
    forget(self)
  end
end

-- Passes over bytes that begin no TPKT; where the next one may begin.
local function seek(self, at)
  local buffer = self.buffer
  local found = find(buffer, "\3", at + 2, true)
  local next_at = found and found - 1 or #buffer
  self.lost, self.synced = self.lost + next_at - at, false
  forget(self)
  return next_at
end

-- What is whole in the buffer.
local function read(self, found)
  local buffer, at = self.buffer, 0
  while at < #buffer do
    if not begins(buffer, at) then
      at = seek(self, at)
    else
      local length = #buffer - at >= HEADER and u16(buffer, at + 2)
      if not length or #buffer - at < length then break end
      self.synced = true
      take_tpdu(self, M.decode(sub(buffer, at + HEADER + 1, at + length), HEADER), found)
      at, self.at = at + length, self.newest
    end
  end
  if at > 0 then self.buffer = sub(buffer, at + 1) end
end

-- Bytes that come when nobody waits for them: only what is whole in them counts.
local function alone(piece)
  local found = Reader.new():take({data = piece.data, at = piece.at})
  for _, whole in ipairs(found) do whole.late = true end
  return found
end

--- Bytes in order (a piece of tcp.lua).
-- @return array of what is whole with them
function Reader:take(piece)
  if piece.late then return alone(piece) end
  if piece.lost then self:lose(piece.lost) end
  if self.buffer == "" or piece.at.frame > self.at.frame then self.at = piece.at end
  self.newest = piece.at
  self.buffer = self.buffer .. piece.data
  local found = {}
  read(self, found)
  return found
end

return M
