-- The words of the tables of cyclic frames, PKW and PZD, in "en" or "zh" (docs/cyclic.md). The tables
-- themselves are tables.lua; what the bytes are is in cyclic/.

local words = require("ds47.spec.lookup").words
local tables = require("ds47.spec.tables")

local concat = table.concat

local M = {}

--- What the AK of a request or of an answer says.
function M.meaning(ak, answer, lang)
  return words(tables.pkw[answer and "answers" or "requests"][ak], lang)
end

--- What an error number of PKW means; nil where nobody says.
function M.error_text(code, lang)
  local row = code and tables.pkw.errors[code]
  return row and words(row, lang)
end

local function among(items, wanted)
  for _, item in ipairs(items) do
    if item == wanted then return true end
  end
  return false
end

local function row_of(id)
  if id == tables.pzd.stopping.id then return tables.pzd.stopping end
  for _, row in ipairs(tables.pzd.states) do
    if row.id == id then return row end
  end
  return nil
end

--- `S2 ready to switch on, fault`, in "en" or "zh".
function M.state_text(id, overlays, lang)
  local own = words(row_of(id), lang)
  local parts = {id:sub(1, 1) == "S" and id .. " " .. own or own}
  for _, each in ipairs(tables.pzd.overlays) do
    if among(overlays, each.id) then parts[#parts + 1] = words(each, lang) end
  end
  return concat(parts, lang == "zh" and "，" or ", ")
end

--- An event of a drive, in "en" or "zh".
function M.event_text(id, lang)
  return words(tables.pzd.events[id], lang)
end

return M
