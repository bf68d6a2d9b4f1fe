-- The file of lists that `ds47 params export` writes for the plugin (Python: ds47.parameters.table, where its
-- lines are explained). Nothing is looked up here (catalogue.lua), and no file is opened.

local push = require("ds47.support.arrays").push

local M = {}

--- The first line of such a file.
M.HEAD = "ds47-parameters\t1"

local UNESCAPED = { ["\\t"] = "\t", ["\\n"] = "\n", ["\\r"] = "\r", ["\\\\"] = "\\" }
local MOST_LINES = 1000000

local function plain(text) return (text:gsub("\\[tnr\\]", UNESCAPED)) end

local function cells(line)
  local found = {}
  for cell in (line .. "\t"):gmatch("([^\t]*)\t") do found[#found + 1] = cell end
  return found
end

local function number(text, most)
  local found = text and text:find("^%d+$") and tonumber(text)
  return found and found <= most and found or nil
end

local function optional(text) return text ~= "" and plain(text) or nil end

local add = {}

-- list, vendor id or nothing, device ids with commas between them or nothing
function add.list(lists, cell)
  local vendor_id, devices = number(cell[2], 0xFFFF), nil
  if cell[2] == nil or cell[3] == nil or (cell[2] ~= "" and not vendor_id) then return false end
  for text in cell[3]:gmatch("[^,]+") do
    local id = number(text, 0xFFFF)
    if not id then return false end
    devices = devices or {}
    devices[id] = true
  end
  lists[#lists + 1] = { vendor_id = vendor_id, devices = devices, rows = {}, messages = {} }
  return true
end

-- parameter, number, name, unit or nothing, then value and text again and again
function add.parameter(lists, cell)
  local list, pnu = lists[#lists], number(cell[2], 0xFFFF)
  if not (list and pnu and cell[3] and cell[3] ~= "" and cell[4] and #cell % 2 == 0) then return false end
  local row = { name = plain(cell[3]), unit = optional(cell[4]), values = {} }
  for place = 5, #cell, 2 do
    local value = cell[place]:find("^%-?%d+$") and tonumber(cell[place])
    if not value then return false end
    row.values[value] = plain(cell[place + 1])
  end
  list.rows[pnu] = row
  return true
end

-- message, letter, number, text
function add.message(lists, cell)
  local list, value = lists[#lists], number(cell[3], 999999)
  if not (list and value and #cell == 4 and cell[2]:find("^%u$")) then return false end
  push(list.messages, value, { letter = cell[2], number = value, text = plain(cell[4]) })
  return true
end

--- The lists of a file, in their order: an array of {vendor_id, devices = set or nil, rows, messages}.
-- @return nil and the number of the line that is broken, where one is
function M.read(text)
  local lists, count = {}, 0
  for line in (text:gsub("\r\n", "\n") .. "\n"):gmatch("([^\n]*)\n") do
    count = count + 1
    local cell = cells(line)
    local kind = add[cell[1]]
    local fine = count == 1 and line == M.HEAD
    if count > 1 then fine = line == "" or kind and kind(lists, cell) end
    if not fine or count > MOST_LINES then return nil, count end
  end
  return lists
end

return M
