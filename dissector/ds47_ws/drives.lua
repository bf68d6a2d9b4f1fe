-- What a frame has of the drives that PZD controls: where their words stand, and what happened in it.
--
-- Live from what the analysis tells frame by frame, later from the complete result. Only drives that are
-- proven. Fields and texts are not here (pzd_tree.lua, info.lua), nor is what words mean (ds47.cyclic).

local arrays = require("ds47.support.arrays")
local bits = require("ds47.support.bits")
local cyclic = require("ds47.cyclic.channels")
local pzd = require("ds47.cyclic.pzd")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")

local ends_to, said = cyclic.ends_to, cyclic.said
local last_until, push = arrays.last_until, arrays.push

local M = {}

local NONE = {}
local PZD = "pzd"

--- Whether there is one that may be a drive among relations.
function M.among(relations)
  return arrays.any(relations, function(relation) return relation.channel == PZD end)
end

local function key_of(source, frame_id)
  return source .. string.format("%d", frame_id) -- six bytes, on PROFIBUS two; %s of Lua 5.2 ends at a zero
end

-- The control words that a drive heeds, each behind the frame from which on it stands.
local function controls_of(events)
  local heeded = arrays.filtered(events, function(event)
    return event.word == "STW1" and bits.bit(event.after, tables.pzd.stopping.heeded) == 1
  end)
  return arrays.mapped(heeded, function(event) return { event.frame, event.after } end)
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

-- Whether the frame has all of an end: the capture may have cut it.
local function is_whole(side, frame, at)
  return #frame > at + math.max(side.offset + side.length - 1, side.status or 0, side.iops or 0)
end

-- Whether a relation counts in a frame: a Connect began it, and another one may have replaced it.
local function counts(relation, number)
  return (relation.frame or number) <= number and (relation.replaced == nil or number <= relation.replaced)
end

-- What an end says in a frame, a place: {offset in the frame, length, sent (by the controller), relation,
-- word, valid, speed (whether a speed is behind the word), control (that the drive heeds, may be nil)}.
local function place_of(each, frame, at, speed, control)
  local side = each.side
  local words, valid = said(each, frame, at)
  return {
    offset = at + side.offset, length = side.length, sent = each.sent, relation = each.relation,
    word = reader.u16(words, 0), valid = valid, speed = speed, control = control,
  }
end

--- The words of drives in a cyclic frame, as far as earlier frames prove them: array of places.
-- @param channels Analysis.cyclic
-- @param place where its words stand, as track.lua knows it: {at, source, receiver, frame_id}
function M.live_words(channels, number, frame, place)
  local found, lines = {}, channels:drives()
  if #lines == 0 then return found end
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
  if ends == nil then return NONE end
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
  if place.sent or not place.valid then return nil end
  return pzd.state(place.word, place.control)
end

return M
