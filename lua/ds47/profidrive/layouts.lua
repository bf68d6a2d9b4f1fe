-- What the responses to one question repeat: all but the reference and the values.
--
-- A program asks the same again and again, and the drive answers in the same formats. So a response that was
-- decoded without a flaw leaves its layout with the question, and the next one of that layout is known by one
-- look at its bytes; its values are decoded when somebody asks for them.
-- Only layouts of which the bytes tell all: no errors, no format that has two sizes. How a response is
-- decoded is in parameter.lua. A layout holds what bytes decode to and no verdict: what a rule says of a
-- response is decided each time. Other than in Python, which remembers elsewhere.

local flat = require("ds47.support.flat").copy

local byte, find, gsub, sub = string.byte, string.find, string.gsub, string.sub
local rep = string.rep

local M = {}

local MOST_LAYOUTS, LONGEST = 4, 240 -- of one question; bytes of a response
local MAGIC = "[%^%$%(%)%%%.%[%]%*%+%-%?]"

local function literal(bytes) return (gsub(bytes, MAGIC, "%%%0")) end

-- What the blocks at one place of a layout have in common, the metatable of each: nil where the bytes of the
-- block do not tell all.
local function place_of(block)
  local format = getmetatable(block)
  if block.error or not format or not block.sound_codec then return nil end
  local place = flat(format)
  place.value_count, place.offset, place.pad = block.value_count, block.offset, block.pad
  place.at, place.last = block.offset + 2, block.offset + 2 + #block.raw
  place.__index = place
  return place
end

-- The blocks of a response that has a layout.
local function blocks_of(layout, data)
  local places, blocks = layout.places, {nil, nil, nil, nil} -- so many places need not be added one by one
  for number = 1, #places do
    local place = places[number]
    local codec, raw = place.sound_codec, sub(data, place.at + 1, place.last)
    local values = codec.decode(raw, place.value_count, codec.size)
    local block = setmetatable({values = values, raw = raw}, place)
    if codec.scale then block.scaled = codec.scale(values, raw, codec) end
    blocks[number] = block
  end
  return blocks
end

--- The blocks of a response but for their values, which need not be decoded for it.
function M.places(response)
  local layout = response.layout
  return layout and layout.places or response.blocks
end

-- The layout of a response, the metatable of all that have it; nil where there is none.
local function layout_of(data, response)
  local places, pattern = {}, "^." .. literal(sub(data, 2, 4))
  for number, block in ipairs(response.blocks) do
    local place = place_of(block)
    if not place then return nil end
    places[number] = place
    local head = literal(sub(data, block.offset + 1, block.offset + 2))
    pattern = pattern .. head .. rep(".", #block.raw) .. block.pad
  end
  local layout = {
    places = places, pattern = pattern .. "$", response_id = response.response_id, axis = response.axis,
    parameter_count = response.parameter_count, flaws = response.flaws, rest = "", length = #data,
    shaped = response.shaped,
  }
  function layout.__index(made, key) -- the blocks are made when somebody asks for them
    if key == "blocks" then
      made.blocks = blocks_of(layout, made.data)
      return made.blocks
    end
    return layout[key]
  end
  return layout
end

--- A question without layouts: what requests share that differ in reference and values alone.
-- @param options the dialects in which its responses are read
function M.question(options) return {options = options, layouts = {}} end

--- A response to a question in one of its layouts: as parameter.decode_response gives it, with `layout`. Nil
-- where it has none of them.
function M.find(question, data)
  local layouts = question.layouts
  for number = 1, #layouts do
    local layout = layouts[number]
    if find(data, layout.pattern) then
      return setmetatable({request_reference = byte(data, 1), data = data, layout = layout}, layout)
    end
  end
  return nil
end

--- Keeps the layout of a response that was decoded; of too many the oldest goes.
function M.learn(question, data, response)
  if #data > LONGEST or response.flaws[1] or response.cut or not response.shaped then return end
  local last = response.blocks[#response.blocks]
  if (last and last.offset + 2 + #last.raw + #last.pad or 4) ~= #data then return end
  local layout, layouts = layout_of(data, response), question.layouts
  if layout then
    table.insert(layouts, 1, layout)
    layouts[MOST_LAYOUTS + 1] = nil
  end
end

return M
