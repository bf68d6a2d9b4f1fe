-- What an analysis found in words, English or Chinese: findings and diagnoses, error numbers, names of
-- parameters (Python: ds47.report.sentences).
--
-- The only place that words them; nothing reads a value back out of what it gives. What the types of
-- arguments mean is in spec/rules.toml. A value of a parameter is a string, or what json.raw gives for a
-- number, and so is a time: the text of a float keeps its point.

local cyclic = require("ds47.spec.cyclic")
local naming = require("ds47.profidrive.naming")
local spec = require("ds47.spec.lookup")
local status = require("ds47.spec.statuses")
local tables = require("ds47.spec.tables")

local concat, floor, format = table.concat, math.floor, string.format

local M = {}

M.VALUES_SHOWN = 4 -- values of a list that a sentence names

local LINE = 100

local ABSENT = {code = true, pkw = true, info = true, status = true, value = true, values = true}

local function integer(number) return format("%d", number) end

local function plain(value)
  if type(value) == "table" then return value.text end
  if type(value) == "number" and value == floor(value) then return integer(value) end
  return tostring(value)
end

local function list(items, most)
  local shown = {}
  for number = 1, math.min(#items, most or #items) do shown[number] = plain(items[number]) end
  shown[#shown + 1] = #items > #shown and "..." or nil
  return concat(shown, ", ")
end

local function tenths(number) return format("%.1f", tonumber(plain(number))) end

local SHOW = {
  hex = spec.error_hex,
  code = spec.error_hex,
  hex32 = function(number) return format("0x%08X", number) end,
  index = function(index) return index < 0x100 and integer(index) or format("0x%04X", index) end,
  ms = tenths,
  ms3 = function(number) return format("%.3f", tonumber(plain(number))) end,
  s = tenths,
  numbers = list,
  values = function(items) return #items > 0 and list(items, M.VALUES_SHOWN) or "-" end,
  line = function(text) return #text <= LINE and text or text:sub(1, LINE - 3) .. "..." end,
}

local shown -- forward: the words of a key have arguments too

local function fill(template, rule, args, lang)
  return (template:gsub("{([^}]*)}", function(name) return shown(name, rule, args, lang) end))
end

local function key_words(key, lang) return spec.words(tables.diagnosis_words[key], lang) end

-- The error number that the rule is about, and what it means.
local function error_of(rule, args, lang)
  local code, kind = args.code, rule.args.code
  if code == nil then
    return spec.words(tables.report_words[kind == "pkw" and "no_known_number" or "no_error_number"], lang)
  end
  if kind == "pkw" then return integer(code) .. " " .. cyclic.error_text(code, lang, args.vendor_id) end
  local text = spec.error_hex(code) .. " " .. spec.error_text(code, lang, args.vendor_id)
  if not args.among then return text end
  return spec.fill(key_words("among", lang), {error = text})
end

-- The words of the status that the rule is about.
local function text_of(args, lang)
  return args.status and status.status_text(tonumber(args.status, 16), lang) or ""
end

local function reason(args, lang)
  local text = spec.words(tables.reasons[args.reason], lang)
  local between = lang == "zh" and "；" or "; "
  return args.dropped and text .. between .. spec.words(tables.reasons.dropped, lang) or text
end

-- A drive in cyclic frames: its device and slot; one that was named by hand has no slot.
local function drive(args, lang)
  local device = args.device or "?"
  return args.slot and spec.fill(key_words("drive", lang), {device = device, slot = args.slot}) or device
end

--- `1.1`; `1` on PROFIBUS, which has no subslots.
function M.slot_number(slot, subslot)
  return subslot and format("%d.%d", slot, subslot) or format("%d", slot)
end

-- A part of a message, such as `value block 1 of 2`; what no table has stays as it is.
local function part(text, lang)
  local numbers = {}
  local template = text:gsub("%d+", function(number)
    numbers[#numbers + 1] = number
    return #numbers == 1 and "{n}" or "{m}"
  end)
  local known = lang == "zh" and tables.message_parts[template]
  if not known then return text end
  return spec.fill(known, {n = numbers[1], m = numbers[2]})
end

function shown(name, rule, args, lang)
  if name == "parameter" then
    return fill(key_words(args.pnu and "parameter" or "parameter_unknown", lang), rule, args, lang)
  elseif name == "text" then
    return text_of(args, lang)
  elseif name == "error" then
    return error_of(rule, args, lang)
  elseif name == "drive" then
    return drive(args, lang)
  end
  local kind, value = rule.args and rule.args[name] or "text", args[name]
  if value == nil and kind == "clause" then return "" end -- it is not always there
  if value == nil then return ABSENT[kind] and "-" or "?" end
  if kind == "reason" then return reason(args, lang) end
  if kind == "key" or kind == "clause" then return fill(key_words(value, lang), rule, args, lang) end
  if kind == "text" and type(value) == "string" then return part(value, lang) end
  if kind == "pnu" then return naming.spelling(value, args.family) end
  return (SHOW[kind] or plain)(value)
end

--- What the error number of a parameter means on the drive that sent it; "" where there is no number.
function M.error_words(item, lang)
  if item.ak then
    return cyclic.error_text(item.code, lang, item.vendor_id) or cyclic.meaning(item.ak, true, lang)
  end
  return item.code and spec.error_text(item.code, lang, item.vendor_id) or ""
end

--- The error number of a parameter as manuals print it: `0x11`, of PKW `17`; nil where there is none.
function M.error_number(item)
  if item.code == nil then return nil end
  return item.ak and integer(item.code) or spec.error_hex(item.code)
end

--- As the drive calls it; else the name of a listed parameter; nil of any other.
function M.name(item, lang)
  if item.described and item.described.name then return item.described.name end
  local known = item.listed
  return known and (lang == "zh" and known.name_zh or known.name_en) or nil
end

--- What a finding says, in "en" or "zh".
function M.sentence(finding, lang)
  local row, args = tables.rules[finding.rule], finding.args or {}
  local text = fill(lang == "zh" and row.message_zh or row.message, row, args, lang)
  if args.dropped and args.reason == nil then
    return text .. format(lang == "zh" and "（%s）" or " (%s)", spec.words(tables.reasons.dropped, lang))
  end
  return text
end

--- What a rule advises: what is about the error number, or the ErrorCode1 of a STATUS, that was seen first.
function M.advice(row, args, lang)
  local zh = lang == "zh"
  local text, colon = zh and row.advice_zh or row.advice, zh and "：" or ":"
  local refused = tostring(args.status):match("^D[EF]80(%x%x)%x%x$")
  local code = refused and tonumber(refused, 16) or args.code
  if not code then return text end
  local several = zh and "，多个参数" or ", several parameters" -- of requests of one there is nothing to say
  local seen, parts, wanted = spec.error_hex(code), {}, 0
  -- What is about a number begins a line.
  local lines = text:gsub("0x%x%x" .. colon, "\n%0"):gsub("0x%x%x" .. several .. colon, "\n%0")
  for piece in lines:gmatch("[^\n]+") do
    piece = piece:match("^%s*(.-)%s*$")
    local number, about = piece:match("^(0x%x%x)(.-)" .. colon)
    if not number or (about ~= "" and about ~= several) then
      parts[#parts + 1] = piece
    elseif number == seen and not (about == several and args.asked == 1) then
      wanted = wanted + 1
      table.insert(parts, wanted, piece)
    end
  end
  if row.args and row.args.code == "code" and spec.in_manual(code, args.vendor_id) then
    table.insert(parts, 1, spec.manual_of(code, args.vendor_id, lang))
  end
  return parts[1] and concat(parts, zh and "" or " ") or text
end

return M
