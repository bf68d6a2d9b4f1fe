-- Which record calls are ours (docs/pairing.md, "Which records are ours", P19 to P23).
--
-- Records of 0xB02E, 0xB02F and the indices that a user names are always ours. Index 47 belongs to the maker
-- of the module, and other devices than drives keep values there. So events at index 47 wait here until their
-- AR proves that it uses the parameter channel. Then all of them go on, in their order.
--
-- records.lua makes the key of an AR: controller, device, AR UUID (nil UUID for ReadImplicit).
--
-- An event is any table; the caller runs it (`runner:run(event)`). Ask `passes` first: without waiting no
-- event is made at all.

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

-- Response ids from here on mean that a request failed.
local NEGATIVE = 0x80
-- Bytes that a request and its response may have in common.
local HEADER = 4
-- How many Writes of a place to compare with a Read: the newest may be refused or still pending.
local SENT = 4
-- Unknown attribute, PNU 0.
local ADDRESSLESS = {DS305 = true, DS306 = true}

--- Whether a request is a question (P20): it decodes to its end, with known attributes and no PNU 0.
function M.is_question(request)
  return request.shaped and not parameter.has_one_of(request.flaws, ADDRESSLESS)
end

-- Whether a Read returns what was written, perhaps with another length: it agrees beyond the header.
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
-- @param extra set of further record indices that are always ours, {[index] = true}; nil for none
-- @param waiting how many events of one AR, and how many ARs, may wait; the oldest is dropped first
-- @param forbid_47 true if index 47 is never ours, even if `extra` names it
-- @param waiting_ars all ARs together may have this many times `waiting` events; nil (here and below) for the
--   shipped limit
-- @param proven how many proven ARs to remember; the least recent one is forgotten first
function Index47.new(extra, waiting, forbid_47, waiting_ars, proven)
  local always = {}
  for index, wanted in pairs(extra or {}) do always[index] = wanted or nil end
  for index in pairs(ALWAYS) do always[index] = true end
  if forbid_47 then always[SHARED_INDEX] = nil end
  local concerned = flat(always)
  concerned[SHARED_INDEX] = not forbid_47 or nil
  return setmetatable({
    concerned = concerned, -- set of the record indices that can be ours
    always = always, waiting = waiting,
    most_events = waiting * (waiting_ars or tables.limits.waiting_ars),
    most_open = proven or tables.limits.proven_ars,
    open = ordered.new(), held = ordered.new(), events = 0,
    drives = ordered.new(), -- submodules that have responded at 0xB02E or 0xB02F; false: a store at 47
    sent = ordered.new(), -- the bytes of the newest Writes to a submodule, from any AR that waits
    left = ordered.new(), -- device -> what `unproven` gives, for ARs that no longer wait
  }, Index47)
end

--- Whether events of a device wait: they may include a change of a parameter.
function Index47:waits(device)
  for ar, held in self.held:iterate() do
    if not held.question and records.device_of(ar) == device then return true end
  end
  return false
end

--- Whether an event of this AR and index runs now, even if it also waits.
function Index47:is_open(ar, index)
  local held = self.held.values[ar]
  local runs = self.always[index] or self.open.values[ar] or held and held.question
  return self.concerned[index] and runs or false
end

--- Whether an event may run now. Notes that the AR is in use. Another event proves its AR (`prove`), or waits
-- (`pass_on`).
function Index47:passes(ar, index)
  local open = self.open
  if open.newest == ar then return true end -- already the newest
  if open.values[ar] then
    open:move_to_end(ar)
    return true
  end
  return self.always[index] or false
end

-- Runs the waiting events of an AR through `runner`.
local function run_all(self, held, runner)
  local waiting = self.waiting
  for number = math.max(0, held.count - waiting), held.count - 1 do runner:run(held[number % waiting + 1]) end
end

--- Lets an event wait until something proves its AR.
-- @param asks  whether it is a question: then the events of the AR run now, and also wait for a proof
-- @return whether the AR has sent a question, so that the event runs now
function Index47:pass_on(ar, event, asks, runner)
  local held = self.held:get(ar)
  if not held then
    -- A ring: slot count % waiting takes the next event. `asked`: the newest Write of each place; `question`:
    -- the AR has sent one; `stores`: it wrote to a store, so that a question proves nothing; `records`: how
    -- many requests and responses without a request; `asks`: there was a request; `first`: the first frame.
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

--- A record was read at 0xB02E or 0xB02F: if it looks like a response, the submodule belongs to a drive.
function Index47:responded(device, place, data, codec)
  local name = submodule(device, place.api, place)
  if not self.drives.values[name] and parameter.decode_response(data, nil, codec).shaped then
    self.drives:keep(name, true, self.most_open)
  end
end

--- Whether a place is a drive's: it is in the API of PROFIdrive, or has responded.
function Index47:is_of_drive(device, place)
  local drives = self.drives.values
  return place.api == PROFIDRIVE_API or drives[submodule(device, place.api, place)]
    or drives[submodule(device, PROFIDRIVE_API, place)] or false
end

--- Counts a record that waits: a request, or a response without one.
-- @param asks  whether it is a request
function Index47:heard(ar, frame, asks)
  local held = self.held:get(ar)
  if held then
    held.first = held.first or frame
    held.records, held.asks = held.records + 1, held.asks or asks
  end
end

--- A counted response has a request after all, which is counted next.
function Index47:unheard(ar)
  local held = self.held:get(ar)
  if held then held.records = held.records - 1 end
end

--- A Write waits: a matching response will prove that it is a parameter request.
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

--- Whether a Write is a question, and its place is not known as a store.
function Index47:is_question_here(device, place, request)
  return M.is_question(request) and self.drives.values[submodule(device, place.api, place)] ~= false
end

--- A Read brought a record. If that only returns what was written: the ARs with a question (P20), else nil.
-- It does not matter who wrote: all share one store. From now on a question proves no AR that wrote there.
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

--- Whether a record that is no echo is the response to the waiting Write (P20).
function Index47:answers(ar, place, data, codec)
  local held = self.held:get(ar)
  local request = held and held.asked:get(submodule(records.device_of(ar), place.api, place))
  if not request then return false end
  if request.operation == "unknown" or not (request.addresses[1] and parameter.kind_fits(request, data)) then
    return false
  end
  local refuses = data:byte(2) >= NEGATIVE -- the reason may be that bytes are missing
  return data:byte(1) == request.request_reference and (refuses or request.shaped)
    and parameter.decode_response(data, request, codec).shaped
end

-- The events of an AR do not wait any longer, and are not ours: counts its records for its device.
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

--- Each device without a proven AR, if nothing more comes: array of {device, first, count, asks}.
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

--- Lets an event wait behind the others of its AR; drops it if none waits.
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

--- An AR has proved itself: its waiting events run through `runner`.
function Index47:prove(ar, runner)
  self.open:set(ar, true)
  if self.open.length > self.most_open then self.open:pop_first() end
  local held = self.held:pop(ar)
  if held then
    self.events = self.events - math.min(held.count, self.waiting)
    if not held.question then run_all(self, held, runner) end -- else they ran already
  end
end

return M
