-- Cyclic frames to what their channels say: which bytes of which frame are a channel, and what changed in
-- them. What a change of the bytes means is the business of handshake.lua and timeline.lua.
--
-- Relations come from Connects, or are named by hand; a later Connect of the same stations replaces what an
-- earlier one said. Transactions of PKW are handed out when their relation is proven: a request and the
-- response that followed it were seen. PZD is proven by its words, or by PKW beside it.
--
-- A line is one relation at work (`Requests`, `Drive`), an end one direction of it: {line, side, sent (by
-- the controller), looks (frames that were looked at: they count where no cycle is known), and of PKW words
-- (what was there last)}. A row has the ends of one sender and frame id; it is found by the bytes that all
-- its frames begin with: a frame costs one look-up, a comparison where it is watched, and no more as long as
-- nothing changes in it. Of the others one in a while is looked at, because values move in all of them: the
-- same ones as the analyzer looks at (`sampled` in capture/scan.py).

local arrays = require("ds47.support.arrays")
local connect = require("ds47.profinet.connect")
local entries = require("ds47.support.later").entries
local flat = require("ds47.support.flat").copy
local handshake = require("ds47.cyclic.handshake")
local link = require("ds47.profinet.link")
local operation = require("ds47.cyclic.operation")
local relations = require("ds47.cyclic.relations")
local rpc = require("ds47.profinet.rpc")
local sequences = require("ds47.cyclic.sequences")
local tables = require("ds47.spec.tables")
local timeline = require("ds47.cyclic.timeline")

local byte, char, sub = string.byte, string.char, string.sub
local floor, max, min = math.floor, math.max, math.min
local filtered, has, mapped = arrays.filtered, arrays.has, arrays.mapped
local concat, find, gsub, rep = table.concat, string.find, string.gsub, string.rep

local M = {}

local ETHERTYPE, TAG = "\x88\x92", "\x81\x00"
local DCP = 0xFE -- first byte of frame ids that are not cyclic
-- What a sender may be slower than its cycle, and how many frames it may be short of: else some are missing.
local SLOWER, ALLOWED = 1.25, 3
-- After so many exchanges with a station one that comes so many times as late as any before it shows a hole.
local HABIT, PAUSE = 32, 4
local LATE = 2 -- cycles from a change of a request to the next frame of the drive: some between are missing
local KEPT = 256 -- transactions that wait for the proof
local PATIENCE = 8192 -- frames of what might be PZD that are looked at without a proof
-- Of so many frames one is looked at, and how often before it is half as many.
local SAMPLE, RAREST, OFTEN = 4, 1024, 256
local DENSE = 1024 -- data exchanges that are all looked at; then one of ever more that say the same
local SPEED = "^NSOLL" -- how the name of a word begins that is a setpoint of speed
local LENGTHS, CONFIGURED, SEEN = relations.LENGTHS, relations.CONFIGURED, relations.SEEN
local NAMED, ODD, REFUTED = relations.NAMED, relations.ODD, relations.REFUTED

local NO_DOUBT = {{}, {}} -- the ends of a line that gets no more frames

local Channels = {}
Channels.__index = Channels

--- All channels of drives in the cyclic frames of a capture.
-- @param listener listener:exchanged(relation, job) is told of each transaction of a proven relation when
--   it is over
-- @param limits the flat table of tables.lua
-- @param numbers nil, or those that the frames had before somebody chose them: every watched one is looked at
function M.new(listener, limits, numbers, naming)
  return setmetatable({
    naming = naming, numbers = numbers, listener = listener, limits = limits, lines = {},
    rows = {}, -- source, EtherType and frame id -> row
    senders = 0, -- how many rows there are
    strange = {}, -- keys of rows of which frames go to receivers that are in no relation, too
    stations = {}, -- the same of stations of PROFIBUS, by source
    named = {}, -- relations that a user named
    all = {}, -- relations, those that a later Connect replaced and those that are only candidates too
    drives_ = {}, -- lines of PZD
    without_request = {}, -- relations of PKW in which none was seen
    ignored = {}, -- {relation, job} of what reads as a request and has no response
    newest = {}, -- {time, counter} of the newest frame, by key of its row and receiver
    mixed = {}, -- {frame, device, sender, frame_id}: it proves that several sequences take turns
    asked = {}, -- places where one was, in a relation that another one may have replaced
    moved = {}, -- ends in which the last frame changed something
    looked = {frame = 0, place = 0, time = 0}, -- of the last look; `place` is its number before
    busiest = 0, -- the highest rate of a channel
  }, Channels)
end

-- A relation of PKW; what is over waits until one transaction proves it.
local Requests = {}
Requests.__index = Requests

-- A transaction is over. Not a closure: a line is copied for the end of the capture.
local function over(job, line)
  local relation, waiting = line.relation, line.waiting
  line.asked = true
  local responded = job.state == "ok" or job.state == "error"
  local edge = job.began and not job.settled
  if (relation.certainty == LENGTHS or relation.certainty == CONFIGURED) and responded and edge then
    relation.certainty = SEEN
    line.owner:proven(relation)
  end
  if #waiting < KEPT then waiting[#waiting + 1] = job end
  line:hand_out()
end

-- What is over waits, too, while the frames of an end may be of two sequences (`doubt`).
function Requests:hand_out()
  local waiting, ends = self.waiting, self.ends
  if self.relation.certainty == LENGTHS or ends[1].doubt or ends[2].doubt then return end
  self.waiting = {}
  for _, each in ipairs(waiting) do self.owner.listener:exchanged(self.relation, each) end
end

function Requests:take(sent, words, moment)
  if not sent then
    self.channel:answered(words, moment)
  elseif self.channel:sent(words, moment) then
    self.changed = self.changed or moment
  end
end

--- A frame of the drive comes; before its words.
function Requests:passes(moment)
  local changed = self.changed
  self.changed = nil
  if changed and self.rate > 0 and moment.time - changed.time >= LATE * self.relation.input.cycle_ns then
    self:skipped(changed, moment.frame)
  end
end

--- Frames are missing between the one `before` and another.
function Requests:skipped(before, last)
  self.channel:skipped(before.frame, last, before.time - LATE * self.relation.input.cycle_ns)
end

--- The data exchange stopped: nobody is to blame for what is open.
function Requests:stopped(moment) self.channel:lost(moment) end

function Requests:lost(sent, moment) self.channel:lost(moment, sent and "out" or "in") end

--- The same line as one that goes on alone, with another relation and owner.
function Requests:apart(relation, owner)
  local made = flat(self)
  made.relation, made.owner, made.channel = relation, owner, self.channel:apart(made)
  made.waiting = mapped(self.waiting, flat)
  return made
end

--- Only what nothing proves is given up.
function Requests.is_hopeless() return false end

-- What stood for so long, where all reads as requests, and nothing has a response or proves that it is PKW.
local function ignored(line, cycles)
  if line.relation.certainty ~= LENGTHS then return nil end
  local found
  for _, each in ipairs(line.waiting) do
    local is_ignored = handshake.is_ignored(each)
    if not is_ignored and each.state ~= "incomplete" then return nil end
    if found == nil and is_ignored and handshake.stood(each) >= cycles then found = each end
  end
  return found
end

function Requests:finish(within)
  self.channel:finish(within)
  self.ends = NO_DOUBT
  self:hand_out()
  local owner = self.owner
  local job = ignored(self, owner.limits.pkw_cycles)
  if job then owner.ignored[#owner.ignored + 1] = {relation = self.relation, job = job} end
  local certainty = self.relation.certainty
  if (certainty == LENGTHS or certainty == CONFIGURED) and not self.asked then
    owner.without_request[#owner.without_request + 1] = self.relation
  else
    owner.asked[relations.place(self.relation)] = true
  end
end

-- A relation of PZD with what its words say; `behind` PKW in one submodule only PKW can prove it.
local Drive = {}
Drive.__index = Drive

-- Whether the word behind STW1 is a speed in all of these telegrams; nil where some have another word.
local function is_speed(numbers)
  local known
  for _, number in ipairs(numbers) do
    local speed = find(tables.pzd.telegrams[number].out[2], SPEED) ~= nil
    if known ~= nil and known ~= speed then return nil end
    known = speed
  end
  return known
end

--- Whether it is a drive, as far as one can see.
function Drive:is_proven()
  local certainty = self.relation.certainty
  return (certainty == SEEN or certainty == NAMED) and not (self.refuted or self.recorder.refuted)
end

--- Whether it was looked at for long, and nothing speaks for a drive.
function Drive:is_hopeless() return self.looked_at > PATIENCE and not self:is_proven() end

function Drive:prove()
  local is_new = not self.behind and self.relation.certainty == LENGTHS
  if self.recorder.proven and is_new then self.relation.certainty = SEEN end
end

function Drive:take(sent, words, moment)
  local recorder, relation = self.recorder, self.relation
  self.looked_at = self.looked_at + 1
  if sent then
    recorder:sent(words, moment.frame, moment.time)
  else
    recorder:answered(words, moment.frame, moment.time)
  end
  self:prove()
  if recorder.refuted and relation.certainty == NAMED then relation.certainty = REFUTED end
  if recorder.speed and not self.is_speed then
    self.is_speed = true
    relation.telegrams = filtered(relation.telegrams, function(number) return is_speed({number}) end)
  end
end

--- Frames are missing behind the one `before`, if its own began before.
function Drive:skipped(before)
  if self.start and self.start <= before.time then self.recorder:skipped() end
end

--- The data exchange stopped: what the drive did until it started again is unknown.
function Drive:stopped() self.recorder:skipped() end

function Drive:lost(sent, moment) self.recorder:lost(sent, moment.frame, moment.time) end

--- As that of PKW; events are shared, because no frame adds one.
function Drive:apart(relation, owner)
  local made = flat(self)
  made.relation, made.owner, made.recorder = relation, owner, flat(self.recorder)
  made.recorder.operation = self.recorder.operation:apart()
  made.recorder.trips = self.recorder.trips:apart()
  return made
end

function Drive:finish()
  local numbers = self.relation.telegrams
  local function lacks_pkw(number) return not tables.pzd.telegrams[number].pkw end
  local beside_pkw = numbers[1] ~= nil and not arrays.any(numbers, lacks_pkw)
  self.recorder:finish(beside_pkw or relations.is_bus(self.relation))
  self:prove()
  self.recorder.operation:finish()
  local looked = self.ends[1].looks > 0 and self.ends[2].looks > 0
  if self.relation.certainty == NAMED and not self.recorder:has_sense() and looked then
    self.relation.certainty = ODD
  end
end

--- From this frame on its frames are of two drives: what was seen in them does not count.
function Drive:cut(since)
  if since then self.recorder:cut(since.frame) end
  self.refuted = self.refuted or since == nil or #self.recorder.events == 0
end

local function of_fault(self, rule, frame)
  local code = self.recorder:fault_code(frame)
  local args = {device = self.relation.device, slot = self.relation.slot, code = code}
  args.what = code and "pzd_fault_number" or "pzd_fault"
  return {rule = rule, frame = frame, args = args}
end

--- What was wrong with its operation; when nothing more comes. An array of remarks.
function Drive:remarks()
  local found, recorder = {}, self.recorder
  if not recorder:has_sense() then return found end
  local since = recorder.fault_since
  for _, frame in ipairs(recorder.trips.frames) do
    found[#found + 1] = of_fault(self, "DS520", frame)
    if frame == since then since = nil end
  end
  if since then found[#found + 1] = of_fault(self, "DS533", since) end
  for _, remark in ipairs(recorder.operation.remarks) do found[#found + 1] = remark end
  return found
end

-- Relations

-- The line of a relation of PZD.
local function new_drive(self, relation, behind)
  local place = relations.place_of("FAULT_CODE", relation.telegrams)
  local warning = relations.place_of("WARN_CODE", relation.telegrams)
  local recorder = timeline.new(
    operation.new({device = relation.device, slot = relation.slot}, self.limits),
    not relations.is_foreign(relation), is_speed(relation.telegrams), warning and place, self.limits.events,
    relations.is_of_others(relation)
  )
  local line = {
    relation = relation, owner = self, recorder = recorder, behind = behind,
    refuted = false, -- whether its bytes turned out to be PKW
    looked_at = 0, is_speed = false, -- whether the telegrams without a setpoint of speed are left out
  }
  return setmetatable(line, Drive)
end

local function new_requests(self, relation)
  local line = setmetatable({relation = relation, owner = self, waiting = {}, asked = false}, Requests)
  line.channel = handshake.new(over, line, relations.is_bus(relation) and relation.certainty ~= NAMED)
  line.changed = nil -- when the words of the controller changed first, until a frame of the drive comes
  line.shared = false -- whether other drives have frames of the same id
  return line
end

local function add(self, relation, behind)
  self.all[#self.all + 1] = relation
  relation.is_foreign = relations.is_foreign
  local line
  if relation.channel == relations.PKW then
    line = new_requests(self, relation)
  else
    line = new_drive(self, relation, behind)
    self.drives_[#self.drives_ + 1] = line
  end
  -- Frames of both directions in a nanosecond, of PZD half of them: what is a little out of order is no hole.
  local out, input = relation.output.cycle_ns, relation.input.cycle_ns
  line.rate = out > 0 and input > 0 and (1 / out + 1 / input) / (line.recorder and 2 or 1) or 0
  line.ends = {
    {line = line, side = relation.output, sent = true, looks = 0},
    {line = line, side = relation.input, sent = false, looks = 0},
  }
  self.lines[#self.lines + 1] = line
end

--- A relation is PKW: what is beside or behind it is PZD, and nothing else is in its bytes.
function Channels:proven(pkw)
  local place, beside = relations.place(pkw), {}
  for _, each in ipairs(self.drives_) do
    if relations.place(each.relation) == place then
      if relations.is_same_spot(each.relation, pkw) and not each.behind then
        each.refuted = true
      else
        beside[#beside + 1] = each
      end
    end
  end
  if #beside == 1 and beside[1].relation.certainty ~= NAMED then beside[1].relation.certainty = SEEN end
end

-- Relations that were replaced get no more frames.
local function leave_out_replaced(self)
  self.lines = filtered(self.lines, function(line) return line.relation.replaced == nil end)
end

-- The channels that `is_over(relation)` tells are set up anew, in this frame.
local function replace(self, frame, is_over)
  for _, line in ipairs(self.lines) do
    if is_over(line.relation) then
      line:finish()
      line.relation.replaced = frame
      if line.recorder then line.recorder.fault_since = nil end -- what becomes of it the next one shows
    end
  end
  leave_out_replaced(self)
end

-- Those of two stations, but for what was named and fits the frames: frame id -> bytes of data.
local function replace_all(self, controller, device, frame, lengths)
  local function fits(side) return side.offset + side.length <= (lengths[side.frame_id] or math.huge) end
  replace(self, frame, function(each)
    local stays = has(self.named, each) and fits(each.output) and fits(each.input)
    return each.output.source == controller and each.input.source == device and not stays
  end)
end

-- Whether a channel of a Connect may be one: what was named in its bytes wins, and is told as set up there;
-- where no frame came before, there was nothing else.
local function agrees(self, found)
  for _, name in ipairs(self.named) do
    local meet, is_same = relations.meet(name, found)
    if is_same then
      found.certainty = NAMED
      replace(self, found.frame, function(each) return each == name end)
      if name.frame == nil then
        self.all = filtered(self.all, function(each) return each ~= name end)
        self.drives_ = filtered(self.drives_, function(each) return each.relation ~= name end)
      end
    elseif meet and (name.channel == relations.PKW or found.channel ~= relations.PKW) then
      return false -- PKW where PZD was named proves itself
    end
  end
  return true
end

-- The bytes that matter in the frames of a row, in order and each once: array of {offset, length}.
local function parts_of(row)
  local places, parts = {}, {}
  for _, each in ipairs(row) do
    local side = each.side
    for at = side.offset, side.offset + side.watched - 1 do places[#places + 1] = at end
    places[#places + 1] = side.status
    places[#places + 1] = side.iops
    local is_shared = row.shared or not each.sent and each.line.channel and each.line.shared
    if is_shared and side.status then -- all frames: what one says may be what another one said last
      places[#places + 1] = side.status - 2
      places[#places + 1] = side.status - 1
    end
  end
  table.sort(places)
  for _, at in ipairs(places) do
    local newest = parts[#parts]
    if newest and newest[1] + newest[2] == at then
      newest[2] = newest[2] + 1
    elseif newest == nil or newest[1] + newest[2] < at then
      parts[#parts + 1] = {at, 1}
    end
  end
  return parts
end

-- The sender at the other side: the receiver of the frames of an end.
local function receiver_of(each)
  local relation = each.relation or each.line.relation
  return (each.sent and relation.input or relation.output).source
end

--- Of the ends of one sender and frame id those that are in a frame to this receiver: two controllers may
-- have the same frame id. All where the frame is to several stations, or its header does not know to whom.
function M.ends_to(ends, receiver)
  local found = {}
  for place = 1, #ends do
    if receiver_of(ends[place]) == receiver then found[#found + 1] = ends[place] end
  end
  return (found[1] or (byte(receiver or "") or 1) % 2 == 0) and found or ends
end

-- Where requests of PKW are in frames the row of the drive: what it says next is looked at, too.
local function row_of_answers(self, row)
  for _, each in ipairs(row.shared and {} or row) do
    if each.sent and each.line.channel then
      local source, id = each.line.relation.input.source, each.line.relation.input.frame_id
      if relations.is_bus(each.line.relation) then return self.stations[source] end
      return self.rows[source .. ETHERTYPE .. char(floor(id / 256), id % 256)]
    end
  end
  return nil
end

local function watch(self)
  self.rows, self.senders, self.moved, self.stations, self.busiest = {}, 0, {}, {}, 0
  for _, line in ipairs(self.lines) do
    self.busiest = max(self.busiest, line.rate)
    local is_bus = relations.is_bus(line.relation)
    for _, each in ipairs(line.ends) do
      local rows, key, id = self.stations, each.side.source, each.side.frame_id
      if not is_bus then rows, key = self.rows, key .. ETHERTYPE .. char(floor(id / 256), id % 256) end
      if is_bus or floor(id / 256) ~= DCP then
        rows[key] = rows[key] or {
          period = -1, due = 0, -- of the last look, and the frame with which the next begins
          said = "", count = 0, longest = 0, -- of a station; the longest time between two
          restarted = false, -- whether the station was set up anew since the newest one
          follows = false, -- whether the frame behind one that says something new is looked at as well
          sequences = {}, -- by receiver
          key = key,
        }
        local row = rows[key]
        row[#row + 1], row.follows = each, row.follows or each.side.cycle_ns == 0
      end
    end
  end
  for _, row in pairs(self.rows) do
    row.shared = self.strange[row.key] or #M.ends_to(row, receiver_of(row[1])) < #row
    for _, each in ipairs(row) do
      if each.sent then each.line.shared = row.shared end
    end
  end
  for _, rows in ipairs({self.rows, self.stations}) do
    for _, row in pairs(rows) do
      row.parts = parts_of(row)
      local final = row.parts[#row.parts]
      row.need = final[1] + final[2]
      row.answered = row_of_answers(self, row)
      self.senders = self.senders + (rows == self.rows and 1 or 0)
    end
  end
end

--- Channels that a user names, before the first frame: relations as named.lua gives them.
function Channels:name(named)
  self.named = named
  for _, relation in ipairs(named) do add(self, relation, false) end
  watch(self)
end

--- A Connect and its response; nothing happens where it was refused, or sets up no such channel.
function Channels:connected(request, response)
  local asked = connect.parse_request(request)
  local ar, device_mac, frame_ids = connect.parse_response(response)
  if not asked or ar ~= asked.ar then return end
  local lengths = connect.answered(asked, frame_ids)
  replace_all(self, asked.controller_mac, device_mac, response.frame, lengths)
  local vendor_id = rpc.device_identity(response.object_uuid)
  if vendor_id == nil and self.naming.vendor_id then vendor_id = self.naming:vendor(request.server) end
  for _, found in ipairs(relations.channels(asked, vendor_id)) do
    if #self.all >= self.limits.relations then break end
    local item, channel, offset = found.submodule, found.channel, found.offset
    local made = {
      channel = channel, controller = request.client, device = request.server,
      vendor_id = vendor_id, ar = ar, api = item.api, slot = item.slot, subslot = item.subslot,
      telegrams = found.telegrams,
      output = relations.side(item.output, asked.controller_mac, channel, offset),
      input = relations.side(item.input, device_mac, channel, offset),
      frame = response.frame, certainty = LENGTHS,
    }
    if agrees(self, made) then add(self, made, offset > 0) end
  end
  watch(self)
end

--- Of whom the drives are whose channels were named, as far as the capture has shown it.
function Channels:identify()
  for _, each in ipairs(self.named) do each.vendor_id = self.naming:vendor_of(each.device) end
end

local function same_side(one, other)
  return one.source == other.source and one.offset == other.offset and one.length == other.length
end

-- Whether these channels are at work already: a station that starts again has the same ones.
local function is_set_up_so(self, found, output)
  local there = filtered(self.lines, function(line) return line.relation.output.source == output end)
  for number, each in ipairs(found) do
    local other = there[number] and there[number].relation
    if not other or each.channel ~= other.channel or each.vendor_id ~= other.vendor_id
      or not same_side(each.output, other.output) or not same_side(each.input, other.input) then
      return false
    end
  end
  return #there == #found
end

--- A station of PROFIBUS gets its configuration: the channels in its data, in place of those before.
-- @param output, input  the sources of both sides: there may be no channel any more
-- @param frame  of the configuration
function Channels:configured(found, output, input, frame)
  if is_set_up_so(self, found, output) then
    if self.stations[output] then self.stations[output].restarted = true end
    return
  end
  replace_all(self, output, input, frame, {})
  for _, relation in ipairs(found) do
    if #self.all < self.limits.relations then add(self, relation, false) end
  end
  watch(self)
end

-- What there is

--- The proven lines of PZD.
function Channels:drives() return filtered(self.drives_, Drive.is_proven) end

function Channels:has_drives() return self.drives_[1] ~= nil and self:drives()[1] ~= nil end

-- Whether the bytes of what might be PKW turned out to be the words of a drive.
local function is_pzd(self, pkw)
  if pkw.certainty ~= LENGTHS then return false end
  return arrays.any(self.drives_, function(each)
    return each:is_proven() and not each.behind and relations.place(each.relation) == relations.place(pkw)
      and relations.is_same_spot(each.relation, pkw)
  end)
end

--- Those that are reported, those that a later Connect replaced too; of PZD those that are proven.
function Channels:relations()
  local proven = {}
  for _, each in ipairs(self:drives()) do proven[each.relation] = true end
  return filtered(self.all, function(each)
    local may_be_pkw = each.channel == relations.PKW and not is_pzd(self, each)
    return proven[each] or relations.is_named(each) or may_be_pkw
  end)
end

--- What happened to each drive: array of {relation (its place in `relations`), events, left_out}.
function Channels:timelines()
  local places = {}
  for place, each in ipairs(self:relations()) do places[each] = place end
  return mapped(self:drives(), function(drive)
    local recorder = drive.recorder
    return {relation = places[drive.relation], events = recorder:told(), left_out = recorder.left_out}
  end)
end

-- The places of drives, as a set.
local function places_of(drives)
  local places = {}
  for _, each in ipairs(drives) do places[relations.place(each.relation)] = true end
  return places
end

-- Whether what may be PKW stands beside the words of a drive, and is not these.
local function is_beside(self, pkw, places) return places[relations.place(pkw)] and not is_pzd(self, pkw) end

--- Where PKW is as sure as the process data beside it, and no request was seen; when nothing more comes.
function Channels:unused()
  local places = places_of(self:drives())
  return filtered(self.without_request, function(each)
    return not self.asked[relations.place(each)] and is_beside(self, each, places)
  end)
end

--- What reads as a request beside the words of a drive, and has no response; when nothing more comes. An
-- array of {relation, job}.
function Channels:unanswered()
  local places = places_of(self:drives())
  return filtered(self.ignored, function(each) return is_beside(self, each.relation, places) end)
end

--- The same channels as ones that go on alone, to their end: no frame comes to them any more.
-- @param listener  as `new` takes it
function Channels:apart(listener)
  local made = flat(self)
  local function standing(list, apart) return mapped(list, function(each) return apart[each] end) end
  local relations_apart = entries(flat)
  local lines_apart = entries(function(line) return line:apart(relations_apart[line.relation], made) end)
  made.listener, made.asked = listener, flat(self.asked)
  made.all = standing(self.all, relations_apart)
  made.without_request = standing(self.without_request, relations_apart)
  made.ignored = mapped(self.ignored, function(each)
    return {relation = relations_apart[each.relation], job = each.job}
  end)
  made.lines, made.drives_ = standing(self.lines, lines_apart), standing(self.drives_, lines_apart)
  return made
end

-- Frames

--- The row of a frame and where its data begins, behind the frame id; nil of one that is not watched. First
-- what nearly all are: Ethernet with one VLAN tag at most.
function Channels:row_of(frame)
  local row, kind = self.rows[sub(frame, 7, 16)], sub(frame, 13, 14)
  if row or kind == ETHERTYPE then return row, 16 end
  if kind == TAG and sub(frame, 17, 18) == ETHERTYPE then
    return self.rows[sub(frame, 7, 12) .. sub(frame, 17, 20)], 20
  end
  local at = link.network(frame, link.PROFINET)
  local source = at and link.source(frame, at)
  return source and self.rows[source .. ETHERTYPE .. sub(frame, at + 1, at + 2)], at and at + 2
end

--- What an end says in a frame whose data begins at `at`: its words, and whether they are valid, as IOPS and
-- the status of the frame say, where they are known; nil where the capture cut them.
function M.said(each, frame, at)
  local side = each.side
  local first = at + side.offset
  if #frame < first + side.length then return nil end
  local valid = (not side.status or floor(byte(frame, at + side.status + 1) / 4) % 2 == 1)
    and (not side.iops or byte(frame, at + side.iops + 1) >= 0x80)
  return sub(frame, first + 1, first + side.length), valid
end

local said = M.said

-- The bytes that matter.
local function bytes_of(row, data, at)
  local bytes = {}
  for number, part in ipairs(row.parts) do
    bytes[number] = sub(data, at + part[1] + 1, at + part[1] + part[2])
  end
  return concat(bytes)
end

-- Keeps them, and what a frame looks like in which they are the same, as a pattern: one call tells nearly all
-- frames apart.
local function keep(row, frame, at)
  local pattern, stop = {"^"}, at + row.parts[1][1]
  row.bytes, row.first, row.at = bytes_of(row, frame, at), stop + 1, at
  for _, part in ipairs(row.parts) do
    local first = at + part[1]
    pattern[#pattern + 1] = rep(".", first - stop)
    stop = first + part[2]
    pattern[#pattern + 1] = gsub(sub(frame, first + 1, stop), "%W", "%%%0")
  end
  row.standing = concat(pattern)
end

-- Of how many frames around the one of this number each watched sender has one looked at.
local function sampled(self, number)
  local sample = SAMPLE
  while sample < RAREST and number >= sample * self.senders * OFTEN do sample = sample * 2 end
  return sample * self.senders
end

--- Whether a watched frame is looked at: it says something else than the one before it, or is the first of a
-- while. One that the capture cut says nothing.
function Channels:is_news(row, frame, at, number)
  if self.numbers then return #frame >= at + row.need end
  if number < row.due and row.at == at and find(frame, row.standing, row.first) then return false end
  if #frame < at + row.need then return false end
  if number >= row.due then
    local step = sampled(self, number)
    local period = floor(number / step)
    row.due = (period + 1) * step
    if period ~= row.period then return true end
  end
  return bytes_of(row, frame, at) ~= row.bytes
end

-- One end of a frame that is looked at; true where what it says has changed.
local function take(each, frame, at, number, time)
  local words, valid = said(each, frame, at)
  if words == nil then return false end
  local line = each.line
  local relation = line.relation
  line.start, relation.frame = line.start or time, relation.frame or number
  each.looks = each.looks + 1
  local cycle = each.looks
  if each.side.cycle_ns > 0 then cycle = (time - line.start) / each.side.cycle_ns end
  local moment = {frame = number, time = time, cycle = cycle}
  if line.passes and not each.sent then line:passes(moment) end
  if valid then
    line:take(each.sent, words, moment)
  elseif each.valid then
    line:lost(each.sent, moment)
  end
  local moved = words ~= each.words or valid ~= each.valid
  each.words, each.valid = words, valid
  return moved
end

-- The ends of a frame that is looked at. Lines that were looked at for long without a proof are given up.
local function take_all(self, ends, frame, at, number, time)
  local hopeless = false
  for place = 1, #ends do
    local each = ends[place]
    if take(each, frame, at, number, time) then self.moved[#self.moved + 1] = each end
    hopeless = hopeless or each.line:is_hopeless()
  end
  if hopeless then
    self.lines = filtered(self.lines, function(line) return not line:is_hopeless() end)
    watch(self)
  end
end

-- The cycle counter of a frame; nil where nobody knows where it is, or the capture cut it.
local function counter_of(side, frame, at)
  if not side.status or #frame <= at + side.status then return nil end
  local high, low = byte(frame, at + side.status - 1, at + side.status)
  return high * 256 + low
end

-- Whether a frame stands behind a later one of its sender: what it says is no news. Its cycle counter goes
-- back, too; of a channel without one the time alone tells it from a clock that was set.
local function is_late(self, row, side, frame, at, time)
  local key, counter = row.key .. link.receiver(frame, at - 2), counter_of(side, frame, at)
  local newest = self.newest[key] or {time = time, counter = counter}
  local back = newest.time - time
  local went_on = counter and newest.counter and (counter - newest.counter) % 0x10000 or 0
  local late = back > 0 and back < self.limits.disorder_ns and (went_on == 0 or went_on >= 0x8000)
  if not late then self.newest[key] = {time = time, counter = counter} end
  return late
end

-- Whether the frames of several sequences take turns: nothing is said of their relations any more.
local function are_mixed(self, row, ends, frame, at, number, time)
  local side, receiver = ends[1].side, link.receiver(frame, at - 2)
  local counter = counter_of(side, frame, at)
  if counter == nil or side.cycle_ns == 0 then return false end
  local found = row.sequences[receiver] or sequences.new(side.cycle_ns)
  row.sequences[receiver] = found
  local several = found:are_several(counter, time, sub(frame, at + 1), number)
  local doubt = found:are_doubtful()
  for place = 1, #ends do ends[place].doubt = doubt end
  if not several then return false end
  self.mixed[#self.mixed + 1] = {
    frame = number, device = ends[1].line.relation.device, sender = side.source, frame_id = side.frame_id,
  }
  for _, each in ipairs(ends) do
    each.line.relation.replaced = number
    if each.line.recorder then each.line:cut(found.since) end
    self.asked[relations.place(each.line.relation)] = true
  end
  leave_out_replaced(self)
  watch(self)
  return true
end

-- Tells each channel where there are fewer frames between two looks than it would have sent alone.
local function look(self, number, time)
  local before, place = self.looked, self.numbers and self.numbers[number] or number
  local passed, there = time - before.time, SLOWER * (place - before.place) + ALLOWED
  for _, line in ipairs(passed * self.busiest > there and self.lines or {}) do
    if passed * line.rate > there then line:skipped(before, number) end
  end
  self.looked = {frame = number, place = place, time = time}
end

--- Takes a watched frame that is looked at (`is_news`).
-- @param row, at as `row_of` gives them
-- @param number, time  of the frame; a time as times.lua has it
function Channels:frame(row, frame, at, number, time)
  self.moved = {}
  local before = row.bytes
  row.period = floor(number / sampled(self, number))
  keep(row, frame, at)
  if row.bytes ~= before then
    if row.follows then row.period, row.due = -1, 0 end
    if row.answered then row.answered.period, row.answered.due = -1, 0 end
  end
  local ends = M.ends_to(row, link.receiver(frame, at - 2))
  if ends[1] and is_late(self, row, ends[1].side, frame, at, time) then return end
  look(self, number, time)
  if ends[1] == nil then -- it is to a device whose Connect is not in the capture
    if not row.shared then
      self.strange[row.key] = true
      watch(self)
    end
  elseif not are_mixed(self, row, ends, frame, at, number, time) then
    take_all(self, ends, frame, at, number, time)
  end
end

-- Whether the data of a station says something else than the one before it, or is due, because values move in
-- all of them.
local function is_news_of_station(row, data)
  row.count = row.count + 1
  local bytes = bytes_of(row, data, 0)
  if bytes == row.said and row.count < row.due and #data >= row.need then return false end
  if bytes ~= row.said and row.answered then row.answered.due = 0 end
  row.due = row.count + (bytes == row.said and min(max(floor(row.count / DENSE), 1), RAREST) or 1)
  row.said = bytes
  return true
end

-- Where the next data of a master comes much later than any before it, exchanges are missing, or there were
-- none: nobody tells their cycle.
local function pause(row, number, time)
  local passed = row.newest and time - row.newest.time or 0
  if row.count > HABIT and row.longest > 0 and passed > PAUSE * row.longest then
    for _, each in ipairs(row) do
      if row.restarted then
        each.line:stopped({frame = row.newest.frame, time = row.newest.time, cycle = each.looks})
      else
        each.line:skipped(row.newest, number)
      end
    end
  else
    row.longest = max(row.longest, passed)
  end
  row.restarted = false
  row.newest = {frame = number, time = time}
end

--- Data of a station of PROFIBUS: one side of a relation at a time.
-- @param source  sender and receiver, two bytes
-- @param number, time  of the frame; a time as times.lua has it
function Channels:exchanged(source, data, number, time)
  self.moved = {}
  local row = self.stations[source]
  if row and row[1] and row[1].sent then pause(row, number, time) end
  if row and is_news_of_station(row, data) then take_all(self, row, data, 0, number, time) end
end

-- Whether a relation is proven, or will be by this request.
local function is_proven(line, job)
  return line.relation.certainty ~= LENGTHS or (job.answer and job.began and not job.settled)
end

--- What the last frame, of this number, began or responded to, as far as it is proven: array of {relation,
-- job, role}, a role being "write_request" or "read_response".
function Channels:touched(number)
  local found = {}
  for _, each in ipairs(self.moved) do
    local job = each.line.channel and each.line.channel:open_job()
    if job and is_proven(each.line, job) then
      local sight = job.answer
      if each.sent then sight = job.request end
      if sight and sight.at.frame == number then
        local role = each.sent and "write_request" or "read_response"
        found[#found + 1] = {relation = each.line.relation, job = job, role = role}
      end
    end
  end
  return found
end

--- What happened to drives in the last frame, of this number, as far as it is known to be one: array of
-- {relation, event (timeline.lua)}.
function Channels:happened(number)
  local found = {}
  for _, each in ipairs(self.moved) do
    local recorder = each.line.recorder
    local events = recorder and each.line:is_proven() and recorder.events or {}
    local first = #events
    while first > 0 and events[first].frame == number do first = first - 1 end
    for place = first + 1, #events do
      if recorder:is_told(events[place]) then
        found[#found + 1] = {relation = each.line.relation, event = events[place]}
      end
    end
  end
  return found
end

--- The ends of relations whose words are in a frame: array of {relation, side, sent}. Those that a later
-- Connect replaced count for the frames before it.
-- @param place  of the frame: source and receiver, MAC addresses, and frame_id
function Channels:ends_in(number, place)
  local found = {}
  for _, relation in ipairs(self.all) do
    if (relation.frame or number) <= number and (relation.replaced == nil or number <= relation.replaced) then
      for _, way in ipairs({"output", "input"}) do
        local side = relation[way]
        if side.source == place.source and side.frame_id == place.frame_id then
          found[#found + 1] = {relation = relation, side = side, sent = way == "output"}
        end
      end
    end
  end
  return M.ends_to(found, place.receiver)
end

function Channels:finish()
  for _, line in ipairs(self.lines) do line:finish(self.limits.unread_ns) end
end

return M
