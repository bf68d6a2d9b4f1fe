-- The preferences of the plugin: what a user may choose, and how it becomes the options of an analysis.
--
-- Registers nothing by itself: `define` is given the protocol by the entry file.

local dictionary = require("ds47.profidrive.dictionary")
local lists = require("ds47_ws.lists")
local named = require("ds47.cyclic.named")
local ppo = require("ds47.cyclic.ppo")
local tables = require("ds47.spec.tables")

local M = {}

local ALWAYS, NEVER = 1, 2 -- of index_47
local USS, CHINESE = 1, 1
local INDEX_47 = 47

--- Gives the protocol its preferences, those of spec/wireshark.toml.
function M.define(proto)
  for _, row in ipairs(tables.preferences) do
    local is_radio = row.kind == "enum"
    proto.prefs[row.name] = Pref[row.kind](row.label, row.default, row.about, row.choices, is_radio)
  end
end

-- A range of Wireshark ("47,100-103", also with 0x) as a set of numbers.
local function indices(text)
  local set = {}
  for first, last in string.gmatch(text or "", "([%dxXa-fA-F]+)%-?([%dxXa-fA-F]*)") do
    local from = tonumber(first)
    local to = last == "" and from or tonumber(last)
    for index = from or 1, math.min(to or 0, 65535) do set[index] = true end
  end
  return set
end

local function rules(text)
  local list = {}
  for rule in string.gmatch(text or "", "[%w]+") do list[#list + 1] = string.upper(rule) end
  return list
end

-- `192.168.0.5=uss 192.168.0.6=cyclic` as layouts by address.
local function layouts(text)
  local by_device = {}
  for device, layout in string.gmatch(text or "", "([^%s,;=]+)=(%a+)") do
    if layout == "uss" or layout == "cyclic" then by_device[device] = layout end
  end
  return by_device
end

-- The numbers that frames had in a capture from which others were left out since.
local function numbers(path)
  local found, file = {}, io.open(path)
  for line in file and file:lines() or ipairs({}) do found[#found + 1] = tonumber(line) end
  if file then file:close() end
  return found
end

--- The preferences as they are now: the options of `ds47.analysis`, and the language of the texts.
function M.options(proto)
  local prefs = proto.prefs
  lists.take(prefs.lists or "")
  local set = indices(prefs.indices)
  if prefs.index_47 == ALWAYS then set[INDEX_47] = true end
  return {
    indices = set,
    forbid_47 = prefs.index_47 == NEVER,
    slow_ms = prefs.slow_ms,
    ignore = rules(prefs.ignore),
    vendor_id = prefs.assume_sinamics and dictionary.SIEMENS or nil,
    pkw_layout = prefs.pkw_layout == USS and "uss" or "cyclic",
    pkw_layouts = layouts(prefs.pkw_layouts),
    cyclic = named.list(prefs.cyclic or ""),
    ppos = ppo.list(prefs.ppos or ""),
    frame_numbers = prefs.frame_numbers ~= "" and numbers(prefs.frame_numbers) or nil,
    codec = { legacy_g120_formats = prefs.legacy_g120_formats, profile_v3_types = prefs.profile_v3_types },
  }, prefs.language == CHINESE and "zh" or "en"
end

return M
