-- Channels that a user names, where a capture has no Connect: their notation, and relations (docs/cyclic.md
-- 5).
--
-- A name says who sends a channel and where it is; two of them make a relation, the first for the frames of
-- the controller. What a Connect would say besides (addresses, slot, IOPS, cycle time) nobody knows.

local LENGTH = require("ds47.cyclic.pkw").LENGTH
local mac_text = require("ds47.profinet.link").mac_text
local relations = require("ds47.cyclic.relations")

local char, find, floor = string.char, string.find, math.floor

local M = {}

local KINDS = {pkw = true, pzd = true, ppo1 = true}
local FIRST, LAST = 0x0100, 0xFBFF -- frame ids of cyclic frames
local LONGEST = 1440
local PZD_LENGTH = 4 -- STW1 and setpoint, ZSW1 and actual value: what all telegrams have
local NAME = "^(%x%x[:-]%x%x[:-]%x%x[:-]%x%x[:-]%x%x[:-]%x%x)@(%x+):(%d+):(%w+)$"

--- A name as it is typed, `00:1b:1b:11:22:33@8000:0:pkw`: {source (six bytes), frame_id, offset, kind}; nil
-- where it is none.
function M.parse(text)
  local _, _, mac, id, offset, kind = find(text:lower():gsub("@0x", "@"), NAME)
  local frame_id = mac and tonumber(id, 16)
  if not mac or #id > 4 or not KINDS[kind] or tonumber(offset) >= LONGEST then return nil end
  if frame_id < FIRST or frame_id > LAST then return nil end
  local source = mac:gsub("%x%x[:-]?", function(each) return char(tonumber(each:sub(1, 2), 16)) end)
  return {source = source, frame_id = frame_id, offset = floor(tonumber(offset)), kind = kind}
end

--- All names of a text, with commas or blanks between them; nil where one is none, or two do not go together.
function M.list(text)
  local found = {}
  for each in text:gmatch("[^%s,;]+") do
    local name = M.parse(each)
    if name == nil then return nil end
    found[#found + 1] = name
  end
  if #found % 2 == 1 then return nil end
  for number = 1, #found, 2 do
    if found[number].kind ~= found[number + 1].kind then return nil end
  end
  return found
end

local function side(name, behind, channel, length)
  return relations.bare_side(name.source, name.frame_id, name.offset + behind, length, channel)
end

local function relation(channel, output, input, behind, length)
  return {
    channel = channel, telegrams = {},
    controller = mac_text(output.source), device = mac_text(input.source),
    output = side(output, behind, channel, length), input = side(input, behind, channel, length),
    certainty = relations.NAMED,
  }
end

--- The channels that names stand for, two names for each: array of relations.
function M.relations(names)
  local found = {}
  for number = 1, #names, 2 do
    local output, input = names[number], names[number + 1]
    if output.kind ~= "pzd" then found[#found + 1] = relation(relations.PKW, output, input, 0, LENGTH) end
    if output.kind ~= "pkw" then
      local behind = output.kind == "ppo1" and LENGTH or 0
      found[#found + 1] = relation(relations.PZD, output, input, behind, PZD_LENGTH)
    end
  end
  return found
end

return M
