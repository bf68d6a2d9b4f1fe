-- The fields and expert infos of a frame of PROFIBUS: ds47.profibus.*. Their words are those of the tables;
-- which field stands where is in profibus_tree.lua. Registers nothing by itself.

local tables = require("ds47.spec.tables")
local types = require("ds47_ws.types")

local M = {}

-- Names of codes for Wireshark to show beside the number.
local function names(rows, name)
  local found = {}
  for code, row in pairs(rows) do
    found[code] = name(row)
  end
  return found
end

local function english(row)
  return row.en
end

local function with_id(row)
  return row.id .. ", " .. row.en
end

-- Functions of MS1, refusals among them.
local function functions()
  local found = names(tables.profibus.functions, english)
  for code, row in pairs(tables.profibus.refusals) do
    found[code] = row.en .. " negative"
  end
  return found
end

-- Key, label, kind, base, names, mask. Of a boolean: key, label, "bool", words for set and not set, mask.
local function rows()
  local codes = tables.profibus
  return {
    { "sd", "Start byte", "uint8", "HEX", names(codes.start, with_id) },
    { "le", "Length (LE)", "uint8", "DEC" },
    { "ler", "Length, repeated (LEr)", "uint8", "DEC" },
    { "sd_repeated", "Start byte, repeated", "uint8", "HEX" },
    { "da", "Destination", "uint8", "DEC" },
    { "sa", "Source", "uint8", "DEC" },
    { "fc", "Function code", "uint8", "HEX" },
    { "fc.request", "Frame", "bool", { "request", "answer" }, 0x40 },
    { "fc.fcb", "FCB", "bool", { "1", "0" }, 0x20 },
    { "fc.fcv", "FCV", "bool", { "FCB counts", "FCB does not count" }, 0x10 },
    { "fc.station", "Station", "uint8", "DEC", names(codes.station, english), 0x30 },
    { "fc.function", "Function", "uint8", "HEX", names(codes.request, english), 0x0F },
    { "fc.answer", "Function", "uint8", "HEX", names(codes.answer, english), 0x0F },
    { "dae", "Address extension of the destination", "bytes" },
    { "sae", "Address extension of the source", "bytes" },
    { "dsap", "Destination SAP", "uint8", "DEC" },
    { "ssap", "Source SAP", "uint8", "DEC" },
    { "service", "Service", "uint8", "DEC", types.words("profibus_services") },
    { "data", "Data", "bytes" },
    { "outputs", "Outputs", "bytes" },
    { "inputs", "Inputs", "bytes" },
    { "wants_diagnosis", "The slave asks for a diagnosis", "bool" },
    { "ident", "Ident number", "uint16", "HEX" },
    { "groups", "Groups", "uint8", "HEX" },
    { "diagnosis.master", "Master", "uint8", "DEC" },
    { "diagnosis.block", "Extended diagnosis", "bytes" },
    { "parameters.watchdog_1", "Watchdog factor 1", "uint8", "DEC" },
    { "parameters.watchdog_2", "Watchdog factor 2", "uint8", "DEC" },
    { "parameters.watchdog_ms", "Watchdog (ms)", "uint32", "DEC" },
    { "parameters.tsdr", "Min Tsdr", "uint8", "DEC" },
    { "parameters.user", "Parameters of the maker", "bytes" },
    { "configuration.module", "Module", "bytes" },
    { "configuration.outputs", "Bytes to the slave", "uint16", "DEC" },
    { "configuration.inputs", "Bytes from the slave", "uint16", "DEC" },
    { "configuration.role", "Role in the PPO", "uint8", "DEC", types.words("profibus_roles") },
    { "ppo", "PPO", "uint8", "DEC" },
    { "ms1", "Message of MS1 or MS2", "uint8", "DEC", types.words("profibus_messages") },
    { "ms1.function", "Function", "uint8", "HEX", functions() },
    { "ms1.slot", "Slot", "uint8", "DEC" },
    { "ms1.index", "Index", "uint8", "DEC" },
    { "ms1.length", "Length", "uint8", "DEC" },
    { "ms1.record", "Record", "bytes" },
    { "ms1.error_decode", "Error decode", "uint8", "HEX" },
    { "ms1.error_code_1", "Error code 1", "uint8", "HEX" },
    { "ms1.error_code_2", "Error code 2", "uint8", "HEX" },
    { "ms1.status", "Status", "uint32", "HEX" },
    { "ms1.not_ready", "The answer is not ready", "bool" },
    { "fcs", "Check byte", "uint8", "HEX" },
    { "fcs.good", "Check byte is right", "bool" },
    { "ed", "End byte", "uint8", "HEX" },
    { "rest", "Bytes behind the frame", "bytes" },
    { "flaw", "Flaw", "uint8", "DEC", types.words("profibus_flaws") },
    { "flaw.offset", "Offset of the flaw", "uint32", "DEC" },
  }
end

local function make(row)
  local abbreviation, constructor = "ds47.profibus." .. row[1], ProtoField[row[3]]
  if row[3] == "bool" then
    return constructor(abbreviation, row[2], row[5] and 8 or base.NONE, row[4], row[5])
  elseif row[4] then
    return constructor(abbreviation, row[2], base[row[4]], row[5], row[6])
  end
  return constructor(abbreviation, row[2])
end

--- The tables of bits that have a field each: `ds47.profibus.diagnosis.prm_fault`.
M.FLAGS = { "diagnosis", "parameters", "control" }

-- Flaws of a frame, and of the data in it.
local EXPERTS = {
  { "profibus.check", "Wrong check byte", "CHECKSUM", "ERROR" },
  { "profibus.damaged", "Damaged frame", "MALFORMED", "ERROR" },
  { "profibus.data", "Data that does not fit", "PROTOCOL", "WARN" },
}

--- The key of the expert info of a flaw.
-- @param of_data whether it is one of the data of a frame
function M.expert_of(flaw, of_data)
  return of_data and "profibus.data" or flaw.kind == "check" and "profibus.check" or "profibus.damaged"
end

--- Gives the protocol its fields and expert infos, and adds them to those that there are, by key
-- ("profibus.fc.fcb").
function M.define(proto, fields, experts)
  local list = {}
  local function add(key, field)
    fields["profibus." .. key] = field
    list[#list + 1] = field
  end
  for _, row in ipairs(rows()) do
    add(row[1], make(row))
  end
  for _, name in ipairs(M.FLAGS) do
    for _, row in ipairs(tables.profibus[name .. "_flags"]) do
      local key = name .. "." .. row.id
      add(key, ProtoField.bool("ds47.profibus." .. key, row.en, 8, nil, 2 ^ row.bit))
    end
  end
  proto.fields = list
  local made = {}
  for number, row in ipairs(EXPERTS) do
    local group, severity = expert.group[row[3]], expert.severity[row[4]]
    made[number] = ProtoExpert.new("ds47.expert." .. row[1], row[2], group, severity)
    experts[row[1]] = made[number]
  end
  proto.experts = made
end

return M
