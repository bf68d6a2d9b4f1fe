-- The words of the tables of PROFIBUS DP in "en" or "zh" (docs/profibus.md). The tables themselves are
-- tables.lua; what the bytes are is in profibus/.

local lookup = require("ds47.spec.lookup")
local tables = require("ds47.spec.tables")

local fill, words = lookup.fill, lookup.words
local floor = math.floor

local M = {}

local function word(key, lang, args) return fill(words(tables.profibus.words[key], lang), args or {}) end

--- What is wrong with a frame.
-- @param flaw {kind, offset, args}, as profibus/telegram.lua has it
function M.flaw_text(flaw, lang) return fill(words(tables.profibus.flaws[flaw.kind], lang), flaw.args) end

function M.service_text(id, lang) return words(tables.profibus.services[id], lang) end

--- What a function code says: `SRD high, FCB 1`, `OK, slave`.
function M.control_text(fc, lang)
  local requested, code, middle = floor(fc / 0x40) % 2 == 1, fc % 0x10, floor(fc / 0x10) % 4
  local row = tables.profibus[requested and "request" or "answer"][code]
  local own = row and words(row, lang) or word("unknown", lang, {code = code})
  local beside
  if not requested then
    beside = words(tables.profibus.station[middle], lang)
  elseif middle == 2 then
    beside = word("fcb_first", lang)
  elseif middle ~= 0 then
    beside = word("fcb", lang, {bit = middle == 3 and 1 or 0})
  end
  return beside and own .. word("separator", lang) .. beside or own
end

--- What the first byte of MS1 says: `DS_Read`, `DS_Read positive`, `DS_Read negative`.
function M.function_text(code, request, lang)
  local refused = not request and tables.profibus.refusals[code]
  local row = refused or tables.profibus.functions[code]
  if not row then return word("unknown", lang, {code = code}) end
  if request or not row.negative then return words(row, lang) end
  return words(row, lang) .. " " .. word(refused and "negative" or "positive", lang)
end

return M
