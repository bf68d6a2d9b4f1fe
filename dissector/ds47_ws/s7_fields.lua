-- The fields of S7 communication: rows as in fields.lua. What stands in a PDU is shown by the dissector of
-- Wireshark (s7comm); here is what it does not say.

return {
  { "s7.request_in", "Request in frame", "framenum", "REQUEST" },
  { "s7.response_in", "Response in frame", "framenum", "RESPONSE" },
  { "s7.time", "Time from the request", "relative_time" },
  { "s7.connection", "Connection", "uint32", "DEC" },
  { "s7.reference", "PDU reference", "uint16", "DEC" },
  { "s7.error", "Error class and code", "uint16", "HEX" },
  { "s7.item", "Item", "string" },
  { "s7.area", "Area", "string" },
  { "s7.code", "Return code", "uint8", "HEX" },
  { "s7.memory", "Memory", "string" }, -- what the address begins with
  { "s7.db", "Data block", "uint16", "DEC" },
  { "s7.start", "First byte", "uint32", "DEC" }, -- of timers and counters the number of the first one
  { "s7.bit", "Bit", "uint8", "DEC" },
  { "s7.length", "Bytes of the item", "uint32", "DEC" },
  { "s7.value", "Value", "bytes" }, -- all of it
  { "s7.whole", "Whole area", "string" }, -- of which the job reads or writes a part
  { "s7.parts", "Parts of the area", "uint32", "DEC" },
  { "s7.part", "Part", "uint32", "DEC" },
  { "s7.inconsistent", "Bytes that were not there together", "string" },
  { "s7.r_id", "R_ID", "uint32", "HEX" },
  { "s7.total", "Bytes that BSEND announces", "uint32", "DEC" },
  { "s7.segments", "Segments", "uint32", "DEC" },
  { "s7.segment", "Segment in frame", "framenum", "NONE" },
  { "s7.segment.request", "Segment: sent", "framenum", "REQUEST" },
  { "s7.segment.response", "Segment: acknowledged", "framenum", "RESPONSE" },
}
