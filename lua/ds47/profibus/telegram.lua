-- One frame of PROFIBUS: start byte, addresses, function code, SAPs, data, check byte (docs/profibus.md 2).
-- One frame whose bytes are in hand; what its data says is in dp.lua and ms1.lua.

local bit_of = require("ds47.support.bits").bit
local tables = require("ds47.spec.tables")

local M = {ALL_STATIONS = 127}

local END, START = 0x16, 0x68
local HEAD, TRAILER = 4, 2
local SIZES = {SD1 = 6, SD3 = 14, SD4 = 3, SC = 1}

local function add(flaws, kind, offset, args)
  flaws[#flaws + 1] = {kind = kind, offset = offset, args = args or {}}
end

--- The check byte of what stands between start and check byte.
function M.check_byte(content)
  local sum = 0
  for at = 1, #content do sum = sum + content:byte(at) end
  return sum % 0x100
end

--- How many bytes the frame has that begins here.
-- @return nil where no frame begins with this byte, where too few bytes are there to know, or where SD2 has
-- length bytes that differ or that no frame has
function M.size(data)
  local start = tables.profibus.start[data:byte(1)]
  if not start then return nil end
  if start.id ~= "SD2" then return SIZES[start.id] end
  local le, ler = data:byte(2, 3)
  if not ler or le ~= ler or le < tables.profibus.least or le > tables.profibus.most then return nil end
  return le + HEAD + TRAILER
end

-- What is wrong with the first four bytes of SD2.
local function head_flaws(kind, data)
  local flaws = {}
  if kind ~= "SD2" then return flaws end
  if #data < HEAD - 1 then
    add(flaws, "cut", 0, {have = #data, want = HEAD})
    return flaws
  end
  local le, ler, second = data:byte(2, 4)
  local least, most = tables.profibus.least, tables.profibus.most
  if le ~= ler then
    add(flaws, "lengths", 1, {le = le, ler = ler})
  elseif le < least or le > most then
    add(flaws, "length", 1, {le = le, least = least, most = most})
  end
  if second and second ~= START then add(flaws, "second", 3, {byte = second}) end
  return flaws
end

local function border_flaws(data, whole, flaws)
  if #data < whole then add(flaws, "cut", #data, {have = #data, want = whole}) end
  if #data > whole then add(flaws, "rest", whole, {n = #data - whole}) end
end

-- A token has addresses alone: no check byte proves them.
local function token(item)
  for at = 1, 2 do
    local address = item.data:byte(at + 1)
    if address and address >= M.ALL_STATIONS then add(item.flaws, "address", at, {address = address}) end
    if address then item[at == 1 and "da" or "sa"] = address % 0x80 end
  end
  return item
end

-- The extension bytes that an address announces, and where they end: bit 7 announces another one.
local function extension(content, at, address)
  local first, more = at, address >= 0x80
  while more and at < #content do
    more = content:byte(at + 1) >= 0x80
    at = at + 1
  end
  return content:sub(first + 1, at), at
end

local function is_whole(bytes, address) return address < 0x80 or #bytes > 0 and bytes:byte(-1) < 0x80 end

-- The SAP among extension bytes; those with bit 6 name a segment of the net.
local function sap(bytes)
  for at = 1, #bytes do
    local byte = bytes:byte(at)
    if bit_of(byte, 6) == 0 then return byte % 0x40 end
  end
  return nil
end

local function check(item, content, at)
  local sent, last = item.data:byte(at + 1, at + 2)
  item.fcs = sent
  local computed = M.check_byte(content)
  if sent and sent ~= computed then add(item.flaws, "check", at, {sent = sent, computed = computed}) end
  if last and last ~= END then add(item.flaws, "end_byte", at + 1, {byte = last}) end
end

-- What a function code says of both sides.
local function direct(item)
  local fc = item.fc
  item.request, item.code = bit_of(fc, 6) == 1, fc % 0x10
  if item.request then
    item.fcb, item.fcv = bit_of(fc, 5), bit_of(fc, 4)
    item.slave_sap, item.master_sap = item.dsap, item.ssap
  else
    item.slave_sap, item.master_sap = item.ssap, item.dsap
  end
end

-- SD1, SD2 or SD3, as far as it is there; its content stands from head to the end.
local function body(item, head, last)
  local content, flaws = item.data:sub(head + 1, last), item.flaws
  if #content < 3 then return item end
  check(item, content, last)
  local da, sa, fc = content:byte(1, 3)
  if sa % 0x80 == M.ALL_STATIONS then add(flaws, "address", head + 1, {address = M.ALL_STATIONS}) end
  if fc >= 0x80 then add(flaws, "reserved", head + 2, {byte = fc}) end
  local at = 3
  item.dae, at = extension(content, at, da)
  item.sae, at = extension(content, at, sa)
  if not is_whole(item.dae, da) or not is_whole(item.sae, sa) then add(flaws, "extension", head + at) end
  item.da, item.sa, item.fc = da % 0x80, sa % 0x80, fc
  item.dsap, item.ssap = sap(item.dae), sap(item.sae)
  item.du = content:sub(at + 1)
  direct(item)
  return item
end

--- The frame that these bytes are; whatever they are, with what is wrong about it.
-- @param data string, all bytes of one frame; further ones are a flaw
-- @return table {kind ("SD1" to "SD4", "SC", "" where no frame begins so), data, da, sa, fc, dae, sae, dsap,
-- ssap, du, fcs, flaws (list of {kind, offset, args}), request, code, fcb, fcv, slave_sap, master_sap}; what
-- it does not have is nil, du, dae and sae are empty then
function M.decode(data)
  local item = {kind = "", data = data, du = "", dae = "", sae = "", flaws = {}}
  local first = data:byte(1)
  local start = first and tables.profibus.start[first]
  if not start then
    if first then add(item.flaws, "start", 0, {byte = first})
    else add(item.flaws, "cut", 0, {have = 0, want = 1}) end
    return item
  end
  local whole = M.size(data)
  item.kind, item.flaws = start.id, head_flaws(start.id, data)
  if not whole then return item end
  border_flaws(data, whole, item.flaws)
  if item.kind == "SC" then return item end
  if item.kind == "SD4" then return token(item) end
  return body(item, item.kind == "SD2" and HEAD or 1, whole - TRAILER)
end

return M
