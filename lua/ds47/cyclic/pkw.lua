-- The four words of PKW: bytes to their meaning (docs/cyclic.md 2). One request or one answer at a time; what
-- belongs together, and when an answer counts, is not here.

local numbers = require("ds47.support.numbers")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")

local abs, floor, u16, u32 = math.abs, math.floor, reader.u16, reader.u32

local M = {LENGTH = 8, ERROR = 7, NO_RIGHTS = 8}

local MOST_PNU = 0xFFFF

-- The parameter number of a page; nil where there is none.
local function number(base, page)
  local pnu = base
  for bit, weight in pairs(tables.pkw.weights) do
    if floor(page / 2 ^ bit) % 2 == 1 then pnu = pnu + weight end
  end
  if pnu <= MOST_PNU then return pnu end
  return nil
end

-- A word, or a double word as what people mean by it: a float where it looks like one. And whether it is one.
local function value(data, width)
  if not width then return nil, false end
  if width == 16 then return u16(data, 6), false end
  local float = numbers.float32(data, 4)
  if type(float) == "number" then
    local size = abs(float)
    if size >= tables.pkw.float_least and size <= tables.pkw.float_most then return float, true end
  end
  local whole = u32(data, 4)
  return u16(data, 4) == 0xFFFF and whole - 2 ^ 32 or whole, false
end

-- The error number stands in PWE2; some manuals put it into PWE1, with 0 behind it.
local function failure(message, family)
  if message.ak == M.NO_RIGHTS then return {} end
  local code = message.pwe2
  if code == 0 and message.pwe1 ~= 0 then code = message.pwe1 end
  local known = tables.pkw.codes
  if family then known = tables.pkw.families[family] end
  return {code = known[code] and code or nil}
end

-- The parameter and the bit or index that a value of SINAMICS G120 names.
local function connector(message)
  local mark = tables.pkw.connector
  if message.pwe1 == 0 or message.pwe2 < mark then return nil end
  return {pnu = message.pwe1, index = message.pwe2 - mark}
end

--- A request or an answer from its eight bytes.
-- @param data string, eight bytes at least; further ones are left alone
-- @param answer boolean: the drive sent it
-- @param layout "cyclic" (the page in the low byte of IND) or "uss" (in the high one)
-- @param family whose error numbers count, a key of tables.pkw.families; nil: all that are known
-- @return table {answer, ak, spm, pnu, subindex, layout, page, pwe1, pwe2, value, float, error, connector}:
-- pnu is nil where page and number together are none; error {code} of an answer that is negative, its code
-- nil where no word is an error number
function M.decode(data, answer, layout, family)
  local pke, high, low = u16(data, 0), data:byte(3), data:byte(4)
  local uss = layout == "uss"
  local message = {
    answer = answer, ak = floor(pke / 0x1000), spm = floor(pke / 0x800) % 2,
    layout = uss and "uss" or "cyclic",
    subindex = uss and low or high, page = uss and high or low,
    pwe1 = u16(data, 4), pwe2 = u16(data, 6),
  }
  message.pnu = number(pke % 0x800, message.page)
  local width = tables.pkw[answer and "answers" or "requests"][message.ak].width
  message.value, message.float = value(data, width)
  if answer and (message.ak == M.ERROR or message.ak == M.NO_RIGHTS) then
    message.error = failure(message, family)
  end
  if width then message.connector = connector(message) end
  return message
end

--- The four words as manuals print them: 143A 0000 0000 0000.
function M.digits(data) return (reader.hex(data):upper():gsub("%x%x%x%x", "%0 "):sub(1, -2)) end

--- Whether the page is one that exists: what is set beyond that speaks for the other layout.
function M.fits_layout(message) return message.page % 4 == 0 and message.pnu ~= nil end

return M
