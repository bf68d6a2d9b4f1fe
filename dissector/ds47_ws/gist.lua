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

local byte, char, concat, format, sub = string.byte, string.char, table.concat, string.format, string.sub

local M = {}

local HEADER, ADDRESS = 4, 6 -- bytes of a message in front of its addresses, and of each of them
local MOST_QUESTIONS = 1024
local NONE = {}
local CHANGE, READ = "change", "read"

-- Numbers as report_words.lua writes them, straight from their bytes

-- Most whole numbers are small, and come again.
local decimals = {}

local function decimal(number)
  local text = decimals[number]
  if text == nil then
    text = format("%.0f", number)
    if number < 65536 and number >= -32768 then
      decimals[number] = text
    end
  end
  return text
end

local writers = {} -- letter of a codec -> a function of the bytes of one value

local function writer(bits, signed)
  local half, range = 2 ^ (bits - 1), signed and 2 ^ bits or 0
  return function(raw)
    local a, b, c, d = byte(raw, 1, 4)
    local number = d and ((a * 256 + b) * 256 + c) * 256 + d or b and a * 256 + b or a
    return decimal(number >= half and number - range or number)
  end
end

writers.B, writers.H, writers.I = writer(8, false), writer(16, false), writer(32, false)
writers.b, writers.h, writers.i = writer(8, true), writer(16, true), writer(32, true)

function writers.f(raw)
  return numbers.float32_text(raw, 0)
end

local some = {}

-- The same for a list of values.
local function list_writer(write, size, count)
  return function(raw)
    for number = 1, count do
      some[number] = write(sub(raw, (number - 1) * size + 1, number * size))
    end
    return concat(some, ", ", 1, count)
  end
end

-- Masks

-- A block of a mask: `fixed` are the bytes from `from` on, up to its values.
local function part_of(data, from, block, shown, written)
  local codec, first, count = block.sound_codec, block.offset + 3, block.value_count
  local write = writers[codec.pack]
  if write and count > 1 then
    write = count <= words.VALUES_SHOWN and list_writer(write, codec.size, count) or nil
  end
  return {
    from = from, to = first - 1, fixed = sub(data, from, first - 1),
    first = first, last = first + #block.raw - 1,
    codec = codec, count = count, format = block.format_name,
    class = getmetatable(shown), head = info.address(shown) .. (written and " := " or " = "),
    write = count > 0 and write or nil,
    raw = nil, text = nil, -- what was read last
  }
end

-- The mask of a message with the reference left out; nil where a block is anything but sound values.
local function mask_of(data, blocks, parameters, written)
  if #blocks ~= #parameters then
    return nil
  end
  local parts, at = {}, 2
  for number, block in ipairs(blocks) do
    if block.sound_codec == nil or block.error then
      return nil
    end
    parts[number] = part_of(data, at, block, parameters[number], written)
    at = parts[number].last + 1
  end
  return { parts = parts, from = at, fixed = sub(data, at), written = written }
end

local item = {} -- the parameter whose text is made

-- The text of the parameter with these values.
local function text_of(part, raw, written)
  if part.write then
    return part.head .. part.write(raw)
  end
  local codec = part.codec
  local values = codec.decode(raw, part.count, codec.size)
  item.format, item.values = part.format, values
  item.scaled = codec.scale and codec.scale(values, raw, codec) or nil
  return info.parameter(setmetatable(item, part.class), written)
end

local texts = {}

-- The parameters of a message that fits the mask, as a sentence has them; nil where it does not fit.
local function listed(mask, data)
  local parts = mask.parts
  local count = #parts
  for number = 1, count do
    local part = parts[number]
    if sub(data, part.from, part.to) ~= part.fixed then
      return nil
    end
    if number <= info.PARAMETERS_SHOWN then
      local raw = sub(data, part.first, part.last)
      if raw ~= part.raw then
        part.raw, part.text = raw, text_of(part, raw, mask.written)
      end
      texts[number] = part.text
    end
  end
  if sub(data, mask.from) ~= mask.fixed then
    return nil
  end
  return info.list(texts, count)
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
  local question = {
    change = change, pnus = pnus, peer = peer, axis = message.axis,
    before = info.PROTOCOL .. message.operation .. " request ",
    answered = info.PROTOCOL .. message.operation .. " response ",
    mask = change and mask_of(data, message.blocks, parameters, true) or nil,
    list = not change and info.list_of(parameters, false) or nil, -- of a change its values come from the mask
    answers = {}, -- length of an answer -> its mask
    -- Of a change that was done the answer says nothing else.
    done = change and char(tables.request_ids[message.request_id].positive, message.axis,
      message.parameter_count) or nil,
  }
  return (question.list or question.mask) and question or false
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

--- What a request asks: a question, and the text of its parameters. Nil for an unusual one.
-- A question has: `change`, `pnus` (those that are asked for), `before` and `answered` (how the sentences of
-- the request and of its answer begin), `axis`.
function Gist:request(data, peer)
  local vendor_id = peer.vendor_id or 0
  local reads, behind = self.reads[vendor_id], sub(data, 2)
  local question = reads and reads[behind]
  if question then
    return question, question.list
  end
  question = self:_question(data, peer)
  if not question then
    return nil
  elseif question.change then
    local list = listed(question.mask, data)
    return list and question, list
  end
  reads = self.reads[vendor_id] or {}
  self.reads[vendor_id], reads[behind] = reads, question
  return question, question.list
end

-- Answers

-- A job with nothing but its own messages and times, as `Judge:answered` takes it.
local function job_of(self, asked, frame, data, time_ns)
  local message = self.decode(asked.data)
  return setmetatable({
    peer = asked.question.peer, message = message, channel_key = nil,
    record = { request = { frame = asked.frame, time_ns = asked.asked_ns, data = asked.data }, spot = "" },
    write_response = { frame = asked.frame, time_ns = asked.accepted_ns, status = 0 },
    read_request = { frame = frame, time_ns = asked.fetched_ns },
    read_response = { frame = frame, time_ns = time_ns, data = data, status = 0 },
    response = parameter.decode_response(data, message, self.codec),
  }, pairing.Job)
end

-- What is to be said of an answer on its own frame: findings as `Analysis:findings_at` gives them, and
-- whether there was anything to be said of the job at all, wanted or not.
local function judged(self, job, frame)
  local judge = rules.new(self.judge.limits, self.judge.slow_ns, self.lang)
  local found, remarks = findings.new(self.lang, self.select, self.ignore), judge:answered(job)
  found:foresee(remarks)
  return found:at(frame), #remarks > 0
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

--- The Info column of an answer, and what is to be said of it: an array of findings.
-- @param asked  the request: {question, list, data, frame, asked_ns, accepted_ns, fetched_ns}
-- @param frame, data, time_ns  of the answer, whose reference is that of the request
-- @param slow   whether the drive took long: then it is judged with care
function Gist:answer(asked, frame, data, time_ns, slow)
  local question = asked.question
  if not slow then
    local mask, list = question.answers[#data], nil
    if mask then
      list = listed(mask, data)
    elseif sub(data, 2) == question.done then
      list = asked.list
    end
    if list then
      return question.answered .. info.head(byte(data, 1), question.axis) .. list, NONE
    end
  end
  local job = job_of(self, asked, frame, data, time_ns)
  local found, remarkable = judged(self, job, frame)
  local parameters = transactions.parameters(job, self.lang)
  if not remarkable and not question.change then
    question.answers[#data] = mask_of(data, job.response.blocks, parameters, false)
  end
  return sentence(job, parameters), found
end

return M
