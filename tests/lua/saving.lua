-- What the menu saves, under plain Lua: arg[1] is a folder to write into. Prints what a test looks at.

local root = arg[0]:match("^(.*[/\\])[^/\\]*$") or "./"
package.path = root .. "../../lua/?.lua;" .. root .. "../../dissector/?.lua;" .. package.path

local menu = require("ds47_ws.menu")
local saving = require("ds47_ws.saving")

local folder = arg[1] .. "/"

local function save(name, lang)
  return table.concat(menu.save(function(kind)
    return kind .. " of " .. name
  end, name, lang or "en"), "\n")
end

print(save("  "))
print(save(folder .. "report.txt"))
print(save(folder .. "report"))
print(save(folder .. "report.csv ", "zh"))
print(save(folder .. "no/such"))
print(save(folder .. "locked/report"))
print(saving.write(folder .. "capture", "a report"))
print(saving.write(folder .. "older", "a report"))
print(saving.write(folder .. "newer", "a report"))
