-- Descriptions and texts of parameters in words: what stands in a line instead of their 46 bytes.
-- Python: ds47.report.descriptions. What the bytes mean is in ds47.profidrive.description.

local arrays = require("ds47.support.arrays")
local description = require("ds47.profidrive.description")
local formats = require("ds47.profidrive.formats")
local naming = require("ds47.profidrive.naming")
local tables = require("ds47.spec.tables")

local append, mapped, format = arrays.append, arrays.mapped, string.format

local M = {}

--- The description that the values of a parameter are; nil where they are none.
-- The elements of PKW, which has no number of elements, are those of an older profile.
function M.of(item)
  if item.attribute ~= "description" or item.element_count == nil or not item.values[1] then return nil end
  return description.describe(item.subindex, item.format, item.values)
end

--- How many values there are, more than are shown where the end of the record is missing; a string is one.
function M.stated(item)
  local row = tables.formats[formats.code_of(item.format)]
  return row and not row.whole and item.value_count or #item.values
end

--- The entries of a text array that the values of a parameter are; nil where they are none.
function M.entries(item)
  if item.attribute ~= "text" or item.element_count == nil or not item.values[1]
    or M.stated(item) > #item.values then
    return nil
  end
  return description.texts(item.format, item.values)
end

--- A limit or a factor as a report shows it; `format_name` of it.
function M.number(value, format_name)
  if value == nil then return "" end
  return type(value) == "string" and value or formats.number_text(value, format_name)
end

-- What needs no words of a language.
local function plain(item, family, quoted)
  local found = {}
  local function add(text) found[#found + 1] = text end
  if item.name then add(quoted(item.name)) end
  if item.type then
    add(item.type .. (item.elements and item.elements > 0 and format("[%d]", item.elements) or ""))
  end
  if item.unit then add(item.unit) end
  if item.low or item.high then
    add(M.number(item.low, item.limit_format) .. ".." .. M.number(item.high, item.limit_format))
  end
  if item.factor and item.factor ~= 1 then add("* " .. M.number(item.factor, "Float32")) end
  if item.full_scale then
    local whole = item.reference and item.reference > 0 and naming.spelling(item.reference, family) or "100 %"
    add(format("0x%04X = %s", item.full_scale, whole))
  end
  return found
end

-- What its bits say, where it is not what they say of most parameters: the keys of words.
local function marks(item)
  local found = {}
  if item.writable == false then found[1] = "description_read_only" end
  if item.text_array then found[#found + 1] = "description_texts" end
  if item.changed then found[#found + 1] = "description_changed" end
  if item.reset_only then found[#found + 1] = "description_reset" end
  return found
end

--- What a description or a text says: an array of texts; nil where the values say it themselves.
-- @param words the module formatting.lua, which has the language
function M.parts(item, words, lang)
  local described = M.of(item)
  if not described then
    local entries = M.entries(item)
    return entries and mapped(entries, words.quoted)
  end
  local found = plain(described, item.family, words.quoted)
  append(found, mapped(marks(described), function(key) return words.say(lang, key) end))
  return found[1] and found or nil
end

--- Whether an attribute is one of these two.
function M.is_about(attribute) return attribute == "description" or attribute == "text" end

return M
