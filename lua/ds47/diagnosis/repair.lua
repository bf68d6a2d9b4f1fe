-- What one change makes of a request that went wrong: swapped bytes, spread fields, wrong types (DS714 to
-- DS716). The same search as python/ds47/diagnosis/repair.py, where the candidates are listed and explained;
-- numbers of parameters begin with 1 here.

local any = require("ds47.support.arrays").any
local dictionary = require("ds47.profidrive.dictionary")
local formats = require("ds47.profidrive.formats")
local json = require("ds47.support.json")
local notation = require("ds47.profidrive.notation")
local numbers = require("ds47.support.numbers")
local parameter = require("ds47.profidrive.parameter")
local reader = require("ds47.support.bytes")
local tables = require("ds47.spec.tables")

local byte, char, format, gsub, rep = string.byte, string.char, string.format, string.gsub, string.rep
local reverse, sub = string.reverse, string.sub
local abs, floor, max = math.abs, math.floor, math.max
local concat = table.concat
local is_absurd, known = formats.is_absurd, tables.known

local M = {}

local READ, CHANGE = 0x01, 0x02
local HEADER, ADDRESS = tables.layouts.MESSAGE_SIZE, tables.layouts.ADDRESS_SIZE
local WRONG_TYPE = {[0x05] = true, [0x17] = true} -- the type errors that are never about the value
local SIEMENS = dictionary.SIEMENS
local NORMALISED = 0x65 -- from this code on a whole number stands for something else
local BOOLEAN = 0x01
local NUMBERS = {number = true, float = true, time_of_day = true, duration = true}
local OTHER = {number = {[4] = 0x08, [8] = 0x0F}, float = {[4] = 0x04, [8] = 0x37}} -- what bits may mean
local MARGIN = 2 -- significant digits by which one of two readings must be shorter
local EXACT = 9007199254740992 -- 2^53

-- Numbers -----------------------------------------------------------------------------------------------

local LEAST = tonumber(format("1e%d", known.plausible_least))
local MOST = tonumber(format("1e%d", known.plausible_most))

-- Significant digits of a number that a person may have typed (0: none), nil for any other.
local function digits_of(value)
  if type(value) ~= "number" then return nil end
  if value == 0 then return 0 end
  value = abs(value)
  if value < LEAST or value > MOST then return nil end
  local count = #gsub(gsub(gsub(numbers.text(value), "%.", ""), "^0+", ""), "0+$", "")
  return count <= known.plausible_digits and count or nil
end

local function nobody_types(value) return not digits_of(value) end

local function row_of(block) return tables.formats[block.meaning or block.format] end

-- Bytes per value; of a block that is cut off, with which nothing can be done, fewer.
local function size_of(block) return floor(#block.raw / max(block.value_count, 1)) end

local function numbers_of(block)
  local row = row_of(block)
  return row and NUMBERS[row.kind] and block.values or {}
end

local function absurd_inside(message) return any(message.blocks, is_absurd) end

-- The values of a block as an argument of a finding.
local function values_of(block)
  local shown = json.array({})
  for i, value in ipairs(block.values) do shown[i] = formats.argument(value, block) end
  return shown
end

-- Bytes of numbers ----------------------------------------------------------------------------------------

local unsigned = reader.of_number

local SIGNED = {b = true, h = true, i = true, q = true}

local function whole_number(value, row, size)
  if value % 1 ~= 0 or value < -EXACT or value > EXACT then return nil end
  local range = size < 8 and 256 ^ size or nil
  if SIGNED[row.pack] then
    if range and (value < -range / 2 or value >= range / 2) then return nil end
  elseif value < 0 or range and value >= range then
    return nil
  end
  local high = floor(value / 4294967296)
  local bytes = unsigned(high % 4294967296, 4) .. unsigned(value - high * 4294967296, 4)
  return sub(bytes, 9 - size)
end

-- Half a step up or down to the even one, as the hardware does.
local function nearest(number)
  local low = floor(number)
  local off = number - low
  if off > 0.5 or off == 0.5 and low % 2 == 1 then low = low + 1 end
  return low
end

-- value * 2^-exponent as a number of 1 to 2, or below 1 where the exponent ends at `least`.
local function split(value, least)
  local exponent = 0
  while value >= 2 do value, exponent = value / 2, exponent + 1 end
  while value < 1 and exponent > least do value, exponent = value * 2, exponent - 1 end
  return value, exponent
end

local function float32(value)
  local part, exponent = split(abs(value), -126)
  local bits = (exponent + 126) * 8388608 + nearest(part * 8388608)
  if bits >= 2139095040 then return nil end
  local negative = value < 0 or value == 0 and 1 / value < 0
  return unsigned(bits + (negative and 2147483648 or 0), 4)
end

local function float64(value)
  local part, exponent = split(abs(value), -1022)
  local fraction = part * 4503599627370496
  local high = (exponent + 1022) * 1048576 + floor(fraction / 4294967296)
  local negative = value < 0 or value == 0 and 1 / value < 0
  return unsigned(high + (negative and 2147483648 or 0), 4) .. unsigned(fraction % 4294967296, 4)
end

local function bytes_of(value, row)
  if row.pack == "f" then return float32(value) end
  if row.pack == "d" then return float64(value) end
  return whole_number(value, row, row.size)
end

local function same_values(left, right)
  if #left ~= #right then return false end
  for i = 1, #left do
    if left[i] ~= right[i] then return false end
  end
  return true
end

local function new_block(code, count, values, raw)
  local codec = formats.codec(code)
  return {
    format = code, format_name = tables.formats[code].name, value_count = count, values = values, raw = raw,
    pad = rep("\0", #raw % 2), float = codec.float,
  }
end

-- The same numbers as a block of another format; nil where that cannot hold them exactly.
local function as_format(code, values)
  local row, codec, parts = tables.formats[code], formats.codec(code), {}
  for i, value in ipairs(values) do
    parts[i] = bytes_of(value, row)
    if not parts[i] then return nil end
  end
  local raw = concat(parts)
  local decoded = codec.decode(raw, #values, codec.size)
  return same_values(decoded, values) and new_block(code, #values, decoded, raw) or nil
end

-- The whole message ---------------------------------------------------------------------------------------

-- A request without any flaw, zeros behind its end cut off, and its bytes; nil for every other.
local function settled(data, options)
  local message = parameter.decode_request(data, options)
  if #message.flaws == 1 and message.flaws[1].rule == "DS314" then
    data = sub(data, 1, #data - #message.rest)
    message = parameter.decode_request(data, options)
  end
  if message.flaws[1] or message.request_id ~= READ and message.request_id ~= CHANGE then return nil end
  return message, data
end

-- The readable line; the bytes where there is none, as with dialects, which it does not know.
local function line(data, message, options)
  return notation.request_line(message, options and options.family)
    or (gsub(gsub(reader.hex(data), "..", "%0 "), " $", ""))
end

local function repair(rule, what, message, data, options, number)
  local args = {meant = line(data, message, options)}
  return {rule = rule, what = what, request = data, args = args, number = number or 1}
end

local function all_known(message, known_pnu)
  return not any(message.addresses, function(address) return not known_pnu(address.pnu) end)
end

local function turned(block)
  local row, size = row_of(block), size_of(block)
  if not row or not NUMBERS[row.kind] or size ~= 2 and size ~= 4 and size ~= 8 then return block.raw end
  return (gsub(block.raw, rep(".", size), reverse))
end

local function put(data, offset, bytes)
  return sub(data, 1, offset) .. bytes .. sub(data, offset + #bytes + 1)
end

-- The request with its values, and its PNU and subindex too, turned round.
local function little_endian(request, message, addresses)
  for _, address in ipairs(addresses and message.addresses or {}) do
    local at = address.offset
    local field = sub(request, at + 3, at + 6)
    request = put(request, at + 2, (gsub(field, "(.)(.)", "%2%1")))
  end
  for _, block in ipairs(message.blocks) do request = put(request, block.offset + 2, turned(block)) end
  return request
end

-- Whether a number that somebody may have typed is none any more.
local function is_worse(before, after)
  for i, block in ipairs(before.blocks) do
    local values = after.blocks[i] and numbers_of(after.blocks[i]) or {}
    for j, value in ipairs(numbers_of(block)) do
      if values[j] ~= nil and digits_of(value) and not digits_of(values[j]) then return true end
    end
  end
  return false
end

local function try_swapped(found, what, data, before, known_pnu, options)
  local message, bytes = settled(data, options)
  if not message or not all_known(message, known_pnu) or absurd_inside(message) or found[bytes] then
    return
  end
  if what ~= "all_bytes" and is_worse(before, message) then return end
  found[#found + 1] = repair("DS715", what, message, bytes, options)
  found[bytes] = true
end

-- found: array of repairs, and the set of their requests
local function swapped(found, request, message, known_pnu, options)
  if message.addresses[1] and all_known(message, known_pnu) then return end
  if #request % 2 == 0 then
    try_swapped(found, "all_bytes", gsub(request, "(.)(.)", "%2%1"), message, known_pnu, options)
  end
  if #message.addresses == message.parameter_count then
    local data = little_endian(request, message, true)
    try_swapped(found, "fields", data, message, known_pnu, options)
  end
end

local function try_layout(found, what, data, options)
  if not data or data == "" then return false end
  local message, bytes = settled(data, options)
  if not message or absurd_inside(message) then return false end
  if not found[bytes] then found[#found + 1] = repair("DS716", what, message, bytes, options) end
  return true
end

-- Each second byte, from `place` (0 or 1) on; nil unless all others are zero.
local function every_second(data, place)
  local parts = {}
  for i = 1, #data do
    if (i - 1) % 2 == place then
      parts[#parts + 1] = sub(data, i, i)
    elseif byte(data, i) ~= 0 then
      return nil
    end
  end
  return concat(parts)
end

-- A request whose single bytes lie in words of their own: {data, place, at, failed}.
local function take(spread, size)
  local part = sub(spread.data, spread.at + 1, spread.at + size)
  spread.at = spread.at + size
  if #part < size then spread.failed = true end
  return part
end

local function singles(spread, count)
  local part = every_second(take(spread, 2 * count), spread.place)
  if not part or #part < count then spread.failed = true end
  return part or ""
end

local function spread_block(spread, options)
  local head = singles(spread, 2)
  if spread.failed then return "" end
  local code, count = byte(head, 1, 2)
  local codec = parameter.codec(code, options)
  if not codec then
    spread.failed = true
    return ""
  end
  local size, single = count * codec.size, codec.size == 1 and not codec.whole
  local values = single and singles(spread, size) or take(spread, size)
  if not single and size % 2 == 1 then take(spread, 1) end
  return head .. values .. rep("\0", size % 2)
end

-- The bytes without the fill bytes, which stand behind each single byte (place 0) or before it (1).
local function without_fill_bytes(data, place, options)
  local spread = {data = data, place = place, at = 0, failed = false}
  local head = singles(spread, HEADER)
  if spread.failed then return nil end
  local parts, count = {head}, byte(head, 4)
  for _ = 1, count do
    parts[#parts + 1] = singles(spread, 2) .. take(spread, 4)
    if spread.failed then return nil end
  end
  for _ = 1, byte(head, 2) == CHANGE and count or 0 do
    parts[#parts + 1] = spread_block(spread, options)
    if spread.failed then return nil end
  end
  return reader.only_zeros(data, spread.at) and concat(parts) or nil
end

-- The repairs that concern more than values; equal requests count once.
local function whole_message(request, message, known_pnu, options)
  local found = {}
  swapped(found, request, message, known_pnu, options)
  local zeros = false
  for place = 0, 1 do zeros = try_layout(found, "zeros", every_second(request, place), options) or zeros end
  if zeros then return found end -- which explains the fill bytes as well
  for place = 0, 1 do
    try_layout(found, "even_offsets", without_fill_bytes(request, place, options), options)
  end
  return found
end

-- Values --------------------------------------------------------------------------------------------------
--
-- A job is {request, message, errors, known_format, options}; a guess {repair, digits}, the digits of the
-- longest number in it.

-- Whether this is a known BICO input, whose value is no number (DS720 speaks of those).
local function is_connector(job, number)
  local vendor = job.options and job.options.vendor_id
  return (vendor == nil or vendor == SIEMENS) and known.connectors[job.message.addresses[number].pnu] ~= nil
end

-- Whether values are absurd by themselves, or the drive refused numbers that nobody types.
local function is_wrong(job, number)
  local block = job.message.blocks[number]
  if is_connector(job, number) then return false end
  if is_absurd(block) then return true end
  return known.type_errors[job.errors[number]] and any(numbers_of(block), nobody_types) or false
end

-- Whether values may be connectors, PNU in the upper word, rather than numbers turned round.
local function may_be_connectors(block, count)
  local row = row_of(block)
  if not row or row.pack ~= "I" then return false end
  for _, value in ipairs(block.values) do
    local pnu = digits_of(floor(value / 65536))
    if pnu and pnu > 0 and pnu < count + MARGIN then return true end
  end
  return false
end

-- Whether the drive refused the type, and the parameter is known to have another one.
local function is_of_other_type(job, number)
  local wanted = job.known_format(job.message.addresses[number].pnu)
  return WRONG_TYPE[job.errors[number]] and wanted ~= nil and wanted ~= job.message.blocks[number].format
end

-- All values little-endian: at least one is absurd now, none is then.
local function values_swapped(job)
  local fixed, data = settled(little_endian(job.request, job.message, false), job.options)
  if not fixed then return nil end
  local longest, first = 0, nil
  for number, block in ipairs(fixed.blocks) do
    if is_of_other_type(job, number) then return nil end
    local old = job.message.blocks[number]
    if block.raw ~= old.raw then
      for _, value in ipairs(block.values) do
        local count = digits_of(value)
        if not count then return nil end
        longest = max(longest, count)
      end
      if not first and is_wrong(job, number) and not may_be_connectors(old, longest) then first = number end
    end
  end
  return first and {repair = repair("DS715", "values", fixed, data, job.options, first), digits = longest}
end

-- The same bits as a float instead of a whole number or the reverse, if all are plausible.
local function other_reading(block)
  local row = row_of(block)
  local code = OTHER[row.kind] and OTHER[row.kind][size_of(block)]
  if not code then return nil end
  local codec = formats.codec(code)
  local values = codec.decode(block.raw, block.value_count, codec.size)
  if any(values, nobody_types) then return nil end
  return values, code
end

-- The values under a format: the same bits if they mean them there, else the same numbers.
local function written(block, values, code)
  local row, codec = tables.formats[code], formats.codec(code)
  if not codec or not NUMBERS[row.kind] then return nil end
  local count, raw = block.value_count, block.raw
  if #raw == count * codec.size then
    local decoded = codec.decode(raw, count, codec.size)
    if same_values(decoded, values) then return new_block(code, count, decoded, raw) end
  end
  local plain = (row.kind == "number" or row.kind == "float") and code > BOOLEAN and code < NORMALISED
  if not plain or block.format >= NORMALISED then return nil end
  for _, value in ipairs(values) do
    if type(value) == "string" then return nil end
  end
  return as_format(code, values)
end

local function retyped(job, number, block)
  local wanted = job.known_format(job.message.addresses[number].pnu)
  if block.meaning or not numbers_of(block)[1] or is_connector(job, number) then return nil end
  if is_wrong(job, number) then
    local values, natural = other_reading(block)
    if values then return written(block, values, wanted or natural) end
  end
  if not wanted or not is_of_other_type(job, number) or is_absurd(block) then return nil end
  return written(block, block.values, wanted)
end

-- The request with some of its value blocks replaced.
local function with_blocks(job, changed)
  local parts = {sub(job.request, 1, HEADER + ADDRESS * #job.message.addresses)}
  for i, block in ipairs(job.message.blocks) do
    block = changed[i] or block
    parts[#parts + 1] = char(block.format, block.value_count) .. block.raw .. block.pad
  end
  return concat(parts) .. job.message.rest
end

-- How the values of two blocks hang together: a key of tables.diagnosis_words.
local function kinship(old, new)
  if new.raw == old.raw then return "bits_same" end
  return same_values(new.values, numbers_of(old)) and "number_same" or "number_other"
end

local function described(job, number, new)
  local old, address = job.message.blocks[number], job.message.addresses[number]
  return {
    number = number, bits = kinship(old, new),
    args = {
      pnu = address.pnu, subindex = address.subindex, format = old.format_name, values = values_of(old),
      better = new.format_name, code = new.format, meant = values_of(new),
    },
  }
end

-- `each` are all parameters that stand under another format now; the first of them is in the fields too.
local function type_repair(job, changed, data)
  local each = {}
  for number = 1, #job.message.blocks do
    if changed[number] then each[#each + 1] = described(job, number, changed[number]) end
  end
  local first = each[1]
  return {rule = "DS714", what = "", request = data, number = first.number, args = first.args, each = each}
end

-- The values that are absurd, or of a type that was refused, under another format.
local function other_format(job)
  local changed, first, longest = {}, nil, 0
  for number, block in ipairs(job.message.blocks) do
    changed[number] = retyped(job, number, block)
    if changed[number] then
      first = true
      for _, value in ipairs(changed[number].values) do longest = max(longest, digits_of(value) or 0) end
    end
  end
  if not first then return nil end
  local fixed, data = settled(with_blocks(job, changed), job.options)
  if not fixed or absurd_inside(fixed) then return nil end
  return {repair = type_repair(job, changed, data), digits = longest}
end

-- The one of two guesses; where both are left the one with clearly shorter numbers.
local function meant(turn, other)
  if not turn or not other then return turn or other end
  if turn.digits + MARGIN <= other.digits then return turn end
  return other.digits + MARGIN <= turn.digits and other or nil
end

local function is_sound_change(message)
  local is_broken = any(message.flaws, function(flaw) return flaw.rule ~= "DS314" end)
  return not is_broken and message.request_id == CHANGE
end

--- The repair of a request, nil if nothing is wrong or if it is not certain. Never raises.
-- @param request the data of the Write record
-- @param message the same decoded with the same `options`
-- @param errors number of the parameter, from 1 -> error number, of those that were refused
-- @param known_pnu function(pnu): whether there is such a parameter
-- @param known_format function(pnu): its format code, nil where it is not known
-- @param options {legacy_g120_formats, profile_v3_types, vendor_id, family} or nil; the family is whose
--   parameters the drive has, for the readable line
-- @return {rule, what (key of tables.diagnosis_words, "" for DS714), request, args, number (from 1)}
function M.find(request, message, errors, known_pnu, known_format, options)
  -- Twice the channel: data with a fill byte for each one. What is longer no program of a channel sends.
  if #request > 2 * known.channel_bytes then return nil end
  if message.shaped and next(errors) == nil and not absurd_inside(message) then return nil end
  local whole = whole_message(request, message, known_pnu, options)
  if whole[1] then return not whole[2] and whole[1] or nil end
  if not is_sound_change(message) then return nil end
  local job = {
    request = request, message = message, errors = errors, known_format = known_format, options = options,
  }
  local guess = meant(values_swapped(job), other_format(job))
  return guess and guess.repair
end

return M
