-- JSON text to values, for the programs here: what the plugin writes, it never reads.

local json = require("ds47.support.json")

local byte, char, find, gsub = string.byte, string.char, string.find, string.gsub
local format, match, sub, floor = string.format, string.match, string.sub, math.floor

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
  local items, count = json.array({}), 0
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

local WORDS = {["true"] = true, ["false"] = false, null = json.null}

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

--- The value that a JSON text holds; null is json.null. Raises an error where the text is none.
return function(text)
  local value, at = take(text, 1)
  at = skip(text, at)
  if at <= #text then wrong(text, at) end
  return value
end
