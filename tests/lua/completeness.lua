-- What is missing of a conversation, asked by a stream of words: lua tests/lua/completeness.lua < LINES
--
-- A line is what is heard, or what is asked; of that one line comes back. test_lua_completeness.py makes them
-- and says what Python says to the same.

local root = arg[0]:match("^(.*[/\\])[^/\\]*$") or "./"
package.path = root .. "../../lua/?.lua;" .. package.path

local completeness = require("ds47.profinet.completeness")

local found, activities

local function told(what)
  if what == nil then return "nothing" end
  return ("%s %s %s %s"):format(what.what, what.first or "-", what.last or "-", what.numbers or "-")
end

local function holes_of(activity)
  local holes = {}
  for _, hole in ipairs(activity.holes) do
    holes[#holes + 1] = ("%d-%d %d..%d"):format(hole.after, hole.before, hole.first, hole.last)
  end
  return table.concat(holes, ", ")
end

local COMMANDS = {
  new = function(pdu) found, activities = completeness.new(pdu.most), {} end,
  add = function(pdu)
    local activity = activities[pdu.activity]
    if activity == nil then
      activity = completeness.numbers(pdu)
      activities[pdu.activity] = activity
    end
    activity:add(pdu, pdu.renewed == 1)
  end,
  began = function(pdu) found:began(pdu, activities[pdu.activity]) end,
  heard = function(pdu) activities[pdu.activity].waited = 1 end,
  unasked = function(pdu) found:unasked(pdu) end,
  cut = function(pdu) found:cut(pdu) end,
  late = function(pdu) found:asked_after_all(pdu) end,
  disordered = function(pdu) found:disordered(pdu) end,
  lost = function(pdu) found:lost(pdu) end,
  behind = function(pdu)
    return told(found:missing_after(pdu.client, pdu.server, pdu.frame, nil, pdu.renewed == 1))
  end,
  spoke = function(pdu) return tostring(found:spoke_ns(pdu.client, pdu.server)) end,
  fills = function(pdu) return tostring(activities[pdu.activity]:fills(pdu.seq)) end,
  has = function(pdu) return tostring(activities[pdu.activity]:has(pdu.seq)) end,
  holes = function(pdu) return holes_of(activities[pdu.activity]) end,
}

for line in io.lines() do
  local pdu = {}
  for name, value in line:gmatch("(%w+)=(%d+)") do
    pdu[name] = math.floor(tonumber(value))
  end
  pdu.client, pdu.server, pdu.time_ns = tostring(pdu.client), tostring(pdu.server), pdu.time
  local said = COMMANDS[line:match("^%w+_?%w*")](pdu)
  if said then print(said) end
end
