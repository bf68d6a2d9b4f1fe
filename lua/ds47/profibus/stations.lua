-- What the stations of a line did: counts and times, what Set_Prm, Chk_Cfg and Slave_Diag said
-- (docs/profibus.md 7).
--
-- Hears of the frames and the exchanges of a line. What is wrong with it is the business of judge.lua.
--
-- A station is {address, asks, asked, silent, damaged, retries, answers, cycles, exchanges, last_exchange,
-- wanting, parameters, parameters_frame, parameters_master, configuration, configuration_frame, diagnosis,
-- diagnosis_frame}: `asks` of a master; counts of requests to it that somebody answers, of those without
-- an answer, of damaged frames in the place of answers, of repetitions, each {count, frames}, the first
-- ones; `copies`: repetitions that are left where each frame stands there twice, `copied`: damaged frames
-- that are not; times {count, least, total, most}; and the newest of what was said to it and by it.

local dp = require("ds47.profibus.dp")
local tables = require("ds47.spec.tables")

-- Frames that are kept of what happens again and again.
local M = {MOST_FRAMES = 60}

-- It happened again, in a frame: {count, frames}, the first of these are kept.
function M.add(counted, frame)
  counted.count = counted.count + 1
  if counted.count <= M.MOST_FRAMES then
    counted.frames[#counted.frames + 1] = frame
  end
end

--- Something that did not happen yet.
function M.counted()
  return {count = 0, frames = {}}
end

local add, counted = M.add, M.counted

local function times()
  return {count = 0, least = 0, total = 0, most = 0}
end

-- A negative time, which a clock that was set back leaves, is none.
local function add_time(all, time_ns)
  if time_ns < 0 then
    return
  end
  all.least = (all.count == 0 or time_ns < all.least) and time_ns or all.least
  all.most = time_ns > all.most and time_ns or all.most
  all.count = all.count + 1
  all.total = all.total + time_ns
end

local function span(all)
  if all.count == 0 then
    return nil
  end
  return {least = all.least, mean = (all.total - all.total % all.count) / all.count, most = all.most}
end

local function new_station(address)
  return {
    address = address, asks = false, asked = counted(), silent = counted(), damaged = counted(),
    retries = counted(), copies = 0, copied = 0, answers = times(), cycles = times(),
    exchanges = counted(), last_exchange = nil,
    wanting = {asked = 0, fetched = 0, longest = counted(), row = counted()},
  }
end

local Stations = {}
Stations.__index = Stations

--- Takes the frames and the exchanges of a line.
-- @param judge  is told of each exchange with an answer, and of its station before it counts there:
--   judge:heard(station, exchange, answer)
function M.new(judge)
  return setmetatable({
    judge = judge,
    stations = {}, -- by address
    frames = 0, tokens = 0,
    check = counted(), -- frames with a wrong check byte,
    broken = counted(), -- and those that are damaged otherwise
    doubled = 0, -- answers that stand there twice: a recording of two places has everything twice,
    answers = 0, -- and how many there are
    answer = nil, -- the bytes of the last frame, if it was one
  }, Stations)
end

--- The station with this address.
function Stations:station(address)
  local found = self.stations[address]
  if not found then
    found = new_station(address)
    self.stations[address] = found
  end
  return found
end

--- All that were seen, by address.
function Stations:all()
  local found = {}
  for address = 0, 127 do
    found[#found + 1] = self.stations[address]
  end
  return found
end

-- The kinds of what is wrong with a frame, as a set; nil for nothing.
local function kinds_of(item)
  local kinds = item.flaws[1] and {} or nil
  for _, flaw in ipairs(item.flaws) do
    kinds[flaw.kind] = true
  end
  return kinds
end

--- A frame, before what it belongs to is known.
-- @param cut  whether the recording did not keep all of it; that is no fault of the line
function Stations:frame(seen, cut)
  local item = seen.item
  local kinds = kinds_of(item)
  self.frames = self.frames + 1
  if kinds then
    if not (cut and kinds.cut) then
      add(kinds.check and self.check or self.broken, seen.frame)
    end
  elseif item.kind == "SD4" then
    self.tokens = self.tokens + 1
    self:station(item.sa).asks = true
  end
  if item.request then
    self.answer = nil
    return
  end
  if not kinds and item.kind ~= "SD4" then
    self.answers = self.answers + 1
    self.doubled = self.doubled + (item.data == self.answer and 1 or 0)
  end
  self.answer = item.data
end

local function count(station, exchange)
  local seen, answer, retries = exchange.request, exchange.answer, exchange.retries
  add(station.asked, seen.frame)
  if exchange.again then
    add(station.retries, seen.frame)
  end
  if exchange.retried > 0 then
    for _, each in ipairs(retries) do add(station.retries, each.frame) end
    station.retries.count = station.retries.count + exchange.retried - #retries
  end
  local pairs_left = (exchange.retried - exchange.retried % 2) / 2
  station.copies = station.copies + pairs_left + (exchange.again and 1 or 0)
  if exchange.damaged then
    add(station.damaged, exchange.damaged)
    station.damaged.count = station.damaged.count + exchange.spoiled - 1
    station.copied = station.copied + exchange.copied
  elseif not answer and not exchange.cut then
    add(station.silent, seen.frame)
  end
  if answer and exchange.retried <= #retries then -- else nobody knows when the last one was sent
    add_time(station.answers, answer.time_ns - (retries[#retries] or seen).time_ns)
  end
end

-- An answer of data exchange: how often in a row the station asks for Slave_Diag.
local function wants(wanting, wanted, frame)
  if not wanted then
    wanting.row = wanting.row.count > 0 and counted() or wanting.row
    return
  end
  if wanting.row.count == 0 then
    wanting.asked = wanting.asked + 1
  end
  add(wanting.row, frame)
  if wanting.row.count > wanting.longest.count then
    wanting.longest = wanting.row
  end
end

local function exchanged(station, exchange, answer)
  local row = tables.profibus.answer[answer.item.code]
  local short = answer.item.kind == "SC" -- of a station without inputs
  if not short and not (row and row.exchange) then
    return
  end
  local seen, last = exchange.request, station.last_exchange
  if last and not exchange.again then
    add_time(station.cycles, seen.time_ns - last.time_ns)
  end
  station.last_exchange = seen
  add(station.exchanges, seen.frame)
  station.outputs, station.inputs = #seen.item.du, #(answer.item.du or "")
  wants(station.wanting, not short and row.wants, answer.frame)
end

-- What an exchange with an answer says of the station.
local function keep(station, exchange, answer)
  local item = exchange.request.item
  local name = dp.service(item)
  if dp.refuses(answer.item) then
    return
  elseif name == "exchange" then
    exchanged(station, exchange, answer)
  elseif name == "parameters" then
    station.parameters, station.parameters_frame = dp.decode(item), exchange.request.frame
    station.parameters_master, station.last_exchange = item.sa, nil
  elseif name == "configuration" then
    station.configuration, station.configuration_frame = dp.configuration(item.du), exchange.request.frame
  elseif name == "diagnosis" and answer.item.du and answer.item.du ~= "" then
    local told, wanting = dp.decode(answer.item), station.wanting
    if told and told.kind == "diagnosis" then
      station.diagnosis, station.diagnosis_frame = told, answer.frame
      wanting.fetched = wanting.fetched + (wanting.row.count > 0 and 1 or 0)
      wanting.row = counted()
    end
  end
end

--- An exchange that is over.
function Stations:take(exchange)
  local item, answer = exchange.request.item, exchange.answer
  self:station(item.sa).asks = true
  local row = tables.profibus.request[item.code]
  if exchange.silent or not answer and (exchange.unfinished or row and row.probe) then
    return
  end
  local station = self:station(item.da)
  count(station, exchange)
  if answer then
    self.judge:heard(station, exchange, answer)
    keep(station, exchange, answer)
  end
end

--- Whether the line was recorded at two places: so many answers stand there twice.
function Stations:copied()
  return self.answers > 0 and self.answers <= 3 * self.doubled
end

--- No frame comes any more: whether the recording has each frame twice is known.
function Stations:finish()
  for _, station in ipairs(self:all()) do
    if self:copied() then
      station.retries.count = station.copies
      station.damaged.count = station.damaged.count - station.copied
    end
  end
end

local function told_diagnosis(station)
  local told = station.diagnosis
  if not told then
    return nil
  end
  local ids, blocks = {}, {}
  for number, id in ipairs(told.flags) do ids[number] = id end
  for number, block in ipairs(told.blocks) do blocks[number] = block.data end
  return {
    frame = station.diagnosis_frame, flags = ids, master = told.master, ident = told.ident, blocks = blocks,
  }
end

local function told(station)
  local set_up, diagnosis, configured = station.parameters, station.diagnosis, station.configuration
  local ident
  if set_up then ident = set_up.ident elseif diagnosis then ident = diagnosis.ident end
  return {
    address = station.address, role = station.asks and "master" or "slave", ident = ident,
    ppo = configured and configured.ppo or nil, watchdog_ms = set_up and set_up.watchdog_ms or nil,
    requests = station.asked.count, unanswered = station.silent.count, damaged = station.damaged.count,
    retries = station.retries.count, exchanges = station.exchanges.count,
    outputs = station.outputs, inputs = station.inputs, cycle = span(station.cycles),
    answer = span(station.answers), diagnoses_wanted = station.wanting.asked,
    diagnoses_fetched = station.wanting.fetched, parameters = station.parameters_frame,
    configuration = station.configuration_frame, diagnosis = told_diagnosis(station),
  }
end

--- As the result has it: {frames, tokens, damaged, stray, stations}; nil where there was no frame.
-- @param stray  answers that nobody asked for
-- @param echoes  those of them that stand directly behind the same answer
function Stations:told(stray, echoes)
  if self.frames == 0 then
    return nil
  end
  local found = {}
  for _, station in ipairs(self:all()) do
    if station.asks or station.asked.count > 0 then
      found[#found + 1] = told(station)
    end
  end
  return {
    frames = self.frames, tokens = self.tokens, damaged = self.check.count + self.broken.count,
    stray = self:copied() and stray - echoes or stray,
    stations = found,
  }
end

return M
