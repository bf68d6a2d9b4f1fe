-- What a description (attribute 0x20) says of a parameter, and the entries of a text array (0x30), below the
-- parameter. Each stands at its bytes; those of a change are in brackets in its response. What the bytes mean
-- is in ds47.profidrive.description.

local descriptions = require("ds47.report.descriptions")
local tables = require("ds47.spec.tables")
local words = require("ds47.report.formatting")

local M = {}

local FLOAT_WORDS = { NaN = 0 / 0, Infinity = 1 / 0, ["-Infinity"] = -1 / 0 }

-- The fields of an element, in their order: those of `variable` and of the identifier have several.
local FIELDS = {
  identifier = { "identifier", "type", "writable", "text_array", "changed", "reset_only", "array" },
  variable = { "quantity", "conversion", "unit" },
  normalisation = { "normalisation", "full_scale" },
}
local DOUBLES = { factor = true, low = true, high = true }

local function value_of(name, value)
  if DOUBLES[name] then
    return FLOAT_WORDS[value] or tonumber(value)
  elseif type(value) == "string" then
    return words.escape(value)
  end
  return value
end

-- One element: at `offset` of the record, or in brackets where it is nil.
local function add_element(parent, found, element, offset, record, put)
  for place, name in ipairs(FIELDS[element.name] or { element.name }) do
    local at, size = offset, element.size
    if element.name == "variable" and place < 3 and at then
      at, size = at + place - 1, 1
    end
    local key, value = "description." .. name, found[name]
    if value ~= nil and at then
      put.add(parent, key, value_of(name, value), record, at, size)
    elseif value ~= nil then
      put.derive(parent, key, value_of(name, value))
    end
  end
end

local function add_description(parent, item, found, block, record, put)
  local start, whole = block and block.offset + 2, item.subindex == 0
  local shown
  local parts = descriptions.parts(item, words)
  local label = parts and table.concat(parts, ", ") or words.values(item.values, item.format)
  if start then
    shown = put.add(parent, "description", label, record, start, #block.raw) or parent
  else
    shown = put.derive(parent, "description", label) or parent
  end
  for _, element in ipairs(tables.descriptions.elements) do
    if element.name ~= "reserved" and (whole or element.number == item.subindex) then
      local at = start and start + (whole and element.offset or 0)
      local size = whole and element.size or block and #block.raw or 0
      local part = { name = element.name, size = size }
      add_element(shown, found, part, at, record, put)
    end
  end
end

local function add_texts(parent, entries, block, record, put)
  local size = block and math.floor(#block.raw / #entries)
  for number, text in ipairs(entries) do
    if block then
      put.add(parent, "text", words.escape(text), record, block.offset + 2 + (number - 1) * size, size)
    else
      put.derive(parent, "text", words.escape(text))
    end
  end
end

--- Adds what the values of a parameter describe; nothing where they describe nothing.
-- @param block  where they stand, nil where that is not in this frame
-- @param record the bytes of the record in this frame
-- @param put    wanted, add and derive of tree.lua
function M.add(parent, item, block, record, put)
  local found, entries = descriptions.of(item), descriptions.entries(item)
  if found then
    add_description(parent, item, found, block, record, put)
  elseif entries then
    add_texts(parent, entries, block, record, put)
  end
end

return M
