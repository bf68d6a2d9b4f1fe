-- PKW and PZD in the data exchange of PROFIBUS: what Chk_Cfg says of its modules, as relations
-- (docs/profibus.md 3).
--
-- Hears of the exchanges of a line. Which modules a configuration has is dp.lua; what the words mean is the
-- business of channels.lua and of those behind it, for PROFINET and PROFIBUS alike.

local dp = require("ds47.profibus.dp")
local flat = require("ds47.support.flat").copy
local relations = require("ds47.cyclic.relations")
local tables = require("ds47.spec.tables")

local char, format = string.char, string.format

local M = {}

local LAST = 126 -- the highest address of a station

local ROWS = {} -- PPO by their numbers
for _, row in ipairs(tables.profibus.ppos) do ROWS[row.number] = row end

local Ppo = {}
Ppo.__index = Ppo

--- Stations and their PPO as they are typed, `3=ppo1 4=ppo3`, as a table; what is none is passed over.
function M.list(text)
  local found = {}
  for station, number in text:lower():gmatch("(%d+)=ppo(%d+)") do
    local address, known = tonumber(station), ROWS[tonumber(number)]
    if known and address <= LAST then found[address] = known.number end
  end
  return found
end

--- Feeds channels with the data of stations whose configuration was seen, or whose PPO is named.
-- @param channels takes the relations, and the data (channels.lua)
-- @param named  numbers of PPO by station, for captures without their Chk_Cfg, which counts more
-- @param idents knows of which make stations are (profibus/idents.lua); it hears of an exchange first
function M.new(channels, named, idents)
  return setmetatable({
    channels = channels,
    named = flat(named),
    at_work = {}, -- masters and stations of a PPO that is named, as a set
    idents = idents,
  }, Ppo)
end

--- What stands for a sender where frames have stations, and neither MAC address nor frame id: sender and
-- receiver as bytes.
M.source = char

-- The telegrams that the process data may be.
local function telegrams_of(told, maker)
  local numbers, with_pkw = {}, false
  for _, module in ipairs(told.modules) do with_pkw = with_pkw or module.role == "PKW" end
  for _, module in ipairs(told.modules) do
    if module.role == "PZD" and module.outputs and module.inputs then
      relations.add_telegrams(numbers, module.outputs.length, module.inputs.length, with_pkw, maker)
    end
  end
  return numbers
end

-- Chk_Cfg with an ident number that is known and agreed tells that PKW is PKW; PZD is proved by its
-- words.
local function certainty_of(is_pkw, frame, agreed)
  if not frame then return relations.NAMED end
  return is_pkw and agreed and relations.CONFIGURED or relations.LENGTHS
end

--- The channels of a configuration; none where it is no PPO that is known.
-- @param told as `dp.configuration` gives it
-- @param vendor_id of the maker of the drive; nil where that is not known
-- @param frame of Chk_Cfg; nil where a user named the PPO
-- @param family of the parameters of the drive; nil where that is not known
-- @param agreed whether master and station name the same ident number, which is known
function M.relations(master, station, told, vendor_id, frame, family, agreed)
  local found, output, input, telegrams = {}, 0, 0, telegrams_of(told, vendor_id)
  for _, module in ipairs(told.modules) do
    local out = module.outputs and module.outputs.length or 0
    local in_ = module.inputs and module.inputs.length or 0
    if module.role then
      local is_pkw = module.role == "PKW"
      local channel = is_pkw and relations.PKW or relations.PZD
      found[#found + 1] = {
        channel = channel, controller = format("dp%d", master), device = format("dp%d", station),
        vendor_id = vendor_id, family = family, telegrams = telegrams,
        output = relations.bare_side(M.source(master, station), 0, output, out, channel),
        input = relations.bare_side(M.source(station, master), 0, input, in_, channel),
        frame = frame, certainty = certainty_of(is_pkw, frame, agreed),
      }
    end
    output, input = output + out, input + in_
  end
  return found
end

-- The channels of a configuration, by what is known of the station.
local function relations_of(self, master, station, configuration, frame)
  local vendor_id, family = self.idents:whose(station)
  local agreed = self.idents:agree(station)
  return M.relations(master, station, dp.configuration(configuration), vendor_id, frame, family, agreed)
end

-- Whether data of a station whose PPO is named has its length; its channels begin with the first data.
local function fits(self, master, station, output, input)
  local row, key, length, identifiers = ROWS[self.named[station]], M.source(master, station), 0, {}
  for number, each in ipairs(row.modules) do
    length, identifiers[number] = length + each, char(0xF0 + each / relations.WORD - 1)
  end
  if not self.at_work[key] then
    self.at_work[key] = true
    local found = relations_of(self, master, station, table.concat(identifiers), nil)
    self.channels:configured(found, key, M.source(station, master))
  end
  return #output == length and #input == length
end

--- An exchange that is over; one without an answer, or that was refused, says nothing.
function Ppo:take(exchange)
  local item, answer = exchange.request.item, exchange.answer
  if not answer or not item.request or not item.sa or not item.da or dp.refuses(answer.item) then return end
  local name, frame = dp.service(item), exchange.request.frame
  if name == "exchange" then
    if self.named[item.da] and not fits(self, item.sa, item.da, item.du, answer.item.du) then return end
    self.channels:exchanged(M.source(item.sa, item.da), item.du, frame, exchange.request.time_ns)
    self.channels:exchanged(M.source(item.da, item.sa), answer.item.du, answer.frame, answer.time_ns)
  elseif name == "configuration" then
    self.named[item.da] = nil
    local found = relations_of(self, item.sa, item.da, item.du, frame)
    self.channels:configured(found, M.source(item.sa, item.da), M.source(item.da, item.sa), frame)
  end
end

return M
