-- LLDP as PROFINET stations send it: MAC address, station name, management address.
--
-- Lives here: the few TLVs that name a station. Not here: topology.
--
-- The station name is the chassis id (locally assigned), or, in newer devices whose chassis id is a
-- description, what stands behind the first dot of the port id ("port-001.drive-1"). A port sends from
-- a MAC address of its own; the PROFINET TLV (00-0E-CF, 5) says that of the station.

local dcp = require("ds47.profinet.dcp")
local mac_text = require("ds47.profinet.link").mac_text

local byte, sub = string.byte, string.sub

local M = {}

local END, CHASSIS, PORT, MANAGEMENT, ORGANISATION = 0, 1, 2, 8, 127
local MAC_SUBTYPE, LOCAL_SUBTYPE = 4, 7
local LONGEST_NAME = 240
local DIGIT = "[0-9]"
local PORT_ID = "^port%-" .. DIGIT:rep(3) .. "%.(.+)$"
local LONG_PORT_ID = "^port%-" .. DIGIT:rep(3) .. "%-" .. DIGIT:rep(5) .. "%.(.+)$"

--- The text when it obeys the rules for station names (lower case, digits, dots, dashes), else nil.
local function station_name(value)
  value = dcp.without_zeros(value)
  if #value <= LONGEST_NAME
    and (value:find("^[a-z0-9]$") or value:find("^[a-z0-9][a-z0-9.%-]*[a-z0-9]$")) then
    return value
  end
end

local learn = {
  [CHASSIS] = function(station, value)
    local subtype = byte(value, 1)
    if subtype == LOCAL_SUBTYPE then
      station.name = station_name(sub(value, 2))
    elseif subtype == MAC_SUBTYPE and #value == 7 then
      station.mac = mac_text(sub(value, 2))
    end
  end,
  [PORT] = function(station, value)
    if byte(value, 1) == LOCAL_SUBTYPE then
      local id = sub(value, 2)
      station.port_name = id:match(PORT_ID) or id:match(LONG_PORT_ID)
    end
  end,
  [MANAGEMENT] = function(station, value)
    if sub(value, 1, 2) == "\5\1" and #value >= 6 then station.ip = dcp.address(sub(value, 3, 6)) end
  end,
  [ORGANISATION] = function(station, value)
    if sub(value, 1, 3) == "\x00\x0e\xcf" then
      station.ours = true
      if byte(value, 4) == 5 and #value >= 10 then station.mac = mac_text(sub(value, 5, 10)) end
    end
  end,
}

--- What an LLDP frame says about a station, nil when no PROFINET station speaks. Takes any bytes.
-- @param data the LLDPDU
-- @param src_mac text or nil
-- @return {mac, ip, name}; nil where it says nothing
function M.parse(data, src_mac)
  local heard = {mac = src_mac}
  local at = 0
  while at + 2 <= #data do -- a TLV that is cut off ends it, too
    local high, low = byte(data, at + 1, at + 2)
    local kind, length = (high - high % 2) / 2, high % 2 * 256 + low
    if kind == END or at + 2 + length > #data then break end
    if learn[kind] then learn[kind](heard, sub(data, at + 3, at + 2 + length)) end
    at = at + 2 + length
  end
  local name = heard.port_name and station_name(heard.port_name) or heard.name
  if heard.ours and (name or heard.ip) then return {mac = heard.mac, ip = heard.ip, name = name} end
end

return M
