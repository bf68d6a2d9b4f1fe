-- What the analysis says, as the types that fields of Wireshark take: numbers of words, numbers, addresses,
-- bytes that the frame does not have. Which field has which type is in fields.lua.

local bit_of = require("ds47.support.bits").bit
local code_of = require("ds47.profidrive.formats").code_of
local entries = require("ds47.support.later").entries
local tables = require("ds47.spec.tables")

local gsub, match, rep = string.gsub, string.match, string.rep

local M = {}

local KEPT = 256 -- addresses that are remembered

--- The words of a table of tables.codes by their numbers, for Wireshark to show beside them.
function M.words(name)
  local found = {}
  for word, code in pairs(tables.codes[name]) do found[code] = word end
  return found
end

--- The code of a format by its name, which is `0x77` where it has none; nil of nil.
function M.format_code(name) return name and (code_of(name) or tonumber(name)) end

local FLOAT_WORDS = { NaN = 0 / 0, Infinity = 1 / 0, ["-Infinity"] = -1 / 0 }

--- A value as a double: integers that have more digits than a double are texts, and lose the last ones.
-- @return nil where it is no number
function M.number(value)
  if type(value) == "number" then return value end
  return FLOAT_WORDS[value] or tonumber(value)
end

--- `.... .1..`, as Wireshark shows a bit of a number of so many bits.
function M.picture(number, bit, width)
  local dots = rep(".", width - 1 - bit) .. bit_of(number, bit) .. rep(".", bit)
  return (gsub(dots, "....", "%0 "):sub(1, -2))
end

-- Of both ends the field of each kind of address.
local ENDS = {
  controller = { ip = "controller", mac = "controller.mac", bus = "master" },
  device = { ip = "device", mac = "device.mac", bus = "station" },
}

-- What kind of address a text is, and what a field takes of it: nil of what is none.
local PEERS = entries(function(text)
  local station = match(text, "^dp(%d+)$")
  if station then return { kind = "bus", value = tonumber(station) } end
  if match(text, "^%d+%.%d+%.%d+%.%d+$") then return { kind = "ip", value = Address.ip(text) } end
  if match(text, "^%x%x:%x%x:%x%x:%x%x:%x%x:%x%x$") then
    return { kind = "mac", value = Address.ether(text) }
  end
  return { kind = "ip" }
end, KEPT)

--- Adds controller and device of a transaction or of a relation: by IP, without one by MAC, on PROFIBUS by
-- the addresses of master and station.
-- @param put the functions of tree.lua that add fields
function M.add_peers(put, parent, about)
  for _, name in ipairs({ "controller", "device" }) do
    local peer = about[name] and PEERS[about[name]]
    if peer then put.derive(parent, ENDS[name][peer.kind], peer.value) end
  end
end

--- Bytes that this frame does not have, as a source of data beside it: a tab below the bytes of the frame.
-- @param find_bytes a function that finds bytes in the frame
-- @return TvbRange
function M.range_of(data, name, find_bytes)
  return data == "" and find_bytes("") or ByteArray.new(data, true):tvb(name):range()
end

return M
