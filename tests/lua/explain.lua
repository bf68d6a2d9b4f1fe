-- Answers what statuses and error numbers mean, and how a request is copied: one JSON object a line from
-- stdin, one line of JSON each to stdout; the other side is tests/python/test_lua_explain.py.
--   {"status": 3733910784, "lang": "en", "width": 100}, {"error": 107, "vendor": 42, ...}: the lines
--   {"request": hex}: {scl, encode}; {"pkw": hex, "layout": "uss"}: the command

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. here .. "/?.lua;" .. package.path

local explanation = require("ds47.report.explanation")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local meanings = require("ds47.explain.meanings")
local reader = require("ds47.support.bytes")
local suggest = require("ds47.diagnosis.suggest")

local function answer(question)
  if question.pkw then
    return suggest.pkw_command(reader.unhex(question.pkw), question.layout) or json.null
  end
  if question.request then
    local data = reader.unhex(question.request)
    return { scl = suggest.scl(data), encode = suggest.encode_command(data) or json.null }
  end
  local found
  if question.status then
    found = { meanings.status(question.status, question.lang) }
  else
    local vendor = question.vendor ~= json.null and question.vendor or nil
    found = meanings.error(question.error, question.lang, vendor)
  end
  return explanation.lines(found, question.lang, question.width)
end

for line in io.lines() do
  io.write(json.encode(answer(read_json(line))), "\n")
end
