-- Which make the stations of a line are, by the ident numbers that the capture shows (Python:
-- ds47.profibus.idents, where it is explained). What a slave says of itself counts more than what a master
-- sends it.

local dp = require("ds47.profibus.dp")
local tables = require("ds47.spec.tables")

local M = {}

local Idents = {}
Idents.__index = Idents

--- The ident numbers of stations, as they stand in their GSD; the newest of each kind.
-- @param vendor_id whose the stations are whose ident number does not tell it; nil: nobody's
function M.new(vendor_id) return setmetatable({said = {}, sent = {}, vendor_id = vendor_id}, Idents) end

--- An exchange that is over; one without an answer, or that was refused, says nothing.
function Idents:take(exchange)
  local item, answer = exchange.request.item, exchange.answer
  if not answer or not item.da or dp.refuses(answer.item) then return end
  local name = dp.service(item)
  if name == "parameters" then
    self.sent[item.da] = dp.decode(item).ident or self.sent[item.da]
  elseif name == "diagnosis" then
    local told = dp.decode(answer.item)
    self.said[item.da] = told and told.ident or self.said[item.da]
  end
end

--- Vendor id, and family of parameters: by the ident number of a station, else the assumed vendor. The third
-- value is true where it is assumed.
function Idents:whose(station)
  local ident = self.said[station] or self.sent[station] or -1
  local vendor_id = tables.profibus.vendors[ident]
  if vendor_id == nil then return self.vendor_id, nil, self.vendor_id ~= nil end
  return vendor_id, tables.profibus.families[ident], false
end

--- Whether master and station name the same ident number, and it is known.
function Idents:agree(station)
  local sent = self.sent[station] or -1
  return tables.profibus.vendors[sent] ~= nil and (self.said[station] or sent) == sent
end

return M
