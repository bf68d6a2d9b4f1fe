-- Read and write of records: the data of MS1, and of MS2, which has the same (docs/profibus.md 4). One
-- message at a time; the record inside (DS47) is in profidrive/.

local tables = require("ds47.spec.tables")

local M = {READ = 0x5E, WRITE = 0x5F, MOST_DATA = 240}

local HEAD = 4

local function flaw(kind, offset, args) return {{kind = kind, offset = offset, args = args}} end

-- What does not fit; some manuals print a length that is not that of the data.
local function flaws_of(data, length, there, carries)
  if not length then return flaw("data", #data, {have = #data, want = HEAD}) end
  if carries and length ~= there then return flaw("record_length", 3, {says = length, there = there}) end
  if not carries and there > 0 then return flaw("more", HEAD, {n = there}) end
  return {}
end

local function refusal(data)
  local code, decode, first, second = data:byte(1, 4)
  local found = {
    kind = "refusal", code = code, error_decode = decode, error_code_1 = first, error_code_2 = second,
    name = tables.profibus.refusals[code].id, data = data:sub(HEAD + 1), flaws = {},
  }
  if #data < HEAD then
    found.flaws = flaw("data", #data, {have = #data, want = HEAD})
  else
    found.status = ((code * 0x100 + decode) * 0x100 + first) * 0x100 + second
    if #data > HEAD then found.flaws = flaw("more", HEAD, {n = #data - HEAD}) end
  end
  found.not_ready = found.name == "read" and decode == tables.profibus.not_ready_decode
    and first == tables.profibus.not_ready_code_1
  return found
end

--- A message from the data of its frame, whatever that is.
-- @param data string, the data unit, SAPs not included
-- @param request boolean: the master sent it
-- @return table {kind ("request", "poll", "answer", "taken", "refusal"), code, name (the id of its function),
-- slot, index, length (as it says), data (what is there of the record), error_decode, error_code_1,
-- error_code_2, status (as PROFINET has it), not_ready, flaws}
function M.decode(data, request)
  local code, slot, index, length = data:byte(1, 4)
  if not code then return {kind = request and "poll" or "taken", data = "", not_ready = false, flaws = {}} end
  if not request and tables.profibus.refusals[code] then return refusal(data) end
  local row = tables.profibus.functions[code]
  local found = {
    kind = request and "request" or "answer", code = code, name = row and row.id, not_ready = false,
    flaws = {},
  }
  if code ~= M.READ and code ~= M.WRITE then
    found.data = data:sub(2)
    return found
  end
  found.slot, found.index, found.length = slot, index, length
  found.data = length and data:sub(HEAD + 1, HEAD + length) or ""
  local carries = (code == M.WRITE) == request
  found.flaws = flaws_of(data, length, #data - HEAD, carries)
  return found
end

return M
