-- What a frame says in one sentence: the Info column, and the label of the tree.
--
-- A *view* is one transaction as one frame shows it (track.lua makes them): {role, item = the transaction,
-- parameters = those that the frame shows, message, response, complete}. Numbers, values and addresses are
-- written as the text report writes them.

local status = require("ds47.status")
local words = require("ds47.report_words")

local M = {}

local PARAMETERS_SHOWN = 6 -- more make the line long: they are counted

-- `ref 3, DO 2`; a message may be too short to have them.
local function head(item)
  local reference, axis = item.request_reference, item.axis
  local text = reference and string.format("ref %d", reference) or "ref ?"
  return axis and string.format("%s, DO %d", text, axis) or text
end

local function reference(item)
  return item.request_reference and string.format("ref %d", item.request_reference) or "ref ?"
end

local function drive_object(item)
  return item.axis and string.format(", DO %d", item.axis) or ""
end

--- `0x02 value outside limits`; the second word where it says something.
function M.error(failed)
  local text = failed.code and string.format("0x%02X", failed.code) or "error"
  if failed.text ~= "" then
    text = text .. " " .. words.escape(failed.text)
  end
  if failed.info and failed.info ~= 0 then
    text = string.format("%s (info %d)", text, failed.info)
  end
  return text
end

--- One parameter: `p50303[0] = 10.0`, `:=` where the value was written, `: 0x02 ...` where it failed.
function M.parameter(item, written)
  local text = words.address(item)
  if item.error then
    return text .. ": " .. M.error(item.error)
  elseif #item.values == 0 then
    return text
  end
  text = text .. (written and " := " or " = ") .. words.values(item.values, item.format)
  if item.scaled and #item.scaled > 0 then
    local unit = item.unit and " " .. words.escape(item.unit) or ""
    text = text .. " (" .. words.values(item.scaled, item.format, true) .. unit .. ")"
  end
  return text
end

local function list(view)
  local parameters, parts = view.parameters, {}
  local written = view.item.operation == "change"
  for number = 1, math.min(#parameters, PARAMETERS_SHOWN) do
    parts[number] = M.parameter(parameters[number], written)
  end
  if #parts == 0 then
    return ""
  end
  local more = #parameters - #parts
  return ": " .. table.concat(parts, ", ") .. (more > 0 and string.format(", ... and %d more", more) or "")
end

local function refusal(word)
  return status.status_hex(word) .. " " .. status.status_text(word)
end

local function asked(view)
  local item, id = view.item, view.message and view.message.request_id
  if item.operation == "read" or item.operation == "change" then
    return item.operation
  end
  return id and string.format("%s 0x%02X", item.operation, id) or item.operation
end

local sentences = {}

function sentences.write_request(view)
  return asked(view) .. " request " .. head(view.item) .. list(view)
end

function sentences.write_response(view)
  local item = view.item
  local word = item.write_status
  if word == nil then
    return "write failed " .. reference(item)
  elseif word == 0 then
    return "write accepted " .. reference(item)
  end
  return "write refused " .. reference(item) .. ": " .. refusal(word)
end

function sentences.read_request(view)
  return "fetch response " .. head(view.item)
end

function sentences.poll(view)
  return "read poll " .. reference(view.item) .. ": not ready"
end

-- How a record of the drive is called: refused where no parameter of it was done.
local function outcome(view)
  local item, response = view.item, view.response
  local failed, done = 0, 0
  for _, block in ipairs(response and response.blocks or {}) do
    if block.error then
      failed = failed + 1
    else
      done = done + 1
    end
  end
  if failed == 0 then
    return asked(view) .. " response " .. head(item)
  end
  return asked(view) .. (done > 0 and " partly refused" or " refused") .. drive_object(item)
end

function sentences.read_response(view)
  local item = view.item
  if item.read_status and item.read_status ~= 0 then
    return "read refused " .. reference(item) .. ": " .. refusal(item.read_status)
  end
  return outcome(view) .. list(view)
end

function sentences.reread(view)
  return "read again: " .. outcome(view) .. list(view)
end

--- The sentence of one view, without the name of the protocol.
function M.sentence(view)
  return sentences[view.role](view)
end

--- The Info column of a frame: the sentences of all its views.
function M.text(views)
  local text = "DS47 " .. M.sentence(views[1])
  for number = 2, #views do
    text = text .. "; " .. M.sentence(views[number])
  end
  return text
end

return M
