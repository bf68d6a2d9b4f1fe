-- Values as JSON text: objects, arrays, UTF-8. What a result looks like as JSON is decided elsewhere; nothing
-- reads JSON here.

local entries = require("ds47.support.later").entries
local numbers = require("ds47.support.numbers")

local byte, format, gsub, concat = string.byte, string.format, string.gsub, table.concat

local M = {}

--- Stands for null: nil has no place in a table.
M.null = setmetatable({}, {__tostring = function() return "null" end})

local Array, Raw = {}, {}

--- Marks a table as an array, so that it stays one when it is empty. Returns the table.
function M.array(items) return setmetatable(items, Array) end

--- A text that is JSON already and is written as it stands, such as a float with its point.
function M.raw(text) return setmetatable({text = text}, Raw) end

--- A float as JSON: 10.0 is not 10. Strings (NaN and the infinities) pass.
function M.float(number) return type(number) == "number" and M.raw(numbers.float_text(number)) or number end

--- A byte of Latin-1 -> how a string of JSON has it where it does not stand for itself.
M.ESCAPES = entries(function(character) return format("\\u%04x", byte(character)) end)
for character, escape in pairs({
  ['"'] = '\\"', ["\\"] = "\\\\", ["\b"] = "\\b", ["\f"] = "\\f", ["\n"] = "\\n", ["\r"] = "\\r",
  ["\t"] = "\\t",
}) do
  M.ESCAPES[character] = escape
end

--- A text as a string of JSON.
function M.quoted(text) return '"' .. gsub(text, '[%z\1-\31\\"]', M.ESCAPES) .. '"' end

local put -- forward: values nest

local function put_array(items, out)
  out[#out + 1] = "["
  for i = 1, items.n or #items do
    if i > 1 then out[#out + 1] = "," end
    put(items[i], out)
  end
  out[#out + 1] = "]"
end

local function put_object(object, out)
  local keys = {}
  for key in pairs(object) do keys[#keys + 1] = key end
  table.sort(keys)
  out[#out + 1] = "{"
  for i, key in ipairs(keys) do
    if i > 1 then out[#out + 1] = "," end
    out[#out + 1] = M.quoted(key) .. ":"
    put(object[key], out)
  end
  out[#out + 1] = "}"
end

local function put_table(value, out)
  local kind = getmetatable(value)
  if kind == Raw then
    out[#out + 1] = value.text
  elseif kind == Array or value[1] ~= nil then
    put_array(value, out)
  else
    put_object(value, out)
  end
end

function put(value, out)
  local kind = type(value)
  if value == nil or value == M.null then
    out[#out + 1] = "null"
  elseif kind == "table" then
    put_table(value, out)
  elseif kind == "string" then
    out[#out + 1] = M.quoted(value)
  elseif kind == "number" then
    out[#out + 1] = numbers.text(value)
  else
    out[#out + 1] = tostring(value)
  end
end

--- A value as JSON on one line, keys of objects in order. A table with [1], or made by array(), is an array
-- (of `n` items if it has that field); an empty table without either is an object.
function M.encode(value)
  local out = {}
  put(value, out)
  return concat(out)
end

return M
