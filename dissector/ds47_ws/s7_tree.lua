-- What a frame of S7 communication shows: the job that it belongs to, its other frames, its items, what was
-- split.
--
-- All of it is generated: the bytes are shown by the dissector of Wireshark. What a view is stands in
-- info.lua; roles of S7 are "write_request" (the request, or the first segment), "read_response" (the answer,
-- or the last acknowledgement), "segment" and "acknowledge".

local report = require("ds47.report.s7")
local s7 = require("ds47.spec.s7")
local words = require("ds47.report.formatting")

local upper = string.upper

local M = {}

-- Adds a code with its meaning behind it.
local function add_code(put, root, name, code, meaning)
  local item = put.derive(root, name, code)
  if item then item:append_text(" (" .. meaning .. ")") end
end

local NAMED = 4 -- addresses of a job that its label names

-- `GET DB1.DBB0..443`, `BSEND R_ID 00000009`.
local function about(item)
  if item.r_id then return upper(item.operation) .. string.format(" R_ID %08X", item.r_id) end
  local named = {}
  for number = 1, math.min(#item.items, NAMED) do named[number] = item.items[number].address or "?" end
  named[#named + 1] = #item.items > NAMED and "..." or nil
  return upper(item.operation) .. " " .. (named[1] and table.concat(named, ", ") or "?")
end

--- The label of a view: `GET DB1.DBB0..443: ok, 0.8 ms`.
function M.label(view, lang)
  local item, text = view.item, about(view.item)
  if not view.complete and view.role ~= "read_response" then return text end
  local parts = { words.state(lang, item.state), report.error(item, lang) }
  if item.duration_ns then parts[#parts + 1] = words.duration(item.duration_ns) end
  return text .. ": " .. words.joined(lang, parts)
end

-- Where an item is, and how long.
local function add_place(put, shown, each)
  put.derive(shown, "s7.area", each.address)
  put.derive(shown, "s7.memory", each.area)
  put.derive(shown, "s7.db", each.db)
  put.derive(shown, "s7.start", each.start)
  put.derive(shown, "s7.bit", each.bit)
  put.derive(shown, "s7.length", each.length)
end

-- The values of all items, one behind the other, and where each begins. They may have come in several frames.
local function values_of(put, items)
  local parts, starts, length = {}, {}, 0
  for number, each in ipairs(items) do
    starts[number], length = length, length + #(each.value or "")
    parts[number] = each.value or ""
  end
  return put.elsewhere(table.concat(parts), "Values of the job"), starts
end

-- What stands in the request alone is not known of what an answer brings. Values stand once, in the frame
-- that shows all of the job.
local function add_items(put, root, view, main, lang)
  local item, values, starts = view.item, nil, nil
  local parts = report.parts(item, lang)
  if main and put.wanted("s7.value") then values, starts = values_of(put, item.items) end
  for number, each in ipairs(item.items) do
    local shown = put.derive(root, "s7.item", parts[number]) or root
    add_place(put, shown, each)
    if each.code and (view.complete or view.role == "read_response") then
      add_code(put, shown, "s7.code", each.code, s7.code_text("return_code", each.code, lang))
    end
    if values and each.value then
      put.point(shown, "s7.value", values:range(starts[number], #each.value))
    end
  end
end

-- Bytes of a BSEND up to this frame, its segments and their acknowledgements; which of these belong together
-- stands once.
local function add_segments(put, root, item, main)
  put.derive(root, "s7.r_id", item.r_id)
  put.derive(root, "s7.total", item.total)
  if #item.segments == 0 then return end
  put.derive(root, "s7.segments", #item.segments)
  for _, each in ipairs(item.segments) do
    put.derive(root, "s7.segment", each.request)
    put.derive(root, "s7.segment", each.response)
  end
  for _, each in ipairs(main and item.segments or {}) do
    put.derive(root, "s7.segment.request", each.request)
    put.derive(root, "s7.segment.response", each.response)
  end
end

local function add_split(put, root, split)
  if not split.parts then return end
  local shown = put.derive(root, "s7.whole", split.area) or root
  put.derive(shown, "s7.parts", split.parts)
  put.derive(shown, "s7.part", split.number)
end

--- The two bytes of a finding about data that mixes two moments; nil of others.
function M.inconsistent(finding)
  if finding.rule ~= "DS905" then return nil end
  local args = finding.args
  return string.format("%s = 0x%02X, %s = 0x%02X", args.first, args.first_value, args.second,
    args.second_value)
end

--- Adds the job that a frame belongs to.
-- @param put  what adds fields, as tree.lua has it
-- @param root  the tree of the view
-- @param main  whether the view shows all of its job
-- @param duration  makes a time of nanoseconds
function M.add(put, root, view, main, duration, lang)
  local item = view.item
  if view.role ~= "write_request" then put.derive(root, "s7.request_in", item.frames.write_request) end
  if view.role ~= "read_response" then put.derive(root, "s7.response_in", item.frames.read_response) end
  if item.duration_ns and put.wanted("s7.time") then
    put.derive(root, "s7.time", duration(item.duration_ns))
  end
  put.derive(root, "s7.connection", item.connection)
  put.derive(root, "s7.reference", item.request_reference)
  if item.error and (view.complete or view.role == "read_response") then
    add_code(put, root, "s7.error", item.error, s7.error_meaning(item.error, lang))
  end
  add_items(put, root, view, main, lang)
  add_segments(put, root, item, main)
  add_split(put, root, item.split)
end

return M
