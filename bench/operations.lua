-- Counts the operations of Lua that the plugin takes: unlike seconds they are the same on a machine that has
-- other work. Loads the plugin itself, in tshark (bench/plugin.py --operations):
--   tshark -r CAPTURE -X lua_script:bench/operations.lua -X lua_script1:dissector/ds47.lua
-- Prints how many there were, and with a second -X lua_script1:functions those in which most were, by the
-- file and the line where a function begins. Then the counting is counted, too: a third more, all over.

local plugin, functions = ...
local EVERY, MOST = functions and 97 or 1000, 40 -- a hook each so many operations; functions that are told

local count, found = 0, {}

local function counted()
  count = count + 1
end

local function counted_by_function()
  count = count + 1
  local here = debug.getinfo(2, "S")
  local name = here.short_src:match("[^/\\]*$") .. ":" .. here.linedefined
  found[name] = (found[name] or 0) + 1
end

local function told()
  debug.sethook()
  io.stderr:write(("operations: %d\n"):format(count * EVERY))
  local names = {}
  for name in pairs(found) do names[#names + 1] = name end
  table.sort(names, function(one, other) return found[one] > found[other] end)
  for place = 1, math.min(#names, MOST) do
    io.stderr:write(("%12d %s\n"):format(found[names[place]] * EVERY, names[place]))
  end
end

dofile(plugin)

local ended = Listener.new("frame", "frame.number == 1") -- its end is that of the file
function ended.draw() told() end

debug.sethook(functions and counted_by_function or counted, "", EVERY)
