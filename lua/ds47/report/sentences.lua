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

local function integer(number)
  return format("%d", number)
end

local function plain(value)
  if type(value) == "table" then
    return value.text
  elseif type(value) == "number" and value == floor(value) then
    return integer(value)
  end
  return tostring(value)
end

local function list(items)
  local shown = {}
  for number, item in ipairs(items) do
    shown[number] = plain(item)
  end
  return concat(shown, ", ")
end

local function values(items)
  local shown = {}
  for number, item in ipairs(items) do
    if number > M.VALUES_SHOWN then
      shown[number] = "..."
      break
    end
    shown[number] = plain(item)
  end
  return #shown > 0 and concat(shown, ", ") or "-"
end

--- A record index as people write it: 47, 0xB02E.
function M.record_index(index)
  return index < 0x100 and integer(index) or format("0x%04X", index)
end

local SHOW = {
  hex = spec.error_hex,
  code = spec.error_hex,
  hex32 = function(number) return format("0x%08X", number) end,
  index = M.record_index,
  ms = function(number) return format("%.1f", tonumber(plain(number))) end,
  ms3 = function(number) return format("%.3f", tonumber(plain(number))) end,
  s = function(number) return format("%.1f", tonumber(plain(number))) end,
  numbers = list,
  frames = list,
  values = values,
  line = function(text) return #text <= LINE and text or text:sub(1, LINE - 3) .. "..." end,
}

local function word(texts, lang)
  return lang == "zh" and texts.zh or texts.en
end

-- Templates as arrays: text, name of an argument, text, ...
local templates = {}

local function pieces(template)
  local found = templates[template]
  if found == nil then
    found = {}
    local at = 1
    for before, name, after in template:gmatch("([^{]*){([^}]*)}()") do
      found[#found + 1] = before
      found[#found + 1] = name
      at = after
    end
    found[#found + 1] = template:sub(at)
    templates[template] = found
  end
  return found
end

local shown -- forward: the words of a key have arguments too

local function fill(template, rule, args, lang)
  local parts, text = pieces(template), {}
  for number, part in ipairs(parts) do
    text[number] = number % 2 == 1 and part or shown(part, rule, args, lang)
  end
  return concat(text)
end

-- The words of a key.
local function key_words(key, lang)
  return word(tables.diagnosis_words[key], lang)
end

-- The error number that the rule is about, and what it means.
local function error_of(rule, args, lang)
  local code, kind = args.code, rule.args.code
  if code == nil then
    return word(tables.report_words[kind == "pkw" and "no_known_number" or "no_error_number"], lang)
  end
  if kind == "pkw" then return integer(code) .. " " .. cyclic.error_text(code, lang, args.vendor_id) end
  local text = spec.error_hex(code) .. " " .. spec.error_text(code, lang, args.vendor_id)
  if not args.among then return text end
  return (key_words("among", lang):gsub("{error}", {["{error}"] = text}))
end

-- The words of the status that the rule is about.
local function text_of(args, lang)
  return args.status and status.status_text(tonumber(args.status, 16), lang) or ""
end

local function reason(args, lang)
  local text = word(tables.reasons[args.reason], lang)
  local between = lang == "zh" and "；" or "; "
  return args.dropped and text .. between .. word(tables.reasons.dropped, lang) or text
end

-- A drive in cyclic frames: its device and slot; one that was named by hand has no slot.
local function drive(args, lang)
  local device = args.device or "?"
  if args.slot == nil then return device end
  local values_ = {device = device, slot = integer(args.slot)}
  return (word(tables.diagnosis_words.drive, lang):gsub("{(%w+)}", values_))
end

--- `1.1`; `1` on PROFIBUS, which has no subslots.
function M.slot_number(slot, subslot)
  return subslot and format("%d.%d", slot, subslot) or format("%d", slot)
end

local function place(where, lang)
  local values_ = {slot = M.slot_number(where.slot, where.subslot), index = M.record_index(where.index)}
  return (word(tables.diagnosis_words.place, lang):gsub("{(%w+)}", values_))
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
  return (known:gsub("{(%w)}", { n = numbers[1], m = numbers[2] }))
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
  if value == nil then
    return ABSENT[kind] and "-" or "?"
  elseif kind == "reason" then
    return reason(args, lang)
  elseif kind == "key" then
    return fill(key_words(value, lang), rule, args, lang)
  elseif kind == "place" then
    return place(value, lang)
  elseif kind == "text" and type(value) == "string" then
    return part(value, lang)
  elseif kind == "pnu" then
    return naming.spelling(value, args.family)
  end
  return (SHOW[kind] or plain)(value)
end

local NONE = {}

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

--- The sentence of a rule with these arguments, in "en" or "zh".
function M.words(rule, args, lang)
  local row = tables.rules[rule]
  args = args or NONE
  local text = fill(lang == "zh" and row.message_zh or row.message, row, args, lang)
  if args.dropped and args.reason == nil then
    return text .. format(lang == "zh" and "（%s）" or " (%s)", word(tables.reasons.dropped, lang))
  end
  return text
end

--- What a rule advises: what is about the error number that was seen first, about no other one.
function M.advice(row, args, lang)
  local zh = lang == "zh"
  local text, colon = zh and row.advice_zh or row.advice, zh and "：" or ":"
  if not args.code then
    return text
  end
  local seen, first, others, from = spec.error_hex(args.code) .. colon, {}, {}, 1
  while from <= #text do
    local to = text:find("0x%x%x" .. colon, from + 1) or #text + 1
    local piece = text:sub(from, to - 1):match("^%s*(.-)%s*$")
    if piece:sub(1, #seen) == seen then
      first[#first + 1] = piece
    elseif not piece:find("^0x%x%x" .. colon) then
      others[#others + 1] = piece
    end
    from = to
  end
  for _, piece in ipairs(others) do
    first[#first + 1] = piece
  end
  return first[1] and concat(first, zh and "" or " ") or text
end

--- What a finding says.
function M.sentence(finding, lang)
  return M.words(finding.rule, finding.args, lang)
end

return M
