--- Statistics > DS47 Statistics, DS47 Drives; Tools > DS47: the same, save a report, add the profile, check
-- the installation.
-- The texts come from ds47.report.statistics, ds47.report.text and ds47.report.csv (through ds47_ws.stats).
-- Does nothing when loaded, only when called.

local lists = require("ds47_ws.lists")
local profile = require("ds47_ws.profile")
local saving = require("ds47_ws.saving")
local say = require("ds47.report.formatting").say
local stats = require("ds47_ws.stats")

local M = {}

local OLDEST = { 3, 4 } -- the oldest Wireshark that the plugin is tested with
local DRIVES = "Drives: control and status word"
-- Buttons, and what they sort the tables of statistics by.
local SORTS = {
  { "By count", "count" }, { "By time", "time" }, { "By frame", "frame" }, { "By device", "device" },
}
local NAME = "^ds47.*%.lua$" -- a plugin file: ds47.lua or the single file ds47-2_0_0_dev0.lua

local function show(title, text)
  local window = TextWindow.new(title)
  window:set(text)
  return window
end

--- How many frames the open file has: the highest number that a Listener sees when all are gone through.
local function count_frames()
  local frames = 0
  local listener = Listener.new("frame")
  function listener.packet(pinfo) frames = math.max(frames, pinfo.number) end
  retap_packets()
  listener:remove()
  return frames
end

-- The filter of the main window, and the frames that it shows; nil without one, and no frames where it is not
-- valid.
local function main_filter()
  local filter = get_filter()
  if not filter or filter:match("^%s*$") then return nil end
  local listener, shown = stats.listener(filter)
  if listener then
    retap_packets()
    listener:remove()
  end
  return filter, shown
end

-- A window with one of the texts of stats.lua about what the display filter shows. *Refresh* takes the filter
-- that there is then, and what a capture has brought since.
-- @param sorts names of buttons and what they sort tables by; the same one again turns the order round
local function show_text(track, kind, title, sorts)
  local window, options, result, text, order
  local function show_again()
    options.order = order
    text = stats.text(kind, result, options)
    window:set(text)
  end
  local function fill()
    options, result = stats.filtered(track, stats.options(track), main_filter())
    show_again()
  end
  window = TextWindow.new(title)
  fill()
  for _, sort in ipairs(sorts) do
    window:add_button(sort[1], function()
      local by = sort[2]
      order = { by = by, reversed = order ~= nil and order.by == by and not order.reversed }
      show_again()
    end)
  end
  window:add_button("Copy", function() copy_to_clipboard(text) end)
  window:add_button("Refresh", fill)
end

-- Saving

local function home() return os.getenv("HOME") or os.getenv("USERPROFILE") or "." end

local ENDINGS = { report = ".txt", csv = ".csv" }

-- What the user wrote as a path without ending; nil where that is nothing.
local function chosen_name(text)
  local name = text:gsub("^%s+", ""):gsub("%s+$", ""):gsub("^~", home):gsub("%.txt$", ""):gsub("%.csv$", "")
  return name ~= "" and name or nil
end

--- Writes the report as NAME.txt and NAME.csv, where one of them is there as NAME-2, and gives the lines that
-- say what became of it.
-- @param texts a function that gives the text of "report" and of "csv"
-- @param text what the user wrote
function M.save(texts, text, lang)
  local wanted = chosen_name(text)
  if wanted == nil then return { say(lang, "menu_no_name") } end
  local name, reason = saving.free_name(wanted, { ENDINGS.report, ENDINGS.csv })
  if name == nil then return { say(lang, "menu_not_saved", { problem = reason }) } end
  local lines = {}
  for _, kind in ipairs({ "report", "csv" }) do
    local path = name .. ENDINGS[kind]
    local saved, problem = saving.write(path, texts(kind))
    lines[#lines + 1] = saved and say(lang, "menu_saved", { path = path })
      or say(lang, "menu_not_saved", { problem = problem })
  end
  if name ~= wanted then lines[#lines + 1] = say(lang, "menu_was_there", { path = wanted }) end
  return lines
end

local function ask_and_save(track)
  local lang = stats.options(track).lang
  local title, where = say(lang, "menu_save"), say(lang, "menu_where")
  local function chosen(text)
    local options = stats.options(track, count_frames())
    local lines = M.save(function(kind)
      return stats.text(kind, track.result(), options)
    end, text, lang)
    show(title, table.concat(lines, "\n") .. "\n")
  end
  -- Wireshark before 3.6 knows only labels, and no suggestion for a field.
  local name = home() .. "/ds47-report"
  name = saving.free_name(name, { ENDINGS.report, ENDINGS.csv }) or name
  if not pcall(new_dialog, title, chosen, { name = where, value = name }) then
    new_dialog(title, chosen, where)
  end
end

-- Checking the installation

local function about_version(add)
  local version = get_version()
  local major, minor = version:match("^(%d+)%.(%d+)")
  major, minor = tonumber(major) or 0, tonumber(minor) or 0
  local old = major < OLDEST[1] or major == OLDEST[1] and minor < OLDEST[2]
  local note = old and string.format("  TOO OLD: %d.%d or later is needed", OLDEST[1], OLDEST[2]) or ""
  add("Wireshark           " .. version .. note)
  add("Lua                 " .. _VERSION:gsub("^Lua ", ""))
end

local function same_file(one, other)
  local function plain(path) return (path:gsub("\\", "/"):gsub("/+", "/"):lower()) end
  return plain(one) == plain(other)
end

--- Adds the plugin files of a folder and of its folders, `depth` levels down.
local function find_plugins(folder, found, depth)
  if not folder or folder == "" or not Dir.exists(folder) then return end
  for entry in Dir.open(folder) do
    local path = folder:gsub("[/\\]+$", "") .. "/" .. entry
    if entry:match(NAME) then
      found[#found + 1] = path
    elseif depth > 0 and Dir.exists(path) and entry ~= "ds47_ws" then
      find_plugins(path, found, depth - 1)
    end
  end
end

local function about_copies(add, info)
  local personal, global = Dir.personal_plugins_path(), Dir.global_plugins_path()
  add("Personal plugins    " .. personal)
  add("Global plugins      " .. global)
  local found, others = {}, 0
  find_plugins(personal, found, 2)
  find_plugins(global, found, 2)
  for _, path in ipairs(found) do
    if not (info.path and same_file(path, info.path)) then
      others = others + 1
      add("ANOTHER COPY        " .. path)
    end
  end
  local only = "                    Only the first one that is loaded works: remove the others."
  add(others > 0 and only or "Other copies        none")
end

local function about_superuser(add)
  -- Wireshark 4.4 and later do not say whether they run as the superuser: the home folder tells.
  if not running_superuser and os.getenv("HOME") ~= "/root" then
    add("Superuser           no")
    return
  end
  add("Superuser           YES: run Wireshark as an ordinary user.")
  add("                    From 4.4 on it silently loads no personal plugin as root.")
end

-- The profile, and the user's lists of parameters where there are some.
local function about_settings(add)
  local none = "none: Tools > DS47 > Add profile DS47 puts it there"
  add("Profile DS47        " .. (profile.is_there() and profile.path() or none))
  local path, problem = lists.state()
  if path then
    add("Lists               " .. path)
    add(problem and "                    " .. problem or nil)
  end
end

local function about_capture(add, track)
  local result = track.result()
  local rpc = result.rpc or {}
  add(string.format("Open capture        %d RPC requests, %d responses, %d transactions", rpc.requests or 0,
    rpc.responses or 0, #result.transactions))
  if #result.transactions == 0 then
    add("                    None? Of PROFINET only IPv4 must be enabled under Analyze >")
    add("                    Enabled Protocols, DCERPC and PNIO need not; further record")
    add("                    indices can be named under Edit > Preferences > Protocols >")
    add("                    DS47. 0 requests: no record call passed where it was captured.")
  end
end

--- What can be seen of the installation from inside, as text.
-- @param info {version, path}: of the plugin, and the file it was loaded from
function M.check(track, info)
  local lines = {}
  local function add(line) lines[#lines + 1] = line end
  add("DS47 plugin         " .. (info.version or "?"))
  add("Loaded from         " .. (info.path or "?"))
  about_version(add)
  about_copies(add, info)
  about_superuser(add)
  about_settings(add)
  about_capture(add, track)
  add("")
  add("From outside `ds47 plugin doctor` sees more.")
  add("")
  return table.concat(lines, "\n")
end

--- Adds the menu; without a window nothing happens.
-- @param info nil or {version, path}
function M.register(track, info)
  if not gui_enabled() then return end
  info = info or {}
  local function entry(name, action) register_menu("DS47/" .. name, action, MENU_TOOLS_UNSORTED) end
  local function statistics() show_text(track, "statistics", "DS47 statistics", SORTS) end
  local function drives() show_text(track, "drives", "DS47 drives", {}) end
  -- Before 4.6 the menu Statistics has no submenus of scripts: a name with a slash stands there as it is.
  register_menu("DS47 Statistics", statistics, MENU_STAT_UNSORTED)
  register_menu("DS47 Drives", drives, MENU_STAT_UNSORTED)
  entry("Statistics", statistics)
  entry(DRIVES, drives)
  entry("Save report", function() ask_and_save(track) end)
  if profile.files() then
    entry("Add profile DS47", function()
      local lang = stats.options(track).lang
      show(say(lang, "menu_profile"), table.concat(profile.add(lang), "\n") .. "\n")
    end)
  end
  entry("Check installation", function() show("DS47: check installation", M.check(track, info)) end)
end

return M
