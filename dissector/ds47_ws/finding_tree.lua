-- The part of the tree that is about a finding: what was seen, what it is called (the expert info), cause,
-- what to do, the request as it should have been, and the other frames that it is about.
--
-- `put` are the functions of tree.lua that add fields. Message and arguments are fields, too, hidden.

local json = require("ds47.support.json")
local later = require("ds47.support.later").module
local own_experts = require("ds47_ws.experts")
local sentences = require("ds47.report.sentences")
local suggest = later("ds47.diagnosis.suggest")
local tables = require("ds47.spec.tables")
local words = require("ds47.report.formatting")

local M = {}

-- Columns of a line, and of the first one; blanks before a further one. Wireshark shows 240 bytes of each.
local WIDTH, WIDEST, HANGING = 76, 150, 4

local function in_language(row, key, lang) return lang == "zh" and row[key .. "_zh"] or row[key] end

-- `DS410 error: Negative response for a parameter`.
local function label(finding, row, lang)
  return words.say(lang, "finding_title", {
    rule = finding.rule, severity = words.say(lang, "severity_" .. finding.severity),
    title = in_language(row, "title", lang),
  })
end

-- A text in as many lines as it takes: that of an item, and lines below another one.
local function set_lines(item, parent, text, width)
  for number, line in ipairs(words.wrap(text, width, HANGING)) do
    if number == 1 then
      item:set_text(line)
    else
      parent:add(line):set_generated()
    end
  end
end

-- `DS410 error: Parameter p1437[0] is refused: ...`: what was seen.
local function add_title(put, parent, finding, sentence, lang)
  local shown = put.derive(parent, "finding", finding.rule)
  if not shown then return parent end
  local severity = words.say(lang, "severity_" .. finding.severity)
  local about = { rule = finding.rule, severity = severity, title = words.escape(sentence) }
  set_lines(shown, shown, words.say(lang, "finding_title", about), WIDEST)
  return shown
end

-- What a finding is called where another one of its frame refers to it: by its parameter, else by its rule.
local function name_of(finding)
  local args = finding.args
  if type(args.pnu) ~= "number" then return finding.rule end
  local subindex = type(args.subindex) == "number" and args.subindex or nil
  return finding.rule .. " " .. words.address({ pnu = args.pnu, subindex = subindex, family = args.family })
end

-- What the rule says of its findings, its "cause" or "advice": once in a frame, which may have the same for
-- dozens of parameters.
-- @param word the word of the report that the line has
local function add_of_rule(put, parent, finding, key, text, word, lang)
  local told = put.told[text]
  if told then
    local as_told = words.say(lang, "finding_as_told", { finding = told })
    parent:add(words.say(lang, word, { text = as_told })):set_generated()
    return
  end
  local item = put.derive(parent, "finding." .. key, text)
  if item then
    put.told[text] = name_of(finding)
    set_lines(item, parent, words.say(lang, word, { text = text }), WIDTH)
  end
end

-- The corrected request. Its bytes are not those of the frame: the window shows them in a tab of their own.
local function add_instead(put, parent, finding)
  if not finding.corrected then return end
  local item, request = parent, finding.corrected
  if put.wanted("finding.instead") then
    item = put.point(parent, "finding.instead", put.elsewhere(request, "Send instead"))
  end
  put.derive(item, "finding.instead.words", table.concat(suggest.plc_words(request), " "))
  put.derive(item, "finding.instead.encode", suggest.encode_command(request, finding.args.family))
end

-- The other frames that it is about, as links. `request` is that of its transaction, which the finding may
-- stand behind.
local function add_frames(put, parent, finding, request)
  local known = { [finding.frame] = true }
  for _, frame in ipairs(finding.frames) do
    if not known[frame] then
      put.derive(parent, "finding.frame", frame)
      known[frame] = true
    end
  end
  if request and not known[request] then put.derive(parent, "finding.request_in", request) end
end

--- Adds a link to a finding that another frame has.
function M.add_elsewhere(put, parent, finding, lang)
  local item = put.derive(parent, "finding.elsewhere", finding.frame)
  if item then
    item:set_text(words.say(lang, finding.corrected and "finding_elsewhere_instead" or "finding_elsewhere", {
      frame = words.integer(finding.frame), title = label(finding, tables.rules[finding.rule], lang),
    }))
  end
end

--- Adds a finding.
-- @param parent the tree of its transaction, or of the frame
-- @param experts as fields.lua makes them
-- @param request number of the frame with the request of its transaction; nil where there is none, or where
--   the tree of the transaction has the link
function M.add(put, parent, finding, experts, request, lang)
  local row, sentence = tables.rules[finding.rule], sentences.sentence(finding, lang)
  local shown = add_title(put, parent, finding, sentence, lang)
  own_experts.add_finding(shown, experts, finding, lang)
  if put.wanted("finding.message") then -- which a filter finds and nobody sees, as the next one
    put.derive(shown, "finding.message", words.escape(sentence)):set_hidden()
  end
  if put.wanted("finding.args") then
    put.derive(shown, "finding.args", json.encode(finding.args)):set_hidden()
  end
  local advice = sentences.advice(row, finding.args, lang)
  add_of_rule(put, shown, finding, "cause", in_language(row, "cause", lang), "finding_cause", lang)
  add_of_rule(put, shown, finding, "advice", advice, "finding_advice", lang)
  add_instead(put, shown, finding)
  add_frames(put, shown, finding, request)
  put.derive(shown, "finding.severity", tables.codes.severities[finding.severity])
  put.derive(shown, "finding.offset", finding.offset)
  put.derive(shown, "finding.transaction", finding.transaction or finding.order)
end

return M
