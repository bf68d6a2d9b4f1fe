-- What DP says in a frame, by its SAPs: diagnosis, parameters, configuration, control, data
-- (docs/profibus.md 3). One frame at a time. Records (MS1, MS2) are in ms1.lua.

local bit_of = require("ds47.support.bits").bit
local filtered = require("ds47.support.arrays").filtered
local tables = require("ds47.spec.tables")

local floor, max = math.floor, math.max

local M = {}

local NO_MASTER, MOST_MAKER = 255, 14
local BLOCK_LENGTHS = {[2] = 3, [3] = 1}

local function row_of(item) return tables.profibus[item.request and "request" or "answer"][item.code] end

--- Which service of DP a frame belongs to.
-- @param item what telegram.lua decoded
-- @return a key of tables.profibus.services, or nil where the SAPs stand for none
function M.service(item)
  if not item.code then return nil end
  local slave, master = item.slave_sap, item.master_sap
  if not slave and not master then
    local row = row_of(item)
    return row and row.exchange and "exchange" or nil
  end
  if not slave or not master then return nil end
  local known = tables.profibus.service_ids[slave]
  if known and known[master] then return known[master] end
  if master == tables.profibus.ms2_master and slave <= tables.profibus.ms2_most then return "ms2" end
  return nil
end

-- The ids of the bits that are set.
local function flags(name, data)
  local found = {}
  for _, row in ipairs(tables.profibus[name .. "_flags"]) do
    local byte = data:byte(row.byte + 1)
    if byte and bit_of(byte, row.bit) == 1 then
      found[#found + 1] = row.id
      found[row.id] = true
    end
  end
  return found
end

local function measure(data, want, flaws)
  if #data < want then
    flaws[#flaws + 1] = {kind = "data", offset = #data, args = {have = #data, want = want}}
  end
  return flaws
end

local function word(data, at)
  local high, low = data:byte(at + 1, at + 2)
  return low and high * 0x100 + low
end

local function diagnosis(data)
  local flaws, blocks, at = measure(data, 6, {}), {}, 6
  while at < #data do
    local head = data:byte(at + 1)
    local kind = floor(head / 0x40)
    local long = BLOCK_LENGTHS[kind] or max(head % 0x40, 1)
    blocks[#blocks + 1] = {kind = kind, data = data:sub(at + 1, at + long)}
    measure(data, at + long, flaws)
    at = at + long
  end
  local master = data:byte(4)
  if master == NO_MASTER then master = nil end
  return {
    kind = "diagnosis", flags = flags("diagnosis", data:sub(1, 6)), master = master, ident = word(data, 4),
    blocks = blocks, flaws = flaws,
  }
end

local function parameters(data)
  local set, watchdog = flags("parameters", data), nil
  if set.watchdog and #data >= 3 then
    local first, second = data:byte(2, 3)
    watchdog = (set.dpv1 and set.watchdog_base_1ms and 1 or 10) * first * second
  end
  return {
    kind = "parameters", flags = set, watchdog_ms = watchdog, tsdr = data:byte(4), ident = word(data, 4),
    groups = data:byte(7), user = data:sub(8), flaws = measure(data, 7, {}),
  }
end

local function area(head, range)
  local words = bit_of(head, 6) == 1
  return {length = (head % range + 1) * (words and 2 or 1), words = words, consistent = bit_of(head, 7) == 1}
end

-- One byte: consistency, words or bytes, in and out, length.
local function general(data, at)
  local head = data:byte(at + 1)
  local both = area(head, 0x10)
  return {
    data = data:sub(at + 1, at + 1), special = false, maker = "",
    inputs = bit_of(head, 4) == 1 and both or nil, outputs = bit_of(head, 5) == 1 and both or nil,
  }, at + 1
end

-- A byte that says what follows: a length byte of outputs, one of inputs, bytes of the maker.
local function special(data, at)
  local head, module, next_at = data:byte(at + 1), {special = true}, at + 1
  for _, side in ipairs({{"outputs", 7}, {"inputs", 6}}) do
    if bit_of(head, side[2]) == 1 then
      local long = data:byte(next_at + 1)
      module[side[1]] = long and area(long, 0x40) or nil
      next_at = next_at + 1
    end
  end
  local maker = head % 0x10
  local last = next_at + (maker <= MOST_MAKER and maker or 0)
  module.data, module.maker = data:sub(at + 1, last), data:sub(next_at + 1, last)
  return module, last
end

-- The bytes of a module that is in and out alike; nil for another one.
local function both_ways(module)
  local inputs, outputs = module.inputs, module.outputs
  return inputs and outputs and inputs.length == outputs.length and inputs.length or nil
end

local function is_ppo(row, filled)
  if #row.modules ~= #filled then return false end
  for i, length in ipairs(row.modules) do
    if both_ways(filled[i]) ~= length then return false end
  end
  return true
end

-- The PPO by the lengths of the modules; each of these gets its role. And whether PKW is consistent over its
-- whole length, both ways.
local function name_ppo(found)
  local filled = filtered(found.modules, function(module) return module.inputs or module.outputs end)
  for _, row in ipairs(tables.profibus.ppos) do
    if is_ppo(row, filled) then
      found.ppo = row.number
      for i, module in ipairs(filled) do module.role = row.pkw and i == 1 and "PKW" or "PZD" end
      if row.pkw then found.pkw_consistent = filled[1].inputs.consistent and filled[1].outputs.consistent end
    end
  end
  return found
end

--- The modules of the identifier bytes of Chk_Cfg.
-- @return table {kind = "configuration", modules (list of {data, special, inputs, outputs, maker, role}),
-- ppo, pkw_consistent, input_length, output_length, flaws}; inputs, outputs: {length, words, consistent}
function M.configuration(data)
  local found = {kind = "configuration", modules = {}, flaws = {}, input_length = 0, output_length = 0}
  local at = 0
  while at < #data do
    local head = data:byte(at + 1)
    local read = floor(head / 0x10) % 4 ~= 0 and general or special
    local module, last = read(data, at)
    found.modules[#found.modules + 1] = module
    found.input_length = found.input_length + (module.inputs and module.inputs.length or 0)
    found.output_length = found.output_length + (module.outputs and module.outputs.length or 0)
    measure(data, last, found.flaws)
    at = last
  end
  return name_ppo(found)
end

local function control(data)
  return {
    kind = "control", flags = flags("control", data), groups = data:byte(2), flaws = measure(data, 2, {}),
  }
end

local REFUSED = {[1] = true, [2] = true, [3] = true} -- codes of answers that refuse a service: UE, RR, RS

--- Whether an answer refuses its service: what the master sent with it does not count then.
function M.refuses(answer) return REFUSED[answer.code] or false end

--- What a frame says, nil for nothing that DP-V0 knows. One with flaws is decoded as far as possible.
-- @param item what telegram.lua decoded
-- @return table with a kind: "diagnosis", "parameters", "configuration", "control" or "exchange", and flaws
function M.decode(item)
  local name = M.service(item)
  if name == "exchange" then
    local wants = not item.request and row_of(item).wants or false
    return {kind = name, outputs = item.request, data = item.du, wants_diagnosis = wants, flaws = {}}
  end
  if name == "diagnosis" and not item.request then return diagnosis(item.du) end
  if name == "parameters" and item.request then return parameters(item.du) end
  if name == "configuration" and item.request or name == "get_configuration" and not item.request then
    return M.configuration(item.du)
  end
  if name == "control" and item.request then return control(item.du) end
  return nil
end

return M
