-- What lists of a user say of parameters: name and unit, where the drive says none itself, and texts of
-- values (Python: ds47.parameters.naming). The plugin says which catalogue there is; without one nothing
-- happens here.

local M = {}

local catalogue

--- Takes a catalogue (catalogue.lua), or none.
function M.use(found) catalogue = found end

function M.is_used() return catalogue ~= nil end

local function texts(item, row, vendor_id, device_id)
  local found
  local letter = item.listed and item.listed.messages
  if item.attribute ~= "value" or item.format and item.format:find("^Float") then return nil end
  for _, value in ipairs(item.values or {}) do
    local text = row and row.values[value]
    if not text and letter and type(value) == "number" and value > 0 and value == math.floor(value) then
      local message = catalogue:message(value, letter, vendor_id, device_id)
      text = message and ("%s%05d %s"):format(message.letter, message.number, message.text)
    end
    if text then
      found = found or {}
      found[value] = text
    end
  end
  return found
end

--- What lists say of a parameter: {unit, described, value_texts} as they are then; nil where they say
-- nothing.
-- @param device_id of PROFINET; nil where it is not known
function M.explained(item, vendor_id, device_id)
  if catalogue == nil or item.pnu == nil then return nil end
  local row, said = catalogue:row(item.pnu, vendor_id, device_id), item.described
  local value_texts = texts(item, row, vendor_id, device_id)
  if row == nil and value_texts == nil then return nil end
  local found = { unit = item.unit, described = said, value_texts = value_texts }
  if row and said == nil then
    found.unit, found.described = row.unit or item.unit, { name = row.name }
  elseif row and said.name == nil then
    found.described = { name = row.name, frames = said.frames }
  end
  return found
end

--- Gives the parameters of a transaction of PKW what lists say of them.
function M.explain(item)
  if catalogue == nil then return end
  for _, each in ipairs(item.parameters) do
    local found = M.explained(each, item.vendor_id)
    if found then
      each.unit, each.described, each.value_texts = found.unit, found.described, found.value_texts
    end
  end
end

return M
