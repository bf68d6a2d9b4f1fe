-- Driver: results of an analysis as JSON in, reports as JSON out, under plain Lua.
--   lua tests/lua/report.lua IN.json OUT.json
-- IN is an array of {"kind": "statistics" | "report" | "csv", "result": {...}, "options": {...}}; OUT is an
-- array of the texts. Nothing is judged here: the test that calls it compares.

local folder = arg[0]:match("^(.*)[/\\]tests[/\\]lua[/\\]") or "."
package.path = folder .. "/lua/?.lua;" .. package.path

local json = require("ds47.json")

local KINDS = {
  statistics = require("ds47.statistics").text,
  report = require("ds47.report_text").report,
  csv = require("ds47.report_csv").report,
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

local input = assert(io.open(arg[1], "rb"))
local jobs = json.decode(input:read("*a"))
input:close()

local texts = {}
for i, job in ipairs(jobs) do
  texts[i] = KINDS[job.kind](without_null(job.result), without_null(job.options))
end

local output = assert(io.open(arg[2], "wb"))
output:write(json.encode(json.array(texts)), "\n")
output:close()
