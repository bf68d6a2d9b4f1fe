-- Tells a dictionary what tests/python/test_lua_dictionary.py tells that of Python, and answers what it is
-- asked: JSON objects, a line each from stdin, a line of JSON for each question to stdout.
--   {"most": 6}                                                        a new dictionary
--   {"refused": ACCESS, "code"}, {"identified": ACCESS, "values"}      what a capture shows of drive objects
--   {"learn": ACCESS, "pnu", "subindex", "response": hex, "frame"}     a description
--   {"ask": ACCESS, "pnu", "vendor_id", "last", "response": hex}       a value: what it is told with

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. here .. "/?.lua;" .. package.path

local dictionary = require("ds47.profidrive.dictionary")
local drive_objects = require("ds47.profidrive.drive_objects")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local parameter = require("ds47.profidrive.parameter")
local reader = require("ds47.support.bytes")
local words = require("ds47.report.formatting")

local objects, known

local function given(item)
  return item ~= json.null and item or nil
end

local function access(item)
  return {
    device = item[1], record_index = item[2], slot = given(item[3]), subslot = given(item[4]),
    axis = given(item[5]),
  }
end

local function block(line)
  return parameter.decode_response(reader.unhex(line.response)).blocks[1]
end

local function said(each)
  return each and {each.value, each.frame} or json.null
end

local function ask(line)
  local value = block(line)
  local meaning, is_said = known:meaning(access(line.ask), line.pnu, given(line.vendor_id), given(line.last))
  local row = meaning.listed
  local item = {
    pnu = line.pnu, subindex = 0, attribute = "value", element_count = 0, listed = row,
    unit = dictionary.unit_of(row, value.format_name),
    format = value.format_name, values = value.values, scaled = value.scaled,
  }
  local told = dictionary.explained(item, meaning)
  item.unit, item.scaled, item.described = told.unit, told.scaled, told.described
  return {
    is_said = is_said, type = said(meaning.type), low = said(meaning.low), high = said(meaning.high),
    frames = item.described and item.described.frames or json.null, en = words.parameter(item, false, "en"),
    zh = words.parameter(item, true, "zh"),
  }
end

for text in io.lines() do
  local line = read_json(text)
  if line.most then
    objects = drive_objects.new()
    known = dictionary.new(objects, line.most)
  elseif line.refused then
    objects:refused(access(line.refused), line.code)
  elseif line.identified then
    objects:identified(access(line.identified), 7, line.values)
  elseif line.learn then
    local value = block(line)
    known:learn(access(line.learn), line.pnu, line.subindex, value.format_name, value.values, line.frame)
  else
    print(json.encode(ask(line)))
  end
end
