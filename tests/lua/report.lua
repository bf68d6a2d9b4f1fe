-- Driver: results of an analysis as JSON in, reports as JSON out, under plain Lua.
--   lua tests/lua/report.lua IN.json OUT.json
-- IN is an array of {"kind": "statistics" | "report" | "csv" | "parameters" | "advice",
-- "result": {...}, "options": {...}}; OUT is an array of the texts. Nothing is judged here: the test that
-- calls it compares.

local folder = arg[0]:match("^(.*)[/\\]tests[/\\]lua[/\\]") or "."
package.path = folder .. "/lua/?.lua;" .. folder .. "/tests/lua/?.lua;" .. package.path

local json = require("ds47.support.json")
local read_json = require("json_reader")
local sentences = require("ds47.report.sentences")
local tables = require("ds47.spec.tables")
local unhex = require("ds47.support.bytes").unhex
local words = require("ds47.report.formatting")

-- The parameters of each transaction, as the tree of a packet has them.
local function parameters(result, options)
  local lines = {}
  for _, item in ipairs(result.transactions) do
    for _, each in ipairs(item.parameters) do
      lines[#lines + 1] = words.parameter(each, item.operation == "change", options.lang)
    end
  end
  return table.concat(lines, "\n")
end

-- What each finding advises.
local function advices(result, options)
  local lines = {}
  for number, item in ipairs(result.findings) do
    lines[number] = sentences.advice(tables.rules[item.rule], item.args, options.lang)
  end
  return table.concat(lines, "\n")
end

local KINDS = {
  advice = advices,
  statistics = require("ds47.report.statistics").text,
  report = require("ds47.report.text").report,
  csv = require("ds47.report.csv").report,
  parameters = parameters,
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

-- Messages are bytes in a result, and hexadecimal digits in JSON; arguments keep the point of a float.
local function as_result(result)
  for _, each in ipairs(result.transactions) do
    each.request, each.response = each.request and unhex(each.request), each.response and unhex(each.response)
    for _, item in ipairs(each.parameters or {}) do with_values(item) end
  end
  for _, each in ipairs(result.findings) do each.args = with_points(each.args) end
  return result
end

local input = assert(io.open(arg[1], "rb"))
local jobs = read_json(input:read("*a"))
input:close()

local texts = {}
for i, job in ipairs(jobs) do
  texts[i] = KINDS[job.kind](as_result(without_null(job.result)), without_null(job.options))
end

local output = assert(io.open(arg[2], "wb"))
output:write(json.encode(json.array(texts)), "\n")
output:close()
