-- The formats of values (docs/protocol.md A.6): bytes to values, and the physical values of normalised
-- formats. One codec per format of tables.lua. Blocks, pads and what to do with unknown formats are in
-- parameter.lua.

local numbers = require("ds47.support.numbers")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")

local byte, floor, format, sub = string.byte, math.floor, string.format, string.sub
local float32, float64 = numbers.float32, numbers.float64

local M = {}

local DAY_MS = 86400000
local MS_RANGE = 268435456 -- times of day use 28 of their 32 bits
local DAYS_TO_1984 = 724581 -- from 1 March of the year 0, with which the years of the calendar below begin

-- decode(raw, count, size) -> values: `raw` begins with `count` whole values. One function per `pack`.
local decode = {}

function decode.B(raw, count)
  if count == 1 then return {(byte(raw))} end
  return {byte(raw, 1, count)}
end

function decode.b(raw, count)
  local values = {}
  for i = 1, count do
    local value = byte(raw, i)
    values[i] = value < 128 and value or value - 256
  end
  return values
end

function decode.H(raw, count)
  if count == 1 then return {reader.u16(raw, 0)} end
  local values = {}
  for i = 1, count do
    local a, b = byte(raw, 2 * i - 1, 2 * i)
    values[i] = a * 256 + b
  end
  return values
end

function decode.h(raw, count)
  local values = {}
  for i = 1, count do
    local a, b = byte(raw, 2 * i - 1, 2 * i)
    values[i] = (a < 128 and a or a - 256) * 256 + b
  end
  return values
end

function decode.I(raw, count)
  local values = {}
  for i = 1, count do
    local a, b, c, d = byte(raw, 4 * i - 3, 4 * i)
    values[i] = ((a * 256 + b) * 256 + c) * 256 + d
  end
  return values
end

function decode.i(raw, count)
  local values = {}
  for i = 1, count do
    local a, b, c, d = byte(raw, 4 * i - 3, 4 * i)
    values[i] = (((a < 128 and a or a - 256) * 256 + b) * 256 + c) * 256 + d
  end
  return values
end

function decode.Q(raw, count)
  local values = {}
  for i = 1, count do values[i] = numbers.unsigned(raw, 8 * i - 8, 8) end
  return values
end

function decode.q(raw, count)
  local values = {}
  for i = 1, count do values[i] = numbers.signed64(raw, 8 * i - 8) end
  return values
end

function decode.f(raw, count)
  if count == 1 then return {float32(raw, 0)} end
  local values = {}
  for i = 1, count do values[i] = float32(raw, 4 * i - 4) end
  return values
end

function decode.d(raw, count)
  local values = {}
  for i = 1, count do values[i] = float64(raw, 8 * i - 8) end
  return values
end

local function whole_text(raw, count)
  return count > 0 and {reader.latin1(raw)} or {}
end

local function texts(raw, count, size)
  local values = {}
  for i = 1, count do values[i] = reader.latin1(sub(raw, (i - 1) * size + 1, i * size)) end
  return values
end

local function whole_octets(raw, count)
  return count > 0 and {reader.hex(raw)} or {}
end

local function octets(raw, count, size)
  local values = {}
  for i = 1, count do values[i] = reader.hex(sub(raw, (i - 1) * size + 1, i * size)) end
  return values
end

local function integers(raw, count, size)
  local values = {}
  for i = 1, count do values[i] = numbers.unsigned(raw, (i - 1) * size, size) end
  return values
end

local function nothing()
  return {}
end

-- scale(values, raw, codec) -> physical values, one for each value.

local function ratio(values, _, codec)
  local scaled = {}
  for i = 1, #values do scaled[i] = values[i] * codec.multiply / codec.divide end
  return scaled
end

local function without_status(values, raw, codec)
  local scaled = {}
  for i = 1, #values do
    local at = (i - 1) * codec.size
    scaled[i] = codec.scaled_float and float32(raw, at) or byte(raw, at + 1)
  end
  return scaled
end

local function clock(milliseconds)
  local seconds = floor(milliseconds / 1000)
  local minutes = floor(seconds / 60)
  return format("%02d:%02d:%02d.%03d", floor(minutes / 60), minutes % 60, seconds % 60, milliseconds % 1000)
end

-- The date that is so many days after 1984-01-01. Years here begin in March, so that a leap day ends one.
local function date(days)
  days = days + DAYS_TO_1984
  local cycle, day = floor(days / 146097), days % 146097 -- 400 years
  local year = floor((day - floor(day / 1460) + floor(day / 36524) - floor(day / 146096)) / 365)
  day = day - (365 * year + floor(year / 4) - floor(year / 100))
  local month = floor((5 * day + 2) / 153)
  day = day - floor((153 * month + 2) / 5) + 1
  month = month < 10 and month + 3 or month - 9
  return format("%04d-%02d-%02d", cycle * 400 + year + (month <= 2 and 1 or 0), month, day)
end

local function time_of_day(values, raw, codec)
  local scaled = {}
  for i = 1, #values do
    local at = (i - 1) * codec.size
    local text = clock(reader.u32(raw, at) % MS_RANGE)
    scaled[i] = codec.size < 6 and text or date(reader.u16(raw, at + 4)) .. "T" .. text
  end
  return scaled
end

local function duration(values, raw, codec)
  local scaled = {}
  for i = 1, #values do
    local at = (i - 1) * codec.size
    local days = codec.size == 6 and reader.u16(raw, at + 4) or 0
    scaled[i] = (days * DAY_MS + reader.u32(raw, at)) / 1000
  end
  return scaled
end

-- ISO 8601, unchecked: a month 13 stays visible. Years 84 to 99 are of the last century.
local function date_and_time(values, raw, codec)
  local scaled = {}
  for i = 1, #values do
    local at = (i - 1) * codec.size
    local milliseconds = reader.u16(raw, at)
    local minute, hour, day, month, year = byte(raw, at + 3, at + 7)
    year = year % 128
    scaled[i] = format("%04d-%02d-%02dT%02d:%02d:%02d.%03d", year + (year >= 84 and 1900 or 2000),
      month % 64, day % 32, hour % 32, minute % 64, floor(milliseconds / 1000), milliseconds % 1000)
  end
  return scaled
end

-- kind of tables.lua -> what of a codec does not stand in the row itself.
local make = {}

function make.number(row)
  return {
    decode = decode[row.pack], scale = row.divide and ratio, scaled_float = row.divide ~= nil,
    pack = not row.divide and row.pack or nil,
  }
end

function make.float(row)
  return {decode = decode[row.pack], float = true, pack = row.pack}
end

function make.text(row)
  return {decode = row.whole and whole_text or texts}
end

function make.octets(row)
  return {decode = row.whole and whole_octets or octets}
end

function make.with_status(row)
  return {decode = octets, scale = without_status, scaled_float = row.pack == "f"}
end

function make.date()
  return {decode = integers, scale = date_and_time}
end

function make.time_of_day()
  return {decode = integers, scale = time_of_day}
end

function make.duration()
  return {decode = integers, scale = duration, scaled_float = true}
end

function make.zero()
  return {decode = nothing}
end

--- The codec of a format code, nil where the length of its values cannot be known.
-- @param code a code of tables.formats, dialects already resolved
-- @param size bytes per value where the format has two sizes; its own otherwise
-- @return {size, decode, scale (nil: the format has none), whole, float (values are floats), scaled_float,
--   pack (of plain numbers: a letter of string.unpack), multiply, divide}; decode(raw, count, size) and
--   scale(values, raw, codec) give arrays
function M.codec(code, size)
  local row = tables.formats[code]
  if not (row and row.size and make[row.kind]) then return nil end
  local codec = make[row.kind](row)
  codec.size, codec.whole = size or row.size, row.whole
  codec.multiply, codec.divide = row.multiply or 1, row.divide
  return codec
end

local floats -- format name -> {values, scaled}: whether they are floats
local function is_float(format_name, scaled)
  if not floats then
    floats = {}
    for _, row in pairs(tables.formats) do
      local with_status = row.kind == "with_status" and row.pack == "f"
      floats[row.name] = {
        values = row.kind == "float",
        scaled = row.divide ~= nil or row.kind == "duration" or with_status,
      }
    end
  end
  local known = floats[format_name]
  return known and (scaled and known.scaled or not scaled and known.values)
end

--- The name of the format of a block, of a parameter of a transaction, or that name itself.
function M.name_of(block)
  if type(block) == "table" then
    return block.format_name or type(block.format) == "string" and block.format or nil
  end
  return block
end

--- A number as Python shows it: a float always with a point or an exponent, an integer never.
-- The format says which it is: Lua 5.2 has one kind of number only.
function M.number_text(number, format_name, scaled)
  if is_float(format_name, scaled) or floor(number) ~= number then
    return numbers.float_text(number)
  end
  return format("%.0f", number) -- "%d" of Lua 5.2 holds only 32 bits on Windows
end

return M
