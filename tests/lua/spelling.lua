-- Prints how each number on stdin is written, a number, behind it a family of drives
-- (tests/python/test_spelling.py).

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. package.path

local naming = require("ds47.profidrive.naming")

for line in io.lines() do
  local number, family = line:match("^(%d+) ?(.*)$")
  print(naming.spelling(tonumber(number), family ~= "" and family or nil))
end
