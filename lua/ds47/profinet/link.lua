-- Where the network layer of a frame begins, behind Ethernet, a cooked header (Linux SLL, SLL2) and VLAN
-- tags, and the MAC addresses in front of it.
--
-- VLAN tags have 4 bytes, so what is left of the offset of the network layer tells the link type.

local byte, sub = string.byte, string.sub

local M = {}

--- The EtherType of PROFINET, as `network` takes it.
M.PROFINET = {[0x8892] = true}

-- Places of the EtherType, and where what it tells begins: Ethernet, SLL, SLL2.
local HEADERS = {{12, 14}, {14, 16}, {0, 20}}

--- Unsigned, 16 bits, big-endian; nil where the data ends before.
function M.u16(data, offset)
  local high, low = byte(data, offset + 1, offset + 2)
  return low and high * 256 + low
end

--- Offset of the network layer of one of these EtherTypes, and which; nil of any other frame.
-- @param kinds EtherType -> something
function M.network(frame, kinds)
  for _, header in ipairs(HEADERS) do
    local kind, at = M.u16(frame, header[1]), header[2]
    while kind == 0x8100 or kind == 0x88A8 or kind == 0x9100 or kind == 0x9200 do
      kind, at = M.u16(frame, at + 2), at + 4
    end
    if kinds[kind] then return at, kind end
  end
  return nil
end

--- A MAC address as text: 00:0e:cf:01:02:03.
function M.mac_text(address) return ("%02x:%02x:%02x:%02x:%02x:%02x"):format(byte(address, 1, 6)) end

local function is_ethernet(offset) return offset % 4 == 2 and offset >= 14 end

--- The MAC address of the sender of a frame whose network layer begins at `offset`, six bytes; nil for none.
function M.source(frame, offset)
  if is_ethernet(offset) then return sub(frame, 7, 12) end
  if offset >= 20 and byte(frame, 1) ~= 0 then return byte(frame, 12) == 6 and sub(frame, 13, 18) or nil end
  return offset >= 16 and sub(frame, 5, 6) == "\0\6" and sub(frame, 7, 12) or nil
end

--- That of its receiver, which a cooked header does not know: "" there.
function M.receiver(frame, offset) return is_ethernet(offset) and sub(frame, 1, 6) or "" end

return M
