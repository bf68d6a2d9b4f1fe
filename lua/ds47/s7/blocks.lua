-- How many bytes a partner copies without interruption when others read and write its memory (docs/s7.md 6).
--
-- A capture does not have this number: the user names it, or the partner says what it is. Nothing is judged
-- here.

local cpu_of_order = require("ds47.spec.s7").cpu_of_order
local tables = require("ds47.spec.tables")

local M = {}

local ANYBODY = "" -- the address of all partners that are not named

local Blocks = {}
Blocks.__index = Blocks

--- The blocks of all partners. One is {size, source, frame, name}: bytes; who says so: "block_chosen"
-- (--s7-block), "block_kind" (--s7-cpu), "block_said" (SZL 0131) or "block_order" (the order number in an
-- SZL); where the partner said it; the kind of CPU, or its order number.
-- @param sizes  bytes by IP address; "" stands for all others
-- @param kinds  ids of tables.s7.cpus likewise
-- @param most  partners of which it is kept what they said
function M.new(sizes, kinds, most)
  local self = {chosen = {}, kinds = {}, most = most, told = {}, count = 0}
  for ip, size in pairs(sizes) do self.chosen[ip] = {size = size, source = "block_chosen"} end
  for ip, kind in pairs(kinds) do
    self.kinds[ip] = {size = tables.s7.cpus[kind].block, source = "block_kind", name = kind}
  end
  return setmetatable(self, Blocks)
end

--- A partner said what it is; of two numbers the larger one counts.
-- @param found  as szl.lua has it
function Blocks:evidence(ip, found)
  local value, block = found.value
  if type(value) == "string" then
    local cpu = cpu_of_order(value)
    block = cpu and {size = cpu.block, source = "block_order", frame = found.at.frame, name = value}
  else
    block = value > 0 and {size = value, source = "block_said", frame = found.at.frame}
  end
  local before = self.told[ip]
  if not block or before and before.size >= block.size then return end
  if before or self.count < self.most then
    self.count = self.count + (before and 0 or 1)
    self.told[ip] = block
  end
end

--- The block of a partner; nil where nobody says.
function Blocks:of(ip)
  local chosen, kinds = self.chosen, self.kinds
  return chosen[ip] or chosen[ANYBODY] or kinds[ip] or kinds[ANYBODY] or self.told[ip]
end

return M
