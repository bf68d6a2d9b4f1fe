-- Judgement: a transaction of PKW to findings DS5xx (spec/rules.toml has the catalogue). What is wrong with
-- one request and its response.
--
-- The tables are those of one maker; of drives of others only what the profile says is said (docs/cyclic.md
-- 5). A remark is a finding in the making: {rule, frame, args}.

local flat = require("ds47.support.flat").copy
local handshake = require("ds47.cyclic.handshake")
local json = require("ds47.support.json")
local pkw = require("ds47.cyclic.pkw")
local relations = require("ds47.cyclic.relations")
local tables = require("ds47.spec.tables")
local transactions = require("ds47.cyclic.transactions")

local M = {}

local function put(remarks, rule, frame, args)
  remarks[#remarks + 1] = {rule = rule, frame = frame, args = args}
end

-- The arguments that name the parameter, and others.
local function which(asked, family, more)
  local args = {pnu = asked.pnu, subindex = asked.subindex, family = family}
  for name, value in pairs(more or {}) do args[name] = value end
  return args
end

local function of_request(remarks, job, asked, family)
  local row = tables.pkw.requests[asked.ak]
  if job.halves then put(remarks, "DS506", job.halves, which(asked, family)) end
  if row.access == "change" and row.width == 16 and asked.pwe1 ~= 0 then
    put(remarks, "DS513", job.request.at.frame, which(asked, family, {pwe = asked.pwe1}))
  end
end

local function of_response(remarks, job, asked, family, told, vendor_id)
  local frame = job.answer.at.frame
  if told.ak == pkw.ERROR then
    put(remarks, "DS501", frame, which(asked, family, {code = told.error.code, vendor_id = vendor_id}))
  elseif told.ak == pkw.NO_RIGHTS then
    put(remarks, "DS502", frame, which(asked, family))
  end
end

-- That of a request whose response did not come.
local function of_end(remarks, job, asked, family)
  local ended, hole = job.ended, job.hole
  if job.state == "incomplete" then
    put(remarks, "DS110", job.request.at.frame, flat(hole))
  elseif job.state == "mismatch" then
    local args = {request = pkw.digits(job.request.data), response = pkw.digits(job.odd.data)}
    put(remarks, "DS505", job.odd.at.frame, args)
  elseif not job.heard then
    return -- the capture has nothing of the drive
  elseif job.state == "superseded" and ended then
    local args = {request = job.request.at.frame, by = ended.frame}
    put(remarks, "DS504", ended.frame, which(asked, family, args))
  elseif job.reason == "withdrawn" and ended then
    local stood_ns = ended.time - job.request.at.time
    if stood_ns >= 0 then -- else somebody set the clock meanwhile: how long it stood is not known
      put(remarks, "DS503", ended.frame, which(asked, family, {milliseconds = json.float(stood_ns / 1e6)}))
    end
  end
end

--- What reads as a request has no response: nothing proves that it is one, or it stands to the end. An array
-- of remarks.
function M.unanswered(relation, job, layout)
  local remarks, asked = {}, transactions.decoded(job, layout)
  local stood_ns = handshake.last_of(job).time - job.request.at.time
  if stood_ns >= 0 then -- else somebody set the clock meanwhile
    local args = which(asked, relations.drives(relation), {milliseconds = json.float(stood_ns / 1e6)})
    put(remarks, "DS514", job.request.at.frame, args)
  end
  return remarks
end

--- What is wrong with a transaction that is over, and as far as it is certain with one that is not: an
-- array of remarks.
function M.remarks(relation, job, layout)
  local remarks = {}
  local asked, told = transactions.decoded(job, layout)
  local family = relations.drives(relation)
  of_request(remarks, job, asked, family)
  if told then
    of_response(remarks, job, asked, family, told, relation.vendor_id)
  else
    of_end(remarks, job, asked, family)
  end
  return remarks
end

return M
