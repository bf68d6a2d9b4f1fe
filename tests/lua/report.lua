-- Driver: results of an analysis as JSON in, reports as JSON out, under plain Lua.
--   lua tests/lua/report.lua IN.json OUT.json
-- IN is an array of {"kind": "statistics" | "report" | "csv" | "grouping", "result": {...},
-- "options": {...}}; OUT is an array of the texts. Nothing is judged here: the test that calls it compares.

local folder = arg[0]:match("^(.*)[/\\]tests[/\\]lua[/\\]") or "."
package.path = folder .. "/lua/?.lua;" .. package.path

local grouping = require("ds47.findings.grouping")
local json = require("ds47.support.json")
local unhex = require("ds47.support.bytes").unhex

-- Findings to diagnoses: the result has `told`, an array of {finding, device}.
local function group(result)
  local groups = grouping.new()
  for _, each in ipairs(result.told) do
    groups:add(each.finding, each.device)
  end
  return json.encode(json.array(groups:result()))
end

local KINDS = {
  grouping = group,
  statistics = require("ds47.report.statistics").text,
  report = require("ds47.report.text").report,
  csv = require("ds47.report.csv").report,
}

-- null is nil in a result.
local function without_null(item)
  for key, value in pairs(item) do
    if value == json.null then
      item[key] = nil
    elseif type(value) == "table" then
      without_null(value)
    end
  end
  return item
end

-- {"float": "30.0"} is a float of the arguments of a finding, which keeps its point.
local function with_points(item)
  for key, value in pairs(item) do
    if type(value) == "table" then
      item[key] = value.float and json.raw(value.float) or with_points(value)
    end
  end
  return item
end

-- A side of a relation has the bytes of its sender, and on PROFIBUS those of the receiver as well.
local function with_source(side, receiver)
  local station, other = side.mac:match("^dp(%d+)$"), receiver.mac:match("^dp(%d+)$")
  if station then
    side.source, side.frame_id = string.char(tonumber(station), tonumber(other)), 0
  else
    side.source = side.mac:gsub("%x%x:?", function(digits)
      return string.char(tonumber(digits:sub(1, 2), 16))
    end)
  end
end

-- Values with texts are keys of a row, and of what a list says: numbers, which JSON has no keys of.
local function with_values(item)
  for _, holder in ipairs({ item.listed or {}, item }) do
    for _, key in ipairs({ "values_en", "values_zh", "told" }) do
      local texts = {}
      for value, text in pairs(holder[key] or {}) do
        texts[tonumber(value)] = text
      end
      holder[key] = holder[key] and texts
    end
  end
end

-- Messages and blocks of diagnosis are bytes in a result, and hexadecimal digits in JSON; arguments keep the
-- point of a float.
local function as_result(result)
  for _, each in ipairs(result.transactions) do
    each.request, each.response = each.request and unhex(each.request), each.response and unhex(each.response)
    for _, item in ipairs(each.parameters or {}) do with_values(item) end
    for _, item in ipairs(each.items or {}) do item.value = item.value and unhex(item.value) end
  end
  for _, each in ipairs(result.connections or {}) do
    each.client_tsap = each.client_tsap and unhex(each.client_tsap)
    each.server_tsap = each.server_tsap and unhex(each.server_tsap)
  end
  for _, each in ipairs(result.bus and result.bus.stations or {}) do
    local blocks = each.diagnosis and each.diagnosis.blocks or {}
    for number, block in ipairs(blocks) do blocks[number] = unhex(block) end
  end
  for _, each in ipairs(result.relations or {}) do
    with_source(each.output, each.input)
    with_source(each.input, each.output)
  end
  for _, key in ipairs({"findings", "diagnoses"}) do
    for _, each in ipairs(result[key] or {}) do
      each.args, each.corrected = with_points(each.args), each.corrected and unhex(each.corrected)
    end
  end
  return result
end

local input = assert(io.open(arg[1], "rb"))
local jobs = json.decode(input:read("*a"))
input:close()

local texts = {}
for i, job in ipairs(jobs) do
  texts[i] = KINDS[job.kind](as_result(without_null(job.result)), without_null(job.options))
end

local output = assert(io.open(arg[2], "wb"))
output:write(json.encode(json.array(texts)), "\n")
output:close()
