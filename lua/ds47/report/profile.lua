-- What values of profile parameters mean: 964, 965, 974 and 975, telegrams of 922, addresses of 61000 and on.
-- Python: ds47.report.profile.

local tables = require("ds47.spec.tables")
local unhex = require("ds47.support.bytes").unhex

local floor, format = math.floor, string.format

local M = {}

local PROFILES = { [0x03] = "profile_profidrive", [0x3D] = "profile_of_encoders" }
local CLASSES = { [1] = "profile_axis", [5] = "profile_encoder" }
-- Families of the only maker whose telegrams are known.
local SIEMENS = { sinamics = true, micromaster = true }
local MOST_NAME = 240 -- characters of a name of station
local ADDRESSES = { [61001] = true, [61003] = true, [61004] = true }

local function is_number(value)
  return type(value) == "number" and value >= 0 and value <= 0xFFFF and value == floor(value)
end

-- `words` is the module formatting.lua, which has the language.
local function limit(place, value, words, lang)
  if place == 0 then return words.say(lang, "profile_block", { n = value }) end
  if place == 1 then return words.say(lang, "profile_parameters", { n = value }) end
  return place == 2 and value > 0 and words.say(lang, "profile_latency", { n = value * 10 }) or nil
end

-- `2014-03-15`, where there is such a day.
local function date(year, ddmm)
  local day, month = floor(ddmm / 100), ddmm % 100
  if day < 1 or day > 31 or month < 1 or month > 12 or year < 1990 or year > 2199 then return nil end
  return format("%d-%02d-%02d", year, month, day)
end

local function identification(pnu, place, value, words, lang)
  if place == 0 then return words.say(lang, "profile_maker", { id = format("0x%04X", value) }) end
  if place == 1 then
    return words.say(lang, pnu == 964 and "profile_device" or "profile_do_type", { n = format("%d", value) })
  elseif place == 2 then
    local version = format("%d.%02d", floor(value / 100), value % 100)
    return words.say(lang, "profile_version", { version = version })
  elseif place == 5 then
    if pnu == 964 then return words.say(lang, "profile_objects", { n = value }) end
    return CLASSES[value] and words.say(lang, CLASSES[value]) or nil
  end
  return place == 7 and pnu == 975 and words.say(lang, "profile_do_id", { n = format("%d", value) }) or nil
end

-- The elements of 964, 974 and 975, each for itself; year and day together.
local function elements(pnu, first, values, words, lang)
  local known, found = {}, {}
  for number, value in ipairs(values) do
    if is_number(value) then known[first + number - 1] = value end
  end
  for number = 1, #values do
    local place = first + number - 1
    local value, told = known[place], nil
    if value and pnu == 974 then
      told = limit(place, value, words, lang)
    elseif value and (place == 3 or place == 4) and known[3] and known[4] then
      told = place == 3 and date(known[3], known[4]) or nil
    elseif value then
      told = identification(pnu, place, value, words, lang)
    end
    found[#found + 1] = told
  end
  return found[1] and found or nil
end

-- The name of a telegram, and its words where they are known; those of a maker on its drives alone.
local function telegram(value, family, words, lang)
  if not is_number(value) or value == 0 or value >= 999 then return nil end
  local key = value < 100 and "profile_standard" or "profile_own"
  local told = words.say(lang, key, { n = format("%d", value) })
  local known = tables.pzd.telegrams[value]
  if known and (known.vendor == nil or SIEMENS[family]) then
    local signals = table.concat(known.out, " ") .. " / " .. table.concat(known.inward, " ")
    told = words.joined(lang, { told, signals }, ": ", "：")
  end
  return { told }
end

local function hex_number(text) return #text == 4 and not text:find("%X") and tonumber(text, 16) or nil end

-- `PROFIdrive 4.1` of 0x0329, whatever the format of the two bytes.
local function profile(values, words, lang)
  local first, second, number = values[1], values[2], nil
  if type(first) == "string" then
    number = hex_number(first)
  elseif #values == 2 and is_number(first) and is_number(second) and first <= 0xFF and second <= 0xFF then
    number = first * 0x100 + second
  elseif is_number(first) then
    number = first
  end
  local key = number and PROFILES[floor(number / 0x100)]
  if not key then return nil end
  local version = number % 0x100
  return { words.say(lang, key, { version = format("%d.%d", floor(version / 10), version % 10) }) }
end

-- A name of station, an IP address, a MAC address, of octets in hex.
local function address(pnu, value, quoted)
  if type(value) ~= "string" or value:find("%X") or #value % 2 == 1 then return nil end
  local octets = unhex(value)
  if ADDRESSES[pnu] and #octets == 4 then return { format("%d.%d.%d.%d", octets:byte(1, 4)) } end
  if pnu == 61002 and #octets == 6 then return { (value:lower():gsub("%x%x", "%0:"):sub(1, -2)) } end
  if pnu ~= 61000 then return nil end
  local text = octets:gsub("[%z ]+$", "")
  if text == "" or #text > MOST_NAME or text:find("[^ -~]") then return nil end
  return { quoted(text) }
end

--- What the values of a parameter of the profile mean: an array of texts; nil where they say it.
-- @param words the module formatting.lua
function M.parts(item, words, lang)
  local pnu, values = item.pnu, item.values
  if pnu == 964 or pnu == 974 or pnu == 975 then return elements(pnu, item.subindex, values, words, lang) end
  if pnu == 922 then return telegram(values[1], item.family, words, lang) end
  if pnu == 965 then return profile(values, words, lang) end
  return address(pnu, values[1], words.quoted)
end

return M
