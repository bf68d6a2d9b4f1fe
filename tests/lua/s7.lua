-- Bytes of S7 under plain Lua, for a comparison with Python (tests/python/test_lua_s7.py). Reads a JSON
-- object a line and writes one or more for each. Its `kind` says what it is:
--   pdu      {data, answer}: a PDU in hexadecimal digits, and one that answers it; prints all that it says
--   tpdu     {data}: the payload of a TPKT
--   begin    {ports, most, most_bytes}: from here on other connections
--   segment  {source, destination, payload, missing, frame}: the payload of an IP packet; prints the pieces
--            that are in order with it, what is whole in them, and which connections are over
--   end      nothing more comes
--   question  {read, others, before, foreign}: accesses to a memory, what is known from before (at -> value),
--            bytes that somebody else writes; prints the two bytes that never were there together

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. package.path

local consistency = require("ds47.s7.consistency")
local json = require("ds47.support.json")
local memory = require("ds47.s7.memory")
local pdus = require("ds47.s7.pdu")
local reader = require("ds47.support.bytes")
local spans = require("ds47.support.spans")
local tcp = require("ds47.s7.tcp")
local tpkt = require("ds47.s7.tpkt")
local words = require("ds47.spec.s7")

local hex, unhex = reader.hex, reader.unhex

local function or_null(value)
  if value == nil then return json.null end
  return value
end

local function hex_or_null(value)
  return value and hex(value) or json.null
end

local function mapped(items, change)
  local found = json.array({})
  for i, item in ipairs(items) do found[i] = change(item) end
  return found
end

local function flaws(items)
  return mapped(items, function(flaw)
    return {
      kind = flaw.kind, offset = flaw.offset, text = words.flaw_text(flaw, "en"),
      zh = words.flaw_text(flaw, "zh"),
    }
  end)
end

local function address(found)
  if not found then return json.null end
  return {
    area = found.area, db = found.db, start = found.start, size = found.size, count = found.count,
    transport = found.transport, last = found:last(), length = found:length(),
  }
end

local function items(found)
  return mapped(found, function(item)
    return {
      address = address(item.address), value = hex_or_null(item.value), code = or_null(item.code),
      syntax = or_null(item.syntax),
    }
  end)
end

local function results(found)
  return mapped(found, function(item) return {code = item.code, data = hex_or_null(item.data)} end)
end

local function user_data(pdu)
  local told = pdus.user_data(pdu)
  if not told then return json.null end
  local part = pdus.segment(pdu, told)
  if part then part.data, part.total = hex(part.data), or_null(part.total) end
  told.content, told.segment = hex(told.content), or_null(part)
  return told
end

local function usend(pdu)
  local sent = pdus.usend(pdu)
  return sent and {r_id = sent.r_id, areas = mapped(sent.areas, hex)} or json.null
end

local function document(data)
  local pdu = pdus.decode(data)
  local found = {
    data = hex(pdu.data), kind = or_null(pdu.kind), reference = pdu.reference, parameter = hex(pdu.parameter),
    content = hex(pdu.content), error = or_null(pdu.error), size = pdu.size, head = pdu.head,
    content_at = pdu.content_at, service = or_null(pdu.service), setup = or_null(pdus.setup(pdu)),
    user_data = user_data(pdu), usend = usend(pdu),
  }
  found.flaws = flaws(pdu.flaws)
  if pdu.error then found.error_text = {words.error_text(pdu.error), words.error_text(pdu.error, "zh")} end
  return found
end

-- A request, and what its answer says of it.
local function job(request, answer)
  local asked, told = pdus.decode(request), pdus.decode(answer)
  local found = pdus.variables(asked)
  local each = {request = items(found.items), groups = mapped(found.groups, function(item) return item end)}
  local values = pdus.results(told)
  each.results, each.answer_flaws = results(values), flaws(told.flaws)
  each.settled, each.request_flaws = flaws(pdus.settle(found, values)), flaws(asked.flaws)
  each.items = items(found.items)
  return each
end

local function told_tpdu(tpdu)
  return {
    kind = or_null(tpdu.kind), data = hex(tpdu.data), last = tpdu.last, calling = hex_or_null(tpdu.calling),
    called = hex_or_null(tpdu.called), size = or_null(tpdu.size), reason = or_null(tpdu.reason),
    flaws = flaws(tpdu.flaws),
  }
end

local tell = {}

function tell:take(talk, from_client, piece)
  talk.owner = talk.owner or {[true] = tpkt.Reader.new(), [false] = tpkt.Reader.new()}
  local own = talk.owner[from_client]
  local wholes = mapped(own:take(piece), function(whole)
    return {
      tpdu = told_tpdu(whole.tpdu), data = hex(whole.data), frame = whole.at.frame,
      late = whole.late or false,
    }
  end)
  talk.kept = talk.owner[true]:held() + talk.owner[false]:held()
  print(json.encode({
    client = talk.client, server = talk.server, from_client = from_client, data = hex(piece.data),
    frame = piece.at.frame, lost = piece.lost or 0, late = piece.late or false, whole = wholes,
    lost_of_reader = own.lost, synced = own.synced, kept = talk.kept,
  }))
end

function tell:talk_over(talk, reset, at)
  print(json.encode({client = talk.client, server = talk.server, over = at.frame, reset = reset}))
end

local take, streams = {}, nil

function take.pdu(line)
  local data, answer = unhex(line.data), unhex(line.answer)
  print(json.encode({pdu = document(data), job = job(data, answer)}))
end

function take.tpdu(line)
  print(json.encode(told_tpdu(tpkt.decode(unhex(line.data), 4))))
end

function take.begin(line)
  local ports = {}
  for _, port in ipairs(line.ports) do ports[port] = true end
  streams = tcp.Streams.new(ports, tell, line.most, line.most_bytes)
end

function take.segment(line)
  local segment = tcp.parse(line.source, line.destination, unhex(line.payload), line.missing)
  if segment then streams:feed(segment, {frame = line.frame, time_ns = line.frame}) end
end

local function accesses(list)
  for _, each in ipairs(list) do
    each.data = unhex(each.data)
    each.last = each.start + #each.data
    if each.answered_ns == json.null then each.answered_ns = nil end
  end
  return list
end

function take.question(line)
  local before = memory.new(1).before
  for _, each in ipairs(line.before) do
    before:put({start = each[1], last = each[1] + 1, data = string.char(each[2])})
  end
  local asked = consistency.new(accesses(line.read), accesses(line.others), before, spans.of(line.foreign))
  local first, second = asked:mixed()
  print(json.encode({mixed = first and json.array({first, second}) or json.null, steps = asked.steps}))
end

take["end"] = function()
  streams:finish()
  print(json.encode({held = streams.held}))
end

for text in io.lines() do
  local line = json.decode(text)
  take[line.kind](line)
end
