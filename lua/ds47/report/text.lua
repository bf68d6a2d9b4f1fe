--- Report as text, for a person: the verdict and what to do, a line per transaction, findings, a summary.
-- The same bytes as `ds47 report` prints for the same capture (Python: ds47.report.text), but for what the
-- analyzer alone has: diagnoses about the whole capture. What stands in a line is decided here, in the first
-- lines in summary.lua; how values are written in formatting.lua. Opens no file.

local all_frames = require("ds47.acyclic.transactions").all_frames
local buffers = require("ds47.report.buffers")
local bus = require("ds47.report.bus")
local clocks = require("ds47.report.clock")
local filters = require("ds47.report.filters")
local grouping = require("ds47.findings.grouping")
local opening = require("ds47.report.summary")
local plc = require("ds47.report.plc")
local is_bus = require("ds47.cyclic.relations").is_bus
local tables = require("ds47.spec.tables")
local targets = require("ds47.report.targets")
local timelines = require("ds47.report.timelines")
local todo = require("ds47.report.todo")
local verdict = require("ds47.report.verdict")
local words = require("ds47.report.formatting")

local M = {}

local duration, escape, integer = words.duration, words.escape, words.integer
local joined, noted, pad, say = words.joined, words.noted, words.pad, words.say
local concat, format, sort = table.concat, string.format, table.sort

M.WIDTH = 140 -- columns of a line; what can be copied is never broken
M.FINDINGS_PER_RULE = 12
M.RELATIONS_LISTED = 20
M.EVENTS_LISTED = 60
M.OPERATIONS = { "read", "change", "vendor", "unknown", "get", "put", "bsend", "usend" }
M.SEVERITIES = { "error", "warning", "note" } -- from serious to harmless

local RPC_COUNTS = {
  "requests", "responses", "faults", "rejects", "pings", "working", "others", "copies",
  "retransmissions", "unanswered",
}

local function frame_count(frames)
  local seen, count = {}, 0
  for _, frame in ipairs(all_frames(frames)) do
    if not seen[frame] then
      seen[frame], count = true, count + 1
    end
  end
  return count
end

--- Count, smallest, mean, median, 95th and 99th percentile and largest of times in ns; negative ones, which a
-- clock set back leaves, are only counted. A percentile is the nearest rank: always one that was measured.
function M.distribution(durations)
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
    p50 = percentile(50), p95 = percentile(95), p99 = percentile(99), max = ordered[timed],
  }
end

--- `4 ok, 1 error`: the counts that are not zero, in the order given. `kind` begins the keys of their words.
local function told_counts(lang, order, counts, kind)
  local parts = {}
  for _, key in ipairs(order) do
    if counts[key] and counts[key] > 0 then
      parts[#parts + 1] = integer(counts[key]) .. " " .. say(lang, kind .. key)
    end
  end
  return joined(lang, parts)
end

--- What a capture without transactions has instead, so that nobody doubts it was read.
local function traffic(result, lang)
  local indices, calls, rpc = {}, {}, {}
  for index in pairs(result.records or {}) do
    indices[#indices + 1] = index
  end
  sort(indices, function(a, b)
    return tonumber(a) < tonumber(b)
  end)
  for _, index in ipairs(indices) do
    for _, kind in ipairs({ "read", "write" }) do
      local number = result.records[index][kind]
      if number and number > 0 then
        local values = { index = index, kind = kind, number = integer(number) }
        calls[#calls + 1] = say(lang, "record_index", values)
      end
    end
  end
  for _, name in ipairs(RPC_COUNTS) do
    local number = result.rpc and result.rpc[name]
    if number and number > 0 then
      rpc[#rpc + 1] = format("%s %d", name, number)
    end
  end
  if #rpc == 0 then
    return nil
  end
  local shown = {}
  for i = 1, math.min(6, #calls) do
    shown[i] = calls[i]
  end
  if #calls > 6 then
    shown[7] = say(lang, "more", { number = integer(#calls - 6) })
  end
  local records = #calls > 0 and say(lang, "record_calls", { calls = joined(lang, shown) }) or ""
  return joined(lang, { "RPC", joined(lang, rpc) }, ": ", "：") .. records
end

local function header(add, result, counts, options)
  local lang = options.lang
  local frames = say(lang, "frames", { n = options.frames or result.frames or 0 })
  add(options.path and escape(options.path) .. ": " .. frames or frames)
  add(verdict.verdict(counts, lang))
  local span = options.clock:span(lang)
  if span then add("  " .. span) end
  if result.complete == false or result.problem then
    local problem = escape(result.problem or say(lang, "file_ends_early"))
    add("  " .. say(lang, "partly_read", { problem = problem }))
  end
  if result.dropped and result.dropped > 0 then
    add("  " .. say(lang, "machine_dropped", { n = result.dropped }))
  end
  if #result.transactions == 0 then
    local there = traffic(result, lang) or say(lang, result.bus and "no_bus_records" or "no_rpc")
    add("  " .. say(lang, "no_transaction") .. " (" .. there .. ")")
  end
end

local function where_of(relation)
  local place = relation.slot and format(" slot %d.%d", relation.slot, relation.subslot) or ""
  return escape(relation.device) .. place
end

-- The key of the words that say how sure a relation is.
local function certainty_of(relation)
  if relation.frame == nil then return "certainty_absent" end
  if relation.channel == "pzd" and relation.certainty == "seen" then return "certainty_seen_pzd" end
  return "certainty_" .. relation.certainty
end

local function relation_line(item, lang)
  local numbers = concat(item.telegrams, ", ")
  return say(lang, is_bus(item) and "relation_ppo" or "relation", {
    where = where_of(item), channel = item.channel:upper(),
    telegram = numbers ~= "" and say(lang, "relation_telegram", { numbers = numbers }) or "",
    output = format("%04X", item.output.frame_id), output_at = item.output.offset,
    input = format("%04X", item.input.frame_id), input_at = item.input.offset,
    cycle = item.input.cycle_ns > 0 and say(lang, "relation_cycle", { cycle = duration(item.input.cycle_ns) })
      or "",
    certainty = say(lang, certainty_of(item)),
  })
end

-- The words of a drive, where only one telegram has these lengths; nil elsewhere.
local function telegram_words(item, lang)
  local number = item.telegrams[1]
  if item.channel ~= "pzd" or #item.telegrams ~= 1 then return nil end
  local row = tables.pzd.telegrams[number]
  return say(lang, "relation_words", {
    number = integer(number), output = concat(row.out, ", "), input = concat(row.inward, ", "),
  })
end

--- The parameter channels in cyclic frames, and how sure each is.
local function relations(add, list, lang)
  if #list == 0 then
    return
  end
  add("")
  add(say(lang, "relations_head"))
  for i = 1, math.min(#list, M.RELATIONS_LISTED) do
    add("  " .. relation_line(list[i], lang))
    local told = telegram_words(list[i], lang)
    if told then add("    " .. told) end
  end
  if #list > M.RELATIONS_LISTED then
    add("  " .. say(lang, "more", { number = integer(#list - M.RELATIONS_LISTED) }))
  end
end

-- Cells in columns, each as wide as its widest cell, two blanks between them.
local function aligned(rows)
  local widths, lines = {}, {}
  for _, row in ipairs(rows) do
    for place, cell in ipairs(row) do
      widths[place] = math.max(widths[place] or 0, words.width(cell))
    end
  end
  for number, row in ipairs(rows) do
    local cells = {}
    for place, cell in ipairs(row) do
      cells[place] = cell .. (" "):rep(widths[place] - words.width(cell))
    end
    lines[number] = concat(cells, "  "):gsub(" +$", "")
  end
  return lines
end

--- The stations of PROFIBUS.
local function stations(add, copied, result, lang)
  local item = result.bus
  if not item then
    return
  end
  add("")
  add(say(lang, "bus_head"))
  add("  " .. bus.counts(item, lang))
  for _, line in ipairs(aligned(bus.rows(item, lang))) do
    copied("  " .. line)
  end
  for _, lines in ipairs({bus.diagnoses(item, lang), bus.hints(item, result.relations or {}, lang)}) do
    for _, line in ipairs(lines) do add("  " .. line) end
  end
end

local function event_cells(row, clock, lang)
  local standing = timelines.standing(row, lang)
  local cells = { say(lang, "frame", { frame = integer(row.last.frame) }), clock:at(row.last.time) }
  for _, cell in ipairs({
    clock:since(row.last.time) .. " s", timelines.change(row), timelines.words(row, lang),
    standing ~= "" and "[" .. standing .. "]" or "",
  }) do
    cells[#cells + 1] = cell
  end
  return cells
end

--- What happened to each drive, a line for each word and frame.
local function events(add, result, options)
  local copied, clock, lang = options.copied, options.clock, options.lang
  for _, timeline in ipairs(result.timelines or {}) do
    local relation, rows, cells = result.relations[timeline.relation], timelines.rows(timeline), {}
    add("")
    add(say(lang, "timeline_head", { where = where_of(relation) }))
    local reference = timelines.reference(result, relation.device, lang)
    if reference then add("  " .. reference) end
    for number = 1, math.min(#rows, M.EVENTS_LISTED) do
      cells[number] = event_cells(rows[number], clock, lang)
    end
    for _, line in ipairs(aligned(cells)) do
      copied("  " .. line)
    end
    if #rows > M.EVENTS_LISTED then
      add("  " .. say(lang, "more", { number = integer(#rows - M.EVENTS_LISTED) }))
    end
    if timeline.left_out > 0 then add("  " .. say(lang, "timeline_left_out", { n = timeline.left_out })) end
  end
end

--- The entries of fault buffers, where more is known of them than their numbers.
local function fault_buffers(add, result, lang)
  for _, each in ipairs(buffers.of(result.transactions, targets.new(result.transactions))) do
    add("")
    add(buffers.head(each, lang))
    for _, line in ipairs(aligned(buffers.rows(each, lang))) do add("  " .. line) end
  end
end

local function differ(list, key)
  local first = key(list[1])
  for i = 2, #list do
    if key(list[i]) ~= first then
      return true
    end
  end
  return false
end

--- What the transactions of one capture need to be told apart, and how wide that is.
local function columns_of(transactions, clock, lang)
  local columns = { operation = 0, number = 0, route = 0, since = 0, frame = 0 }
  columns.targets, columns.clock = targets.new(transactions), clock
  columns.controllers = differ(transactions, function(each)
    return each.controller
  end)
  columns.slots = differ(transactions, function(each)
    return each.slot and format("%.0f.%d.%d", each.api or -1, each.slot, each.subslot or -1) or ""
  end)
  for _, each in ipairs(transactions) do
    columns.operation = math.max(columns.operation, words.width(words.operation(lang, each.operation)))
    columns.since = math.max(columns.since, #clock:since(each.start_ns))
    columns.frame = math.max(columns.frame, #integer(all_frames(each.frames)[1] or 0))
    columns.number = math.max(columns.number, #integer(each.id) + 1)
    columns.route = math.max(columns.route, words.length(M.route(each, columns)))
  end
  return columns
end

--- Where a request goes: `192.168.0.2 -> 192.168.0.33 slot 1.1 DO 2`, controller and slot where asked for.
-- @param columns {controllers, slots, targets}
function M.route(item, columns)
  local text = escape(item.device)
  if columns.controllers then
    text = escape(item.controller) .. " -> " .. text
  end
  local place = columns.targets:place(item, columns.slots)
  return place == "" and text or text .. " " .. place
end

local function state_mark(item, lang)
  local parts = { words.state(lang, item.state) }
  if item.state == "refused" then
    for _, key in ipairs({ "write_status", "read_status" }) do
      local status = item[key]
      if status and status ~= 0 then
        parts[#parts + 1] = format("%08X", status)
      end
    end
  end
  return "[" .. concat(parts, " ") .. "]"
end

local function timing(item, lang)
  local text = say(lang, "frames", { n = frame_count(item.frames) })
  if item.duration_ns then
    text = text .. " " .. duration(item.duration_ns)
  end
  local parts = { text }
  if item.cycles then
    parts[2] = say(lang, "cycles", { n = item.cycles })
  end
  for _, kind in ipairs({ { "polls", "polled" }, { "rereads", "read_again" } }) do
    local number = #(item.frames[kind[1]] or {})
    if number > 0 then
      parts[#parts + 1] = say(lang, kind[2], { times = say(lang, "times", { n = number }) })
    end
  end
  return joined(lang, parts)
end

-- The parameters of a transaction.
local function parts_of(item, lang)
  local parts = {}
  for i, each in ipairs(item.parameters) do
    parts[i] = words.parameter(each, item.operation == "change", lang)
  end
  return parts
end

-- Number, time, seconds since the first frame, first frame.
local function front(item, columns)
  local since = columns.clock:since(item.start_ns)
  local frame = integer(all_frames(item.frames)[1] or 0)
  local cells = { pad("#" .. integer(item.id), columns.number), columns.clock:at(item.start_ns) }
  cells[#cells + 1] = (" "):rep(columns.since - #since) .. since
  cells[#cells + 1] = (" "):rep(columns.frame - #frame) .. frame
  return concat(cells, "  ")
end

local function transaction_lines(add, item, columns, lang)
  local operation = words.operation(lang, item.operation)
  local blanks = (" "):rep(columns.operation - words.width(operation))
  local left = front(item, columns) .. "  " .. operation .. blanks
    .. "  " .. pad(M.route(item, columns), columns.route)
  local parts = parts_of(item, lang)
  local tail = (item.state ~= "ok" and state_mark(item, lang) .. "  " or "") .. timing(item, lang)
  local whole = left .. "  " .. (#parts > 0 and concat(parts, "; ") .. "  " or "") .. tail
  local function add_wrapped(text, hanging)
    for _, line in ipairs(words.wrap(text, M.WIDTH, hanging)) do add(line) end
  end
  if words.width(whole) <= M.WIDTH or #parts == 0 then
    return add_wrapped(whole, 6)
  end
  if #parts > 1 then
    left = left .. "  " .. say(lang, "parameters", { n = #parts })
  end
  if words.width(left .. "  " .. tail) <= M.WIDTH then
    add(left .. "  " .. tail)
  else
    add_wrapped(left, 6)
    add_wrapped("      " .. tail, 6)
  end
  for _, part in ipairs(parts) do add_wrapped("      " .. part, 8) end
end

local function transaction_table(add, result, options)
  local transactions = result.transactions
  if #transactions == 0 then
    return
  end
  local witness = plc.witness(result)
  add("")
  add(say(options.lang, "transactions_head"))
  local columns = columns_of(transactions, options.clock, options.lang)
  add("  " .. say(options.lang, options.clock.known and "line_columns" or "line_columns_undated"))
  for _, each in ipairs(transactions) do
    transaction_lines(add, each, columns, options.lang)
    if each.channel == "ds47" and (options.plc or each.state ~= "ok") then
      add("      " .. witness:line(each, options.lang))
    end
  end
end

local function finding_group(add, group, rules, options)
  local lang = options.lang
  local first, frames = group[1], {}
  local rule = rules[first.rule]
  local name = rule and " " .. rule.name or ""
  add("  " .. say(lang, "findings_of_rule", {
    rule = first.rule,
    severity = say(lang, "severity_" .. first.severity),
    name = name,
    findings = say(lang, "findings", { n = #group }),
  }))
  for i, each in ipairs(group) do
    for _, frame in ipairs(grouping.counted(each)) do frames[#frames + 1] = frame end
    if i <= M.FINDINGS_PER_RULE then
      add("    " .. say(lang, "finding_line", {
        frame = say(lang, "frame", { frame = integer(each.frame) }),
        job = each.transaction and options.moment(each.transaction)
          or each.time_ns and " " .. options.clock:moment(each.time_ns) or "",
        message = escape(words.message(each, lang)),
      }))
    end
  end
  if #group > M.FINDINGS_PER_RULE then
    add("    " .. say(lang, "more", { number = integer(#group - M.FINDINGS_PER_RULE) }))
  end
  local filter, left_out = filters.display_filter(frames)
  local note = left_out > 0 and "  " .. say(lang, "frames_more", { n = left_out }) or ""
  options.copied("    " .. filter .. note)
end

local function findings(add, list, rules, options)
  if #list == 0 then
    return
  end
  add("")
  add(say(options.lang, "findings_head"))
  for _, group in ipairs(todo.by_rule(list)) do
    finding_group(add, group, rules, options)
  end
end

--- Percentiles of the times that can be true.
local function latency(transactions, lang)
  local durations = {}
  for _, each in ipairs(transactions) do
    durations[#durations + 1] = each.duration_ns
  end
  local times = M.distribution(durations)
  local note = times.negative > 0 and say(lang, "negative_times", { n = times.negative }) or nil
  if times.timed == 0 then
    return note and noted(lang, say(lang, "latency_unknown"), note)
  end
  return noted(lang, say(lang, "latency", {
    half = duration(times.p50),
    most = duration(times.p95),
    nearly = duration(times.p99),
    longest = duration(times.max),
  }), note)
end

--- How many transactions and findings there are, by state, operation and severity: two lines.
local function summary(result, counts, lang)
  local list = result.transactions
  local jobs = { say(lang, "transactions", { n = #list }) }
  if #list > 0 then
    local states = told_counts(lang, verdict.STATES, counts.states, "state_")
    local operations = told_counts(lang, M.OPERATIONS, counts.operations, "operation_")
    jobs[2] = joined(lang, { states, operations }, "; ", "；")
  end
  local findings_told = { say(lang, "findings", { n = #result.findings }) }
  if #result.findings > 0 then
    findings_told[2] = told_counts(lang, M.SEVERITIES, counts.severities, "severity_")
  end
  return joined(lang, jobs, ": ", "："), joined(lang, findings_told, ": ", "：")
end

-- A function that gives ` #12 12:14:03.412` of a number: a transaction and when it began.
local function moments(result, options)
  local starts = {}
  for _, each in ipairs(result.transactions) do starts[each.id] = each.start_ns end
  return function(number)
    local start = starts[number]
    return " #" .. integer(number) .. (start and " " .. options.clock:moment(start) or "")
  end
end

--- The report of one capture.
-- @param result what Analysis:ended() gives
-- @param options nil or {path = name of the capture (nil where nobody knows it), frames = frames in the file,
--   rules = catalogue, lang = "en" or "zh", plc = true for what the PLC saw of every job, s7 = true for every
--   job of S7, not only those with findings, zone = "local" for times of the zone of this machine, else UTC}
-- @return text, every line ended with LF
function M.report(result, given)
  local options = {}
  for key, value in pairs(given or {}) do options[key] = value end
  local rules = options.rules or tables.rules
  local counts, lines = verdict.counts(result), {}
  function options.copied(line)
    lines[#lines + 1] = line
  end
  local function add(line)
    for _, each in ipairs(words.fitted(line, M.WIDTH)) do options.copied(each) end
  end
  options.clock = clocks.new(result, options.zone)
  options.moment = moments(result, options)
  header(add, result, counts, options)
  opening.lines(options.copied, result, counts, {
    lang = options.lang, rules = rules, clock = options.clock, width = M.WIDTH,
  })
  stations(add, options.copied, result, options.lang)
  relations(add, result.relations or {}, options.lang)
  events(add, result, options)
  fault_buffers(add, result, options.lang)
  transaction_table(add, result, options)
  findings(add, result.findings, rules, options)
  add("")
  add(say(options.lang, "summary_head"))
  local jobs, found = summary(result, counts, options.lang)
  add("  " .. jobs)
  add("  " .. found)
  local times = latency(result.transactions, options.lang)
  if times then
    add("  " .. times)
  end
  add("")
  return concat(lines, "\n")
end

return M
