-- What values mean (lua/ds47/report/values.lua), of parameters on standard input, each in a line:
-- {pnu, family, values, subindex, format, told = [[value, text], ...]}; the answer is {en, zh}.

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. here .. "/?.lua;" .. package.path

local formatting = require("ds47.report.formatting")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local lookup = require("ds47.spec.lookup")

local function given(value)
  if value == nil then return json.null end
  return value
end

for text in io.lines() do
  local line = read_json(text)
  local texts
  for _, each in ipairs(line.value_texts) do
    texts = texts or {}
    texts[each[1]] = each[2]
  end
  local item = {
    pnu = line.pnu, subindex = line.subindex, attribute = "value", format = line.format, values = line.values,
    listed = lookup.parameter(line.pnu, line.family), value_texts = texts,
  }
  local en, zh = formatting.meaning(item, "en"), formatting.meaning(item, "zh")
  print(json.encode({ en = given(en), zh = given(zh) }))
end
