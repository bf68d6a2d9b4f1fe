--- What the PLC saw of a job: the outputs of WRREC and RDREC as a program would see them (Python:
-- ds47.report.plc). Derived from the transaction alone: every call of a block with DONE or VALID, ERROR,
-- STATUS and LEN. The words are those of tables.report_words.

local words = require("ds47.report_words")

local byte, format = string.byte, string.format
local say = words.say

local M = {}

M.NOT_READY = 0xDE80B500 -- the STATUS of a poll: state conflict on a Read
local REFUSED = 0x80 -- the bit of byte 1 of a response that says that something was refused

local function write(item)
  local frames = item.frames
  if not frames.write_request then
    return { block = "WRREC", outcome = "missing" }
  elseif item.write_status then
    local outcome = item.write_status == 0 and "done" or "error"
    return { block = "WRREC", outcome = outcome, status = item.write_status }
  elseif frames.write_response then
    return { block = "WRREC", outcome = "fault" }
  elseif frames.read_response or #(frames.polls or {}) > 0 then
    return { block = "WRREC", outcome = "assumed" }
  end
  return { block = "WRREC", outcome = "busy" }
end

local function last_read(item, polls, length)
  local frames = item.frames
  if frames.read_response and item.read_status and item.read_status ~= 0 then
    return { block = "RDREC", outcome = "error", status = item.read_status }
  elseif frames.read_response then
    return { block = "RDREC", outcome = "done", status = 0, length = length }
  elseif frames.read_request then
    return { block = "RDREC", outcome = "busy" }
  end
  return { block = "RDREC", outcome = polls > 0 and "given_up" or "never" }
end

--- The calls of a job in their order: array of {block, outcome, status, times, length}, as in Python.
function M.saw(item)
  local polls, rereads = #(item.frames.polls or {}), #(item.frames.rereads or {})
  local length = item.response and #item.response or 0
  local calls = { write(item) }
  if polls > 0 then
    calls[2] = { block = "RDREC", outcome = "polled", status = M.NOT_READY, times = polls }
  end
  calls[#calls + 1] = last_read(item, polls, length)
  if rereads > 0 then
    calls[#calls + 1] = { block = "RDREC", outcome = "again", status = 0, times = rereads, length = length }
  end
  return calls
end

--- What STATUS does not tell: that the record refuses, or belongs to another request. Nil where it does not.
function M.remark(item, lang)
  local response = item.response
  if response == nil or (item.read_status or 0) ~= 0 then
    return nil
  elseif item.state == "mismatch" then
    return say(lang, "plc_other")
  end
  local id = byte(response, 2) or 0
  return id >= REFUSED and say(lang, "plc_refused", { id = format("%02X", id) }) or nil
end

--- `WRREC DONE, STATUS 00000000; RDREC 3 x ERROR, STATUS DE80B500; RDREC VALID ...`
function M.text(item, lang)
  local parts = {}
  for number, call in ipairs(M.saw(item)) do
    local kind = call.block == "WRREC" and "write" or "read"
    parts[number] = say(lang, "plc_" .. kind .. "_" .. call.outcome, {
      n = call.times or 1, status = format("%08X", call.status or 0), length = call.length,
    })
  end
  local text = words.joined(lang, parts, "; ", "；")
  local more = M.remark(item, lang)
  if more then
    text = text .. (lang == "zh" and "，" or " - ") .. more
  end
  return text
end

--- The same with `PLC: ` in front.
function M.line(item, lang)
  return say(lang, "plc_line", { calls = M.text(item, lang) })
end

return M
