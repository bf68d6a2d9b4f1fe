--- Statistics of a capture as tables of fixed width, in English or Chinese: response times per operation and
-- device, errors per code, slowest transactions, unanswered requests, findings per rule. Takes the result of
-- Analysis:ended(); opens no file.
--
-- No table is wider than the window that Wireshark opens for a text: a row that is longer has several
-- lines.

local arrays = require("ds47.support.arrays")
local report_text = require("ds47.report.text")
local sentences = require("ds47.report.sentences")
local status = require("ds47.spec.statuses")
local tables = require("ds47.spec.tables")
local targets = require("ds47.report.targets")
local words = require("ds47.report.formatting")

local M = {}

local concat, format, sort = table.concat, string.format, table.sort
local integer, escape, say = words.integer, words.escape, words.say

M.WIDTH = 72 -- columns of a table: as many as that window shows
local SLOWEST = 10 -- transactions in the table of the slowest
local ROWS = 50 -- rows of the tables of errors and of unanswered requests; how many more is stated
local INDENT = 6 -- blanks before the further lines of a row
local ASKED_WIDTH = 60 -- columns for what was asked

local OPERATIONS = { "read", "change", "vendor", "unknown" }
local OPEN = { unanswered = true, superseded = true, incomplete = true }

local COLUMNS, RIGHT = tables.statistics.columns, tables.statistics.right

--- What tables can be sorted by -> the column of one that has it. Of counts and times the greatest is first.
M.ORDERS = {
  count = { count = true }, time = { max = true, took = true }, frame = { frame = true },
  device = { device = true },
}
local GREATEST_FIRST = { count = true, time = true }

local function word(lang, key, values) return say(lang, "statistics_" .. key, values) end

-- From a second on nobody looks at microseconds.
local function milliseconds(nanoseconds)
  return nanoseconds and format(nanoseconds < 1e9 and "%.3f" or "%.1f", nanoseconds / 1e6) or "-"
end

local function number(value) return value and integer(value) or "-" end

-- Order

-- The column of the first lines of a table that decides its order; nil where it has none, or nobody chose.
local function decisive(lines, order)
  for _, keys in ipairs(order and lines or {}) do
    for _, key in ipairs(keys) do
      if M.ORDERS[order.by][key] then return key end
    end
  end
  return nil
end

-- A cell as it is compared: a number, or a text in which numbers count as such.
local function rank(cell)
  if cell == nil or cell == "-" then return nil end
  return tonumber(cell) or (cell:gsub("%d+", function(digits) return ("0"):rep(9 - #digits) .. digits end))
end

-- Rows by a column, equal ones as they were; those that have nothing there come last.
local function sorted(rows, key, order)
  local places, ranks = {}, {}
  local descending = (GREATEST_FIRST[order.by] == true) ~= (order.reversed == true)
  for place, row in ipairs(rows) do
    places[row], ranks[row] = place, rank(row[key])
  end
  local found = arrays.mapped(rows, function(row) return row end)
  sort(found, function(a, b)
    local one, other = ranks[a], ranks[b]
    if one == other then return places[a] < places[b] end
    if one == nil or other == nil then return other == nil end
    if descending then return one > other end
    return one < other
  end)
  return found
end

-- Rows: tables of texts and counts by the keys of their columns

-- The transactions {device, operation, items} by device in the order of the capture, then operation; behind
-- several of them all together.
local function groups_of(transactions)
  local devices, by_device, groups = {}, {}, {}
  for _, item in ipairs(transactions) do
    local operations = by_device[item.device]
    if not operations then
      operations = {}
      by_device[item.device] = operations
      devices[#devices + 1] = item.device
    end
    arrays.push(operations, item.operation, item)
  end
  for _, device in ipairs(devices) do
    for _, operation in ipairs(OPERATIONS) do
      local items = by_device[device][operation]
      groups[#groups + 1] = items and { device = device, operation = operation, items = items }
    end
  end
  if #groups > 1 then groups[#groups + 1] = { items = transactions } end
  return groups
end

--- Count, smallest, mean, median, 95th percentile and largest of times in ns; negative ones, which a clock
-- set back leaves, are only counted. A percentile is the nearest rank: always one that was measured.
local function distribution(items, key)
  local ordered, sum, negative = {}, 0, 0
  for _, item in ipairs(items) do
    local each = item.duration_ns and item[key .. "_ns"]
    if each and each >= 0 then
      ordered[#ordered + 1] = each
      sum = sum + each
    elseif each then
      negative = negative + 1
    end
  end
  sort(ordered)
  local timed = #ordered
  local function percentile(percent) return milliseconds(ordered[math.ceil(percent * timed / 100)]) end
  return {
    count = #items, timed = timed, negative = negative, min = milliseconds(ordered[1]),
    mean = milliseconds(timed > 0 and sum / timed or nil), p50 = percentile(50), p95 = percentile(95),
    max = milliseconds(ordered[timed]),
  }
end

-- A row for each group, before those of a device one that names it: devices in the order of their first rows.
local function response_times(groups, lang, key, order)
  local devices, by_device, all = {}, {}, {}
  local function row_of(group)
    local row = distribution(group.items, key)
    row.device = group.device
    row.operation = group.device and "  " .. say(lang, "operation_" .. group.operation) or word(lang, "all")
    return row
  end
  local rows = arrays.mapped(groups, row_of)
  local column = order and (order.by == "device" and "device" or decisive(COLUMNS[key], order))
  for _, row in ipairs(column and sorted(rows, column, order) or rows) do
    local device = row.device
    if device and not by_device[device] then devices[#devices + 1] = device end
    arrays.push(by_device, device, row)
    all[1] = device == nil and row or all[1]
  end
  rows = {}
  for _, device in ipairs(devices) do
    rows[#rows + 1] = { heading = device }
    arrays.append(rows, by_device[device])
  end
  arrays.append(rows, all)
  return rows
end

--- Of the rows that are equal in these columns the first one, with their count; the most frequent first.
local function counted(rows, columns)
  local found, known = {}, {}
  for _, row in ipairs(rows) do
    local about = concat(arrays.mapped(columns, function(key) return row[key] end), "\0")
    local first = known[about]
    if not first then
      first = row
      first.count, first.order = 0, #found
      known[about], found[#found + 1] = first, first
    end
    first.count = first.count + 1
  end
  sort(found, function(a, b) return a.count > b.count or a.count == b.count and a.order < b.order end)
  return found
end

--- Error numbers of parameters, each with its first frame.
local function errors(transactions, lang)
  local rows = {}
  for _, item in ipairs(transactions) do
    for _, parameter in ipairs(item.parameters) do
      local failed = parameter.error
      rows[#rows + 1] = failed and {
        device = item.device, code = sentences.error_number(failed) or "-",
        text = sentences.error_words(failed, lang), frame = number(item.frames.read_response),
      }
    end
  end
  return counted(rows, { "device", "code", "text" })
end

--- Record calls with a negative status, each with its first frame. Polls are none: they are counted with
-- their transaction.
local function refusals(transactions, lang)
  local rows = {}
  for _, item in ipairs(transactions) do
    for _, call in ipairs({ "write", "read" }) do
      local answer = item[call .. "_status"]
      rows[#rows + 1] = answer and answer ~= 0 and {
        device = item.device, call = word(lang, call), status = status.status_hex(answer),
        text = status.status_text(answer, lang), frame = number(item.frames[call .. "_response"]),
      } or nil
    end
  end
  return counted(rows, { "device", "call", "status" })
end

local function slowest(transactions)
  local list = arrays.filtered(transactions, function(item)
    return item.duration_ns and item.duration_ns >= 0
  end)
  sort(list, function(a, b)
    return a.duration_ns > b.duration_ns or a.duration_ns == b.duration_ns and a.id < b.id
  end)
  for i = #list, SLOWEST + 1, -1 do list[i] = nil end
  return list
end

local function unanswered(transactions)
  return arrays.filtered(transactions, function(item) return OPEN[item.state] end)
end

local function rules(findings, lang)
  local rows = {}
  for place, group in ipairs(report_text.by_rule(findings)) do
    local first = group[1]
    local known = tables.rules[first.rule]
    rows[place] = {
      rule = first.rule, severity = say(lang, "severity_" .. first.severity), count = #group,
      frame = number(first.frame), name = known and (lang == "zh" and known.title_zh or known.title) or "",
    }
  end
  return rows
end

--- Cuts a text to a number of columns.
local function shortened(text, columns)
  if words.width(text) <= columns then return text end
  local parts, width = {}, 3
  for character in text:gmatch(words.CHARACTER) do
    width = width + words.width(character)
    if width > columns then break end
    parts[#parts + 1] = character
  end
  return concat(parts) .. "..."
end

--- What a transaction asked for: `p50303[0]; p50304[0] := 100.0`, cut where it grows long.
local function asked(item)
  local parts, change = {}, item.operation == "change"
  for i, parameter in ipairs(item.parameters) do
    local text = words.address(parameter)
    if change and #parameter.values > 0 then
      local stated = words.stated(parameter)
      text = text .. " := " .. words.values(parameter.values, parameter.format, nil, nil, stated)
    end
    parts[i] = text
  end
  return shortened(#parts > 0 and concat(parts, "; ") or "-", ASKED_WIDTH)
end

-- The device, and what of it a request addresses, as far as that is known.
local function place_of(names, item)
  local where = names:place(item, false)
  return where == "" and item.device or item.device .. " " .. where
end

-- The row of a transaction, which begins with one of its frames.
local function transaction_row(item, frame, names, lang)
  return {
    took = milliseconds(item.duration_ns), share = milliseconds(item.drive_ns),
    transaction = "#" .. integer(item.id), frame = number(item.frames[frame]),
    state = say(lang, "state_" .. item.state), operation = say(lang, "operation_" .. item.operation),
    device = place_of(names, item), asked = asked(item),
  }
end

-- The cells of a row as texts.
local function shown(row)
  local cells = {}
  for key, value in pairs(row) do cells[key] = type(value) == "number" and integer(value) or escape(value) end
  return cells
end

-- A line of a row; where it grows too long its last cell goes on below itself.
local function add_line(add, indent, keys, widths, row)
  local text = (" "):rep(indent)
  for place, key in ipairs(keys) do
    local cell = row[key]
    local blanks = (" "):rep(widths[key] - words.width(cell))
    if place == #keys and not RIGHT[key] then
      add(text .. cell, words.width(text))
      return
    end
    text = text .. (RIGHT[key] and blanks .. cell or cell .. blanks) .. "  "
  end
  add(words.stripped(text))
end

--- Rows as lines of fixed width.
-- @param lines arrays of keys: the lines of a row
-- @param rows texts by these keys, the titles first; or {heading = text} for those that follow it
local function add_table(add, lines, rows)
  local widths, most = {}, 0
  for line, keys in ipairs(lines) do
    local width = line == 1 and 0 or INDENT - 2
    for _, key in ipairs(keys) do
      widths[key] = 0
      for _, row in ipairs(rows) do widths[key] = math.max(widths[key], words.width(row[key] or "")) end
      width = width + widths[key] + 2
    end
    most = math.max(most, width)
  end
  for place, row in ipairs(rows) do
    if row.heading then
      add("  " .. row.heading)
    else
      for line, keys in ipairs(lines) do add_line(add, line == 1 and 2 or INDENT, keys, widths, row) end
    end
    if place == 1 then add("  " .. ("-"):rep(math.min(most, M.WIDTH) - 2)) end
  end
end

--- A titled table; `none` where it has no row, and how many rows were left out.
-- @param order nil, or what decides the order of rows: those of response times have theirs
-- @param row_of nil or a function that gives the row of an entry of the list
local function section(add, lang, name, list, order, row_of)
  add("")
  add(word(lang, name), 0)
  if #list == 0 then
    add("  " .. word(lang, "none"))
    return
  end
  local titles, column = {}, decisive(COLUMNS[name], order)
  for _, keys in ipairs(COLUMNS[name]) do
    for _, key in ipairs(keys) do titles[key] = word(lang, key) .. (key == column and "*" or "") end
  end
  if column and not list[1].heading then
    list, row_of = sorted(row_of and arrays.mapped(list, row_of) or list, column, order), nil
  end
  local rows = { titles }
  for place = 1, math.min(#list, ROWS) do
    rows[place + 1] = shown(row_of and row_of(list[place]) or list[place])
  end
  add_table(add, COLUMNS[name], rows)
  if #list > ROWS then add("  " .. word(lang, "more", { n = integer(#list - ROWS) })) end
end

-- How often the clock was set back, as the rows that are shown have it.
local function add_negative(add, lang, rows)
  local negative = 0
  for place = 1, math.min(#rows, ROWS) do negative = math.max(negative, rows[place].negative or 0) end
  if negative > 0 then add("  " .. word(lang, "negative", { n = integer(negative) })) end
end

--- The line about a display filter: {text, all = how many transactions there are without it; nil of a filter
-- that is not valid}.
function M.filter_line(filter, lang)
  return word(lang, filter.all and "filter" or "no_filter", { filter = escape(filter.text) })
end

-- The numbers are given as text: they stand without commas here.
local function heading(add, lang, result, options)
  local named = options.path and options.path ~= "-" -- "-": a file whose name nobody knows
  add(word(lang, "title") .. (named and ": " .. escape(options.path) or ""))
  local parts = {}
  if options.frames then parts[1] = say(lang, "frames", { n = integer(options.frames) }) end
  local count, all = #result.transactions, options.filter and options.filter.all
  local jobs = all and word(lang, "among", { n = integer(count), all = integer(all) })
    or say(lang, "transactions", { n = integer(count) })
  local states = report_text.by_state(result.transactions, lang)
  parts[#parts + 1] = #states > 0 and jobs .. " (" .. concat(states, ", ") .. ")" or jobs
  parts[#parts + 1] = say(lang, "findings", { n = integer(#result.findings) })
  add(concat(parts, ", "), 2)
  if options.filter then add(M.filter_line(options.filter, lang), 2) end
end

--- The statistics of one capture as text of fixed width.
-- @param result what Analysis:ended() gives
-- @param options nil or {lang = "en" or "zh", path = name of the capture, frames = frames in it,
--   order = nil or {by = one of ORDERS, reversed}, filter = nil or as `filter_line` has it}
-- @return text, every line ended with LF
function M.text(result, options)
  options = options or {}
  local lang, order, transactions, lines = options.lang, options.order, result.transactions, {}
  -- A line; of a text that may be too long the lines, all but the first behind `hanging` blanks.
  local function add(text, hanging)
    arrays.append(lines, hanging and words.wrap(text, M.WIDTH, hanging) or { text })
  end
  heading(add, lang, result, options)
  local groups, names = groups_of(transactions), targets.new(transactions)
  for _, key in ipairs({ "duration", "drive" }) do
    local rows = response_times(groups, lang, key, order)
    section(add, lang, key, rows, order)
    add_negative(add, lang, rows)
  end
  section(add, lang, "errors", errors(transactions, lang), order)
  section(add, lang, "refusals", refusals(transactions, lang), order)
  section(add, lang, "slowest", slowest(transactions), order, function(item)
    return transaction_row(item, "read_response", names, lang)
  end)
  section(add, lang, "unanswered", unanswered(transactions), order, function(item)
    return transaction_row(item, "write_request", names, lang)
  end)
  section(add, lang, "rules", rules(result.findings, lang), order)
  add("")
  return concat(lines, "\n")
end

return M
