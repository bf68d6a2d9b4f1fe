-- S7 communication in words: its connections as a table, what servers say of themselves, the items of a job
-- (Python: ds47.report.s7). What is wrong there are findings like all others (docs/s7.md).

local s7 = require("ds47.spec.s7")
local words = require("ds47.report.formatting")

local concat, format, insert = table.concat, string.format, table.insert
local duration, escape, grouped, integer = words.duration, words.escape, words.grouped, words.integer
local joined, say = words.joined, words.say

local M = {}

local COLUMNS = {
  "connection", "tsaps", "pdu", "jobs", "refused", "unanswered", "read", "written", "sent", "answer", "also",
}
local ALSO = {
  {"s7_orphans", "orphans"}, {"s7_cyclic", "cyclic"}, {"s7_other", "other"}, {"s7_plus", "plus"},
  {"s7_lost", "lost_bytes"},
}
local BYTES_SHOWN = 16 -- a longer value is cut, and its length stated
local OK = 0xFF

-- Bytes as hexadecimal digits, `between` them.
local function hex(data, between)
  local digits = {}
  for at = 1, #data do digits[at] = format("%02X", data:byte(at)) end
  return concat(digits, between)
end

--- A TSAP: `01.00`, or its text where it is one.
function M.tsap(data)
  if not data or data == "" then return "?" end
  return #data > 2 and not data:find("[^ -~]") and data or hex(data, ".")
end

-- Both TSAPs, who owns the connection, and the place of the CPU; nothing where they were not seen.
local function tsaps(item, lang)
  if not item.client_tsap and not item.server_tsap then return "" end
  local told, about = M.tsap(item.client_tsap) .. " -> " .. M.tsap(item.server_tsap), {}
  local owner = s7.owner(item.server_tsap)
  if owner then insert(about, say(lang, "s7_owner_" .. owner)) end
  if item.rack then
    insert(about, say(lang, "s7_place", {rack = integer(item.rack), slot = integer(item.slot)}))
  end
  return about[1] and told .. " " .. joined(lang, about) or told
end

local function also(item, lang)
  local told = {}
  for _, each in ipairs(ALSO) do
    if item[each[2]] > 0 then insert(told, say(lang, each[1], {n = item[each[2]]})) end
  end
  return joined(lang, told)
end

local function row_of(item, lang)
  local parallel = item.parallel and " x" .. integer(item.parallel) or ""
  local answer = item.answer
  return {
    format("%s:%d -> %s:%d", escape(item.client), item.client_port, escape(item.server), item.server_port),
    tsaps(item, lang), item.pdu_length and integer(item.pdu_length) .. parallel or "",
    grouped(item.jobs), grouped(item.refused), grouped(item.unanswered), grouped(item.read_bytes),
    grouped(item.written_bytes), grouped(item.sent_bytes),
    answer and duration(answer.mean) .. " (" .. duration(answer.most) .. ")" or "", also(item, lang),
  }
end

--- The names of the columns, and a row for each connection, `most` of them at the most.
function M.rows(connections, most, lang)
  local found = {{}}
  for place, name in ipairs(COLUMNS) do found[1][place] = say(lang, "s7_" .. name) end
  for number = 1, math.min(#connections, most) do found[number + 1] = row_of(connections[number], lang) end
  return found
end

--- What servers say of themselves, each thing once for a server: array of lines.
function M.evidence(connections, lang)
  local seen, found = {}, {}
  for _, connection in ipairs(connections) do
    for _, each in ipairs(connection.evidence) do
      local value = type(each.value) == "number" and integer(each.value) or each.value
      local key = concat({connection.server, each.name, value}, " ")
      if not seen[key] then
        seen[key] = true
        insert(found, say(lang, "s7_" .. each.name, {
          server = escape(connection.server), frame = integer(each.frame), value = escape(value),
        }))
      end
    end
  end
  return found
end

--- Whether variables are read or written of a server of which nobody says how many bytes it copies at once.
function M.blocks_missing(connections)
  for _, each in ipairs(connections) do
    if not each.block and each.read_bytes + each.written_bytes > 0 then return true end
  end
  return false
end

--- Whether a transaction of S7 stands in a list: one with findings, or that did not go well; or `every` one.
function M.is_listed(item, every)
  return every or #(item.findings or {}) > 0 or item.state ~= "ok"
end

-- `0x05 address out of range`.
local function failure(code, lang)
  return format("0x%02X %s", code, s7.code_text("return_code", code, lang))
end

--- Bytes, cut where they are many: `00 01 02 ... (444 bytes)`.
function M.value(data, lang)
  local shown = hex(data:sub(1, BYTES_SHOWN), " ")
  if #data <= BYTES_SHOWN then return shown end
  return shown .. " ... (" .. say(lang, "s7_length", {n = #data}) .. ")"
end

local function part_of(item, job, lang)
  local name = item.address or job.r_id and format("R_ID %08X", job.r_id) or "?"
  local failed = item.code and item.code ~= OK and " " .. failure(item.code, lang) or ""
  if not item.value then return escape(name) .. failed end
  local mark = job.operation == "get" and " = " or " := "
  return escape(name) .. mark .. M.value(item.value, lang) .. failed
end

--- What a job is about, an entry for each item: `DB1.DBB0..3 = 00 00 00 07`, `R_ID 00000009 := ...`.
function M.parts(item, lang)
  local told = {}
  for number, each in ipairs(item.items) do told[number] = part_of(each, item, lang) end
  if #item.segments > 0 then
    told[1] = (told[1] or "") .. " (" .. say(lang, "s7_segments", {n = #item.segments}) .. ")"
  end
  return told
end

--- Error class and code of an answer in words; nil where there is none.
function M.error(item, lang)
  return (item.error or 0) ~= 0 and s7.error_text(item.error, lang) or nil
end

return M
