-- The part of the tree that is about a finding: what it is called, what was seen (the expert info), cause,
-- what to do, the request as it should have been, and the other frames that it is about.
--
-- `put` are the functions of tree.lua that add fields. The sentence stands in the expert info alone, and
-- Wireshark's dialog shows that; as fields message and arguments are there, hidden.

local json = require("ds47.support.json")
local later = require("ds47.support.later").module
local own_experts = require("ds47_ws.experts")
local sentences = require("ds47.report.sentences")
local suggest = later("ds47.diagnosis.suggest")
local tables = require("ds47.spec.tables")
local words = require("ds47.report.formatting")

local M = {}

local WIDTH, HANGING = 76, 4 -- columns of a line, and blanks before a further one

local function in_language(row, key, lang) return lang == "zh" and row[key .. "_zh"] or row[key] end

-- `DS410 error: Negative response for a parameter`.
local function label(finding, row, lang)
  return words.say(lang, "finding_title", {
    rule = finding.rule, severity = words.say(lang, "severity_" .. finding.severity),
    title = in_language(row, "title", lang),
  })
end

-- The same with the parameter that it is about, `... for a parameter: p1437[0]`: a response may have several.
local function label_of_one(finding, row, lang)
  local text, args = label(finding, row, lang), finding.args
  if type(args.pnu) ~= "number" then return text end
  local subindex = type(args.subindex) == "number" and args.subindex or nil
  local address = words.address({ pnu = args.pnu, subindex = subindex, family = args.family })
  return words.joined(lang, { text, address }, ": ", "：")
end

-- What the rule says of its findings, its "cause" or "advice". It may be longer than Wireshark shows in
-- one line (240 bytes): the rest stands in lines below it.
-- @param word the word of the report that the line has
local function add_of_rule(put, parent, key, text, word, lang)
  local item = put.derive(parent, "finding." .. key, text)
  if not item then return end
  local shown = words.say(lang, word, { text = text })
  for number, line in ipairs(words.wrap(shown, WIDTH, HANGING)) do
    if number == 1 then
      item:set_text(line)
    else
      parent:add(line):set_generated()
    end
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
  local row = tables.rules[finding.rule]
  local shown = put.derive(parent, "finding", finding.rule)
  if shown then shown:set_text(label_of_one(finding, row, lang)) end
  shown = shown or parent
  own_experts.add_finding(shown, experts, finding, lang)
  if put.wanted("finding.message") then -- which a filter finds and nobody sees, as the next one
    put.derive(shown, "finding.message", words.escape(sentences.sentence(finding, lang))):set_hidden()
  end
  if put.wanted("finding.args") then
    put.derive(shown, "finding.args", json.encode(finding.args)):set_hidden()
  end
  add_of_rule(put, shown, "cause", in_language(row, "cause", lang), "finding_cause", lang)
  add_of_rule(put, shown, "advice", sentences.advice(row, finding.args, lang), "finding_advice", lang)
  add_instead(put, shown, finding)
  add_frames(put, shown, finding, request)
  put.derive(shown, "finding.severity", tables.codes.severities[finding.severity])
  put.derive(shown, "finding.offset", finding.offset)
  put.derive(shown, "finding.transaction", finding.transaction or finding.order)
end

return M
