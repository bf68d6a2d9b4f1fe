-- The profile of Wireshark (columns, colours, filter buttons, graphs), for whoever has the plugin as one
-- file.
--
-- `ds47 plugin install` puts it there, too. The single file carries it as a module, a checkout has it beside
-- the plugin. Needs `Dir` of Wireshark; does nothing when loaded.

local saving = require("ds47_ws.saving")
local say = require("ds47.report.formatting").say

local M = {}

local NAME = "DS47"
local CARRIED = "ds47_ws.profile_files" -- a module of the single file: name -> content

local folder = "profile"

--- Says where the plugin is.
function M.configure(place) folder = place .. "/profile" end

function M.path() return Dir.personal_config_path("profiles/" .. NAME) end

function M.is_there() return Dir.exists(M.path()) == true end

-- The files of a folder: name -> content.
local function read(place)
  local files = {}
  for name in Dir.open(place) do
    local file = io.open(place .. "/" .. name, "rb")
    files[name] = file and file:read("*a") or nil
    if file then file:close() end
  end
  return files
end

--- The files of the profile by their names; nil where this copy of the plugin has none.
function M.files()
  if package.preload[CARRIED] then return require(CARRIED) end
  return Dir.exists(folder) and read(folder) or nil
end

-- Writes all of it or nothing. Gives why it could not.
local function write(path, files)
  Dir.make(Dir.personal_config_path("profiles"))
  if not Dir.make(path) then return path end
  for name, content in pairs(files) do
    local written, problem = saving.write(path .. "/" .. name, content)
    if not written then
      Dir.remove_all(path)
      return problem
    end
  end
  return nil
end

--- Adds the profile; one that is there stays.
-- @return the lines that say what became of it
function M.add(lang)
  local path, there = M.path(), M.is_there()
  local problem = not there and write(path, M.files()) or nil
  if problem then return { say(lang, "menu_profile_failed", { problem = problem }) } end
  return {
    say(lang, there and "menu_profile_there" or "menu_profile_added", { path = path }),
    say(lang, "menu_profile_choose"),
  }
end

return M
