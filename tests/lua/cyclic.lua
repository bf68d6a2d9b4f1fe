-- Answers questions about the words of cyclic frames, one JSON object a line from stdin, one line of JSON
-- each to stdout; the other side is tests/python/test_cyclic.py. {"ask": "pkw", "hex", "answer", "layout",
-- "family"}, {"ask": "words", "stw1", "zsw1", "family", "lang"}, {"ask": "handshake", "steps"}

local here = arg[0]:match("^(.*)[/\\]") or "."
package.path = here .. "/../../lua/?.lua;" .. here .. "/?.lua;" .. package.path

local handshake = require("ds47.cyclic.handshake")
local json = require("ds47.support.json")
local read_json = require("json_reader")
local pkw = require("ds47.cyclic.pkw")
local pzd = require("ds47.cyclic.pzd")
local reader = require("ds47.support.bytes")
local words = require("ds47.spec.cyclic")

local function known(value)
  if value == json.null then return nil end
  return value
end

local function or_null(value)
  if value == nil then return json.null end
  return value
end

local ask = {}

function ask.pkw(question)
  local data, family = reader.unhex(question.hex), known(question.family)
  local item = pkw.decode(data, question.answer, question.layout, family)
  local value = item.float and json.float(item.value) or item.value
  local failure = json.null
  if item.error then
    failure = {code = or_null(item.error.code), text = or_null(words.error_text(item.error.code))}
  end
  return {
    ak = item.ak, meaning = words.meaning(item.ak, item.answer), spm = item.spm, pnu = or_null(item.pnu),
    subindex = item.subindex, layout = item.layout, pwe1 = item.pwe1, pwe2 = item.pwe2,
    value = or_null(value), error = failure,
    connector = or_null(item.connector), fits = pkw.fits_layout(item),
  }
end

function ask.words(question)
  local id, overlays = pzd.state(question.zsw1, known(question.stw1))
  return {
    state = id, overlays = json.array(overlays), text = words.state_text(id, overlays, question.lang),
    signed = pzd.signed(question.zsw1),
  }
end

local function data_of(sight)
  return sight and reader.hex(sight.data) or json.null
end

function ask.handshake(question)
  local jobs = json.array({})
  local channel = handshake.new(function(job)
    local cycles, duration = handshake.duration(job)
    jobs[#jobs + 1] = {
      request = data_of(job.request), start = job.request.at.cycle, state = job.state,
      reason = or_null(job.reason), answer = data_of(job.answer), settled = job.settled,
      updates = job.updates, newest = data_of(job.newest), halves = or_null(job.halves),
      odd = job.odd and job.odd.at.frame or json.null, late = or_null(job.late),
      ["end"] = job.ended and job.ended.cycle or json.null,
      cycles = or_null(cycles), duration = or_null(duration), heard = job.heard,
      hole = job.hole and json.array({job.hole.first, job.hole.last, job.hole.what}) or json.null,
    }
  end)
  for _, step in ipairs(question.steps) do
    local at = {frame = step.cycle, time = step.cycle * 2000000, cycle = step.cycle}
    if step.lost then
      channel:lost(at, known(step.side))
    else
      if step.out then channel:sent(reader.unhex(step.out), at) end
      if step.skipped then channel:skipped(step.skipped[1], step.skipped[2]) end
      if step["in"] then channel:answered(reader.unhex(step["in"]), at) end
    end
  end
  channel:finish()
  return {jobs = jobs}
end

for line in io.lines() do
  local question = read_json(line)
  io.write(json.encode(ask[question.ask](question)), "\n")
end
