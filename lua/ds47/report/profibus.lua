-- Frames of PROFIBUS in words: what stands at which byte, and what it means (Python: ds47.report.profibus).
--
-- Of single frames. Decoding is ds47.profibus; the record inside (DS47) and what a capture shows of a station
-- are not here.

local arrays = require("ds47.support.arrays")
local dp = require("ds47.profibus.dp")
local ms1 = require("ds47.profibus.ms1")
local of_row = require("ds47.spec.lookup").words
local status_text = require("ds47.spec.statuses").status_text
local tables = require("ds47.spec.tables")
local told = require("ds47.spec.profibus")
local words = require("ds47.report.formatting")

local floor, format = math.floor, string.format
local joined, say = words.joined, words.say

local M = {}

-- The services whose data is a message of MS1 or MS2.
local RECORDS = { record = true, alarm = true, resource = true, ms2 = true }
local ALL_STATIONS = require("ds47.profibus.telegram").ALL_STATIONS

--- The message of MS1 or MS2 that a frame carries; nil for none.
-- @param item what telegram.lua decoded
function M.record(item)
  if item.request == nil or not RECORDS[dp.service(item)] then return nil end
  return ms1.decode(item.du, item.request)
end

--- Where the data of a frame begins: behind addresses and function code, and the head of an SD2.
function M.data_start(item) return (item.kind == "SD2" and 7 or 4) + #item.dae + #item.sae end

--- A station as its frame names it: the address, or that all are meant.
function M.receiver(address, lang)
  return address == ALL_STATIONS and say(lang, "dp_all") or format("%d", address)
end

--- What the first byte of MS1 says, and the status of a refusal.
function M.function_text(message, item, lang)
  local name = told.function_text(message.code, item.request, lang)
  if message.kind ~= "refusal" then return name end
  local why = message.status and status_text(message.status, lang) or say(lang, "dp_cut_data")
  return joined(lang, { name, why }, ": ", "：")
end

-- The bits that are set, in words.
local function flag_words(content, lang)
  local rows = tables.profibus[content.kind .. "_flags"]
  local set = arrays.filtered(rows, function(row) return content.flags[row.id] end)
  local found = arrays.mapped(set, function(row) return of_row(row, lang) end)
  return #found > 0 and joined(lang, found, "; ", "；") or say(lang, "dp_no_flag")
end

--- The kind of a block of extended diagnosis: `of the device`.
function M.block_kind(block, lang) return of_row(tables.profibus.block[block.kind], lang) end

--- `parameterised by master 2`.
function M.master_text(address, lang)
  return address and say(lang, "dp_master", { sa = format("%d", address) }) or say(lang, "dp_no_master")
end

--- `watchdog 300 ms`.
function M.watchdog_text(milliseconds, lang)
  return milliseconds and say(lang, "dp_watchdog", { ms = format("%d", milliseconds) })
    or say(lang, "dp_watchdog_off")
end

--- The groups of Set_Prm or Global_Control.
-- @param none the key of the words for no bit
function M.groups_text(groups, none, lang)
  local bits = ""
  for bit = 7, 0, -1 do bits = bits .. format("%d", floor(groups / 2 ^ bit) % 2) end
  return groups ~= 0 and say(lang, "dp_groups", { bits = bits }) or say(lang, none)
end

local function area_text(area, side, lang)
  local counted = area.words and area.length / 2 or area.length
  local unit = say(lang, area.words and "dp_words" or "dp_bytes", { n = floor(counted) })
  local whole = say(lang, area.consistent and "dp_whole" or "dp_piecewise")
  return joined(lang, { joined(lang, { unit, say(lang, side) }, " ", ""), whole })
end

local function is_same(one, other)
  return one.length == other.length and one.words == other.words and one.consistent == other.consistent
end

-- What goes in and out.
local function sides_text(module, lang)
  local inputs, outputs, parts = module.inputs, module.outputs, {}
  if inputs and outputs and is_same(inputs, outputs) then return area_text(inputs, "dp_in_out", lang) end
  parts[1] = outputs and area_text(outputs, "dp_out", lang)
  parts[#parts + 1] = inputs and area_text(inputs, "dp_in", lang)
  return parts[1] and joined(lang, parts, "; ", "；") or say(lang, "dp_empty_slot")
end

--- `4 words in+out, consistent over whole length (PKW)`.
function M.module_text(module, lang)
  local text = sides_text(module, lang)
  if module.maker ~= "" then text = joined(lang, { text, say(lang, "dp_maker", { n = #module.maker }) }) end
  return module.role and format(lang == "zh" and "%s（%s）" or "%s (%s)", text, module.role) or text
end

--- `PPO1: 12 bytes to the slave, 12 from it`.
function M.ppo_text(content, lang)
  return say(lang, content.ppo and "dp_ppo" or "dp_no_ppo", {
    ppo = content.ppo and format("%d", content.ppo), outputs = format("%d", content.output_length),
    inputs = format("%d", content.input_length),
  })
end

--- The head of a message of MS1 in one line: `DS_Write, slot 0, index 47, length 10`. Without any byte it
-- says that the master asks for the answer, or that there is none yet.
function M.message_text(message, item, lang)
  if not message.code then return say(lang, "ms1_" .. message.kind) end
  local carries = message.code == ms1.READ or message.code == ms1.WRITE
  if message.kind == "refusal" or not carries or not message.length then
    return M.function_text(message, item, lang)
  end
  return say(lang, "ms1_record", {
    ["function"] = told.function_text(message.code, item.request, lang),
    slot = format("%d", message.slot), index = format("%d", message.index),
    length = format("%d", message.length),
  })
end

local function sap(number) return number and format("%d", number) or "-" end

--- The SAPs of a frame, with the service that they stand for.
function M.saps_text(item, lang)
  local service = dp.service(item)
  return say(lang, "dp_saps", {
    dsap = sap(item.dsap), ssap = sap(item.ssap),
    service = service and told.service_text(service, lang) or say(lang, "dp_service_unknown"),
  })
end

--- A token, which has stations and nothing else; nil where the frame is none.
function M.token_text(item, lang)
  if item.kind ~= "SD4" or not item.da or not item.sa then return nil end
  return say(lang, "dp_token", { sa = format("%d", item.sa), da = format("%d", item.da) })
end

-- In one line

-- What the content of a frame says, as far as a line has room; nil for nothing.
local gists = { diagnosis = flag_words, control = flag_words, configuration = M.ppo_text }

function gists.parameters(content, lang)
  local ident = content.ident and say(lang, "dp_ident", { ident = format("%04X", content.ident) })
  return joined(lang, { M.watchdog_text(content.watchdog_ms, lang), ident or nil })
end

function gists.exchange(content, lang)
  local text = say(lang, content.outputs and "dp_outputs" or "dp_inputs", { n = #content.data })
  return content.wants_diagnosis and joined(lang, { text, say(lang, "dp_wants_diagnosis") }) or text
end

--- What the data of a frame says: `slave diagnosis: watchdog is on`; the service alone where nobody knows.
-- @param item one of a service without records
function M.data_text(item, lang)
  local name, content = told.service_text(dp.service(item), lang), dp.decode(item)
  local gist = content and item.du ~= "" and gists[content.kind](content, lang)
  return gist and joined(lang, { name, gist }, ": ", "：") or name
end

-- The service of a frame and what it says; nil where it has none.
local function service_text(item, lang)
  local message = M.record(item)
  if message then return M.message_text(message, item, lang) end
  if dp.service(item) then return M.data_text(item, lang) end
  return (item.dae ~= "" or item.sae ~= "") and M.saps_text(item, lang) or nil
end

--- What is wrong with a frame, in words; nil for nothing.
function M.damage(item, lang) return item.flaws[1] and told.flaw_text(item.flaws[1], lang) or nil end

-- Whether a frame asks, or brings data as usual: its function code says nothing that a reader wants.
local function is_usual(item)
  local row = tables.profibus.answer[item.code]
  return item.request or row and row.exchange
end

-- A frame with a function code: its service, or else what the code says.
local function control_and_service(item, lang)
  local control, service = told.control_text(item.fc, lang), service_text(item, lang)
  if not service then return control end
  return is_usual(item) and service or joined(lang, { service, control }, "; ", "；")
end

--- A frame in one line: `set parameters: watchdog 300 ms, ident number 80B5`.
function M.summary(item, lang)
  local row, damage = tables.profibus.start[item.data:byte(1)], M.damage(item, lang)
  if not row then return damage end
  local text = item.fc and control_and_service(item, lang) or M.token_text(item, lang) or of_row(row, lang)
  return damage and joined(lang, { text, damage }, "; ", "；") or text
end

--- What is wrong, with its place in the frame: `wrong at byte 10: check byte is 12, and the bytes give 16`.
function M.flaw_line(flaw, start, lang)
  local offset = format("%d", start + flaw.offset)
  return say(lang, "dp_flaw", { offset = offset, text = told.flaw_text(flaw, lang) })
end

return M
