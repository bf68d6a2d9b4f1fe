-- Which record calls are ours (docs/pairing.md, "Which records are ours", P19 to P23).
--
-- 0xB02E, 0xB02F and the indices a user names always are. Index 47 belongs to whoever made the module, and
-- devices that are no drives keep values there: what comes on it waits here until that AR proves to use the
-- parameter channel; then all of it, in its order, goes on.
--
-- An AR is named by a key, which records.lua makes: controller, device, AR UUID (nil UUID for ReadImplicit).
--
-- An event is any table; whoever hands it in runs it (`runner:run(event)`). Where nothing has to wait no
-- event is made at all: ask `passes` first.

local flat = require("ds47.support.flat").copy
local ordered = require("ds47.support.ordered")
local parameter = require("ds47.profidrive.parameter")
local records = require("ds47.profinet.records")
local tables = require("ds47.spec.tables")

local M = {}

local SHARED_INDEX = 47
local ALWAYS = {[0xB02E] = true, [0xB02F] = true}
local PROFIDRIVE_API = tables.layouts.RECORD_PROFIDRIVE_API
M.SHARED_INDEX, M.ALWAYS = SHARED_INDEX, ALWAYS

-- The response ids from here on are those of requests that were not done.
local NEGATIVE = 0x80
-- Bytes of a message that a request and its response may have in common.
local HEADER = 4
-- Writes of a place that a Read of it may bring: the newest may be refused, or under way.
local SENT = 4
-- Unknown attribute, PNU 0.
local ADDRESSLESS = {DS305 = true, DS306 = true}

--- Whether a request is one by itself (P20): it decodes to its end, with known attributes and PNUs.
function M.is_question(request)
  return request.shaped and not parameter.has_one_of(request.flaws, ADDRESSLESS)
end

-- Whether a record was written, in another length too; behind the header no response is what was asked.
local function is_echo(written, data)
  for _, sent in ipairs(written or {}) do
    local both = math.min(#sent, #data)
    if data == sent or both > HEADER and data:sub(1, both) == sent:sub(1, both) then return true end
  end
  return false
end

local Index47 = {}
Index47.__index = Index47
M.Index47 = Index47

--- Holds events of index 47 back until their AR has proved itself.
-- @param extra set of record indices that are ours whatever they hold, {[index] = true}; nil for none
-- @param waiting how many events of one AR, and how many ARs, may wait; the oldest goes first
-- @param forbid_47 true when index 47 is never ours, also where `extra` names it
-- @param waiting_ars how many times as many events may wait of all ARs together; nil (here and below) for the
--   shipped limit
-- @param proven how many ARs that have proved themselves are remembered; the one that spoke last goes last
function Index47.new(extra, waiting, forbid_47, waiting_ars, proven)
  local always = {}
  for index, wanted in pairs(extra or {}) do always[index] = wanted or nil end
  for index in pairs(ALWAYS) do always[index] = true end
  if forbid_47 then always[SHARED_INDEX] = nil end
  local concerned = flat(always)
  concerned[SHARED_INDEX] = not forbid_47 or nil
  return setmetatable({
    concerned = concerned, -- set of the record indices that can be ours at all
    always = always, waiting = waiting,
    most_events = waiting * (waiting_ars or tables.limits.waiting_ars),
    most_open = proven or tables.limits.proven_ars,
    open = ordered.new(), held = ordered.new(), events = 0,
    drives = ordered.new(), -- submodules that have responded at 0xB02E or 0xB02F; false: a store at 47
    sent = ordered.new(), -- the bytes of the newest Writes of a submodule, whoever waits that wrote them
    left = ordered.new(), -- of ARs that do not wait any more, by device, as `unproven` gives it
  }, Index47)
end

--- Whether anything waits that was asked of a device, perhaps a change of a parameter.
function Index47:waits(device)
  for ar, held in self.held:iterate() do
    if not held.question and records.device_of(ar) == device then return true end
  end
  return false
end

--- Whether what comes on a record of this AR and index runs now, and does not wait (only).
function Index47:is_open(ar, index)
  local held = self.held.values[ar]
  local runs = self.always[index] or self.open.values[ar] or held and held.question
  return self.concerned[index] and runs or false
end

--- Whether an event may run now; the AR has spoken then. Another one proves its AR (`prove`), or waits
-- (`pass_on`).
function Index47:passes(ar, index)
  local open = self.open
  if open.newest == ar then return true end -- it spoke last
  if open.values[ar] then
    open:move_to_end(ar)
    return true
  end
  return self.always[index] or false
end

-- Runs, through `runner`, what waits of an AR.
local function run_all(self, held, runner)
  local waiting = self.waiting
  for number = math.max(0, held.count - waiting), held.count - 1 do runner:run(held[number % waiting + 1]) end
end

--- Keeps an event until something proves the same AR; for good if nothing does.
-- @param asks  whether it is a question, which proves its AR until a Read shows a store; what waited runs
-- @return whether a question proves the AR, so that the event runs all the same
function Index47:pass_on(ar, event, asks, runner)
  local held = self.held:get(ar)
  if not held then
    -- A ring: slot count % waiting takes the next one. `asked`: the newest Write of each place; `question`:
    -- one proves the AR; `stores`: none does, as it wrote to a store; `records`: requests (`asks`: there are
    -- some), and responses without a request; `first`: the frame of the first one.
    held = {count = 0, asked = ordered.new(), records = 0}
    self.held:set(ar, held)
  end
  if asks and not (held.question or held.stores) then
    held.question = true
    run_all(self, held, runner)
  end
  local runs = held.question
  self:follow(ar, event)
  return runs
end

local function submodule(device, api, place)
  return api .. "\0" .. place.slot * 65536 + place.subslot .. "\0" .. device
end

--- A record was read at 0xB02E or 0xB02F: with the shape of a response its submodule is that of a drive.
function Index47:responded(device, place, data, codec)
  local name = submodule(device, place.api, place)
  if not self.drives.values[name] and parameter.decode_response(data, nil, codec).shaped then
    self.drives:keep(name, true, self.most_open)
  end
end

--- Whether a place is that of a drive, whoever asks there: under the API of PROFIdrive, or it responded.
function Index47:is_of_drive(device, place)
  local drives = self.drives.values
  return place.api == PROFIDRIVE_API or drives[submodule(device, place.api, place)]
    or drives[submodule(device, PROFIDRIVE_API, place)] or false
end

--- A record waits now: a request, or a response without one.
-- @param asks  whether it is a request
function Index47:heard(ar, frame, asks)
  local held = self.held:get(ar)
  if held then
    held.first = held.first or frame
    held.records, held.asks = held.records + 1, held.asks or asks
  end
end

--- A response that was heard has a request after all, which is heard next.
function Index47:unheard(ar)
  local held = self.held:get(ar)
  if held then held.records = held.records - 1 end
end

--- A Write waits: a response that mirrors it is to prove that it is a request.
function Index47:asked(ar, place, request, data)
  local held, spot = self.held:get(ar), submodule(records.device_of(ar), place.api, place)
  if held then
    held.asked:pop(spot)
    held.asked:keep(spot, request, self.waiting)
    held.stores = held.stores or self.drives.values[spot] == false
    local sent = self.sent:get(spot) or {}
    table.insert(sent, 1, data)
    sent[SENT + 1] = nil
    self.sent:keep(spot, sent, self.waiting)
  end
end

--- Whether a Write is a question, as far as its place is no store.
function Index47:asks(device, place, request)
  return M.is_question(request) and self.drives.values[submodule(device, place.api, place)] ~= false
end

--- A Read brought a record: if it is what was written once more, the ARs that a question proved (P20).
-- Whoever wrote: a store has one for all. A question proves none of those who wrote there any more.
function Index47:echoed(ar, place, data)
  local spot, gone = submodule(records.device_of(ar), place.api, place), {}
  if not is_echo(self.sent:get(spot), data) then return nil end
  local known = self.drives.values[spot] == false
  self.drives:keep(spot, false, self.most_open)
  for each, held in self.held:iterate() do
    if held.asked:get(spot) and (each == ar or not known) then
      gone[#gone + 1] = held.question and each or nil
      held.stores, held.question = true, false
    end
  end
  return gone
end

--- Whether a record, which is not the same bytes once more, is the response to the Write that waits (P20).
function Index47:answers(ar, place, data, codec)
  local held = self.held:get(ar)
  local request = held and held.asked:get(submodule(records.device_of(ar), place.api, place))
  if not request then return false end
  if request.operation == "unknown" or not (request.addresses[1] and parameter.kind_fits(request, data)) then
    return false
  end
  local refuses = data:byte(2) >= NEGATIVE -- it may be what lacks bytes that is refused
  return data:byte(1) == request.request_reference and (refuses or request.shaped)
    and parameter.decode_response(data, request, codec).shaped
end

-- What waits of an AR will not be ours: its records are added to those of its device.
local function leave(left, ar, held, most)
  if held.records > 0 then
    local device = records.device_of(ar)
    local before = left:get(device) or {first = held.first, count = 0}
    left:keep(device, {
      device = device, first = math.min(before.first, held.first), count = before.count + held.records,
      asks = before.asks or held.asks,
    }, most)
  end
end

--- Each device of which no AR has proved itself, if nothing more comes: array of {device, first, count,
-- asks}.
function Index47:unproven()
  local found, drives, result = ordered.new(), {}, {}
  for device, told in self.left:iterate() do found:set(device, told) end
  for ar, held in self.held:iterate() do
    if held.question then
      drives[records.device_of(ar)] = true
    else
      leave(found, ar, held, self.most_open)
    end
  end
  for ar in self.open:iterate() do drives[records.device_of(ar) or ""] = true end
  for device, told in found:iterate() do
    if not drives[device] then result[#result + 1] = told end
  end
  return result
end

--- Lets an event wait behind those that wait for an AR; where none does, it is not needed.
function Index47:follow(ar, event)
  local waiting, held = self.waiting, self.held:get(ar)
  if not held then return end
  if held.question and held.count >= waiting then
    self:prove(ar) -- it need not wait any longer
    return
  elseif held.count < waiting then
    self.events = self.events + 1
  end
  held[held.count % waiting + 1] = event
  held.count = held.count + 1
  while self.held.length > waiting or self.events > self.most_events do
    local ar_of_oldest, oldest = self.held:first()
    if oldest.question then
      self:prove(ar_of_oldest)
    else
      self.held:pop(ar_of_oldest)
      self.events = self.events - math.min(oldest.count, waiting)
      leave(self.left, ar_of_oldest, oldest, self.most_open)
    end
  end
end

--- An AR has proved itself: what waited for it runs, through `runner`.
function Index47:prove(ar, runner)
  self.open:set(ar, true)
  if self.open.length > self.most_open then self.open:pop_first() end
  local held = self.held:pop(ar)
  if held then
    self.events = self.events - math.min(held.count, self.waiting)
    if not held.question then run_all(self, held, runner) end -- else they ran
  end
end

return M
