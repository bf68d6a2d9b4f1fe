-- What a frame says in one sentence: the Info column, and the label of the tree. First stands what one looks
-- for, parameters with their values: a narrow column, and a label of Flow Graph, cut the rest.
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

local concat, format, type = table.concat, string.format, type

local M = {}

local PARAMETERS_SHOWN = 6 -- more make the line long: they are counted
local NAMES_SHOWN = 2 -- with more parameters than these the line has no names

-- A text with the drive object and the reference behind it, which a message may be too short to have:
-- `change request, DO 2, ref 0xC9`.
local function of(item, text)
  local axis, number = item.axis, item.request_reference
  if axis then text = format("%s, DO %d", text, axis) end
  return number and format("%s, ref 0x%02X", text, number) or text .. ", ref ?"
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
  if failed.info and failed.info ~= 0 then text = format("%s, info %d", text, failed.info) end
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

-- What a sentence says around the values of a parameter: {style, address, before and behind (a value, up to
-- what follows), name (false or nil where none is given), number_text (what makes the text of a number)}.
-- Remembered where parameters share what they are.
local function words_of(item, style)
  local address = words.address(item)
  local found = {
    style = style, address = address, before = address .. style.sign,
    behind = item.unit and " " .. words.escape(item.unit) .. ", " or ", ",
    name = style.named and words.name(item, style.lang), number_text = text_of(item.format),
    is_described = descriptions.is_about(item.attribute),
  }
  local class = getmetatable(item)
  if class then class.words = found end
  return found
end

-- A text with one more parameter behind it, and the name of a known one: `p50303[0] = 10.0, `, ` := ` as the
-- sign where the value was written, `: 0x02 ...` where it failed.
local function with_parameter(text, item, style)
  local around, values, failed = item.words, item.values, item.error
  if around == nil or around.style ~= style then around = words_of(item, style) end
  local value, name = values[1], around.name
  if failed then return text .. around.address .. ": " .. error_of(failed) .. ", ", name end
  if value == nil then return text .. around.address .. ", ", name end
  local described = around.is_described and descriptions.parts(item, words, style.lang)
  if described then return text .. around.before .. concat(described, ", ") .. ", ", name end
  if descriptions.stated(item) > 1 or item.scaled then
    return text .. around.before .. words.with_unit(item) .. ", ", name
  end
  local shown = type(value) == "number" and around.number_text(value) or words.value(value, item.format)
  item.shown = shown -- the tree shows it, too
  return text .. around.before .. shown .. around.behind, name
end

-- What a sentence says of the parameters of a transaction that is called so, up to what follows, and their
-- names for its end: of one ` (Maximum speed)`, of two with their addresses.
local function list_of(parameters, operation)
  local count, text, names = #parameters, "", ""
  local shown = count > PARAMETERS_SHOWN and PARAMETERS_SHOWN or count
  local style = STYLES[language][operation == "change"][count <= NAMES_SHOWN]
  for number = 1, shown do
    local item = parameters[number]
    local longer, name = with_parameter(text, item, style)
    text = longer
    if name then
      if count > 1 then name = words.address(item) .. " " .. name end
      names = names == "" and name or names .. ", " .. name
    end
  end
  if count > shown then text = format("%s... and %d more, ", text, count - shown) end
  return text, names == "" and names or " (" .. names .. ")"
end

-- What a sentence says of the parameters of a request, remembered where equal ones share it
-- (parameter.remembering).
local function list_asked(view)
  local item, shared = view.item, view.message.shared
  local job = item.job
  local peer = job and job.peer or item
  local whose = peer.family or peer.vendor_id or false
  if shared == nil or (job or item).meanings then -- which are those of one transaction
    return list_of(view.parameters, item.operation)
  elseif shared.listed_for ~= whose or shared.listed_in ~= language then -- names and units are of both
    shared.listed, shared.listed_names = list_of(view.parameters, item.operation)
    shared.listed_for, shared.listed_in = whose, language
  end
  return shared.listed, shared.listed_names
end

local function refusal(word) return status.status_hex(word) .. " " .. status.status_text(word) end

local function asked(view)
  local operation = view.item.operation
  if operation == "read" or operation == "change" then return operation end
  local id = view.message and view.message.request_id
  return id and format("%s 0x%02X", operation, id) or operation
end

local sentences = {}

function sentences.write_request(view)
  local list, names = list_asked(view)
  return list .. of(view.item, asked(view) .. " request") .. names
end

function sentences.write_response(view)
  local word = view.item.write_status
  local how = word == nil and "failed" or word == 0 and "accepted" or "refused: " .. refusal(word)
  return of(view.item, "write " .. how)
end

function sentences.read_request(view) return of(view.item, "fetch response") end

function sentences.poll(view) return of(view.item, "read poll: not ready") end

-- What a record of the drive says; where parameters failed it is called by the state that comes of it.
local function answered(view, prefix)
  local item = view.item
  local how = item.failing and words.state("en", item.failing) or "response"
  local list, names = list_of(view.parameters, item.operation)
  return list .. of(item, prefix .. asked(view) .. " " .. how) .. names
end

function sentences.read_response(view)
  local word = view.item.read_status
  if word and word ~= 0 then return of(view.item, "read refused: " .. refusal(word)) end
  return answered(view, "")
end

function sentences.reread(view) return answered(view, "read again: ") end

-- A request or a response of PKW: `p1082[0] = 50.0, PKW read response (Maximum speed)`.
local function pkw_sentence(view)
  local kind, operation = view.role == "write_request" and " request" or " response", view.item.operation
  local list, names = list_of(view.parameters, operation)
  return list .. "PKW " .. operation .. kind .. names
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
  local before = event.before and format("%04X -> ", event.before) or ""
  return format("%s %s%04X", event.word, before, event.after)
end

-- The same with the word, `ON (STW1 047E -> 047F)`: the state only where the drive itself says it.
local function of_word(events, lang)
  local text, event = names(events, lang), events[#events]
  if event.word == nil then return text end
  text = format("%s (%s)", text, M.word(event))
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
