-- The user's lists of parameters: the file of `ds47 params export --wireshark`, read once for each name.

local catalogue = require("ds47.parameters.catalogue")
local naming = require("ds47.parameters.naming")
local parameters = require("ds47.parameters.table")

local M = {}

--- Its name beside the plugin.
M.NAME = "ds47-parameters.tsv"

local folder, taken
local complaint -- what is wrong with the file that is taken, nil where nothing is

--- Says where the plugin is.
function M.configure(place) folder = place end

-- One line: in the window as a message, because nobody sees where it was started; else on stderr. The plugin
-- works without the file.
local function complain(path, problem)
  complaint = problem .. "; ds47 params export --wireshark writes it anew"
  local text = ("ds47: %s %s"):format(path, complaint)
  if gui_enabled() then
    report_failure(text)
  else
    io.stderr:write(text, "\n")
  end
end

local function lists_of(path, named)
  local file = io.open(path, "rb")
  if not file then
    if named then complain(path, "cannot be read") end
    return nil
  end
  local text = file:read("*a")
  file:close()
  local lists, line = parameters.read(text or "")
  if not lists then complain(path, ("is no file of lists: line %d"):format(line)) end
  return lists
end

--- Uses the file that a preference names, else the one beside the plugin, if there is one.
function M.take(name)
  local path = name ~= "" and name or folder and folder .. "/" .. M.NAME or nil
  if path == nil or path == taken then return end
  taken, complaint = path, nil
  local lists = lists_of(path, name ~= "")
  naming.use(lists and lists[1] and catalogue.new(lists) or nil)
end

--- The file that is used, and what is wrong with it; nil where none is there and no preference names one.
function M.state()
  if taken and (complaint or naming.is_used()) then return taken, complaint end
  return nil
end

return M
