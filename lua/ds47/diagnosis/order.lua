-- Diagnoses of the order of frames: too early, too late, twice, somebody else's (DS702, 704, 705, 722).
--
-- Looks at one closed job, with what pairing learnt of its neighbours. Nothing is decoded here.

local pairing = require("ds47.acyclic.pairing")
local rules = require("ds47.acyclic.judge")
local NIL_UUID = require("ds47.profinet.records").NIL_UUID
local uuid_text = require("ds47.spec.units").uuid_text

local put, sub = rules.put, string.sub

local M = {}

local STATUS_IN_USE = pairing.STATUS_IN_USE

-- The first Read request of a job that was seen.
local function first_read(job)
  for _, poll in ipairs(job.polls) do
    if poll.request then return poll.request end
  end
  return job.read_request
end

local function read_too_early(remarks, job)
  local answer = job.write_response
  if answer == nil or answer.status ~= 0 or job.hasty then return end
  local read, asked = first_read(job), job.record.request
  if read == nil or asked and read.time_ns < asked.time_ns then return end -- the times say another order
  if read.frame < answer.frame and read.time_ns <= answer.time_ns then
    put(remarks, "DS702", read.frame, {frame = read.frame, by = answer.frame})
  end
end

-- `write` is the frame of the Write that was refused between the two Reads.
local function put_again(remarks, case, frame, first, write)
  put(remarks, "DS704", frame, {case = case, frame = frame, first = first, write = write})
end

local function old_answer(remarks, job)
  local read = job.read_response
  if read == nil then return end
  if job.repeats ~= nil then
    local refused = job:write_request()
    local case = refused and "again_after_refusal" or "again_without_ar"
    put_again(remarks, case, read.frame, job.repeats, refused and refused.frame)
  end
  if job.reread_cause ~= "" and not (job.between and not job.between:write_told()) then
    put_again(remarks, job.reread_cause, job.rereads[1].response.frame, read.frame)
  end
end

-- Who the two are, as far as the capture shows it; a key of tables.diagnosis_words.
local function case_of(held, came)
  if held == nil then return "unseen_user" end
  if held.peer.controller ~= came.peer.controller then return "two_stations" end
  return held.record.ar == came.record.ar and "one_station" or "two_ars"
end

-- The AR of a request; nil on PROFIBUS, which has none.
local function ar_of(job) return job.record.ar ~= NIL_UUID and uuid_text(job.record.ar) or nil end

-- `held` is nil where the request of the other one was not seen, and `first` its frame.
local function clash(remarks, held, came, first, frame)
  put(remarks, "DS705", frame, {
    case = case_of(held, came),
    controller = came.peer.controller, ar = ar_of(came), frame = frame,
    other = held and held.peer.controller, other_ar = held and ar_of(held) or nil, first = first,
  })
end

-- A read that is displaced by another request. A change that is displaced says nothing: many programs never
-- read what a change is answered. Nor does the same question asked again: that is one user who does not wait.
local function displaced(remarks, job, asked)
  local later = not job.contested and job.superseding
  if not later or job.message.operation ~= "read" then return end
  local other = later:write_request()
  if other and sub(other.data, 2) ~= sub(asked.data, 2) then
    clash(remarks, job, later, asked.frame, other.frame)
  end
end

-- A Write that is turned away while another request is open.
local function turned_away(remarks, job, asked)
  local answer = job.write_response
  if answer and answer.status == STATUS_IN_USE then
    local held = job.rival and job.rival:write_request()
    if held and held.frame > asked.frame then
      return -- the two crossed: it was not open yet when this one was sent
    elseif held or job.alone then -- else what was open may be missing in the capture
      clash(remarks, job.rival, job, held and held.frame, asked.frame)
    end
  end
end

-- What was to be read, or was waited for; of a change many programs never read the answer.
local function connection_lost(remarks, job, asked)
  if job.missing or job.ended == nil or job.contested or job.read_response or job.write_refused then
    return
  end
  if job.message.operation == "read" or job.read_request or job.polls[1] or job.empty_reads[1] then
    put(remarks, "DS722", asked.frame, {frame = job.ended})
  end
end

--- Whether nothing can be said: answered at the first Read, which came after the Write's response.
function M.is_usual(job)
  local accepted, read = job.write_response, job.read_request
  return job.read_response and accepted and read and accepted.status == 0 and accepted.frame < read.frame
    and job.repeats == nil and not job.polls[1] and not job.rereads[1]
end

--- Adds what the order of its frames says of a closed job.
function M.add(remarks, job)
  read_too_early(remarks, job)
  old_answer(remarks, job)
  local asked = job:write_request()
  if asked then
    displaced(remarks, job, asked)
    turned_away(remarks, job, asked)
    connection_lost(remarks, job, asked)
  end
end

return M
