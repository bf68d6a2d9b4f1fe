-- Prints how each number on stdin is written, a line each (tests/python/test_spelling.py).

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. package.path

local naming = require("ds47.profidrive.naming")

for line in io.lines() do
  print(naming.spelling(tonumber(line)))
end
