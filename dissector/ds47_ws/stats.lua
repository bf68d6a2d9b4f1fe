--- Statistics and reports at the end of a run: what `tshark -X lua_script1:statistics` prints.
-- Here are the arguments of the script, the Listener and the files; the texts come from ds47.statistics,
-- ds47.report_text and ds47.report_csv, that of drives from drives_text.lua. Does nothing when loaded, only
-- when called.

local M = {}

--- What can be asked for: name -> module and function that give the text.
local KINDS = {
  statistics = { "ds47.report.statistics", "text" },
  report = { "ds47.report.text", "report" },
  csv = { "ds47.report.csv", "report" },
  drives = { "ds47_ws.drives_text", "text" },
}
local USAGE = "statistics[=FILE], report[=FILE], csv[=FILE], drives[=FILE], name=NAME, lang=en or lang=zh"

local function complain(text)
  io.stderr:write("ds47: ", text, "\n")
end

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
    path = wanted and wanted.name or name or "-",
    lang = wanted and wanted.lang or track.lang or "en",
    frames = frames,
  }
end

--- The text of one kind: "statistics", "report", "csv" or "drives".
function M.text(kind, track, options)
  local module, name = KINDS[kind][1], KINDS[kind][2]
  return require(module)[name](track.result(), options)
end

-- First bytes of what nobody writes over: pcap of either byte order and unit, pcapng, gzip and zstd,
-- in which a capture may be.
local CAPTURES = {
  "\xA1\xB2\xC3\xD4", "\xD4\xC3\xB2\xA1", "\xA1\xB2\x3C\x4D", "\x4D\x3C\xB2\xA1",
  "\xA1\xB2\xCD\x34", "\x34\xCD\xB2\xA1", "\x0A\x0D\x0D\x0A", "\x1F\x8B", "\x28\xB5\x2F\xFD",
}

local function holds_capture(file)
  local head = file:read(4) or ""
  for _, magic in ipairs(CAPTURES) do
    if head:sub(1, #magic) == magic then
      return true
    end
  end
  return false
end

--- Writes a text to a file as it is, but never over a capture. Returns true, or nil and what went wrong.
function M.save(path, text)
  local there = io.open(path, "r+b") -- not "rb": that would wait for a writer of a pipe
  local is_file = there and there:seek("end") -- a pipe cannot be asked
  if is_file and there:seek("set") and holds_capture(there) then
    there:close()
    return nil, path .. ": a capture or a packed file, which is not written over: choose another name"
  end
  local file, problem = io.open(path, "wb")
  if there then
    there:close()
  end
  if not file then
    return nil, problem
  end
  local written, reason = file:write(text)
  local closed, late = file:close()
  if not (written and closed) then
    return nil, reason or late
  end
  return true
end

local function print_all(track, frames, wanted)
  local options = M.options(track, frames, wanted)
  for _, output in ipairs(wanted.outputs) do
    local text = M.text(output.kind, track, options)
    if output.file then
      local saved, problem = M.save(output.file, text)
      if not saved then
        complain("cannot write " .. problem)
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
  for _, argument in ipairs(unknown) do
    complain("unknown argument " .. argument .. "; known: " .. USAGE)
  end
  if #wanted.outputs == 0 or gui_enabled() then
    return
  end
  local frames = 0
  local listener = Listener.new("frame")
  function listener.packet(pinfo)
    frames = pinfo.number
  end
  function listener.reset()
    frames = 0
  end
  function listener.draw()
    print_all(track, frames, wanted)
  end
end

return M
