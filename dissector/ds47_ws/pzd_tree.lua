-- The part of the tree that is about a drive: control and status word in each of its cyclic frames, and what
-- happened in one.
--
-- `put` are the functions of tree.lua that add fields: {wanted, add, take, derive}. A record is the TvbRange
-- of the words. Where they stand and whose they are is told by drives.lua.

local bits = require("ds47.support.bits")
local cyclic = require("ds47.spec.cyclic")
local drives = require("ds47_ws.drives")
local info = require("ds47_ws.info")
local pzd = require("ds47.cyclic.pzd")
local relations = require("ds47.cyclic.relations")
local tables = require("ds47.spec.tables")
local types = require("ds47_ws.types")

local bit_of, codes = bits.bit, tables.codes
local concat, format = table.concat, string.format

local M = {}

-- Setpoint as it is effective, or actual value, in percent; nil where it is none, or not valid.
local function percent(place, raw)
  if not raw or not place.valid or not place.speed then return nil end
  local share = raw / tables.pzd.word * 100
  local turned = place.sent and pzd.turns(place.word, relations.is_of_others(place.relation))
  return turned and -share or share
end

-- `STW1 16#047F, setpoint 60.0 %`, the whole in one line.
local function line_of(place, value, lang)
  local parts = { format("%s 16#%04X", place.sent and "STW1" or "ZSW1", place.word) }
  local state, overlays = drives.state(place)
  if state then parts[2] = cyclic.state_text(state, overlays, lang) end
  if value then
    parts[#parts + 1] = format("%s %.1f %%", place.sent and "setpoint" or "actual value", value)
  end
  if not place.valid then parts[#parts + 1] = "data not valid" end
  return concat(parts, ", ")
end

-- The words of a bit in this family of telegrams.
local function bit_text(name, word, bit, family, lang)
  local own = family and tables.pzd[name .. "_" .. family] or {}
  local row = own[bit] or tables.pzd[name][bit]
  local value = bit_of(word, bit)
  return row[(value == 1 and "set" or "clear") .. (lang == "zh" and "_zh" or "")] or tostring(value)
end

-- Bits have their words from the field, which knows those of speed telegrams of SINAMICS in English.
local function add_bits(put, parent, name, place, record, lang)
  local kind = place.speed == false and "positioning" or nil
  local rows, others = tables.fields[name], tables.pzd[name .. "_others"] -- from bit 0 on
  if not relations.is_of_others(place.relation) then others = {} end
  for number = 1, #rows do
    local shown, bit = put.take(parent, rows[number][1], record, 0, 2), number - 1
    local family = others[bit] and "others" or kind
    if shown and (family or lang == "zh") then
      local text = bit_text(name, place.word, bit, family, lang)
      local picture = types.picture(place.word, bit, 16)
      shown:set_text(format("%s = %s bit %d: %s", picture, name:upper(), bit, text))
    end
  end
end

-- The words behind the first, by their names in the telegram: the only one that may be.
local function add_words(put, parent, place, record)
  local numbers = place.relation.telegrams
  local telegram = #numbers == 1 and tables.pzd.telegrams[numbers[1]]
  if not telegram then return end
  local offset = 2
  local names = place.sent and telegram.out or telegram.inward
  for number = 2, #names do
    local word = tables.fields.telegram_words[names[number]]
    if word.key then put.take(parent, word.key, record, offset, word.size) end
    offset = offset + word.size
  end
end

local function add_values(put, parent, place, record, raw, value)
  local key = place.sent and "pzd.setpoint" or "pzd.actual"
  local shown = put.add(parent, key, value, record, 2, 2)
  if shown then shown:set_text(format("%s: %.2f %%", place.sent and "Setpoint" or "Actual value", value)) end
  if place.speed then put.add(parent, key .. ".raw", raw, record, 2, 2) end
end

-- The state has a number; what stands beside it is told in words.
local function derive_state(put, parent, key, state, overlays, lang)
  local shown = state and put.derive(parent, key, codes.drive_states[state])
  if shown then shown:set_text("State of the drive: " .. cyclic.state_text(state, overlays, lang)) end
end

-- The telegrams that it may be.
local function add_telegrams(put, parent, numbers)
  for _, number in ipairs(numbers) do
    local shown = put.derive(parent, "pzd.telegram", number)
    if shown and #numbers > 1 then shown:append_text(format(" (one of %d)", #numbers)) end
  end
end

--- Adds the words of one direction of a drive.
-- @param place as drives.lua gives it
function M.add(put, parent, place, record, lang)
  local raw = record:len() >= 4 and record:range(2, 2):int() or nil -- the second word, with its sign
  local value, root, name = percent(place, raw), parent, place.sent and "stw1" or "zsw1"
  if put.wanted("pzd") then
    local line = line_of(place, value, lang)
    root = put.own(parent, record, "DS47 PZD: " .. line)
    put.add(root, "pzd", line, record, 0, record:len()):set_hidden()
  end
  local numbers = place.relation.telegrams
  if numbers[1] and put.wanted("pzd.telegram") then add_telegrams(put, root, numbers) end
  local word = put.add(root, "pzd." .. name, place.word, record, 0, 2)
  add_bits(put, word or root, name, place, record, lang)
  if put.wanted("pzd.state") then
    local state, overlays = drives.state(place)
    derive_state(put, root, "pzd.state", state, overlays, lang)
  end
  add_values(put, root, place, record, raw, value)
  add_words(put, root, place, record)
end

--- Adds what happened to a drive in this frame.
-- @param found {relation, event, number}, as drives.lua gives it
-- @param record the word that the event is about; nil where it is about none
-- @return the item, nil where nobody wants it
function M.add_event(put, root, found, record, lang)
  local event, relation = found.event, found.relation
  local text = cyclic.event_text(event.name, lang)
  local shown = put.add(root, "pzd.event", text, record, 0, 2)
  if shown then shown:set_text("Event of a drive: " .. info.what({ event }, lang)) end
  local below = shown or root
  put.derive(below, "pzd.event.name", codes.events[event.name])
  put.derive(below, "pzd.event.word", codes.drive_words[event.word])
  put.derive(below, "pzd.event.before", event.before)
  put.derive(below, "pzd.event.after", event.after)
  derive_state(put, below, "pzd.event.state", event.state, {}, lang)
  put.derive(below, "pzd.event.overlays", event.state and event.overlays[1] and concat(event.overlays, " "))
  put.derive(below, "pzd.event.relation", found.number)
  put.derive(below, "pzd.event.telegrams", relation.telegrams[1] and concat(relation.telegrams, " "))
  types.add_peers(put, below, relation)
  put.derive(below, "slot", relation.slot)
  put.derive(below, "subslot", relation.subslot)
  return shown
end

return M
