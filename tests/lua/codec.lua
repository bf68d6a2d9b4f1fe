-- Answers questions about the codec, one JSON object a line from stdin, one line of JSON each to stdout; the
-- other side is tests/python/test_lua_codec.py.
--   {"ask": "request" | "response", "hex", "request" (hex or null), "options"}   the whole decoded message
--   {"ask": "error_text", "code", "lang", "vendor_id"}, {"ask": "status_text", "status", "lang"}
--   {"ask": "number", "hex", "as": "float32" | "float64" | "signed64" | "unsigned64"}

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. here .. "/?.lua;" .. package.path

local formatting = require("ds47.report.formatting")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local numbers = require("ds47.support.numbers")
local parameter = require("ds47.profidrive.parameter")
local reader = require("ds47.support.bytes")
local spec = require("ds47.spec.lookup")
local status = require("ds47.spec.statuses")

local function known(value)
  if value == json.null then return nil end
  return value
end

local function or_null(value)
  if value == nil then return json.null end
  return value
end

-- Values as JSON holds them; those of a float format are floats even where they look whole.
local function shown(values, float)
  local items = json.array({})
  for i, value in ipairs(values or {}) do items[i] = float and json.float(value) or value end
  return values and items or json.null
end

local function texts(values, block, scaled)
  local items = json.array({})
  for i, value in ipairs(values or {}) do
    items[i] = formatting.value(value, block.format_name, scaled)
  end
  return items
end

local function show_error(failure)
  if not failure then return json.null end
  return {code = or_null(failure.code), info = or_null(failure.info), words = json.array(failure.words)}
end

local function show_block(block)
  return {
    format = block.format, format_name = or_null(block.format_name), value_count = block.value_count,
    values = shown(block.values, block.float), scaled = shown(block.scaled, block.scaled_float),
    texts = texts(block.values, block), scaled_texts = texts(block.scaled, block, true),
    error = show_error(block.error), raw = reader.hex(block.raw), pad = reader.hex(block.pad),
    offset = block.offset, meaning = or_null(block.meaning),
  }
end

local function show(message)
  local blocks = json.array({})
  for i, block in ipairs(message.blocks) do blocks[i] = show_block(block) end
  for _, flaw in ipairs(message.flaws) do
    flaw.message = spec.fill(require("ds47.spec.tables").rules[flaw.rule].message, flaw.args)
  end
  return {
    request_reference = or_null(message.request_reference), axis = or_null(message.axis),
    request_id = or_null(message.request_id), response_id = or_null(message.response_id),
    parameter_count = or_null(message.parameter_count), length = message.length,
    addresses = json.array(message.addresses or {}), blocks = blocks, flaws = json.array(message.flaws),
    rest = reader.hex(message.rest), shaped = message.shaped, operation = or_null(message.operation),
  }
end

local answers = {}

function answers.request(question)
  return show(parameter.decode_request(reader.unhex(question.hex), question.options))
end

function answers.response(question)
  local request = known(question.request)
  request = request and parameter.decode_request(reader.unhex(request))
  return show(parameter.decode_response(reader.unhex(question.hex), request, question.options))
end

function answers.error_text(question)
  return {
    text = spec.error_text(question.code, question.lang, known(question.vendor_id)),
    info = spec.error_info_meaning(question.code),
  }
end

function answers.status_text(question)
  return {text = status.status_text(question.status, question.lang), hex = status.status_hex(question.status)}
end

function answers.number(question)
  local data, as = reader.unhex(question.hex), question.as
  if as == "float32" or as == "float64" then return {value = json.float(numbers[as](data, 0))} end
  return {value = as == "signed64" and numbers.signed64(data, 0) or numbers.unsigned(data, 0, 8)}
end

for line in io.lines() do
  local question = read_json(line)
  io.write(json.encode(answers[question.ask](question)), "\n")
end
