-- S7 of a capture: packets in, jobs that are over with what is wrong with them out.
--
-- Joins the steps of this room; the analysis needs no other.

local blocks = require("ds47.s7.blocks")
local connections = require("ds47.s7.connections")
local judge = require("ds47.s7.judge")
local tcp = require("ds47.s7.tcp")
local told = require("ds47.s7.transactions").told

local M = {}

local NONE = {}

local Communication = {}
Communication.__index = Communication

--- All connections of S7 of a capture.
-- @param ports  of servers, a set
-- @param choices  of the user: nil, or any of
--   ports     array of further TCP ports, which are in `ports` already
--   blocks    bytes that a server copies at once, by its address; "" stands for all others
--   cpus      kinds of servers (tables.s7.cpus) likewise
--   readback  true: what is read has to be what was written (DS916)
-- @param limits  how much is kept
-- @param listener  is told of each job that is over, with what is wrong with it, and of what is wrong
--   otherwise, or with a job that was over before: listener:communicated(job, remarks),
--     listener:s7_remark(remark)
function M.new(ports, choices, limits, listener)
  choices = choices or NONE
  local self = setmetatable({
    listener = listener,
    said = {}, -- what is wrong with jobs that are not over
    seen = {}, -- what the last packet had to do with: array of {job, role}
  }, Communication)
  self.blocks = blocks.new(choices.blocks or NONE, choices.cpus or NONE, limits.s7_memories)
  self.judge = judge.new(limits, self, self.blocks, choices.readback or false)
  self.connections = connections.new(ports, limits, {self.judge, self})
  return self
end

--- The next segment of TCP.
-- @param packet  {src_ip, dst_ip, payload (of the IP packet), missing (bytes of it that the capture does not
--   have), frame, time_ns}
function Communication:packet(packet)
  if self.seen[1] then self.seen = {} end
  local segment = tcp.parse(packet.src_ip, packet.dst_ip, packet.payload, packet.missing or 0)
  if segment then self.connections:feed(segment, {frame = packet.frame, time_ns = packet.time_ns}) end
end

--- The capture is over.
function Communication:finish()
  self.connections:finish()
  for _, remark in ipairs(self.judge:finish()) do self:heard(remark) end
end

--- The connections, as the report has them.
function Communication:told()
  local found = {}
  for number, each in ipairs(self.connections:all()) do
    local block = self.blocks:of(each.server.ip)
    found[number] = told(each, block and block.size)
  end
  return found
end

--- Connections for which there was no room.
function Communication:left_out()
  return self.connections.left_out
end

-- A job, once: what says more of it comes first.
local function see(self, job, role)
  for _, each in ipairs(self.seen) do
    if each.job == job then return end
  end
  table.insert(self.seen, {job = job, role = role})
end

--- A request, as connections.lua tells.
function Communication:asked(job)
  see(self, job, "write_request")
end

--- A segment or an acknowledgement, as connections.lua tells.
function Communication:touched(job, role)
  see(self, job, role)
end

--- What is wrong with a job that is not over, as far as that is known: array of remarks.
function Communication:certain(job)
  return self.said[job] or NONE
end

--- A job is over, as connections.lua tells; the judge has heard of it before.
function Communication:over(job)
  if job.answered then see(self, job, "read_response") end
  local remarks = self.said[job] or {}
  self.said[job] = nil
  self.listener:communicated(job, remarks)
end

--- What the judge says.
function Communication:heard(remark)
  local job = remark.job
  if job and job.phase ~= "closed" then
    self.said[job] = self.said[job] or {}
    table.insert(self.said[job], remark)
  else
    remark.job = nil -- as where transactions are handed out at once
    self.listener:s7_remark(remark)
  end
end

return M
