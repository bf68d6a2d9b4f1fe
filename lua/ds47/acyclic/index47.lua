-- Which record calls are ours (docs/pairing.md, "Which records are ours", P19 to P23).
--
-- 0xB02E, 0xB02F and the indices a user names always are. Index 47 belongs to whoever made the module: what
-- comes on it waits here until one message of that AR has the shape of the parameter channel; then all of
-- it, in its order, goes on.
--
-- An AR is named by a key, which records.lua makes: controller, device, AR UUID (nil UUID for ReadImplicit).
--
-- An event is any table; whoever hands it in runs it (`runner:run(event)`). Where nothing has to wait no
-- event is made at all: ask `admit` first.

local ordered = require("ds47.support.ordered")
local records = require("ds47.profinet.records")
local tables = require("ds47.spec.tables")

local M = {}

local SHARED_INDEX = 47
local ALWAYS = {0xB02E, 0xB02F}
M.SHARED_INDEX = SHARED_INDEX

local Gate = {}
Gate.__index = Gate
M.Gate = Gate

--- Holds events of index 47 back until their AR has proved itself.
-- @param extra set of record indices that are ours whatever they hold, {[index] = true}; nil for none
-- @param waiting how many events of one AR, and how many ARs, may wait; the oldest goes first
-- @param forbid_47 true when index 47 is never ours, also where `extra` names it
-- @param waiting_ars how many times as many events may wait of all ARs together; nil (here and below) for the
--   shipped limit
-- @param proven how many ARs that have proved themselves are remembered; the one that spoke last goes last
function Gate.new(extra, waiting, forbid_47, waiting_ars, proven)
  local always = {}
  for index, wanted in pairs(extra or {}) do
    always[index] = wanted or nil
  end
  for _, index in ipairs(ALWAYS) do
    always[index] = true
  end
  if forbid_47 then
    always[SHARED_INDEX] = nil
  end
  local ours = {}
  for index in pairs(always) do
    ours[index] = true
  end
  ours[SHARED_INDEX] = not forbid_47 or nil
  return setmetatable({
    ours = ours, -- set of the record indices that can be ours at all
    always = always, waiting = waiting,
    most_events = waiting * (waiting_ars or tables.limits.waiting_ars),
    most_open = proven or tables.limits.proven_ars,
    open = ordered.new(), held = ordered.new(), events = 0,
  }, Gate)
end

--- Whether a record of this index can be ours at all.
function Gate:concerns(index)
  return self.ours[index] or false
end

--- Whether a message with the right shape would open the gate.
function Gate:needs_proof(ar, index)
  return not self.always[index] and not self.open.values[ar]
end

--- Whether anything waits that was asked of a device, perhaps a change of a parameter.
function Gate:waits(device)
  for ar in self.held:iterate() do
    if records.is_of(ar, device) then
      return true
    end
  end
  return false
end

--- Whether what comes on a record of this AR and index runs now, and does not have to wait.
function Gate:is_open(ar, index)
  return self:concerns(index) and not self:needs_proof(ar, index)
end

--- Whether an event of this AR may run now; false where it has to be held (`hold`).
-- A shaped message proves its AR: what waited for it runs first, through `runner`.
function Gate:admit(ar, index, shaped, runner)
  local open = self.open
  if open.newest == ar then -- it spoke last
    return true
  elseif open.values[ar] then
    open:move_to_end(ar)
    return true
  end
  if self.always[index] then
    return true
  end
  if shaped then
    self:_prove(ar, runner)
    return true
  end
  return false
end

--- Keeps an event until a shaped message of the same AR comes; for good if none does.
function Gate:hold(ar, event)
  if not self.held:get(ar) then
    self.held:set(ar, {count = 0}) -- a ring: slot count % waiting takes the next one
  end
  self:follow(ar, event)
end

--- Lets an event wait behind those that wait for an AR; where none does, it is not needed.
function Gate:follow(ar, event)
  local waiting, held = self.waiting, self.held:get(ar)
  if not held then
    return
  end
  if held.count < waiting then
    self.events = self.events + 1
  end
  held[held.count % waiting + 1] = event
  held.count = held.count + 1
  while self.held.length > waiting or self.events > self.most_events do
    local _, oldest = self.held:pop_first()
    self.events = self.events - math.min(oldest.count, waiting)
  end
end

function Gate:_prove(ar, runner)
  self.open:set(ar, true)
  if self.open.length > self.most_open then
    self.open:pop_first()
  end
  local held, waiting = self.held:pop(ar), self.waiting
  if not held then
    return
  end
  self.events = self.events - math.min(held.count, waiting)
  for number = math.max(0, held.count - waiting), held.count - 1 do
    runner:run(held[number % waiting + 1])
  end
end

return M
