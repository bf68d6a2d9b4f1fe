--- Statistics of a capture as tables of fixed width, in English or Chinese: response times per operation and
-- device, errors per code, slowest transactions, unanswered requests, findings per rule.
-- `compute` counts, `text` prints. Takes the result of Analysis:ended(); opens no file.
--
-- No table is wider than the window that Wireshark opens for a text: a row that is longer has several
-- lines.

local report_text = require("ds47.report.text")
local sentences = require("ds47.report.sentences")
local status = require("ds47.spec.statuses")
local tables = require("ds47.spec.tables")
local targets = require("ds47.report.targets")
local words = require("ds47.report.formatting")

local M = {}

local concat, format, sort = table.concat, string.format, table.sort
local integer, escape, stripped = words.integer, words.escape, words.stripped

M.SLOWEST = 10 -- transactions in the table of the slowest
M.ROWS = 50 -- rows of the tables of errors and of unanswered requests; how many more is stated
M.WIDTH = 72 -- columns of a table: as many as that window shows
M.INDENT = 6 -- blanks before the further lines of a row
M.ASKED_WIDTH = 60 -- columns for what was asked

local OPERATIONS = { "read", "change", "vendor", "unknown" }

-- The words of each language.
local TEXTS = {
  title = { en = "DS47 statistics", zh = "DS47 统计" },
  frames = { en = "%s frames", zh = "%s 帧" },
  transactions = { en = "%s transactions", zh = "%s 个任务" },
  findings = { en = "%s findings", zh = "%s 个结论" },
  none = { en = "none", zh = "无" },
  more = { en = "and %s more", zh = "还有 %s 条" },
  all = { en = "all", zh = "全部" },
  duration = {
    en = "Response time in ms: from the Write request to the Read response",
    zh = "响应时间（ms）：从写请求到读响应",
  },
  drive = {
    en = "Share of the drive in ms: the same without the pause of the program before its first Read",
    zh = "驱动器所占时间（ms）：不含程序在第一次读之前的停顿",
  },
  negative = { en = "%s negative times left out: the clock was set back", zh = "%s 个负时间未计入：时钟被调回" },
  device = { en = "Device", zh = "设备" },
  operation = { en = "Operation", zh = "操作" },
  number = { en = "Count", zh = "数量" },
  timed = { en = "Timed", zh = "计时" },
  min = { en = "Min", zh = "最小" },
  mean = { en = "Mean", zh = "平均" },
  max = { en = "Max", zh = "最大" },
  errors = {
    en = "Negative responses by error number, each with its first frame",
    zh = "按错误号统计的否定应答（附首次出现的帧）",
  },
  code = { en = "Code", zh = "代码" },
  text = { en = "Meaning", zh = "含义" },
  read = { en = "read", zh = "读" },
  write = { en = "write", zh = "写" },
  refusals = {
    en = "Refused record calls, each with its first frame",
    zh = "被拒绝的记录调用（附首次出现的帧）",
  },
  status = { en = "Status", zh = "状态字" },
  call = { en = "Call", zh = "调用" },
  slowest = { en = "Slowest transactions", zh = "最慢的任务" },
  transaction = { en = "No.", zh = "编号" },
  frame = { en = "Frame", zh = "帧" },
  took = { en = "ms", zh = "ms" },
  share = { en = "Drive", zh = "驱动器" },
  state = { en = "State", zh = "状态" },
  asked = { en = "Asked", zh = "请求内容" },
  unanswered = {
    en = "Requests without a response (unanswered, superseded, incomplete)",
    zh = "没有应答的请求（无应答、被取代、不完整）",
  },
  rules = { en = "Findings by rule, each with its first frame", zh = "按规则统计的结论（附首次出现的帧）" },
  rule = { en = "Rule", zh = "规则" },
  severity = { en = "Severity", zh = "严重程度" },
  name = { en = "Name", zh = "名称" },
}

local function texts_in(lang)
  local texts = { lang = lang == "zh" and lang or "en" }
  for key, words_of in pairs(TEXTS) do
    texts[key] = words_of[texts.lang]
  end
  return texts
end

-- Counting

--- Count, smallest, mean, median, 95th percentile and largest of times in ns; negative ones, which a clock
-- set back leaves, are only counted. A percentile is the nearest rank: always one that was measured.
local function distribution(durations)
  local ordered, sum = {}, 0
  for _, each in ipairs(durations) do
    if each >= 0 then
      ordered[#ordered + 1] = each
      sum = sum + each
    end
  end
  sort(ordered)
  local timed = #ordered
  if timed == 0 then
    return { timed = 0, negative = #durations }
  end
  local function percentile(percent)
    return ordered[math.ceil(percent * timed / 100)]
  end
  return {
    timed = timed, negative = #durations - timed, min = ordered[1], mean = sum / timed,
    p50 = percentile(50), p95 = percentile(95), max = ordered[timed],
  }
end

local function counted_in(row, item)
  row.count = row.count + 1
  row.durations[#row.durations + 1] = item.duration_ns
  if item.duration_ns then
    row.drives[#row.drives + 1] = item.drive_ns
  end
end

local function new_row(device, operation)
  return { device = device, operation = operation, count = 0, durations = {}, drives = {} }
end

--- Rows {device, operation, count, duration, drive}, by device in the order of the capture, then operation.
local function response_times(transactions)
  local devices, by_device, all = {}, {}, new_row("", "")
  for _, item in ipairs(transactions) do
    local device, operation = item.device, item.operation
    if not by_device[device] then
      by_device[device] = {}
      devices[#devices + 1] = device
    end
    by_device[device][operation] = by_device[device][operation] or new_row(device, operation)
    counted_in(by_device[device][operation], item)
    counted_in(all, item)
  end
  local rows = {}
  for _, device in ipairs(devices) do
    for _, operation in ipairs(OPERATIONS) do
      rows[#rows + 1] = by_device[device][operation]
    end
  end
  if #rows > 1 then
    rows[#rows + 1] = all -- the sum, behind the others
  end
  for _, row in ipairs(rows) do
    row.duration, row.drive = distribution(row.durations), distribution(row.drives)
    row.durations, row.drives = nil, nil
  end
  return rows
end

--- Counts things that are equal in `key`: rows as `make` gives them, with `count`; the most frequent first.
local function counted()
  local rows, by_key = {}, {}
  return rows, function(key, row)
    local known = by_key[key]
    if known then
      known.count = known.count + 1
      return
    end
    row.count, row.order = 1, #rows
    by_key[key] = row
    rows[#rows + 1] = row
  end
end

local function by_count(a, b)
  return a.count > b.count or a.count == b.count and a.order < b.order
end

--- Error numbers of parameters: rows {device, code, text, count, frame of the first}.
local function errors(transactions, lang)
  local rows, add = counted()
  for _, item in ipairs(transactions) do
    for _, parameter in ipairs(item.parameters) do
      local failed = parameter.error
      if failed then
        local code = sentences.error_number(failed) or "-"
        local text, frame = sentences.error_words(failed, lang), item.frames.read_response
        local row = { device = item.device, code = code, text = text, frame = frame }
        add(concat({ item.device, code, text }, "\0"), row)
      end
    end
  end
  sort(rows, by_count)
  return rows
end

--- Record calls with a negative status: rows {device, call, status, text, count, frame of the first}.
-- Polls are none: they are counted with their transaction.
local function refusals(transactions, lang)
  local rows, add = counted()
  for _, item in ipairs(transactions) do
    for _, call in ipairs({ "write", "read" }) do
      local word = item[call .. "_status"]
      if word and word ~= 0 then
        local row = {
          device = item.device, call = call, status = format("%08X", word),
          text = status.status_text(word, lang), frame = item.frames[call .. "_response"],
        }
        add(concat({ item.device, call, row.status }, "\0"), row)
      end
    end
  end
  sort(rows, by_count)
  return rows
end

local function slowest(transactions)
  local list = {}
  for _, item in ipairs(transactions) do
    if item.duration_ns and item.duration_ns >= 0 then
      list[#list + 1] = item
    end
  end
  sort(list, function(a, b)
    return a.duration_ns > b.duration_ns or a.duration_ns == b.duration_ns and a.id < b.id
  end)
  for i = #list, M.SLOWEST + 1, -1 do
    list[i] = nil
  end
  return list
end

local function unanswered(transactions)
  local list = {}
  for _, item in ipairs(transactions) do
    if item.state == "unanswered" or item.state == "superseded" or item.state == "incomplete" then
      list[#list + 1] = item
    end
  end
  return list
end

--- Counts what a capture holds.
-- @param result what Analysis:ended() gives
-- @param lang "en" or "zh": of the meaning of an error number and of a status
-- @return {transactions, findings (how many), states, response_times, errors, refusals, slowest, unanswered,
--   rules}: the last six are arrays of rows
function M.compute(result, lang)
  local list = result.transactions
  local groups = report_text.by_rule(result.findings)
  local rules = {}
  for i, group in ipairs(groups) do
    rules[i] = { rule = group[1].rule, severity = group[1].severity, count = #group, frame = group[1].frame }
  end
  return {
    transactions = #list, findings = #result.findings, states = report_text.by_state(list, lang),
    response_times = response_times(list), errors = errors(list, lang),
    refusals = refusals(list, lang),
    slowest = slowest(list), unanswered = unanswered(list), rules = rules,
  }
end

-- Printing

-- The columns of each line of a row: {indent, and {place, width, right} in their order}.
local function lines_of(columns, rows)
  local lines = {}
  for place, column in ipairs(columns) do
    local width = words.width(column[1])
    for _, row in ipairs(rows) do
      width = row.heading and width or math.max(width, words.width(row[place]))
    end
    local number = column.line or 1
    lines[number] = lines[number] or { indent = number == 1 and 2 or M.INDENT }
    table.insert(lines[number], { place = place, width = width, right = column[2] == ">" })
  end
  return lines
end

-- A line of a row; where it grows too long its last cell goes on below itself.
local function add_line(add, line, cells)
  local text = (" "):rep(line.indent)
  for number, column in ipairs(line) do
    local cell = cells[column.place]
    local blanks = (" "):rep(column.width - words.width(cell))
    if number == #line and not column.right then
      for _, part in ipairs(words.wrap(text .. cell, M.WIDTH, words.width(text))) do
        add(part)
      end
      return
    end
    text = text .. (column.right and blanks .. cell or cell .. blanks) .. "  "
  end
  add(stripped(text))
end

-- How wide a table is: as its widest line.
local function width_of(lines)
  local most = 0
  for _, line in ipairs(lines) do
    local width = line.indent - 4
    for _, column in ipairs(line) do
      width = width + column.width + 2
    end
    most = math.max(most, width)
  end
  return math.min(most, M.WIDTH - 2)
end

--- Rows of cells as lines of fixed width.
-- @param columns array of {title, align, line}: align ">" for the right; line: of the row, 1 where none is
--   named; the last column of a line ends where its text does
-- @param rows array of arrays of texts, or of {heading = text} for those that follow it
local function table_lines(add, columns, rows)
  local lines, titles = lines_of(columns, rows), {}
  for place, column in ipairs(columns) do
    titles[place] = column[1]
  end
  for _, line in ipairs(lines) do
    add_line(add, line, titles)
  end
  add("  " .. ("-"):rep(width_of(lines)))
  for _, row in ipairs(rows) do
    if row.heading then
      add("  " .. row.heading)
    else
      for _, line in ipairs(lines) do
        add_line(add, line, row)
      end
    end
  end
end

--- A titled table; `none` where it has no row, and how many rows were left out.
local function section(add, texts, title, columns, list, cells)
  add("")
  for _, line in ipairs(words.wrap(title, M.WIDTH)) do
    add(line)
  end
  if #list == 0 then
    add("  " .. texts.none)
    return
  end
  local rows = {}
  for i = 1, math.min(#list, M.ROWS) do
    rows[i] = cells(list[i])
  end
  table_lines(add, columns, rows)
  if #list > M.ROWS then
    add("  " .. format(texts.more, integer(#list - M.ROWS)))
  end
end

-- From a second on nobody looks at microseconds.
local function milliseconds(nanoseconds)
  return nanoseconds and format(nanoseconds < 1e9 and "%.3f" or "%.1f", nanoseconds / 1e6) or "-"
end

local function number(value)
  return value and integer(value) or "-"
end

--- Cuts a text to a number of columns.
local function shortened(text, columns)
  if words.width(text) <= columns then
    return text
  end
  local parts, width = {}, 3
  for character in text:gmatch(words.CHARACTER) do
    width = width + words.width(character)
    if width > columns then
      break
    end
    parts[#parts + 1] = character
  end
  return concat(parts) .. "..."
end

--- What a transaction asked for: `p50303[0]; p50304[0] := 100.0`, cut where it grows long.
local function asked(item)
  local parts, change = {}, item.operation == "change"
  for i, each in ipairs(item.items or {}) do
    parts[i] = each.address or "?"
  end
  for i, parameter in ipairs(item.parameters) do
    local text = words.address(parameter)
    if change and #parameter.values > 0 then
      text = text .. " := " .. words.values(parameter.values, parameter.format)
    end
    parts[i] = text
  end
  return shortened(#parts > 0 and concat(parts, "; ") or "-", M.ASKED_WIDTH)
end

local function operation_of(texts, key)
  return words.operation(texts.lang, key)
end

-- The device, and what of it a request addresses, as far as that is known.
local function place(names, item)
  local where = names:place(item, false)
  return where == "" and escape(item.device) or escape(item.device) .. " " .. where
end

-- The rows of response times, before those of each device one that names it.
local function under_devices(rows)
  local list, device = {}, ""
  for _, row in ipairs(rows) do
    if row.device ~= device and row.device ~= "" then
      list[#list + 1] = { heading = escape(row.device) }
    end
    device = row.device
    list[#list + 1] = row
  end
  return list
end

local function response_time_section(add, texts, rows, key)
  local columns = {
    { texts.operation }, { texts.number, ">" }, { texts.timed, ">" }, { texts.min, ">" },
    { texts.mean, ">" }, { "p50", ">" }, { "p95", ">" }, { texts.max, ">" },
  }
  local negative = 0
  section(add, texts, texts[key], columns, under_devices(rows), function(row)
    local times = row[key]
    if row.heading then
      return row
    end
    negative = math.max(negative, times.negative)
    return {
      row.device == "" and texts.all or "  " .. operation_of(texts, row.operation), integer(row.count),
      integer(times.timed), milliseconds(times.min), milliseconds(times.mean), milliseconds(times.p50),
      milliseconds(times.p95), milliseconds(times.max),
    }
  end)
  if negative > 0 then
    add("  " .. format(texts.negative, integer(negative)))
  end
end

local function error_sections(add, texts, statistics)
  local columns = {
    { texts.code }, { texts.number, ">" }, { texts.frame, ">" }, { texts.device }, { texts.text },
  }
  section(add, texts, texts.errors, columns, statistics.errors, function(row)
    return { row.code, integer(row.count), number(row.frame), escape(row.device), escape(row.text) }
  end)
  columns[1] = { texts.status }
  table.insert(columns, 2, { texts.call })
  section(add, texts, texts.refusals, columns, statistics.refusals, function(row)
    local call = texts[row.call]
    return { row.status, call, integer(row.count), number(row.frame), escape(row.device), escape(row.text) }
  end)
end

local function transaction_sections(add, texts, statistics, names)
  local columns = {
    { texts.took, ">" }, { texts.share, ">" }, { texts.transaction, ">" }, { texts.frame, ">" },
    { texts.operation }, { texts.device }, { texts.asked, line = 2 },
  }
  section(add, texts, texts.slowest, columns, statistics.slowest, function(item)
    return {
      milliseconds(item.duration_ns), milliseconds(item.drive_ns), "#" .. integer(item.id),
      number(item.frames.read_response), operation_of(texts, item.operation), place(names, item), asked(item),
    }
  end)
  columns = {
    { texts.frame, ">" }, { texts.transaction, ">" }, { texts.state }, { texts.operation }, { texts.device },
    { texts.asked, line = 2 },
  }
  section(add, texts, texts.unanswered, columns, statistics.unanswered, function(item)
    return {
      number(item.frames.write_request), "#" .. integer(item.id), words.state(texts.lang, item.state),
      operation_of(texts, item.operation), place(names, item), asked(item),
    }
  end)
end

local function rule_section(add, texts, rows, rules)
  local columns = {
    { texts.rule }, { texts.severity }, { texts.number, ">" }, { texts.frame, ">" }, { texts.name },
  }
  section(add, texts, texts.rules, columns, rows, function(row)
    local rule = rules[row.rule]
    return {
      row.rule, words.say(texts.lang, "severity_" .. row.severity), integer(row.count), number(row.frame),
      rule and (texts.lang == "zh" and rule.title_zh or rule.title) or "",
    }
  end)
end

local function heading(add, texts, statistics, options)
  local named = options.path and options.path ~= "-" -- "-": a file whose name nobody knows
  add(texts.title .. (named and ": " .. escape(options.path) or ""))
  local parts = {}
  if options.frames then
    parts[1] = format(texts.frames, integer(options.frames))
  end
  parts[#parts + 1] = format(texts.transactions, integer(statistics.transactions))
  local states = statistics.states
  if #states > 0 then
    parts[#parts] = parts[#parts] .. " (" .. concat(states, ", ") .. ")"
  end
  parts[#parts + 1] = format(texts.findings, integer(statistics.findings))
  for _, line in ipairs(words.wrap(concat(parts, ", "), M.WIDTH, 2)) do
    add(line)
  end
end

--- The statistics of one capture as text of fixed width.
-- @param result what Analysis:ended() gives
-- @param options nil or {lang = "en" or "zh", path = name of the capture, frames = frames in it}
-- @return text, every line ended with LF
function M.text(result, options)
  options = options or {}
  local texts = texts_in(options.lang)
  local statistics, lines = M.compute(result, texts.lang), {}
  local function add(line)
    lines[#lines + 1] = line
  end
  heading(add, texts, statistics, options)
  response_time_section(add, texts, statistics.response_times, "duration")
  response_time_section(add, texts, statistics.response_times, "drive")
  error_sections(add, texts, statistics)
  transaction_sections(add, texts, statistics, targets.new(result.transactions))
  rule_section(add, texts, statistics.rules, tables.rules)
  add("")
  return concat(lines, "\n")
end

return M
