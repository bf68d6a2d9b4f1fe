-- The words of the tables of cyclic frames, PKW and PZD, in "en" or "zh" (docs/cyclic.md). The tables
-- themselves are tables.lua; what the bytes are is in cyclic/.

local arrays = require("ds47.support.arrays")
local lookup = require("ds47.spec.lookup")
local tables = require("ds47.spec.tables")

local concat, format, words = table.concat, string.format, lookup.words

local M = {}

--- What the AK of a request or of an answer says.
function M.meaning(ak, answer, lang)
  return words(tables.pkw[answer and "answers" or "requests"][ak], lang)
end

--- What an error number of PKW means (docs/cyclic.md 2); nil where nobody says.
-- @param vendor_id PROFINET vendor id of the device or nil. Its maker's table goes before the profile's, and
--   numbers behind those of the profile belong to the maker
function M.error_text(code, lang, vendor_id)
  if code == nil then return nil end
  local maker = lookup.vendor(vendor_id)
  if maker and maker.pkw and maker.pkw[code] then return words(maker.pkw[code], lang) end
  if code <= tables.pkw.profile_errors or vendor_id == tables.vendors[1].id then
    local row = tables.pkw.errors[code]
    if row or not tables.pkw.codes[code] then return row and words(row, lang) end
  end
  local text = lookup.error_fallback(format("%d", code), lang)
  return vendor_id and text .. lookup.of_maker(vendor_id, lang) or text
end

local function row_of(id)
  if id == tables.pzd.stopping.id then return tables.pzd.stopping end
  return arrays.first(tables.pzd.states, function(row) return row.id == id end)
end

--- `S2 ready to switch on, fault`, in "en" or "zh".
function M.state_text(id, overlays, lang)
  local own = words(row_of(id), lang)
  local parts = {id:sub(1, 1) == "S" and id .. " " .. own or own}
  for _, each in ipairs(tables.pzd.overlays) do
    if arrays.has(overlays, each.id) then parts[#parts + 1] = words(each, lang) end
  end
  return concat(parts, lang == "zh" and "，" or ", ")
end

--- An event of a drive, in "en" or "zh".
function M.event_text(id, lang) return words(tables.pzd.events[id], lang) end

return M
