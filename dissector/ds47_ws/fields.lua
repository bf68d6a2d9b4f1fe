-- The fields and expert infos of the ds47 protocol: their names, types and labels.
--
-- A name is the key of the JSON report behind `ds47.`; docs/report.md says what each means. Registers nothing
-- by itself: `define` is given the protocol by the entry file. Which field stands where is in tree.lua.

local tables = require("ds47.spec.tables")

local M = {}

-- Key, label, kind. A kind is the constructor of ProtoField, with what it takes behind the label.
local FIELDS = {
  -- the message
  { "request_reference", "Request reference", "uint8", "DEC" },
  { "request_id", "Request ID", "uint8", "HEX", "request_ids" },
  { "response_id", "Response ID", "uint8", "HEX", "response_ids" },
  { "axis", "Axis / DO-ID", "uint8", "DEC" },
  { "parameter_count", "Number of parameters", "uint8", "DEC" },
  { "raw", "Bytes not decoded", "bytes" },
  -- one parameter
  { "parameter", "Parameter", "string" },
  { "pnu", "Parameter number (PNU)", "uint16", "DEC" },
  { "subindex", "Subindex", "uint16", "DEC" },
  { "attribute", "Attribute", "uint8", "HEX", "attributes" },
  { "element_count", "Number of elements", "uint8", "DEC" },
  { "name", "Name", "string" },
  { "unit", "Unit", "string" },
  { "format", "Format", "string" },
  { "value_count", "Number of values", "uint8", "DEC" },
  -- in a response: what its request wrote
  { "written.format", "Format written", "string" },
  { "written.value_count", "Number of values written", "uint8", "DEC" },
  -- one value: as text, and with the type of its format. A time is text as ISO 8601 writes it, because a
  -- drive knows no time zone, may send a time of day without a date, and dates that do not exist; as text it
  -- compares rightly all the same. Durations and normalised values have their physical value as a double.
  { "value", "Value", "string" },
  { "value.signed", "Signed", "int64", "DEC" },
  { "value.unsigned", "Unsigned", "uint64", "DEC" },
  { "value.float", "Float32", "float" },
  { "value.double", "Float64 or physical value", "double" },
  { "value.string", "Text", "string" },
  { "value.bytes", "Bytes", "bytes" },
  { "value.time", "Time", "string" },
  { "value.hex", "Bytes of the text", "string" }, -- only where the text cannot be shown as it is
  { "scaled", "Physical value", "string" },
  { "error.code", "Error number", "uint16", "HEX" },
  { "error.text", "Error", "string" },
  { "error.info", "Additional information", "uint16", "DEC" },
  -- the words of PKW in a cyclic frame
  { "pkw", "PKW", "string" },
  { "pkw.ak", "AK", "uint8", "DEC" },
  { "pkw.spm", "SPM", "uint8", "DEC" },
  { "pkw.pnu", "Parameter number (PNU)", "uint16", "DEC" },
  { "pkw.subindex", "Subindex", "uint8", "DEC" },
  { "pkw.page", "Page", "uint8", "HEX" },
  { "pkw.pwe1", "PWE1", "uint16", "HEX" },
  { "pkw.pwe2", "PWE2", "uint16", "HEX" },
  { "pkw.value", "Value", "string" },
  { "pkw.error", "Error number", "uint16", "DEC" },
  -- the other frames
  { "request_in", "Request in frame", "framenum", "REQUEST" },
  { "response_in", "Response in frame", "framenum", "RESPONSE" },
  { "time", "Time from request to response", "relative_time" },
  -- the transaction
  { "transaction", "Transaction", "uint32", "DEC" },
  { "channel", "Channel", "string" },
  { "operation", "Operation", "string" },
  { "state", "State", "string" },
  { "controller", "Controller", "string" },
  { "device", "Device", "string" },
  { "ar", "AR UUID", "string" },
  { "api", "API", "uint32", "DEC_HEX" },
  { "slot", "Slot", "uint16", "DEC_HEX" },
  { "subslot", "Subslot", "uint16", "DEC_HEX" },
  { "index", "Record index", "uint16", "DEC_HEX" },
  { "polls", "Polls", "uint32", "DEC" },
  { "start", "Start (UTC)", "string" },
  { "duration_ms", "Duration (ms)", "double" },
  { "cycles", "Cycles from request to response", "uint32", "DEC" },
  { "bytes.request", "Bytes of the request", "string" },
  { "bytes.response", "Bytes of the response", "string" },
  { "status.write", "Status of the Write", "uint32", "HEX" },
  { "status.read", "Status of the Read", "uint32", "HEX" },
  { "plc", "What the PLC saw", "string" },
  { "frames.write_request", "Write request", "framenum", "REQUEST" },
  { "frames.write_response", "Write response", "framenum", "RESPONSE" },
  { "frames.read_request", "Read request", "framenum", "REQUEST" },
  { "frames.read_response", "Read response", "framenum", "RESPONSE" },
  { "frames.poll.request", "Poll: Read request", "framenum", "REQUEST" },
  { "frames.poll.response", "Poll: Read response", "framenum", "RESPONSE" },
  { "frames.reread.request", "Read again: request", "framenum", "REQUEST" },
  { "frames.reread.response", "Read again: response", "framenum", "RESPONSE" },
  -- a finding
  { "finding", "Finding", "string" },
  { "finding.severity", "Severity", "string" },
  { "finding.message", "Message", "string" },
  { "finding.args", "Arguments", "string" },
  { "finding.frame", "Frame of the finding", "framenum" },
  { "finding.offset", "Offset in the message", "uint32", "DEC" },
  { "finding.transaction", "Transaction of the finding", "uint32", "DEC" },
}

local SEVERITIES = { note = "NOTE", warning = "WARN", error = "ERROR" }

-- Names of the codes in a table of tables.lua, for Wireshark to show beside the number.
local function names(table_name)
  local result = {}
  for code, row in pairs(tables[table_name]) do
    result[code] = type(row) == "table" and (row.name or row.en or row.operation) or nil
  end
  return result
end

local function make(row)
  local key, label, kind, detail, table_name = row[1], row[2], row[3], row[4], row[5]
  local abbreviation, constructor = "ds47." .. key, ProtoField[kind]
  if kind == "framenum" then
    return constructor(abbreviation, label, base.NONE, frametype[detail])
  elseif detail then
    return constructor(abbreviation, label, base[detail], table_name and names(table_name))
  end
  return constructor(abbreviation, label)
end

--- Gives the protocol its fields and expert infos.
-- @return fields by key ("value.float"), expert infos by rule id
function M.define(proto)
  local fields, list = {}, {}
  for number, row in ipairs(FIELDS) do
    local field = make(row)
    fields[row[1]] = field
    list[number] = field
  end
  proto.fields = list
  local experts, all = {}, {}
  for number, rule in ipairs(tables.experts) do
    local made = ProtoExpert.new("ds47.expert." .. string.lower(rule.id), rule.id .. " " .. rule.name,
      expert.group.PROTOCOL, expert.severity[SEVERITIES[rule.severity]])
    experts[rule.id] = made
    all[number] = made
  end
  proto.experts = all
  return fields, experts
end

return M
