-- Diagnoses of lengths: LEN, MLEN and the longest message of the device (DS711, 712, 713).
--
-- What fits is computed from the request alone: a value takes one byte at least, more where its format is
-- known. `size_of` gives the bytes of one value of a PNU, nil where they are not known; `read` does so only
-- as the capture shows it: for what there is room, no list says of this drive.

local arrays = require("ds47.support.arrays")
local later = require("ds47.support.later").module
local STATUS_SHORT = require("ds47.acyclic.pairing").STATUS_SHORT
local parameter = require("ds47.profidrive.parameter")
local rules = require("ds47.acyclic.judge")
local suggest = later("ds47.diagnosis.suggest") -- only here: most captures need no correction
local tables = require("ds47.spec.tables")

local byte, char, floor, max, min = string.byte, string.char, math.floor, math.max, math.min

local any, first, put = arrays.any, arrays.first, rules.put

local M = {}

local VALUE = tables.layouts.ADDRESS_VALUE
local HEADER, ADDRESS = tables.layouts.MESSAGE_SIZE, tables.layouts.ADDRESS_SIZE
local COUNT_AT = 4 -- place of the number of parameters, from 1
local BLOCK_HEADER = 2 -- format and number of values
local BLOCK = 4 -- the shortest value block: format, number of values, one value with its pad

-- The flaw of a message that ends too soon, nil for any other.
local function missing(flaws)
  return first(flaws, function(flaw) return flaw.rule == "DS315" end)
end

-- Whether the message ends among the values of a block.
local function is_cut(block)
  return #(block.error and block.error.words or block.values) < block.value_count
end

-- The least length of a request that ends too soon: what is cut, and the shortest form of what follows.
local function need_of(message, have, more)
  local count = message.parameter_count
  if count == nil or count == 0 then count = 1 end
  local blocks = message.blocks
  local row = tables.request_ids[message.request_id]
  local last, left = blocks[#blocks], row and row.body == "blocks" and count - #blocks or 0
  local finish = have + more - (last and is_cut(last) and 0 or BLOCK_HEADER)
  finish = max(finish, HEADER + ADDRESS * count)
  return left == 0 and finish or finish + finish % 2 + BLOCK * left
end

-- Of how many parameters the bytes are a whole request, if byte 3 were wrong; nil for none. Of none where a
-- value would begin with what is an address: its attribute is a format, too.
local function fitting_count(message, data)
  for count = 1, min(message.parameter_count or 0, floor(#data / ADDRESS) + 1) - 1 do
    local other = parameter.decode_request(data:sub(1, COUNT_AT - 1) .. char(count) .. data:sub(COUNT_AT + 1))
    if byte(data, HEADER + ADDRESS * count + 1) ~= VALUE and other.shaped and not other.flaws[1] then
      return count
    end
  end
  return nil
end

--- LEN of WRREC is too small: the record is whole, the request in it is not.
-- A drive that refused a value for its type has read it: then the format is wrong, and not the length.
-- @param refused  the parameters that were refused, by refusal.lua
function M.request_too_short(remarks, job, refused)
  local half, message = job:write_request(), job.message
  if half == nil or half.missing then return end
  if any(refused, function(each) return tables.known.type_errors[each.code] end) then return end
  local flaw = missing(message.flaws)
  if flaw then
    local have = #half.data
    local fits = fitting_count(message, half.data)
    local count = message.parameter_count
    put(remarks, "DS711", half.frame, {
      have = have, need = need_of(message, have, flaw.args.need), count = count and count > 0 and count or 1,
      fits = fits, case = fits and "length_or_count" or "length_short",
    }, flaw.offset)
  end
end

local function least_block(address, size_of)
  if address.attribute ~= VALUE then return BLOCK end
  local size = (size_of(address.pnu) or 1) * max(1, address.element_count)
  return 2 + size + size % 2
end

local function value_size(block)
  local codec = parameter.codec(block.meaning or block.format)
  return codec and codec.size
end

-- Bytes of one value by the response itself, else as it was read before.
local function shown_by(request, blocks, read)
  local own = {}
  for number, address in ipairs(request.addresses) do
    local block = blocks[number]
    local size = block and not block.error and address.attribute == VALUE and value_size(block) or 0
    if size > 0 then own[address.pnu] = size end
  end
  return function(pnu) return own[pnu] or read(pnu) end
end

-- Bytes of the block of a parameter in a response with all values; nil where nobody knows.
local function block_size(address, block, shown)
  if block and not block.error then -- it may be cut, and says what it has
    local size = value_size(block)
    size = size and size * block.value_count
    return size and BLOCK_HEADER + size + size % 2
  end
  if address.attribute ~= VALUE or shown(address.pnu) == nil then return nil end
  return least_block(address, shown)
end

-- Bytes of a response with all values, where it is known and more than `need`.
local function whole(job, need, read)
  local message, bytes = job.message, HEADER
  if message == nil or message.operation ~= "read" or rules.is_mismatch(job) then return nil end
  local shown = shown_by(message, job.response.blocks, read)
  for number, address in ipairs(message.addresses) do
    local size = block_size(address, job.response.blocks[number], shown)
    if size == nil then return nil end
    bytes = bytes + size
  end
  return bytes > need and bytes or nil
end

-- The number of bytes that fill a value block up and are not there, at the place where the message ends.
local function pads_missing(flaws, offset)
  return any(flaws, function(flaw) return flaw.rule == "DS311" and flaw.offset == offset end) and 1 or 0
end

--- MLEN of RDREC is too small: the response was cut to it. Of a request all is said that it needs, if known.
function M.answer_cut(remarks, job, read)
  local asked, answer = job.read_request, job.read_response
  if asked == nil or asked.stated == 0 or job.response == nil or #answer.data ~= asked.stated then return end
  local flaw = missing(job.response.flaws)
  if flaw and not answer.missing then
    local need = #answer.data + pads_missing(job.response.flaws, flaw.offset) + flaw.args.need
    local all = whole(job, need, read)
    local args = {asked = asked.stated, need = need, more = all and "mlen_whole", whole = all}
    put(remarks, "DS712", answer.frame, args)
  end
end

--- The same: a Read was refused for it, and a later one brought the record, which is longer.
function M.read_too_short(remarks, job)
  local answer = job.read_response
  local need = answer and answer.data ~= "" and #answer.data + (answer.missing or 0) or 0
  for _, read in ipairs(job:too_short()) do
    local stated = read.request and read.request.stated or 0
    if stated > 0 and stated < need then
      put(remarks, "DS712", read.response.frame, {asked = stated, need = need})
    end
  end
end

--- The same, and none brought the record: what all values of the request need at least.
function M.read_refused(remarks, job, size_of)
  local asked, answer, message = job.read_request, job.read_response, job.message
  if asked == nil or answer == nil or answer.status ~= STATUS_SHORT then return end
  if message == nil or message.operation ~= "read" then return end
  local need = HEADER
  for _, address in ipairs(message.addresses) do need = need + least_block(address, size_of) end
  if asked.stated > 0 and asked.stated < need then
    put(remarks, "DS712", answer.frame, {asked = asked.stated, need = need, more = "mlen_request"})
  end
end

-- How the device says that there was no room, and the first parameter of which it says so (from 1); nil
-- where room is not what was missing.
local function without_room(request, blocks, length, most, size_of)
  local count, refused = #request.addresses, false
  for number = 1, min(#blocks, count) do
    local failure = blocks[number].error
    if failure then
      refused = true
      if failure.code == tables.known.too_long then return "too_long", number end
    end
  end
  if refused or #blocks >= count then return nil end
  local number = #blocks + 1
  local following = least_block(request.addresses[number], size_of)
  if length + following > most then return "left_out", number end
  return nil
end

-- For how many of the parameters, or of the elements of the first one, a response has room: the key of the
-- words, and the number. Nobody knows that where the size of a value is not known; those that were answered
-- show theirs.
local function room_for(request, blocks, room, read)
  local left, shown = room - HEADER, shown_by(request, blocks, read)
  for number, address in ipairs(request.addresses) do
    local needs = block_size(address, blocks[number], shown)
    if needs == nil then return nil, nil end
    if needs > left then
      local size = number == 1 and shown(address.pnu)
      if size then return "fit_elements", floor(max(0, left - BLOCK_HEADER) / size) end
      return "fit_parameters", number - 1
    end
    left = left - needs
  end
  return nil, nil
end

-- The numbers of the parameters that have their values: one response could carry those.
local function answered(blocks)
  local found = {}
  for number = 1, #blocks do found[#found + 1] = not blocks[number].error and number or nil end
  return found
end

--- More was asked than one response can carry.
-- @param stated   r0974 of the device, bytes, if it was read; else nil
-- @param longest  bytes of the longest response of the device, as far as it is known
function M.answer_too_long(remarks, job, stated, longest, size_of, read)
  local half, request, response = job.read_response, job.message, job.response
  if half == nil or request == nil or response == nil or request.operation ~= "read" then return end
  if half.missing or rules.is_mismatch(job) then return end
  longest = max(longest, #half.data)
  local limit = stated and stated >= longest and stated or nil
  local most = limit or max(longest, tables.known.channel_bytes)
  local what, number = without_room(request, response.blocks, #half.data, most, size_of)
  if what then
    local address, good = request.addresses[number], answered(response.blocks)
    local fit, fits = room_for(request, response.blocks, most, read)
    put(remarks, "DS713", half.frame, {
      parameters = rules.parameters_asked(job), number = #good, what = what,
      pnu = address.pnu, subindex = address.subindex,
      room = limit and "room_stated" or "room_seen", limit = limit or longest,
      fit = fit, fits = fits, most = fit and most,
    })
    if good[1] and #good < #request.addresses and good[#good] <= #request.addresses then
      remarks[#remarks].corrected = suggest.only(request, good)
    end
  end
end

return M
