-- The fields and expert infos of the ds47 protocol: their names, types and labels.
--
-- A name is the key of the JSON report behind `ds47.`; docs/report.md says what each means. Which there are
-- stands in spec/wireshark.toml. Registers nothing by itself: `define` is given the protocols by the entry
-- file. Which field stands where is in tree.lua.
--
-- What is drawn in every frame of a drive (control and status word, ds47.pzd) belongs to a protocol of its
-- own: so one question tells whether anybody wants it. What happened to a drive stands below that protocol,
-- too: a frame of `ds47` is one of the parameter channel.

local tables = require("ds47.spec.tables")
local types = require("ds47_ws.types")

local M = {}

-- Names of the codes in a table of tables.lua (`formats`, `pkw.errors`), for Wireshark to show beside the
-- number: none of numbers that are nothing but reserved.
local function names(path)
  local result, rows = {}, tables
  for name in string.gmatch(path, "[^.]+") do rows = rows[name] end
  for code, row in pairs(rows) do
    local name = row.name or row.en
    result[code] = name ~= "Reserved" and name or nil
  end
  return result
end

-- A row is key, label, kind and what the kind takes; of a "bool" how many bits the whole has (nil: 8) stands
-- behind the mask.
local function make(row)
  local key, label, kind, detail, values, more = row[1], row[2], row[3], row[4], row[5], row[6]
  local abbreviation, constructor = "ds47." .. key, ProtoField[kind == "code" and "uint8" or kind]
  if kind == "code" then return constructor(abbreviation, label, base.DEC, types.words(detail)) end
  if kind == "bool" and values then return constructor(abbreviation, label, more or 8, detail, values) end
  if kind == "framenum" then return constructor(abbreviation, label, base.NONE, frametype[detail]) end
  if detail then return constructor(abbreviation, label, base[detail], values and names(values), more) end
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

-- The same of expert infos: key, name, text, group and severity.
local function add_experts(experts, proto, rows)
  local list = {}
  for number, row in ipairs(rows) do
    local name, group, severity = "ds47.expert." .. row[2], expert.group[row[4]], expert.severity[row[5]]
    list[number] = ProtoExpert.new(name, row[3], group, severity)
    experts[row[1]] = list[number]
  end
  proto.experts = list
end

--- Gives the protocols their fields and expert infos.
-- @param proto, words, bus  the protocol, that of the words of drives, and that of frames of PROFIBUS
-- @return fields of all by key ("value.float"), expert infos by rule id, and by "pzd.event", "pzd.fault" and
--   those of PROFIBUS
function M.define(proto, words, bus)
  local fields, experts, known = {}, {}, tables.fields
  add_fields(fields, proto, known.message, tables.transaction_fields, known.description)
  add_fields(fields, words, known.words, known.stw1, known.zsw1, known.telegrams)
  add_experts(experts, proto, tables.experts.plugin)
  add_fields(fields, bus, known.bus)
  add_experts(experts, bus, tables.experts.bus)
  return fields, experts
end

return M
