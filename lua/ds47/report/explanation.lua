-- What a status or an error number means, as text: the layout of `ds47 explain` (Python:
-- ds47.report.explanation). The meanings are those of ds47.explain.meanings.

local arrays = require("ds47.support.arrays")
local formatting = require("ds47.report.formatting")
local spec = require("ds47.spec.lookup")
local tables = require("ds47.spec.tables")

local concat, fill, format = table.concat, spec.fill, string.format
local filtered, mapped = arrays.filtered, arrays.mapped

local M = {}

M.WIDTH = 100
local LABEL = 12
local WITH_CAUSE = 2
local ONE_LINE = 140 -- columns of the line where nothing is known

local function label(text) return "  " .. text .. (" "):rep(math.max(1, LABEL - formatting.width(text))) end

local function cause(each, words) return each.text .. fill(words.bracket, {text = words[each.basis]}) end

-- `RDREC VALID 0  BUSY 0  ERROR 1  STATUS 16#DE80B500  (for one call only)`.
local function block_text(block, words)
  if block.block == "" then return block.note end
  if block.done == nil then return block.block .. "  " .. block.note end
  local done = block.block == "RDREC" and "VALID" or "DONE"
  local shown = format("%s %d  BUSY %d  ERROR %d", done, block.done and 1 or 0, block.busy and 1 or 0,
    block.error and 1 or 0)
  local note = fill(words.bracket, {text = block.note})
  return format("%s  %-24s  STATUS 16#%s %s", block.block, shown, block.status, note)
end

local function part_text(part)
  local texts = filtered({part.value, part.name, part.text}, function(each) return each ~= "" end)
  return concat(texts, " ")
end

-- What adds lines to a list.
local function writer(lines, width)
  local self = {}

  function self.add(line) lines[#lines + 1] = line end

  function self.wrapped(text)
    for _, line in ipairs(formatting.wrap(text, width, 2)) do self.add(line) end
  end

  function self.labelled(name, text, hanging)
    for number, line in ipairs(formatting.wrap(text, width - LABEL - 2, hanging)) do
      self.add(label(number == 1 and name or "") .. line)
    end
  end

  return self
end

-- Whether neither the number nor any part of it has a meaning: one line is enough.
local function says_nothing(meanings, words)
  for _, each in ipairs(meanings) do
    if each.known then return false end
  end
  for _, part in ipairs(meanings[1].parts) do
    if part.text ~= "" and part.text ~= words.unknown_part and part.text ~= words.second then return false end
  end
  return true
end

local function full(out, meaning, words)
  out.wrapped(meaning.title)
  local parts = mapped(meaning.parts, part_text)
  if parts[1] then out.labelled(words.parts, concat(parts, words.part_separator)) end
  for number, block in ipairs(meaning.plc) do
    out.labelled(number == 1 and words.plc or "", block_text(block, words), 2)
  end
  local numbered = #meaning.causes > 1
  for number, each in ipairs(meaning.causes) do
    local text = cause(each, words)
    out.labelled(number == 1 and words.causes or "", numbered and number .. ". " .. text or text,
      numbered and 3 or 0)
  end
  out.labelled(words.look, meaning.look)
  if meaning.filter then out.add(label(words.filter) .. meaning.filter) end
  if meaning.plugin_filter then
    out.add(label(meaning.filter and words.plugin_filter or words.filter) .. meaning.plugin_filter)
  end
end

--- The first meaning in full, of the others what they are, those without meaning in one line.
-- @param meanings array of what ds47.explain.meanings gives
-- @param lang "en" or "zh"; anything else gives English
-- @param width nil or columns of a line; a filter may be longer
-- @return array of lines
function M.lines(meanings, lang, width)
  local words, lines = tables.explain.words[lang == "zh" and "zh" or "en"], {}
  local out, others, empty = writer(lines, width or M.WIDTH), {}, {}
  if says_nothing(meanings, words) then
    return formatting.wrap(meanings[1].title, math.max(width or M.WIDTH, ONE_LINE), 2)
  end
  full(out, meanings[1], words)
  if #meanings > 1 then out.add("") end
  for number = 2, #meanings do
    local each = meanings[number]
    if each.known then others[#others + 1] = each else empty[#empty + 1] = each.title end
  end
  for number, each in ipairs(others) do
    out.wrapped(words.other .. " " .. each.title)
    if number <= WITH_CAUSE and each.causes[1] then
      out.labelled(words.causes, cause(each.causes[1], words))
    end
  end
  if empty[1] then out.wrapped(fill(words.nothing, {list = concat(empty, words.list_separator)})) end
  if others[1] then out.add(fill(words.more, {command = others[1].name})) end
  return lines
end

return M
