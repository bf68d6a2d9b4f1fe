-- Descriptions and texts as the JSON of Python has them: for the programs here that write JSON.

local descriptions = require("ds47.report.descriptions")
local json = require("ds47.support.json")

local M = {}

local KEYS = "identifier type writable text_array changed reset_only array elements factor quantity "
  .. "conversion unit name low high extension reference normalisation full_scale"
local FLOATS = { factor = "Float32" }

--- A description of ds47.profidrive.description as JSON has it; nil of nil.
function M.object(found)
  if found == nil then
    return nil
  end
  local result = {}
  for key in KEYS:gmatch("%S+") do
    local value, name = found[key], FLOATS[key] or key:find("^[lh]") and found.limit_format
    if value == nil then
      result[key] = json.null
    elseif type(value) == "number" then
      local text = name and descriptions.number(value, name) or string.format("%.0f", value)
      result[key] = json.raw(text)
    else
      result[key] = value
    end
  end
  return result
end

--- What the values of a parameter describe; nil where they describe nothing.
function M.of(item)
  return M.object(descriptions.of(item))
end

--- Its texts; nil where it has none.
function M.texts(item)
  local found = descriptions.entries(item)
  return found and json.array(found)
end

return M
