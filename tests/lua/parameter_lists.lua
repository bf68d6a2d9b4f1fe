-- Lists of a user (lua/ds47/parameters): the file named by the first argument, then questions on standard
-- input, each in a line: {pnu, vendor_id, device_id, values, format}; the answer is {name, unit, told =
-- {value: text}}. A file that is broken is answered with the number of its line, and nothing else.

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. here .. "/?.lua;" .. package.path

local catalogue = require("ds47.parameters.catalogue")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local naming = require("ds47.parameters.naming")
local parameters = require("ds47.parameters.table")

local file = assert(io.open(arg[1], "rb"))
local lists, line_number = parameters.read(file:read("*a"))
file:close()
if not lists then
  print(json.encode({ line = line_number }))
  return
end
naming.use(catalogue.new(lists))

local function given(value)
  if value == json.null then return nil end
  return value
end

local function or_null(value)
  if value == nil then return json.null end
  return value
end

for text in io.lines() do
  local line = read_json(text)
  local item = { pnu = line.pnu, attribute = "value", values = line.values, format = line.format }
  local found = naming.explained(item, given(line.vendor_id), given(line.device_id)) or {}
  local texts = {}
  for value, said in pairs(found.value_texts or {}) do texts[("%d"):format(value)] = said end
  print(json.encode({
    name = or_null(found.described and found.described.name), unit = or_null(found.unit),
    value_texts = next(texts) and texts or json.null,
  }))
end
