-- The part of the tree that is about the four words of PKW in a cyclic frame: the words, and the parameter.
--
-- `put` are the functions of tree.lua that add fields: {add, derive}. A record is the TvbRange of the eight
-- bytes. What belongs together is decided by the analysis; links and the transaction are tree.lua's.

local cyclic = require("ds47.spec.cyclic")
local naming = require("ds47.profidrive.naming")
local pkw = require("ds47.cyclic.pkw")
local sentences = require("ds47.report.sentences")
local tables = require("ds47.spec.tables")
local types = require("ds47_ws.types")
local words = require("ds47.report.formatting")

local format = string.format

local M = {}

local ATTRIBUTES = {} -- name -> code
for code, row in pairs(tables.attributes) do ATTRIBUTES[type(row) == "table" and row.name or row] = code end

local function value_text(told) return words.value(told.value, told.float and "Float32" or "DoubleWord") end

-- Where the value stands: offset and length in the words.
local function value_place(told)
  local width = tables.pkw[told.answer and "answers" or "requests"][told.ak].width
  return width == 16 and 6 or 4, width == 16 and 2 or 4
end

-- The words of an error, and its number where there is one.
local function error_text(told, lang, vendor_id)
  local code = told.error.code
  if code == nil then return cyclic.meaning(told.ak, true, lang) end
  return format("%d %s", code, cyclic.error_text(code, lang, vendor_id))
end

-- Each of the four words as a field.
local function add_words(put, parent, told, record, lang)
  local uss = told.layout == "uss"
  local ak = put.add(parent, "pkw.ak", told.ak, record, 0, 1)
  if ak then ak:append_text(format(" (%s)", cyclic.meaning(told.ak, told.answer, lang))) end
  put.add(parent, "pkw.spm", told.spm, record, 0, 1)
  put.add(parent, "pkw.pnu", told.pnu, record, 0, 2)
  put.add(parent, "pkw.subindex", told.subindex, record, uss and 3 or 2, 1)
  put.add(parent, "pkw.page", told.page, record, uss and 2 or 3, 1)
  put.add(parent, "pkw.pwe1", told.pwe1, record, 4, 2)
  put.add(parent, "pkw.pwe2", told.pwe2, record, 6, 2)
end

-- The address of the parameter; in a response without it, that of the request.
local function add_address(put, parent, item, told, record)
  local here = told and told.pnu == item.pnu
  put.show(parent, "pnu", item.pnu, here, record, 0, 2)
  put.show(parent, "subindex", item.subindex, here, record, told and told.layout == "uss" and 3 or 2, 1)
end

-- A value; `told` are the words that it stands in, nil where they are in another frame.
local function add_value(put, parent, item, told, record)
  local value = item.values[1]
  if value == nil then return end
  local offset, size
  if told then offset, size = value_place(told) end
  local function one(under, key, what) return put.show(under, key, what, told, record, offset, size) end
  local shown = one(parent, "value", words.value(value, item.format)) or parent
  one(shown, "value.number", types.number(value))
  if item.format == "Float32" then one(shown, "value.float", value) end
  local scaled = item.scaled and item.scaled[1] -- by the description of the parameter
  if scaled then
    local physical = put.derive(shown, "scaled", words.value(scaled, item.format, true)) or shown
    put.derive(physical, "scaled.number", scaled)
  end
end

local function add_error(put, parent, failed, record, lang)
  local text = sentences.error_words(failed, lang)
  if failed.code then
    local shown = put.add(parent, "error.code", failed.code, record, 6, 2)
    if shown then shown:set_text(format("Error number: %d", failed.code)) end
    put.add(parent, "error.text", text, record, 6, 2)
  else
    put.derive(parent, "error.text", text)
  end
end

local function add_parameter(put, root, view, told, record, lang)
  local item, change = view.parameters[1], view.item.operation == "change"
  local answer = view.role == "read_response"
  local label = words.parameter(item, change, lang)
  local shown = put.add(root, "parameter", label, record, 0, pkw.LENGTH) or root
  add_address(put, shown, item, told, record)
  put.follow(shown, item)
  put.derive(shown, "attribute", ATTRIBUTES[item.attribute])
  put.derive(shown, "name", sentences.name(item, lang))
  put.derive(shown, "unit", item.unit)
  put.derive(shown, "family", words.family(item))
  for _, frame in ipairs(item.described and item.described.frames or {}) do
    put.derive(shown, "described_in", frame)
  end
  put.derive(shown, "meaning", words.meaning(item, lang))
  local written = change and answer -- what stands in the request
  put.derive(shown, written and "written.format" or "format", types.format_code(item.format))
  put.derive(shown, written and "written.value_count" or "value_count", item.value_count)
  add_value(put, shown, item, not written and told or nil, record)
  if answer and item.error then add_error(put, shown, item.error, record, lang) end
end

--- Adds what the words in this frame say, and the parameter of the transaction.
-- @param view a transaction of PKW as this frame shows it
-- @param record nil where the frame has it not
function M.add(put, root, view, record, lang)
  local told
  if record then
    local data = record:bytes():raw()
    told = pkw.decode(data, view.role == "read_response", view.item.layout)
    local shown = put.take(root, "pkw", record, 0, pkw.LENGTH)
    if shown then shown:set_text("PKW: " .. pkw.digits(data)) end
    add_words(put, shown or root, told, record, lang)
  end
  add_parameter(put, root, view, told, record, lang)
end

-- What words say that stand there unchanged, in one line.
local function line_of(told, family, lang, vendor_id)
  local text = cyclic.meaning(told.ak, told.answer, lang)
  if told.ak == 0 then return text end
  local parameter = format("p?[%d]", told.subindex)
  if told.pnu then parameter = naming.element(told.pnu, told.subindex, family) end
  text = format("AK %d %s: %s", told.ak, text, parameter)
  if told.error then return text .. ": " .. error_text(told, lang, vendor_id) end
  return told.value and text .. " = " .. value_text(told) or text
end

--- Adds the words that stand in a frame in which none of them changed, as text: they are no fields, so that a
-- filter finds the frames in which something happened.
-- @param range the TvbRange of the eight bytes
-- @param standing whether the drive says them (`answer`), the `layout`; `family` and `vendor_id` of the drive
function M.standing(tree, range, standing, lang)
  local answer = standing.answer
  local told = pkw.decode(range:bytes():raw(), answer, standing.layout)
  local text = line_of(told, standing.family, lang, standing.vendor_id)
  tree:add(range, format("DS47 PKW %s: %s", answer and "response" or "request", text))
end

return M
