-- The fields and expert infos that the plugin registers, without Wireshark: a line each.
--
-- Usage: lua fields.lua ROOT, the checkout. Names are written down by what stands in for Wireshark here.

local root = arg[1]
package.path = root .. "/dissector/?.lua;" .. root .. "/lua/?.lua;" .. package.path

local function anything()
  return setmetatable({}, { __index = function(_, key) return key end })
end

base, frametype = anything(), anything() -- luacheck: ignore 111
expert = { group = anything(), severity = anything() } -- luacheck: ignore 111
ProtoField = setmetatable({}, { -- luacheck: ignore 111
  __index = function(_, kind)
    return function(name) print("field " .. name .. " " .. kind) return {} end
  end,
})
ProtoExpert = { new = function(name) print("expert " .. name) return {} end } -- luacheck: ignore 111

require("ds47_ws.fields").define({}, {}, {})
