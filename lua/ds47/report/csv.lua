--- Report as CSV: one row per parameter, for spreadsheets (Python: ds47.report.csv).
-- The columns and cells of `ds47 report -f csv`; the rows stand in the order of the transactions. UTF-8,
-- comma, LF. A text that a spreadsheet would take for a formula gets a quote (') in front, and what nobody
-- could see is an escape, so that a row is a line. Opens no file.

local drive_objects = require("ds47.profidrive.drive_objects")
local json = require("ds47.support.json")
local mapped = require("ds47.support.arrays").mapped
local numbers = require("ds47.support.numbers")
local sentences = require("ds47.report.sentences")
local tables = require("ds47.spec.tables")
local targets = require("ds47.report.targets")
local times = require("ds47.support.times")
local words = require("ds47.report.formatting")

local M = {}

local concat, find, floor, format = table.concat, string.find, math.floor, string.format
local gsub, match, sub = string.gsub, string.match, string.sub
local integer = words.integer

local FULL_WIDTH = { ["\239\188\157"] = true, ["\239\188\139"] = true, ["\239\188\141"] = true,
  ["\239\188\160"] = true } -- = + - @ in UTF-8

--- A text that no spreadsheet takes for a formula and no terminal for a command.
-- Blanks in front are skipped by some spreadsheets; tabs and line ends are escapes here.
function M.guarded(text)
  if not text then return nil end
  local shown = words.escape(text)
  local begin = gsub(shown, "^ +", "")
  return (find(begin, "^[=+%-@]") or FULL_WIDTH[sub(begin, 1, 3)]) and "'" .. shown or shown
end

--- A time as ISO 8601 in UTC with nine digits.
-- @param base_seconds seconds since 1970 to which time_ns is relative
-- @param time_ns as times.lua has it
function M.timestamp(base_seconds, time_ns)
  local more, nanoseconds = times.split(time_ns)
  local seconds = base_seconds + more
  local days = floor(seconds / 86400)
  seconds = seconds - days * 86400
  local year, month, day = times.date(days)
  local hour, minute = floor(seconds / 3600), floor(seconds / 60) % 60
  return format("%04.0f-%02.0f-%02.0fT%02.0f:%02.0f:%02.0f.%09.0fZ", year, month, day, hour, minute,
    seconds % 60, nanoseconds)
end

local function visible(character) return (gsub(words.escape(character), "^\\x", "\\u00")) end

local function json_text(text)
  text = json.quoted(text)
  if words.escape(text) ~= text then text = gsub(text, words.CHARACTER, visible) end
  return text
end

--- One value stands as it is, several as a JSON array.
local function values(list, format_name, scaled)
  if not list or #list == 0 then return nil end
  if #list == 1 then
    local value = list[1]
    if type(value) ~= "string" then return words.number(value, format_name, scaled) end
    return words.is_text(format_name) and M.guarded(value) or value
  end
  local parts = mapped(list, function(value)
    return type(value) == "string" and json_text(value) or words.number(value, format_name, scaled)
  end)
  return "[" .. concat(parts, ", ") .. "]"
end

--- A cell as it stands in the file: quoted only where it must be.
local function cell(content)
  if content == nil then return "" end
  if type(content) == "number" then return integer(content) end
  if find(content, '[,"\r\n]') then return '"' .. gsub(content, '"', '""') .. '"' end
  return content
end

local function status(word) return word and format("%08X", word) end

--- What reads a key of an object, with a dot between a key and the one inside it: a function of the object.
function M.reader(key)
  local outer, inner = match(key, "^(%w+)%.(.+)$")
  if outer then return function(item) return item[outer] and item[outer][inner] end end
  return function(item) return item[key] end
end

-- What reads each of these columns: a function of `own`, by column, of the object and what comes with it; of
-- another column the object has the value.
local function readers(columns, own)
  return mapped(columns, function(column) return own[column] or M.reader(column) end)
end

local function cells(reads, item, about)
  return concat(mapped(reads, function(read) return cell(read(item, about)) end), ",")
end

-- `about` is {result, path}.
local OF_TRANSACTION = {
  path = function(_, about) return M.guarded(about.path) end,
  transaction = function(item) return item.id end,
  controller = function(item) return M.guarded(item.controller) end,
  device = function(item) return M.guarded(item.device) end,
  drive_object = function(item, about) return drive_objects.reached(about.result, item) end,
  telegram = function(item, about) return targets.telegram(about.result, item) end,
  polls = function(item) return #(item.frames.polls or {}) end,
  start = function(item, about) return M.timestamp(about.result.base_seconds or 0, item.start_ns) end,
  duration_ms = function(item)
    return item.duration_ns and numbers.float_text(item.duration_ns / 1000000)
  end,
  ["status.write"] = function(item) return status(item.write_status) end,
  ["status.read"] = function(item) return status(item.read_status) end,
  findings = function(item) return concat(item.findings or {}, " ") end,
}

local OF_PARAMETER = {
  name = function(item, lang) return M.guarded(sentences.name(item, lang)) end,
  unit = function(item) return M.guarded(item.unit) end,
  values = function(item) return values(item.values, item.format) end,
  scaled = function(item) return values(item.scaled, item.format, true) end,
  ["error.text"] = function(item, lang)
    return item.error and M.guarded(sentences.error_words(item.error, lang))
  end,
}

--- The transactions of one capture.
-- @param result what Analysis:ended() gives
-- @param options nil or {path = name of the capture, lang = "en" or "zh"}
-- @return text: the header, then a row per parameter; each line ended with LF
function M.report(result, options)
  options = options or {}
  local columns, about = tables.columns, { result = result, path = options.path or "-" }
  local of_transaction = readers(columns.transaction, OF_TRANSACTION)
  local of_parameter = readers(columns.parameter, OF_PARAMETER)
  local rows = { concat({
    concat(columns.transaction, ","), concat(columns.parameter, ","), concat(columns.s7, ","),
  }, ",") }
  local nothing, no_job = (","):rep(#columns.parameter), (","):rep(#columns.s7 - 1)
  for _, item in ipairs(result.transactions) do
    local left = cells(of_transaction, item, about) .. ","
    for _, parameter in ipairs(item.parameters) do
      rows[#rows + 1] = left .. cells(of_parameter, parameter, options.lang) .. "," .. no_job
    end
    if #item.parameters == 0 then rows[#rows + 1] = left .. nothing .. no_job end
  end
  rows[#rows + 1] = ""
  return concat(rows, "\n")
end

return M
