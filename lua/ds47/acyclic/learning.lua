-- Which responses teach the dictionary, and when it is asked about the parameters of a job (Python:
-- ds47.acyclic.learning, where it is explained). A description counts from its response on.

local drive_objects = require("ds47.profidrive.drive_objects")
local has_one_of = require("ds47.profidrive.parameter").has_one_of
local rules = require("ds47.acyclic.judge")
local tables = require("ds47.spec.tables")

local M = {}

local VALUE, DESCRIPTION = tables.layouts.ADDRESS_VALUE, tables.layouts.ADDRESS_DESCRIPTION
local READ = { [0x01] = true, [0x81] = true } -- response ids of a read, all of it or a part
-- Flaws of a response that is not decoded to its end: unknown format, bytes left over, bytes missing.
local BROKEN = { DS309 = true, DS313 = true, DS315 = true }

local function has_description(addresses)
  for number = 1, #addresses do
    if addresses[number].attribute == DESCRIPTION then return true end
  end
  return false
end

-- Whether the descriptions in a response count: it is the one to its request, and whole.
local function is_believed(job)
  local response, half = job.response, job.read_response
  if response == nil or half == nil then return false end
  local whole = not half.missing and (half.status or 0) == 0 and not has_one_of(response.flaws, BROKEN)
  return whole and READ[response.response_id] == true and not rules.is_mismatch(job)
end

--- Notes on a job what the drive has said so far about its parameters: `job.meanings`, by their number; nil
-- if it has said nothing. Called with the request, with the response, and when a job is over without one.
-- @param last  what was said behind this frame does not count; nil: all does
function M.ask(dictionary, job, last)
  if dictionary.is_empty or job.message == nil then return end
  local access, peer, found = drive_objects.access(job), job.peer, {}
  for number, address in ipairs(job.message.addresses) do
    if address.attribute == VALUE then
      local meaning, is_said = dictionary:meaning(access, address.pnu, peer.vendor_id, last, peer.family)
      found[number] = is_said and meaning or nil
    end
  end
  job.meanings = next(found) and found or nil
end

--- A job has its response: learns its descriptions, then looks its parameters up.
-- If its AR proves itself late, descriptions from behind its response are known already.
function M.answered(dictionary, job)
  local request = job.message
  if request and request.operation == "read" and has_description(request.addresses) and is_believed(job) then
    local access = drive_objects.access(job)
    for number, address in ipairs(request.addresses) do
      local block = job.response.blocks[number]
      if block and address.attribute == DESCRIPTION and address.element_count <= 1 and not block.error then
        dictionary:learn(access, address.pnu, address.subindex, block.format_name, block.values,
          job.read_response.frame)
      end
    end
  end
  M.ask(dictionary, job, job.read_response and job.read_response.frame)
end

return M
