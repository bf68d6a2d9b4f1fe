-- How bytes and numbers that are no values of a parameter are written: AR UUIDs.

local entries = require("ds47.support.later").entries

local byte, format = string.byte, string.format

local M = {}

-- A capture has few of them; one made to have many must not fill memory.
local uuids = entries(function(raw)
  return format("%02x%02x%02x%02x-%02x%02x-%02x%02x-%02x%02x-%02x%02x%02x%02x%02x%02x", byte(raw, 1, 16))
end, 1024)

--- An AR UUID, 16 bytes, as text.
function M.uuid_text(raw) return uuids[raw] end

return M
