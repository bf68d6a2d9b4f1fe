-- The stations of a line of PROFIBUS in words: a table, and what each said to Slave_Diag (docs/profibus.md 7;
-- Python: ds47.report.bus). What is wrong there are findings like all others.

local hex = require("ds47.support.bytes").hex
local tables = require("ds47.spec.tables")
local words = require("ds47.report.formatting")

local concat, format = table.concat, string.format
local duration, grouped, integer, say = words.duration, words.grouped, words.integer, words.say

local M = {}

local COLUMNS = {
  "station", "role", "ident", "ppo", "watchdog", "requests", "unanswered", "damaged", "retries", "exchanges",
  "cycle", "answer", "diagnoses",
}

local function name(address)
  return "dp" .. integer(address)
end

--- What the frames are, in one line.
function M.counts(bus, lang)
  return say(lang, "bus_counts", bus)
end

local function span(item)
  return item and duration(item.mean) .. " (" .. duration(item.most) .. ")" or ""
end

-- That of Set_Prm; nothing where that was not seen.
local function watchdog(item, lang)
  if not item.parameters then
    return ""
  end
  return item.watchdog_ms and grouped(item.watchdog_ms) .. " ms" or say(lang, "bus_off")
end

-- Of a station that nobody asked there is its role alone.
local function row_of(item, lang)
  local row = {name(item.address), say(lang, "bus_" .. item.role)}
  if item.requests == 0 then
    for place = 3, #COLUMNS do row[place] = "" end
    return row
  end
  local wanted = item.diagnoses_wanted
  for _, cell in ipairs({
    item.ident and format("%04X", item.ident) or "", item.ppo and "PPO" .. integer(item.ppo) or "",
    watchdog(item, lang), grouped(item.requests), grouped(item.unanswered), grouped(item.damaged),
    grouped(item.retries), grouped(item.exchanges), span(item.cycle), span(item.answer),
    wanted > 0 and integer(wanted) .. " (" .. integer(item.diagnoses_fetched) .. ")" or "",
  }) do
    row[#row + 1] = cell
  end
  return row
end

--- The names of the columns, and a row for each station.
function M.rows(bus, lang)
  local found = {{}}
  for place, column in ipairs(COLUMNS) do found[1][place] = say(lang, "bus_" .. column) end
  for number, each in ipairs(bus.stations) do found[number + 1] = row_of(each, lang) end
  return found
end

local function flags_of(item, lang)
  local known, told = {}, {}
  for _, row in ipairs(tables.profibus.diagnosis_flags) do known[row.id] = row end
  for number, id in ipairs(item.flags) do
    told[number] = lang == "zh" and known[id].zh or known[id].en
  end
  return #told > 0 and words.joined(lang, told, "; ", "；") or say(lang, "bus_no_flags")
end

local function diagnosis(address, item, lang)
  local text = say(lang, "bus_diagnosis", {
    station = name(address), frame = integer(item.frame), flags = flags_of(item, lang),
    ident = item.ident and format("%04X", item.ident) or "?",
    master = item.master and name(item.master) or say(lang, "bus_no_master"),
  })
  if #item.blocks == 0 then
    return text
  end
  local blocks = {}
  for number, block in ipairs(item.blocks) do
    blocks[number] = hex(block):upper():gsub("%x%x", "%0 "):sub(1, -2)
  end
  local told = say(lang, "bus_blocks", {blocks = concat(blocks, " | ")})
  return words.joined(lang, {text, told}, "; ", "；")
end

--- What stations said last to Slave_Diag: array of lines.
function M.diagnoses(bus, lang)
  local found = {}
  for _, each in ipairs(bus.stations) do
    if each.diagnosis then
      found[#found + 1] = diagnosis(each.address, each.diagnosis, lang)
    end
  end
  return found
end

-- The options that name the PPO of a station; empty where its data has the lengths of none.
local function options_of(item)
  local options = {}
  for _, row in ipairs(tables.profibus.ppos) do
    local length = 0
    for _, each in ipairs(row.modules) do length = length + each end
    if item.outputs == length and item.inputs == length then
      options[#options + 1] = format("--ppo %d=ppo%d", item.address, row.number)
    end
  end
  return concat(options, " | ")
end

--- How to name the PPO of stations whose Chk_Cfg is missing: array of lines.
-- @param relations  channels that are known already, those of a PPO that was named among them
function M.hints(bus, relations, lang)
  local found, known = {}, {}
  for _, each in ipairs(relations) do known[each.device] = true end
  for _, each in ipairs(bus.stations) do
    local options = (each.configuration or known[name(each.address)]) and "" or options_of(each)
    if options ~= "" then
      found[#found + 1] = say(lang, "bus_hint", {station = name(each.address), options = options})
    end
  end
  return found
end

return M
