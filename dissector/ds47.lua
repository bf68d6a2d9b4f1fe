-- ds47 in Wireshark: the parameter channel of PROFIdrive over PROFINET (record index 47, 0xB02E, 0xB02F) and
-- over PROFIBUS DP (MS1), and frames of PROFIBUS DP.
--
-- This file is the plugin: Wireshark loads it, and it registers everything. It is the only file that does
-- something when it is loaded. What is analysed and decoded is in ../lua/ds47 (no Wireshark in there), what
-- is shown in ds47_ws. From a checkout: wireshark -X lua_script:dissector/ds47.lua

local arguments = { ... } -- of -X lua_script1:ARGUMENT
local GUARD = "ds47_ws.loaded"

local source = debug.getinfo(1, "S").source:gsub("^@", "")
-- Whether a file is one of the user's own plugins, and not of -X lua_script or of everybody.
local function is_installed(path)
  local folder = Dir.personal_plugins_path():gsub("\\", "/")
  return path:gsub("\\", "/"):sub(1, #folder) == folder
end

-- A newer file was put beside an older one, which goes on working: nobody would notice.
local function tell_of_two(works, other)
  if works == other or not (is_installed(works) and is_installed(other)) then return end
  local text = "ds47: two copies of the plugin are installed, and only the first works: " .. works
    .. "; not " .. other .. ". Delete the older one and start Wireshark again."
  if gui_enabled() then
    report_failure(text)
  else
    io.stderr:write(text, "\n")
  end
end

if package.loaded[GUARD] then
  -- Another copy is loaded already: the first one works, and "Check installation" shows the others. An
  -- installed copy gets no arguments; those of a second one loaded with -X lua_script are meant for it.
  tell_of_two(package.loaded[GUARD].path, source)
  require("ds47_ws.stats").register(require("ds47_ws.track"), arguments)
  return
end
package.loaded[GUARD] = { path = source }

-- The modules stand beside this file (an installed copy), or in ../lua (a checkout).
local folder = source:match("^(.*)[/\\]") or "."
package.path = table.concat({ folder .. "/?.lua", folder .. "/../lua/?.lua", package.path }, ";")

local clock = require("ds47_ws.clock")
local collector = require("ds47_ws.collector")
local ds47_fields = require("ds47_ws.fields")
local encapsulations = require("ds47_ws.encapsulations")
local info = require("ds47_ws.info")
local later = require("ds47.support.later").module
local lists = require("ds47_ws.lists")
local passes = require("ds47_ws.passes")
local preferences = require("ds47_ws.preferences")
local refilter = require("ds47_ws.refilter")
local stats = require("ds47_ws.stats")
local tables = require("ds47.spec.tables")
local track = require("ds47_ws.track")
local wanted_fields = require("ds47_ws.wanted")
local words = require("ds47.report.formatting")

set_plugin_info({
  version = tables.version,
  description = "DS47: the parameter channel of PROFIdrive over PROFINET",
})

local ds47 = Proto("ds47", "DS47 (PROFIdrive parameter channel)")
preferences.define(ds47)
lists.configure(folder)
require("ds47_ws.profile").configure(folder)
local ds47_words = Proto("ds47_pzd", "DS47 PZD (control and status word of a drive)")
local ds47_bus = Proto("ds47_profibus", "PROFIBUS DP")
local fields, experts = ds47_fields.define(ds47, ds47_words, ds47_bus)
local tree_of = later("ds47_ws.tree", function(module)
  module.configure(ds47, ds47_words, fields, experts)
end)
local bus_tree_of = later("ds47_ws.profibus_tree", function(module)
  module.configure(ds47_bus, fields, experts)
end)
local bus_info = later("ds47.report.profibus")
local experts_of = later("ds47_ws.experts")
local words_of = later("ds47_ws.pkw_tree")

-- A frame of cyclic data costs one of these, as long as it has no parameter channel: it has no IP.
local ip_field = Field.new("ip")
local index_field = Field.new("pn_io.index")
local WINDOW = gui_enabled()
clock.configure(Field.new("frame.time_epoch"), WINDOW)

-- To ask whether anybody wants fields of ours.
local this_dissector, words_dissector, bus_dissector
local on_bus = false -- whether this is a frame of PROFIBUS, which is shown already

local NONE = {}
local RECORD_HEADER, INDEX_IN_HEADER = 64, 34 -- bytes of a record block (docs/protocol.md E.4)

-- A record in what the built-in put together from fragments: behind the header in which the index stands.
local function find_reassembled(data)
  for _, found in ipairs({ index_field() }) do
    local at, tvb = found.offset - INDEX_IN_HEADER + RECORD_HEADER, found.source
    if at >= 0 and tvb:len() >= at + #data and tvb:raw(at, #data) == data then return tvb:range(at, #data) end
  end
  return nil
end

-- The frame whose tree is made: its TvbRange, its bytes (nil until somebody asks), where its data begins, and
-- behind which byte the next record is. One table for all frames, as are those who find something in it.
local shown = { tvb = nil, bytes = nil, at = 0, from = 0 }

local function bytes_shown()
  shown.bytes = shown.bytes or shown.tvb:raw()
  return shown.bytes
end

-- Finds records in the frame, one behind the other.
local function next_record(data)
  if data == "" then return nil end
  local found = string.find(bytes_shown(), data, shown.from + 1, true)
  if found then
    shown.from = found - 1 + #data
    return shown.tvb:range(found - 1, #data)
  end
  return find_reassembled(data)
end

-- The columns of a frame; nil where nobody sees them, as when a file is loaded or in the first of two passes.
local function columns_of(pinfo, reading)
  if reading and reading.has_columns ~= nil then return reading.has_columns and pinfo.cols or nil end
  local columns = pinfo.cols
  local found = tostring(columns.info) ~= "(info)"
  if reading then reading.has_columns = found end
  return found and columns or nil
end

-- Finds bytes in the frame, behind where its data begins; nil where it has them not.
local function search(bytes)
  local found = string.find(bytes_shown(), bytes, shown.at + 1, true)
  return found and shown.tvb:range(found - 1, #bytes)
end

-- The record that a view has, or its words of PKW.
local function record_of(data, view)
  if view.item.channel == "pkw" then return shown.tvb:range(shown.at + view.item.places[view.role], 8) end
  return next_record(data)
end

-- The word that an event is about; nil where it is about none.
local function word_of(found)
  local side = found.event.word and found.relation[found.event.word == "STW1" and "output" or "input"]
  return side and shown.tvb:range(shown.at + side.offset, 2)
end

-- For the tree of the newest frame, which does not keep it.
local context = {
  find_record = record_of, find_word = word_of, find_bytes = search,
  request_of = track.request_of, findings_of = track.findings_of,
  drive_object = track.drive_object, reached = track.reached,
  now_ns = function() return track.time_ns(clock.now) end,
}

-- Adds to the tree and sets the columns, where there are some. The data of the frame begins at `at`. `whole`:
-- somebody wants our fields. `bytes`: those of the frame, where they are known.
local function show(views, findings, events, tvb, columns, tree, at, whole, reading, bytes)
  local is_shown = views[1] ~= nil or events[1] ~= nil
  if columns and is_shown then
    columns.protocol, columns.info = "DS47", info.text(views, events, track.lang)
  end
  if whole and (is_shown or findings[1]) then
    context.lang, context.answers = track.lang, reading and reading.answers
    shown.tvb, shown.bytes, shown.at, shown.from = tvb, bytes, at, at
    tree_of.add(tree, views, findings, events, context)
    shown.tvb = nil
  elseif findings[1] or events[1] then
    experts_of.add(tree, experts, findings, events, track.lang)
  end
end

-- Whether somebody wants fields of a protocol of ours; a tree that is visible counts as well. Asking costs as
-- much as all else of a cyclic frame in which nothing changed.
local function is_wanted(tree, dissector, reading)
  local found = reading and reading.protocols[dissector]
  if found == nil then
    found = tree:referenced(dissector)
    if reading then reading.protocols[dissector] = found end
  end
  if found and reading and reading.is_new then refilter.wanted = true end
  return found
end

-- Wireshark does not tell whether somebody switched a protocol off; it calls no dissector of one that is. So
-- it is asked to, once in a file and with no bytes, which nobody else would take.
local WORDS, OURS = 0, 1
local asking = DissectorTable.new("ds47", "DS47", ftypes.UINT8, base.DEC, ds47)
local has_words, has_ours -- whether the protocols are on; nil until somebody knows

function ds47_words.dissector() has_words = true end

local function ask_for(number, tvb, pinfo, tree) asking:try(number, tvb:range(0, 0):tvb(), pinfo, tree) end

local function are_words_on(tvb, pinfo, tree)
  if has_words == nil then
    has_words = false
    ask_for(WORDS, tvb, pinfo, tree)
  end
  return has_words
end

-- The same of the parameter channel, for PROFIBUS: elsewhere all begins with its dissector, which a frame of
-- PROFIBUS tells nothing but that it was called.
local function is_channel_on(tvb, pinfo, tree)
  if has_ours == nil then
    on_bus = true
    ask_for(OURS, tvb, pinfo, tree)
    has_ours, on_bus = not on_bus, false
  end
  return has_ours
end

-- The words in a frame, whether something happened in it or not: control and status words of drives, which
-- stand in each of their frames; and where somebody looks at it those of PKW in which nothing changed.
local function show_words(tvb, number, tree, frame, place, is_new, views)
  local places = track.has_drives and track.words(number, frame, place, not is_new) or NONE
  if places[1] then tree_of.add_words(tree, tvb, places, track.lang) end
  if not tree.visible or views and views[1] then return end
  for _, each in ipairs(track.standing(number, frame, place)) do
    words_of.standing(tree, tvb:range(each.offset, 8), each, track.lang)
  end
end

-- A frame without IP, once there are channels of drives in cyclic frames: nearly always nothing changed in
-- it.
local function dissect_cyclic(tvb, pinfo, tree)
  local number, frame, views, findings, events = pinfo.number, nil, nil, nil, nil
  local is_new = track.is_new(number, pinfo)
  if not is_new then
    passes.again = true
    clock.set(pinfo)
    views, findings, events = track.complete_views(number)
  else
    frame = tvb:raw()
    if track.is_news(frame, number) then
      clock.set(pinfo)
      track.feed_cyclic(number, clock.now)
      views, findings, events = track.live_cyclic_views(true)
    end
  end
  local reading = wanted_fields.reading(tree, number, is_new)
  local looked_at = is_wanted(tree, words_dissector, reading) and are_words_on(tvb, pinfo, tree)
  if not views and not looked_at then return end
  if events and events[1] and not are_words_on(tvb, pinfo, tree) then events = NONE end
  frame = frame or tvb:raw()
  local place = track.cyclic_place(frame)
  if views then
    local columns, at = columns_of(pinfo, reading), place and place.at
    local whole = is_wanted(tree, this_dissector, reading)
    show(views, findings, events, tvb, columns, tree, at, whole, reading)
  end
  if looked_at and place then show_words(tvb, number, tree, frame, place, is_new, views) end
end

-- A frame of PROFIBUS with what it shows: views, findings and events; nil of one that is none.
local function look_at_bus(tvb, pinfo, is_new, wanted)
  local number = pinfo.number
  if not is_new then
    passes.again = true
    clock.set(pinfo)
    return track.bus_frame(number, tvb:raw()), track.complete_views(number)
  elseif not clock.is_ready() then
    return nil
  end
  clock.set(pinfo)
  local link_type = encapsulations.link_type(pinfo)
  local item = track.feed_bus(number, tvb:raw(), link_type, clock.now, pinfo.len)
  if item then return item, track.live_cyclic_views(wanted) end
  return nil
end

-- What a frame of PROFIBUS says itself.
local function show_bus(item, tvb, columns, tree, reading)
  if columns then bus_tree_of.set_columns(columns, item, track.lang) end
  if is_wanted(tree, bus_dissector, reading) then
    bus_tree_of.add(tree, tvb, item, track.lang)
  elseif item.flaws[1] then
    bus_tree_of.add_experts(tree, item, track.lang)
  end
end

-- A mirror port's copy of a frame of the parameter channel: that it is one, and a link to the frame that was
-- captured first, which has the message. A copy has no tree of `ds47`: so a filter finds each message once.
local function show_copy(number, pinfo, tree, reading, whole)
  local original = track.original(number, whole)
  if not original then return end
  local columns = columns_of(pinfo, reading)
  local text = words.say(track.lang, "duplicate", { frame = words.integer(original) })
  if columns then columns.protocol, columns.info = "DS47", text end
  tree:add(fields.duplicate_of, original):set_generated():set_text("DS47 " .. text)
end

-- Nothing behind a frame of PROFIBUS is dissected by others: all of it is taken, or it is none.
function ds47_bus.dissector(tvb, pinfo, tree)
  collector.called()
  local number, is_new = pinfo.number, track.is_new(pinfo.number, pinfo)
  local reading = wanted_fields.reading(tree, number, is_new)
  local columns, whole = columns_of(pinfo, reading), is_wanted(tree, this_dissector, reading)
  local item, views, findings, events = look_at_bus(tvb, pinfo, is_new, columns ~= nil or whole)
  if not item then
    encapsulations.pass_on(tvb, pinfo, tree)
    return tvb:len()
  end
  show_bus(item, tvb, columns, tree, reading)
  if not is_channel_on(tvb, pinfo, tree) then return tvb:len() end
  on_bus = true
  local at, place = bus_info.data_start(item), track.bus_place(item)
  if views and events[1] and not are_words_on(tvb, pinfo, tree) then events = NONE end
  if views then show(views, findings, events, tvb, columns, tree, at, whole, reading) end
  if place and is_wanted(tree, words_dissector, reading) and are_words_on(tvb, pinfo, tree) then
    local data = tvb:raw(0, at + #item.du) -- the check byte is none of it
    show_words(tvb, number, tree, data, place, is_new, views)
  end
  return tvb:len()
end

-- A frame with IP that was fed before: a second pass, or somebody looks at it.
local function dissect_again(tvb, pinfo, tree, number, offset)
  passes.again = true
  clock.set(pinfo)
  local reading = wanted_fields.reading(tree, number, false)
  local views, findings = track.complete_views(number)
  if views then
    local columns, whole = columns_of(pinfo, reading), is_wanted(tree, this_dissector, reading)
    show(views, findings, NONE, tvb, columns, tree, offset, whole, reading)
  end
  show_copy(number, pinfo, tree, reading, true)
end

function ds47.dissector(tvb, pinfo, tree)
  if on_bus then
    on_bus = false
    return
  end
  collector.called()
  local ip = ip_field()
  if ip == nil then
    if track.unasked then track.pass_over(pinfo) end
    if track.hears_stations then track.hear_station(pinfo.number, tvb:raw()) end
    if track.watching then dissect_cyclic(tvb, pinfo, tree) end
    return
  end
  local number = pinfo.number
  if not track.is_new(number, pinfo) then
    dissect_again(tvb, pinfo, tree, number, ip.offset)
    return
  end
  clock.set(pinfo)
  local offset, frame = ip.offset, tvb:raw()
  local fed, is_copy = track.feed(number, frame, offset, clock.now, pinfo)
  if fed then
    local reading = wanted_fields.reading(tree, number, true)
    local columns, whole = columns_of(pinfo, reading), is_wanted(tree, this_dissector, reading)
    local views, findings = track.live_views(columns ~= nil or whole)
    show(views, findings, NONE, tvb, columns, tree, offset, whole, reading, frame)
    if is_copy then show_copy(number, pinfo, tree, reading, false) end
    if passes.blind == nil then passes.blind = pinfo.visited end
  end
end

asking:add(WORDS, ds47_words)
asking:add(OURS, ds47)

local function begin_anew()
  on_bus, has_words, has_ours = false, nil, nil
  encapsulations.register(ds47_bus, ds47.prefs.profibus_user0)
  clock.reset()
  passes.reset()
  refilter.reset()
  wanted_fields.reset()
  track.reset()
  track.begin()
  collector.collect_all()
end

track.configure(function() return preferences.options(ds47) end, begin_anew)

function ds47.init()
  this_dissector = this_dissector or Dissector.get("ds47")
  words_dissector = words_dissector or Dissector.get("ds47_pzd")
  bus_dissector = bus_dissector or Dissector.get("ds47_profibus")
  stats.begin()
  begin_anew()
end

ds47.prefs_changed = begin_anew

register_postdissector(ds47)

-- Names of stations. The filter is Wireshark's: other frames do not come here.
local stations = Listener.new("frame", "pn_dcp || lldp")

function stations.packet(pinfo, tvb) track.station(pinfo.number, tvb:raw()) end

-- All listeners are called when tshark has come to the end.
function stations.draw()
  if not WINDOW then passes.finish(track.lang) end
end

stats.register(track, arguments)
if WINDOW then refilter.begin(function() return track.lang end) end
require("ds47_ws.menu").register(track, { version = tables.version, path = source })
if WINDOW and register_packet_menu then require("ds47_ws.packet_menu").register(track) end -- 4.0 has none
