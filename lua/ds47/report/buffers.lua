-- Buffers of faults and alarms of drive objects: number, code, time and value of each entry side by side.
-- Python: ds47.report.buffers, where it is explained.

local drive_objects = require("ds47.profidrive.drive_objects")
local words = require("ds47.report.formatting")
local values = require("ds47.report.values")

local concat, floor, format, sort = table.concat, math.floor, string.format, table.sort

local M = {}

local COLUMNS = { "number", "code", "time", "gone", "value" }
local ENTRIES_LISTED = 64
local ANSWERED = { ok = true, partial = true, error = true }

local function entry_of(item)
  local row = item.listed
  local whole = item.attribute == "value" and item.subindex and not item.error and item.values
  return whole and row and item.values[1] ~= nil and row.entry or nil
end

-- The buffers, as found; equal drive objects share one.
local function seen_of(list, shown, item, pnu, kind)
  local access = drive_objects.access_of(item)
  for _, each in ipairs(list) do
    if each.kind == kind and each.device == item.device and shown:same(each.access, access, pnu) then
      return each
    end
  end
  local made = { kind = kind, device = item.device, access = access, sample = item, columns = {} }
  list[#list + 1] = made
  return made
end

local function cells_of(item, frame)
  local told, cells = item.told or {}, {}
  for number, value in ipairs(item.values) do
    local cell = { value = value, frame = frame, text = told[value], format = item.format }
    cells[item.subindex + number - 1] = cell
  end
  return cells
end

local function are_others(known, now)
  for place, cell in pairs(now) do
    if known[place] and known[place].value ~= cell.value then return true end
  end
  return false
end

local function take_part(list, shown, item, part)
  local kind, column = part.listed.entry[1], part.listed.entry[2]
  local there = seen_of(list, shown, item, part.pnu, kind)
  local now = cells_of(part, item.frames.read_response or 0)
  if values.LEADING[column] then
    there.situations = part.listed.buffer ~= nil
    if are_others(there.columns[column] or {}, now) then there.columns = {} end
  elseif not there.columns.number and not there.columns.code then
    return
  end
  local cells = there.columns[column] or {}
  there.columns[column] = cells
  for place, cell in pairs(now) do cells[place] = cell end
end

-- What one response shows: first what entries there are, then the rest of them.
local function take(list, shown, item)
  for _, leads in ipairs({ true, false }) do
    for _, part in ipairs(item.parameters) do
      local entry = entry_of(part)
      if entry and (values.LEADING[entry[2]] or false) == leads then take_part(list, shown, item, part) end
    end
  end
end

local function places_of(columns)
  local places, known = {}, {}
  for name in pairs(values.LEADING) do
    for place, cell in pairs(columns[name] or {}) do
      if cell.value ~= 0 and not known[place] then
        known[place], places[#places + 1] = true, place
      end
    end
  end
  sort(places)
  return places
end

-- The entries that there are; nil where nothing but their numbers is known.
local function finished(seen, targets)
  local entries, frames, known, more = {}, {}, {}, false
  local places = places_of(seen.columns)
  for number = 1, math.min(#places, ENTRIES_LISTED) do
    local place, cells = places[number], {}
    for _, name in ipairs(COLUMNS) do
      local cell = seen.columns[name] and seen.columns[name][place]
      cells[name] = cell
      more = more or cell ~= nil and not values.LEADING[name]
      if cell and not known[cell.frame] then
        known[cell.frame], frames[#frames + 1] = true, cell.frame
      end
    end
    local situation = seen.situations and floor(place / values.PLACES) or nil
    entries[number] = { subindex = place, situation = situation, cells = cells }
  end
  if not more then return nil end
  sort(frames)
  return {
    kind = seen.kind, device = seen.device, target = targets:place(seen.sample), frames = frames,
    entries = entries,
  }
end

--- Those of which a capture shows more than the numbers, in the order in which they were seen first.
function M.of(transactions, targets)
  local read, list, found = {}, {}, {}
  for place, item in ipairs(transactions) do
    if item.operation == "read" and ANSWERED[item.state] and item.channel ~= "s7" then
      read[#read + 1] = { item = item, frame = item.frames.read_response or 0, place = place }
    end
  end
  sort(read, function(a, b)
    if a.frame ~= b.frame then return a.frame < b.frame end
    return a.place < b.place
  end)
  for _, each in ipairs(read) do take(list, targets.shown, each.item) end
  for _, each in ipairs(list) do found[#found + 1] = finished(each, targets) end
  return found
end

-- Words

local function text_of(cell)
  if cell == nil then return "" end
  return words.escape(cell.text or words.value(cell.value, cell.format))
end

local function situation_of(kind, entry, lang)
  if entry.situation == nil then return "" end
  if entry.situation == 0 then return words.say(lang, "value_active") end
  if kind ~= "faults" then return words.say(lang, "value_gone") end
  return words.say(lang, "value_acknowledged", { n = words.integer(entry.situation) })
end

local function name_of(cells, lang)
  local number, code = cells.number, cells.code
  if not number or not code or number.value == code.value then return text_of(number or code) end
  return words.joined(lang, { text_of(number), words.say(lang, "buffer_code", { code = text_of(code) }) })
end

local function is_whole(cell)
  return cell and type(cell.value) == "number" and not (cell.format or ""):find("^Float")
end

local function time_of(entry, first, lang)
  local cell = entry.cells.time
  if not is_whole(cell) then return "" end
  local key = entry.situation or -1
  first[key] = first[key] or cell.value
  local told = words.say(lang, "buffer_time", { time = words.integer(cell.value) .. " ms" })
  if entry.situation and cell.value ~= first[key] then
    told = told .. format(" (%+d ms)", cell.value - first[key])
  end
  return told
end

local function gone_of(cell, lang)
  if not is_whole(cell) or cell.value == 0 then return "" end
  return words.say(lang, "buffer_gone", { time = words.integer(cell.value) .. " ms" })
end

--- `Fault buffer of 192.168.0.33 DO 2, read in frames 12, 16`.
function M.head(item, lang)
  local frames, where = {}, words.escape(item.device)
  for number, frame in ipairs(item.frames) do frames[number] = words.integer(frame) end
  if item.target ~= "" then where = where .. " " .. item.target end
  return words.say(lang, "buffer_" .. item.kind, { where = where, frames = concat(frames, ", ") })
end

-- Rows without the columns that have no word.
local function without_empty(rows)
  local found = {}
  for number in ipairs(rows) do found[number] = {} end
  for at in ipairs(rows[1]) do
    local any = false
    for _, row in ipairs(rows) do any = any or row[at] ~= "" end
    for number, row in ipairs(any and rows or {}) do found[number][#found[number] + 1] = row[at] end
  end
  return found
end

--- The cells of a table: which entry, what it is, when it was, and its value; no column without a word.
function M.rows(item, lang)
  local rows, first = {}, {}
  for number, entry in ipairs(item.entries) do
    local value = entry.cells.value
    rows[number] = {
      situation_of(item.kind, entry, lang), format("[%d]", entry.subindex), name_of(entry.cells, lang),
      time_of(entry, first, lang), gone_of(entry.cells.gone, lang),
      value and words.say(lang, "buffer_value", { value = text_of(value) }) or "",
    }
  end
  return without_empty(rows)
end

return M
