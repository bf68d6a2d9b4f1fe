-- Which make the stations of a line are, by the ident numbers that the capture shows (Python:
-- ds47.profibus.idents, where it is explained). What a slave says of itself counts more than what a master
-- sends it.

local dp = require("ds47.profibus.dp")
local tables = require("ds47.spec.tables")

local M = {}

local Idents = {}
Idents.__index = Idents

--- The ident numbers of stations, as they stand in their GSD; the newest of each kind.
function M.new() return setmetatable({said = {}, sent = {}}, Idents) end

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

--- The ident number that a station was parameterised with; nil where no frame has said it yet.
function Idents:sent_to(station) return self.sent[station] end

--- The ident number of a station; nil where no frame has said it yet.
function Idents:of(station) return self.said[station] or self.sent[station] end

--- Of which family its parameters are (the list of parameters); nil where that is not known.
function Idents:family(station) return tables.profibus.families[self:of(station) or -1] end

return M
