-- Answers what one change makes of a request, one JSON object a line from stdin, one line of JSON each to
-- stdout; the other side is tests/python/test_lua_repair.py.
--   {"request": hex, "errors": {"0": 5}, "known": [922], "formats": {"922": 6}, "options": {...}}: the repair
--   {"line": hex}: the readable line of a request
-- Parameters are numbered from 0 there, as in Python, and from 1 in Lua.

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. here .. "/?.lua;" .. package.path

local json = require("ds47.support.json")
local read_json = require("json_reader")
local notation = require("ds47.profidrive.notation")
local parameter = require("ds47.profidrive.parameter")
local reader = require("ds47.support.bytes")
local repair = require("ds47.diagnosis.repair")

local function by_number(object, shift)
  local items = {}
  for key, value in pairs(object) do items[tonumber(key) + shift] = value end
  return items
end

local function show(found)
  if not found then return json.null end
  return {
    rule = found.rule, what = found.what, request = reader.hex(found.request), args = found.args,
    number = found.number - 1,
  }
end

local function answer(question)
  if question.line then
    return notation.request_line(parameter.decode_request(reader.unhex(question.line))) or json.null
  end
  local request, known = reader.unhex(question.request), {}
  for _, pnu in ipairs(question.known) do known[pnu] = true end
  local formats = by_number(question.formats, 0)
  return show(repair.find(
    request, parameter.decode_request(request, question.options), by_number(question.errors, 1),
    function(pnu) return known[pnu] ~= nil end, function(pnu) return formats[pnu] end, question.options
  ))
end

for line in io.lines() do
  io.write(json.encode(answer(read_json(line))), "\n")
end
