-- Reads and writes of records by MS1 and MS2, from the exchanges of a line (docs/profibus.md 6).
--
-- A service is asked once and polled until its answer is there: SC, no data and empty answers say that it
-- is not. What is asked of a record, and what "not ready" (B5) means for it, is not here: every DS_Read is a
-- call of its own.
--
-- A call is a DS_Read or DS_Write with its answer:
--   master, station  who asks whom
--   sap              that of the slave: 51 for MS1
--   record           what the pairing takes, as profinet/records.lua has it; `record.response.status` is 0 or
--                    that of the refusal, `record.ar` is empty
--   fault            the function code that refused it below MS1: 3 where the SAP is not enabled; else nil

local dp = require("ds47.profibus.dp")
local entries = require("ds47.support.later").entries
local ms1 = require("ds47.profibus.ms1")
local ordered = require("ds47.support.ordered")
local records = require("ds47.profinet.records")

local floor = math.floor

-- Calls without an answer that are kept: eight for each station that a line can have.
local M = {MOST_OPEN = 1024}

-- The function that keeps a connection of MS2 alive: no service, and no answer to one.
local IDLE = "idle"
local CARRIES_RECORDS = {record = true, ms2 = true}
local MOST_PLACES = 4096

local CallTracker = {}
CallTracker.__index = CallTracker
M.CallTracker = CallTracker

--- Takes the exchanges of a line and tells of the calls in them.
-- @param handlers a table with methods, who hear what becomes of a call in the order of the capture:
--   asked(call); answered(call), positive or negative; failed(call), when the station refused it before MS1
--   (`fault`; `record.response` has the place alone); lost(call), when another service began, or nothing came
--   any more, or it is the oldest of too many; and unasked(call), an answer without its request. One that is
--   negative says neither slot nor index: nobody hears of it
function CallTracker.new(handlers)
  return setmetatable({
    handlers = handlers,
    open = ordered.new(), -- master, station and SAP -> the call that has no answer yet
    begun = nil, -- the exchange whose request was heard of already
  }, CallTracker)
end

-- What calls are found by; nil for an exchange of other services than MS1 and MS2, which says nothing here.
local function key_of(exchange)
  local item = exchange.request.item
  if not item.request or not CARRIES_RECORDS[dp.service(item)] then return nil end
  return (item.sa * 0x100 + item.da) * 0x100 + item.dsap
end

--- The request of an exchange, which may be heard of before its answer: Wireshark shows a frame when it
-- comes.
function CallTracker:begin(exchange)
  local key = key_of(exchange)
  if not key then return end
  self.begun = exchange
  local asked = ms1.decode(exchange.request.item.du, true)
  if asked.kind == "request" and asked.name ~= IDLE and not exchange.again then
    self:_asked(key, asked, exchange)
  end
end

--- An exchange that is over.
function CallTracker:take(exchange)
  local key = key_of(exchange)
  if not key then return end
  if self.begun ~= exchange then self:begin(exchange) end
  self.begun = nil
  self:_answer(key, exchange)
end

--- The calls without an answer, oldest first.
function CallTracker:unanswered()
  local found = {}
  for _, call in self.open:iterate() do found[#found + 1] = call end
  return found
end

-- Places of records: PROFIBUS has neither AR nor API nor subslot.
local places = entries(function(key)
  return records.place({
    write = key >= 0x10000, implicit = false, ar = records.NIL_UUID, api = records.NO_API,
    slot = floor(key / 0x100) % 0x100, subslot = 0, index = key % 0x100, position = 0,
  })
end, MOST_PLACES)

-- That of a refusal; error bytes that a short one does not have are 0, as it refuses without them, too.
local function status_of(refusal)
  local status = refusal.code * 0x100 + (refusal.error_decode or 0)
  return (status * 0x100 + (refusal.error_code_1 or 0)) * 0x100 + (refusal.error_code_2 or 0)
end

-- A message as one half of a record call. A DS_Read carries nothing, and says how much it wants; the answer
-- to a DS_Write repeats its length, and carries nothing either.
local function half_of(seen, message)
  if message.kind == "refusal" then return records.half(seen.frame, seen.time_ns, status_of(message)) end
  local asked, stated = message.kind == "request", message.length or 0
  local half = records.half(seen.frame, seen.time_ns, not asked and 0 or nil)
  if (message.code == ms1.WRITE) == asked then
    local missing = stated - #message.data -- never below 0: ms1.lua takes no more than is stated
    half.data, half.stated, half.missing = message.data, stated, missing > 0 and missing or nil
  elseif asked then
    half.stated = stated
  end
  return half
end

-- A call, with the request or the answer.
local function new_call(exchange, message, request, response)
  local write = message.name == "write"
  local item = exchange.request.item
  return {
    master = item.sa, station = item.da, sap = item.dsap, fault = nil,
    record = records.record(
      places[(write and 0x10000 or 0) + message.slot * 0x100 + message.index], request, response),
  }
end

-- Whether an answer is one to a request; a refusal names no place. Else the request it is to was not seen.
local function is_of(record, answer)
  local same = not answer.slot or answer.slot == record.slot and answer.index == record.index
  return same and record.write == (answer.name == "write")
end

-- Whether a refusal, which names no place, may be for a request that was not seen.
local function may_be_of_another(call, exchange, answer)
  local refuses = dp.refuses(exchange.answer.item) or answer.kind == "refusal"
  return refuses and exchange.hole > call.record.request.frame
end

function CallTracker:_asked(key, asked, exchange)
  self:_lose(key)
  if asked.code ~= ms1.READ and asked.code ~= ms1.WRITE or not asked.slot or not asked.index then return end
  local call = new_call(exchange, asked, half_of(exchange.request, asked))
  self.open:set(key, call)
  self.handlers:asked(call)
  if self.open.length > M.MOST_OPEN then self:_lose(self.open:first()) end
end

function CallTracker:_answer(key, exchange)
  local seen, call = exchange.answer, self.open:get(key)
  local answer = seen and ms1.decode(seen.item.du, false)
  if call and seen and may_be_of_another(call, exchange, answer) then
    self:_lose(key)
    return
  end
  if call and seen and dp.refuses(seen.item) then
    call.fault = seen.item.code
    call.record.response = records.half(seen.frame, seen.time_ns)
    self.open:pop(key)
    self.handlers:failed(call)
    return
  end
  if not answer or answer.kind == "taken" or answer.name == IDLE then return end -- not there yet
  if answer.name ~= "read" and answer.name ~= "write" then
    self:_lose(key)
  elseif call and is_of(call.record, answer) then
    self.open:pop(key)
    call.record.response = half_of(seen, answer)
    self.handlers:answered(call)
  elseif not exchange.again and answer.slot and answer.index then
    self:_lose(key)
    self.handlers:unasked(new_call(exchange, answer, nil, half_of(seen, answer)))
  end
end

function CallTracker:_lose(key)
  local call = self.open:pop(key)
  if call then self.handlers:lost(call) end
end

return M
