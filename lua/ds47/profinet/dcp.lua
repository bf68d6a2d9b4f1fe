-- PROFINET DCP: which station has which name, IP address, vendor and device id.
--
-- Lives here: Identify, Get and Hello answers, and Set requests (what a controller assigns is taken to
-- be so: a refused Set is rare, and the next Identify corrects it). Not here: DCP as a conversation.
--
-- Frame: frame id (2), service id (1), service type (1), transaction (4), delay (2), length (2), then
-- blocks: option (1), suboption (1), length (2), content, padded to even. In answers and Hello two
-- bytes of block information come before the content, in a Set request two bytes of qualifier.

local latin1 = require("ds47.support.bytes").latin1

local byte, sub = string.byte, string.sub

local M = {}

local GET, SET, IDENTIFY, HELLO = 3, 4, 5, 6
local REQUEST, SUCCESS = 0, 1
local HEADER = 12

-- Option and suboption in one number.
local IP, IP_SUITE = 0x0102, 0x0103
local NAME, DEVICE_ID = 0x0202, 0x0203

--- The IPv4 address in the first four bytes of a text; nil for 0.0.0.0 (none assigned yet) and for less.
function M.address(content)
  local a, b, c, d = byte(content, 1, 4)
  if d and (a ~= 0 or b ~= 0 or c ~= 0 or d ~= 0) then return ("%d.%d.%d.%d"):format(a, b, c, d) end
end

--- A text without the zero bytes at its end.
function M.without_zeros(text) return (text:reverse():gsub("^\0+", ""):reverse()) end

local function learn(station, option, content)
  if option == IP or option == IP_SUITE then
    station.ip = M.address(content) or station.ip
  elseif option == NAME and content ~= "" then
    local name = M.without_zeros(content)
    station.name = name ~= "" and latin1(name) or nil
  elseif option == DEVICE_ID and #content >= 4 then
    local v1, v2, d1, d2 = byte(content, 1, 4)
    station.vendor_id, station.device_id = v1 * 256 + v2, d1 * 256 + d2
  end
end

--- What a DCP frame says about a station, nil when it names nobody. Takes any bytes.
-- @param data the frame from the frame id on
-- @param src_mac, dst_mac text or nil; a Set request names its destination
-- @return {mac, ip, name, vendor_id, device_id}; nil where it says nothing
function M.parse(data, src_mac, dst_mac)
  if #data < HEADER then return nil end
  local service, kind = byte(data, 3, 4)
  local station
  if service == SET and kind == REQUEST then
    station = {mac = dst_mac}
  elseif (service == GET or service == IDENTIFY) and kind == SUCCESS or service == HELLO then
    station = {mac = src_mac}
  else
    return nil
  end
  local high, low = byte(data, 11, 12)
  local at, stop = HEADER, math.min(HEADER + high * 256 + low, #data)
  while at + 4 <= stop do
    local option, suboption, s1, s2 = byte(data, at + 1, at + 4)
    local size = s1 * 256 + s2
    if at + 4 + size > stop then break end
    if size >= 2 then -- without the block information or qualifier in front
      learn(station, option * 256 + suboption, sub(data, at + 7, at + 4 + size))
    end
    at = at + 4 + size + size % 2
  end
  return (station.ip or station.name or station.vendor_id) and station or nil
end

return M
