-- What a parameter is called, in what it is measured, and of which type it is: one door to all that says so
-- (Python: ds47.profidrive.dictionary, where it is explained).
--
-- Sources, of each thing the first that says it: the descriptions of this capture, then the list of
-- parameters, where it speaks of the maker of the device. A description holds for the drive object that was
-- asked, as far as drive_objects.lua proves that another request reaches the same one. No words are here.
--
-- What was said is {value, frame}: the frame is that of the response.

local arrays = require("ds47.support.arrays")
local bit = require("ds47.support.bits").bit
local description = require("ds47.profidrive.description")
local drive_objects = require("ds47.profidrive.drive_objects")
local formats = require("ds47.profidrive.formats")
local lookup = require("ds47.spec.lookup")
local ordered = require("ds47.support.ordered")
local tables = require("ds47.spec.tables")

local abs, find, format, match = math.abs, string.find, string.format, string.match

local M = {}

--- PROFINET vendor id of the drives whose own parameters the list names.
M.SIEMENS = 0x002A

local UNKNOWN = "unknown" -- the type of a parameter of which no source says it
local WHOLE = 0 -- the subindex of a whole description
local WAYS = 16 -- ways in which a parameter was described; of more the oldest is forgotten
local NO_TYPES = { [0x00] = true, [0x40] = true, [0x44] = true } -- codes that are the type of no parameter
-- Types whose values are the same in a format that says no more than their size.
local UNSIGNED = { Unsigned8 = "Byte", Unsigned16 = "Word", Unsigned32 = "DoubleWord" }
local FLOATS = { [0x08] = true, [0x0F] = true }
local FIRST_INTEGER, LAST_INTEGER = 0x02, 0x07 -- codes of the integers that are scaled
local POWERS = 22 -- the largest power of ten that a double holds exactly
local NONE = {}
-- What is remembered of a description: its keys; `relevant` and `variable` are made of several.
local KEPT = { "type", "name", "factor", "low", "high" }

--- Whose parameters a device of this vendor has: "sinamics", "micromaster" or, of any other, "profile". On
-- PROFINET a device of Siemens is no MICROMASTER.
-- @param family of the parameters of the device, where PROFIBUS says it; nil elsewhere
function M.family_of(vendor_id, family)
  return family or vendor_id == M.SIEMENS and "sinamics" or "profile"
end

--- The row of a parameter in the tables that speaks of such a device; nil where none does.
function M.listed(pnu, vendor_id, family)
  return pnu and lookup.parameter(pnu, M.family_of(vendor_id, family)) or nil
end

--- The unit that the tables give to values in a format; nil where the tables say another type.
function M.unit_of(row, format_name)
  if row == nil or format_name == nil then return row and row.unit end
  local own = match(row.type, "^[^%[]*")
  if own == UNKNOWN then own = "Float32" end
  return (format_name == own or format_name == UNSIGNED[own]) and row.unit or nil
end

--- Whether a drive may change a parameter itself: by any table, of another make by that of the profile.
function M.changes_itself(pnu, vendor_id, family)
  if vendor_id == nil or vendor_id == M.SIEMENS or family then return tables.changing[pnu] ~= nil end
  local row = lookup.parameter(pnu, "profile")
  return row ~= nil and row.volatile
end

--- Whether there is such a parameter on a device; of an unknown make on any.
function M.is_known(pnu, vendor_id, family)
  if vendor_id == nil and family == nil then
    return tables.parameters[pnu] ~= nil or tables.drives[pnu] ~= nil
  end
  return M.listed(pnu, vendor_id, family) ~= nil
end

local Dictionary = {}
Dictionary.__index = Dictionary

--- A dictionary.
-- @param objects what the capture shows of drive objects; whoever has it keeps it up to date
-- @param most    how many descriptions are remembered; of more the oldest is forgotten
function M.new(objects, most)
  return setmetatable({
    objects = objects,
    most = most,
    all = ordered.new(), -- way and PNU -> {access, place, said}
    ways = {}, -- place, which is device and PNU -> its entries, the newest last
    is_empty = true,
  }, Dictionary)
end

local function place_of(device, pnu) return format("%s %d", device, pnu) end

local function key_of(access, pnu)
  return format("%s %d %d %s %s %s", access.device, pnu, access.record_index, tostring(access.slot),
    tostring(access.subslot), tostring(access.axis))
end

-- Learning

-- Whether a drive may mean what it says: a type that there is, a name of characters that can be read.
local function is_sensible(found)
  if found.type then
    local code = formats.code_of(found.type)
    if code == nil or NO_TYPES[code] then return false end
  end
  local name = found.name
  return not (name and (find(name, "[\0-\31\127]") or find(name, "\194[\128-\160]")))
end

-- Puts into `said` what a description says. An empty name is none.
local function take(said, found, frame)
  for _, key in ipairs(KEPT) do
    local value = found[key]
    if value ~= nil and not (key == "name" and value == "") then
      said[key] = { value = value, frame = frame }
    end
  end
  if found.identifier then
    local irrelevant = bit(found.identifier, tables.descriptions.bits.irrelevant) == 1
    said.relevant = { value = not irrelevant, frame = frame }
  end
  if found.quantity then
    local unit = found.unit
    said.variable = { value = { found.quantity, found.conversion, unit }, frame = frame }
  end
end

function Dictionary:_forget(key)
  local entry = self.all:pop(key)
  local ways = self.ways[entry.place]
  arrays.take_out(ways, entry)
  if #ways == 0 then self.ways[entry.place] = nil end
end

--- A description was read, whole or one element of it; one that is not sensible is not believed.
-- @param access      how it was asked for (drive_objects.access)
-- @param subindex    0 for all elements, else the number of one
-- @param frame       of the response
function Dictionary:learn(access, pnu, subindex, format_name, values, frame)
  local found = description.describe(subindex, format_name, values)
  if found == nil or not is_sensible(found) then return end
  local key, place = key_of(access, pnu), place_of(access.device, pnu)
  local before = self.all:get(key)
  -- Never changed but made anew: of an older result it stays what it was.
  local said = {}
  if subindex == WHOLE then
    said.whole = { value = true, frame = frame }
  else
    for name, each in pairs(before and before.said or NONE) do said[name] = each end
  end
  take(said, found, frame)
  if next(said) == nil then return end
  self.is_empty = false
  if before then
    self:_forget(key)
  elseif self.ways[place] and #self.ways[place] == WAYS then
    self:_forget(self.ways[place][1].key)
  end
  local entry = { key = key, access = access, place = place, said = said }
  local ways = self.ways[place] or {}
  ways[#ways + 1], self.ways[place] = entry, ways
  self.all:set(key, entry)
  if self.all.length > self.most then self:_forget((self.all:first())) end
end

-- Asking

-- Adds what another way was answered with, as far as it is newer; nothing of later frames than `last`.
local function add_newer(said, more, last)
  for name, each in pairs(more) do
    local before = said[name]
    if (last == nil or each.frame <= last) and (before == nil or before.frame <= each.frame) then
      said[name] = each
    end
  end
end

-- Whether a factor says nothing else than a conversion index. Sources differ about its direction.
local function agrees(factor, power)
  return factor == 1 or factor == tonumber("1e" .. power) or factor == tonumber("1e" .. -power)
end

local function is_integer(code) return code ~= nil and code >= FIRST_INTEGER and code <= LAST_INTEGER end

-- How values of the type are measured, where all elements that are about it agree: {power, unit, frames}.
local function measure_of(kind, said)
  local variable, factor = said.variable, said.factor
  local code = formats.code_of(kind.value)
  if variable == nil or not (is_integer(code) or FLOATS[code]) or not said.relevant.value then return nil end
  local quantity, power, unit = variable.value[1], variable.value[2], variable.value[3]
  local known = tables.descriptions.quantities[quantity]
  if unit == nil or known == nil or (factor and not agrees(factor.value, power)) then return nil end
  local frames = arrays.in_order({ kind.frame, variable.frame, factor and factor.frame })
  if not find(unit, "^10%^") then return { power = 0, unit = unit, frames = frames } end
  if not is_integer(code) or abs(power) > POWERS then return nil end
  return { power = power, unit = known.unit, frames = frames }
end

--- What is known of a parameter: {listed (its row in the list), and, each nil where the drive has not said
-- it, name, type, low, high, measure = {power (of ten, that an integer is multiplied with), unit, frames}}.
-- @param access    how it is asked for
-- @param last      the last frame whose description counts; nil: all that came up to now
-- @param family    of its parameters, where PROFIBUS says it
-- @return the meaning, and whether the drive has said anything
function Dictionary:meaning(access, pnu, vendor_id, last, family)
  local meaning, said = { listed = M.listed(pnu, vendor_id, family) }, {}
  for _, entry in ipairs(self.ways[place_of(access.device, pnu)] or NONE) do
    if self.objects:same(access, entry.access, pnu) then add_newer(said, entry.said, last) end
  end
  local whole = said.whole
  for name, each in pairs(said) do
    if whole and each.frame < whole.frame then said[name] = nil end
  end
  for _, name in ipairs({ "name", "type", "low", "high" }) do meaning[name] = said[name] end
  meaning.measure = said.type and measure_of(said.type, said)
  return meaning, (meaning.name or meaning.type or meaning.low or meaning.high) ~= nil
end

-- Telling

--- Whether a value in this format is one of the type that the drive says.
function M.fits(meaning, format_name)
  local own = meaning.type and meaning.type.value
  return own ~= nil and (format_name == nil or format_name == own or UNSIGNED[own] == format_name)
end

-- Integers times a power of ten; nil where one of them is none.
local function scaled(values, power)
  if power == 0 or #values == 0 then return nil end
  local times, found = tonumber("1e" .. abs(power)), {}
  for number, value in ipairs(values) do
    if type(value) ~= "number" then return nil end
    found[number] = power > 0 and value * times or value / times
  end
  return found
end

local function is_listed_as(row, type_name)
  return row ~= nil and (row.type:gsub("%[%]$", "")) == type_name
end

--- What a drive has said of the values of a parameter: {described = {name, frames} or nil, unit, scaled}.
-- @param item the parameter: format, values, unit and scaled as they are without it
function M.explained(item, meaning)
  local fits = M.fits(meaning, item.format) and (item.format ~= nil or #item.values == 0)
  local name, measure = meaning.name, meaning.measure
  local told = { unit = item.unit, scaled = item.scaled }
  local frames = name and { name.frame } or {}
  if fits and measure and item.scaled == nil then
    told.unit, told.scaled = measure.unit, scaled(item.values, measure.power)
    arrays.append(frames, measure.frames)
    frames = arrays.in_order(frames)
  elseif meaning.type and not is_listed_as(meaning.listed, meaning.type.value) then
    told.unit = nil -- that of the list belongs to another parameter
  end
  if #frames > 0 then told.described = { name = name and name.value, frames = frames } end
  return told
end

--- Puts into the parameters of a transaction of PKW what the drive has said of them up to its response.
function Dictionary:explain(item)
  if self.is_empty then return end
  local access, last = drive_objects.access_of(item), item.frames.read_response
  for _, each in ipairs(item.parameters) do
    if each.pnu and each.attribute == "value" then
      local told = M.explained(each, (self:meaning(access, each.pnu, item.vendor_id, last, item.family)))
      each.unit, each.scaled, each.described = told.unit, told.scaled, told.described
    end
  end
end

return M
