-- Answers what descriptions and texts say, a JSON object a line from stdin, a line of JSON each to stdout:
--   {"request": hex, "response": hex}   -> {"description", "texts", "en", "zh"} of its first parameter
-- The other side is tests/python/test_description.py.

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. here .. "/?.lua;" .. package.path

local described = require("described")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local parameter = require("ds47.profidrive.parameter")
local reader = require("ds47.support.bytes")
local words = require("ds47.report.formatting")

local function answer(question)
  local request = parameter.decode_request(reader.unhex(question.request))
  local response = parameter.decode_response(reader.unhex(question.response), request)
  local address, block = request.addresses[1], response.blocks[1]
  local item = {
    pnu = address.pnu, subindex = address.subindex, attribute = address.attribute_name,
    element_count = address.element_count, format = block.format_name, value_count = block.value_count,
    values = block.values,
    scaled = block.scaled,
  }
  if block.error then
    item.values = {}
  end
  return {
    description = described.of(item) or json.null, texts = described.texts(item) or json.null,
    en = words.parameter(item, false, "en"), zh = words.parameter(item, false, "zh"),
  }
end

for line in io.lines() do
  print(json.encode(answer(read_json(line))))
end
