-- From frames to what they show: feeds the analysis of the open file, and tells what a frame has to show.
--
-- A frame is fed once, in the order of the file. A frame that comes again (a second pass, a click) changes
-- nothing: it is drawn from the complete result. Whether a frame is new is told by its number alone, because
-- in the first of two passes Wireshark may give no fields, and then the second one is the first for us. Who
-- asks for a frame before those in front of it (in sharkd) makes all begin anew when those come.
-- Not here: fields and trees (tree.lua), and the analysis itself (ds47.analysis).

local analysis = require("ds47.analysis")
local arrays = require("ds47.support.arrays")
local bus = require("ds47.profibus.bus")
local collector = require("ds47_ws.collector")
local dp = require("ds47.profibus.dp")
local drive_objects = require("ds47.profidrive.drive_objects")
local drives = require("ds47_ws.drives")
local entries = require("ds47.support.later").entries
local link = require("ds47.profinet.link")
local parameter = require("ds47.profidrive.parameter")
local pkw = require("ds47.cyclic.transactions")
local profibus = require("ds47.report.profibus")
local drives_of = require("ds47.cyclic.relations").drives
local rpc = require("ds47.profinet.rpc")
local slot_number = require("ds47.report.sentences").slot_number
local source_on_bus = require("ds47.cyclic.ppo").source
local telegram = require("ds47.profibus.telegram")
local transactions = require("ds47.acyclic.transactions")

local append, mapped, push = arrays.append, arrays.mapped, arrays.push
local byte, format, sub = string.byte, string.format, string.sub

local M = {}

local UDP = 17
local UDP_HEADER = 8
local RPC_HEADER, RPC_VERSION, head_of, new_pdu = rpc.HEADER_LENGTH, rpc.VERSION, rpc.head, rpc.pdu
local FIRST_DCP = 0xFEFC -- the first frame id of DCP
local MOST_WAITING = 4096 -- frames that name stations and are not given to the analysis yet
local MOST_TEXTS = 4096
local MOST_OURS = 4096
-- Frames that wait for one that proves that they are PROFIBUS, and bytes of each: no frame has more.
local MOST_UNPROVEN, LONGEST_ON_BUS = 4096, 300
local NO_FRAME_ID = 0 -- frames of PROFIBUS have stations alone
local NONE = {}

local options -- a function that gives the options of a new analysis
local begin_anew -- a function that forgets everything, here and elsewhere
local current -- the analysis of the open file; nil before its first packet
local last -- number of the newest frame that was fed
local reached -- number of a frame up to which all came one behind the other
local noted -- how many frames had been dissected when it was asked last whether one is new (`unasked`: never)
local complete -- views, findings and drives by frame of the complete result; nil after a packet
local known_relations -- how many there are in cyclic frames
local stations -- what names stations and waits
local newest_station -- number of the newest frame of those
local told -- MAC address and kind -> what was told last
local bus_from -- number of the first frame of PROFIBUS that counts; nil while nothing proves one
local unproven -- those before it
local originals -- frame that is a mirror port's copy -> the frame of which it is one
local ours -- frames of the parameter channel, the newest ones in a ring: copies come at once

-- Texts of addresses, by their bytes: a capture has few of them.
local mac_texts = entries(link.mac_text, MOST_TEXTS)

-- Source and destination address of an IP header: an array of two texts.
local address_pairs = entries(function(raw)
  local a, b, c, d, e, f, g, h = byte(raw, 1, 8)
  return { format("%d.%d.%d.%d", a, b, c, d), format("%d.%d.%d.%d", e, f, g, h) }
end, MOST_TEXTS)

--- Tells where the options of an analysis, and the language of what is shown, come from: a function that is
-- asked for each new file; and one that forgets everything.
function M.configure(get_options, forget) options, begin_anew = get_options, forget end

--- Forgets everything: another file, other preferences.
function M.reset()
  current, last, complete, known_relations = nil, 0, nil, 0
  reached, noted, M.unasked = 0, collector.calls, true
  M.watching = false -- whether there are cyclic frames that are looked at
  M.has_drives = false -- whether there may be drives in them
  stations, newest_station, told = {}, 0, {}
  bus_from, unproven = nil, {}
  originals, ours = {}, {}
end

M.reset()

local function the_analysis()
  if current == nil then
    local chosen
    if options then chosen, M.lang = options() end
    current = analysis.new(chosen)
  end
  return current
end

local function source_mac(frame, offset)
  local source = link.source(frame, offset)
  return source and mac_texts[source]
end

local STATIONS = { [0x8892] = "dcp", [0x88CC] = "lldp" }

-- Stations wait, because what tells the analysis something new makes it forget its complete result, and in
-- two passes they come while frames are drawn from it.
local function hand_over_stations()
  local live = the_analysis()
  for _, station in ipairs(stations) do live:station(station[1], station[2], station[3], station[4]) end
  stations = {}
end

-- Keeps whether there are relations in cyclic frames, and drives among them: there are never less.
local function note_relations(relations)
  if #relations ~= known_relations then
    known_relations = #relations
    M.watching, M.has_drives = known_relations > 0, drives.among(relations)
  end
end

--- A file begins: whether there are cyclic frames that are looked at, because a user named them.
function M.begin()
  local chosen = options and options()
  if chosen and chosen.cyclic and #chosen.cyclic > 0 then note_relations(the_analysis().cyclic.all) end
  M.hears_stations = chosen ~= nil and chosen.vendor_id ~= nil
end

--- Takes a frame that may name a station (DCP, LLDP): its number and its bytes. What it says counts where
-- that is not what was told last.
function M.station(number, frame)
  local at, kind = link.network(frame, STATIONS)
  kind = STATIONS[kind]
  if number <= newest_station or kind == nil or kind == "dcp" and (link.u16(frame, at) or 0) < FIRST_DCP then
    return
  end
  newest_station = number
  local payload = sub(frame, at + 1)
  local source, receiver = source_mac(frame, at), link.receiver(frame, at)
  local destination = receiver ~= "" and mac_texts[receiver] or nil
  local key = (source or "") .. (destination or "") .. kind
  local content = kind == "dcp" and sub(payload, 1, 4) .. sub(payload, 9) or payload -- not the transaction id
  if told[key] == content then return end
  told[key] = content
  stations[#stations + 1] = { kind, payload, source, destination }
  if #stations >= MOST_WAITING then hand_over_stations() end
end

--- The same of a frame without IP while vendors may be assumed: what it says of one counts from now on.
function M.hear_station(number, frame)
  M.station(number, frame)
  if #stations > 0 then hand_over_stations() end
end

-- Feeding

-- Of a frame that the capture cut what a PDU tells of it, else nil.
local function cut_of(number, frame, pinfo)
  local length = pinfo.len
  return length > #frame and { frame = number, captured = #frame, original = length } or nil
end

local the_complete -- below: the complete result by frames

-- A fragment of a datagram; its data begins at `at`, and ends at `wanted` or where the frame does.
local function fragment(frame, offset, at, wanted)
  local stop = wanted < #frame and wanted or #frame
  if at > stop or stop < offset + 20 then return nil end
  local i1, i2, f1, f2 = byte(frame, offset + 5, offset + 8)
  local flags, texts = f1 * 256 + f2, address_pairs[sub(frame, offset + 13, offset + 20)]
  return {
    src_ip = texts[1], dst_ip = texts[2], ip_id = i1 * 256 + i2, src_mac = source_mac(frame, offset),
    offset = flags % 0x2000 * 8,
    more = flags % 0x4000 >= 0x2000,
    data = sub(frame, at + 1, stop),
    missing = wanted > stop and wanted - stop or 0,
  }
end

-- What a frame brings: of a datagram of RPC its head, where it begins, where it ends, and the id of IP; or a
-- fragment, alone; nil when it is none of our business.
local function dissect(frame, offset)
  local first, _, t1, t2, i1, i2, f1, f2, _, protocol = byte(frame, offset + 1, offset + 10)
  if protocol ~= UDP or first < 0x45 or first > 0x4F then return nil end
  local present, total, at = #frame, t1 * 256 + t2, offset + (first - 0x40) * 4
  local stop = total > 0 and offset + total or present
  if f2 ~= 0 or f1 % 0x40 ~= 0 then
    return fragment(frame, offset, at, stop)
  elseif stop > present then
    stop = present
  end
  local high, low, _, _, version = byte(frame, at + 5, at + 9) -- the length, and the first byte behind UDP
  if version ~= RPC_VERSION then return nil end
  local length, begin = high * 256 + low, at + UDP_HEADER
  if length >= UDP_HEADER and at + length < stop then stop = at + length end
  if stop - begin < RPC_HEADER then return nil end
  local texts = address_pairs[sub(frame, offset + 13, offset + 20)]
  return head_of(frame, begin, texts[1], texts[2]), begin, stop, i1 * 256 + i2
end

--- Passes over a frame that comes before it was asked whether one is new: where it has no fields, as in the
-- first of two passes or when sharkd loads a file, it does not count as one that came.
function M.pass_over(pinfo)
  if not pinfo.visited then noted = collector.calls end
end

--- Whether a frame is to be fed: it is new. In the first of two passes a frame that a read filter drops
-- leaves its number to the next one.
-- @param pinfo what Wireshark knows of the frame
function M.is_new(number, pinfo)
  local since = collector.calls - noted -- frames that were dissected, this one too: those in front of it
  noted, M.unasked = collector.calls, false
  if number > last then
    -- sharkd has visited all frames when it has loaded them
    local is_next = number - since <= reached or not pinfo.visited
    if is_next and number > reached then reached = number end
    return true
  elseif reached < last and (number <= since or number > reached and number < last) then
    begin_anew()
    reached, M.unasked = number <= since and number or 0, false
    return true
  end
  return number == last and not pinfo.visited
end

--- Feeds a frame. True when it carried PROFINET RPC, or a fragment that might; and of a copy the frame of
-- which it is one.
-- @param number, frame  its number and its bytes
-- @param offset where its IP header begins
-- @param clock a function of the analysis that gives its time (Analysis:time_ns)
-- @param pinfo what Wireshark knows of the frame
function M.feed(number, frame, offset, clock, pinfo)
  local found, at, stop, ip_id = dissect(frame, offset)
  if found == nil then return false end
  local live = current or the_analysis()
  complete, last = nil, number
  if at then
    local pdu = new_pdu(found, frame, at, stop, number, clock(live))
    local p1, p2 = byte(frame, at - UDP_HEADER + 1, at - UDP_HEADER + 2)
    pdu.port = p1 * 256 + p2
    if pdu.missing ~= 0 then pdu.cut = cut_of(number, frame, pinfo) end
    live:datagram(pdu, ip_id, source_mac(frame, offset))
  else
    found.frame, found.time_ns, found.cut = number, clock(live), cut_of(number, frame, pinfo)
    live:fragment(found)
  end
  local original, relations = live.original, live.cyclic.all
  if original then originals[number] = original end
  if #relations ~= known_relations then note_relations(relations) end
  return true, original
end

--- The frame of which a frame is a mirror port's copy, where that is one of the parameter channel; else nil.
-- @param whole whether all frames were fed, and the complete result tells
function M.original(number, whole)
  local original = originals[number]
  if original == nil then
    return nil
  elseif whole then
    local all = the_complete()
    return (all.places[original] or all.findings[original]) and original
  end
  return ours[original % MOST_OURS] == original and original
end

-- A frame that may be one of PROFIBUS waits until one proves it; of too many the older ones are forgotten.
local function keep_unproven(number, data, time_ns, cut)
  if #unproven >= MOST_UNPROVEN then unproven = {} end
  unproven[#unproven + 1] = { number, sub(data, 1, LONGEST_ON_BUS), time_ns, cut }
end

-- A frame proves that it is PROFIBUS, and so are those that wait.
local function begin_bus(live, number, link_type)
  bus_from = unproven[1] and unproven[1][1] or number
  for _, each in ipairs(unproven) do live:bus_frame(link_type, each[2], each[1], each[3], each[4]) end
  unproven = {}
end

--- Feeds a frame of a link type that carries PROFIBUS. Of LINKTYPE_PROFIBUS_DL, which Wireshark does not tell
-- from others that it does not know, all frames count as soon as one proves that it is; of USER0 those from
-- that one on (docs/profibus.md).
-- @param link_type as profibus/bus.lua has it
-- @param clock  as `feed` takes it
-- @param length bytes of the frame on the wire
-- @return what telegram.lua decoded; nil of a frame that is none, as far as one knows
function M.feed_bus(number, data, link_type, clock, length)
  local live, cut = the_analysis(), length > #data
  last = number
  if not bus_from then
    if not bus.proves(telegram.decode(data)) then
      if link_type == bus.PROFIBUS_DL then keep_unproven(number, data, clock(live), cut) end
      return nil
    end
    begin_bus(live, number, link_type)
  end
  complete = nil
  local item = live:bus_frame(link_type, data, number, clock(live), cut)
  note_relations(live.cyclic.all)
  return item
end

--- A frame of PROFIBUS that was fed already, decoded; nil of one that is none.
function M.bus_frame(number, data) return bus_from and number >= bus_from and telegram.decode(data) or nil end

local news, news_row, news_at -- the cyclic frame that is news, and where its channels are

--- Whether a cyclic frame is looked at, because words in it are not those of the frame before it or it is the
-- first of a while: then it is to be fed.
function M.is_news(frame, number)
  local channels = current.cyclic
  local row, at = channels:row_of(frame)
  if row and channels:is_news(row, frame, at, number) then
    news, news_row, news_at = frame, row, at
    return true
  end
  return false
end

--- Feeds the cyclic frame that is news.
-- @param number, clock  as `feed` takes them
function M.feed_cyclic(number, clock)
  complete, last = nil, number
  current:cyclic_frame(news_row, news, news_at, number, clock(current))
end

-- What a frame shows

-- A view of a transaction that is not complete: what is made of it is made when it is asked for.
local LIVE = {}

function LIVE.__index(view, key) return key == "parameters" and view.item.parameters or nil end

local live_views = {} -- those of the newest frame: the same tables for every frame

local function live_view(number, job, role)
  local view = live_views[number]
  if view == nil then
    view = setmetatable({
      complete = false, item = nil, job = nil, role = nil, message = nil, response = nil,
    }, LIVE)
    live_views[number] = view
  end
  if job.response == nil and job.phase == "closed" then
    transactions.restore(job, current.codec) -- a Write response may come late
  end
  view.role, view.item, view.job = role, transactions.open(job), job
  view.message, view.response = job.message, job.response
end

-- Findings of an open job that are certain already, as far as they stand on the newest frame: behind those of
-- other jobs, where there are some.
local function add_certain(findings, job)
  local known = current:peek(job)
  for number = 1, #known do
    if known[number].frame == last then
      findings = findings or {}
      findings[#findings + 1] = known[number]
    end
  end
  return findings
end

-- Roles in which a frame shows no findings of a job that is open: those are its Write request's, those of a
-- refusal, and of Reads that brought nothing.
local SHOWS_NONE = { read_request = true, poll = true, read_response = true }

--- What earlier frames and the frame that was fed last prove: views, findings.
-- @param seen  whether somebody sees views; else there are none, and findings alone
-- @return two arrays, which count until this is called again
function M.live_views(seen)
  local jobs, roles, count = current:touched()
  local there = current.findings:at(last)
  if count == 0 then return NONE, there end
  ours[last % MOST_OURS] = last
  local shown, certain = 0, nil
  for number = 1, count do
    local job, role = jobs[number], roles[number]
    if seen and role ~= "empty_read" then -- of which nothing but its finding is shown
      shown = shown + 1
      live_view(shown, job, role)
    end
    if not SHOWS_NONE[role] and not job.response and (role ~= "write_response" or job.write_refused) then
      certain = add_certain(certain, job)
    end
  end
  for number = #live_views, shown + 1, -1 do live_views[number] = nil end
  if certain then append(certain, there) end
  return live_views, certain or there
end

-- A view of a transaction of PKW.
local PKW = {}

function PKW.__index(view, key)
  if key ~= "parameters" then return nil end
  local found = view.item.parameters
  if view.role == "write_request" then found = { pkw.asked(found[1], view.item.operation) } end
  view.parameters = found
  return found
end

local function pkw_view(item, role, is_complete)
  return setmetatable({ role = role, item = item, complete = is_complete }, PKW)
end

-- Adds what the words in the frame that was fed last say; gives what happened to drives.
local function add_cyclic(views, findings, seen)
  for _, each in ipairs(current:cyclic_touched()) do
    if seen then views[#views + 1] = pkw_view(each.item, each.role, false) end
    append(findings, each.findings)
  end
  return M.has_drives and current.cyclic:happened(last) or NONE
end

--- The same of a cyclic frame or one of PROFIBUS, which may have records or words, and what happened to
-- drives: arrays of its own.
function M.live_cyclic_views(seen)
  local views, findings = {}, {}
  local records, known = M.live_views(seen)
  append(views, records)
  local events = add_cyclic(views, findings, seen)
  append(findings, known)
  return views, findings, events
end

-- The complete result by frames: `places` has transactions, each with its role, {transaction, role}.
local function by_frames(result)
  local places, findings, of_transactions = {}, {}, {}
  for _, item in ipairs(result.transactions) do
    local frames = item.frames
    for _, role in ipairs({ "write_request", "write_response", "read_request", "read_response" }) do
      push(places, frames[role], { item, role })
    end
    for _, role in ipairs({ "poll", "reread" }) do
      for _, read in ipairs(frames[role .. "s"]) do
        push(places, read.request, { item, "read_request" })
        push(places, read.response, { item, role })
      end
    end
  end
  for _, finding in ipairs(result.findings) do
    push(findings, finding.frame, finding)
    push(of_transactions, finding.transaction, finding)
  end
  return {
    places = places, findings = findings, of_transactions = of_transactions, result = result,
    drives = drives.complete(result, current.cyclic),
  }
end

-- The parts of a view of a complete transaction, which are made when they are asked for.
local PARTS = {}

function PARTS.message(view)
  local item = view.item
  if item.job then return item.job.message end
  return item.request and current.events.decode_request(item.request)
end

function PARTS.response(view)
  local response = view.role ~= "write_request" and view.item.response
  local read = view.item.job and view.item.job.read_response
  local cut_off = read and read.cut
  return response and parameter.decode_response(response, view.message, current.codec, cut_off) or nil
end

-- A Write request alone does not know the values of its transaction.
function PARTS.parameters(view)
  local item = view.item
  if view.role ~= "write_request" or not item.frames.read_response then return item.parameters end
  local peer = { vendor_id = item.vendor_id, device_id = item.device_id, family = item.family }
  local job = { message = view.message, peer = peer, meanings = item.meanings }
  return transactions.parameters(job)
end

local COMPLETE = { complete = true }

function COMPLETE.__index(view, key)
  local make = PARTS[key]
  local value = make and make(view) or COMPLETE[key]
  view[key] = value
  return value
end

local function complete_view(place)
  local item, role = place[1], place[2]
  if item.job == nil and item.channel == "pkw" then return pkw_view(item, role, true) end
  return setmetatable({ role = role, item = item, complete = true, message = nil }, COMPLETE)
end

function the_complete()
  if complete == nil then complete = by_frames(current:ended()) end
  return complete
end

--- What the complete result says of a frame: views, findings, events. Nil when it says nothing.
function M.complete_views(number)
  if current == nil then return nil end
  local all = the_complete()
  local there, findings, events = all.places[number], all.findings[number], all.drives.events[number]
  if not (there or findings or events) then return nil end
  return mapped(there or NONE, complete_view), findings or NONE, events or NONE
end

--- The findings of the transaction of a view, wherever they stand; none before all of the file is known.
function M.findings_of(view) return view.complete and the_complete().of_transactions[view.item.id] or NONE end

--- The number of the drive object that a transaction of the complete result reaches; nil where none is sure.
function M.drive_object(item) return drive_objects.reached(the_complete().result, item) end

--- The drive object that a view is about, as a text that all who reach it share, as far as one knows:
-- `192.168.0.5 DO 2`; the submodule, `192.168.0.5 1.2`, where no number is known. Nil without a device.
function M.reached(view)
  local item = view.item
  local access = drive_objects.access_of(item)
  if not access.device then return nil end
  local axis = access.axis ~= 0 and access.axis or view.complete and M.drive_object(item)
  if axis then return format("%s DO %d", access.device, axis) end
  if not access.slot then return access.device end
  return access.device .. " " .. slot_number(access.slot, access.subslot)
end

--- The frame with the request of the transaction that a finding is about; nil where there is none, or where
-- it is not known yet.
function M.request_of(finding)
  local item
  if finding.transaction then
    item = complete and complete.result.transactions[finding.transaction]
  elseif finding.order then
    item = current.finished_jobs:by_order(finding.order)
  end
  return item and item.frames.write_request
end

--- Where the words of a cyclic frame stand: {at (where its data begins), source, receiver and frame_id (which
-- its relations have)}, nil of a frame that is none.
function M.cyclic_place(frame)
  local at = link.network(frame, link.PROFINET)
  local id = at and link.u16(frame, at)
  local source, receiver = id and link.source(frame, at), id and link.receiver(frame, at)
  return id and { at = at + 2, source = source, receiver = receiver, frame_id = id } or nil
end

--- The same of a frame of PROFIBUS: nil where it is none of data exchange.
-- @param item what telegram.lua decoded
function M.bus_place(item)
  if item.flaws[1] or dp.service(item) ~= "exchange" then return nil end
  return { at = profibus.data_start(item), source = source_on_bus(item.sa, item.da), frame_id = NO_FRAME_ID }
end

--- Where words of PKW stand in a cyclic frame, changed or not: array of {offset of the eight bytes, answer,
-- layout, family, vendor_id}. None of a relation that is not proven yet.
-- @param place as `cyclic_place` gives it
function M.standing(number, frame, place)
  local found = {}
  for _, each in ipairs(current.cyclic:ends_in(number, place)) do
    local offset = place.at + each.side.offset
    local relation = each.relation
    local shown = relation.channel == "pkw" and relation.certainty ~= "lengths"
    if shown and offset + each.side.length <= #frame then
      local layout = current:pkw_layout(relation.device)
      found[#found + 1] = {
        offset = offset, answer = not each.sent, layout = layout, family = drives_of(relation),
        vendor_id = relation.vendor_id,
      }
    end
  end
  return found
end

--- The words of drives in a cyclic frame, changed or not, as drives.lua gives them.
-- @param place as `cyclic_place` gives it
-- @param whole whether all frames were fed, and the complete result tells
function M.words(number, frame, place, whole)
  if whole then return drives.words(the_complete().drives, number, frame, place) end
  return drives.live_words(current.cyclic, number, frame, place)
end

-- The whole file

--- The time of the frame that is dissected, as transactions have theirs.
-- @param clock as `feed` takes it
function M.time_ns(clock) return clock(current) end

--- The complete result of the open file, as ds47.analysis gives it, with the stations that named themselves.
function M.result()
  hand_over_stations()
  local live = the_analysis()
  local result = live:ended()
  result.base_seconds = live.base_seconds
  return result
end

return M
