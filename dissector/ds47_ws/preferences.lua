-- The preferences of the plugin: what a user may choose, and how it becomes the options of an analysis.
--
-- Registers nothing by itself: `define` is given the protocol by the entry file.

local lists = require("ds47_ws.lists")
local named = require("ds47.cyclic.named")
local ppo = require("ds47.cyclic.ppo")
local tables = require("ds47.spec.tables")
local transactions = require("ds47.acyclic.transactions")

local M = {}

local AUTO, ALWAYS, NEVER = 0, 1, 2
local CYCLIC, USS = 0, 1
local ENGLISH, CHINESE = 0, 1
local INDEX_47 = 47

--- Gives the protocol its preferences. Names as in `-o ds47.index_47:never`.
function M.define(proto)
  local prefs = proto.prefs
  prefs.indices = Pref.range("Further record indices", "",
    "Record indices that carry the parameter channel besides 47, 0xB02E and 0xB02F, "
    .. "for example 0xB030,100-103", 65535)
  prefs.index_47 = Pref.enum("Record index 47", AUTO,
    "auto: 47 is decoded once a message of the connection has the shape of a DS47 message; "
    .. "always: whatever it holds; never: not at all",
    { { 1, "auto", AUTO }, { 2, "always", ALWAYS }, { 3, "never", NEVER } }, true)
  prefs.legacy_g120_formats = Pref.bool("Formats of older G120 manuals", false,
    "Format 0x10 is OctetString and 0x13 TimeDifference")
  prefs.profile_v3_types = Pref.bool("Data types of profile V3", false,
    "Formats 0x21 to 0x2C are N2, N4, V2 and so on")
  prefs.assume_sinamics = Pref.bool("Drives without a vendor are SINAMICS", false,
    "Where the capture does not show whose a device is (object UUID, DCP), names, units and error numbers "
    .. "are those of SINAMICS, and ds47.vendor_assumed says so. Frames without IP are looked at for DCP")
  prefs.pkw_layout = Pref.enum("Layout of IND in PKW", CYCLIC,
    "cyclic: the page is the low byte of IND, as in cyclic transfer; uss: the high one, as some makers "
    .. "have it",
    { { 1, "cyclic", CYCLIC }, { 2, "uss", USS } }, true)
  prefs.pkw_layouts = Pref.string("Layout of IND of single devices", "",
    "Addresses with the layout that is not that of all others, for example: 192.168.0.5=uss")
  prefs.cyclic = Pref.string("Channels in cyclic frames", "",
    "Where a channel is whose Connect is missing, two for each: first of the controller's frames, then of "
    .. "the drive's. For example: 00:1b:1b:11:22:33@8000:0:pkw 00:1f:f8:11:22:33@8001:0:pkw")
  prefs.ppos = Pref.string("PPO of stations", "",
    "What stations of PROFIBUS have whose Chk_Cfg is missing, for example: 3=ppo1 4=ppo3")
  prefs.profibus_user0 = Pref.bool("PROFIBUS in USER0", false,
    "Frames of the link type USER0 (147) are PROFIBUS once one of them proves it; others go to the dissector "
    .. "that had them before, the one under DLT_USER among them")
  prefs.every_cyclic = Pref.bool("Look at every frame of a cyclic channel", false,
    "Slow; for captures from which frames without news were left out")
  prefs.lists = Pref.string("File of parameter lists", "",
    "The file of ds47 params export, where it does not stand beside the plugin: names, units and texts of "
    .. "values of lists of yours")
  prefs.language = Pref.enum("Language of the texts", ENGLISH,
    "Texts of error numbers and findings",
    { { 1, "en", ENGLISH }, { 2, "zh", CHINESE } }, true)
  prefs.slow_ms = Pref.uint("Slow from (ms)", math.floor(tables.limits.slow_ns / 1000000),
    "From which share of the drive in a transaction it is slow (DS416), in milliseconds")
  prefs.ignore = Pref.string("Rules to leave out", "",
    "Rule ids or their beginnings, for example: DS204 DS3")
end

-- A range of Wireshark ("47,100-103", also with 0x) as a set of numbers.
local function indices(text)
  local set = {}
  for first, last in string.gmatch(text or "", "([%dxXa-fA-F]+)%-?([%dxXa-fA-F]*)") do
    local from = tonumber(first)
    local to = last == "" and from or tonumber(last)
    for index = from or 1, math.min(to or 0, 65535) do
      set[index] = true
    end
  end
  return set
end

local function rules(text)
  local list = {}
  for rule in string.gmatch(text or "", "[%w]+") do
    list[#list + 1] = string.upper(rule)
  end
  return list
end

-- `192.168.0.5=uss 192.168.0.6=cyclic` as layouts by address.
local function layouts(text)
  local by_device = {}
  for device, layout in string.gmatch(text or "", "([^%s,;=]+)=(%a+)") do
    if layout == "uss" or layout == "cyclic" then
      by_device[device] = layout
    end
  end
  return by_device
end

--- The preferences as they are now: the options of `ds47.analysis`, and the language of the texts.
function M.options(proto)
  local prefs = proto.prefs
  lists.take(prefs.lists or "")
  local set = indices(prefs.indices)
  if prefs.index_47 == ALWAYS then
    set[INDEX_47] = true
  end
  return {
    indices = set,
    forbid_47 = prefs.index_47 == NEVER,
    slow_ms = prefs.slow_ms,
    ignore = rules(prefs.ignore),
    vendor_id = prefs.assume_sinamics and transactions.SIEMENS or nil,
    pkw_layout = prefs.pkw_layout == USS and "uss" or "cyclic",
    pkw_layouts = layouts(prefs.pkw_layouts),
    cyclic = named.list(prefs.cyclic or ""),
    ppos = ppo.list(prefs.ppos or ""),
    every_cyclic = prefs.every_cyclic,
    codec = {
      legacy_g120_formats = prefs.legacy_g120_formats,
      profile_v3_types = prefs.profile_v3_types,
    },
  }, prefs.language == CHINESE and "zh" or "en"
end

return M
