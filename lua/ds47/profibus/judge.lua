-- What is wrong on a line: frames, stations, start-up and services to findings DS8xx (docs/profibus.md 8).
--
-- A thing that happens again is one remark with a count; all are told when nothing more comes. The stations,
-- and what is said of them, are in stations.lua; what is wrong with a transaction of DS47 is not here.

local dp = require("ds47.profibus.dp")
local hex = require("ds47.support.bytes").hex
local json = require("ds47.support.json")
local ordered = require("ds47.support.ordered")
local status_hex = require("ds47.spec.statuses").status_hex
local stations_of = require("ds47.profibus.stations")
local tables = require("ds47.spec.tables")

local concat, format = table.concat, string.format

local M = {}

local NOT_ENABLED = 3 -- the code of an answer that says that the SAP is not enabled (RS)
local OF_RECORDS = {record = true, alarm = true}
local FAULTS = {{"prm_fault", "diag_prm_fault"}, {"cfg_fault", "diag_cfg_fault"}}

--- How the report names a station: `dp3`.
function M.name(address)
  return format("dp%d", address)
end

local Judge = {}
Judge.__index = Judge

--- Hears what stations say, and what becomes of records.
-- @param limits  how much is too much, and how many things are kept apart
function M.new(limits)
  return setmetatable({limits = limits, noted = ordered.new()}, Judge)
end

-- Something is wrong; nil where there is no room for one more.
local function note(self, rule, station, frame, args, key)
  local place = concat({rule, station, key or ""}, " ")
  local noted = self.noted:get(place)
  if not noted and self.noted.length < self.limits.bus_remarks then
    args.device = M.name(station)
    noted = {remark = {rule = rule, frame = frame, args = args}, counted = stations_of.counted()}
    self.noted:set(place, noted)
  end
  if noted then
    stations_of.add(noted.counted, frame)
  end
  return noted
end

local function not_enabled(self, station, sap, service, frame)
  local set_up, case = station.parameters, "sap_unknown"
  if not OF_RECORDS[service] then
    case = "sap_other"
  elseif set_up then
    case = set_up.flags.dpv1 and "sap_dpv1" or "sap_no_dpv1"
  end
  local set_up_in = OF_RECORDS[service] and station.parameters_frame or nil
  note(self, "DS805", station.address, frame, {sap = sap, case = case, frame = set_up_in},
    concat({sap, case, set_up_in or ""}, " "))
end

-- Empty outputs are those of a master that holds its slaves safe; SC has no inputs.
local function lengths(self, station, outputs, answer)
  local configured, row = station.configuration, tables.profibus.answer[answer.item.code]
  if not configured or configured.flaws[1] or not row or not row.exchange then
    return
  end
  local out, in_, there = configured.output_length, configured.input_length, #answer.item.du
  if there ~= in_ or #outputs > 0 and #outputs ~= out then
    note(self, "DS811", station.address, answer.frame, {
      outputs = #outputs, inputs = there, configured_outputs = out, configured_inputs = in_,
      frame = station.configuration_frame,
    }, concat({#outputs, there, out, in_, station.configuration_frame}, " "))
  end
end

local function parameters(self, station, told, frame)
  local last = station.last_exchange
  if last then
    note(self, "DS810", station.address, frame, {last = last.frame})
  end
  if told.flags.lock and not told.flags.watchdog then
    note(self, "DS815", station.address, frame, {})
  end
end

local function configuration(self, station, told, frame)
  if told.pkw_consistent ~= false then
    return
  end
  for _, module in ipairs(told.modules) do
    if module.role == "PKW" then
      local identifier = hex(module.data):upper()
      note(self, "DS813", station.address, frame, {identifier = identifier}, identifier)
    end
  end
end

local function diagnosis(self, station, told, asker, frame)
  for _, row in ipairs(FAULTS) do
    if told.flags[row[1]] then
      note(self, "DS814", station.address, frame, {case = row[2]}, row[2])
    end
  end
  local set_up = station.parameters
  if not set_up or station.parameters_master ~= asker then
    return
  end
  if told.ident and set_up.ident and told.ident ~= set_up.ident then
    local args = {case = "diag_ident", ident = told.ident, sent = set_up.ident}
    note(self, "DS814", station.address, frame, args, concat({args.case, told.ident, set_up.ident}, " "))
  end
  if told.master and told.master ~= asker then
    note(self, "DS814", station.address, frame, {case = "diag_master", master = told.master},
      "diag_master " .. told.master)
  end
end

--- An exchange with an answer, before the station is what it makes of it.
function Judge:heard(station, exchange, answer)
  local item, at = exchange.request.item, exchange.request.frame
  local service = dp.service(item)
  if answer.item.code == NOT_ENABLED and item.slave_sap then
    not_enabled(self, station, item.slave_sap, service, answer.frame)
  end
  if dp.refuses(answer.item) then
    return
  elseif service == "exchange" then
    lengths(self, station, item.du, answer)
  elseif service == "parameters" then
    parameters(self, station, dp.decode(item), at)
  elseif service == "configuration" then
    configuration(self, station, dp.configuration(item.du), at)
  elseif service == "diagnosis" then
    local told = answer.item.code and dp.decode(answer.item)
    if told and told.kind == "diagnosis" then
      diagnosis(self, station, told, item.sa, answer.frame)
    end
  end
end

--- A record that is not of DS47 was refused (docs/profibus.md 4).
function Judge:refused(station, write, slot, index, status, frame)
  note(self, "DS806", station, frame, {
    operation = write and "DS_Write" or "DS_Read", status = status_hex(status),
    place = {slot = slot, subslot = nil, index = index},
  }, concat({write and 1 or 0, slot, index, status}, " "))
end

--- An answer came after so many polls.
function Judge:answered(station, polls, frame)
  local limit = self.limits.bus_polls
  if polls > limit then
    local noted = note(self, "DS807", station, frame, {limit = limit, polls = polls})
    local remark = noted and noted.remark
    if remark and remark.args.polls < polls then
      remark.args.polls, remark.frame = polls, frame
    end
  end
end

-- Something that happened in some frames.
local function tell(found, rule, happened, args)
  if happened.count > 0 then
    args.count, args.frames = happened.count, json.array(happened.frames)
    found[#found + 1] = {rule = rule, frame = happened.frames[1], args = args}
  end
end

-- What only counts show; repetitions that a recording of two places has are none.
local function counted(self, found, station, copied)
  local device, of = M.name(station.address), station.asked.count
  if not copied then
    tell(found, "DS803", station.retries, {device = device, of = of})
  end
  tell(found, "DS804", station.silent, {device = device, of = of})
  if station.wanting.longest.count >= self.limits.bus_diagnosis then
    tell(found, "DS812", station.wanting.longest, {device = device})
  end
end

--- All that was wrong, when nothing more comes: array of remarks.
function Judge:finish(stations)
  local found, all = {}, stations:all()
  tell(found, "DS801", stations.check, {})
  tell(found, "DS802", stations.broken, {})
  for _, station in ipairs(all) do
    counted(self, found, station, stations:copied())
  end
  for _, noted in self.noted:iterate() do
    local remark = noted.remark
    remark.args.count, remark.args.frames = noted.counted.count, json.array(noted.counted.frames)
    found[#found + 1] = remark
  end
  return found
end

return M
