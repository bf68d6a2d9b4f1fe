-- Looking things up in the protocol tables where that takes more than an index: the words of a row, texts of
-- error numbers, and templates with their names filled in. The tables themselves are tables.lua; a PNIOStatus
-- in words is statuses.lua.

local arrays = require("ds47.support.arrays")
local numbers = require("ds47.support.numbers")
local tables = require("ds47.spec.tables")

local format, gsub = string.format, string.gsub

local M = {}

local filling -- what a template is filled with; here so that no call makes a function

local function first(rows, families)
  for _, family in ipairs(rows and families or {}) do
    if rows[family] then return rows[family] end
  end
  return nil
end

--- What a number is on drives of a family: "sinamics", "micromaster" or, of all others, "profile"; nil where
-- no table says it.
function M.parameter(number, family)
  local families = tables.families[family]
  local found = family ~= "profile" and first(tables.drives[number], families) or nil
  return found or first(tables.parameters[number], families)
end

local function field(name, digits)
  local value = filling[name]
  if value == nil then return nil end
  if digits ~= "" then return format("%0" .. digits .. "X", value) end
  if type(value) == "number" then return numbers.text(value) end
  return value
end

--- A template with its {names} filled in, {name:02X} as hexadecimal digits.
-- @param template string; a name that `args` lacks stays as it is
function M.fill(template, args)
  filling = args
  return (gsub(template, "{([%w_]+):?0?(%d*)X?}", field))
end

--- An error number as people write it: `0x11`, and above one byte `0x0811`.
function M.error_hex(code) return format(code <= 0xFF and "0x%02X" or "0x%04X", code) end

--- The words of a row, in "en" or "zh".
function M.words(row, lang) return lang == "zh" and row.zh or row.en end

local function words(entry, code, lang)
  return M.fill(M.words(entry, lang), {code = M.error_hex(code), above = code - (entry.code or code)})
end

--- The words for a number of which nobody knows more than that it is the maker's.
-- @param code as text
function M.error_fallback(code, lang) return M.fill(M.words(tables.error_fallback, lang), {code = code}) end

--- A maker by its id: `Yaskawa`, or `the device` where nobody knows whose the id is.
function M.called(vendor_id, lang)
  return tables.vendor_names[vendor_id] or M.words(tables.error_no_maker, lang)
end

local function with_maker(template, code, vendor_id, lang)
  local id, maker = format("0x%04X", vendor_id), M.called(vendor_id, lang)
  return M.fill(M.words(template, lang), {code = code, maker = maker, vendor = id})
end

--- What follows a number of a maker without a table: whose manual has it.
function M.of_maker(vendor_id, lang) return with_maker(tables.error_of_maker, nil, vendor_id, lang) end

--- The advice to look such a number up, and where.
function M.manual_of(code, vendor_id, lang)
  return with_maker(tables.error_in_manual, M.error_hex(code), vendor_id, lang)
end

--- The maker with this PROFINET vendor id; nil where it has no table of its own.
function M.vendor(vendor_id)
  return vendor_id and arrays.first(tables.vendors, function(each)
    return each.id == vendor_id or arrays.has(each.ids or {}, vendor_id)
  end)
end

--- Whether a number is one of a maker without a table: its manual says what it means.
function M.in_manual(code, vendor_id)
  local makers, vendor = tables.error_makers, M.vendor(vendor_id)
  return vendor_id ~= nil and vendor_id > 0 and code >= makers.first and code <= makers.last
    and not (vendor and next(vendor.errors))
end

--- What an error number means, in words (docs/protocol.md B).
-- @param code error value 1, 0..0xFFFF
-- @param lang "en" or "zh"; anything else gives English
-- @param vendor_id PROFINET vendor id of the device or nil. Numbers from 0x65 on belong to the vendor:
--   without an id the meaning on SINAMICS is given as such, and a vendor without a table gets no meaning
function M.error_text(code, lang, vendor_id)
  local vendor = M.vendor(vendor_id)
  if vendor and vendor.errors[code] then return words(vendor.errors[code], code, lang) end
  if tables.errors[code] then return words(tables.errors[code], code, lang) end
  local text = M.error_fallback(M.error_hex(code), lang)
  local usual = tables.vendors[1]
  if M.in_manual(code, vendor_id) then return text .. M.of_maker(vendor_id, lang) end
  local hint = not vendor_id and usual.errors[code]
  if not hint then return text end
  return text .. " (" .. usual.name .. ": " .. words(hint, code, lang) .. ")"
end

--- What an error number of a vendor means, in words.
-- @param vendor a row of tables.vendors that has the number
function M.vendor_text(vendor, code, lang) return words(vendor.errors[code], code, lang) end

--- What error value 2 means for an error number: "none", "subindex" or "unknown".
function M.error_info_meaning(code)
  local entry = tables.errors[code]
  return entry and entry.info or "unknown"
end

return M
