-- Jobs that are over as transactions of the report, and connections as it tells of them.
--
-- What was wrong with them is not said here. Keys of a transaction are those of acyclic/transactions.lua.

local addresses = require("ds47.s7.addresses")
local place_of = require("ds47.spec.s7").place
local tables = require("ds47.spec.tables")

local floor, insert = math.floor, table.insert

local M = {CHANNEL = "s7"}

local BYTE = 8
local NONE = {}

-- An item of the report; of what is `sent` the bytes are all that is known.
local function item_of(item, sent)
  local address = item.address
  if not address then
    return {length = sent and item.value and #item.value or nil, value = item.value, code = item.code}
  end
  local row = tables.s7.areas[address.area]
  local found = {
    address = addresses.text(address), area = row and row.letter,
    db = row and row.numbered and address.db or nil,
    length = address.size > 0 and address:length() or nil, value = item.value, code = item.code,
  }
  if row and row.elements then
    found.start = address.start
  else
    found.start = floor(address.start / BYTE)
  end
  local bit = not (row and row.elements) and address.start % BYTE or nil
  if address.size == 1 or bit and bit ~= 0 then found.bit = bit end
  return found
end

local function segments_of(job)
  local found = {}
  for _, each in ipairs(job.segments) do
    insert(found, {request = each.at.frame, response = each.acknowledged and each.acknowledged.frame})
  end
  return found
end

-- The bytes of a PDU; nil of one that is not there.
local function whole(pdu)
  return pdu ~= "" and pdu or nil
end

--- The transaction of a job, over or not, with its `order`. Times are those of the job.
function M.build(job)
  local asked, answered, items = job.asked, job.answered, {}
  for number, each in ipairs(job.items) do items[number] = item_of(each, job.r_id ~= nil) end
  return {
    id = 0, findings = {}, order = job.order, channel = M.CHANNEL, position = job.place,
    operation = job.operation, state = job.state, controller = job:asker().ip, device = job:partner().ip,
    request_reference = job.reference,
    frames = {
      write_request = asked and asked.frame, read_response = answered and answered.frame, polls = NONE,
      rereads = NONE,
    },
    start_ns = (asked or answered).time_ns, duration_ns = job:duration_ns(),
    request = whole(job.request), response = whole(job.response), parameters = NONE,
    connection = job.connection.number, items = items, r_id = job.r_id, error = job.error,
    segments = segments_of(job), total = job.total, split = job.split,
  }
end

-- Times of answers; nil where there are none.
local function span_of(counts)
  if counts.timed == 0 then return nil end
  return {
    least = counts.least_ns, mean = (counts.total_ns - counts.total_ns % counts.timed) / counts.timed,
    most = counts.most_ns,
  }
end

--- A connection as the report has it, and how many bytes its server copies at once; nil where nobody says.
function M.told(item, block)
  local rack, slot = place_of(item.server_tsap)
  local counts, evidence = item.counts, {}
  for number, each in ipairs(item.evidence) do
    evidence[number] = {name = each.name, value = each.value, frame = each.at.frame}
  end
  return {
    id = item.number,
    client = item.client.ip, client_port = item.client.port, client_tsap = item.client_tsap,
    server = item.server.ip, server_port = item.server.port, server_tsap = item.server_tsap, rack = rack,
    slot = slot, pdu_length = item.pdu_length, parallel = item.parallel, most_open = item.most_open,
    jobs = counts.jobs, refused = counts.refused, unanswered = counts.unanswered, orphans = counts.orphans,
    read_bytes = counts.read, written_bytes = counts.written, sent_bytes = counts.sent,
    answer = span_of(counts), cyclic = item.cyclic, other = item.other, plus = item.plus,
    lost_bytes = item.lost_bytes, first_frame = item.opened.frame, last_frame = item.last.frame,
    setup = item.setup and item.setup.frame,
    block = block, evidence = evidence,
  }
end

return M
