-- The fields and expert infos of the ds47 protocol: their names, types and labels.
--
-- A name is the key of the JSON report behind `ds47.`; docs/report.md says what each means. Registers nothing
-- by itself: `define` is given the protocols by the entry file. Which field stands where is in tree.lua.
--
-- What is drawn in every frame of a drive (control and status word, ds47.pzd) belongs to a protocol of its
-- own: so one question tells whether anybody wants it. What happened to a drive stands below that protocol,
-- too: a frame of `ds47` is one of the parameter channel.

local bus_rows = require("ds47_ws.profibus_fields")
local tables = require("ds47.spec.tables")
local types = require("ds47_ws.types")

local M = {}

-- Key, label, kind. A kind is the constructor of ProtoField, with its base, the names of numbers (a table of
-- them, or where it is in tables.lua) and the mask; of a "bool" with the words of set and not set, the mask,
-- and how many bits the whole has (nil: 8); "code" is the number of a word, with its table in
-- spec/codes.toml.
local FIELDS = {
  { "info", "Info", "string" }, -- the sentence of the Info column
  -- the message
  { "request_id", "Request ID", "uint8", "HEX", "request_ids" },
  { "response_id", "Response ID", "uint8", "HEX", "response_ids" },
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
  { "family", "Family of drives", "string" }, -- whose parameter it is, where the vendor does not say it
  { "described_in", "Described in frame", "framenum" },
  { "format", "Format", "uint8", "HEX", "formats" },
  { "value_count", "Number of values", "uint8", "DEC" },
  { "meaning", "Meaning", "string" }, -- of the values of a parameter
  -- in a response: what its request wrote
  { "written.format", "Format written", "uint8", "HEX", "formats" },
  { "written.value_count", "Number of values written", "uint8", "DEC" },
  -- one value: as text, and with the type of its format. A time is text as ISO 8601 writes it, because a
  -- drive knows no time zone, may send a time of day without a date, and dates that do not exist; as text it
  -- compares rightly all the same. Whatever its format, a number is one as `value.number`, a physical value
  -- as `scaled.number`.
  { "value", "Value", "string" },
  { "value.number", "Number", "double" },
  { "value.signed", "Signed", "int64", "DEC" },
  { "value.unsigned", "Unsigned", "uint64", "DEC" },
  { "value.float", "Float32", "float" },
  { "value.double", "Float64", "double" },
  { "value.string", "Text", "string" },
  { "value.bytes", "Bytes", "bytes" },
  { "value.time", "Time", "string" },
  { "value.hex", "Bytes of the text", "bytes" }, -- only where the text cannot be shown as it is
  { "scaled", "Physical value", "string" },
  { "scaled.number", "Number", "double" },
  { "error.code", "Error number", "uint16", "HEX", "errors" },
  { "error.text", "Error", "string" },
  { "error.info", "Additional information", "uint16", "DEC" },
  -- the words of PKW in a cyclic frame
  { "pkw", "PKW", "bytes" },
  { "pkw.ak", "AK", "uint8", "DEC" },
  { "pkw.spm", "SPM", "uint8", "DEC" },
  { "pkw.pnu", "Parameter number (PNU)", "uint16", "DEC" },
  { "pkw.subindex", "Subindex", "uint8", "DEC" },
  { "pkw.page", "Page", "uint8", "HEX" },
  { "pkw.pwe1", "PWE1", "uint16", "HEX" },
  { "pkw.pwe2", "PWE2", "uint16", "HEX" },
  { "pkw.value", "Value", "double" },
  { "pkw.error", "Error number", "uint16", "DEC", "pkw.errors" },
  -- the other frames
  { "request_in", "Request in frame", "framenum", "REQUEST" },
  { "response_in", "Response in frame", "framenum", "RESPONSE" },
  { "time", "Time from request to response", "relative_time" },
  -- a copy of a frame
  { "duplicate_of", "Duplicate of frame", "framenum", "DUP_ACK" },
  -- the transaction, beside its keys (tables.transaction_fields)
  { "second_pass", "Second pass", "string" }, -- where it knows more
  { "controller.mac", "Controller", "ether" },
  { "master", "Master", "uint8", "DEC" },
  { "device.mac", "Device", "ether" },
  { "vendor_assumed", "Vendor assumed", "uint16", "HEX" },
  { "bytes.request", "Bytes of the request", "bytes" },
  { "bytes.response", "Bytes of the response", "bytes" },
  { "plc", "What the PLC saw", "string" },
  { "frames.poll.request", "Poll: Read request", "framenum", "REQUEST" },
  { "frames.poll.response", "Poll: Read response", "framenum", "RESPONSE" },
  { "frames.reread.request", "Read again: request", "framenum", "REQUEST" },
  { "frames.reread.response", "Read again: response", "framenum", "RESPONSE" },
  -- a finding
  { "finding", "Finding", "string" },
  { "finding.severity", "Severity", "code", "severities" },
  { "finding.message", "Message", "string" }, -- which the expert info shows
  { "finding.args", "Arguments", "string" },
  { "finding.cause", "Cause", "string" },
  { "finding.advice", "What to do", "string" },
  { "finding.instead", "Send instead", "bytes" },
  { "finding.instead.words", "In words", "string" },
  { "finding.instead.encode", "Made by", "string" },
  { "finding.frame", "Frame of the finding", "framenum" },
  { "finding.request_in", "Request of the transaction in frame", "framenum", "REQUEST" },
  { "finding.elsewhere", "Finding of the transaction in frame", "framenum" },
  { "finding.offset", "Offset in the message", "uint32", "DEC" },
  { "finding.transaction", "Transaction of the finding", "uint32", "DEC" },
  -- what happened to a drive
  { "pzd.event", "Event of a drive", "string" },
  { "pzd.event.name", "Name", "code", "events" },
  { "pzd.event.word", "Word", "code", "drive_words" },
  { "pzd.event.before", "Before", "uint16", "HEX" },
  { "pzd.event.after", "After", "uint16", "HEX" },
  { "pzd.event.state", "State of the drive", "code", "drive_states" },
  { "pzd.event.overlays", "Beside the state", "string" },
  { "pzd.event.relation", "Relation", "uint32", "DEC" },
  { "pzd.event.telegrams", "Telegrams", "string" },
}

--- A description (attribute 0x20), and texts (0x30). Which stands where is in description_tree.lua.
M.DESCRIPTION = {
  { "description", "Description", "string" },
  { "description.identifier", "Identifier", "uint16", "HEX" },
  { "description.type", "Type", "string" },
  { "description.writable", "Can be written", "bool" },
  { "description.text_array", "Has texts", "bool" },
  { "description.changed", "Not at its factory setting", "bool" },
  { "description.reset_only", "Can only be reset", "bool" },
  { "description.array", "Has elements", "bool" },
  { "description.elements", "Number of elements, or length", "uint16", "DEC" },
  { "description.factor", "Standardisation factor", "double" },
  { "description.quantity", "Variable index", "uint8", "DEC" },
  { "description.conversion", "Conversion index", "int8", "DEC" },
  { "description.unit", "Unit", "string" },
  { "description.name", "Name", "string" },
  { "description.low", "Lower limit", "double" },
  { "description.high", "Upper limit", "double" },
  { "description.extension", "Extension of the identifier", "uint16", "HEX" },
  { "description.reference", "Reference parameter", "uint16", "DEC" },
  { "description.normalisation", "Normalisation", "uint16", "HEX" },
  { "description.full_scale", "100 % in the value", "uint32", "HEX" },
  { "text", "Entry of a text array", "string" },
}

-- The words of a drive, in each of its frames.
local WORDS = {
  { "pzd", "Control and status word", "string" },
  { "pzd.telegram", "Telegram", "uint16", "DEC" },
  { "pzd.stw1", "STW1", "uint16", "HEX" },
  { "pzd.zsw1", "ZSW1", "uint16", "HEX" },
  { "pzd.state", "State of the drive", "code", "drive_states" },
  { "pzd.setpoint", "Setpoint (%)", "double" },
  { "pzd.actual", "Actual value (%)", "double" },
  { "pzd.setpoint.raw", "Setpoint, as it is sent", "int16", "DEC" },
  { "pzd.actual.raw", "Actual value, as it is sent", "int16", "DEC" },
}

--- The last part of the name of each bit, from bit 0 on.
M.BITS = {
  stw1 = {
    "on", "no_off2", "no_off3", "enable_operation", "enable_ramp_generator", "continue_ramp_generator",
    "enable_setpoint", "acknowledge", "jog_1", "jog_2", "control_by_plc", "reverse", "bit_12",
    "motor_potentiometer_up", "motor_potentiometer_down", "bit_15",
  },
  zsw1 = {
    "ready_to_switch_on", "ready", "operation_enabled", "fault", "no_off2", "no_off3",
    "switching_on_inhibited", "alarm", "speed_within_tolerance", "control_requested", "comparison_reached",
    "limit_not_reached", "holding_brake_open", "no_temperature_alarm", "forward", "no_overload",
  },
}

local SEVERITIES = { note = "NOTE", warning = "WARN", error = "ERROR" }
-- Groups of expert infos, as spec/rules.toml names them.
local GROUPS = {
  response = "RESPONSE_CODE", malformed = "MALFORMED", sequence = "SEQUENCE", protocol = "PROTOCOL",
  checksum = "CHECKSUM",
}

-- Names of the codes in a table of tables.lua (`formats`, `pkw.errors`), for Wireshark to show beside the
-- number: none of numbers that are nothing but reserved.
local function names(path)
  local result, rows = {}, tables
  for name in string.gmatch(path, "[^.]+") do
    rows = rows[name]
  end
  for code, row in pairs(rows) do
    local name = row.name or row.en
    result[code] = name ~= "Reserved" and name or nil
  end
  return result
end

-- Words of a telegram that are numbers without a sign, or bits.
local UNSIGNED = { "STW", "ZSW", "MELD", "CODE", "SATZ" }

local function is_unsigned(word)
  for _, part in ipairs(UNSIGNED) do
    if string.find(word, part, 1, true) then
      return true
    end
  end
  return false
end

--- The name of a word of a telegram without the mark of double words, and whether it is one. Nil where it has
-- no field of its own: nobody knows what it is, or it is the setpoint or the actual value.
function M.word(word)
  if string.find(word, "^%-$") or string.find(word, "^NSOLL_A") or string.find(word, "^NIST_A") then
    return nil, false
  end
  local name = string.match(word, "^(.*)%(2%)$")
  return name or word, name ~= nil
end

-- Adds the fields of the words of one direction of a telegram, but for those that have one.
local function add_words(rows, known, words)
  for number = 2, #words do -- behind STW1 or ZSW1
    local name, double = M.word(words[number])
    if name and not known[name] then
      known[name] = true
      local size = double and "32" or "16"
      local kind = is_unsigned(name) and "uint" or "int"
      local shown = kind == "int" and "DEC" or "DEC_HEX"
      rows[#rows + 1] = { "pzd.word." .. string.lower(name), name, kind .. size, shown }
    end
  end
end

-- The fields of all words that telegrams have, in the order of the numbers.
local function rows_of_telegrams()
  local numbers, rows, known = {}, {}, {}
  for number in pairs(tables.pzd.telegrams) do
    numbers[#numbers + 1] = number
  end
  table.sort(numbers)
  for _, number in ipairs(numbers) do
    add_words(rows, known, tables.pzd.telegrams[number].out)
    add_words(rows, known, tables.pzd.telegrams[number].inward)
  end
  return rows
end

-- The fields of the bits of both words: what each says as 1 and as 0.
local function rows_of_bits()
  local rows = {}
  for _, word in ipairs({ "stw1", "zsw1" }) do
    for number, name in ipairs(M.BITS[word]) do
      local bit, label = number - 1, string.format("%s bit %d", string.upper(word), number - 1)
      local said = { tables.pzd[word][bit].set or "1", tables.pzd[word][bit].clear or "0" }
      rows[#rows + 1] = { "pzd." .. word .. "." .. name, label, "bool", said, 2 ^ bit, 16 }
    end
  end
  return rows
end

local function make(row)
  local key, label, kind, detail, values, more = row[1], row[2], row[3], row[4], row[5], row[6]
  local abbreviation, constructor = "ds47." .. key, ProtoField[kind == "code" and "uint8" or kind]
  if kind == "code" then
    return constructor(abbreviation, label, base.DEC, types.words(detail))
  elseif kind == "bool" and values then
    return constructor(abbreviation, label, more or 8, detail, values)
  elseif kind == "framenum" then
    return constructor(abbreviation, label, base.NONE, frametype[detail])
  elseif detail then
    values = type(values) == "string" and names(values) or values
    return constructor(abbreviation, label, base[detail], values, more)
  end
  return constructor(abbreviation, label)
end

-- Makes the fields of a protocol, and adds them to those that there are by key.
local function add_fields(fields, proto, ...)
  local list = {}
  for _, rows in ipairs({ ... }) do
    for _, row in ipairs(rows) do
      local field = make(row)
      fields[row[1]] = field
      list[#list + 1] = field
    end
  end
  proto.fields = list
end

-- Expert infos of findings and of what happens to a drive: key, text, group, severity.
local function rows_of_experts()
  local rows = {}
  for _, rule in ipairs(tables.experts) do
    local text = rule.id .. " " .. rule.title
    rows[#rows + 1] = { rule.id, text, rule.expert, rule.severity }
    if rule.of_makers then
      rows[#rows + 1] = { rule.id .. " note", text, rule.expert, "note" }
    end
  end
  rows[#rows + 1] = { "pzd.event", "Event of a drive", "protocol", "note" }
  rows[#rows + 1] = { "pzd.fault", "Fault of a drive", "protocol", "warning" }
  return rows
end

-- The same of expert infos.
local function add_experts(experts, proto, rows)
  local list = {}
  for number, row in ipairs(rows) do
    local name = string.gsub(string.lower(row[1]), " ", ".")
    list[number] = ProtoExpert.new("ds47.expert." .. name, row[2], expert.group[GROUPS[row[3]]],
      expert.severity[SEVERITIES[row[4]]])
    experts[row[1]] = list[number]
  end
  proto.experts = list
end

--- Gives the protocols their fields and expert infos.
-- @param proto, words, bus  the protocol, that of the words of drives, and that of frames of PROFIBUS
-- @return fields of all by key ("value.float"), expert infos by rule id, and by "pzd.event", "pzd.fault" and
--   those of profibus_fields.lua
function M.define(proto, words, bus)
  local fields, experts = {}, {}
  add_fields(fields, proto, FIELDS, tables.transaction_fields, M.DESCRIPTION)
  add_fields(fields, words, WORDS, rows_of_bits(), rows_of_telegrams())
  add_experts(experts, proto, rows_of_experts())
  add_fields(fields, bus, bus_rows.FIELDS)
  add_experts(experts, bus, bus_rows.EXPERTS)
  return fields, experts
end

return M
