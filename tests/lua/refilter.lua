-- When the display filter of a window is applied again (ds47_ws.refilter), with a Wireshark that is played.
-- Prints what happened in each scene, a line each.

local root = arg[0]:match("^(.*[/\\])[^/\\]*$") or "./"
package.path = root .. "../../lua/?.lua;" .. root .. "../../dissector/?.lua;" .. package.path

local collector = require("ds47_ws.collector")

-- Wireshark: listeners in a row, the newest in front, drawn where something came since; and its filter field.
local listeners, field, log, reading = {}, "", {}, false

local function note(text) log[#log + 1] = text end

local function draw()
  local drawn = {}
  for index = #listeners, 1, -1 do drawn[#drawn + 1] = listeners[index] end
  for _, each in ipairs(drawn) do
    if not each.gone then
      if each.dirty and each.draw then each.draw() end
      assert(not each.gone, "a listener is gone while it is drawn")
      each.dirty = false
    end
  end
end

local Fake = {}
Fake.__index = Fake

function Fake:remove()
  assert(not self.gone, "removed twice")
  self.gone = true
  for index, each in ipairs(listeners) do
    if each == self then table.remove(listeners, index) end
  end
end

_G.Listener = {
  new = function(_, filter)
    assert(filter ~= "ds47.pnu ==", "no filter")
    listeners[#listeners + 1] = setmetatable({ dirty = true }, Fake)
    return listeners[#listeners]
  end,
}
_G.get_filter = function() return field end
_G.set_filter = function(text) field = text end

local refilter -- of a scene

local function frames(count, wanted)
  for _ = 1, count do collector.called() end
  if wanted then refilter.wanted = true end
end

_G.apply_filter = function()
  note(reading and "APPLIED WHILE READING" or "applied")
  frames(5) -- a pass over all frames, which come again
  for _, each in ipairs(listeners) do each.dirty = true end
  draw()
end

local window = {}
function window.set(_, text) note(text:sub(1, 26)) end
_G.TextWindow = {
  new = function()
    note("window")
    return window
  end,
}

local function ticks(count)
  for _ = 1, count do draw() end
end

local function opened()
  refilter.reset()
  for _, each in ipairs(listeners) do each.dirty = true end
end

-- A file is read; `drawn` is how often listeners are drawn in the midst of it.
local function read(count, drawn, wanted)
  opened()
  reading = true
  for _ = 1, drawn do
    frames(count, wanted)
    draw()
  end
  frames(count, wanted)
  reading = false
  draw()
end

local function scene(name, filter, play)
  package.loaded["ds47_ws.refilter"] = nil
  listeners, field, log, reading = {}, filter, {}, false
  refilter = require("ds47_ws.refilter")
  refilter.begin(function() return "en" end)
  ticks(2)
  play()
  ticks(60)
  print(name .. ": " .. (#log == 0 and "nothing" or table.concat(log, ", ")))
  assert(#listeners <= 2, "listeners pile up")
  local before = listeners[#listeners]
  ticks(1)
  assert(listeners[#listeners] == before or refilter.wanted, "nothing happens, and still it waits")
end

scene("a short file", "ds47.state", function()
  read(100, 0, true)
  assert(#log == 1, "at once")
end)
scene("a long file", "ds47.state", function() read(5000, 30, true) end)
scene("a macro", "${ours}", function() read(5000, 0, true) end)
scene("a filter that asks for nothing of ours", "ds47 or udp", function() read(5000, 0, false) end)
scene("another filter, and a graph of ours", "udp", function() read(5000, 30, true) end)
scene("no filter", "", function() read(5000, 0, true) end)
scene("two files", "ds47", function()
  read(100, 0, true)
  read(100, 0, true)
end)
scene("a file after long idleness", "ds47", function()
  ticks(100)
  read(5000, 0, true)
end)
scene("half typed", "ds47.pnu ==", function() read(100, 0, true) end)
scene("still being typed", "ds47.pnu", function()
  opened()
  frames(10, true)
  for number = 1, 5 do
    field = "ds47.pnu == " .. number
    draw()
  end
  assert(#log == 0, "not while somebody types")
end)
scene("captured for ten minutes", "ds47", function()
  opened()
  for _ = 1, 200 do
    frames(300, true)
    draw()
  end
  assert(#log == 2, "not while frames come")
end)
scene("captured with pauses", "ds47", function()
  opened()
  for _ = 1, 12 do
    frames(300, true)
    ticks(6)
  end
end)
