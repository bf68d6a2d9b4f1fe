-- The tree of a frame of PROFIBUS: every field at its bytes, and what it means in the words of
-- ds47.report.profibus. The message of DS47, and the words of PKW and PZD in it, are tree.lua's.
--
-- What is damaged is shown as far as it is known, with an expert info for each flaw.

local any = require("ds47.support.arrays").any
local dp = require("ds47.profibus.dp")
local spec = require("ds47.spec.profibus")
local say = require("ds47.report.formatting").say
local status_text = require("ds47.spec.statuses").status_text
local tables = require("ds47.spec.tables")
local types = require("ds47_ws.types")
local words = require("ds47.report.profibus")

local codes = tables.codes
local format = string.format

local M = {}

local PROTOCOL = "DP"
local FC_REQUEST = { "fc.request", "fc.fcb", "fc.fcv", "fc.function" }
local FC_ANSWER = { "fc.request", "fc.station", "fc.answer" }

local protocol, fields, experts

--- Tells the protocol, fields and expert infos, as fields.lua makes them.
function M.configure(the_protocol, the_fields, the_experts)
  protocol, fields, experts = the_protocol, the_fields, the_experts
end

-- The expert info of a flaw; `of_data` says whether it is one of the data of a frame.
local function expert_of(flaw, of_data)
  local kind = of_data and "data" or flaw.kind == "check" and "check" or "damaged"
  return experts["profibus." .. kind]
end

local frame -- the TvbRange of all bytes
local language -- of the texts, "en" or "zh"

-- Part of the frame, nil where the recording has not all of it.
local function part(offset, size)
  if size == 0 or offset + size > frame:len() then return nil end
  return frame:range(offset, size)
end

-- Adds a field whose value is that of its bytes; `note` is what it means.
local function take(parent, key, offset, size, note)
  local range = part(offset, size)
  local item = range and parent:add(fields["profibus." .. key], range)
  if item and note then item:append_text(format(" (%s)", note)) end
  return item
end

-- Adds a field with a value of its own, at its bytes where there are some, else as one that follows from
-- others.
local function derive(parent, key, value, offset, size)
  if value == nil then return nil end
  local range = offset and part(offset, size)
  if range then return parent:add(fields["profibus." .. key], range, value) end
  local item = parent:add(fields["profibus." .. key], value)
  item:set_generated()
  return item
end

-- All bits of a table, each a field.
local function add_flags(parent, name, flags, at, size)
  for _, row in ipairs(tables.profibus[name .. "_flags"]) do
    local item = row.byte < size and take(parent, name .. "." .. row.id, at + row.byte, 1)
    if item and language == "zh" then
      local picture = types.picture(frame:range(at + row.byte, 1):uint(), row.bit, 8)
      item:set_text(format("%s = %s：%s", picture, row.zh, flags[row.id] and "True" or "False"))
    end
  end
end

local function add_length(root, item)
  take(root, "le", 1, 1)
  take(root, "ler", 2, 1)
  take(root, "sd_repeated", 3, 1)
  return item.kind == "SD2" and 4 or 1
end

local function add_addresses(root, item, at)
  local all = words.receiver(item.da, language)
  local shown = derive(root, "da", item.da, at, 1)
  if shown and all ~= format("%d", item.da) then shown:append_text(format(" (%s)", all)) end
  derive(root, "sa", item.sa, at + 1, 1)
end

local function add_function(root, item, at)
  local shown = take(root, "fc", at, 1, spec.control_text(item.fc, language))
  for _, key in ipairs(shown and (item.request and FC_REQUEST or FC_ANSWER) or {}) do
    take(shown, key, at, 1)
  end
end

local function add_sap(root, key, bytes, sap, at)
  local name = key == "dsap" and "dae" or "sae"
  local place = bytes:find("[^\64-\127\192-\255]") -- of the SAP: bit 6 is not set there
  if #bytes > 1 or bytes ~= "" and not place then take(root, name, at, #bytes) end
  if place then derive(root, key, sap, at + place - 1, 1) end
end

local function add_service(root, item)
  local service = dp.service(item)
  local shown = derive(root, "service", codes.profibus_services[service])
  if shown then shown:set_text(format("Service: %s (%s)", service, spec.service_text(service, language))) end
end

-- What DP says

-- Kind of a content -> what adds it: (parent, content, at, size).
local contents = {}

function contents.diagnosis(parent, content, at, size)
  add_flags(parent, "diagnosis", content.flags, at, size)
  local master = words.master_text(content.master, language)
  take(parent, "diagnosis.master", at + 3, size > 3 and 1 or 0, master)
  take(parent, "ident", at + 4, content.ident and 2 or 0)
  local place = at + 6
  for _, block in ipairs(content.blocks) do
    take(parent, "diagnosis.block", place, #block.data, words.block_kind(block, language))
    place = place + #block.data
  end
end

function contents.parameters(parent, content, at, size)
  add_flags(parent, "parameters", content.flags, at, size)
  take(parent, "parameters.watchdog_1", at + 1, size > 1 and 1 or 0)
  take(parent, "parameters.watchdog_2", at + 2, size > 2 and 1 or 0)
  derive(parent, "parameters.watchdog_ms", content.watchdog_ms)
  take(parent, "parameters.tsdr", at + 3, content.tsdr and 1 or 0)
  take(parent, "ident", at + 4, content.ident and 2 or 0)
  local groups = content.groups and words.groups_text(content.groups, "dp_no_groups", language)
  take(parent, "groups", at + 6, groups and 1 or 0, groups)
  take(parent, "parameters.user", at + 7, #content.user)
end

local function add_module(parent, module, at)
  local shown = take(parent, "configuration.module", at, #module.data, words.module_text(module, language))
  if not shown then return end
  derive(shown, "configuration.outputs", module.outputs and module.outputs.length)
  derive(shown, "configuration.inputs", module.inputs and module.inputs.length)
  derive(shown, "configuration.role", codes.profibus_roles[module.role])
end

function contents.configuration(parent, content, at)
  for _, module in ipairs(content.modules) do
    add_module(parent, module, at)
    at = at + #module.data
  end
  local shown = derive(parent, "ppo", content.ppo)
  if shown then shown:set_text(words.ppo_text(content, language)) end
end

function contents.control(parent, content, at, size)
  add_flags(parent, "control", content.flags, at, size)
  local groups = content.groups and words.groups_text(content.groups, "dp_all_groups", language)
  take(parent, "groups", at + 1, groups and 1 or 0, groups)
end

function contents.exchange(parent, content, at, size)
  take(parent, content.outputs and "outputs" or "inputs", at, size)
  if not content.outputs then derive(parent, "wants_diagnosis", content.wants_diagnosis) end
end

-- Records

local function add_refusal(parent, message, at)
  take(parent, "ms1.error_decode", at + 1, message.error_decode and 1 or 0)
  take(parent, "ms1.error_code_1", at + 2, message.error_code_1 and 1 or 0)
  take(parent, "ms1.error_code_2", at + 3, message.error_code_2 and 1 or 0)
  local shown = message.status and derive(parent, "ms1.status", message.status, at, 4)
  if shown then
    shown:append_text(format(" (%s)", status_text(message.status, language)))
    shown:set_generated()
  end
  if message.not_ready then derive(parent, "ms1.not_ready", true) end
end

local function add_message(root, item, message, at)
  local shown = derive(root, "ms1", codes.profibus_messages[message.kind], at, #item.du)
  shown:set_text(words.message_text(message, item, language))
  if not message.code then return end
  take(shown, "ms1.function", at, 1)
  if message.kind == "refusal" then add_refusal(shown, message, at) end
  take(shown, "ms1.slot", at + 1, message.slot and 1 or 0)
  take(shown, "ms1.index", at + 2, message.index and 1 or 0)
  take(shown, "ms1.length", at + 3, message.length and 1 or 0)
  take(shown, "ms1.record", at + 4, message.length and #message.data or 0)
end

local function add_data(root, item, at)
  local message, content = words.record(item), dp.decode(item)
  if message then
    add_message(root, item, message, at)
  elseif item.du ~= "" then
    local shown = take(root, "data", at, #item.du)
    if content then
      shown:set_text(words.data_text(item, language))
      contents[content.kind](shown, content, at, #item.du)
    end
  end
  return message or content
end

-- The end, and what is wrong

local function add_flaw(root, flaw, start, of_data)
  local shown = derive(root, "flaw", codes.profibus_flaws[flaw.kind], start + flaw.offset, 1)
  shown:set_generated()
  shown:set_text(words.flaw_line(flaw, start, language))
  shown:add_proto_expert_info(expert_of(flaw, of_data), spec.flaw_text(flaw, language))
  derive(shown, "flaw.offset", start + flaw.offset)
end

local function add_trailer(root, item, at)
  local good = not any(item.flaws, function(flaw) return flaw.kind == "check" end)
  local shown = take(root, "fcs", at, 1)
  if shown then derive(shown, "fcs.good", good) end
  take(root, "ed", at + 1, 1)
  take(root, "rest", at + 2, math.max(frame:len() - at - 2, 0))
end

local function add_frame(root, item)
  local first = take(root, "sd", 0, 1)
  if item.kind == "SC" then
    first:append_text(", " .. say(language, "dp_taken"))
  elseif item.kind == "SD4" then
    derive(root, "da", item.da, 1, 1)
    derive(root, "sa", item.sa, 2, 1)
    take(root, "rest", 3, math.max(frame:len() - 3, 0))
  end
  local at = item.kind == "SD2" and add_length(root, item) or 1
  if not item.fc then return nil end
  add_addresses(root, item, at)
  add_function(root, item, at + 2)
  add_sap(root, "dsap", item.dae, item.dsap, at + 3)
  add_sap(root, "ssap", item.sae, item.ssap, at + 3 + #item.dae)
  add_service(root, item)
  local start = words.data_start(item)
  local content = add_data(root, item, start)
  add_trailer(root, item, start + #item.du)
  return content
end

--- Adds what a frame says.
-- @param item what telegram.lua decoded
function M.add(tree, tvb, item, lang)
  frame, language = tvb:range(), lang
  local root = tree:add(protocol, frame)
  root:set_text("PROFIBUS DP: " .. words.summary(item, lang))
  local content = item.kind ~= "" and add_frame(root, item) or nil
  for _, flaw in ipairs(item.flaws) do add_flaw(root, flaw, 0, false) end
  for _, flaw in ipairs(content and content.flaws or {}) do
    add_flaw(root, flaw, words.data_start(item), true)
  end
end

--- What is wrong with a frame as expert infos and nothing else: where nobody wants fields.
function M.add_experts(tree, item, lang)
  for _, flaw in ipairs(item.flaws) do
    tree:add_proto_expert_info(expert_of(flaw, false), spec.flaw_text(flaw, lang))
  end
end

local function station(address, lang)
  local text = words.receiver(address, lang)
  return text == format("%d", address) and "dp" .. text or text
end

--- Sets the columns: who sends to whom, and the frame in one line.
function M.set_columns(columns, item, lang)
  columns.protocol, columns.info = PROTOCOL, words.summary(item, lang)
  if item.sa and item.da then columns.src, columns.dst = station(item.sa, lang), station(item.da, lang) end
end

return M
