--- Statistics and reports at the end of a run: what `tshark -X lua_script1:statistics` prints.
-- Here are the arguments of the script and the Listener; the texts come from ds47.report, that of drives from
-- drives_text.lua, and files are written by saving.lua. Does nothing when loaded, only when called.

local saving = require("ds47_ws.saving")

local M = {}

--- What can be asked for: name -> module and function that give the text.
local KINDS = {
  statistics = { "ds47.report.statistics", "text" },
  report = { "ds47.report.text", "report" },
  csv = { "ds47.report.csv", "report" },
  drives = { "ds47_ws.drives_text", "text" },
}
local USAGE = "statistics[=FILE], report[=FILE], csv[=FILE], drives[=FILE], name=NAME, lang=en or lang=zh"

local function complain(text) io.stderr:write("ds47: ", text, "\n") end

--- What the arguments of the script ask for: {outputs = array of {kind, file or nil}, name, lang}.
-- @return that, and an array of the arguments that mean nothing
function M.parse(arguments)
  local wanted, unknown = { outputs = {} }, {}
  for _, argument in ipairs(arguments or {}) do
    local key, value = tostring(argument):match("^([^=]*)=(.*)$")
    key = key or tostring(argument)
    if KINDS[key] then
      wanted.outputs[#wanted.outputs + 1] = { kind = key, file = value ~= "" and value or nil }
    elseif key == "name" and value then
      wanted.name = value
    elseif key == "lang" and (value == "en" or value == "zh") then
      wanted.lang = value
    else
      unknown[#unknown + 1] = tostring(argument)
    end
  end
  return wanted, unknown
end

--- Options of a report about the file that is open: its name, its frames, the language.
-- @param track the analysis of the open file (ds47_ws.track)
-- @param frames how many frames it has, nil where nobody counted
-- @param wanted nil or {name, lang}, which come first
function M.options(track, frames, wanted)
  local name = track.name and track.name()
  return {
    path = wanted and wanted.name or name,
    lang = wanted and wanted.lang or track.lang or "en",
    frames = frames,
  }
end

--- The text of one kind: "statistics", "report", "csv" or "drives".
function M.text(kind, track, options)
  local module, name = KINDS[kind][1], KINDS[kind][2]
  return require(module)[name](track.result(), options)
end

local function print_all(track, frames, wanted)
  local options = M.options(track, frames, wanted)
  for _, output in ipairs(wanted.outputs) do
    local text = M.text(output.kind, track, options)
    if output.file then
      local saved, more = saving.write(output.file, text)
      if not saved then
        complain("cannot write " .. more)
      elseif more then
        complain(output.file .. ": was there, and is written over")
      end
    else
      io.stdout:write(text)
    end
  end
end

--- Prints at the end of a tshark run what the arguments of the script ask for.
-- @param track the analysis of the open file: track.result() is what Analysis:ended() gives
-- @param arguments array of the arguments of the script, one for each -X lua_script1:ARGUMENT
function M.register(track, arguments)
  local wanted, unknown = M.parse(arguments)
  for _, argument in ipairs(unknown) do complain("unknown argument " .. argument .. "; known: " .. USAGE) end
  if #wanted.outputs == 0 or gui_enabled() then return end
  local frames = 0
  local listener = Listener.new("frame")
  function listener.packet(pinfo) frames = pinfo.number end
  function listener.reset() frames = 0 end
  function listener.draw() print_all(track, frames, wanted) end
end

return M
