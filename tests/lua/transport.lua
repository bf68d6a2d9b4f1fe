-- Unit checks of the transport modules of lua/ds47: order, IP fragments, RPC, calls, records, index47, names.
-- What they make of whole captures is compared with Python (transport_trace.lua).
-- Usage: lua transport.lua LUA_FOLDER

package.path = arg[1] .. "/?.lua;" .. package.path

local calls = require("ds47.profinet.calls")
local completeness = require("ds47.profinet.completeness")
local dcp = require("ds47.profinet.dcp")
local Index47 = require("ds47.acyclic.index47").Index47
local ip = require("ds47.profinet.ip")
local lldp = require("ds47.profinet.lldp")
local stations = require("ds47.profinet.stations")
local ordered = require("ds47.support.ordered")
local recordcalls = require("ds47.acyclic.record_calls")
local recordevents = require("ds47.acyclic.record_events")
local records = require("ds47.profinet.records")
local rpc = require("ds47.profinet.rpc")

local SECOND = 1000000000
local passed = 0

local function check(name, got, expected)
  if got ~= expected then
    error(("%s: got %s, expected %s"):format(name, tostring(got), tostring(expected)), 2)
  end
  passed = passed + 1
end

-- Bytes

local function big(value, size)
  local out = ""
  for _ = 1, size do
    out = string.char(value % 256) .. out
    value = math.floor(value / 256)
  end
  return out
end

local function ordered_bytes(value, size, little)
  local text = big(value, size)
  return little and text:reverse() or text
end

local function uuid_bytes(uuid, little)
  if not little then
    return uuid
  end
  return uuid:sub(1, 4):reverse() .. uuid:sub(5, 6):reverse() .. uuid:sub(7, 8):reverse() .. uuid:sub(9)
end

local DEVICE = "\xde\xa0\x00\x01\x6c\x97\x11\xd1\x82\x71\x00\xa0\x24\x42\xdf\x7d"
local OBJECT = "\xde\xa0\x00\x00\x6c\x97\x11\xd1\x82\x71\x00\x01\x05\x01\x00\x2a"
local ACTIVITY = "ABCDEFGHIJKLMNOP"
local CONTROLLER, DRIVE = "192.168.133.2", "192.168.133.33"

-- A UDP payload; `of` may set ptype, little, object, interface, activity, seq, opnum, flags, fragment, body,
-- length, version.
local function payload(of)
  local l, body = of.little, of.body or "body"
  return string.char(of.version or 4, of.ptype or 0, of.flags or 0x20, 0, l and 0x10 or 0, 0, 0, 0)
    .. uuid_bytes(of.object or OBJECT, l) .. uuid_bytes(of.interface or DEVICE, l)
    .. uuid_bytes(of.activity or ACTIVITY, l) .. ("\0"):rep(4) .. ordered_bytes(1, 4, l)
    .. ordered_bytes(of.seq or 7, 4, l) .. ordered_bytes(of.opnum or 2, 2, l) .. "\xff\xff\xff\xff"
    .. ordered_bytes(of.length or #body, 2, l) .. ordered_bytes(of.fragment or 0, 2, l) .. "\0\0" .. body
end

local frame = 0
local function pdu_of(of)
  frame = frame + 1
  local answers = of.ptype == 2 or of.ptype == 3
  return rpc.parse({
    payload = payload(of), frame = frame, time_ns = of.time_ns or 0,
    src_ip = answers and DRIVE or CONTROLLER, dst_ip = answers and CONTROLLER or DRIVE, src_mac = "02:00",
  })
end

-- Order

local function keys(dictionary)
  local found = {}
  for key, value in dictionary:iterate() do
    found[#found + 1] = key .. "=" .. value
  end
  return table.concat(found, " ")
end

local function test_ordered()
  local o = ordered.new()
  check("empty", o:first(), nil)
  check("empty", o:pop_first(), nil)
  check("empty", o:pop("a"), nil)
  for number, key in ipairs({"a", "b", "c", "d"}) do
    o:set(key, number)
  end
  o:set("b", 9)
  check("a known key keeps its place", keys(o), "a=1 b=9 c=3 d=4")
  o:move_to_end("b")
  check("moved from the middle", keys(o), "a=1 c=3 d=4 b=9")
  o:move_to_end("a")
  o:move_to_end("a")
  check("moved from the front, and from the end", keys(o), "c=3 d=4 b=9 a=1")
  check("popped", o:pop("b"), 9)
  check("popped the newest", o:pop("a"), 1)
  o:set("e", 5)
  check("set behind", keys(o), "c=3 d=4 e=5")
  local key, value = o:pop_first()
  check("first", key .. value, "c3")
  check("length", o.length, 2)
  o:pop_first()
  o:pop_first()
  check("nothing is left", next(o.values) or o.newer.c or o.older.c or o.oldest or o.newest, nil)
  o:set("x", 1)
  check("used again", keys(o), "x=1")
end

-- RPC

local function test_rpc_parse()
  for _, little in ipairs({false, true}) do
    local pdu = pdu_of({
      little = little, seq = 0x81020304, opnum = 0x0103, fragment = 0x0201, length = 9, flags = 0x26,
    })
    check("ptype", pdu.ptype, 0)
    check("little", pdu.little, little)
    check("object", pdu.object_uuid, OBJECT)
    check("activity", pdu.activity, ACTIVITY)
    check("seq", pdu.seq, 0x81020304)
    check("opnum", pdu.opnum, 0x0103)
    check("fragment", pdu.fragment, 0x0201)
    check("last", pdu.last, true)
    check("fragmented", pdu.fragmented, true)
    check("body", pdu.body, "body")
    check("missing", pdu.missing, 5)
    check("client", pdu.client, CONTROLLER)
    check("server", pdu.server, DRIVE)
  end
  check("behind the stated length", pdu_of({body = "bodyPADDING", length = 4}).body, "body")
  check("client of a response", pdu_of({ptype = 2}).client, CONTROLLER)
  check("flags", pdu_of({flags = 0x20}).fragmented, false)
  check("upper bits of the type", pdu_of({ptype = 0xE2}).ptype, 2)
end

local function test_rpc_refused()
  check("version", pdu_of({version = 5}), nil)
  check("type", pdu_of({ptype = 11}), nil)
  for number = 0, 6 do
    for _, little in ipairs({false, true}) do
      local interface = DEVICE:sub(1, 3) .. string.char(number) .. DEVICE:sub(5)
      local ours = pdu_of({little = little, interface = interface}) ~= nil
      check("interface " .. number, ours, number >= 1 and number <= 4)
    end
  end
  local whole = payload({body = ""})
  for length = 0, #whole do
    local found = rpc.parse({payload = whole:sub(1, length), src_ip = "a", dst_ip = "b"})
    check("cut", found ~= nil, length == 80)
  end
  local vendor, device = rpc.device_identity(OBJECT)
  check("vendor", vendor, 0x2A)
  check("device", device, 0x0501)
  check("foreign object", rpc.device_identity(ACTIVITY), nil)
end

local function part(number, last, of)
  of = of or {}
  of.fragment, of.flags, of.body = number, last and 0x06 or 0x04, of.body or ("<" .. number .. ">")
  return pdu_of(of)
end

local function test_rpc_fragments()
  local fragments = rpc.Fragments.new(30 * SECOND)
  local whole = pdu_of({})
  check("no fragment", fragments:feed(whole), whole)
  check("last first", fragments:feed(part(2, true)), nil)
  check("copy", fragments:feed(part(2, true, {body = "other"})), nil)
  check("first", fragments:feed(part(0)), nil)
  check("behind the last", fragments:feed(part(7)), nil)
  local newest = part(1, false, {time_ns = 5})
  local joined = fragments:feed(newest)
  check("body", joined.body, "<0><1><2>")
  check("frame", joined.frame, newest.frame)
  check("time", joined.time_ns, 5)
  check("no longer a fragment", joined.fragmented, false)
  check("nothing is left", fragments.fragments, 0)
  fragments:feed(part(9))
  fragments:feed(part(0, true, {seq = 8, ptype = 2}))
  check("a last one removes what stands behind", fragments:feed(part(0, true)).body, "<0>")
end

-- What is not waited for any more, each told once.
local function given_up(parts)
  local gone = parts.given_up
  parts.given_up = {}
  return gone
end

local function test_rpc_fragment_bounds()
  local fragments = rpc.Fragments.new(30 * SECOND, 2, 100)
  for seq = 1, 5 do
    fragments:feed(part(seq == 4 and 1 or 0, false, {seq = seq}))
  end
  local gone, left = given_up(fragments), fragments:unfinished()
  check("three given up", #gone, 3)
  check("the oldest goes first", gone[1].pdu.seq, 1)
  check("for this limit", gone[1].limit, "rpc_messages")
  check("told once", given_up(fragments)[1], nil)
  check("two open", #left, 2)
  check("the newest is last", left[2].pdu.seq, 5)
  check("the first seen where the beginning lacks", left[1].pdu.fragment, 1)
  fragments = rpc.Fragments.new(30 * SECOND)
  fragments:feed(part(0, false, {seq = 1}))
  fragments:feed(part(0, false, {seq = 2, time_ns = 30 * SECOND + 1}))
  check("expired", fragments.partial.length, 1)
  gone = given_up(fragments)
  check("and told", gone[1].have, 1)
  check("for no limit", gone[1].limit, nil)
  fragments = rpc.Fragments.new(30 * SECOND, 9, 3)
  for number = 0, 3 do
    fragments:feed(part(number))
  end
  check("too many fragments", fragments.fragments, 0)
  check("of which limit", given_up(fragments)[1].limit, "rpc_fragments")
  fragments = rpc.Fragments.new(30 * SECOND, 9, 100, 10)
  fragments:feed(part(0, false, {seq = 1, body = "12345"}))
  fragments:feed(part(0, false, {seq = 2, body = "123456"}))
  check("too many bytes", fragments.bytes, 6)
  gone = given_up(fragments)
  check("the oldest goes", gone[1].pdu.seq, 1)
  check("for its bytes", gone[1].limit, "fragment_bytes")
end

-- IP

local LIMITS = {
  copy_ns = 1000000, call_expiry_ns = 60 * SECOND,
  fragment_expiry_ns = 1000, activities = 8192, calls = 64, datagrams = 256, answered_calls = 20,
  ip_datagrams = 256, ip_fragments = 16384, fragment_bytes = 16777216,
}
local UDP_PAYLOAD = ("0123456789"):rep(9)
local DATAGRAM = "\x88\x94\xc3\x50" .. big(8 + #UDP_PAYLOAD, 2) .. "\0\0" .. UDP_PAYLOAD

local function piece(first, last, of)
  of = of or {}
  local data = DATAGRAM:sub(first + 1, last)
  local kept = of.cut and data:sub(1, -1 - of.cut) or data
  return {
    frame = of.frame or first, time_ns = of.time_ns or 0, src_ip = "a", dst_ip = "b", ip_id = of.ip_id or 7,
    src_mac = "mac", offset = first, more = last < #DATAGRAM, data = kept, missing = of.cut,
  }
end

local function feed_all(reassembly, pieces)
  local whole
  for _, fragment in ipairs(pieces) do
    whole = reassembly:feed(fragment) or whole
  end
  return whole
end

local function test_ip_orders()
  local orders = {
    {{0, 24}, {24, 48}, {48, 98}}, {{48, 98}, {24, 48}, {0, 24}}, {{24, 48}, {0, 24}, {48, 98}},
    {{0, 24}, {16, 48}, {40, 98}}, {{0, 8}, {0, 56}, {48, 98}}, {{0, 56}, {48, 98}, {8, 16}},
    {{48, 98}, {0, 24}, {0, 24}, {24, 48}},
  }
  for number, order in ipairs(orders) do
    local reassembly, pieces = ip.Reassembler.new(LIMITS), {}
    for at, range in ipairs(order) do
      pieces[at] = piece(range[1], range[2])
    end
    local packet = feed_all(reassembly, pieces)
    check("payload of order " .. number, packet.payload, UDP_PAYLOAD)
    check("mac", packet.src_mac, "mac")
    check("missing", packet.missing, 0)
    check("a late copy opens nothing", #reassembly:unfinished(), 0)
  end
  local reassembly = ip.Reassembler.new(LIMITS)
  for _, time_ns in ipairs({0, 2000000}) do
    local pieces = {piece(0, 48, {time_ns = time_ns}), piece(48, 98, {time_ns = time_ns})}
    check("an identification used again", feed_all(reassembly, pieces).time_ns, time_ns)
  end
end

local function test_ip_again()
  local reassembly = ip.Reassembler.new(LIMITS)
  feed_all(reassembly, {piece(0, 48), piece(48, 98), piece(0, 48)})
  local last = {time_ns = 14000000}
  check("the same once more", feed_all(reassembly, {piece(48, 98, last)}).payload, UDP_PAYLOAD)
  check("nothing is left", #reassembly:unfinished(), 0)
  reassembly = ip.Reassembler.new(LIMITS)
  feed_all(reassembly, {piece(0, 48), piece(48, 98), piece(0, 48)})
  local other = piece(48, 98, last)
  other.data = other.data:reverse()
  check("another one", reassembly:feed(other), nil)
end

local function test_ip_incomplete()
  local reassembly = ip.Reassembler.new(LIMITS)
  feed_all(reassembly, {piece(0, 24), piece(48, 98, {frame = 9, time_ns = 5})})
  local left = reassembly:unfinished()
  check("one", #left, 1)
  check("fragments seen", left[1].have, 2)
  check("up to the hole", left[1].packet.payload, UDP_PAYLOAD:sub(1, 16))
  check("missing", left[1].packet.missing, 74)
  check("frame", left[1].packet.frame, 9)
  reassembly:feed(piece(0, 24, {time_ns = 2000, ip_id = 8}))
  local gone = given_up(reassembly)
  check("expired, and told", gone[1].have, 2)
  check("for no limit", gone[1].limit, nil)
  check("told once", given_up(reassembly)[1], nil)
  check("one is open", #reassembly:unfinished(), 1)
  check("too late", reassembly:feed(piece(24, 48, {time_ns = 2001})), nil)
  check("without a beginning it tells nothing", #reassembly:unfinished(), 1)
  local cut = feed_all(ip.Reassembler.new(LIMITS), {piece(0, 48, {cut = 10}), piece(48, 98)})
  check("cut", cut.payload, UDP_PAYLOAD:sub(1, 30))
  check("cut", cut.missing, 60)
  local huge = piece(0, 24)
  huge.offset = 65528
  reassembly = ip.Reassembler.new(LIMITS)
  check("an impossible offset", reassembly:feed(huge), nil)
  check("is nothing", reassembly.open.length, 0)
end

local function test_ip_bounds()
  local reassembly = ip.Reassembler.new(LIMITS)
  reassembly.most_datagrams, reassembly.most_fragments = 4, 10
  for ip_id = 1, 1000 do
    for first = 0, 24, 8 do
      reassembly:feed(piece(first, first + 8, {ip_id = ip_id}))
    end
  end
  check("bounded", #reassembly:unfinished() <= 8, true)
  check("fragments", reassembly.fragments <= 10, true)
  check("bytes", reassembly.bytes, reassembly.fragments * 8)
  reassembly.most_fragments, reassembly.most_bytes = 1000, 100
  for ip_id = 1, 4 do
    reassembly:feed(piece(0, 48, {ip_id = ip_id}))
  end
  check("bytes are bounded", reassembly.bytes, 96)
  local offsets = {}
  reassembly = ip.Reassembler.new(LIMITS)
  for at = 0, 88, 8 do
    offsets[#offsets + 1] = at
  end
  for number = 1, #offsets do -- a fixed disorder: steps of 5 through all of them
    local at = offsets[number * 5 % #offsets + 1]
    local packet = reassembly:feed(piece(at, math.min(at + 8, 98)))
    if packet then
      check("small pieces without order", packet.payload, UDP_PAYLOAD:sub(1, 88))
    end
  end
  check("the last piece lacks", reassembly.open.length, 1)
  check("whole", reassembly:feed(piece(96, 98)).payload, UDP_PAYLOAD)
end

-- Calls

local function tracker_of(limits)
  local heard = {}
  local handlers = {message = function() end}
  for _, name in ipairs({"asked", "answered", "again", "failed", "lost", "unasked", "twice", "pushed_out"}) do
    handlers[name] = function(_, call, more)
      heard[#heard + 1] = name .. ":" .. (type(more) == "table" and more or call.request or call).seq
    end
  end
  local tracker = calls.CallTracker.new(limits or LIMITS, handlers)
  return tracker, function()
    local text = table.concat(heard, " ")
    heard = {}
    return text
  end
end

local function feed_calls(tracker, list)
  for _, of in ipairs(list) do
    local pdu = pdu_of(of)
    tracker:take(pdu, pdu.frame) -- no two have the same IP id: none is a copy
  end
end

local function is_copy(tracker, of)
  return tracker:take(pdu_of(of), of.ip_id) ~= nil
end

local function test_copies()
  local cases = {
    {{time_ns = 1000000}, true}, {{time_ns = -1000000}, true}, {{time_ns = 90 * SECOND}, true},
    {{ip_id = 514}, false}, {{ip_id = 257}, false}, {{body = "other"}, false}, {{fragment = 1}, false},
    {{fragment = 256}, false}, {{ptype = 1}, false}, {{seq = 0x01000007}, false}, {{seq = 263}, false},
    {{activity = ("x"):rep(16)}, false}, {{little = true}, true}, {{opnum = 5}, true},
  }
  for number, case in ipairs(cases) do
    local tracker = tracker_of()
    local of = case[1]
    of.ip_id = of.ip_id or 513
    check("the first", is_copy(tracker, {ip_id = 513}), false)
    check("copy " .. number, is_copy(tracker, of), case[2])
    check("count", tracker.counts.copies, case[2] and 1 or 0)
  end
  for late, copy in pairs({[1000000] = true, [1000001] = false}) do
    local fresh = tracker_of()
    is_copy(fresh, {ip_id = 0})
    check("without an IP id", is_copy(fresh, {ip_id = 0, time_ns = late}), copy)
  end
  local tracker = tracker_of()
  for ip_id = 1, 512 do
    is_copy(tracker, {ip_id = ip_id})
  end
  for ip_id, copy in pairs({[1] = false, [256] = false, [257] = true, [512] = true}) do
    check("those that are enough are known, and no older ones", is_copy(tracker, {ip_id = ip_id}), copy)
  end
end

-- Datagrams with the same numbers that differ in their bodies.
local function test_alike_copies()
  local tracker = tracker_of()
  for _, copy in ipairs({false, true}) do
    for _, body in ipairs({"one", "two", "three"}) do
      check("alike but for the body", is_copy(tracker, {ip_id = 9, body = body}), copy)
    end
  end
  check("all are kept", tracker.room, LIMITS.datagrams - 3)
  for ip_id = 1000, 1252 do
    is_copy(tracker, {ip_id = ip_id})
  end
  for ip_id = 2000, 2254 do
    is_copy(tracker, {ip_id = ip_id})
  end
  for _, body in ipairs({"two", "three"}) do
    check("they are known", is_copy(tracker, {ip_id = 9, body = body}), true)
  end
  is_copy(tracker, {ip_id = 2255})
  for _, body in ipairs({"one", "two", "three"}) do
    check("and forgotten", is_copy(tracker, {ip_id = 9, body = body}), false)
  end
  tracker = tracker_of()
  is_copy(tracker, {ip_id = 9, body = "one"})
  for ip_id = 1000, 1254 do
    is_copy(tracker, {ip_id = ip_id})
  end
  is_copy(tracker, {ip_id = 9, body = "two"})
  for ip_id = 1000, 1254 do
    is_copy(tracker, {ip_id = ip_id, body = "more"})
  end
  check("also when the first one is forgotten", is_copy(tracker, {ip_id = 9, body = "two"}), true)
end

local function test_retransmissions()
  local request, response = {}, {ptype = 2}
  local tracker, heard = tracker_of()
  feed_calls(tracker, {request, {time_ns = 30 * SECOND}, {ptype = 2, time_ns = 30 * SECOND}})
  check("while unanswered", heard(), "asked:7 again:7 answered:7")
  for delay, event in pairs({[0] = "again", [60] = "again", [61] = "asked"}) do
    tracker, heard = tracker_of()
    feed_calls(tracker, {request, response, {time_ns = delay * SECOND}})
    check("after the answer", heard(), "asked:7 answered:7 " .. event .. ":7")
  end
  tracker, heard = tracker_of()
  feed_calls(tracker, {request, response, {seq = 8}, request})
  check("after another number", heard(), "asked:7 answered:7 asked:8 again:7")
  feed_calls(tracker, {{seq = 8, body = "other"}, request})
  check("its client counts anew", heard(), "lost:8 asked:8 asked:7")
  tracker, heard = tracker_of()
  feed_calls(tracker, {request, {body = "other"}, response})
  check("another body is a new call", heard(), "asked:7 lost:7 asked:7 answered:7")
  check("unanswered", tracker.counts.unanswered, 1)
  feed_calls(tracker, {{ptype = 2, body = "different"}})
  check("a second response", heard(), "twice:7")
  check("responses", tracker.counts.responses, 2)
  feed_calls(tracker, {response, {ptype = 2, body = "different"}})
  check("nothing is known behind one that came again", heard(), "")
end

local function test_expiry()
  for over, last in pairs({[0] = "answered:7", [1] = "lost:7 unasked:7"}) do
    local tracker, heard = tracker_of()
    feed_calls(tracker, {{}, {ptype = 2, time_ns = 60 * SECOND + over}})
    check("expiry", heard(), "asked:7 " .. last)
  end
  local tracker, heard = tracker_of({
    copy_ns = 0, call_expiry_ns = 60 * SECOND, activities = 2, calls = 2, datagrams = 256, answered_calls = 8,
  })
  feed_calls(tracker, {{seq = 1}, {seq = 2}, {seq = 3}, {seq = 4}})
  check("calls are bounded", heard(), "asked:1 asked:2 asked:3 pushed_out:1 asked:4")
  check("and that is none without a response", tracker.counts.unanswered, 0)
  local other_one, told = tracker_of({
    copy_ns = 0, call_expiry_ns = 60 * SECOND, activities = 2, calls = 2, datagrams = 256, answered_calls = 8,
  })
  feed_calls(other_one, {{seq = 1}, {seq = 2}, {seq = 2, ptype = 2}, {seq = 3}, {seq = 4}, {seq = 5}})
  check("what a client went on from is lost for no limit", told(),
    "asked:1 asked:2 answered:2 asked:3 asked:4 lost:1 asked:5")
  feed_calls(tracker, {{activity = ("x"):rep(16)}, {seq = 4}, {activity = ("y"):rep(16), seq = 9}})
  check("activities are bounded", heard(), "asked:7 pushed_out:2 again:4 pushed_out:7 asked:9")
  heard()
  local left = {}
  for _, call in ipairs(tracker:unanswered()) do
    left[#left + 1] = call.request.seq
  end
  check("what is unanswered", table.concat(left, " "), "3 4 9")
  tracker, heard = tracker_of()
  for seq = 1, 40 do
    feed_calls(tracker, {{seq = seq}, {seq = seq, ptype = 2}})
  end
  heard()
  local other = {seq = 20, ptype = 2, body = "other"}
  feed_calls(tracker, {{seq = 21, ptype = 2, body = "other"}, {seq = 20, ptype = 2}, other})
  feed_calls(tracker, {{seq = 41, ptype = 2}})
  check("answered calls are remembered for a while, and then the number", heard(),
    "twice:21 unasked:41")
end

local function test_faults()
  local tracker, heard = tracker_of()
  feed_calls(tracker, {{ptype = 3}, {}, {ptype = 3}, {ptype = 3}, {ptype = 1}, {ptype = 4}, {ptype = 5}})
  check("and nothing is open", #tracker:unanswered(), 0)
  check("a fault answers once", heard(), "asked:7 failed:7")
  local counts = tracker.counts
  check("counts", counts.faults * 1000 + counts.pings * 100 + counts.working * 10 + counts.others, 3111)
end

-- Records

local AR = ("R"):rep(16)

local function block(of)
  return big(of.type or 0x0008, 2) .. big(60, 2) .. "\1\0" .. big(5, 2) .. (of.ar or AR)
    .. big(of.api or 0x01020304, 4) .. big(of.slot or 0x0506, 2) .. big(of.subslot or 0x0708, 2) .. "\0\0"
    .. big(of.index or 0xB02E, 2) .. big(of.length or #(of.data or ""), 4) .. ("\0"):rep(4)
    .. big(of.status or 0, 4) .. ("\0"):rep(16) .. (of.data or "")
end

local NDR = ("\0"):rep(20)

local function request_of(of, opnum)
  return records.parse_request(pdu_of({opnum = opnum or rpc.WRITE, body = NDR .. block(of)}))
end

-- A chain of records or halves as a list.
local function list_of(item)
  local list = {}
  while item do
    list[#list + 1], item = item, item.following
  end
  return list
end

local function test_record_requests()
  local record = request_of({data = "data"})
  check("one", #list_of(record), 1)
  check("write", record.write and not record.implicit, true)
  check("api", record.api, 0x01020304)
  check("slot", record.slot, 0x0506)
  check("subslot", record.subslot, 0x0708)
  check("index", record.index, 0xB02E)
  check("ar", record.ar, AR)
  check("position", record.position, 0)
  check("data", record.request.data, "data")
  record = request_of({data = "data", length = 6})
  check("stated", record.request.stated, 6)
  check("missing", record.request.missing, 2)
  record = request_of({type = 9, length = 240}, rpc.READ)
  check("a Read carries nothing", record.request.data or record.request.missing, nil)
  check("but says how much it wants", record.request.stated, 240)
  record = request_of({type = 9}, rpc.READ_IMPLICIT)
  check("implicit", record.implicit, true)
  check("without AR", record.ar, records.NIL_UUID)
  check("wrong block", request_of({type = 9}), nil)
  check("no record call", request_of({}, rpc.CONNECT), nil)
  local whole = NDR .. block({})
  for length = 0, #whole do
    local found = records.parse_request(pdu_of({opnum = rpc.WRITE, body = whole:sub(1, length)}))
    check("cut", found ~= nil, length >= 60)
  end
end

local function test_write_multiple()
  local inner = block({data = "abcde"}) .. "\0\0\0" .. block({index = 47, data = "f"}) .. "\0\0\0"
  local first, multiple, nested = request_of({index = 0xE040, data = inner})
  local body = list_of(first)
  check("multiple", multiple and not nested, true)
  check("two", #body, 2)
  check("first", body[1].request.data, "abcde")
  check("second", body[2].request.data, "f")
  check("position", body[2].position, 2)
  inner = inner .. block({index = 0xE040, data = block({})})
  first, multiple, nested = request_of({index = 0xE040, data = inner})
  body = list_of(first)
  check("nested", multiple and nested, true)
  check("is not opened", #body, 3)
  check("stands as it is", body[3].index, 0xE040)
  local response = NDR .. block({type = 0x8008, index = 0xE040}) .. block({type = 0x8008, status = 5})
    .. block({type = 0x8008, index = 47})
  local status, answers = records.parse_response(pdu_of({ptype = 2, opnum = rpc.WRITE, body = response}))
  check("status", status, 0)
  check("inner responses only", #list_of(answers), 2)
  check("own status", answers.response.status, 5)
  check("own status", answers.following.response.status, 0)
  local refused = NDR .. block({type = 0x8008, index = 0xE040, status = 0xDF80B500})
  status, answers = records.parse_response(pdu_of({ptype = 2, opnum = rpc.WRITE, body = refused}))
  check("refused as a whole", status, 0xDF80B500)
  check("without inner responses", answers, nil)
end

local function test_responses()
  for _, little in ipairs({false, true}) do
    local ndr = ordered_bytes(0xDE80B500, 4, little)
    local of = {ptype = 2, little = little, opnum = rpc.READ}
    of.body = ndr .. ("\0"):rep(16) .. block({type = 0x8009, data = "data", length = 6})
    local status, answers = records.parse_response(pdu_of(of))
    check("status", status, 0xDE80B500)
    check("data", answers.response.data, "data")
    check("missing", answers.response.missing, 2)
    check("status of the read", answers.response.status, 0xDE80B500)
    of.body = ndr
    check("status alone", records.parse_response(pdu_of(of)), 0xDE80B500)
    of.body = ndr:sub(1, 3)
    check("no status", records.parse_response(pdu_of(of)), nil)
  end
  local cut = NDR .. block({type = 0x8008}):sub(1, 45)
  local _, answers = records.parse_response(pdu_of({ptype = 2, opnum = rpc.WRITE, body = cut}))
  check("a status that was cut off", answers.response.status, nil)
  local release = "\1\20" .. big(60, 2) .. "\1\0\0\0" .. AR .. ("\0"):rep(36)
  check("release", records.released_ar(pdu_of({opnum = rpc.RELEASE, body = NDR .. release})), AR)
  check("no release", records.released_ar(pdu_of({body = NDR .. block({})})), nil)
  check("nothing", records.released_ar(pdu_of({body = NDR})), nil)
end

-- Index47

local Door = {}
Door.__index = Door

local function door_of(extra, waiting, forbid_47)
  return setmetatable({index47 = Index47.new(extra, waiting or 4, forbid_47), through = {}}, Door)
end

function Door:run(event)
  self.through[#self.through + 1] = event
end

function Door:send(name, ar, index, proves)
  ar = ar or "AR"
  local runs = self.index47:passes(ar, index or 47)
  if proves and not runs then
    self.index47:prove(ar, self)
    runs = true
  end
  if runs then
    self:run(name)
  else
    self.index47:pass_on(ar, name)
  end
end

function Door:told()
  return table.concat(self.through, " ")
end

local function test_index47_waits()
  local door = door_of()
  local function waits(device)
    return door.index47:waits(device)
  end
  local ar, other = records.ar_text(CONTROLLER, DRIVE, AR), records.ar_text(CONTROLLER, DRIVE, AR:lower())
  check("nothing waits", waits(DRIVE), false)
  door:send("a", ar)
  check("waits", waits(DRIVE), true)
  check("the controller does not", waits(CONTROLLER), false)
  check("nor one whose name begins alike", waits(DRIVE:sub(1, -2)), false)
  door:send("b", other)
  door:send("proof", ar, nil, true)
  check("the other AR waits", waits(DRIVE), true)
  door:send("proof", other, nil, true)
  check("none waits any more", waits(DRIVE), false)
end

local function test_index47_indices()
  local shut = Index47.new({[1000] = true}, 4)
  for index, want in pairs({
    [47] = {true, true}, [0xB02E] = {true, false}, [0xB02F] = {true, false}, [48] = {false, true},
    [1000] = {true, false},
  }) do
    check("concerned " .. index, shut.concerned[index] or false, want[1])
    check("needs proof " .. index, not shut:passes("AR", index), want[2])
  end
  check("forbidden", Index47.new({}, 4, true).concerned[47], nil)
  check("forbidden though named", Index47.new({[47] = true}, 4, true).concerned[47], nil)
  check("B02E is not", Index47.new(nil, 4, true).concerned[0xB02E], true)
  local door = door_of({[47] = true})
  door:send("now")
  check("named by the user", door:told(), "now")
  check("open", door.index47:is_open("AR", 47), true)
  check("not ours", door.index47:is_open("AR", 48), false)
end

local function test_index47_waiting()
  local door = door_of()
  door:send("a")
  door:send("other", "OTHER")
  door:send("b")
  door:send("B02F", nil, 0xB02F, true)
  check("held", door:told(), "B02F")
  door:send("proof", nil, 47, true)
  door:send("after")
  check("what waited goes first", door:told(), "B02F a b proof after")
  check("each AR proves itself", door.index47:is_open("OTHER", 47), false)
  door = door_of(nil, 4)
  for number = 0, 5 do
    door:send(number)
  end
  door:send("proof", nil, 47, true)
  check("the oldest event is forgotten", door:told(), "2 3 4 5 proof")
  door = door_of(nil, 4)
  for number = 0, 4 do
    door:send(number, "AR" .. number)
  end
  for number = 0, 4 do
    door:send("|", "AR" .. number, 47, true)
  end
  check("the oldest AR is forgotten", door:told(), "| 1 | 2 | 3 | 4 |")
  door = door_of(nil, 20)
  for ar = 1, 17 do
    for _ = 1, 20 do
      door:send(ar, ar)
    end
  end
  check("eight times as many together", door.index47.events, 160)
  check("the oldest goes", door.index47.held:get(1), nil)
end

-- Record calls, with a pairing that writes down what it hears

local function ear_of()
  local ear = {heard = {}}
  local function note(name)
    return function(self, ...)
      local half = name == "write_response" and select(3, ...) and " fault" or ""
      self.heard[#self.heard + 1] = name .. half
      return {}
    end
  end
  for _, name in ipairs({"write_request", "write_response", "read_response", "read_lost", "write_unasked",
    "release"}) do
    ear[name] = note(name)
  end
  function ear.expected()
    return nil
  end
  function ear.read_over() end
  function ear.is_again()
    return false
  end
  function ear.goes_on()
  end
  function ear:remark(remark)
    self.heard[#self.heard + 1] = remark.rule
  end
  return ear
end

local GOOD_REQUEST = "\1\1\1\1\16\1\3\232\0\0"

local function calls_of(ear, extra)
  local door = Index47.new(extra, 4096)
  local events = recordevents.RecordEvents.new(door, ear, nil, ear)
  local missing = completeness.new(LIMITS.activities)
  local made = recordcalls.RecordCalls.new(events, ear, ear, stations.Stations.new(), missing)
  return calls.CallTracker.new(LIMITS, made, missing)
end

local function test_record_calls()
  local ear = ear_of()
  local tracker = calls_of(ear)
  local write = {opnum = rpc.WRITE, body = NDR .. block({index = 47, data = "foreign"})}
  feed_calls(tracker, {write, write})
  check("47 waits", table.concat(ear.heard, " "), "")
  local shaped = NDR .. block({index = 47, data = GOOD_REQUEST})
  local good = {opnum = rpc.WRITE, seq = 8, body = shaped, time_ns = -1}
  feed_calls(tracker, {good, {ptype = 3, opnum = rpc.WRITE, seq = 8, body = "\1\2"}})
  check("until it is proved", table.concat(ear.heard, " "),
    "write_request DS103 DS107 write_request DS104 write_response fault")
  ear.heard = {}
  local read = {opnum = rpc.READ, seq = 9, body = NDR .. block({type = 9, length = 240})}
  feed_calls(tracker, {read})
  for _, call in ipairs(tracker:unanswered()) do
    tracker.handlers:lost(call)
  end
  check("lost", table.concat(ear.heard, " "), "DS101 DS101 read_lost")
  ear.heard = {}
  local answer = NDR .. block({type = 0x8009, data = "?"})
  feed_calls(tracker, {{ptype = 2, seq = 11, opnum = rpc.READ, body = answer}})
  check("orphan", table.concat(ear.heard, " "), "DS102 read_response")
  ear.heard = {}
  read.seq = 10
  feed_calls(tracker, {read, {ptype = 2, seq = 10, opnum = rpc.READ, body = ""}})
  check("an empty body", table.concat(ear.heard, " "), "DS108 read_response")
end

-- Names

local function test_names()
  local names = stations.Stations.new()
  names:message(pdu_of({ptype = 2}), "02:00")
  names:message(pdu_of({ptype = 0, opnum = rpc.CONNECT}))
  local device = names:devices()[1]
  check("device", device.ip .. device.mac .. device.vendor_id, DRIVE .. "02:0042")
  local data = "\2\2\0\8\0\0drive\xe9" .. "\1\2\0\14\0\1" .. "\192\168\133\33" .. ("\0"):rep(8)
  local identify = "\xfe\xff\5\1\0\0\0\1\0\0" .. big(#data, 2) .. data
  names:station("dcp", identify, "02:33", "02:01")
  check("name, as UTF-8", names:devices()[1].station, "drive\xc3\xa9")
  check("the mac of RPC stays", names:devices()[1].mac, "02:00")
  check("twice the same", names:devices()[1].station, "drive\xc3\xa9")
  for length = 0, #identify do
    dcp.parse(identify:sub(1, length), "02:33")
  end
  local set = "\xfe\xfd\4\0" .. identify:sub(5)
  check("a Set names its destination", dcp.parse(set, "02:33", "02:01").mac, "02:01")
  check("a request asks only", dcp.parse("\xfe\xfe\5\0" .. identify:sub(5), "02:33"), nil)
  local few = stations.Stations.new(2)
  for last = 1, 5 do
    few:station("dcp", identify:gsub("\192\168\133\33", "\192\168\133" .. string.char(last)), "02:33")
  end
  check("addresses that are kept", few.by_ip.length, 2)
end

local function tlv(kind, value)
  return big(kind * 512 + #value, 2) .. value
end

local function test_lldp()
  local ours = tlv(127, "\x00\x0e\xcf\x05\2\0\0\0\0\1")
  local cases = {
    {"\7drive-1", "\7port-001", "drive-1"}, {"\7SINAMICS G120", "\7port-001.drive-1", "drive-1"},
    {"\7SINAMICS", "\7port-001-00002.drive.cell-4", "drive.cell-4"}, {"\7a", "\7port-002.new", "new"},
    {"\7" .. ("a"):rep(240), "\7x", ("a"):rep(240)}, {"\7old-", "\7port-1.x", nil},
    {"\7" .. ("a"):rep(241), "\7x", nil},
  }
  for _, case in ipairs(cases) do
    local found = lldp.parse(tlv(1, case[1]) .. tlv(2, case[2]) .. ours .. "\0\0", "02:99")
    check("station name", found and found.name, case[3])
    check("mac of the station", found and found.mac, case[3] and "02:00:00:00:00:01")
  end
  check("an office switch", lldp.parse(tlv(1, "\7drive-1"), "02:99"), nil)
  local address = lldp.parse(tlv(8, "\5\1\192\168\0\5\2\0\0\0\1\0") .. ours .. "\xfe", "02:99")
  check("address", address.ip, "192.168.0.5")
end

for _, test in ipairs({
  test_ordered, test_rpc_parse, test_rpc_refused, test_rpc_fragments, test_rpc_fragment_bounds,
  test_ip_orders, test_ip_again, test_ip_incomplete, test_ip_bounds, test_copies, test_alike_copies,
  test_retransmissions, test_expiry, test_faults, test_record_requests, test_write_multiple,
  test_responses, test_index47_indices, test_index47_waiting, test_index47_waits, test_record_calls,
  test_names, test_lldp,
}) do
  test()
end
print(passed .. " checks passed")
