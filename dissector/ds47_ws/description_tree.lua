-- The part of the tree that is about a description (attribute 0x20) or texts (0x30) of a parameter: each
-- element at its bytes, below the parameter.
--
-- `put` are the functions of tree.lua that add fields: {wanted, add}. What the bytes mean is said by
-- ds47.profidrive.description. An element that is not known from the message has no field.

local descriptions = require("ds47.report.descriptions")
local tables = require("ds47.spec.tables")

local M = {}

-- What of a description stands in which element: its keys are those of the JSON.
local KEYS = {
  identifier = { "identifier", "type", "writable", "changed" },
  elements = { "elements" }, factor = { "factor" }, variable = { "unit" }, name = { "name" },
  low = { "low" }, high = { "high" }, reference = { "reference" },
  normalisation = { "normalisation", "full_scale" },
}
local NUMBERS = { factor = true, low = true, high = true } -- which may be NaN or infinite: then a text

local function add_element(put, parent, found, element, record, at, size)
  for _, key in ipairs(KEYS[element.name] or {}) do
    local value = found[key]
    if value ~= nil and (not NUMBERS[key] or type(value) == "number") then
      put.add(parent, "description." .. key, value, record, at, size)
    end
  end
end

local function add_description(put, parent, item, block, record)
  local found, values = descriptions.of(item), block.offset + 2
  for _, element in ipairs(found and tables.descriptions.elements or {}) do
    if item.subindex == 0 then
      add_element(put, parent, found, element, record, values + element.offset, element.size)
    elseif item.subindex == element.number then
      add_element(put, parent, found, element, record, values, #block.raw)
    end
  end
end

local function add_texts(put, parent, item, block, record)
  local entries = descriptions.entries(item) or {}
  for number, entry in ipairs(entries) do
    local size = math.floor(#block.raw / #entries)
    put.add(parent, "description.text", entry, record, block.offset + 2 + (number - 1) * size, size)
  end
end

--- Adds what the values of a parameter describe, where they do.
-- @param item the parameter; its values stand in `block` of `record`
function M.add(put, parent, item, block, record)
  if item.attribute == "description" then
    add_description(put, parent, item, block, record)
  elseif item.attribute == "text" then
    add_texts(put, parent, item, block, record)
  end
end

return M
