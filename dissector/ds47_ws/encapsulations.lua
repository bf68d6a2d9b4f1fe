-- Which encapsulations of Wireshark are PROFIBUS, and what becomes of their other frames.
--
-- Wireshark knows no LINKTYPE_PROFIBUS_DL (257): a pcapng with it has "unknown" frames, and those are ours as
-- far as they prove it. USER0 (147) belongs to the user: it is taken while a preference says so, and given
-- back then. What is in a frame is the business of the entry file.

local bus = require("ds47.profibus.bus")

local M = {}

local UNKNOWN, USER0 = 0, 45 -- WTAP_ENCAP_UNKNOWN, WTAP_ENCAP_USER0

-- Who had it when Wireshark started: plugins that are loaded anew leave nobody there.
local AT_START = { [USER0] = "user_dlt" }

local encapsulations = DissectorTable.get("wtap_encap")
local before = {} -- by encapsulation: the dissector that had it; false for none
local data -- the dissector that shows bytes

-- Somebody else may have taken it since.
local function is_ours(encapsulation, proto)
  return tostring(encapsulations:get_dissector(encapsulation)) == tostring(Dissector.get(proto.name:lower()))
end

local function owner(encapsulation)
  local at_start = AT_START[encapsulation]
  return encapsulations:get_dissector(encapsulation) or at_start and Dissector.get(at_start) or false
end

local function take(encapsulation, proto)
  if before[encapsulation] == nil then
    before[encapsulation] = owner(encapsulation)
    encapsulations:add(encapsulation, proto)
  end
end

local function give_back(encapsulation, proto)
  local former = before[encapsulation]
  if former and is_ours(encapsulation, proto) then encapsulations:add(encapsulation, former) end
  before[encapsulation] = nil
end

--- Gives the protocol the encapsulations that are PROFIBUS.
-- @param with_user0 whether USER0 is, which may change at any time
function M.register(proto, with_user0)
  take(UNKNOWN, proto)
  if with_user0 then
    take(USER0, proto)
  elseif before[USER0] ~= nil then
    give_back(USER0, proto)
  end
end

--- The link type of the frame that is dissected, as profibus/bus.lua knows it. Where a user mapped another
-- one to PROFIBUS, that is as USER0.
function M.link_type(pinfo) return pinfo.match == UNKNOWN and bus.PROFIBUS_DL or bus.USER0 end

--- Shows a frame that is not PROFIBUS as it was before there was this plugin.
function M.pass_on(tvb, pinfo, tree)
  local encapsulation = pinfo.match
  local former = before[encapsulation]
  if former then
    pcall(former.call, former, tvb, pinfo, tree) -- it has told of a damaged frame itself
    return
  end
  data = data or Dissector.get("data")
  pinfo.cols.protocol, pinfo.cols.info = "UNKNOWN", "WTAP_ENCAP = " .. encapsulation
  data:call(tvb, pinfo, tree)
end

return M
