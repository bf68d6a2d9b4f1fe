-- Where PKW and PZD are in cyclic frames: what a Connect sets up, as relations (docs/cyclic.md 5). Bytes of
-- frames are not looked at here.
--
-- Lengths alone make candidates only: which of them is a PKW channel, its first request with a response
-- shows, and which is PZD, the words themselves (channels.lua).
--
-- A relation: {channel, controller, device, vendor_id, ar, api, slot, subslot, telegrams, output, input,
-- frame, certainty}; `frame` is that of the response to the Connect, `certainty` M.LENGTHS, M.CONFIGURED,
-- M.SEEN, M.NAMED, M.ODD (its words have no sense) or M.REFUTED. One that was named by hand has no AR and no
-- submodule, and `frame` is its first one.
--
-- A side of it: {source (six bytes), frame_id, offset, length, watched, iops, status, cycle_ns}: where the
-- channel is behind the frame id, how many of its bytes matter when they change, the state of the data (nil
-- where there is none or nobody knows), that of the frame (nil where nobody knows). A cycle of 0 is not
-- known.

local LENGTH = require("ds47.cyclic.pkw").LENGTH
local dictionary = require("ds47.profidrive.dictionary")
local entries = require("ds47.support.later").entries
local filtered = require("ds47.support.arrays").filtered
local tables = require("ds47.spec.tables")

local M = {
  PKW = "pkw", PZD = "pzd", LENGTHS = "lengths", SEEN = "seen", NAMED = "named", REFUTED = "refuted",
  CONFIGURED = "configured", ODD = "odd", SIEMENS = 0x002A, WORD = 2,
}

local LEAST_PZD = 4
local STATIONS = 2 -- bytes of a sender on PROFIBUS; a MAC address has six
local LONGEST = 1440 -- bytes of data that a cyclic frame has at the most

-- Whether data lies in its frame: what a device sets up does, a broken capture may say anything.
local function fits(data)
  return data and data.offset + data.length + data.iops <= data.frame_length and data.frame_length <= LONGEST
end

local function is_before(a, b)
  if a.api ~= b.api then return a.api < b.api end
  if a.slot ~= b.slot then return a.slot < b.slot end
  return a.subslot < b.subslot
end

local function is(item, length) return item.output.length == length and item.input.length == length end

local function size_of(word) return 2 * (tonumber(word:match("%((%d)%)$")) or 1) end

-- Bytes of the words of a telegram.
local sizes = entries(function(words)
  local size = 0
  for _, word in ipairs(words) do size = size + size_of(word) end
  return size
end)

-- The numbers of the telegrams of drives of any maker, with PKW or without, that have these lengths.
local function fitting(output, input, pkw)
  local found = {}
  for number, row in pairs(tables.pzd.telegrams) do
    if row.of_drive and row.pkw == pkw and sizes[row.out] == output and sizes[row.inward] == input then
      found[#found + 1] = number
    end
  end
  table.sort(found)
  return found
end

--- Adds the numbers of the telegrams that a maker has, with PKW or without, where these are their lengths.
-- @param maker vendor id; nil where nothing says it: a number above those of the profile is somebody's
function M.add_telegrams(numbers, output, input, pkw, maker)
  for _, number in ipairs(fitting(output, input, pkw)) do
    local vendor = tables.pzd.telegrams[number].vendor
    if vendor == nil or vendor == maker then numbers[#numbers + 1] = number end
  end
  return numbers
end

local function may_be_pzd(item) return item.output.length >= LEAST_PZD and item.input.length >= LEAST_PZD end

-- Whether a slot has eight bytes of PKW beside what may be process data, and the telegrams of that.
local function beside(slot, maker)
  local words, others, numbers = false, false, {}
  for _, each in ipairs(slot) do
    words = words or is(each, LENGTH)
    if may_be_pzd(each) and not is(each, LENGTH) then
      others = true
      M.add_telegrams(numbers, each.output.length, each.input.length, true, maker)
    end
  end
  return words and others, numbers
end

local function of_slot(slot, maker, result)
  local others, numbers = beside(slot, maker)
  local function found(channel, submodule, offset, of)
    result[#result + 1] = {channel = channel, submodule = submodule, offset = offset, telegrams = of}
  end
  for _, each in ipairs(slot) do
    local output, input = each.output.length, each.input.length
    if is(each, LENGTH) and others then
      found(M.PKW, each, 0, numbers)
    else
      if is(each, 12) or is(each, 20) then -- PPO1 and PPO2
        local rest = M.add_telegrams({}, output - LENGTH, input - LENGTH, true, maker)
        found(M.PKW, each, 0, rest)
        found(M.PZD, each, LENGTH, rest)
      end
      if fitting(output, input, others)[1] or others and may_be_pzd(each) then
        found(M.PZD, each, 0, M.add_telegrams({}, output, input, others, maker))
      end
    end
  end
end

--- What may be a channel of a drive in the data that a Connect sets up: an array of {channel, submodule,
-- offset, telegrams that the lengths allow}. PKW: eight bytes beside process data in one slot; or twelve or
-- twenty in one submodule, as PPO1 and PPO2 have them. PZD: what stands beside or behind them, or has the
-- lengths of a telegram, whosever it is.
-- @param connect as connect.lua gives it
-- @param maker vendor id of the device, nil where nothing says it: only telegrams that it has are named
function M.channels(connect, maker)
  local both = filtered(connect.submodules, function(each) return fits(each.input) and fits(each.output) end)
  table.sort(both, is_before)
  local result, first = {}, 1
  while both[first] do
    local slot, at = {}, first
    while both[at] and both[at].api == both[first].api and both[at].slot == both[first].slot do
      slot[#slot + 1] = both[at]
      at = at + 1
    end
    of_slot(slot, maker, result)
    first = at
  end
  return result
end

--- A direction of a channel that begins `offset` bytes behind the data of a submodule.
-- @param source MAC address of who sends it, six bytes
function M.side(data, source, channel, offset)
  local pkw = channel == M.PKW
  return {
    source = source, frame_id = data.frame_id, offset = data.offset + offset,
    length = pkw and LENGTH or data.length - offset, watched = pkw and LENGTH or M.WORD,
    iops = data.iops > 0 and data.offset + data.length or nil,
    status = data.frame_length + 2, -- behind the cycle counter
    cycle_ns = data.cycle_ns,
  }
end

--- The same where no Connect says more of it.
function M.bare_side(source, frame_id, offset, length, channel)
  local watched = channel == M.PKW and length or M.WORD
  return {
    source = source, frame_id = frame_id, offset = offset, length = length, watched = watched, cycle_ns = 0,
  }
end

--- Where a word is in the drive's data of the only telegram that it may be; nil where that has none.
function M.place_of(word, numbers)
  if #numbers ~= 1 then return nil end
  local place = 0
  for _, each in ipairs(tables.pzd.telegrams[numbers[1]].inward) do
    if each == word then return place end
    place = place + size_of(each)
  end
  return nil
end

--- Whether a user said that a relation is one of a drive.
function M.is_named(relation)
  local certainty = relation.certainty
  return certainty == M.NAMED or certainty == M.ODD or certainty == M.REFUTED
end

--- Whether a relation is of another maker than that whose tables are known, or nothing says whose it is.
function M.is_foreign(relation) return relation.vendor_id ~= M.SIEMENS end

--- Whether it is known to be of another maker: from bit 11 on its words are not those of the profile.
function M.is_of_others(relation) return relation.vendor_id ~= nil and M.is_foreign(relation) end

--- Whether a relation is one of PROFIBUS: senders are stations, two bytes with the receiver.
function M.is_bus(relation) return #relation.output.source == STATIONS end

--- The slave on PROFIBUS; nil elsewhere.
function M.station(relation) return M.is_bus(relation) and string.byte(relation.input.source, 1) or nil end

--- Whose parameters its drive has, as far as is known.
function M.drives(relation)
  return dictionary.family_of(relation.vendor_id, relation.family)
end

--- The stations and the slot as a key: PKW and PZD of one drive have them in common; on PROFIBUS there are
-- stations alone.
function M.place(relation)
  local place = relation.slot and relation.api .. "." .. relation.slot or "-"
  return relation.controller .. " " .. relation.device .. " " .. place
end

-- How many bytes behind another side one begins, of those that have bytes in common; else nil.
local function behind(one, other)
  local distance = one.offset - other.offset
  local meet = one.source == other.source and one.frame_id == other.frame_id
    and distance < other.length and -distance < one.length
  return meet and distance or nil
end

--- Whether two relations have bytes in common, in either direction; whether they are the same channel there.
function M.meet(one, other)
  local output, input = behind(one.output, other.output), behind(one.input, other.input)
  return output or input, one.channel == other.channel and output == 0 and input == 0
end

--- Whether two relations of a place are in the same bytes, or one behind the other in one submodule.
function M.is_same_spot(one, other)
  if M.is_bus(one) or M.is_bus(other) then
    return one.output.offset == other.output.offset and one.input.offset == other.input.offset
  end
  return one.slot == other.slot and one.subslot == other.subslot
end

return M
