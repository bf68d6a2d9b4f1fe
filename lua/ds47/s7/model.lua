-- What is known of S7 communication: addresses, items, jobs, connections (docs/s7.md).
--
-- Plain values only, which every other module of this room fills or reads; nothing is decoded, paired or
-- judged here. A frame is {frame, time_ns} wherever something stands in the capture: called `at`. A flaw is
-- {kind, offset, args}, its words are in spec/s7.lua; an end of a connection is {ip, port}.

local floor = math.floor

local M = {
  DB = 0x84, -- the area of data blocks; all others have no number
  DONE = 0xFF, -- the return code of an item that went well
  ELEMENTS = {[0x1C] = true, [0x1D] = true}, -- areas whose addresses are numbers of elements
}

-- What an item names: `start` counts bits, in timers and counters elements; `count` elements of `size` bits,
-- 0 where that is not known; `transport` is the transport size of the item.
local Address = {}
Address.__index = Address

function M.address(area, db, start, size, count, transport)
  return setmetatable({
    area = area, db = db, start = start, size = size, count = count, transport = transport or 2,
  }, Address)
end

--- What two addresses have in common that can overlap: a number.
function Address:memory()
  return self.area * 0x10000 + self.db
end

--- The first bit behind it, in timers and counters the first element.
function Address:last()
  return self.start + self.count * (M.ELEMENTS[self.area] and 1 or self.size)
end

--- Bytes of its data.
function Address:length()
  return floor((self.count * self.size + 7) / 8)
end

--- One variable of a job, or one area of a USEND; the data of a BSEND is one item.
-- @param address  nil where nothing of the request is known, where its syntax is an unknown one, and in what
--   is sent
-- @param value  what was read, written or sent; nil where it is not there
-- @param code  what the partner answered; nil without an answer, and in what is sent
-- @param syntax  of the address, where it is an unknown one
function M.item(address, value, code, syntax)
  return {address = address, value = value, code = code, syntax = syntax}
end

-- A TCP connection of S7; what the capture does not have of it is nil. The client is the end that opened it;
-- where that was not seen, the end that sent the first job.
--   number               from 1, by the first frame
--   client, server       ends
--   opened, last         first and last frame of it
--   begun                whether its beginning is in the capture (SYN, or CR)
--   client_tsap, server_tsap, tpdu_size (bytes of a TPDU, as it was agreed), confirmed (CC)
--   asked_pdu, asked_parallel  PDU length and parallel jobs of the setup, as the client wants them,
--   pdu_length, parallel       and as they were agreed; `setup` is the answer to it
--   plus, cyclic, other  PDUs of S7CommPlus; of cyclic services, which bring data without a job; all others
--                        that are no job and belong to none
--   lost_bytes, foreign  bytes that the capture does not have; PDUs of other protocols
--   closed, most_open    whether it is over; jobs of one end without an answer, at the most
--   counts               {jobs (all that are over), refused (those that were refused, or of which an item
--                        was), unanswered, orphans (answers without a job), read, written, sent (bytes),
--                          timed (jobs
--                        with a request and an answer), total_ns, least_ns, most_ns}
--   evidence             array of what the server said of itself: {at, szl_id, szl_index, name, value}
local Connection = {}
Connection.__index = Connection

function M.connection(number, talk, at)
  return setmetatable({
    number = number, client = talk.client, server = talk.server, opened = at, last = at, begun = talk.begun,
    plus = 0, cyclic = 0, other = 0, lost_bytes = 0, foreign = 0, closed = false, most_open = 0,
    counts = {
      jobs = 0, refused = 0, unanswered = 0, orphans = 0, read = 0, written = 0, sent = 0, timed = 0,
      total_ns = 0, least_ns = 0, most_ns = 0,
    },
    evidence = {},
  }, Connection)
end

--- Who sends in one direction.
function Connection:side(from_client)
  return from_client and self.client or self.server
end

-- A GET or PUT with its answer, a BSEND with its segments, or a USEND:
--   operation              "get", "put", "bsend", "usend"
--   connection, from_client  whether the end that opened the connection asks, or sends
--   reference              PDU reference: of a BSEND that of its first segment
--   asked, answered        frames: the request, nil for an answer without one; the answer, of a BSEND the
--                          acknowledgement of the last segment
--   items, groups          items; of each the number of its address in the request, from 0
--   request, response      the S7 PDUs; nil for a BSEND
--   error                  error class and code of the answer as one word, of a BSEND that of an
--     acknowledgement
--   r_id, total            of BSEND and USEND; bytes that a BSEND announces
--   segments               of a BSEND: {at, size, number, sequence, last, pdu, reference, acknowledged,
--                          assigned, error}: `number` as the sender counts, `pdu` the bytes of its PDU,
--                            `assigned` and
--                          `error` the sequence and the error word of its acknowledgement
--   state                  "ok", "error", "partial", "refused", "unanswered", "orphan"
--   flaws, answer_flaws    of its PDUs
--   split                  {area, parts, number}, filled when an area was read or written in parts: all of
--                          it, how many parts it has, and which of them this job is
--   lost                   whether the capture lacks bytes of the connection while it was open
--   place                  among the PDUs that begin in the frame of the first one
--   order                  its number among all transactions of the capture; the analysis gives it
--   phase                  "open", and "closed" when everybody knows that it is over
local Job = {}
Job.__index = Job

--- A job; `fields` are those above that it has.
function M.job(fields)
  fields.groups, fields.segments = fields.groups or {}, fields.segments or {}
  fields.flaws, fields.answer_flaws = fields.flaws or {}, fields.answer_flaws or {}
  fields.state, fields.phase, fields.lost = fields.state or "unanswered", "open", false
  fields.place, fields.split = 0, {}
  return setmetatable(fields, Job)
end

--- Who asks, or sends.
function Job:asker()
  return self.connection:side(self.from_client)
end

--- Who answers, or receives.
function Job:partner()
  return self.connection:side(not self.from_client)
end

--- From the request to its answer; nil without one of them.
function Job:duration_ns()
  return self.asked and self.answered and self.answered.time_ns - self.asked.time_ns or nil
end

return M
