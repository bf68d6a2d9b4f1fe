-- What a frame says in one sentence: the Info column, and the label of the tree.
--
-- A *view* is one transaction as one frame shows it (track.lua makes them): {role, item = the transaction,
-- parameters = those that the frame shows, message, response, complete}. Numbers, values, names and units are
-- written as the text report does, references in hex as Wireshark and the manuals do. Events of drives are
-- told as drives.lua gives them: {relation, event}.

local cyclic = require("ds47.spec.cyclic")
local descriptions = require("ds47.report.descriptions")
local entries = require("ds47.support.later").entries
local mapped = require("ds47.support.arrays").mapped
local status = require("ds47.spec.statuses")
local text_of = require("ds47.profidrive.formats").text_of
local words = require("ds47.report.formatting")
local error_texts = require("ds47.report.sentences")

local concat, type = table.concat, type

local M = {}

local PARAMETERS_SHOWN = 6 -- more make the line long: they are counted
local NAMES_SHOWN = 2 -- with more parameters than these the line has no names

-- `ref 0x03`; a message may be too short to have one.
local function reference(item)
  local number = item.request_reference
  return number and string.format("ref 0x%02X", number) or "ref ?"
end

-- A text with the axis behind it: `ref 0x03, DO 2`.
local function with_axis(text, item)
  local axis = item.axis
  return axis and string.format("%s, DO %d", text, axis) or text
end

local language -- of the texts of error numbers, "en" or "zh"

-- `0x02 value outside limits`; the second word where it says something.
local function error_of(failed)
  local text = "error"
  if failed.code then
    text = error_texts.error_number(failed) .. " " .. error_texts.error_words(failed, language)
  elseif failed.ak then
    text = error_texts.error_words(failed, language)
  end
  if failed.info and failed.info ~= 0 then text = string.format("%s (info %d)", text, failed.info) end
  return text
end

-- How parameters are listed, by language, whether they were written, and whether with their names: {lang,
-- named, sign = what stands before a value}.
local STYLES = entries(function(lang)
  local function with(sign)
    return { [true] = { lang = lang, sign = sign, named = true }, [false] = { lang = lang, sign = sign } }
  end
  return { [true] = with(" := "), [false] = with(" = ") }
end)

-- What a sentence says around the values of a parameter: {style, address (with the name where names are
-- given), before and behind (a value), number_text (what makes the text of a number)}. Remembered where
-- parameters share what they are.
local function words_of(item, style)
  local address, name = words.address(item), style.named and words.name(item, style.lang)
  address = name and address .. " (" .. name .. ")" or address
  local found = {
    style = style, address = address, before = address .. style.sign,
    behind = item.unit and " " .. words.escape(item.unit) or "", number_text = text_of(item.format),
    is_described = descriptions.is_about(item.attribute),
  }
  local class = getmetatable(item)
  if class then class.words = found end
  return found
end

-- A text with one more parameter: `p50303[0] = 10.0`, ` := ` as the sign where the value was written,
-- `: 0x02 ...` where it failed; with the name of a known one: `p1082[0] (Maximum speed)`.
-- @param separator what stands between the two
local function with_parameter(text, separator, item, style)
  local around, values, failed = item.words, item.values, item.error
  if around == nil or around.style ~= style then around = words_of(item, style) end
  local value = values[1]
  if failed then return text .. separator .. around.address .. ": " .. error_of(failed) end
  if value == nil then return text .. separator .. around.address end
  local described = around.is_described and descriptions.parts(item, words, style.lang)
  if described then return text .. separator .. around.before .. concat(described, ", ") end
  if descriptions.stated(item) > 1 or item.scaled then
    return text .. separator .. around.before .. words.with_unit(item)
  end
  local shown = type(value) == "number" and around.number_text(value) or words.value(value, item.format)
  item.shown = shown -- the tree shows it, too
  return text .. separator .. around.before .. shown .. around.behind
end

-- A text with what a sentence says of the parameters of a transaction that is called so.
local function with_list(text, parameters, operation)
  local count, separator = #parameters, ": "
  local shown = count > PARAMETERS_SHOWN and PARAMETERS_SHOWN or count
  local style = STYLES[language][operation == "change"][count <= NAMES_SHOWN]
  for number = 1, shown do
    text, separator = with_parameter(text, separator, parameters[number], style), ", "
  end
  return count > shown and string.format("%s, ... and %d more", text, count - shown) or text
end

-- What a sentence says of the parameters of a request, remembered where equal ones share it
-- (parameter.remembering).
local function list_asked(view)
  local item, shared = view.item, view.message.shared
  local job = item.job
  local peer = job and job.peer or item
  local whose = peer.family or peer.vendor_id or false
  if shared == nil or (job or item).meanings then -- which are those of one transaction
    return with_list("", view.parameters, item.operation)
  elseif shared.listed_for ~= whose or shared.listed_in ~= language then -- names and units are of both
    shared.listed, shared.listed_for = with_list("", view.parameters, item.operation), whose
    shared.listed_in = language
  end
  return shared.listed
end

local function refusal(word) return status.status_hex(word) .. " " .. status.status_text(word) end

local function asked(view)
  local operation = view.item.operation
  if operation == "read" or operation == "change" then return operation end
  local id = view.message and view.message.request_id
  return id and string.format("%s 0x%02X", operation, id) or operation
end

local sentences = {}

function sentences.write_request(view)
  return with_axis(asked(view) .. " request " .. reference(view.item), view.item) .. list_asked(view)
end

function sentences.write_response(view)
  local item = view.item
  local word = item.write_status
  if word == nil then return "write failed " .. reference(item) end
  if word == 0 then return "write accepted " .. reference(item) end
  return "write refused " .. reference(item) .. ": " .. refusal(word)
end

function sentences.read_request(view)
  return with_axis("fetch response " .. reference(view.item), view.item)
end

function sentences.poll(view) return "read poll " .. reference(view.item) .. ": not ready" end

-- How a record of the drive is called: where parameters failed by the state that comes of it.
local function outcome(view)
  local item = view.item
  local failing = item.failing
  local how = failing and words.state("en", failing) or "response " .. reference(item)
  return with_axis(asked(view) .. " " .. how, item)
end

function sentences.read_response(view)
  local item = view.item
  local word = item.read_status
  if word and word ~= 0 then return "read refused " .. reference(item) .. ": " .. refusal(word) end
  return with_list(outcome(view), view.parameters, item.operation)
end

function sentences.reread(view)
  return with_list("read again: " .. outcome(view), view.parameters, view.item.operation)
end

-- A request or a response of PKW: `PKW read response p1082[0] = 50.0`.
local function pkw_sentence(view)
  local kind, operation = view.role == "write_request" and " request " or " response ", view.item.operation
  local style = STYLES[language][operation == "change"][true]
  return with_parameter("PKW " .. operation, kind, view.parameters[1], style)
end

--- The sentence of one view; error numbers in "en" or "zh".
function M.sentence(view, lang)
  local item = view.item
  language = lang
  return item.job == nil and item.channel == "pkw" and pkw_sentence(view) or sentences[view.role](view)
end

--- Events of one drive, in their order: those of one word in one frame together, an array of arrays.
function M.together(events)
  local found, newest = {}, {}
  for _, event in ipairs(events) do
    local before = newest[1]
    if before == nil or before.frame ~= event.frame or before.word ~= event.word then
      newest = {}
      found[#found + 1] = newest
    end
    newest[#newest + 1] = event
  end
  return found
end

local function names(events, lang)
  local texts = mapped(events, function(event) return cyclic.event_text(event.name, lang) end)
  return table.concat(texts, lang == "zh" and "，" or ", ")
end

local function with_state(text, event, lang)
  if event.state == nil then return text end
  return text .. (lang == "zh" and "：" or ": ") .. cyclic.state_text(event.state, event.overlays, lang)
end

--- Events of one word in one frame, with the state from then on: `running: S4 operation enabled`.
function M.what(events, lang) return with_state(names(events, lang), events[#events], lang) end

--- The word of an event as it was and as it is, `STW1 047E -> 047F`.
function M.word(event)
  local before = event.before and string.format("%04X -> ", event.before) or ""
  return string.format("%s %s%04X", event.word, before, event.after)
end

-- The same with the word, `ON (STW1 047E -> 047F)`: the state only where the drive itself says it.
local function of_word(events, lang)
  local text, event = names(events, lang), events[#events]
  if event.word == nil then return text end
  text = string.format("%s (%s)", text, M.word(event))
  return event.word == "ZSW1" and with_state(text, event, lang) or text
end

--- What happened to drives in a frame: `PZD running (ZSW1 FB33 -> FB37): S4 operation enabled`.
function M.events(events, lang)
  local texts, first = {}, 1
  while events[first] do
    local relation, own = events[first].relation, {}
    while events[first] and events[first].relation == relation do
      own[#own + 1] = events[first].event
      first = first + 1
    end
    for _, same in ipairs(M.together(own)) do texts[#texts + 1] = of_word(same, lang) end
  end
  return "PZD " .. table.concat(texts, "; ")
end

--- The Info column of a frame: the sentences of all its views, and what happened to drives. Whose they are
-- the column Protocol says.
function M.text(views, events, lang)
  if #views == 1 and #events == 0 then return M.sentence(views[1], lang) end
  local texts = {}
  for number = 1, #views do texts[number] = M.sentence(views[number], lang) end
  if #events > 0 then texts[#texts + 1] = M.events(events, lang) end
  return table.concat(texts, "; ")
end

return M
