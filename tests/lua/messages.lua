-- Every case of tests/vectors/messages.json: messages, formats, texts of error numbers, vendors and statuses.
--   lua tests/lua/messages.lua tests/vectors/messages.json
-- Prints a line for every difference, and last how many cases of each part were run. Exits with 1 where there
-- is a difference.

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. here .. "/?.lua;" .. package.path

local formats = require("ds47.profidrive.formats")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local parameter = require("ds47.profidrive.parameter")
local reader = require("ds47.support.bytes")
local spec = require("ds47.spec.lookup")
local status = require("ds47.spec.statuses")
local tables = require("ds47.spec.tables")

local file = assert(io.open(arg[1], "rb"))
local vectors = read_json(file:read("*a"))
file:close()

local problems = 0

local function problem(...)
  problems = problems + 1
  print(string.format(...))
end

local function same(id, what, got, want)
  if want == json.null then want = nil end
  if got == want and (want ~= 0 or 1 / got == 1 / want) then return end -- 0.0 is not -0.0
  problem("%s: %s is %s, not %s", id, what, tostring(got), tostring(want))
end

-- Messages ------------------------------------------------------------------------------------------------

local function asked(case)
  return case.request and parameter.decode_request(reader.unhex(case.request))
end

local function decode(case)
  local data = reader.unhex(case.hex)
  if case.kind == "request" then return parameter.decode_request(data, case.options) end
  return parameter.decode_response(data, asked(case), case.options)
end

local function compare_list(id, what, got, want)
  if want == json.null then return same(id, what, got, nil) end
  if not got then return problem("%s: no %s", id, what) end
  same(id, "number of " .. what, #got, #want)
  for i = 1, #want do same(id, what .. " " .. i, got[i], want[i]) end
end

local function compare_error(id, got, want)
  if want == json.null then return same(id, "error", got, nil) end
  same(id, "error code", got and got.code, want.code)
  same(id, "error info", got and got.info, want.info)
end

local function compare_block(id, block, want)
  same(id, "format", block.format_name, want.format)
  same(id, "value_count", block.value_count, want.value_count)
  compare_list(id, "values", block.values, want.values)
  compare_list(id, "scaled", block.scaled, want.scaled)
  compare_error(id, block.error, want.error)
  compare_list(id, "words", block.error and block.error.words, want.words)
  same(id, "offset of the block", block.offset, want.offset)
end

local function compare_parameters(id, addresses, message, parameters)
  local number_of_addresses, number_of_blocks = 0, 0
  for i, want in ipairs(parameters) do
    local address, block = addresses[i], message.blocks[i]
    if want.pnu ~= json.null then number_of_addresses = i end
    if want.value_count ~= json.null then number_of_blocks = i end
    same(id, "attribute", address and address.attribute_name, want.attribute)
    for _, key in ipairs({"element_count", "pnu", "subindex"}) do
      same(id, key, address and address[key], want[key])
    end
    if block and want.value_count ~= json.null then compare_block(id, block, want) end
  end
  same(id, "number of blocks", #message.blocks, number_of_blocks)
  same(id, "number of addresses", #addresses, number_of_addresses)
end

local function compare_findings(id, flaws, want)
  same(id, "number of findings", #flaws, #want.findings)
  for i, finding in ipairs(want.findings) do
    local flaw = flaws[i] or {}
    local args = flaw.args or {}
    same(id, "rule", flaw.rule, finding.rule)
    same(id, finding.rule .. " offset", flaw.offset, finding.offset)
    for name, value in pairs(want.args[i]) do same(id, finding.rule .. " " .. name, args[name], value) end
    for name, value in pairs(args) do same(id, finding.rule .. " " .. name, value, want.args[i][name]) end
  end
end

local HEADER = {
  "request_reference", "request_id", "response_id", "axis", "parameter_count", "operation", "shaped",
}

local function check_message(case)
  local id, want, message = case.id, case.expect, decode(case)
  local request = case.kind == "request" and message or asked(case)
  for _, key in ipairs(HEADER) do
    if want[key] ~= nil then same(id, key, message[key], want[key]) end
  end
  same(id, "length", message.length, #case.hex / 2)
  same(id, "rest", reader.hex(message.rest), want.rest)
  compare_findings(id, message.flaws, want)
  compare_parameters(id, request and request.addresses or {}, message, want.parameters)
end

-- Formats -------------------------------------------------------------------------------------------------

local function check_format(case)
  local id = ("format 0x%02X"):format(case.format)
  local row, raw = tables.formats[case.format], reader.unhex(case.raw)
  if not row then return problem("%s is not in the table", id) end
  for _, key in ipairs({"name", "size", "unit"}) do
    if row[key] ~= (case[key] ~= json.null and case[key] or nil) then
      problem("%s: table says %s %s, vector says %s", id, key, tostring(row[key]), tostring(case[key]))
    end
  end
  local block = string.char(case.format, case.value_count) .. raw .. ("\0"):rep(#raw % 2)
  local address = string.char(0x10, case.value_count, 0x03, 0x9A, 0, 0)
  local zero = case.value_count == 0 and 1 or 0 -- a change of no value: DS310
  for number, message in ipairs({
    parameter.decode_response("\1\1\1\1" .. block), parameter.decode_request("\1\2\1\1" .. address .. block),
  }) do
    same(id, "number of findings", #message.flaws, (number - 1) * zero)
    compare_list(id, "values", message.blocks[1].values, case.values)
    compare_list(id, "scaled", message.blocks[1].scaled, case.scaled)
  end
  if not formats.codec(case.format) then problem("%s has no codec", id) end
end

-- Texts ---------------------------------------------------------------------------------------------------

local function compare_text(name, lang, got, case)
  if got ~= case[lang] then
    problem("%s, %s): table says %s, vector says %s", name, lang, tostring(got), case[lang])
  end
end

local function check_error(case)
  local vendor = case.vendor_id ~= json.null and case.vendor_id or nil
  local name = ("error 0x%02X (vendor %s"):format(case.code, tostring(vendor))
  for _, lang in ipairs({"en", "zh"}) do
    compare_text(name, lang, spec.error_text(case.code, lang, vendor), case)
  end
  local info = spec.error_info_meaning(case.code)
  if info ~= case.info then
    problem("error 0x%02X: table says info is %s, vector says %s", case.code, info, case.info)
  end
end

local vendor_of = {}
for _, vendor in ipairs(tables.vendors) do vendor_of[vendor.name] = vendor end

local function check_vendor(case)
  local name = ("error 0x%02X (%s"):format(case.code, case.vendor)
  local vendor = vendor_of[case.vendor] or {errors = {}}
  local row = vendor.errors[case.code]
  same(case.vendor, "vendor id", vendor.id, case.vendor_id)
  for _, lang in ipairs({"en", "zh"}) do
    local args = row and {code = case.code, above = case.code - (row.code or case.code)}
    compare_text(name, lang, row and spec.fill(row[lang], args), case)
  end
end

local function check_status(case)
  for _, lang in ipairs({"en", "zh"}) do
    local text = status.status_text(tonumber(case.status, 16), lang)
    compare_text("status " .. case.status .. " (PNIOStatus", lang, text, case)
  end
end

local PARTS = {
  {"messages", check_message}, {"formats", check_format}, {"errors", check_error},
  {"vendors", check_vendor}, {"statuses", check_status},
}
local ran = {}
for _, part in ipairs(PARTS) do
  local name, check = part[1], part[2]
  local count = 0
  for _, case in ipairs(vectors[name] or {}) do
    check(case)
    count = count + 1
  end
  ran[#ran + 1] = count .. " " .. name
end
print(table.concat(ran, ", ") .. ", " .. problems .. " differences")
os.exit(problems == 0 and #vectors.messages > 0 and 0 or 1)
