-- Which fields somebody wants in the tree of a frame: a filter, a column, a colour, or who looks at the tree.
--
-- Asking Wireshark costs half as much as making a field. So frames of one reading share what was told
-- (`reading`), columns included, and the trees of others are asked only for what a frame of their kind needs
-- (`of`). What is made of the answers is the business of tree.lua.
--
-- Answers are a table: by the key of a field (fields.lua) the field where somebody wants it, else false; by
-- an array of keys whether one of them is wanted; by a list (`list`) those of its rows that are; by VISIBLE
-- whether somebody looks at the tree, and so wants every field; by a protocol UNKNOWN, until somebody knows
-- whether it is made.

local WINDOW = gui_enabled()

local M = {}

M.VISIBLE, M.UNKNOWN = {}, "unknown"

local VISIBLE, UNKNOWN = M.VISIBLE, M.UNKNOWN

local fields
local frame_tree, referenced -- the tree of the frame, and the method of all trees that tells
local lists = {}

--- Tells the fields, by their keys.
function M.configure(the_fields) fields = the_fields end

--- Makes a list of rows, each {field = a key, or an array of keys, ...}, one that answers have. Of a row that
-- is `rare` it is asked where there is something to show: in a window each question is one of many.
function M.list(rows)
  lists[rows] = true
  return rows
end

local function ask(answers, key)
  if type(key) == "string" then return referenced(frame_tree, fields[key]) and fields[key] end
  if key == VISIBLE then return frame_tree.visible end
  if type(key) == "userdata" then return UNKNOWN end
  if lists[key] then
    local found = {}
    for number = 1, #key do
      local row = key[number]
      found[#found + 1] = (WINDOW and row.rare or answers[row.field]) and row or nil
    end
    return found
  end
  for number = 1, #key do
    if answers[key[number]] then return true end
  end
  return false
end

local KEEPING = {}

function KEEPING.__index(answers, key)
  local answer = ask(answers, key)
  answers[key] = answer
  return answer
end

-- In a window, and where words are shown, the tree of the next frame may say something else, and mostly says
-- the same as that of the last one of its kind. So its fields are asked for again, in one go, and where one
-- answer is another one all are forgotten. Frames of a kind ask for much the same fields.
local AGAIN = {}

-- By the answers of a kind: which fields its trees were asked for (`fields`, so many as `count`), whether
-- those were wanted (`answers`), and for which protocols, which each frame tells of anew.
local memories, kinds = {}, {}

function AGAIN.__index(answers, key)
  local answer, memory = ask(answers, key), memories[answers]
  answers[key] = answer
  if type(key) == "string" then
    local count = memory.count + 1
    memory.count, memory.fields[count], memory.answers[count] = count, fields[key], answer ~= false
  elseif type(key) == "userdata" then
    memory.owners[key] = true
  end
  return answer
end

local function is_as_before(memory)
  local tree, is_wanted, asked, answers = frame_tree, referenced, memory.fields, memory.answers
  for number = 1, memory.count do
    if is_wanted(tree, asked[number]) ~= answers[number] then return false end
  end
  return true
end

local function new_kind(kind)
  local answers = setmetatable({}, AGAIN)
  memories[answers] = { fields = {}, answers = {}, count = 0, owners = {} }
  kinds[kind] = answers
  return answers
end

local function asked_again(kind)
  local answers = kinds[kind] or new_kind(kind)
  local memory, visible = memories[answers], frame_tree.visible
  if visible ~= answers[VISIBLE] or not (visible or is_as_before(memory)) then
    for key in next, answers do answers[key] = nil end
    memory.count = 0
  end
  for owner in next, memory.owners do answers[owner] = UNKNOWN end
  return answers
end

-- What was told in one reading, and the last frame of it.
local reading, newest = nil, 0

local function is_further(tree, number, is_new)
  if reading == nil or reading.is_new ~= is_new or number <= newest then return false end
  -- behind a gap it may be the frame below the rows
  return number == newest + 1 or tree.visible == reading.is_visible
end

--- What is known of who reads a frame: a table that frames share which come one behind the other, all of them
-- new or none of them, as tshark reads a file and as a window loads one. Where somebody jumps (in sharkd) all
-- is asked anew. Nil where each frame is asked: in the rows of a window.
-- @return {answers = those of trees, nil in a window; protocols = whether their fields are wanted, by what is
--   asked; has_columns = nil until somebody knows}
function M.reading(tree, number, is_new)
  if WINDOW and not is_new then
    reading = nil
  elseif not is_further(tree, number, is_new) then
    reading = {
      is_new = is_new, is_visible = tree.visible, protocols = {}, has_columns = nil,
      answers = not WINDOW and setmetatable({}, KEEPING) or nil,
    }
  end
  newest = number
  return reading
end

--- A file begins.
function M.reset() reading, newest = nil, 0 end

--- The answers of the tree of a frame, which count until the next one.
-- @param kept those of a reading; nil where each frame is asked
-- @param kind a name of those that want much the same fields
function M.of(tree, kept, kind)
  frame_tree, referenced = tree, referenced or tree.referenced
  return kept or asked_again(kind)
end

return M
