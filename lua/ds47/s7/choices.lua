-- What a user may choose for S7: ports, and how many bytes which server copies at once (docs/s7.md 8).
--
-- From the words of the preferences to what communication.lua takes; what they do is known elsewhere. A word
-- that means nothing is left out.

local tables = require("ds47.spec.tables")

local M = {}

local MOST_PORTS = 16 -- 102 among them
local MOST_BYTES = 0xFFFF

-- Words of a text; they stand between blanks, commas or semicolons.
local function words(text)
  return (text or ""):gmatch("[^%s,;]+")
end

local function ports_of(text)
  local found = {}
  for word in words(text) do
    local port = word:match("^%d+$") and tonumber(word)
    if port and port > 0 and port <= 0xFFFF and #found < MOST_PORTS - 1 then found[#found + 1] = port end
  end
  return found
end

-- `10.0.0.2=s7-400` of one server, `s7-400` of all others (their address is ""); `take` gives the value of a
-- word.
local function by_address(text, take)
  local found = {}
  for word in words(text) do
    local ip, name = word:match("^(.*)=([^=]*)$")
    local value = take(name or word)
    if value then found[ip or ""] = value end
  end
  return found
end

--- The choices in words.
-- @param ports  `1102 2102`
-- @param cpus  kinds of CPU (tables.s7.cpus): `s7-400`, or `10.0.0.2=s7-400` for one server
-- @param blocks  bytes likewise
-- @param readback  whether what is read has to be what was written (DS916)
-- @return table as communication.lua takes it
function M.parse(ports, cpus, blocks, readback)
  return {
    ports = ports_of(ports),
    cpus = by_address(cpus, function(name) return tables.s7.cpus[name] and name end),
    blocks = by_address(blocks, function(size)
      local number = size:match("^%d+$") and tonumber(size)
      return number and number > 0 and number <= MOST_BYTES and number or nil
    end),
    readback = readback,
  }
end

return M
