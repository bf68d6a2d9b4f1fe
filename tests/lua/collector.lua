-- The pace of the collector (ds47_ws.collector), with Lua's own pace switched off: what frames leave behind
-- does not pile up, and of another file nothing is kept.
-- Usage: lua collector.lua. Prints the most kB that were in use while frames came, those in use while a large
-- file is open, those after the next one was opened, and how many objects were closed.

local root = arg[0]:match("^(.*[/\\])[^/\\]*$") or "./"
package.path = root .. "../../dissector/?.lua;" .. package.path

local collector = require("ds47_ws.collector")
collectgarbage("stop")

local FRAMES, OBJECTS = 50000, 3
local closed, most = 0, 0
local object = { __gc = function() closed = closed + 1 end }

for _ = 1, FRAMES do
  for _ = 1, OBJECTS do
    setmetatable({ {} }, object)
  end
  collector.called()
  most = math.max(most, collectgarbage("count"))
end

package.loaded.file = {}
for number = 1, FRAMES do
  package.loaded.file[number] = { number }
end
local large = collectgarbage("count")
package.loaded.file = nil
collector.collect_all()
print(math.floor(most), math.floor(large), math.floor(collectgarbage("count")), closed)
