-- lua/ds47/spec/tables.lua, every entry, against tests/vectors/tables.json.
--   lua tests/lua/tables.lua tests/vectors/tables.json [TABLES]
-- Prints a line for every key that differs, and last how many entries the tables have. Exits with 1 where
-- there is a difference. TABLES: another tables.lua.

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. here .. "/?.lua;" .. package.path

local read_json = require("json_reader")
local tables = arg[2] and dofile(arg[2]) or require("ds47.spec.tables")

local file = assert(io.open(arg[1], "rb"))
local stored = read_json(file:read("*a")).tables
file:close()

local SAME_AS_KEY = {code = true, id = true}
local EXPLAINING = { -- for the reader of a table alone
  note = true, confirmed = true, zh_from = true, plc = true, wireshark = true,
  analyzer_only = true,
  many = true, many_zh = true, brief = true, brief_zh = true, -- headlines are the analyzer's
}

local flat, entries = {}, 0

local function put(key, value)
  flat[key] = value
  entries = entries + 1
end

-- A number as the keys have it: in hexadecimal digits.
local function name_of(key)
  return type(key) == "number" and ("0x%02X"):format(key) or key
end

local function flatten(where, value)
  if type(value) ~= "table" then return put(where, value) end
  local arguments = where:find("%.args$") -- whose names may be those of columns
  for key, item in pairs(value) do
    local shown = arguments or not SAME_AS_KEY[key]
    if shown then flatten(where .. "." .. name_of(key), item) end
  end
end

for name in ("limits phases reasons formats dialects attributes vendor_attributes request_ids response_ids "
  .. "codes errors error_fallback rules known diagnosis_words"):gmatch("%S+") do
  flatten(name, tables[name])
end
for _, made in ipairs({tables.parameters, tables.drives}) do
  for number, families in pairs(made) do
    for family, row in pairs(families) do flatten(("parameters.%d.%s"):format(number, family), row) end
  end
end
for _, name in ipairs({"error_code", "error_decode", "access", "protocol"}) do
  flatten("status." .. name, tables.status[name])
end
for lang, words in pairs(tables.status.words) do
  for name, text in pairs(words) do put("status.words." .. name .. "." .. lang, text) end
end
for _, vendor in ipairs(tables.vendors) do
  if vendor.id then put("vendors." .. vendor.name .. ".id", vendor.id) end
  flatten("vendors." .. vendor.name .. ".errors", vendor.errors)
end

local problems = {}
local function differs(key, got, want)
  local says = {tostring(got), tostring(want)}
  problems[#problems + 1] = ("%s: table says %s, vector says %s"):format(key, says[1], says[2])
end
-- What only the analyzer has is in no table of Lua: rules, words, numbers.
local function is_analyzers(key)
  local rule = key:match("^rules%.(%w+)%.")
  return key:find("^analyzer_") or rule and stored["rules." .. rule .. ".analyzer_only"]
end
for key, want in pairs(stored) do
  local explaining = (EXPLAINING[key:match("[^.]+$")] or key:find("%.sources%.") or key:find("%.changed%.")
    or key:find("^rules%.%w+%.group%.")) and not key:find("^codes%.") -- which may be words
  if not explaining and not is_analyzers(key) and flat[key] ~= want then differs(key, flat[key], want) end
end
for key, value in pairs(flat) do
  if stored[key] == nil then differs(key, value, nil) end
end
table.sort(problems)
for _, text in ipairs(problems) do print(text) end
print(entries .. " entries")
os.exit(#problems == 0 and entries > 0 and 0 or 1)
