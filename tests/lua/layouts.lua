-- Responses whose requests remember their layouts, against those of requests that remember nothing: responses
-- of all formats by chance, the same again with other values, and damaged ones. Both have to say the same.
--   lua tests/lua/layouts.lua
-- Prints how many responses were compared, and how many had a layout. Exits with 1 where one differs.

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. package.path

local parameter = require("ds47.profidrive.parameter")
local tables = require("ds47.spec.tables")

local char, random = string.char, math.random

local DIALECTS = {
  {}, {legacy_g120_formats = true}, {profile_v3_types = true},
}
local KINDS = { -- request id, and the response ids that are seen
  {0x01, {0x01, 0x01, 0x81}}, {0x02, {0x02, 0x82}}, {0x51, {0x51, 0xD1}}, {0x42, {0x42}},
}
local CONVERSATIONS, RESPONSES = 300, 24
local ERROR = 0x44
local SAID = {
  "request_reference", "response_id", "axis", "parameter_count", "flaws", "rest", "length", "shaped",
  "blocks", "format", "value_count", "values", "scaled", "error", "raw", "offset", "pad", "meaning",
  "format_name", "float", "scaled_float", "rule", "args", "code", "info", "words", "need", "what", "count",
  "size",
}

local codes = {}
for code in pairs(tables.formats) do codes[#codes + 1] = code end
table.sort(codes)
codes[#codes + 1] = 0x77 -- which no format has

local function show(value)
  if type(value) ~= "table" then
    return value == 0 and 1 / value < 0 and "-0" or tostring(value)
  end
  local parts = {}
  for _, key in ipairs(SAID) do
    if value[key] ~= nil then parts[#parts + 1] = key .. "=" .. show(value[key]) end
  end
  for number = 1, #value do parts[#parts + 1] = show(value[number]) end
  return "{" .. table.concat(parts, ",") .. "}"
end

local function bytes(count)
  local found = {}
  for number = 1, count do found[number] = char(random(0, 255)) end
  return table.concat(found)
end

local function block(code, count)
  local codec = code ~= ERROR and parameter.codec(code)
  local raw = bytes(count * (codec and codec.size or 2))
  return char(code, count) .. raw .. (#raw % 2 == 1 and "\0" or "")
end

-- A request, and what makes responses to it: always the same formats, and mostly no error.
local function conversation()
  local kind, count = KINDS[random(#KINDS)], random(1, 4)
  local request, formats, counts = char(random(1, 255), kind[1], random(0, 3), count), {}, {}
  for number = 1, count do
    request = request .. char(0x10, 1) .. bytes(4)
    formats[number], counts[number] = codes[random(#codes)], random(1, 3)
  end
  return request, function()
    local id = kind[2][random(#kind[2])]
    local response = request:sub(1, 1) .. char(id) .. request:sub(3, 4)
    for number = 1, id == 0x02 and 0 or count do
      response = response .. block(random(20) == 1 and ERROR or formats[number], counts[number])
    end
    return response
  end
end

local function damaged(data)
  local chance, at = random(5), random(#data)
  if chance == 1 then
    return data:sub(1, at - 1) .. bytes(1) .. data:sub(at + 1)
  elseif chance == 2 then
    return data:sub(1, at)
  elseif chance == 3 then
    return data .. bytes(random(2))
  end
  return data
end

math.randomseed(47)
local compared, known = 0, 0
for number = 1, CONVERSATIONS do
  local options = DIALECTS[number % #DIALECTS + 1]
  local request, respond = conversation()
  local remembered = parameter.remembering(options)(request)
  local plain = parameter.decode_request(request, options)
  for _ = 1, RESPONSES do
    local data = damaged(respond())
    local found = parameter.decode_response(data, remembered, options)
    local got, wanted = show(found), show(parameter.decode_response(data, plain, options))
    compared, known = compared + 1, known + (found.layout and 1 or 0)
    if got ~= wanted then
      print(("conversation %d: %s, not %s"):format(number, got, wanted))
      os.exit(1)
    end
  end
end
print(compared, known)
