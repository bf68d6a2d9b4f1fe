-- Whether data is of one moment: areas that were split, data that mixes two moments, two writers (docs/s7.md
-- 6).
--
-- Hears of all jobs, keeps what they make of the memories of each partner (memory.lua), and tells remarks
-- DS904, DS905, DS907 and DS916 of it.

local addresses = require("ds47.s7.addresses")
local areas = require("ds47.s7.areas")
local json = require("ds47.support.json")
local memories = require("ds47.s7.memory")
local ordered = require("ds47.support.ordered")
local place_of = require("ds47.spec.s7").place

local concat, insert, remove = table.concat, table.insert, table.remove
local max, min = math.max, math.min
local byte = string.byte
local byte_text = areas.byte_text

local M = {}

local RECENT = 8 -- areas read, and written, in parts that may still meet others
local KNOWN = 256

local Moments = {}
Moments.__index = Moments

--- Hears of jobs in the order of their frames.
-- @param limits  times, and how much is kept
-- @param notes  what happens again and again
-- @param readback  whether what is read has to be what was written (DS916)
function M.new(limits, notes, readback)
  return setmetatable({
    limits = limits, notes = notes, readback = readback,
    places = ordered.new(), -- by partner, area and DB: see `place`
    partners = ordered.new(), -- by address and port: see `heard`
    splits = ordered.new(), -- by connection and side
    numbers = {}, -- of jobs: that of its first access
    number = 0, told = {},
  }, Moments)
end

local function keep(list, item, most)
  insert(list, item)
  if #list > most then remove(list, 1) end
end

-- Partners and their memories

local function key_of(connection)
  return connection.server.ip .. " " .. connection.server.port
end

-- What was not heard, or not understood, on a connection.
local function doubt_of(connection)
  return connection.lost_bytes + connection.plus + connection.other
end

-- Tells what mixes two moments in a memory, unless somebody else was seen to write these bytes.
local function tell_place(self, place)
  for _, each in ipairs(place.mixed) do
    local foreign = place.memory.foreign
    if not foreign:has(each.found.first) and not foreign:has(each.found.second) then
      insert(self.told, each.remark)
    end
  end
end

local function give_up(self, key)
  self.partners:pop(key)
  local own = {}
  for name, place in self.places:iterate() do own[#own + 1] = place.partner == key and name or nil end
  for _, name in ipairs(own) do tell_place(self, self.places:pop(name)) end
end

local function forget(self, ip, time_ns)
  for _, place in self.places:iterate() do
    if place.ip == ip then
      place.memory:forget(time_ns)
      place.puts = {}
    end
  end
end

-- A partner is {connections (by number, those that are open), doubt (what was not heard so far), left (the
-- doubt of connections that are over), latest (the time of the last frame), slots (set), slot_count}.
local function partner_of(self, connection)
  local key = key_of(connection)
  local partner = self.partners:get(key)
  if not partner then -- where there are too many, the one that was heard first is forgotten
    if self.partners.length >= self.limits.s7_memories then give_up(self, self.partners.oldest) end
    partner = {connections = {}, doubt = 0, left = 0, latest = nil, slots = {}, slot_count = 0}
    self.partners:set(key, partner)
  end
  self.partners:move_to_end(key)
  return partner
end

local function add_slot(partner, tsap)
  local rack, slot = place_of(tsap)
  local key = rack and rack * 0x20 + slot
  if key and partner.slot_count < 2 and not partner.slots[key] then
    partner.slots[key], partner.slot_count = true, partner.slot_count + 1
  end
end

-- Forgets a partner's memories where something was not heard, or time steps back.
local function heard(self, job, time_ns)
  local connection = job.connection
  local partner = partner_of(self, connection)
  partner.connections[connection.number] = connection
  add_slot(partner, connection.server_tsap)
  local doubt, latest = partner.left, partner.latest
  for _, each in pairs(partner.connections) do doubt = doubt + doubt_of(each) end
  local newest = latest and time_ns < latest and latest or time_ns
  if doubt ~= partner.doubt or latest and time_ns < latest then
    partner.doubt = doubt
    forget(self, connection.server.ip, newest)
  end
  partner.latest = newest
end

-- What a job of a client does to memories; nothing where it is open whose they are.
local function accesses_of(self, job, number)
  if not job.from_client or partner_of(self, job.connection).slot_count > 1 then return {} end
  return areas.accesses(job, number)
end

-- A memory of a partner, what met there lately, and what is to be told of it: {partner, ip, memory, gets
-- (areas read in parts), puts (areas written in parts: {parts, whole}), mixed (array of {found, remark}),
-- known (numbers of accesses of which it is told already)}.
local function place_at(self, job, access)
  local partner = key_of(job.connection)
  local key = concat({partner, access.area, access.db}, " ")
  local place = self.places:get(key)
  if not place then
    place = {
      partner = partner, ip = job.connection.server.ip, memory = memories.new(self.limits.s7_accesses),
      gets = {}, puts = {}, mixed = {}, known = {},
    }
    self.places:set(key, place)
    if self.places.length > self.limits.s7_memories then
      local _, oldest = self.places:pop_first()
      tell_place(self, oldest)
    end
  end
  self.places:move_to_end(key)
  return place
end

-- Data that mixes two moments

-- What DS905 says of the two bytes, the write, and all frames.
local function arguments(reader, found, parts, put)
  local values, requests, jobs, frames, seen = {}, {}, 0, {}, {}
  local function add(access)
    for _, frame in ipairs({access.request, access.response}) do
      if not seen[frame] then insert(frames, frame) end
      seen[frame] = true
    end
  end
  for _, each in ipairs(parts) do
    for _, at in ipairs({found.first, found.second}) do
      values[at] = each.start <= at and at < each.last and byte(each.data, at - each.start + 1) or values[at]
    end
    jobs = jobs + (requests[each.request] and 0 or 1)
    requests[each.request] = true
    add(each)
  end
  for _, each in ipairs(put and put.parts or {}) do add(each) end
  add(found.write)
  table.sort(frames)
  local area, db = parts[1].area, parts[1].db
  return {
    device = reader.server.ip, controller = reader.client.ip,
    case = put and "mixed_put" or jobs > 1 and "mixed_split" or "mixed_job", jobs = jobs,
    first = byte_text(area, db, found.first), first_value = values[found.first],
    second = byte_text(area, db, found.second), second_value = values[found.second],
    write = found.write.request, frames = json.array(frames),
  }
end

-- The part that was over last.
local function last_of(parts)
  local last = parts[1]
  for _, each in ipairs(parts) do
    if last.answered_ns < each.answered_ns then last = each end
  end
  return last
end

-- Whether what was read mixes two moments, by the writes as they are, or by one in parts (`put`) taken as
-- one; of each access it is told once.
local function mixes(place, parts, put, reader, job)
  for _, each in ipairs(parts) do
    for _, order in ipairs(place.known) do
      if order == each.order then return false end
    end
  end
  local found = place.memory:mixed(parts, put)
  if not found then return false end
  for _, each in ipairs(parts) do keep(place.known, each.order, KNOWN) end
  local args = arguments(reader, found, parts, put)
  local remark = {rule = "DS905", frame = last_of(parts).response, args = args, job = job}
  insert(place.mixed, {found = found, remark = remark})
  return true
end

-- The same by the writes as they are, or by each of those in parts.
local function look(place, job, parts)
  if mixes(place, parts, nil, job.connection, job) then return end
  for _, put in ipairs(place.puts) do
    if mixes(place, parts, put, job.connection, job) then return end
  end
end

-- Areas in parts

local function tell_split(self, whole, job, area)
  local args = {
    device = job:partner().ip, controller = job:asker().ip, operation = job.operation:upper(), area = area,
    jobs = #whole.parts,
  }
  local frames = {}
  for number, part in ipairs(whole.parts) do
    insert(frames, part.job.asked and part.job.asked.frame)
    insert(frames, part.job.answered and part.job.answered.frame)
    local split = part.job.split
    split.area, split.parts, split.number = area, #whole.parts, number
  end
  local key = concat({job.connection.number, tostring(job.from_client), job.operation, area}, " ")
  self.notes:add("DS904", key, remove(frames, 1), args, frames)
end

-- The write that an area written in parts wants to be; nil where that is open.
local function joined(self, parts)
  local first, last, data = parts[1], parts[#parts], {}
  local asked, answered = first.asked_ns, first.answered_ns
  for number, each in ipairs(parts) do
    if not each.sure or not each.known then return nil end
    data[number] = each.data
    if each.asked_ns < asked then asked = each.asked_ns end
    if answered < each.answered_ns then answered = each.answered_ns end
  end
  self.number = self.number + 1
  local text = concat(data)
  return {
    order = self.number, connection = first.connection, write = true, area = first.area, db = first.db,
    start = first.start, last = first.start + #text, data = text, asked_ns = asked, answered_ns = answered,
    request = first.request, response = last.response, sure = true, known = true,
  }
end

-- An area was written in parts: was it read meanwhile?
local function take_put(self, partner, place, parts)
  local whole = joined(self, parts)
  if not whole then return end
  local put, reads = {parts = parts, whole = whole}, {}
  keep(place.puts, put, RECENT)
  for _, each in ipairs(place.gets) do insert(reads, each) end
  for _, each in ipairs(place.memory:reads(whole)) do insert(reads, {each}) end
  for _, read in ipairs(reads) do
    local reader = partner.connections[read[1].connection]
    if reader then mixes(place, read, put, reader) end
  end
end

-- An area was read or written in parts.
local function complete(self, whole)
  if not whole then return end
  local job = whole.parts[#whole.parts].job
  tell_split(self, whole, job, addresses.text(whole:address()))
  local parts = job.from_client and whole:accesses() or {}
  if #parts ~= #whole.parts then return end
  local place = place_at(self, job, parts[1])
  if job.operation == "get" then
    keep(place.gets, parts, RECENT)
    look(place, job, parts)
  else
    take_put(self, partner_of(self, job.connection), place, parts)
  end
end

local function side_of(connection, from_client)
  return connection.number .. (from_client and " client" or " server")
end

local function splits_of(self, job)
  local key = side_of(job.connection, job.from_client)
  local found = self.splits:get(key)
  if not found then
    found = areas.splits(self.limits.s7_split_ns, self.limits.s7_parts)
    self.splits:set(key, found)
  end
  return found
end

-- Jobs

-- Another station wrote other values to the same bytes, not long before.
local function two_writers(self, job, access, memory)
  local partner, own = partner_of(self, job.connection), job.connection.client.ip
  for _, other in ipairs(memory:writes()) do
    local connection = partner.connections[other.connection]
    local first, last = max(access.start, other.start), min(access.last, other.last)
    if connection and connection.client.ip ~= own and other.sure and other.known and first < last
      and access.asked_ns - other.answered_ns <= self.limits.s7_writers_ns then
      for at = first, last - 1 do
        if byte(access.data, at - access.start + 1) ~= byte(other.data, at - other.start + 1) then
          local one, two = own, connection.client.ip
          if two < one then one, two = two, one end
          local name = byte_text(access.area, access.db, at)
          local args = {device = job:partner().ip, controller = one, other = two, byte = name}
          local key = concat({key_of(job.connection), access.area, access.db, one, two}, " ")
          self.notes:add("DS907", key, access.request, args, {other.request})
          return
        end
      end
    end
  end
end

-- The first read after a write has other values.
local function compare(self, job, access, memory)
  for _, write in ipairs(memory:unread(access)) do
    local first, last = max(access.start, write.start), min(access.last, write.last)
    for at = first, last - 1 do
      local written, read = byte(write.data, at - write.start + 1), byte(access.data, at - access.start + 1)
      if written ~= read then
        insert(self.told, {
          rule = "DS916", frame = access.response or access.request, job = job, args = {
            device = job:partner().ip, controller = job:asker().ip,
            byte = byte_text(access.area, access.db, at), written = written, read = read, by = write.request,
          },
        })
        break
      end
    end
  end
end

local function written(self, job, number)
  for _, access in ipairs(accesses_of(self, job, number)) do
    local memory = place_at(self, job, access).memory
    if not access.answered_ns then
      memory:gave_up(access)
    else
      if access.sure and access.known then two_writers(self, job, access, memory) end
      memory:written(access)
    end
  end
end

-- What was read by one job, of each memory.
local function read(self, job, number)
  local parts = ordered.new()
  for _, access in ipairs(accesses_of(self, job, number)) do
    local key = access.area * 0x10000 + access.db
    local own = parts:get(key) or {}
    insert(own, access)
    parts:set(key, own)
  end
  for _, own in parts:iterate() do
    local place = place_at(self, job, own[1])
    for _, access in ipairs(own) do
      if self.readback then compare(self, job, access, place.memory) end
      place.memory:read(access)
    end
    look(place, job, own)
  end
end

local function is_variables(job)
  return job.operation == "get" or job.operation == "put"
end

--- A request was seen.
function Moments:asked(job)
  if not is_variables(job) or not job.asked then return end
  local number = self.number
  self.numbers[job], self.number = number, number + #job.items + 1
  heard(self, job, job.asked.time_ns)
  complete(self, splits_of(self, job):asked({job = job, first = number}))
  if job.operation == "put" then
    for _, access in ipairs(accesses_of(self, job, number)) do
      place_at(self, job, access).memory:sent(access)
    end
  end
end

-- Whether it is known what a PUT wrote, and where.
local function is_known(job)
  return job.from_client and job.state ~= "orphan" and areas.is_clear(job)
end

--- Nothing more comes of a job.
function Moments:over(job)
  local number, at = self.numbers[job], job.answered or job.asked
  self.numbers[job] = nil
  if not at then return end
  heard(self, job, at.time_ns)
  if not is_variables(job) or job.operation == "put" and not is_known(job) then
    forget(self, job:partner().ip, at.time_ns)
  end
  if not number or not is_variables(job) then return end
  local take = job.operation == "put" and written or read
  take(self, job, number)
  complete(self, splits_of(self, job):over(job))
end

--- A connection is over.
function Moments:closed(connection)
  for _, from_client in ipairs({true, false}) do
    local splits = self.splits:pop(side_of(connection, from_client))
    if splits then complete(self, splits:finish()) end
  end
  local partner = self.partners:get(key_of(connection))
  if partner and partner.connections[connection.number] then
    partner.connections[connection.number] = nil
    partner.left = partner.left + doubt_of(connection)
  end
end

--- What was found, when nothing more comes: array of remarks.
function Moments:finish()
  for _, splits in self.splits:iterate() do complete(self, splits:finish()) end
  for _, place in self.places:iterate() do tell_place(self, place) end
  return self.told
end

return M
