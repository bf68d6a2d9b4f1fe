-- Which response IDs belong to which request ID, and whether a response has the kind of a request.
--
-- Only the header says that (docs/protocol.md A.1 to A.3). What a response says about its request beyond that
-- is judged in acyclic/judge.lua.

local tables = require("ds47.spec.tables")

local M = {}

--- Response id of a device that does not know the request id.
M.NOT_SUPPORTED = 0x80

local NOT_SUPPORTED, MESSAGE_SIZE = M.NOT_SUPPORTED, tables.layouts.MESSAGE_SIZE

--- Whether a response id belongs to a request id (docs/protocol.md A.3).
function M.family_fits(request_id, response_id)
  local known = tables.request_ids[request_id]
  if response_id == NOT_SUPPORTED then return true end
  if known == nil then return response_id % 128 == request_id % 128 end
  return response_id == known.positive or response_id == known.negative
end

--- Whether a response is of the family of a request, of its axis, and has as many parameters.
-- nil where either lacks a part of its header. What stands behind the id 0x80 is not documented, and its
-- number says nothing.
function M.kind_fits(request, data)
  local asked, count = request.request_id, request.parameter_count
  if asked == nil or count == nil or #data < MESSAGE_SIZE then return nil end
  local _, id, axis, got = data:byte(1, MESSAGE_SIZE)
  return M.family_fits(asked, id) and axis == request.axis and (got == count or id == NOT_SUPPORTED)
end

return M
