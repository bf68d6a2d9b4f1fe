--- What the PLC saw of a transaction: the outputs of WRREC and RDREC as a program would see them (Python:
-- ds47.report.plc). Derived from the transaction, from findings about calls that it does not show, and from
-- what comes after it on its channel: every call of a block with DONE or VALID, ERROR, STATUS and LEN. The
-- words are those of tables.report_words.

local all_frames = require("ds47.acyclic.transactions").all_frames
local arrays = require("ds47.support.arrays")
local family_fits = require("ds47.profidrive.parameter").family_fits
local status_hex = require("ds47.spec.statuses").status_hex
local tables = require("ds47.spec.tables")
local times = require("ds47.support.times")
local words = require("ds47.report.formatting")

local byte, concat, format = string.byte, table.concat, string.format
local say = words.say

local M = {}

local NONE = {}
local NOT_READY = 0xDE80B500 -- the STATUS of a poll: state conflict on a Read
local NEGATIVE = 0x80 -- the bit of byte 1 of a response that says that it is a negative one

-- Rules about a call that brought no record, and what the call ended with.
local LEFT_OUT = {
  DS101 = "unseen", DS105 = "unseen", DS104 = "fault", DS108 = "bare", DS201 = "error", DS207 = "empty",
}
local IN_PART, CUT = "DS105", "DS106"
local NOTHING = { DS206 = true, DS808 = true } -- about a Read for which no request was open
-- The bytes of a request that its response mirrors, but for byte 2, from 1.
local HEADER = { { "mirror_reference", 1 }, { "mirror_axis", 3 }, { "mirror_count", 4 } }

-- When the last thing that is known of a transaction happened; nil where there is none.
local function end_of(transactions)
  local last
  for _, each in ipairs(transactions) do
    local stop = times.later(each.start_ns, each.duration_ns or 0)
    last = (last == nil or last < stop) and stop or last
  end
  return last
end

local function channel_of(item)
  return concat({
    item.controller, item.device, item.ar or "", item.api and words.integer(item.api) or "",
    item.slot or "", item.subslot or "", item.index,
  }, "\0")
end

-- How long transactions without a response were waited for, by their id: "ends" where nothing comes after it
-- on its channel, "busy" where the capture is known to go on for the time after which a request is given up
-- and nothing more came on the channel, else "unseen".
local function waits_of(transactions)
  local expiry, last = tables.limits.transaction_expiry_ns, end_of(transactions)
  local after, waits = {}, {}
  for place = #transactions, 1, -1 do
    local item = transactions[place]
    local channel = channel_of(item)
    local following = after[channel]
    after[channel] = item.start_ns
    if item.state == "unanswered" or item.state == "incomplete" then
      local quiet = item.state == "unanswered" and (following or last) - item.start_ns > expiry
      waits[item.id] = quiet and "busy" or following and "unseen" or "ends"
    end
  end
  return waits
end

-- The frames of a transaction, and of the findings about its calls.
local function frames_of(item, found)
  local list = all_frames(item.frames)
  for _, each in ipairs(found or NONE) do list[#list + 1] = each.frame end
  return list
end

local function newest_of(item, found)
  local newest = 0
  for _, frame in ipairs(frames_of(item, found)) do newest = math.max(newest, frame) end
  return newest
end

local function sort(entries)
  table.sort(entries, function(a, b) return a[1] < b[1] end)
end

-- Whether no Read brought a record, and none was given up.
local function is_unread(item) return not item.frames.read_request and not item.frames.read_response end

-- Where Reads came between the accepted Writes, by channel: entries {frame, id of the transaction} in the
-- order of their frames. Whose they are is not always known. Channels on which nobody asks have none.
local function channels_of(transactions, calls)
  local reads, accepted = {}, {}
  for _, item in ipairs(transactions) do
    if is_unread(item) then
      local channel = channel_of(item)
      reads[channel], accepted[channel] = {}, {}
    end
  end
  for _, item in ipairs(next(reads) and transactions or NONE) do
    local channel, frames = channel_of(item), item.frames
    local entries, asked = reads[channel], frames.write_request
    for _, frame in ipairs(entries and frames_of(item, calls[item.id]) or NONE) do
      if frame ~= asked and frame ~= frames.write_response then entries[#entries + 1] = { frame, item.id } end
    end
    if entries and asked and item.write_status == 0 then
      table.insert(accepted[channel], { asked, item.id })
    end
  end
  for channel, entries in pairs(reads) do
    sort(entries)
    sort(accepted[channel])
  end
  return reads, accepted
end

-- The first frame after another one that does not belong to the transaction `but`; huge where there is none.
local function after(entries, frame, but)
  local place = arrays.last_until(entries, frame) + 1
  while entries[place] and entries[place][2] == but do place = place + 1 end
  return entries[place] and entries[place][1] or math.huge
end

-- Says "unseen" of those behind whose last frame a Read came that may be of their channel.
local function say_followed(transactions, calls, loose, waits)
  local newest, stray = {}, 0
  for _, item in ipairs(transactions) do
    local channel = channel_of(item)
    newest[channel] = math.max(newest[channel] or 0, newest_of(item))
  end
  for _, entry in ipairs(loose) do stray = math.max(stray, entry[1]) end
  for _, item in ipairs(transactions) do
    local own = item.state == "unanswered" and newest_of(item, calls[item.id])
    if own and math.max(stray, newest[channel_of(item)]) > own then waits[item.id] = "unseen" end
  end
end

-- Says "beside" of those behind whose Write, before the next accepted one, a Read came that is told of
-- another transaction, or of none (`loose`): for which of them the PLC started RDREC is not known then.
local function say_beside(transactions, calls, loose, waits)
  local reads, accepted = channels_of(transactions, calls)
  sort(loose)
  for _, item in ipairs(transactions) do
    local begin = is_unread(item) and item.frames.write_request
    if begin then
      local channel = channel_of(item)
      local read = math.min(after(loose, begin), after(reads[channel], begin, item.id))
      if read < after(accepted[channel], begin) then waits[item.id] = "beside" end
    end
  end
end

local Witness = {}
Witness.__index = Witness

--- Tells what the PLC saw of each transaction of a result {transactions, findings}.
function M.witness(result)
  local calls, lengths, loose, cut = {}, {}, {}, {}
  for _, each in ipairs(result.findings) do
    local owner = each.transaction
    if not owner and (LEFT_OUT[each.rule] or NOTHING[each.rule]) then
      loose[#loose + 1] = { each.frame, 0 }
    elseif LEFT_OUT[each.rule] and owner then
      arrays.push(calls, owner, each)
    elseif each.rule == CUT and each.args.completed then
      lengths[each.args.completed], cut[each.args.completed] = each.args.length, each.args.length == nil
    end
  end
  -- no other channel has blocks that are called for it
  local records = arrays.filtered(result.transactions, function(item) return item.channel == "ds47" end)
  local waits = waits_of(records)
  say_followed(records, calls, loose, waits)
  say_beside(records, calls, loose, waits)
  return setmetatable({
    calls = calls, -- transaction -> the findings about calls that brought no record
    lengths = lengths, -- frame of a Read response -> bytes of its record, which the capture cut
    cut = cut, -- frame of a response that it cut before that length is told, or the STATUS of a Write -> true
    waits = waits,
  }, Witness)
end

--- The same of one transaction while the capture goes on: what its job has learnt so far.
function M.witness_of(item, job)
  local findings = {}
  local function add(rule, frame, args)
    findings[#findings + 1] = { rule = rule, frame = frame, transaction = item.id, args = args }
  end
  for _, call in ipairs(job.calls) do add(call.rule, call.frame) end
  for _, half in ipairs(job.empty_reads) do add("DS207", half.frame) end
  for _, read in ipairs(job:too_short()) do
    add("DS201", read.response.frame, { status = status_hex(read.response.status) })
  end
  local read = job.read_response
  if read and read.cut then add(CUT, read.frame, { completed = read.frame, length = read.stated }) end
  local answer = job.write_response
  if answer and answer.cut then add(CUT, answer.frame, { completed = answer.frame }) end
  return M.witness({ transactions = { item }, findings = findings })
end

-- The Reads that brought no record and are none of the frames of a transaction; and whether a part of a
-- response is there: then it is not that none came.
local function left_out_of(item, found)
  local frames, list = item.frames, {}
  local waits, in_part = frames.read_request and not frames.read_response, false
  for _, each in ipairs(found) do
    in_part = in_part or each.rule == IN_PART
    waits = waits and each.frame ~= frames.read_request -- nothing came for it: the part is another's
  end
  for _, each in ipairs(found) do
    local frame = each.frame
    if waits and each.rule == IN_PART then
      waits = false
    elseif frame ~= frames.write_request and frame ~= frames.write_response and frame ~= frames.read_request
      and frame ~= frames.read_response then
      local status = each.rule == "DS201" and tonumber(each.args.status, 16) or nil
      list[#list + 1] = { frame = frame, outcome = LEFT_OUT[each.rule], status = status }
    end
  end
  return list, in_part
end

-- Polls, Reads that brought nothing, and the one without a response that is a frame of the transaction, by
-- their frames; of the last one alone it is told that the capture ended.
local function in_order(item, left_out, wait)
  local frames, all, told = item.frames, {}, {}
  local function add(frame, outcome, status)
    all[#all + 1] = { frame = frame, outcome = outcome, status = status, order = #all }
  end
  for _, each in ipairs(left_out) do told[each.frame] = true end
  for _, poll in ipairs(frames.polls or NONE) do
    if not told[poll.response] then add(poll.response or 0, "polled", NOT_READY) end
  end
  for _, each in ipairs(left_out) do add(each.frame, each.outcome, each.status) end
  local waits = frames.read_request and not frames.read_response
  if waits then add(frames.read_request, item.station and "nothing" or "unseen") end
  table.sort(all, function(a, b)
    return a.frame < b.frame or a.frame == b.frame and a.order < b.order
  end)
  if waits and wait == "ends" and all[#all].outcome == "unseen" then all[#all] = { outcome = "ends" } end
  return all
end

-- The Reads before the one that was answered: polls, and those that brought nothing.
local function before(item, left_out, wait)
  local calls = {}
  for _, each in ipairs(in_order(item, left_out, wait)) do
    local newest = calls[#calls]
    if newest and newest.outcome == each.outcome then
      newest.times = newest.times + 1
    else
      calls[#calls + 1] = { block = "RDREC", outcome = each.outcome, status = each.status, times = 1 }
    end
  end
  return calls
end

local function is_bare(item, found)
  return arrays.any(found, function(each)
    return each.rule == "DS108" and each.frame == item.frames.write_response
  end)
end

local function write(item, found, left_out, wait)
  local frames = item.frames
  local outcome = wait == "beside" and "unseen" or wait
  if not frames.write_request then
    outcome = "missing"
  elseif item.write_status then
    outcome = item.write_status == 0 and "done" or "error"
  elseif frames.write_response then
    outcome = is_bare(item, found) and "bare" or item.station and "sap" or "fault"
  elseif #left_out > 0 or frames.read_request or frames.read_response or #(frames.polls or {}) > 0 then
    outcome = "unseen"
  end
  return { block = "WRREC", outcome = outcome, status = item.write_status }
end

-- The Read that a transaction ended with; nil where all are told already.
local function last_read(item, left_out, length, wait)
  local frames = item.frames
  if frames.read_response and item.read_status and item.read_status ~= 0 then
    return { block = "RDREC", outcome = "error", status = item.read_status }
  elseif frames.read_response then
    local captured = item.response and #item.response or 0
    local outcome = captured < length and "cut" or "done"
    return { block = "RDREC", outcome = outcome, status = 0, length = length, captured = captured }
  elseif frames.read_request then
    return nil
  elseif item.state == "superseded" then
    return { block = "RDREC", outcome = "superseded" }
  elseif item.state == "incomplete" and not item.station then
    return #left_out == 0 and { block = "RDREC", outcome = "missing" } or nil
  elseif #left_out == 0 and wait ~= "beside" then
    local unread = #(frames.polls or {}) > 0 and "given_up" or "never"
    return { block = "RDREC", outcome = item.station and "without" or unread }
  end
  return nil
end

--- The calls of a transaction in their order: array of {block, outcome, status, times, length, captured}, as
-- in Python.
function Witness:saw(item)
  local captured = item.response and #item.response or 0
  local length = self.lengths[item.frames.read_response or 0] or captured
  if item.ar == nil and item.station == nil and not item.frames.write_request then
    -- a Read without an AR, which no block makes
    return { { block = "RDREC", outcome = "implicit", status = item.read_status, length = length } }
  end
  local found = self.calls[item.id] or NONE
  local left_out, in_part = left_out_of(item, found)
  local wait = not in_part and self.waits[item.id] or "unseen"
  local calls = { write(item, found, left_out, wait) }
  if item.write_status == nil and self.cut[item.frames.write_response or 0] then calls[1].outcome = "cut" end
  arrays.append(calls, before(item, left_out, wait))
  calls[#calls + 1] = last_read(item, left_out, length, wait)
  local rereads = #(item.frames.rereads or {})
  if rereads > 0 then
    calls[#calls + 1] = { block = "RDREC", outcome = "again", status = 0, times = rereads, length = length }
  end
  return calls
end

-- What the response of a mismatch has otherwise than the request: reference, DO, count, ID.
local function not_mirrored(item, lang)
  local request, response, parts = item.request or "", item.response or "", {}
  for _, row in ipairs(HEADER) do
    local sent, got = byte(request, row[2]), byte(response, row[2])
    if sent and got and sent ~= got then parts[#parts + 1] = say(lang, row[1]) end
  end
  local sent, got = byte(request, 2), byte(response, 2)
  if sent and got and not family_fits(sent, got) then parts[#parts + 1] = say(lang, "mirror_id") end
  return words.joined(lang, #parts > 0 and parts or { say(lang, "mirror_count") })
end

--- What STATUS does not tell: that the record does not mirror the request, or is a negative response. Nil
-- where it is neither.
function M.remark(item, lang)
  local response = item.response
  if response == nil or (item.read_status or 0) ~= 0 then return nil end
  if item.state == "mismatch" then return say(lang, "plc_other", { what = not_mirrored(item, lang) }) end
  local id = byte(response, 2) or 0
  if id < NEGATIVE then return nil end
  local key = item.state == "partial" and "plc_negative_partial" or "plc_negative"
  return say(lang, key, { id = format("%02X", id) })
end

--- `WRREC DONE, STATUS 00000000; RDREC 3 x ERROR, STATUS DE80B500; RDREC VALID ...`
function Witness:text(item, lang)
  local parts = {}
  for number, call in ipairs(self:saw(item)) do
    local kind = call.block == "WRREC" and "write" or "read"
    parts[number] = say(lang, "plc_" .. kind .. "_" .. call.outcome, {
      n = call.times or 1, status = format("%08X", call.status or 0), length = call.length,
      captured = call.captured,
    })
  end
  local text = words.joined(lang, parts, "; ", "；")
  local more = M.remark(item, lang)
  if more then text = text .. (lang == "zh" and "，" or " - ") .. more end
  return text
end

return M
