-- What values mean, in words: values of the profile and of the tables, connections, buffers of faults.
-- Python: ds47.report.values, where it is explained.

local lookup = require("ds47.spec.lookup")
local profile = require("ds47.report.profile")

local floor, format = math.floor, string.format

local M = {}

local MOST = 8 -- the most values of one parameter that get words, one by one
local OWN = 63 -- the drive object of a connection that stays within its own
local NONE = {}
-- From here on, a word of PKW has another value if it is signed; types in the tables that allow a sign.
local HALF = { Word = 0x8000, DoubleWord = 0x80000000 }
local OPEN = { unknown = true, Integer16 = true, Integer32 = true }

M.PLACES = 8 -- elements for one situation in a buffer
M.LEADING = { number = true, code = true } -- columns of a buffer that show whether there is an entry

local function are_whole(values)
  for _, value in ipairs(values) do
    if type(value) ~= "number" or value ~= floor(value) then return false end
  end
  return true
end

local function listed(row, lang) return row and (lang == "zh" and row.values_zh or row.values_en) or NONE end

-- The text of each value; a value without one stays a number. nil if no value has a text.
local function texts(row, values, told, words, lang)
  local known, found, any = listed(row, lang), {}, false
  if #values > MOST then return nil end
  for number, value in ipairs(values) do
    local text = told[value] and words.escape(told[value]) or known[value]
    any = any or text ~= nil
    found[number] = text or format("%d", value)
  end
  return any and found or nil
end

-- `from r0722.2`, for 32 bits that name a signal of the same drive object; else nil.
local function connection(kind, values, words, lang)
  local value = values[1]
  if #values ~= 1 or value <= 0xFFFF or value > 0xFFFFFFFF then return nil end
  local number, place = floor(value / 0x10000), value % 0x400
  if floor(value / 0x400) % 0x40 ~= OWN then return nil end
  local row = lookup.parameter(number, "sinamics")
  local source = row and row.access and format("%s%04d", row.access, number) or format("%d", number)
  source = source .. format(kind == "bit" and ".%d" or "[%d]", place)
  local told = words.say(lang, "value_from", { source = source })
  local name = row and (lang == "zh" and row.name_zh or row.name_en)
  return { name and words.joined(lang, { told, name }) or told }
end

-- The entries of a buffer that are not 0, by situation: eight elements each. Only a missing number or code
-- shows that there is no fault: a value may be 0.
local function buffer(row, first, values, told, words, lang)
  local kind, column = row.buffer, row.entry and row.entry[2]
  local found, active, situation, entries, gone = {}, false, nil, nil, {}
  local function add(what, list) found[#found + 1] = words.joined(lang, { what, list }, ": ", "：") end
  local function close()
    if entries == nil then return end
    local list = words.joined(lang, entries)
    if situation == 0 then
      active = true
      add(words.say(lang, "value_active"), list)
    elseif kind == "faults" then
      add(words.say(lang, "value_acknowledged", { n = format("%d", situation) }), list)
    else
      gone[#gone + 1] = list
    end
    entries = nil
  end
  for number, value in ipairs(values) do
    local of = floor((first + number - 1) / M.PLACES)
    if of ~= situation then
      close()
      situation = of
    end
    if value ~= 0 then
      entries = entries or {}
      entries[#entries + 1] = told[value] and words.escape(told[value]) or format("%d", value)
    end
  end
  close()
  if gone[1] then add(words.say(lang, "value_gone"), words.joined(lang, gone)) end
  if first == 0 and not active and M.LEADING[column] then
    table.insert(found, 1, words.say(lang, kind == "faults" and "value_no_faults" or "value_no_alarms"))
  end
  return found[1] and { words.joined(lang, found, "; ", "；") } or nil
end

-- `signed -25`: for a word of PKW, which has no type, if nothing else says its type.
local function signed(item, words, lang)
  local value, half, row = item.values[1], HALF[item.format], item.listed
  if item.element_count or item.described or row and not OPEN[row.type] then return nil end
  if not half or value < half then return nil end
  return { words.say(lang, "value_signed", { value = format("%d", value - 2 * half) }) }
end

--- What the values of a parameter mean: an array of texts; nil if there is nothing to add.
-- @param item  a parameter; `value_texts` has the texts for single values from lists of the user
-- @param words the module formatting.lua, which has the language
function M.parts(item, words, lang)
  local pnu, values, row = item.pnu, item.values, item.listed
  if item.attribute ~= "value" or not pnu or not item.subindex or not values or values[1] == nil then
    return nil
  elseif item.error or item.format and item.format:find("^Float") then
    return nil
  end
  local told = item.value_texts or NONE
  local found = profile.parts(item, words, lang)
  if found or not are_whole(values) then return found end
  if row and row.buffer then return buffer(row, item.subindex, values, told, words, lang) end
  if row and row.connects and not item.value_texts then
    return connection(row.connects, values, words, lang)
  end
  return texts(row, values, told, words, lang) or signed(item, words, lang)
end

return M
