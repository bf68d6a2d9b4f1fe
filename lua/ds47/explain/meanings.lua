-- What a status or an error number means: causes, what the PLC shows, what to look for.
--
-- The same as python/ds47/explain/meanings.py has it, of these two kinds of codes: those that a frame has.
-- How it is laid out is in ds47.report.explanation. The words are in tables.explain.

local arrays = require("ds47.support.arrays")
local spec = require("ds47.spec.lookup")
local statuses = require("ds47.spec.statuses")
local tables = require("ds47.spec.tables")

local format, gsub, upper = string.format, string.gsub, string.upper
local fill, four, has = spec.fill, statuses.four, arrays.has

local M = {}

local ACCESS, PROTOCOL = 0x80, 0x81
local READ, WRITE = 0xDE, 0xDF
local NOBODY = -1 -- no vendor's id: the text of the profile, or that of any maker's number
-- First bytes of a status that no PDU has: the PLC made it up.
local OF_PLC = {[0x00] = true, [0x40] = true, [0xC0] = true}

local function in_language(row, lang, name) return row[(name or "") .. (lang == "zh" and "zh" or "en")] end

local function words_in(lang) return in_language(tables.explain.words, lang) end

-- What is said about a status

-- Whether a row says nothing about a byte, or names it, or a range that holds it.
local function within(first, last, value)
  return first == nil or first <= value and value <= (last or first)
end

local function fits(row, decode, code_1, code_2)
  return within(row.decode, row.decode_to, decode) and within(row.code1, row.to, code_1)
    and within(row.code2, nil, code_2)
end

local function entry_of(status)
  local code, decode, code_1, code_2 = four(status)
  return arrays.first(tables.explain.statuses, function(row)
    return has(row.services, code) and fits(row, decode, code_1, code_2)
  end) or arrays.first(tables.explain.of_plc, function(row)
    return row.first == code and fits(row, decode, code_1, code_2)
  end)
end

-- The view or filter for a refused Read or Write: `refused` -> `read_refused`.
local function sided(name, status)
  local code = four(status)
  local side = code == READ and "read" or code == WRITE and "write" or nil
  if side and name == "refused" then return side .. "_refused" end
  if side and name == "status" then return "status_" .. side end
  return name
end

local function name_of(column, value, lang)
  local row = tables.status[column][value]
  return row and in_language(row, lang)
end

local function headline(entry, status, lang)
  local code, decode, code_1, code_2 = four(status)
  local service = name_of("error_code", code, lang) or ""
  local inputs, number = tables.explain.inputs, decode % 16
  return fill(in_language(entry, lang), {
    service = gsub(service, "^%l", upper),
    name = name_of(decode == ACCESS and "access" or "protocol", code_1, lang) or format("0x%02X", code_1),
    code2 = format("0x%02X", code_2), n = format("%d", number),
    parameter = inputs.names[number] or in_language(inputs, lang, "unknown_"),
  })
end

-- The four bytes; what the middle two say depends on who made the status.
local function parts_of(status, lang)
  if status == 0 then return {} end
  local code, decode, code_1, code_2 = four(status)
  local words = words_in(lang)
  local column = decode == ACCESS and "access" or decode == PROTOCOL and "protocol" or nil
  local of_plc = OF_PLC[code]
  local function part(value, name, text)
    return {value = format("%02X", value), name = name, text = of_plc and "" or text or words.unknown_part}
  end
  return {
    {value = format("%02X", code), name = "ErrorCode",
     text = of_plc and words.plc_itself or name_of("error_code", code, lang) or words.unknown_part},
    part(decode, "ErrorDecode", name_of("error_decode", decode, lang)),
    part(code_1, "ErrorCode1", column and name_of(column, code_1, lang)),
    {value = format("%02X", code_2), name = "ErrorCode2", text = code_2 ~= 0 and words.second or ""},
  }
end

local function status_values(status)
  local code, decode, code_1, code_2 = four(status)
  return {
    code = format("0x%02x", code), decode = format("0x%02x", decode), code1 = format("0x%02x", code_1),
    code2 = format("0x%02x", code_2), value = format("0x%08x", status),
  }
end

-- Putting an answer together

local function blocks(view, shown, lang)
  local found = {}
  for number, row in ipairs(tables.explain.plc[view]) do
    local done = row.done
    if row.valid ~= nil then done = row.valid end
    found[number] = {
      block = row.block or "", done = done, busy = row.busy, error = row.error,
      status = row.status == "" and shown or row.status, note = in_language(row, lang),
    }
  end
  return found
end

local function causes_of(entry, lang)
  return arrays.mapped(entry.cause, function(row)
    return {text = in_language(row, lang), basis = row.basis}
  end)
end

-- A meaning: {title, known, parts, plc, causes, look, filter, plugin_filter}.
local function meaning(title, known, entry, lang, more)
  local templates = tables.explain.filters[more.filter]
  return {
    title = title, known = known, parts = more.parts, rank = more.rank, name = more.name,
    plc = blocks(more.view, more.shown or "", lang), causes = causes_of(entry, lang),
    look = in_language(entry, lang, "look_"),
    filter = templates.wireshark and fill(templates.wireshark, more.values),
    plugin_filter = templates.plugin and fill(templates.plugin, more.values),
  }
end

-- A status that has a meaning as `template` tells of it, in which `given` is what was asked; nil where it has
-- none.
local function known_status(status, template, given, lang)
  local entry, code = entry_of(status), statuses.status_hex(status)
  if not entry then return nil end
  local title = fill(template, {given = given, code = code, text = headline(entry, status, lang)})
  return meaning(title, true, entry, lang, {
    parts = parts_of(status, lang), view = sided(entry.plc, status), shown = code,
    filter = sided(entry.filter, status), values = status_values(status),
  })
end

-- The status whose first three bytes these are behind a byte in front; nil where none begins so.
local function read_too_early(status)
  local late = status % 16777216 * 256
  local code = four(late)
  return (tables.status.error_code[code] or code ~= 0 and OF_PLC[code]) and late or nil
end

--- What a status of four bytes means.
-- @param status 32 bits, ErrorCode in the highest byte
-- @param lang "en" or "zh"; anything else gives English
-- @return a meaning; `known` is false where only its bytes have one
function M.status(status, lang)
  local words, code, late = words_in(lang), statuses.status_hex(status), read_too_early(status)
  local code_1, code_2, code_3, code_4 = four(status)
  local turned = ((code_4 * 256 + code_3) * 256 + code_2) * 256 + code_1
  local known = known_status(status, words.status, code, lang)
    or known_status(turned, words.bytes_reversed, code, lang)
    or late and known_status(late, words.bytes_shifted, code, lang)
  if known then return known end
  local text = format("%s (%s)", words.unknown_status, statuses.status_text(status, lang))
  return meaning(fill(words.status, {code = code, text = text}), false, tables.explain.unknown, lang, {
    parts = parts_of(status, lang), view = "unknown", shown = code, filter = "status",
    values = status_values(status),
  })
end

-- Error numbers

local function in_ranges(ranges, code)
  return arrays.any(ranges or {}, function(range) return range[1] <= code and code <= range[2] end)
end

-- What is said about an error number, of the profile or of the named vendor.
local function entry_of_error(code, vendor)
  for _, row in ipairs(tables.explain.errors) do
    local general = row.vendor == nil and row.codes == nil and row.ranges == nil
    if general then return row end
    if row.vendor == vendor then
      local everything = row.codes == nil and (row.ranges == nil or #row.ranges == 0)
      if everything or has(row.codes or {}, code) or in_ranges(row.ranges, code) then return row end
    end
  end
  return nil
end

-- Where to look: in the manual of the maker, where nothing better is said of its number.
local function look_of(found, entry, name, vendor_id, lang)
  if vendor_id and entry.vendor == nil and entry.codes == nil and entry.ranges == nil then
    local words = words_in(lang)
    local values = {maker = spec.called(vendor_id, lang), vendor = format("0x%04X", vendor_id)}
    found.look = fill(words.look_in_manual, {code = name, maker = fill(words.maker_with_id, values)})
  end
  return found
end

local function of_vendor(code, text, vendor, lang, vendor_id)
  local words, ranks, name = words_in(lang), tables.explain.ranks, spec.error_hex(code)
  local entry, alone = entry_of_error(code, vendor), tables.explain.error_word .. " " .. name
  local parts, known, title, rank = {}, not entry.reserved, words.vendor_error, ranks.error
  if vendor then
    alone = alone .. " --vendor " .. vendor
    rank = in_ranges(tables.explain.ranges[vendor], code) and ranks.vendor_range or ranks.vendor_error
  else
    parts[1] = {value = "", name = "", text = words["info_" .. spec.error_info_meaning(code)]}
    title, known = words.error, known and tables.errors[code] ~= nil
  end
  local values = {code = name, decimal = format("%d", code), text = text, vendor = vendor}
  return look_of(meaning(fill(title, values), known, entry, lang, {
    parts = parts, view = "in_response", filter = "error", values = {value = name:lower()}, rank = rank,
    name = alone,
  }), entry, name, vendor_id, lang)
end

-- The vendors whose number it is: of the one with an id, or all that have it.
local function makers(code, vendor_id)
  return arrays.filtered(tables.vendors, function(vendor)
    return vendor.errors[code] and (vendor_id == nil or spec.vendor(vendor_id) == vendor)
  end)
end

--- What an error number means: of the profile, and of the vendors that have one of their own.
-- @param lang "en" or "zh"; anything else gives English
-- @param vendor_id PROFINET vendor id of the device, nil where nobody knows it
-- @return array of meanings, the likeliest first
function M.error(code, lang, vendor_id)
  local found, own = {}, makers(code, vendor_id)
  local general = tables.errors[code] and not (vendor_id and own[1]) or not tables.errors[code] and not own[1]
  if general then found[1] = of_vendor(code, spec.error_text(code, lang, NOBODY), nil, lang, vendor_id) end
  for _, vendor in ipairs(own) do
    found[#found + 1] = of_vendor(code, spec.vendor_text(vendor, code, lang), vendor.name, lang, vendor.id)
  end
  local order = {}
  for number, each in ipairs(found) do order[each] = number end
  table.sort(found, function(one, other)
    if one.known ~= other.known then return one.known end
    if one.rank ~= other.rank then return one.rank < other.rank end
    return order[one] < order[other]
  end)
  return found
end

return M
