-- What is wrong with S7 communication: connections, PDUs, jobs and transfers to findings DS9xx (docs/s7.md
-- 7).
--
-- Whether data is of one moment is decided in moments.lua. A thing that happens again is one remark with a
-- count, told when nothing more comes; what is wrong with a job is told with the job.

local addresses = require("ds47.s7.addresses")
local json = require("ds47.support.json")
local model = require("ds47.s7.model")
local moments = require("ds47.s7.moments")
local notes = require("ds47.s7.notes")
local ordered = require("ds47.support.ordered")
local place = require("ds47.spec.s7").place

local concat, format, insert = table.concat, string.format, table.insert

local M = {}

local NAMED = 4 -- addresses of a job that a finding names

--- What items name: DB1.DBB0..9, MB4; cut after four.
function M.areas(items)
  local named = {}
  for number = 1, math.min(#items, NAMED) do
    local address = items[number].address
    named[number] = address and addresses.text(address) or "?"
  end
  if #items > NAMED then insert(named, "...") end
  return named[1] and concat(named, ", ") or "?"
end

local areas = M.areas

-- A listener of connections.lua.
local Judge = {}
Judge.__index = Judge

--- @param limits  times, and how much is kept
-- @param listener  is told of what is wrong with a job as soon as that is seen: listener:heard(remark)
-- @param blocks  what partners copy at once, as the user says
-- @param readback  whether what is read has to be what was written (DS916)
function M.new(limits, listener, blocks, readback)
  local self = setmetatable({
    limits = limits, listener = listener, blocks = blocks, notes = notes.new(limits.s7_notes),
    without_setup = {}, -- the first job of connections whose setup was not seen
    open = {}, -- jobs of the client of a connection
    crowds = {}, -- jobs that were open at once, more than agreed: {jobs (set), left, open_now, frame}
    sending = ordered.new(), -- open BSEND by connection, direction and R_ID
    tangled = {}, -- those among them of which nobody can tell whose segments are whose
    shapes = ordered.new(), -- frame and lengths of the last USEND likewise
  }, Judge)
  self.moments = moments.new(limits, self.notes, readback)
  return self
end

--- What happened again and again, and what only the whole capture shows: array of remarks.
function Judge:finish()
  local found = {}
  for _, list in ipairs({self.moments:finish(), self.notes:finish()}) do
    for _, remark in ipairs(list) do insert(found, remark) end
  end
  return found
end

-- Connections

--- The setup was seen.
function Judge:agreed(connection)
  self.without_setup[connection.number] = nil
end

local function dotted(tsap)
  return (tsap:gsub(".", function(each) return format("%02X.", each:byte()) end):sub(1, -2))
end

--- Nothing comes of a connection.
function Judge:refused(connection, why, at, code)
  local tsap, server = connection.server_tsap, connection.server
  local rack, slot = place(tsap)
  local case = "refused_" .. why .. ((tsap or why == "setup") and "" or "_tcp")
  local args = {
    device = server.ip, controller = connection.client.ip, case = case, tsap = tsap and dotted(tsap),
    rack = rack, slot = slot, code = code,
  }
  local key = concat({server.ip, server.port, args.controller, case, args.tsap or "", code}, " ")
  self.notes:add("DS917", key, at.frame, args)
end

--- A PDU may be larger than was agreed.
function Judge:pdu(told)
  local connection, agreed = told.connection, told.connection.pdu_length
  if not agreed or told.size <= agreed or not connection.setup then return end
  local note = self.notes:add("DS902", connection.number .. tostring(told.from_client), told.at.frame, {
    device = connection.server.ip, sender = connection:side(told.from_client).ip, size = told.size,
    agreed = agreed, frame = connection.setup.frame,
  })
  if note then note:more("size", told.size, told.at.frame) end
end

--- The server said what it is.
function Judge:evidence(connection, found)
  self.blocks:evidence(connection.server.ip, found)
end

--- A connection is over.
function Judge:closed(connection)
  self.moments:closed(connection)
  local number, client, server = connection.number, connection.client, connection.server
  local frame = self.without_setup[number]
  self.without_setup[number] = nil
  if frame then
    local args = {device = server.ip, controller = client.ip}
    self.notes:add("DS915", concat({server.ip, server.port, client.ip}, " "), frame, args)
  end
  self.open[number], self.crowds[number] = nil, nil
  for _, table_ in ipairs({self.sending, self.shapes}) do
    local own = {}
    for key, each in table_:iterate() do own[#own + 1] = each.number == number and key or nil end
    for _, key in ipairs(own) do table_:pop(key) end
  end
end

local function say(self, rule, job, at, args)
  args.device, args.controller = job:partner().ip, job:asker().ip
  self.listener:heard({rule = rule, frame = at.frame, args = args, job = job})
end

-- GET and PUT

-- A job of a client is open.
local function crowded(self, job, at)
  local number, parallel = job.connection.number, job.connection.parallel
  local there = self.open[number] or {}
  self.open[number] = there
  insert(there, job)
  if not parallel or #there <= parallel or job.connection.lost_bytes > 0 then return end
  local crowd = self.crowds[number]
  if not crowd or crowd.open_now < #there then
    crowd = {jobs = {}, left = #there, open_now = #there, frame = at.frame}
    for _, each in ipairs(there) do crowd.jobs[each] = true end
    self.crowds[number] = crowd
  end
end

-- A job is open no more: jobs of which too many were open count when all of them are answered.
local function settled(self, job)
  local number, connection = job.connection.number, job.connection
  for place_of_it, each in ipairs(self.open[number] or {}) do
    if each == job then
      table.remove(self.open[number], place_of_it)
      break
    end
  end
  local crowd = self.crowds[number]
  if not crowd or not crowd.jobs[job] then return end
  crowd.jobs[job], crowd.left = nil, crowd.left - 1
  if not job.answered or crowd.left == 0 then self.crowds[number] = nil end
  if not job.answered or crowd.left > 0 then return end
  local note = self.notes:add("DS914", tostring(number), crowd.frame, {
    device = job:partner().ip, controller = job:asker().ip, most = crowd.open_now,
    agreed = connection.parallel,
  })
  if note then note:more("most", crowd.open_now, crowd.frame) end
end

-- The items of a job with a code, and the codes of those that failed, each once.
local function failed(job)
  local codes, by_code = {}, {}
  for _, item in ipairs(job.items) do
    local code = item.code
    if code and code ~= model.DONE then
      if not by_code[code] then
        by_code[code] = {}
        insert(codes, code)
      end
      insert(by_code[code], item)
    end
  end
  return codes, by_code
end

-- Items that are larger than what the partner copies at once.
local function blocked(self, job, at, operation)
  local partner = job:partner().ip
  local block = self.blocks:of(partner)
  for _, item in ipairs(block and job.items or {}) do
    local address, done = item.address, item.code == model.DONE
    if address and done and not model.ELEMENTS[address.area] and address:length() > block.size then
      local args = {
        device = partner, controller = job:asker().ip, operation = operation, area = addresses.text(address),
        bytes = address:length(), block = block.size, case = block.source, frame = block.frame,
        name = block.name,
      }
      local key = concat({
        job.connection.number, tostring(job.from_client), operation, args.area, block.size, block.source,
        block.frame or "", block.name or "",
      }, " ")
      self.notes:add("DS903", key, at.frame, args, {job.answered and job.answered.frame})
    end
  end
end

local function variables(self, job)
  local operation, at = job.operation:upper(), job.answered or job.asked
  if not at or not job.asked then return end
  if job.state == "unanswered" then
    if not job.lost then
      say(self, "DS901", job, job.asked, {operation = operation, area = areas(job.items)})
    end
    return
  end
  if (job.error or 0) ~= 0 then
    say(self, "DS909", job, at, {operation = operation, area = areas(job.items), code = job.error})
    return
  end
  local codes, by_code = failed(job)
  for _, code in ipairs(codes) do
    say(self, "DS908", job, at, {operation = operation, area = areas(by_code[code]), code = code})
  end
  blocked(self, job, job.asked, operation)
  if #job.items > 1 and job.state == "ok" then
    local args = {device = job:partner().ip, controller = job:asker().ip}
    self.notes:add("DS906", job.connection.number .. tostring(job.from_client), job.asked.frame, args)
  end
end

-- BSEND and USEND

local function key_of(job)
  return concat({job.connection.number, tostring(job.from_client), job.r_id or ""}, " ")
end

local function begun(self, job, at)
  local key = key_of(job)
  local before = self.sending:get(key)
  before = before and before.job
  if before and before.asked and not before.lost then
    say(self, "DS912", job, at, {r_id = job.r_id, case = "r_id_open", frame = before.asked.frame})
    self.tangled[job], self.tangled[before] = true, true
  end
  if before or self.sending.length < self.limits.s7_notes then
    self.sending:set(key, {job = job, number = job.connection.number})
  end
end

-- What a BSEND lacks that was sent, nil for nothing.
local function incomplete(job, parts, size)
  if not parts[#parts].last then return "bsend_open" end
  if job.total and size ~= job.total then return "bsend_sum" end
  local assigned = parts[1].assigned
  for number = 2, assigned and #parts or 0 do
    if parts[number].sequence ~= assigned then return "bsend_sequence" end
  end
  return nil
end

local function sent(self, job)
  local at, parts, size, silent = job.asked, job.segments, 0, {}
  if not at or not parts[1] then return end
  if job.state == "refused" then
    say(self, "DS912", job, job.answered or at, {r_id = job.r_id, case = "r_id_refused", code = job.error})
    return
  end
  if job.lost then return end
  for _, part in ipairs(parts) do
    size = size + part.size
    if not part.acknowledged then insert(silent, part.at.frame) end
  end
  local case = incomplete(job, parts, size)
  if case then
    say(self, "DS910", job, parts[#parts].at, {
      r_id = job.r_id, case = case, total = job.total, size = size, segments = #parts, first = at.frame,
    })
  end
  if silent[1] then
    say(self, "DS911", job, {frame = silent[1]}, {
      r_id = job.r_id, count = #silent, segments = #parts, frames = json.array(silent),
    })
  end
end

local function shape_of(job)
  local found = json.array({})
  for number, item in ipairs(job.items) do found[number] = #(item.value or "") end
  return found
end

local function shaped(self, job)
  local at, shape, key = job.asked, shape_of(job), key_of(job)
  if not at or job.flaws[1] then return end
  local before = self.shapes:get(key)
  if not before and self.shapes.length >= self.limits.s7_notes then return end
  self.shapes:set(key, {frame = at.frame, shape = shape, number = job.connection.number})
  if before and concat(before.shape, " ") ~= concat(shape, " ") then
    say(self, "DS913", job, at, {r_id = job.r_id, before = before.shape, now = shape, first = before.frame})
  end
end

-- Jobs

--- A request, or the first segment, was seen.
function Judge:asked(job)
  self.moments:asked(job)
  local at, number = job.asked, job.connection.number
  if not at then return end
  if not job.connection.pdu_length and not self.without_setup[number] then
    self.without_setup[number] = at.frame
  end
  if job.operation == "bsend" then
    begun(self, job, at)
  elseif job.operation ~= "usend" and job.from_client then
    crowded(self, job, at)
  end
end

--- Nothing more comes of a job.
function Judge:over(job)
  self.moments:over(job)
  if job.operation == "bsend" then
    local key = key_of(job)
    local open = self.sending:get(key)
    if open and open.job == job then self.sending:pop(key) end
    if job.state ~= "orphan" and not self.tangled[job] then sent(self, job) end
    self.tangled[job] = nil
  elseif job.operation == "usend" then
    shaped(self, job)
  elseif job.state ~= "orphan" then
    settled(self, job)
    variables(self, job)
  end
end

return M
