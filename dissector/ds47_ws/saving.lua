-- Files that the plugin writes: never over a capture, and from the window over nothing at all.
--
-- Knows nothing of Wireshark; what is written is given to it as text (stats.lua, menu.lua).

local any = require("ds47.support.arrays").any

local M = {}

-- First bytes of what nobody writes over: pcap of either byte order and unit, pcapng, snoop, btsnoop, two of
-- Network Monitor, Peek; gzip, zstd and lz4, in which a capture may be.
local CAPTURES = {
  "\xA1\xB2\xC3\xD4", "\xD4\xC3\xB2\xA1", "\xA1\xB2\x3C\x4D", "\x4D\x3C\xB2\xA1",
  "\xA1\xB2\xCD\x34", "\x34\xCD\xB2\xA1", "\x0A\x0D\x0D\x0A", "snoo", "btsn", "RTSS", "GMBU", "\x7Fver",
  "\x1F\x8B", "\x28\xB5\x2F\xFD", "\x04\x22\x4D\x18",
}
local NO_SUCH_FILE = 2 -- on every system
local MOST_NAMES = 10000 -- that are tried

local function holds_capture(file)
  local head = file:read(4) or ""
  return any(CAPTURES, function(magic) return head:sub(1, #magic) == magic end)
end

-- Not "rb": that would wait for the writer of a pipe.
local function open_there(path) return io.open(path, "r+b") end

-- Nil where nothing of this name is there; else why it cannot be taken, be it a folder or what one may not
-- read.
local function taken(path)
  local file, problem, number = open_there(path)
  if file then
    file:close()
    return path .. ": is there already"
  end
  return number ~= NO_SUCH_FILE and problem or nil
end

--- A name of which no file is there: `NAME`, else `NAME-2`, `NAME-3`, ...
-- @param name a path without ending
-- @param endings array of what is put behind it; of none of them there is a file
-- @return the name without ending; or nil and why there is none
function M.free_name(name, endings)
  local problem
  for number = 1, MOST_NAMES do
    local tried = number == 1 and name or string.format("%s-%d", name, number)
    problem = nil
    for _, ending in ipairs(endings) do problem = problem or taken(tried .. ending) end
    if problem == nil then return tried end
  end
  return nil, problem
end

--- Writes a text to a file as it is, but never over a capture.
-- @return true and whether another file of that name was written over; or nil and what went wrong
function M.write(path, text)
  local there = open_there(path)
  local size = there and there:seek("end") -- a pipe cannot be asked
  if size and there:seek("set") and holds_capture(there) then
    there:close()
    return nil, path .. ": a capture or a packed file is not overwritten: choose another name"
  end
  local file, problem = io.open(path, "wb")
  if there then there:close() end
  if not file then return nil, problem end
  local written, reason = file:write(text)
  local closed, late = file:close()
  if not (written and closed) then return nil, reason or late end
  return true, size ~= nil and size > 0
end

return M
