-- What a frame has of the drives that PZD controls: where their words stand, and what happened in it.
--
-- Live from what the analysis tells frame by frame, later from the complete result. Only drives that are
-- proven. Fields and texts are not here (pzd_tree.lua, info.lua), nor is what words mean (ds47.cyclic).

local bits = require("ds47.support.bits")
local last_until = require("ds47.support.arrays").last_until
local ends_to = require("ds47.cyclic.channels").ends_to
local pzd = require("ds47.cyclic.pzd")
local tables = require("ds47.spec.tables")

local byte = string.byte

local M = {}

local NONE = {}
local PZD = "pzd"
local VALID = 2 -- bit of the status of a frame

--- Whether there is one that may be a drive among relations.
function M.among(relations)
  for _, relation in ipairs(relations) do
    if relation.channel == PZD then
      return true
    end
  end
  return false
end

-- The complete result

local function is_heeded(word)
  return bits.bit(word, tables.pzd.stopping.heeded) == 1
end

local function key_of(source, frame_id)
  return source .. string.format("%d", frame_id) -- six bytes, on PROFIBUS two; %s of Lua 5.2 ends at a zero
end

local function push(lists, key, item)
  lists[key] = lists[key] or {}
  table.insert(lists[key], item)
end

-- The control words that a drive heeds, each behind the frame from which on it stands.
local function controls_of(events)
  local controls = {}
  for _, event in ipairs(events) do
    if event.word == "STW1" and is_heeded(event.after) then
      controls[#controls + 1] = { event.frame, event.after }
    end
  end
  return controls
end

-- Both ends of a relation, found by what its frames begin with.
local function push_ends(ends, relation, recorder, controls)
  for _, way in ipairs({ "output", "input" }) do
    local side = relation[way]
    push(ends, key_of(side.source, side.frame_id), {
      relation = relation, side = side, sent = way == "output", speed = recorder.speed, controls = controls,
    })
  end
end

--- The complete result as frames ask for it.
-- @param result as Analysis:ended gives it
-- @param channels Analysis.cyclic, which has its drives in the same order
-- @return {ends = by source and frame id, events = by frame: array of {relation, event, number}}
function M.complete(result, channels)
  local found, lines = { ends = {}, events = {} }, channels:drives()
  for place, timeline in ipairs(result.timelines) do
    local number = timeline.relation
    local relation = result.relations[number]
    push_ends(found.ends, relation, lines[place].recorder, controls_of(timeline.events))
    for _, event in ipairs(timeline.events) do
      push(found.events, event.frame, { relation = relation, event = event, number = number })
    end
  end
  return found
end

-- Words

-- Whether data is valid, as its IOPS and the status of the frame say, where they are known.
local function is_valid(side, frame, at)
  return (not side.status or bits.bit(byte(frame, at + side.status + 1), VALID) == 1)
    and (not side.iops or byte(frame, at + side.iops + 1) >= 0x80)
end

-- Whether the frame has all of an end: the capture may have cut it.
local function is_whole(side, frame, at)
  return #frame > at + math.max(side.offset + side.length - 1, side.status or 0, side.iops or 0)
end

-- Whether a relation counts in a frame: a Connect began it, and another one may have replaced it.
local function counts(relation, number)
  return (relation.frame or number) <= number and (relation.replaced == nil or number <= relation.replaced)
end

local function word_at(frame, offset)
  local high, low = byte(frame, offset + 1, offset + 2)
  return high * 256 + low
end

-- What an end says in a frame, a place: {offset in the frame, length, sent (by the controller), relation,
-- word, valid, speed (whether a speed is behind the word), control (that the drive heeds, may be nil)}.
local function place_of(each, frame, at, speed, control)
  local side = each.side
  local offset = at + side.offset
  return {
    offset = offset, length = side.length, sent = each.sent, relation = each.relation,
    word = word_at(frame, offset), valid = is_valid(side, frame, at), speed = speed, control = control,
  }
end

--- The words of drives in a cyclic frame, as far as earlier frames prove them: array of places.
-- @param channels Analysis.cyclic
-- @param place where its words stand, as track.lua knows it: {at, source, receiver, frame_id}
function M.live_words(channels, number, frame, place)
  local found, lines = {}, channels:drives()
  if #lines == 0 then
    return found
  end
  local at = place.at
  for _, each in ipairs(channels:ends_in(number, place)) do
    for _, line in ipairs(lines) do
      if line.relation == each.relation and is_whole(each.side, frame, at) then
        found[#found + 1] = place_of(each, frame, at, line.recorder.speed, line.recorder.heeded)
      end
    end
  end
  return found
end

--- The same as the complete result knows it.
-- @param complete as `M.complete` gives it
function M.words(complete, number, frame, place)
  local ends = complete.ends[key_of(place.source, place.frame_id)]
  if ends == nil then
    return NONE
  end
  local found, at = {}, place.at
  for _, each in ipairs(ends_to(ends, place.receiver)) do
    if counts(each.relation, number) and is_whole(each.side, frame, at) then
      local control = each.controls[last_until(each.controls, number)]
      found[#found + 1] = place_of(each, frame, at, each.speed, control and control[2])
    end
  end
  return found
end

--- The state that words of a drive show: its id and the ids of what is shown beside it; nil of a control
-- word, and where the data is not valid.
function M.state(place)
  if place.sent or not place.valid then
    return nil
  end
  return pzd.state(place.word, place.control)
end

return M
