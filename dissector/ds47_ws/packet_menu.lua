--- The menu of a packet in the list: filters for what it is about, its request to paste, its status in words.
--
-- Wireshark 4.4 has such a menu, 4.0 has not. It tells the fields of the packet; what the packet is about is
-- known from its number, so that a filter holds for what the report calls the same parameter. Does nothing
-- when loaded, only when called.

local arrays = require("ds47.support.arrays")
local drive_objects = require("ds47.profidrive.drive_objects")
local formatting = require("ds47.report.formatting")
local later = require("ds47.support.later").module
local explanation = later("ds47.report.explanation")
local meanings = later("ds47.explain.meanings")
local reader = require("ds47.support.bytes")
local sentences = require("ds47.report.sentences")
local suggest = later("ds47.diagnosis.suggest")

local append, mapped = arrays.append, arrays.mapped
local concat, format = table.concat, string.format
local integer, say = formatting.integer, formatting.say

local M = {}

local WIDTH = 80 -- columns of the window
-- Terms of one kind in a filter. With more they are left out, so that the filter shows more and not less.
local MOST_TERMS = 32
local NEEDED = "ds47.transaction" -- what a packet needs for an entry

local function add_new(list, item)
  list.has = list.has or {}
  if item ~= nil and not list.has[item] then
    list.has[item] = true
    list[#list + 1] = item
  end
end

--- The transactions of views, each once.
function M.transactions(views)
  local items = {}
  for _, view in ipairs(views) do add_new(items, view.item) end
  return items
end

-- Filters

-- Any of some terms, of which there is one at least.
local function alternatives(terms)
  return #terms == 1 and terms[1] or "((" .. concat(terms, ") || (") .. "))"
end

-- `FIELD == 7`, `FIELD in {7, 9}`; nil without numbers.
local function among(field, numbers)
  local texts = mapped(numbers, integer)
  if #texts < 2 then return texts[1] and field .. " == " .. texts[1] end
  return field .. " in {" .. concat(texts, ", ") .. "}"
end

--- All frames of these transactions.
function M.transaction_filter(items)
  return among("ds47.transaction", mapped(items, function(item) return item.id end))
end

-- One drive: a station, or an address in the field that the packet has for it.
local function device_term(item, fields)
  if item.station then return "ds47.station == " .. integer(item.station) end
  if not item.device then return nil end
  local mac = item.device:find(":", 1, true) and fields["ds47.device.mac"]
  local name = mac and "ds47.device.mac" or "ds47.device"
  return name .. " == " .. item.device
end

--- All frames of the drives of these transactions; nil where none has an address.
-- @param fields of the packet, by their names
function M.drive_filter(items, fields)
  local terms = {}
  for _, item in ipairs(items) do add_new(terms, device_term(item, fields)) end
  return terms[1] and alternatives(terms)
end

-- How a request reaches its parameter, as a filter: by the submodule, or by the axis byte.
local function way_term(item)
  local access, terms = drive_objects.access_of(item), {}
  local function add(field, value)
    if value then terms[#terms + 1] = format("ds47.%s == %s", field, integer(value)) end
  end
  if item.channel == "pkw" then terms[1] = "ds47.pkw" end
  add("index", item.index)
  add("slot", item.slot)
  add("subslot", item.subslot)
  add("axis", access.axis)
  return concat(terms, " && ")
end

local function last_of(parameter)
  return parameter.subindex + math.max(parameter.element_count or 1, 1) - 1
end

local function overlap(one, other)
  if one.subindex == nil or other.subindex == nil then return false end
  return one.subindex <= last_of(other) and other.subindex <= last_of(one)
end

-- The ways by which requests reach the same parameter, in all of the capture, and the subindices from which
-- on they ask for one of its elements.
local function requests_for(parameter, item, result, shown)
  local access, ways, subindices = drive_objects.access_of(item), {}, {}
  add_new(ways, way_term(item))
  add_new(subindices, parameter.subindex)
  for _, other in ipairs(result.transactions) do
    for _, each in ipairs(other.parameters) do
      if each.pnu == parameter.pnu and shown:same(access, drive_objects.access_of(other), each.pnu) then
        add_new(ways, way_term(other))
        add_new(subindices, overlap(each, parameter) and each.subindex or nil)
      end
    end
  end
  table.sort(subindices)
  return ways, subindices
end

-- `ds47.pnu == 1120 && ds47.subindex == 0 && ...`; frames have a parameter in a request and in its response.
local function parameter_term(parameter, item, result, shown)
  local ways, subindices = requests_for(parameter, item, result, shown)
  local terms = { "ds47.pnu == " .. integer(parameter.pnu) }
  if #subindices <= MOST_TERMS then terms[#terms + 1] = among("ds47.subindex", subindices) end
  if #ways <= MOST_TERMS then terms[#terms + 1] = alternatives(ways) end
  return concat(terms, " && ")
end

--- The frames in which the parameters of these transactions stand, of the same drive objects as far as the
-- capture proves which those are.
-- @param fields  of the packet, by their names
-- @param result  the complete result (Analysis:ended)
-- @return a filter; nil where there is no parameter, or no address of the drive
function M.parameter_filter(items, fields, result)
  local shown, of_drives = drive_objects.of(result.transactions), {}
  for _, item in ipairs(items) do
    local device, terms = device_term(item, fields), {}
    for _, parameter in ipairs(device and item.parameters or {}) do
      if parameter.pnu then add_new(terms, parameter_term(parameter, item, result, shown)) end
    end
    if terms[1] then add_new(of_drives, device .. " && " .. alternatives(terms)) end
  end
  return of_drives[1] and alternatives(of_drives)
end

-- Requests to paste

--- The requests of these transactions as lines that `ds47 encode` takes ("encode"), or as SCL ("scl").
-- @return the text; or nil and what to say instead
function M.copied(items, kind, lang)
  local texts, problem = {}, say(lang, "menu_no_request")
  for _, item in ipairs(items) do
    if item.request then
      local text
      if kind == "scl" then
        text = suggest.scl(item.request)
      else
        local family = item.parameters[1] and item.parameters[1].family
        text = item.channel == "pkw" and suggest.pkw_command(item.request, item.layout, family)
          or item.channel ~= "pkw" and suggest.encode_command(item.request, family)
      end
      if text then
        texts[#texts + 1] = text
      else
        problem = say(lang, "menu_no_line", { bytes = reader.hex(item.request) })
      end
    end
  end
  if texts[1] == nil then return nil, problem end
  return concat(texts, "\n")
end

--- What to send instead of the requests of transactions, as SCL, where their findings prove something.
-- @return the text; or nil and what to say instead
function M.instead(findings, lang)
  local requests = {}
  for _, finding in ipairs(findings) do add_new(requests, finding.corrected) end
  local texts = mapped(requests, suggest.scl)
  if texts[1] == nil then return nil, say(lang, "menu_no_instead") end
  return concat(texts, "\n")
end

-- Statuses

-- The error numbers of the parameters of a transaction, each once.
local function add_errors(lines, item, lang)
  local seen = {}
  for _, each in ipairs(item.parameters) do
    local failed = each.error
    local key = failed and (failed.code or -1)
    if failed and not seen[key] then
      seen[key] = true
      append(lines, { "", formatting.address(each) .. ":" })
      if failed.code and item.channel == "ds47" then
        local found = meanings.error(failed.code, lang, item.vendor_id)
        append(lines, explanation.lines(found, lang, WIDTH))
      else
        append(lines, formatting.wrap(sentences.error_words(failed, lang), WIDTH))
      end
    end
  end
end

local function add_status(lines, status, lang)
  append(lines, { "" })
  append(lines, explanation.lines({ meanings.status(status, lang) }, lang, WIDTH))
end

-- What ended a transaction: the statuses of its record calls and its error numbers; where there is none of
-- them, what a good status says.
local function add_outcome(lines, item, lang)
  local before = #lines
  for _, key in ipairs({ "write_status", "read_status" }) do
    if item[key] and item[key] ~= 0 then add_status(lines, item[key], lang) end
  end
  add_errors(lines, item, lang)
  if #lines == before and (item.write_status or item.read_status) then add_status(lines, 0, lang) end
end

--- What the statuses and error numbers of views mean, as `ds47 explain` has it.
-- @param own  the status of the frame itself, nil where nobody tells it
function M.explained(views, own, lang)
  local lines = {}
  for _, view in ipairs(views) do
    local item = view.item
    local state = formatting.state(lang, item.state)
    lines[#lines + 1] = lines[1] and "" or nil
    append(lines, formatting.wrap(say(lang, "menu_transaction", {
      number = integer(item.id), state = state, about = say(lang, "about_" .. item.state),
    }), WIDTH))
    if view.role == "poll" and own then
      add_status(lines, own, lang)
    else
      add_outcome(lines, item, lang)
    end
  end
  return concat(lines, "\n") .. "\n"
end

-- What the built-in says of the status of the frame: nil where it is switched off. Its first byte stands in
-- the highest place or in the lowest one, as the byte order of the call is.
local function own_status(fields)
  local status, code = fields["pn_io.status"], fields["pn_io.error_code"]
  if status == nil or code == nil then return nil end
  local bytes = status.source:range(status.offset, 4)
  return code.offset == status.offset and bytes:uint() or bytes:le_uint()
end

-- The fields of a packet by their names, the first of each.
local function by_name(...)
  local fields = {}
  for _, field in ipairs({ ... }) do fields[field.name] = fields[field.name] or field end
  return fields
end

local function show(text) TextWindow.new("DS47"):set(text .. "\n") end

function M.register(track)
  -- `make` is a function of the views, and of the fields by their names. It gives a text for `take`, or nil
  -- and what to say instead.
  local function entry(name, make, take)
    register_packet_menu("DS47/" .. name, function(...)
      local fields = by_name(...)
      local views = track.complete_views(fields["frame.number"].value) or {}
      local text, problem = make(views, fields)
      if text then
        take(text)
      else
        show(problem)
      end
    end, NEEDED)
  end
  local function filter(name, make)
    entry(name, function(views, fields)
      return make(M.transactions(views), fields), say(track.lang, "menu_no_parameter")
    end, function(text)
      set_filter(text)
      apply_filter()
    end)
  end
  local function copy(name, make) entry(name, make, copy_to_clipboard) end
  filter("Only this transaction", M.transaction_filter)
  filter("Only these parameters on this drive object", function(items, fields)
    return M.parameter_filter(items, fields, track.result())
  end)
  filter("Only this drive", M.drive_filter)
  copy("Copy request as ds47 encode line", function(views)
    return M.copied(M.transactions(views), "encode", track.lang)
  end)
  copy("Copy request as SCL", function(views)
    return M.copied(M.transactions(views), "scl", track.lang)
  end)
  copy("Copy what to send instead as SCL", function(views)
    local findings = {}
    for _, view in ipairs(views) do append(findings, track.findings_of(view)) end
    return M.instead(findings, track.lang)
  end)
  entry("Explain this status", function(views, fields)
    return M.explained(views, own_status(fields), track.lang)
  end, show)
end

return M
