-- Decodes frames of PROFIBUS, one in hexadecimal digits a line from stdin, and writes each as a line of JSON
-- as the analyzer has it, with the words of its flaws in Chinese, and with all its words in both languages;
-- the other side is tests/python/test_profibus.py.

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. package.path

local dp = require("ds47.profibus.dp")
local json = require("ds47.support.json")
local ms1 = require("ds47.profibus.ms1")
local reader = require("ds47.support.bytes")
local shown = require("ds47.report.profibus")
local statuses = require("ds47.spec.statuses")
local telegram = require("ds47.profibus.telegram")
local words = require("ds47.spec.profibus")

local RECORDS = {record = true, alarm = true, resource = true, ms2 = true}

local function or_null(value)
  if value == nil then return json.null end
  return value
end

local function mapped(items, change)
  local found = json.array({})
  for i, item in ipairs(items) do found[i] = change(item) end
  return found
end

local function flaws(items)
  return mapped(items, function(flaw)
    return {
      kind = flaw.kind, offset = flaw.offset, text = words.flaw_text(flaw, "en"),
      zh = words.flaw_text(flaw, "zh"),
    }
  end)
end

local function same(item)
  return item
end

local function area(found)
  if not found then return json.null end
  return {length = found.length, words = found.words, consistent = found.consistent}
end

local content = {}

function content.diagnosis(found)
  local blocks = mapped(found.blocks, function(block)
    return {kind = block.kind, data = reader.hex(block.data)}
  end)
  return {
    flags = mapped(found.flags, same), master = or_null(found.master), ident = or_null(found.ident),
    blocks = blocks, flaws = flaws(found.flaws),
  }
end

function content.parameters(found)
  return {
    flags = mapped(found.flags, same), watchdog_ms = or_null(found.watchdog_ms), tsdr = or_null(found.tsdr),
    ident = or_null(found.ident), groups = or_null(found.groups), user = reader.hex(found.user),
    flaws = flaws(found.flaws),
  }
end

function content.configuration(found)
  local modules = mapped(found.modules, function(module)
    return {
      data = reader.hex(module.data), special = module.special, inputs = area(module.inputs),
      outputs = area(module.outputs), maker = reader.hex(module.maker), role = or_null(module.role),
    }
  end)
  return {
    ppo = or_null(found.ppo), pkw_consistent = or_null(found.pkw_consistent),
    input_length = found.input_length, output_length = found.output_length, modules = modules,
    flaws = flaws(found.flaws),
  }
end

function content.control(found)
  return {
    flags = mapped(found.flags, same), groups = or_null(found.groups), flaws = flaws(found.flaws),
  }
end

function content.exchange(found)
  return {
    [found.outputs and "outputs" or "inputs"] = reader.hex(found.data),
    wants_diagnosis = found.wants_diagnosis, flaws = flaws(found.flaws),
  }
end

local function message(item, service)
  if not RECORDS[service] then return json.null end
  local found = ms1.decode(item.du, item.request)
  return {
    kind = found.kind,
    ["function"] = found.code and words.function_text(found.code, item.request) or json.null,
    slot = or_null(found.slot), index = or_null(found.index), length = or_null(found.length),
    data = reader.hex(found.data), error_decode = or_null(found.error_decode),
    error_code_1 = or_null(found.error_code_1), error_code_2 = or_null(found.error_code_2),
    status = found.status and statuses.status_text(found.status) or json.null,
    not_ready = found.not_ready, flaws = flaws(found.flaws),
  }
end

local function document(item)
  local service, found = dp.service(item), dp.decode(item)
  return {
    sd = item.kind ~= "" and item.kind or json.null, length = #item.data, da = or_null(item.da),
    sa = or_null(item.sa), fc = or_null(item.fc),
    ["function"] = item.fc and words.control_text(item.fc) or json.null,
    request = or_null(item.request), fcb = or_null(item.fcb), fcv = or_null(item.fcv),
    dsap = or_null(item.dsap), ssap = or_null(item.ssap), du = reader.hex(item.du), fcs = or_null(item.fcs),
    service = service and words.service_text(service) or json.null,
    flaws = flaws(item.flaws), dp = found and content[found.kind](found) or json.null,
    ms1 = message(item, service), en = shown.summary(item, "en"), zh = shown.summary(item, "zh"),
  }
end

for line in io.lines() do
  io.write(json.encode(document(telegram.decode(reader.unhex(line)))), "\n")
end
