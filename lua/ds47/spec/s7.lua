-- The words of the tables of S7 in "en" or "zh", what a PDU has room for, and what a TSAP says (docs/s7.md).
-- The tables themselves are tables.lua; what the bytes are is in s7/.

local fill = require("ds47.spec.lookup").fill
local tables = require("ds47.spec.tables")

local floor = math.floor

local M = {}

local function words(row, lang)
  return lang == "zh" and row.zh or row.en
end

--- What is wrong with bytes.
-- @param flaw {kind, offset, args}, as s7/pdu.lua has it
function M.flaw_text(flaw, lang)
  return fill(words(tables.s7.flaws[flaw.kind], lang), flaw.args)
end

--- What a code of a table ("functions", "return_code", "error_class", "group" ...) means, an unknown one too.
function M.code_text(name, code, lang)
  local row = tables.s7[name][code]
  return row and words(row, lang) or fill(words(tables.s7.words.unknown, lang), {code = code})
end

--- What an error word means: the whole of it, else its class.
function M.error_meaning(error, lang)
  local whole = tables.s7.error[error]
  return whole and words(whole, lang) or M.code_text("error_class", floor(error / 0x100), lang)
end

--- The same with the word.
function M.error_text(error, lang)
  return fill(words(tables.s7.words.error, lang), {text = M.error_meaning(error, lang), code = error})
end

--- Bytes of user data that a PDU of this length holds.
-- @param use  "get", "put", "usend", "bsend_first" or "bsend"
-- @param items  nil for one
function M.room(use, pdu_length, items)
  local row = tables.s7.rooms[use]
  return pdu_length - row.fixed - (items or 1) * row.each
end

--- The kind of CPU with an order number, a row of tables.s7.cpus; nil where it is none, or not known.
function M.cpu_of_order(number)
  number = number:upper():gsub("%s+", " "):match("^ ?(.-) ?$")
  for _, row in ipairs(tables.s7.orders) do
    local fits = #number >= #row.number
    for at = 1, fits and #row.number or 0 do
      local want = row.number:sub(at, at)
      fits = fits and (want == "?" or want == number:sub(at, at))
    end
    if fits then return tables.s7.cpus[row.cpu] end
  end
  return nil
end

local function first_of(tsap)
  return tsap and #tsap == 2 and tsap:byte() > 0 and tsap:byte() or nil
end

--- Who owns a connection by a TSAP of two bytes: an id of tables.s7.tsap; nil where it does not tell.
function M.owner(tsap)
  local first = first_of(tsap)
  if not first then return nil end
  for code, row in pairs(tables.s7.tsap) do
    if code <= first and first <= (row.last or code) then return row.id end
  end
  return nil
end

--- Rack and slot in the TSAP of a server; nil where it does not have them.
function M.place(tsap)
  if not first_of(tsap) then return nil end
  local second = tsap:byte(2)
  return floor(second / 0x20), second % 0x20
end

return M
