-- The fields and expert infos of a frame of PROFIBUS, ds47.profibus.*, as fields.lua has them. Their words
-- are those of the tables; which field stands where is in profibus_tree.lua.

local codes = require("ds47.spec.tables").profibus

local M = {}

local starts, functions = {}, {} -- words of start bytes, and of functions of MS1, refusals among them
for code, row in pairs(codes.start) do
  starts[code] = row.id .. ", " .. row.en
end
for code, row in pairs(codes.functions) do
  functions[code] = row.en
end
for code, row in pairs(codes.refusals) do
  functions[code] = row.en .. " negative"
end

M.FIELDS = {
  { "profibus.sd", "Start byte", "uint8", "HEX", starts },
  { "profibus.le", "Length (LE)", "uint8", "DEC" },
  { "profibus.ler", "Length, repeated (LEr)", "uint8", "DEC" },
  { "profibus.sd_repeated", "Start byte, repeated", "uint8", "HEX" },
  { "profibus.da", "Destination", "uint8", "DEC" },
  { "profibus.sa", "Source", "uint8", "DEC" },
  { "profibus.fc", "Function code", "uint8", "HEX" },
  { "profibus.fc.request", "Frame", "bool", { "request", "answer" }, 0x40 },
  { "profibus.fc.fcb", "FCB", "bool", { "1", "0" }, 0x20 },
  { "profibus.fc.fcv", "FCV", "bool", { "FCB counts", "FCB does not count" }, 0x10 },
  { "profibus.fc.station", "Station", "uint8", "DEC", "profibus.station", 0x30 },
  { "profibus.fc.function", "Function", "uint8", "HEX", "profibus.request", 0x0F },
  { "profibus.fc.answer", "Function", "uint8", "HEX", "profibus.answer", 0x0F },
  { "profibus.dae", "Address extension of the destination", "bytes" },
  { "profibus.sae", "Address extension of the source", "bytes" },
  { "profibus.dsap", "Destination SAP", "uint8", "DEC" },
  { "profibus.ssap", "Source SAP", "uint8", "DEC" },
  { "profibus.service", "Service", "code", "profibus_services" },
  { "profibus.data", "Data", "bytes" },
  { "profibus.outputs", "Outputs", "bytes" },
  { "profibus.inputs", "Inputs", "bytes" },
  { "profibus.wants_diagnosis", "The slave asks for a diagnosis", "bool" },
  { "profibus.ident", "Ident number", "uint16", "HEX" },
  { "profibus.groups", "Groups", "uint8", "HEX" },
  { "profibus.diagnosis.master", "Master", "uint8", "DEC" },
  { "profibus.diagnosis.block", "Extended diagnosis", "bytes" },
  { "profibus.parameters.watchdog_1", "Watchdog factor 1", "uint8", "DEC" },
  { "profibus.parameters.watchdog_2", "Watchdog factor 2", "uint8", "DEC" },
  { "profibus.parameters.watchdog_ms", "Watchdog (ms)", "uint32", "DEC" },
  { "profibus.parameters.tsdr", "Min Tsdr", "uint8", "DEC" },
  { "profibus.parameters.user", "Parameters of the maker", "bytes" },
  { "profibus.configuration.module", "Module", "bytes" },
  { "profibus.configuration.outputs", "Bytes to the slave", "uint16", "DEC" },
  { "profibus.configuration.inputs", "Bytes from the slave", "uint16", "DEC" },
  { "profibus.configuration.role", "Role in the PPO", "code", "profibus_roles" },
  { "profibus.ppo", "PPO", "uint8", "DEC" },
  { "profibus.ms1", "Message of MS1 or MS2", "code", "profibus_messages" },
  { "profibus.ms1.function", "Function", "uint8", "HEX", functions },
  { "profibus.ms1.slot", "Slot", "uint8", "DEC" },
  { "profibus.ms1.index", "Index", "uint8", "DEC" },
  { "profibus.ms1.length", "Length", "uint8", "DEC" },
  { "profibus.ms1.record", "Record", "bytes" },
  { "profibus.ms1.error_decode", "Error decode", "uint8", "HEX" },
  { "profibus.ms1.error_code_1", "Error code 1", "uint8", "HEX" },
  { "profibus.ms1.error_code_2", "Error code 2", "uint8", "HEX" },
  { "profibus.ms1.status", "Status", "uint32", "HEX" },
  { "profibus.ms1.not_ready", "The answer is not ready", "bool" },
  { "profibus.fcs", "Check byte", "uint8", "HEX" },
  { "profibus.fcs.good", "Check byte is right", "bool" },
  { "profibus.ed", "End byte", "uint8", "HEX" },
  { "profibus.rest", "Bytes behind the frame", "bytes" },
  { "profibus.flaw", "Flaw", "code", "profibus_flaws" },
  { "profibus.flaw.offset", "Offset of the flaw", "uint32", "DEC" },
}

-- The tables of bits that have a field each: `ds47.profibus.diagnosis.prm_fault`.
for _, name in ipairs({ "diagnosis", "parameters", "control" }) do
  for _, row in ipairs(codes[name .. "_flags"]) do
    M.FIELDS[#M.FIELDS + 1] = { "profibus." .. name .. "." .. row.id, row.en, "bool", nil, 2 ^ row.bit }
  end
end

--- Flaws of a frame, and of the data in it.
M.EXPERTS = {
  { "profibus.check", "Wrong check byte", "checksum", "error" },
  { "profibus.damaged", "Damaged frame", "malformed", "error" },
  { "profibus.data", "Data that does not fit", "protocol", "warning" },
}

--- The key of the expert info of a flaw.
-- @param of_data whether it is one of the data of a frame
function M.expert_of(flaw, of_data)
  return of_data and "profibus.data" or flaw.kind == "check" and "profibus.check" or "profibus.damaged"
end

return M
