--- Words of the reports: numbers, values and addresses as a person reads them (Python: ds47.report.words).
-- Also the little of UTF-8 that fixed-width text needs. No layout here, no file is opened.

local naming = require("ds47.profidrive.naming")
local tables = require("ds47.spec.tables")
local descriptions = require("ds47.report.descriptions")
local meanings = require("ds47.report.values")
local formats = require("ds47.profidrive.formats")
local sentences = require("ds47.report.sentences")

local M = {}

local format, find, gsub = string.format, string.find, string.gsub
local concat = table.concat

local MICROMASTER = "micromaster"

M.VALUES_SHOWN = 8 -- a longer list of values is cut, and its length stated
M.CHARACTER = "[\0-\127\192-\255][\128-\191]*" -- one UTF-8 character, as a pattern

local HIDDEN, WIDE = tables.characters.hidden, tables.characters.wide -- first and last code points
-- Of characters of one byte to four: the least and the greatest first byte, and the lowest bit in it that is
-- no part of the code point.
local LEADS = { { 0, 0x7F, 0x80 }, { 0xC2, 0xDF, 0x20 }, { 0xE0, 0xEF, 0x10 }, { 0xF0, 0xF4, 0x08 } }
local SHORT_ESCAPES = { [9] = "\\t", [10] = "\\n", [13] = "\\r" }

local function within(ranges, point)
  for i = 1, #ranges, 2 do
    if point < ranges[i] then return false end
    if point <= ranges[i + 1] then return true end
  end
  return false
end

--- The code point of one UTF-8 character, nil where the bytes are none.
local function code_point(character)
  local first, lead = character:byte(), LEADS[#character]
  if not lead or first < lead[1] or first > lead[2] then return nil end
  local point = first % lead[3]
  for i = 2, #character do point = point * 64 + character:byte(i) - 0x80 end
  return point
end

local function escape_character(character)
  local point = code_point(character)
  if not point then
    return (gsub(character, ".", function(byte) return format("\\x%02x", byte:byte()) end))
  elseif not within(HIDDEN, point) then
    return character
  elseif SHORT_ESCAPES[point] then
    return SHORT_ESCAPES[point]
  end
  return format(point < 0x100 and "\\x%02x" or point < 0x10000 and "\\u%04x" or "\\U%08x", point)
end

--- The text with everything a terminal might obey, or nobody could see, as an escape.
function M.escape(text)
  if not find(text, "[^ -~]") then return text end
  return (gsub(gsub(text, "^[\128-\191]+", ""), M.CHARACTER, escape_character))
end

--- Columns that a UTF-8 text takes in a fixed-width font; a Chinese character takes two.
function M.width(text)
  local columns = #text
  if find(text, "[\128-\255]") then
    columns = 0
    for character in text:gmatch(M.CHARACTER) do
      local point = #character > 1 and code_point(character) or 0
      columns = columns + (within(WIDE, point) and 2 or 1)
    end
  end
  return columns
end

--- A whole number without a decimal point in every Lua version.
-- ("%d" of Lua 5.2 holds only 32 bits on Windows.)
function M.integer(number) return format("%.0f", number) end

--- A whole number in groups of three digits: `12,000`.
function M.grouped(number)
  local digits, cut = M.integer(number), 1
  while cut > 0 do digits, cut = gsub(digits, "^(-?%d+)(%d%d%d)", "%1,%2") end
  return digits
end

--- A text of tables.report_words in "en" or "zh" with its values filled in; `n` also chooses between
-- `one|several`.
function M.say(lang, key, values)
  local known = tables.report_words[key]
  local text = lang == "zh" and known.zh or known.en
  if values == nil then return text end
  local one, several = text:match("^(.*)|(.*)$")
  if one then text = tonumber(values.n) == 1 and one or several end
  return (gsub(text, "{([%w_]+)}", function(name)
    local value = values[name]
    return type(value) == "number" and M.grouped(value) or tostring(value)
  end))
end

--- The name of a state of a transaction: one and the same in every report.
function M.state(lang, word) return M.say(lang, "state_" .. word) end

--- Texts in a row, with the commas of their language where no separators are given.
function M.joined(lang, parts, en, zh) return concat(parts, lang == "zh" and (zh or "，") or en or ", ") end

--- `p50303[0]`, `p2902[2..5]`, `p944[0].text`; `p?` where no request names it.
function M.address(item)
  if not item.pnu then return "p?" end
  local first, elements, index = item.subindex, item.element_count or 0, ""
  if first and elements > 1 then
    index = format("[%d..%d]", first, first + elements - 1)
  elseif first then
    index = format("[%d]", first)
  end
  local attribute = item.attribute and item.attribute ~= "value" and "." .. item.attribute or ""
  return naming.spelling(item.pnu, item.family) .. index .. attribute
end

--- Whether a value that is a string is text from the drive (docs/protocol.md A.6).
-- In the other formats it is a number that JSON cannot hold (NaN, 64 bits) or hex digits.
function M.is_text(format_name)
  return format_name == nil
    or find(format_name, "^VisibleString") ~= nil
    or find(format_name, "^Unicode") ~= nil
    or find(format_name, "^UNICODE") ~= nil
end

--- A number as Python shows it.
M.number = formats.number_text

function M.quoted(text) return '"' .. gsub(M.escape(text), '"', '\\"') .. '"' end

--- One value; text from the drive in quotes.
function M.value(item, format_name, scaled)
  if type(item) ~= "string" then return M.number(item, format_name, scaled) end
  return M.is_text(format_name) and M.quoted(item) or M.escape(item)
end

--- A list of values, cut where it grows long: `1, 2, 3, ... (40 values)`.
-- @param lang "zh" for Chinese words, else English
-- @param stated nil, or how many there are: more where the end of the record is missing
function M.values(items, format_name, scaled, lang, stated)
  stated = stated or #items
  if stated == 1 and items[1] ~= nil then return M.value(items[1], format_name, scaled) end
  local shown = {}
  for i = 1, math.min(#items, M.VALUES_SHOWN) do shown[i] = M.value(items[i], format_name, scaled) end
  local text = concat(shown, ", ")
  local short = stated > math.min(#items, M.VALUES_SHOWN)
  return short and M.say(lang, "values_cut", { values = text, n = stated }) or text
end

M.stated = descriptions.stated

--- `error 0x11: request cannot be executed (info 3)`; `lang` as in `values`.
function M.error(item, lang)
  local text = M.say(lang, "parameter_error") .. (item.code and " " .. sentences.error_number(item) or "")
  local told = sentences.error_words(item, lang)
  if told ~= "" then text = M.joined(lang, { text, told }, ": ", "：") end
  if not item.info or item.info == 0 then return text end
  local info = M.say(lang, "parameter_error_info", { info = M.integer(item.info) })
  return M.joined(lang, { text, info }, " ", "")
end

--- The values of a parameter with its unit: `10.0 s`, `5461 (33.33 %)`. `lang` as in `values`.
function M.with_unit(item, lang)
  local unit = item.unit and " " .. M.escape(item.unit) or ""
  if item.scaled and #item.scaled > 0 then
    unit = " (" .. M.values(item.scaled, item.format, true, lang) .. unit .. ")"
  end
  -- `shown`: an only value that was written out before
  return (item.shown or M.values(item.values, item.format, false, lang, M.stated(item))) .. unit
end

--- `Maximum speed`; as the drive calls it in quotes, `"Max_frequency"`; nil where it has no name.
function M.name(item, lang)
  local name = sentences.name(item, lang)
  if name and item.described and item.described.name then -- of the drive, or of a list of the user
    return item.described.frames and M.quoted(name) or M.escape(name)
  end
  return name
end

--- Whose parameter it is, where the vendor does not say it: "micromaster", else nil.
function M.family(item) return item.family == MICROMASTER and item.family or nil end

--- What the values of a parameter mean; nil where they say it themselves.
function M.meaning(item, lang)
  local parts = meanings.parts(item, M, lang)
  return parts and M.joined(lang, parts) or nil
end

--- A parameter with what is known of it: `p50303[0] = 10.0`, with `:=` if it was written.
-- `lang` as in `values`.
function M.parameter(item, written, lang)
  local known, name = item.words, M.name(item, lang) -- the Info column (info.lua) has the address, too
  local text = known and known.address or M.address(item)
  if name then text = text .. " (" .. name .. ")" end
  local described = descriptions.is_about(item.attribute) and item.values
    and descriptions.parts(item, M, lang)
  if described then
    text = text .. (written and " := " or " = ") .. M.joined(lang, described)
  elseif item.values and #item.values > 0 then
    local told, meant = M.with_unit(item, lang), M.meaning(item, lang)
    if meant then told = M.say(lang, "parameter_meant", { value = told, text = meant }) end
    text = text .. (written and " := " or " = ") .. told
  end
  return item.error and text .. " " .. M.error(item.error, lang) or text
end

--- The message of a finding; where it is about a byte of a message, with its offset in front.
function M.message(finding, lang)
  local offset = finding.offset and M.integer(finding.offset)
  local text = sentences.sentence(finding, lang)
  return offset and M.say(lang, "finding_offset", { offset = offset, message = text }) or text
end

-- Lines of a terminal

local STAYS = {} -- characters that do not begin a line
for character in ("，。；：、）”"):gmatch(M.CHARACTER) do STAYS[character] = true end

-- The text in pieces that stay whole: a word with the blanks behind it, or a wide character.
local function pieces(text)
  local characters, found, piece = {}, {}, ""
  if not find(text, "[\128-\255]") then
    found[1] = text:match("^ +")
    for word in text:gmatch("[^ ]+ *") do found[#found + 1] = word end
    if not find(text, "[^ ]$") then found[#found + 1] = "" end
    return found
  end
  for character in text:gmatch(M.CHARACTER) do characters[#characters + 1] = character end
  for place, character in ipairs(characters) do
    local following = characters[place + 1] or ""
    piece = piece .. character
    local blank = character == " " and following ~= " "
    local wide = M.width(character) == 2 or M.width(following) == 2
    if blank or (wide and not STAYS[following]) then
      found[#found + 1] = piece
      piece = ""
    end
  end
  found[#found + 1] = piece
  return found
end

--- The text without blanks at its end.
function M.stripped(text) return (gsub(text, " +$", "")) end

--- Lines of at most so many columns, all but the first behind `hanging` blanks (Python: ds47.report.wrap).
function M.wrap(text, width, hanging)
  local lines, line = {}, ""
  for _, piece in ipairs(pieces(text)) do
    if find(line, "%S") and M.width(line .. M.stripped(piece)) > width then
      lines[#lines + 1] = M.stripped(line)
      line = (" "):rep(hanging or 0)
      piece = gsub(piece, "^ +", "")
    end
    line = line .. piece
  end
  lines[#lines + 1] = M.stripped(line)
  return lines
end

return M
