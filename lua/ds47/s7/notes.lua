-- What happens again and again, as one remark with a count and its first frames (docs/s7.md 7).
--
-- Kept until nothing more comes; which rule speaks of what is known by those who add to it.

local json = require("ds47.support.json")
local ordered = require("ds47.support.ordered")

local M = {}

local MOST_FRAMES = 60 -- frames that are kept of one thing

-- A remark, how often it is true, and in which frames first: {remark, count, frames}.
local Note = {}
Note.__index = Note

--- An argument that is the largest one of all, which the remark then stands at.
function Note:more(name, value, frame)
  if self.remark.args[name] < value then
    self.remark.args[name], self.remark.frame = value, frame
  end
end

local Notes = {}
Notes.__index = Notes

--- @param most  different things that are kept
function M.new(most)
  return setmetatable({most = most, notes = ordered.new()}, Notes)
end

local function add_frame(frames, frame)
  if #frames >= MOST_FRAMES then return end
  for _, each in ipairs(frames) do
    if each == frame then return end
  end
  frames[#frames + 1] = frame
end

--- It happened, perhaps again.
-- @param rule  what it is,
-- @param key  and what tells it from others of the rule: text
-- @param frame  where it shows
-- @param args  of the remark, the first time; the table is kept
-- @param also  array of further frames that it is about; may be nil
-- @return the note; nil where there is no room for one more thing
function Notes:add(rule, key, frame, args, also)
  local place = rule .. " " .. key
  local note = self.notes:get(place)
  if not note then
    if self.notes.length >= self.most then return nil end
    note = setmetatable({remark = {rule = rule, frame = frame, args = args}, count = 0, frames = {}}, Note)
    self.notes:set(place, note)
  end
  note.count = note.count + 1
  add_frame(note.frames, frame)
  for _, each in ipairs(also or {}) do add_frame(note.frames, each) end
  return note
end

--- All remarks.
function Notes:finish()
  local found = {}
  for _, note in self.notes:iterate() do
    table.sort(note.frames)
    note.remark.args.count, note.remark.args.frames = note.count, json.array(note.frames)
    found[#found + 1] = note.remark
  end
  return found
end

return M
