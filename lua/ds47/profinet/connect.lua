-- What a Connect sets up: which bytes of which cyclic frames belong to which submodule (docs/protocol.md
-- F.6). Request and response to places in frames. What the bytes are, PKW or PZD or none of them, is
-- cyclic/.
--
-- A submodule: {api, slot, subslot, ident, input, output}. Its data in a direction, nil where it has none:
-- {reference, frame_id, offset, length, iops, cycle_ns, frame_length}; `offset` counts from the byte behind
-- the frame id, IOPS stands behind the data, and behind `frame_length` bytes the status of the frame.

local flat = require("ds47.support.flat").copy
local layout = require("ds47.spec.tables").layouts
local reader = require("ds47.support.bytes")

local byte, format, sub, u16, u32 = string.byte, string.format, string.sub, reader.u16, reader.u32

local M = {INPUT = 1, OUTPUT = 2} -- types of relations, and of data: device to controller, and the other way

local NDR, HEADER = layout.NDR_SIZE, layout.BLOCK_SIZE
local IOCR, OBJECT, SLOT, SUBMODULE, DESCRIPTION = 40, 6, 14, 8, 6 -- bytes of what blocks are made of
local TICK_NS = 31250
local BOTH = 3 -- properties of a submodule that has input and output

-- Whether so many bytes are there; a message that ends before them tells nothing.
local function has(data, at, size) return at + size <= #data end

-- Calls `take` with type and content behind the version of each block; false where one ends too early, or
-- `take` finds that it does.
local function each_block(body, take)
  local at = NDR
  while has(body, at, HEADER) do
    local kind, length = u16(body, at), u16(body, at + 2)
    local stop = at + 4 + length
    if length < 2 or stop > #body or take(kind, sub(body, at + HEADER + 1, stop)) == false then
      return false
    end
    at = stop
  end
  return true
end

local function place_of(api, slot, subslot) return format("%.0f %d %d", api, slot, subslot) end

-- One list of an API in an IOCRBlockReq, kept in `offsets` where it is wanted; where it ends, nil: too early.
local function places(block, at, api, offsets)
  if not has(block, at, 2) then return nil end
  local count = u16(block, at)
  at = at + 2
  if not has(block, at, count * OBJECT) then return nil end
  for _ = 1, count do
    if offsets then offsets[place_of(api, u16(block, at), u16(block, at + 2))] = u16(block, at + 4) end
    at = at + OBJECT
  end
  return at
end

-- An IOCRBlockReq behind its version: where which submodule lies in its frames; nil where it ends too early.
local function relation(block)
  if not has(block, 0, IOCR) then return nil end
  local found = {
    kind = u16(block, 0), reference = u16(block, 2), frame_length = u16(block, 10),
    frame_id = u16(block, 12), cycle_ns = u16(block, 14) * u16(block, 16) * TICK_NS, offsets = {},
  }
  local at = IOCR
  for _ = 1, u16(block, IOCR - 2) do
    if not has(block, at, 4) then return nil end
    local api = u32(block, at)
    at = places(block, at + 4, api, found.offsets)
    at = at and places(block, at, api) -- the IOCS of others
    if not at then return nil end
  end
  return found
end

-- The lengths of data and of IOPS by direction, and where their descriptions end; nil: too early.
local function lengths_of(block, at, properties)
  local lengths = {}
  for _ = 1, properties % 4 == BOTH and 2 or 1 do
    if not has(block, at, DESCRIPTION) then return nil end
    lengths[u16(block, at)] = {length = u16(block, at + 2), iops = byte(block, at + 6)}
    at = at + DESCRIPTION
  end
  return lengths, at
end

-- The submodules of a slot; where they end, nil: too early.
local function slot_of(block, at, expected)
  if not has(block, at, SLOT) then return nil end
  local api, slot, count = u32(block, at), u16(block, at + 4), u16(block, at + 12)
  at = at + SLOT
  for _ = 1, count do
    if not has(block, at, SUBMODULE) then return nil end
    local item = {api = api, slot = slot, subslot = u16(block, at), ident = u32(block, at + 2)}
    local lengths, stop = lengths_of(block, at + SUBMODULE, u16(block, at + 6))
    if not lengths then return nil end
    item.lengths, at = lengths, stop
    expected[place_of(api, slot, item.subslot)] = item
  end
  return at
end

-- An ExpectedSubmoduleBlockReq: what is described of each submodule goes to `expected`, by place.
local function expect(block, expected)
  if not has(block, 0, 2) then return false end
  local at = 2
  for _ = 1, u16(block, 0) do
    at = slot_of(block, at, expected)
    if not at then return false end
  end
  return true
end

-- The submodules that have data in a cyclic frame, in no order.
local function submodules(relations, expected)
  local result = {}
  for place, item in pairs(expected) do
    local found, any = {}, false
    for _, each in ipairs(relations) do
      local offset, described = each.offsets[place], item.lengths[each.kind]
      if offset and described and described.length > 0 then
        any = true
        local data = flat(each)
        data.offset, data.length, data.iops = offset, described.length, described.iops
        found[each.kind] = data
      end
    end
    if any then
      result[#result + 1] = {
        api = item.api, slot = item.slot, subslot = item.subslot, ident = item.ident,
        input = found[M.INPUT], output = found[M.OUTPUT],
      }
    end
  end
  return result
end

-- AR and MAC address of an ARBlockReq or ARBlockRes; nil where it has none.
local function stations(block)
  return has(block, 0, 18) and sub(block, 3, 18) or nil, has(block, 0, 26) and sub(block, 21, 26) or nil
end

--- What a Connect request asks for: {ar, controller_mac (six bytes), submodules}; nil where it has no AR,
-- or a block that is cut off or does not parse.
function M.parse_request(pdu)
  local relations, expected, ar, mac = {}, {}, nil, nil
  local whole = each_block(pdu.body, function(kind, block)
    if kind == layout.BLOCK_AR_REQUEST then
      ar, mac = stations(block)
    elseif kind == layout.BLOCK_IOCR_REQUEST then
      relations[#relations + 1] = relation(block) or false
      return relations[#relations] ~= false
    elseif kind == layout.BLOCK_EXPECTED_SUBMODULES then
      return expect(block, expected)
    end
  end)
  if not (whole and ar and mac) then return nil end
  return {ar = ar, controller_mac = mac, submodules = submodules(relations, expected)}
end

--- The AR, the MAC address of the device (six bytes), and the frame id of each relation by its reference; nil
-- as above.
function M.parse_response(pdu)
  local ids, ar, mac = {}, nil, nil
  local whole = each_block(pdu.body, function(kind, block)
    if kind == layout.BLOCK_AR_RESPONSE then
      ar, mac = stations(block)
    elseif kind == layout.BLOCK_IOCR_RESPONSE then
      if not has(block, 0, OBJECT) then return false end
      ids[u16(block, 2)] = u16(block, 4)
    end
  end)
  if not (whole and ar and mac) then return nil end
  return ar, mac, ids
end

--- Gives a Connect the frame ids that the device gave, by the reference of their relation.
-- @return frame id -> bytes of data of all submodules
function M.answered(connect, frame_ids)
  local lengths = {}
  for _, each in ipairs(connect.submodules) do
    for _, data in ipairs({each.input or false, each.output or false}) do
      if data then
        data.frame_id = frame_ids[data.reference] or data.frame_id
        lengths[data.frame_id] = data.frame_length
      end
    end
  end
  return lengths
end

return M
