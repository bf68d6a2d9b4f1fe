-- Services of MS1 and MS2 on PROFIBUS to the same events as RPC calls on PROFINET (docs/profibus.md 6).
--
-- Sits between the services (services.lua) and the records (record_events.lua), as record_calls.lua
-- does for RPC. Which frames a service has, and what is wrong with them, is not here.

local MOST_DATA = require("ds47.profibus.ms1").MOST_DATA
local dp = require("ds47.profibus.dp")
local family_of = require("ds47.profidrive.dictionary").family_of

local M = {}

local Ms1Calls = {}
Ms1Calls.__index = Ms1Calls

--- The handlers of a `CallTracker` of services.lua.
-- @param events  hears of every record that may be ours (record_events.lua)
-- @param findings  is told what is wrong with a request: findings:add(remark)
-- @param idents  knows of which make stations are (profibus/idents.lua)
function M.new(events, findings, idents)
  return setmetatable({
    events = events, concerned = events.index47.concerned, findings = findings, idents = idents,
    newest = nil, -- the call that the last frame asked for; whoever feeds frames forgets it
    written = {}, -- stations and indices that were written there -> the frame of the first time
  }, Ms1Calls)
end

--- Whether a record was written to an index of a station before a frame.
function Ms1Calls:was_written(device, index, before)
  return (self.written[device .. " " .. index] or before) < before
end

local peers = {}

--- Who talks to whom: {controller, device, vendor_id, vendor_assumed, station, family}; `dp2` is the station
-- with the address 2, the rest is as `Idents:whose` tells it. MICROMASTER is of Siemens, but has none of the
-- error numbers of SINAMICS: its calls have no vendor.
-- The same table again for the same ones, so nobody may change it.
function M.peer(master, station, vendor_id, family, assumed)
  local key = ("%d %d %d %s %s"):format(master, station, vendor_id or -1, family or "", assumed)
  local peer = peers[key]
  if peer == nil then
    local whose = (family == nil or family == family_of(vendor_id)) and vendor_id or nil
    peer = {
      controller = ("dp%d"):format(master), device = ("dp%d"):format(station), station = station,
      vendor_id = whose, vendor_assumed = assumed and whose or nil, family = family,
    }
    peers[key] = peer
  end
  return peer
end

local StartUps = {}
StartUps.__index = StartUps

--- Hears of the exchanges of a line, for the stations that get their parameters (Set_Prm): a station may have
-- been switched off and on before that, as a device before its Connect.
-- @param pairing is told of them: pairing:started(station, {frame, time_ns})
function M.start_ups(pairing) return setmetatable({pairing = pairing, stations = {}}, StartUps) end

--- Whether the capture has a start-up of a station before a frame, and behind another one.
function StartUps:seen(device, before, behind)
  local frame = self.stations[device] or before
  return behind < frame and frame < before
end

--- An exchange; one without an answer, or that was refused, says nothing here.
function StartUps:take(exchange)
  local item, answer = exchange.request.item, exchange.answer
  if dp.service(item) == "parameters" and answer and not dp.refuses(answer.item) then
    local peer = M.peer(item.sa, item.da)
    self.stations[peer.device] = self.stations[peer.device] or exchange.request.frame
    local asked = exchange.request
    self.pairing:started(peer.device, {frame = asked.frame, time_ns = asked.time_ns})
  end
end

-- Where something happens to a record, as record_events.lua takes it.
local function origin(self, call, half)
  local peer = M.peer(call.master, call.station, self.idents:whose(call.station))
  return {frame = half.frame, time_ns = half.time_ns, peer = peer, missing = 0}
end

function Ms1Calls:_writing(call)
  local record, device = call.record, M.peer(call.master, call.station).device
  local place = device .. " " .. record.index
  self.written[place] = self.written[place] or record.request.frame
  if record.request.stated > MOST_DATA then
    local args = {device = device, length = record.request.stated, most = MOST_DATA}
    self.findings:add({rule = "DS809", frame = record.request.frame, args = args})
  end
end

function Ms1Calls:asked(call)
  local record = call.record
  self.newest = call
  if record.write then self:_writing(call) end
  self.events:asked(origin(self, call, record.request), record)
end

function Ms1Calls:failed(call)
  local record = call.record
  if self.concerned[record.index] then
    local here = origin(self, call, record.response)
    self.events:failed(here, record)
    self.events:lost(here, record)
  end
end

-- What happens to a record with one half of its call is told as it is.
for event, half in pairs({answered = "response", lost = "request", unasked = "response"}) do
  Ms1Calls[event] = function(self, call)
    local record = call.record
    if self.concerned[record.index] then
      self.events[event](self.events, origin(self, call, record[half]), record)
    end
  end
end

return M
