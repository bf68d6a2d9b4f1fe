--- Report as CSV: one row per parameter, for spreadsheets (Python: ds47.report.csv).
-- The columns and cells of `ds47 report -f csv`; the rows stand in the order of the transactions. UTF-8,
-- comma, LF. A text that a spreadsheet would take for a formula gets a quote (') in front, and what nobody
-- could see is an escape, so that a row is a line. Opens no file.

local json = require("ds47.support.json")
local numbers = require("ds47.support.numbers")
local sentences = require("ds47.report.sentences")
local times = require("ds47.support.times")
local words = require("ds47.report.formatting")

local M = {}

local concat, find, floor, format = table.concat, string.find, math.floor, string.format
local gsub, sub = string.gsub, string.sub
local integer = words.integer

M.TRANSACTION_COLUMNS = {
  "path", "transaction", "channel", "operation", "state", "controller", "device", "station", "ar", "api",
  "slot", "subslot", "index", "request_reference", "axis", "frames.write_request", "frames.write_response",
  "frames.read_request", "frames.read_response", "polls", "start", "duration_ms", "cycles", "status.write",
  "status.read", "findings",
}
M.PARAMETER_COLUMNS = {
  "pnu", "subindex", "attribute", "element_count", "name", "unit", "format", "value_count", "values",
  "scaled", "error.code", "error.text", "error.info",
}

-- Of jobs of S7, which are the analyzer's: here they are empty.
M.S7_COLUMNS = { "connection", "r_id", "error", "item.address", "item.length", "item.value", "item.code" }

local FULL_WIDTH = { ["\239\188\157"] = true, ["\239\188\139"] = true, ["\239\188\141"] = true,
  ["\239\188\160"] = true } -- = + - @ in UTF-8

--- A text that no spreadsheet takes for a formula and no terminal for a command.
-- Blanks in front are skipped by some spreadsheets; tabs and line ends are escapes here.
function M.guarded(text)
  if not text then
    return nil
  end
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

local function visible(character)
  return (gsub(words.escape(character), "^\\x", "\\u00"))
end

local function json_text(text)
  text = json.quoted(text)
  if words.escape(text) ~= text then
    text = gsub(text, words.CHARACTER, visible)
  end
  return text
end

--- One value stands as it is, several as a JSON array.
local function values(list, format_name, scaled)
  if not list or #list == 0 then
    return nil
  elseif #list == 1 then
    local value = list[1]
    if type(value) ~= "string" then
      return words.number(value, format_name, scaled)
    end
    return words.is_text(format_name) and M.guarded(value) or value
  end
  local parts = {}
  for i, value in ipairs(list) do
    parts[i] = type(value) == "string" and json_text(value) or words.number(value, format_name, scaled)
  end
  return "[" .. concat(parts, ", ") .. "]"
end

--- A cell as it stands in the file: quoted only where it must be.
local function cell(content)
  if content == nil then
    return ""
  elseif type(content) == "number" then
    return integer(content)
  elseif find(content, '[,"\r\n]') then
    return '"' .. gsub(content, '"', '""') .. '"'
  end
  return content
end

local function status(word)
  return word and format("%08X", word)
end

--- Adds cells that may be nil: `count` of them.
local function append(cells, count, ...)
  for i = 1, count do
    cells[#cells + 1] = cell((select(i, ...)))
  end
end

local function transaction_cells(item, path, base_seconds)
  local cells, frames = {}, item.frames
  local duration = item.duration_ns and numbers.float_text(item.duration_ns / 1000000)
  append(cells, 12, M.guarded(path), item.id, item.channel, item.operation, item.state,
    M.guarded(item.controller), M.guarded(item.device), item.station, item.ar, item.api, item.slot,
    item.subslot)
  append(cells, 7, item.index, item.request_reference, item.axis, frames.write_request,
    frames.write_response, frames.read_request, frames.read_response)
  append(cells, 7, #(frames.polls or {}), M.timestamp(base_seconds, item.start_ns), duration, item.cycles,
    status(item.write_status), status(item.read_status), concat(item.findings or {}, " "))
  return cells
end

local function parameter_cells(item, lang)
  local cells, failed = {}, item.error or {}
  local text = item.error and M.guarded(sentences.error_words(failed, lang))
  append(cells, 8, item.pnu, item.subindex, item.attribute, item.element_count,
    M.guarded(sentences.name(item, lang)), M.guarded(item.unit), item.format, item.value_count)
  append(cells, 5, values(item.values, item.format), values(item.scaled, item.format, true), failed.code,
    text, failed.info)
  return cells
end

--- The transactions of one capture.
-- @param result what Analysis:ended() gives
-- @param options nil or {path = name of the capture, lang = "en" or "zh"}
-- @return text: the header, then a row per parameter; each line ended with LF
function M.report(result, options)
  options = options or {}
  local path = options.path or "-"
  local rows = { concat(M.TRANSACTION_COLUMNS, ",") .. "," .. concat(M.PARAMETER_COLUMNS, ",") .. ","
    .. concat(M.S7_COLUMNS, ",") }
  local nothing, no_job = (","):rep(#M.PARAMETER_COLUMNS), (","):rep(#M.S7_COLUMNS - 1)
  for _, item in ipairs(result.transactions) do
    local left = concat(transaction_cells(item, path, result.base_seconds or 0), ",") .. ","
    for _, parameter in ipairs(item.parameters) do
      rows[#rows + 1] = left .. concat(parameter_cells(parameter, options.lang), ",") .. "," .. no_job
    end
    if #item.parameters == 0 then
      rows[#rows + 1] = left .. nothing .. no_job
    end
  end
  rows[#rows + 1] = ""
  return concat(rows, "\n")
end

return M
