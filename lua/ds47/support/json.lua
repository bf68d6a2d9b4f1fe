-- JSON, as far as the vectors, the drivers of the tests and a dump of a result need it: objects, arrays,
-- UTF-8. What a result looks like as JSON is decided elsewhere.

local entries = require("ds47.support.later").entries
local numbers = require("ds47.support.numbers")

local byte, char, find, format, gsub = string.byte, string.char, string.find, string.format, string.gsub
local match, sub = string.match, string.sub
local concat, floor = table.concat, math.floor

local M = {}

--- Stands for null: nil has no place in a table.
M.null = setmetatable({}, {__tostring = function() return "null" end})

local Array, Raw = {}, {}

--- Marks a table as an array, so that it stays one when it is empty. Returns the table.
function M.array(items)
  return setmetatable(items, Array)
end

--- A text that is JSON already and is written as it stands, such as a float with its point.
function M.raw(text)
  return setmetatable({text = text}, Raw)
end

--- A float as JSON: 10.0 is not 10. Strings (NaN and the infinities) pass.
function M.float(number)
  return type(number) == "number" and M.raw(numbers.float_text(number)) or number
end

--- A byte of Latin-1 -> how a string of JSON has it where it does not stand for itself.
M.ESCAPES = entries(function(character) return format("\\u%04x", byte(character)) end)
for character, escape in pairs({
  ['"'] = '\\"', ["\\"] = "\\\\", ["\b"] = "\\b", ["\f"] = "\\f", ["\n"] = "\\n", ["\r"] = "\\r",
  ["\t"] = "\\t",
}) do
  M.ESCAPES[character] = escape
end

--- A text as a string of JSON.
function M.quoted(text)
  return '"' .. gsub(text, '[%z\1-\31\\"]', M.ESCAPES) .. '"'
end

local quoted = M.quoted

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
    out[#out + 1] = quoted(key) .. ":"
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
    out[#out + 1] = quoted(value)
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

local function utf8(code)
  if code < 128 then return char(code) end
  local tail = char(128 + code % 64)
  code = floor(code / 64)
  if code < 32 then return char(192 + code) .. tail end
  tail = char(128 + code % 64) .. tail
  code = floor(code / 64)
  if code < 16 then return char(224 + code) .. tail end
  return char(240 + floor(code / 64)) .. char(128 + code % 64) .. tail
end

local LITERAL = {b = "\b", f = "\f", n = "\n", r = "\r", t = "\t"}

local function surrogates(high, low)
  return utf8((tonumber(high, 16) - 0xD800) * 1024 + tonumber(low, 16) - 0xDC00 + 0x10000)
end

local function unescape(text)
  if not find(text, "\\", 1, true) then return text end
  text = gsub(text, "\\\\", "\\u005c") -- so that every other backslash begins an escape
  text = gsub(text, "\\u([dD][89aAbB]%x%x)\\u([dD][c-fC-F]%x%x)", surrogates)
  text = gsub(text, "\\([^u])", function(letter) return LITERAL[letter] or letter end)
  return (gsub(text, "\\u(%x%x%x%x)", function(digits) return utf8(tonumber(digits, 16)) end))
end

local function skip(text, at)
  return find(text, "[^ \t\r\n]", at) or #text + 1
end

local function wrong(text, at)
  error(format("JSON: unexpected %s at byte %d", at > #text and "end" or sub(text, at, at), at), 0)
end

local function take_string(text, at)
  local stop = at
  repeat
    stop = find(text, '["\\]', stop + 1)
    if not stop then wrong(text, #text + 1) end
    local closes = byte(text, stop) == 34
    if not closes then stop = stop + 1 end -- what stands behind a backslash closes nothing
  until closes
  return unescape(sub(text, at + 1, stop - 1)), stop + 1
end

local take -- forward: values nest

-- Behind an item: where the next one begins; nil, and what follows, where `close` stands.
local function behind(text, at, close)
  at = skip(text, at)
  local mark = sub(text, at, at)
  if mark == close then return nil, at + 1 end
  if mark ~= "," then wrong(text, at) end
  return at + 1
end

local function take_array(text, at)
  local items, count = M.array({}), 0
  at = skip(text, at + 1)
  if sub(text, at, at) == "]" then return items, at + 1 end
  local stop
  while at do
    count = count + 1
    items[count], at = take(text, at)
    at, stop = behind(text, at, "]")
  end
  return items, stop
end

local function take_object(text, at)
  local object = {}
  at = skip(text, at + 1)
  if sub(text, at, at) == "}" then return object, at + 1 end
  local key, stop
  while at do
    at = skip(text, at)
    if byte(text, at) ~= 34 then wrong(text, at) end
    key, at = take_string(text, at)
    at = skip(text, at)
    if sub(text, at, at) ~= ":" then wrong(text, at) end
    object[key], at = take(text, at + 1)
    at, stop = behind(text, at, "}")
  end
  return object, stop
end

local WORDS = {["true"] = true, ["false"] = false, null = M.null}

function take(text, at)
  at = skip(text, at)
  local mark = sub(text, at, at)
  if mark == '"' then return take_string(text, at) end
  if mark == "{" then return take_object(text, at) end
  if mark == "[" then return take_array(text, at) end
  local token = match(text, "^[%w+.-]+", at)
  local value = token and WORDS[token]
  if value == nil then value = token and tonumber(token) end
  if value == nil then wrong(text, at) end
  return value, at + #token
end

--- The value that a JSON text holds; null is M.null. Raises an error where the text is none.
function M.decode(text)
  local value, at = take(text, 1)
  at = skip(text, at)
  if at <= #text then wrong(text, at) end
  return value
end

return M
