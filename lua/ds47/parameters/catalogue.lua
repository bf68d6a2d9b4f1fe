-- What a parameter or a message is on a device, of several lists: the one that is made for it most closely
-- (Python: ds47.parameters.catalogue). The lists come in this order from whoever wrote them.

local M = {}

local Catalogue = {}
Catalogue.__index = Catalogue

--- A catalogue of lists, as table.lua reads them.
function M.new(lists) return setmetatable({ lists = lists }, Catalogue) end

local function fits(list, vendor_id, device_id)
  if list.vendor_id and list.vendor_id ~= vendor_id then return false end
  return list.devices == nil or list.devices[device_id] == true
end

--- What a parameter is on a device: {name, unit, values}; nil where no list says it.
function Catalogue:row(pnu, vendor_id, device_id)
  for _, list in ipairs(self.lists) do
    if list.rows[pnu] and fits(list, vendor_id, device_id) then return list.rows[pnu] end
  end
  return nil
end

--- The text of a message on a device: {letter, number, text}; one with this letter before any other.
function Catalogue:message(number, letter, vendor_id, device_id)
  local other
  for _, list in ipairs(self.lists) do
    for _, each in ipairs(fits(list, vendor_id, device_id) and list.messages[number] or {}) do
      if each.letter == letter then return each end
      other = other or each
    end
  end
  return other
end

return M
