-- What the usual messages say, in one sentence, without decoding again what was decoded before.
--
-- Programs ask the same again and again, and the answers differ in nothing but the values. Of a message
-- about which there was nothing to say its *mask* is kept: the bytes that are no values, and the codec of
-- each value block. A message with the same bytes in these places differs in no other way, because no rule
-- looks at the values alone. Everything else is decoded and judged as the analysis does it, but for what
-- compares it with other transactions: glance.lua makes sure that there is nothing of that.
-- Not here: frames, and to which request an answer belongs.

local findings = require("ds47.findings")
local info = require("ds47_ws.info")
local numbers = require("ds47.numbers")
local pairing = require("ds47.pairing")
local parameter = require("ds47.parameter")
local rules = require("ds47.rules")
local tables = require("ds47.tables")
local transactions = require("ds47.transactions")
local words = require("ds47.report_words")

local byte, char, find, sub = string.byte, string.char, string.find, string.sub
local concat, floor = table.concat, math.floor

local M = {}

local HEADER, ADDRESS = 4, 6 -- bytes of a message in front of its addresses, and of each of them
local MOST_QUESTIONS = 1024
local NONE = {}
local CHANGE, READ, PARAMETER_FAILED = "change", "read", "DS410"
local DIGITS, PARAMETERS_SHOWN = info.DIGITS, info.PARAMETERS_SHOWN
local BEGIN = 3 -- pieces of a sentence in front of its parameters

-- Numbers as report_words.lua writes them, straight from their bytes

-- Letter of a codec -> a function of where a value stands in its message (`first` and `last`, from 1), of a
-- frame, and of how many bytes stand there in front of the message. A whole number is its own text: to
-- remember texts of numbers would give the collector much to look through.
local writers = {}

local function writer(bits, signed)
  local half = floor(2 ^ (bits - 1)) -- no float: its text would have a point
  local range = signed and half * 2 or 0
  return function(place, frame, front)
    local a, b, c, d = byte(frame, front + place.first, front + place.last)
    local number = d and ((a * 256 + b) * 256 + c) * 256 + d or b and a * 256 + b or a
    return number >= half and number - range or number
  end
end

writers.B, writers.H, writers.I = writer(8, false), writer(16, false), writer(32, false)
writers.b, writers.h, writers.i = writer(8, true), writer(16, true), writer(32, true)

function writers.f(place, frame, front)
  local a, b, c, d = byte(frame, front + place.first, front + place.last)
  local bits = ((a * 256 + b) * 256 + c) * 256 + d
  if bits ~= place.bits then -- drives are asked for what hardly changes
    place.bits, place.text = bits, numbers.float32_text(frame, front + place.first - 1)
  end
  return place.text
end

-- The same for a list of values.
local function list_writer(write, size, count)
  local some, place = {}, {}
  return function(part, frame, front)
    for number = 1, count do
      place.first = part.first + (number - 1) * size
      place.last = place.first + size - 1
      some[number] = write(place, frame, front)
    end
    return concat(some, ", ", 1, count)
  end
end

-- Masks

local item = {} -- the parameter whose text is made
local pieces = {} -- of a sentence

-- The text of a parameter, its address in front, with the values that stand in the message now.
local function spelled(part, frame, front)
  local raw = sub(frame, front + part.first, front + part.last)
  if raw ~= part.raw then
    local codec = part.codec
    local values = codec.decode(raw, part.count, codec.size)
    item.format, item.values = part.format, values
    item.scaled = codec.scale and codec.scale(values, raw, codec) or nil
    part.raw, part.text = raw, info.parameter(setmetatable(item, part.class), part.written)
  end
  return part.text
end

-- A block of a mask: `fixed` are the bytes from `from` on, up to its values. `lead` and what `write` says of
-- the message are its text.
local function part_of(data, from, block, lead, shown, written)
  local codec, first, count = block.sound_codec, block.offset + 3, block.value_count
  local part = {
    from = from, fixed = sub(data, from, first - 1), first = first, last = first + #block.raw - 1,
    codec = codec, count = count, format = block.format_name, class = getmetatable(shown), written = written,
    lead = lead, write = spelled,
  }
  local write = writers[codec.pack]
  if write and count >= 1 and count <= words.VALUES_SHOWN then
    part.lead = lead .. info.address(shown) .. (written and " := " or " = ")
    part.write = count == 1 and write or list_writer(write, codec.size, count)
  end
  return part
end

local function nothing()
  return ""
end

-- A block of a mask that is an error, all of which is fixed.
local function failed_part(data, from, block, lead, shown)
  local last = block.offset + 2 + #block.raw
  return {
    from = from, fixed = sub(data, from, last), last = last,
    lead = lead .. info.parameter(shown), write = nothing,
  }
end

-- The mask of a message with the reference left out; nil where a block is anything but sound values or an
-- error.
local function mask_of(data, blocks, parameters, written)
  if #blocks ~= #parameters then
    return nil
  end
  local parts, at = {}, 2
  for number, block in ipairs(blocks) do
    local lead = number == 1 and ": " or ", "
    if block.error and not written then
      parts[number] = failed_part(data, at, block, lead, parameters[number])
    elseif block.sound_codec and not block.error then
      parts[number] = part_of(data, at, block, lead, parameters[number], written)
    else
      return nil
    end
    at = parts[number].last + 1
  end
  return { parts = parts, count = #parts, from = at, fixed = sub(data, at), more = info.more(#parts) }
end

-- Writes what a message of the length of its mask says of its parameters behind `filled` pieces of a
-- sentence, and tells how many there are then; nil where it does not fit. Looks for bytes in their place,
-- because cutting them out would make strings.
local function listed(mask, frame, front, filled)
  local parts = mask.parts
  for number = 1, mask.count do
    local part = parts[number]
    local from = front + part.from
    if find(frame, part.fixed, from, true) ~= from then
      return nil
    end
    if number <= PARAMETERS_SHOWN then
      pieces[filled + 1], pieces[filled + 2] = part.lead, part.write(part, frame, front)
      filled = filled + 2
    end
  end
  local from = front + mask.from
  if find(frame, mask.fixed, from, true) ~= from then
    return nil
  end
  pieces[filled + 1] = mask.more
  return filled + 1
end

-- Questions: requests without their reference and the values that they write

local Gist = {}
Gist.__index = Gist

--- Knows nothing yet.
-- @param analysis the one whose options, limits and vocabulary count (ds47.analysis)
function M.new(analysis)
  local options = analysis.options
  return setmetatable({
    lang = analysis.lang, codec = analysis.codec, judge = analysis.judge,
    select = options.select, ignore = options.ignore,
    questions = {}, count = 0, -- by what tells them apart (`key_of`)
    reads = {}, -- vendor id or 0 -> the bytes of a request to read, without its reference -> its question
    decode = analysis.records.decode_request,
  }, Gist)
end

local function key_of(data, vendor_id)
  local count = byte(data, 4) or 0
  return sub(data, 2, HEADER + ADDRESS * count) .. #data .. "\0" .. (vendor_id or "")
end

--- The PNUs of a request: an array.
function M.pnus(message)
  local pnus = {}
  for number, address in ipairs(message.addresses) do
    pnus[number] = address.pnu
  end
  return pnus
end

local function has(list, wanted)
  for _, value in ipairs(list) do
    if value == wanted then
      return true
    end
  end
  return false
end

-- A new question; false for a request of which more is to be said than its sentence.
local function new_question(self, data, message, peer)
  local change = message.operation == CHANGE
  local pnus = M.pnus(message)
  if not (change or message.operation == READ) or #message.flaws > 0
    or not change and has(pnus, rules.PNU_ACCESS_IDENTIFICATION) then
    return false
  end
  local parameters = transactions.parameters({ message = message, peer = peer }, self.lang)
  local object = info.drive_object(message.axis)
  local question = {
    change = change, pnus = pnus, peer = peer, object = object,
    before = info.PROTOCOL .. message.operation .. " request ref ",
    answered = info.PROTOCOL .. message.operation .. " response ref ",
    mask = change and mask_of(data, message.blocks, parameters, true) or nil, -- its values
    behind = not change and object .. info.list_of(parameters, false) or nil,
    answers = {}, -- length of an answer -> its mask
    -- Of a change that was done the answer says nothing else.
    done = change and char(tables.request_ids[message.request_id].positive, message.axis,
      message.parameter_count) or nil,
  }
  return (question.behind or question.mask) and question or false
end

function Gist:_question(data, peer)
  local key = key_of(data, peer.vendor_id)
  local question = self.questions[key]
  if question == nil then
    if self.count >= MOST_QUESTIONS then
      self.questions, self.reads, self.count = {}, {}, 0
    end
    question = new_question(self, data, self.decode(data), peer)
    self.questions[key], self.count = question, self.count + 1
  end
  return question
end

-- Reads that ask the same are known by their bytes behind the reference.
function Gist:_read(frame, front, length, peer, last)
  if last and length == last.length and find(frame, last.asks, front + 2, true) == front + 2 then
    return last -- most programs ask the same again
  end
  local reads = self.reads[peer.vendor_id or 0]
  return reads and reads[sub(frame, front + 2, front + length)]
end

function Gist:_remember_read(question, data, peer)
  local vendor_id = peer.vendor_id or 0
  local reads = self.reads[vendor_id] or {}
  question.asks, question.length = sub(data, 2), #data
  self.reads[vendor_id], reads[question.asks] = reads, question
end

local function read_text(question, reference)
  return question.before .. DIGITS[reference] .. question.behind
end

local function change_text(question, frame, front)
  local last = listed(question.mask, frame, front, BEGIN)
  if last then
    pieces[1], pieces[2], pieces[3] = question.before, DIGITS[byte(frame, front + 1)], question.object
    return concat(pieces, "", 1, last)
  end
  return nil
end

--- What a request asks: a question, and the text of its Info column. Nil for an unusual one.
-- A question has: `change`, `pnus` (those that are asked for), `object`
-- (its axis, as a sentence says it).
-- @param frame, front, length  the bytes of its frame, how many stand in front of it, and how many it has
-- @param last  the question that was asked last in this place, if any
function Gist:request(frame, front, length, peer, last)
  local question = self:_read(frame, front, length, peer, last)
  if question then
    return question, read_text(question, byte(frame, front + 1))
  end
  local data = sub(frame, front + 1, front + length)
  question = self:_question(data, peer)
  if not question then
    return nil
  elseif question.change then
    local text = change_text(question, frame, front)
    return text and question, text
  end
  self:_remember_read(question, data, peer)
  return question, read_text(question, byte(data, 1))
end

-- Answers

-- A job with nothing but its own messages and times, as `Judge:answered` takes it.
local function job_of(self, asked, number, data, time_ns)
  local request = sub(asked.frame, asked.front + 1, asked.front + asked.length)
  local message = self.decode(request)
  return setmetatable({
    peer = asked.question.peer, message = message, channel_key = nil,
    record = { request = { frame = asked.number, time_ns = asked.asked_ns, data = request }, spot = "" },
    write_response = { frame = asked.number, time_ns = asked.accepted_ns, status = 0 },
    read_request = { frame = number, time_ns = asked.fetched_ns },
    read_response = { frame = number, time_ns = time_ns, data = data, status = 0 },
    response = parameter.decode_response(data, message, self.codec),
  }, pairing.Job)
end

-- What is to be said of an answer on its own frame: findings as `Analysis:findings_at` gives them; and the
-- remarks about the job, wanted or not.
local function judged(self, job, frame)
  local judge = rules.new(self.judge.limits, self.judge.slow_ns)
  local found, remarks = findings.new(self.select, self.ignore), judge:answered(job)
  found:foresee(remarks)
  return found:at(frame), remarks
end

-- The same findings, on another frame.
local function on_frame(found, frame)
  local list = {}
  for number, finding in ipairs(found) do
    local copy = {}
    for key, value in pairs(finding) do
      copy[key] = value
    end
    copy.frame, copy.frames = frame, {frame}
    list[number] = copy
  end
  return list
end

local function sentence(job, parameters)
  local message = job.message
  return info.text({{
    role = "read_response", message = message, response = job.response, parameters = parameters,
    item = {
      operation = message.operation, request_reference = message.request_reference, axis = message.axis,
    },
  }})
end

-- Remembers an answer, if those that differ in their values alone are told alike: nothing was to be said of
-- it, or only that parameters failed.
local function remember_answer(question, data, job, text, parameters, remarks, found)
  for _, remark in ipairs(remarks) do
    if remark.rule ~= PARAMETER_FAILED then
      return
    end
  end
  local mask = mask_of(data, job.response.blocks, parameters, false)
  if mask and #remarks > 0 then -- its sentence begins with what became of it, without a reference
    mask.begin, mask.found = sub(text, 1, #text - #info.list_of(parameters, false)), found
  end
  question.answers[#data] = mask
end

-- The Info column of an answer that differs from earlier ones in nothing but its values, and the findings
-- that are the same; nil for all others.
local function usual_answer(asked, number, frame, front, length)
  local question = asked.question
  local mask, done, last = question.answers[length], question.done, nil
  if mask then
    last = listed(mask, frame, front, BEGIN)
  elseif done and length == #done + 1 and find(frame, done, front + 2, true) == front + 2 then
    last = listed(question.mask, asked.frame, asked.front, BEGIN)
  end
  if last == nil then
    return nil
  elseif mask and mask.begin then
    pieces[1], pieces[2], pieces[3] = mask.begin, "", ""
    return concat(pieces, "", 1, last), on_frame(mask.found, number)
  end
  pieces[1], pieces[2], pieces[3] = question.answered, DIGITS[byte(frame, front + 1)], question.object
  return concat(pieces, "", 1, last), NONE
end

--- The Info column of an answer, and what is to be said of it: an array of findings.
-- @param asked  the request: {question, number, frame, front, length, asked_ns, accepted_ns, fetched_ns}
-- @param number, time_ns  of the answer, whose reference is that of the request
-- @param frame, front, length  as for `request`
-- @param slow   whether the drive took long: then it is judged with care
function Gist:answer(asked, number, time_ns, frame, front, length, slow)
  if not slow then
    local text, found = usual_answer(asked, number, frame, front, length)
    if text then
      return text, found
    end
  end
  local data = sub(frame, front + 1, front + length)
  local question, job = asked.question, job_of(self, asked, number, data, time_ns)
  local found, remarks = judged(self, job, number)
  local parameters = transactions.parameters(job, self.lang)
  local text = sentence(job, parameters)
  if not slow and not question.change then
    remember_answer(question, data, job, text, parameters, remarks, found)
  end
  return text, found
end

return M
