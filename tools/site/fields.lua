-- Prints the fields of the Wireshark plugin: name, type, label and the words of its numbers, divided by tabs.
--
--   lua tools/site/fields.lua ROOT
--
-- Runs dissector/ds47_ws/fields.lua with a ProtoField of its own, so that what the plugin registers is
-- what is printed. Needs no Wireshark.


local root = arg[1]
package.path = root .. "/dissector/?.lua;" .. root .. "/lua/?.lua;" .. package.path

-- Any name is there, and is itself: base.DEC is "DEC".
local function names()
  return setmetatable({}, { __index = function(_, name) return name end })
end

local function words(values)
  local numbers, found = {}, {}
  for number in pairs(type(values) == "table" and values or {}) do
    numbers[#numbers + 1] = number
  end
  table.sort(numbers)
  for _, number in ipairs(numbers) do
    found[#found + 1] = string.format("%d=%s", number, tostring(values[number]))
  end
  return table.concat(found, ";")
end

-- What Wireshark has.
-- luacheck: globals base frametype expert ProtoExpert ProtoField
base, frametype = names(), names()
expert = { group = names(), severity = names() }
ProtoExpert = { new = function() return {} end }
ProtoField = setmetatable({}, { __index = function(_, kind)
  return function(name, label, ...)
    local values = kind ~= "bool" and select(2, ...) or nil
    print(table.concat({ name, kind, label, words(values) }, "\t"))
    return {}
  end
end })

require("ds47_ws.fields").define({}, {}, {})
