-- One readable line per request of PKW, as `ds47 encode` takes it: pkw change p1082=Float32:40.0
-- The notation is described in python/ds47/cyclic/notation.py. Here lines are written only.

local naming = require("ds47.profidrive.naming")
local numbers = require("ds47.support.numbers")
local pkw = require("ds47.cyclic.pkw")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")

local format = string.format

local M = {}

local PAGE = 2000
local VERBS = {read = "read", count = "count", change = "change"}

-- The page byte that a line gives, by which a parameter number is reached.
local function page_of(pnu)
  local left, page, order = pnu - pnu % PAGE, 0, {}
  for bit, weight in pairs(tables.pkw.weights) do order[#order + 1] = {bit, weight} end
  table.sort(order, function(one, other) return one[2] > other[2] end)
  for _, each in ipairs(order) do
    if each[2] <= left then left, page = left - each[2], page + 2 ^ each[1] end
  end
  return page
end

-- The value as a line writes it; nil where the words hold more than it.
local function value_text(message, width, data)
  if message.float then return "Float32:" .. numbers.float_text(message.value) end
  if width == 32 then return format("DoubleWord:%.0f", reader.u32(data, 4)) end
  return message.pwe1 == 0 and format("Word:%d", message.pwe2) or nil
end

--- The readable line of a request; nil where no line gives the same bytes.
-- @param layout "cyclic" or "uss"
function M.line(data, layout, family)
  local message = pkw.decode(data, false, layout)
  local request = tables.pkw.requests[message.ak]
  local verb, pnu = VERBS[request.access], message.pnu
  if not verb or message.spm ~= 0 or not pnu or message.page ~= page_of(pnu) then return nil end
  local parameter = naming.spelling(pnu, family)
  if message.subindex > 0 or verb == "change" and request.array then
    parameter = format("%s[%d]", parameter, message.subindex)
  end
  if verb == "change" then
    local text = (request.array or message.subindex == 0) and value_text(message, request.width, data)
    if not text then return nil end
    return format("pkw change %s%s=%s", request.eeprom and "eeprom " or "", parameter, text)
  end
  if message.pwe1 ~= 0 or message.pwe2 ~= 0 then return nil end
  return format("pkw %s%s %s", verb, request.array and " array" or "", parameter)
end

return M
