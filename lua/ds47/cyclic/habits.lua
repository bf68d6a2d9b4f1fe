-- Judgement: how a program uses the PKW of one drive, to findings DS507 to DS511 (docs/cyclic.md 5). What one
-- request alone does not show. Whether anybody wants to know is decided elsewhere, as in judge.lua.

local flat = require("ds47.support.flat").copy
local json = require("ds47.support.json")
local pkw = require("ds47.cyclic.pkw")
local tables = require("ds47.spec.tables")

local float = json.float

local M = {}

local WRONG_TYPE = 5 -- error number of PKW
local OTHER = {cyclic = "uss", uss = "cyclic"}

local Habits = {}
Habits.__index = Habits

--- The requests of one drive, as far as they are remembered.
-- @param where arguments of findings about the drive: {device, slot}
-- @param limits the flat table of tables.lua
-- @param family whose parameters it has
function M.new(where, limits, layout, family)
  return setmetatable({
    where = where, limits = limits, layout = layout, family = family,
    double = {}, -- parameters that were answered as double words -> frame
    saved = {}, reads = {}, -- arrays of {pnu, subindex, count, newest frame}, and by parameter
    slow = 0, slowest = 0, slowest_frame = 0,
    strange = 0, strange_at = nil, -- requests with a page that does not exist, and the frame of the first one
    unreadable = false, -- whether the other layout would not do either
  }, Habits)
end

local function key_of(asked) return (asked.pnu or "-") .. "[" .. asked.subindex .. "]" end

local function has_room(self, list, key)
  return list[key] ~= nil or #self.saved + #self.reads < self.limits.written_values
end

local function count(list, key, asked, frame)
  local entry = list[key]
  if entry == nil then
    entry = {pnu = asked.pnu, subindex = asked.subindex, count = 0}
    list[key], list[#list + 1] = entry, entry
  end
  entry.count, entry.frame = entry.count + 1, frame
end

local function page(self, data, frame, asked)
  local other = pkw.decode(data, false, OTHER[self.layout])
  self.unreadable = self.unreadable or not pkw.fits_layout(other)
  if not pkw.fits_layout(asked) then
    self.strange, self.strange_at = self.strange + 1, self.strange_at or frame
  end
end

local function time(self, took, frame)
  if took and took > self.limits.pkw_slow_ns then
    self.slow = self.slow + 1
    if took > self.slowest or took == self.slowest and frame > self.slowest_frame then
      self.slowest, self.slowest_frame = took, frame
    end
  end
end

--- A transaction that is over; what is wrong with it is put behind `remarks`.
-- @param took nanoseconds from the request to its response, nil where nobody knows
function Habits:take(job, took, remarks)
  local asked = pkw.decode(job.request.data, false, self.layout)
  local row, key, frame = tables.pkw.requests[asked.ak], key_of(asked), job.request.at.frame
  page(self, job.request.data, frame, asked)
  if row.eeprom and has_room(self, self.saved, key) then
    count(self.saved, key, asked, frame)
  elseif row.access == "read" and has_room(self, self.reads, key) then
    count(self.reads, key, asked, frame)
  end
  if job.answer == nil then return end
  local at = job.answer.at.frame
  time(self, took, at)
  local told = pkw.decode(job.answer.data, true, self.layout)
  if row.access == "read" and tables.pkw.answers[told.ak].width == 32 and self.reads[key] then
    self.double[key] = at
  end
  local wrong = told.error and told.error.code == WRONG_TYPE
  if row.access == "change" and row.width == 16 and wrong and self.double[key] then
    remarks[#remarks + 1] = {
      rule = "DS507", frame = at,
      args = {pnu = asked.pnu, subindex = asked.subindex, read = self.double[key], family = self.family},
    }
  end
end

-- Entries that may be counted on alone.
local function entries_apart(list)
  local made = {}
  for number, entry in ipairs(list) do
    made[number] = flat(entry)
    made[key_of(entry)] = made[number]
  end
  return made
end

--- The same habits as ones that go on alone.
function Habits:apart()
  local made = flat(self, {"double"})
  made.saved, made.reads = entries_apart(self.saved), entries_apart(self.reads)
  return made
end

-- A remark about the drive.
local function about(self, rule, frame, args)
  for name, value in pairs(self.where) do args[name] = value end
  return {rule = rule, frame = frame, args = args}
end

local function often(self, rule, entry, limit)
  return about(self, rule, entry.frame, {
    pnu = entry.pnu, subindex = entry.subindex, count = entry.count, limit = limit, family = self.family,
  })
end

--- What the whole capture shows: array of remarks.
function Habits:finish()
  local found, limits, most = {}, self.limits, nil
  local saved = limits.pkw_saved
  for _, entry in ipairs(self.saved) do
    if entry.count > saved then found[#found + 1] = often(self, "DS508", entry, saved) end
  end
  for _, entry in ipairs(self.reads) do
    if most == nil or entry.count > most.count then most = entry end
  end
  if most and most.count > limits.pkw_reads then
    found[#found + 1] = often(self, "DS509", most, limits.pkw_reads)
  end
  if self.strange > 0 and not self.unreadable then
    local args = {count = self.strange, layout = self.layout, other = OTHER[self.layout]}
    found[#found + 1] = about(self, "DS510", self.strange_at, args)
  end
  if self.slow > 0 then
    local limit, slowest = float(limits.pkw_slow_ns / 1e6), float(self.slowest / 1e6)
    local args = {count = self.slow, limit = limit, slowest = slowest}
    found[#found + 1] = about(self, "DS511", self.slowest_frame, args)
  end
  return found
end

return M
