-- What a description (attribute 0x20) says of a parameter, and the entries of a text array (0x30), below the
-- parameter. Each stands at its bytes; those of a change are in brackets in its response. What the bytes mean
-- is in ds47.profidrive.description.

local descriptions = require("ds47.report.descriptions")
local tables = require("ds47.spec.tables")
local types = require("ds47_ws.types")
local words = require("ds47.report.formatting")

local M = {}

-- The fields of an element, in their order: those of `variable` and of the identifier have several.
local FIELDS = {
  identifier = { "identifier", "type", "writable", "text_array", "changed", "reset_only", "array" },
  variable = { "quantity", "conversion", "unit" },
  normalisation = { "normalisation", "full_scale" },
}
local BYTES = { quantity = 0, conversion = 1 } -- of `variable`: fields of one byte, and which one it is
local DOUBLES = { factor = true, low = true, high = true }

local function value_of(name, value)
  if DOUBLES[name] then return types.number(value) end
  if type(value) == "string" then return words.escape(value) end
  return value
end

-- An element, whose bytes stand at `offset` of the record where `here` says that they are in this frame.
local function add_element(put, parent, found, name, here, record, offset, size)
  for _, key in ipairs(FIELDS[name] or { name }) do
    local byte = BYTES[key]
    local at, length = byte and offset + byte or offset, byte and 1 or size
    put.show(parent, "description." .. key, value_of(key, found[key]), here, record, at, length)
  end
end

local function add_description(put, parent, item, found, block, record)
  local start, all = block and block.offset + 2 or 0, block and #block.raw or 0
  local parts = descriptions.parts(item, words)
  local label = parts and table.concat(parts, ", ") or words.values(item.values, item.format)
  local shown = put.show(parent, "description", label, block, record, start, all) or parent
  for _, each in ipairs(tables.descriptions.elements) do
    if item.subindex == 0 then
      add_element(put, shown, found, each.name, block, record, start + each.offset, each.size)
    elseif item.subindex == each.number then
      add_element(put, shown, found, each.name, block, record, start, all)
    end
  end
end

local function add_texts(put, parent, entries, block, record)
  local start, size = block and block.offset + 2 or 0, block and math.floor(#block.raw / #entries) or 0
  for number, text in ipairs(entries) do
    put.show(parent, "text", words.escape(text), block, record, start + (number - 1) * size, size)
  end
end

--- Adds what the values of a parameter describe; nothing where they describe nothing.
-- @param put    the functions of tree.lua that add fields
-- @param block  where they stand, nil where that is not in this frame
-- @param record the bytes of the record in this frame
function M.add(put, parent, item, block, record)
  local found, entries = descriptions.of(item), descriptions.entries(item)
  if found then
    add_description(put, parent, item, found, block, record)
  elseif entries then
    add_texts(put, parent, entries, block, record)
  end
end

return M
