-- What only the whole capture shows of the cyclic channels: habits, operation, why a change was not accepted.
--
-- Gathers what habits.lua, operation.lua and explanation.lua have to say, and of whom: tables and bits are
-- those of one maker, so that what is said of the drives of others is a note (docs/cyclic.md 5).

local flat = require("ds47.support.flat").copy
local explanation = require("ds47.cyclic.explanation")
local habits = require("ds47.cyclic.habits")
local handshake = require("ds47.cyclic.handshake")
local judge = require("ds47.cyclic.judge")
local link = require("ds47.profinet.link")
local ordered = require("ds47.support.ordered")
local relations = require("ds47.cyclic.relations")

local M = {}

local OF_ITS_MAKER = {DS508 = true} -- that AK 11 to 14 save is an extension of the maker of these tables

local Conclusions = {}
Conclusions.__index = Conclusions

-- Adds remarks that know of whose drive they are; those about tables of one maker are of no other. They are
-- copies: the capture may go on, and what is kept of it has to stay as it is.
local function add_of(found, relation, remarks)
  for _, remark in ipairs(remarks) do
    if not OF_ITS_MAKER[remark.rule] or not relations.is_foreign(relation) then
      local told = flat(remark)
      found[#found + 1], told.of = told, relation
    end
  end
end

--- What is kept of transactions until the capture is over.
-- @param limits the flat table of tables.lua
function M.new(limits, channels)
  return setmetatable({
    limits = limits, channels = channels,
    habits = ordered.new(), -- place of a drive -> its habits
  }, Conclusions)
end

--- The same conclusions as ones that go on alone.
-- @param channels those of the capture, which go on alone
function Conclusions:apart(channels)
  local made = M.new(self.limits, channels)
  for place, each in self.habits:iterate() do made.habits:set(place, each:apart()) end
  return made
end

local function habits_of(self, relation, layout)
  local place = relations.place(relation)
  local found = self.habits:get(place)
  if found == nil then
    local where = {device = relation.device, slot = relation.slot}
    found = habits.new(where, self.limits, layout, relations.drives(relation))
    found.relation = relation
    self.habits:set(place, found)
  end
  return found
end

--- What is wrong with a transaction of PKW that is over: array of remarks.
function Conclusions:exchanged(relation, job, layout)
  local found, remarks = {}, judge.remarks(relation, job, layout)
  local took = handshake.reaction(job)
  habits_of(self, relation, layout):take(job, took, remarks)
  add_of(found, relation, remarks)
  if job.reason == "end" and handshake.is_ignored(job) and handshake.stood(job) >= self.limits.pkw_cycles then
    add_of(found, relation, judge.unanswered(relation, job, layout))
  end
  return found
end

--- Whether the state of its drive explains a transaction of any channel that is over: a remark, or nil.
function Conclusions:transaction(item) return explanation.explain(item, self.channels:drives()) end

--- Everything else, when the capture is over: array of remarks.
-- @param layout_of the layout of IND, by the address of a device
function Conclusions:finish(layout_of)
  local found = {}
  for _, each in ipairs(self.channels.mixed) do
    local args = {device = each.device, sender = link.mac_text(each.sender), frame_id = each.frame_id}
    found[#found + 1] = {rule = "DS515", frame = each.frame, args = args}
  end
  for _, drive in ipairs(self.channels:drives()) do add_of(found, drive.relation, drive:remarks()) end
  for _, each in self.habits:iterate() do add_of(found, each.relation, each:finish()) end
  for _, each in ipairs(self.channels:unanswered()) do
    local relation = each.relation
    add_of(found, relation, judge.unanswered(relation, each.job, layout_of(relation.device)))
  end
  for _, relation in ipairs(self.channels:unused()) do
    if not relations.is_foreign(relation) and relation.frame then
      local args = {device = relation.device, slot = relation.slot}
      found[#found + 1] = {rule = "DS512", frame = relation.frame, args = args}
    end
  end
  return found
end

return M
