--- Statistics and reports at the end of a run: what `tshark -X lua_script1:statistics` prints.
-- Here are the arguments of the script and the Listener; the texts come from ds47.report, that of drives from
-- drives_text.lua, and files are written by saving.lua. Does nothing when loaded, only when called.

local arrays = require("ds47.support.arrays")
local saving = require("ds47_ws.saving")

local M = {}

--- What can be asked for: name -> module and function that give the text, and whether it takes a display
-- filter. The report is about all of the capture.
local KINDS = {
  statistics = { "ds47.report.statistics", "text", true },
  report = { "ds47.report.text", "report", false },
  csv = { "ds47.report.csv", "report", true },
  drives = { "ds47_ws.drives_text", "text", true },
}
local USAGE = "statistics[=FILE], report[=FILE], csv[=FILE], drives[=FILE], filter=DISPLAY FILTER, "
  .. "sort=count, time, frame or device, name=NAME, lang=en or lang=zh"

local function complain(text) io.stderr:write("ds47: ", text, "\n") end

--- What the arguments of the script ask for: {outputs = array of {kind, file or nil}, name, lang, filter,
-- sort}.
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
    elseif key == "sort" and require("ds47.report.statistics").ORDERS[value] then
      wanted.sort = value
    elseif key == "filter" and value and value ~= "" then
      wanted.filter = value
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

-- What of a complete result has a frame among those that a display filter shows: transactions, findings on
-- such a frame or about such a transaction, and events of drives.
local function narrowed(result, shown)
  local kept = {}
  local function is_shown(frame) return frame and shown[frame] end
  local function has_shown(read) return is_shown(read.request) or is_shown(read.response) end
  local transactions = arrays.filtered(result.transactions, function(item)
    local frames = item.frames
    kept[item.id] = is_shown(frames.write_request) or is_shown(frames.write_response)
      or is_shown(frames.read_request) or is_shown(frames.read_response)
      or arrays.any(frames.polls, has_shown) or arrays.any(frames.rereads, has_shown)
    return kept[item.id]
  end)
  local findings = arrays.filtered(result.findings, function(finding)
    return is_shown(finding.frame) or finding.transaction and kept[finding.transaction]
  end)
  local timelines = arrays.mapped(result.timelines, function(timeline)
    local events = arrays.filtered(timeline.events, function(event) return is_shown(event.frame) end)
    return setmetatable({ events = events }, { __index = timeline })
  end)
  local found = { transactions = transactions, findings = findings, timelines = timelines }
  return setmetatable(found, { __index = result })
end

--- A Listener that notes which frames a display filter shows; nil of a filter that is not valid.
-- @return it, and a table that has them: frame -> true
function M.listener(filter)
  local shown = {}
  local is_valid, listener = pcall(Listener.new, "frame", filter)
  if not is_valid then return nil end
  function listener.packet(pinfo) shown[pinfo.number] = true end
  return listener, shown
end

--- The options of a text with a display filter, and the complete result as far as it shows it.
-- @param filter nil, or a filter with `shown` = the frames that it shows; nil where it is not valid
function M.filtered(track, options, filter, shown)
  local result = track.result()
  if filter == nil then return options, result end
  options.filter = { text = filter, all = shown and #result.transactions }
  return options, shown and narrowed(result, shown) or result
end

--- The text of one kind, "statistics", "report", "csv" or "drives", of a complete result.
function M.text(kind, result, options)
  local module, name = KINDS[kind][1], KINDS[kind][2]
  return require(module)[name](result, options)
end

local function print_all(track, frames, wanted, shown)
  local options, result = M.filtered(track, M.options(track, frames, wanted), wanted.filter, shown)
  options.order = wanted.sort and { by = wanted.sort }
  for _, output in ipairs(wanted.outputs) do
    local text = M.text(output.kind, KINDS[output.kind][3] and result or track.result(), options)
    if output.file then
      local saved, more = saving.write(output.file, text)
      if not saved then
        complain("cannot write " .. more)
      elseif more then
        complain(output.file .. ": was there, and is overwritten")
      end
    else
      io.stdout:write(text)
    end
  end
end

local function nothing() end

--- A file begins: from now on filters may have fields of plugins.
M.begin = nothing

--- Prints at the end of a tshark run what the arguments of the script ask for.
-- @param track the analysis of the open file: track.result() is what Analysis:ended() gives
-- @param arguments array of the arguments of the script, one for each -X lua_script1:ARGUMENT
function M.register(track, arguments)
  local wanted, unknown = M.parse(arguments)
  for _, argument in ipairs(unknown) do complain("unknown argument " .. argument .. "; known: " .. USAGE) end
  if #wanted.outputs == 0 or gui_enabled() then return end
  local frames, shown = 0, nil
  function M.begin()
    M.begin = nothing
    if not wanted.filter then return end
    local filtering
    filtering, shown = M.listener(wanted.filter)
    if not filtering then complain("not a display filter: " .. wanted.filter) end
  end
  local listener = Listener.new("frame")
  function listener.packet(pinfo) frames = pinfo.number end
  function listener.reset() frames = 0 end
  function listener.draw()
    if shown or not wanted.filter then print_all(track, frames, wanted, shown) end
  end
end

return M
