-- Names for the devices of a capture: RPC object UUID, Connect, DCP and LLDP, put together by IP and MAC.

local later = require("ds47.support.later").module
local dcp = later("ds47.profinet.dcp")
local lldp = later("ds47.profinet.lldp")
local ordered = require("ds47.support.ordered")
local rpc = require("ds47.profinet.rpc")
local tables = require("ds47.spec.tables")

local M = {}

local Stations = {}
Stations.__index = Stations
M.Stations = Stations

--- Collects what the capture says about who is who.
-- @param most how many stations are kept, the oldest goes first, and how many devices, the first stay; nil
--   for the shipped limit
-- @param vendor_id whose devices are of which nothing says a vendor; nil: nobody's
function Stations.new(most, vendor_id)
  return setmetatable({
    servers = ordered.new(), stations = ordered.new(), most = most or tables.limits.stations,
    by_ip = ordered.new(), -- MAC address of the station that was the last to say that it has an IP address
    vendor_id = vendor_id,
  }, Stations)
end

--- Takes a DCP or LLDP packet.
-- @param kind "dcp" (payload begins with the frame id) or "lldp" (payload is the LLDPDU)
-- @param src_mac, dst_mac text, or nil where the link type has none; a DCP Set names its destination
function Stations:station(kind, payload, src_mac, dst_mac)
  local parse = kind == "dcp" and dcp.parse or lldp.parse
  local station = parse(payload, src_mac, dst_mac)
  if not station or not station.mac then return end
  local known = self.stations:pop(station.mac)
  if known then
    for key, value in pairs(known) do
      if station[key] == nil then station[key] = value end
    end
  end
  if station.ip then self.by_ip:keep(station.ip, station.mac, self.most) end
  self.stations:keep(station.mac, station, self.most)
end

--- Vendor id of a device whose record call does not say it: as shown up to now, else what is assumed. The
-- second value is true where it is assumed.
function Stations:vendor(ip)
  local device = self.servers:get(ip)
  if device and device.vendor_id then return device.vendor_id, false end
  local mac = self.by_ip:get(ip)
  local station = mac and self.stations:get(mac)
  if station == nil or station.ip ~= ip then
    station = device and device.mac and self.stations:get(device.mac)
  end
  if station and station.vendor_id then return station.vendor_id, false end
  return self.vendor_id, self.vendor_id ~= nil
end

--- Vendor id of the station with a MAC address: as shown up to now, else what is assumed.
function Stations:vendor_of(mac)
  local station = self.stations:get(mac)
  if station and station.vendor_id then return station.vendor_id end
  for _, device in self.servers:iterate() do
    if device.mac == mac and device.vendor_id then return device.vendor_id end
  end
  return self.vendor_id
end

--- Takes an RPC message: responses come from devices, a Connect names device and controller.
-- @param src_mac of the frame that it came in, or that completed it: text, nil where that is not known
function Stations:message(pdu, src_mac)
  local ptype = pdu.ptype
  if ptype == 2 and pdu.opnum ~= rpc.CONTROL then -- a controller answers ApplicationReady
    self:_learn(pdu.source, src_mac, pdu.object_uuid)
  elseif ptype == 0 and pdu.opnum == rpc.CONNECT then
    self:_learn(pdu.destination, nil, pdu.object_uuid)
  end
end

--- Every device that answered or was connected to, in the order of first sight.
-- An array of {ip, mac, station, vendor_id, assumed_vendor_id, device_id}, made anew each time.
function Stations:devices()
  local by_ip, devices = {}, {}
  for _, station in self.stations:iterate() do
    if station.ip then by_ip[station.ip] = station end
  end
  for ip, device in self.servers:iterate() do
    local station = by_ip[ip] or device.mac and self.stations:get(device.mac) or {}
    local vendor_id = device.vendor_id or station.vendor_id
    devices[#devices + 1] = {
      ip = ip, mac = device.mac or station.mac, station = station.name,
      vendor_id = vendor_id, assumed_vendor_id = not vendor_id and self.vendor_id or nil,
      device_id = device.device_id or station.device_id,
    }
  end
  return devices
end

function Stations:_learn(ip, mac, object_uuid)
  local device = self.servers:get(ip)
  if device and device.mac and device.vendor_id then return end -- nothing is left to learn
  if not device then
    if self.servers.length >= self.most then return end
    device = {ip = ip}
    self.servers:set(ip, device)
  end
  device.mac = device.mac or mac
  if device.vendor_id == nil then device.vendor_id, device.device_id = rpc.device_identity(object_uuid) end
end

return M
