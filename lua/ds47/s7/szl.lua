-- What a CPU says of itself in a system status list (SZL) that somebody reads (docs/s7.md 6).
--
-- Only lists that tell which CPU it is, or how many bytes it reads consistently for a panel.

local DONE = require("ds47.s7.model").DONE
local reader = require("ds47.support.bytes")

local floor, min = math.floor, math.min
local u16 = reader.u16

local M = {}

-- By id and index of an SZL: what it says, the bytes of an entry, where in it the text or number begins, and
-- how many bytes that has, and the index of the entry
local SZL = {
  [0x0131] = {[3] = {"consistent", 40, 6, 2, 3}},
  [0x0011] = {[0] = {"order_number", 28, 2, 20, 1}}, [0x0111] = {[1] = {"order_number", 28, 2, 20, 1}},
  [0x001C] = {[0] = {"module", 34, 2, 32, 7}}, [0x011C] = {[7] = {"module", 34, 2, 32, 7}},
}

-- Bytes of Latin-1 up to the first zero as text without white space around it; nil for none that can be
-- printed.
local function text_of(value)
  local text = value:sub(1, (value:find("\0", 1, true) or #value + 1) - 1)
  text = text:match("^[\9-\13\28-\32\133\160]*(.-)[\9-\13\28-\32\133\160]*$")
  if text == "" or text:find("[\1-\31\127-\160\173]") then return nil end
  return reader.latin1(text)
end

--- What the answer to the reading of an SZL says of the CPU.
-- @param told  as pdu.lua has user data
-- @return array of {at, szl_id, szl_index, name ("consistent", "order_number" or "module"), value}
function M.evidence(told, at)
  local content, found = told.content, {}
  if told.code ~= DONE or #content < 8 then return found end
  local szl_id, szl_index, length, number = u16(content, 0), u16(content, 2), u16(content, 4), u16(content, 6)
  local row = SZL[szl_id] and SZL[szl_id][szl_index]
  if not row or length ~= row[2] then return found end
  for entry = 0, min(number, floor((#content - 8) / length)) - 1 do
    local part = content:sub(9 + entry * length, 8 + (entry + 1) * length)
    if u16(part, 0) == row[5] then
      local value = part:sub(row[3] + 1, row[3] + row[4])
      value = row[1] == "consistent" and u16(value, 0) or text_of(value)
      if value then
        found[#found + 1] = {at = at, szl_id = szl_id, szl_index = szl_index, name = row[1], value = value}
      end
    end
  end
  return found
end

return M
