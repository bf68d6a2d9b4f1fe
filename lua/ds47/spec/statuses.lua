-- PNIOStatus in words: what DE80B500 means (docs/protocol.md E.5). The words are in tables.lua.

local spec = require("ds47.spec.lookup")
local tables = require("ds47.spec.tables")

local floor, format = math.floor, string.format

local M = {}

local ACCESS, PROTOCOL = 0x80, 0x81

--- A status as engineers know it, ErrorCode first: "DE80B500".
-- @param status 32 bits, ErrorCode in the highest byte, whatever the byte order on the wire was
function M.status_hex(status) return format("%08X", status) end

--- The four bytes of a status, ErrorCode first.
function M.four(status)
  return floor(status / 16777216), floor(status / 65536) % 256, floor(status / 256) % 256, status % 256
end

local function filled(template, value) return spec.fill(template, {value = value}) end

local function name(column, value, lang, words)
  local entry = tables.status[column][value]
  return entry and entry[lang] or filled(words.unknown, value)
end

--- A status in words: "read: access: state conflict".
-- @param lang "en" or "zh"; anything else gives English
function M.status_text(status, lang)
  lang = lang == "zh" and "zh" or "en"
  local words = tables.status.words[lang]
  if status == 0 then return words.ok end
  local code, decode, first, second = M.four(status)
  local parts, detail = {name("error_code", code, lang, words)}, "detail"
  if decode == ACCESS then
    parts[2], detail = name("access", first, lang, words), "user"
  else
    parts[2] = name("error_decode", decode, lang, words)
    parts[3] = decode == PROTOCOL and name("protocol", first, lang, words) or format("0x%02X", first)
  end
  if second ~= 0 then parts[#parts + 1] = filled(words[detail], second) end
  return table.concat(parts, words.separator)
end

return M
