-- The memory of the diagnoses against a plain one that is sorted by age: put, get, forgetting, and one that
-- goes on alone. Prints "ok".

local root = arg[0]:match("^(.*[/\\])[^/\\]*$") or "./"
package.path = root .. "../../lua/?.lua;" .. package.path

local memory = require("ds47.diagnosis.memory")

local LIMIT, ROUNDS, STEPS = 7, 400, 60
local DEVICES, NUMBERS = 3, 5

-- The plain one: an array of {device, number, value}, the oldest first.
local function put(plain, device, number, value)
  for place, entry in ipairs(plain) do
    if entry[1] == device and entry[2] == number then
      table.remove(plain, place)
      break
    end
  end
  plain[#plain + 1] = {device, number, value}
  if #plain > LIMIT then
    table.remove(plain, 1)
  end
end

local function get(plain, device, number)
  for _, entry in ipairs(plain) do
    if entry[1] == device and entry[2] == number then
      return entry[3]
    end
  end
  return nil
end

local function copied(plain)
  local result = {}
  for place, entry in ipairs(plain) do
    result[place] = entry
  end
  return result
end

local function same(tested, plain, where)
  for device = 1, DEVICES do
    for number = 1, NUMBERS do
      local found, wanted = tested:get("d" .. device, number), get(plain, "d" .. device, number)
      if found ~= wanted then
        error(("%s: d%d %d is %s, not %s"):format(where, device, number, tostring(found), tostring(wanted)))
      end
      local own = tested:of("d" .. device)[number]
      if own ~= wanted then
        error(("%s: of d%d %d is %s, not %s"):format(where, device, number, tostring(own), tostring(wanted)))
      end
    end
  end
  assert(tested.order.length == #plain, where .. ": length")
end

local function step(tested, plain)
  local device, number = "d" .. math.random(DEVICES), math.random(NUMBERS)
  local value = math.random(100)
  tested:put(device, number, value)
  put(plain, device, number, value)
end

math.randomseed(47)
for round = 1, ROUNDS do
  local tested, plain = memory.new(LIMIT), {}
  for number = 1, STEPS do
    step(tested, plain)
    same(tested, plain, ("round %d, step %d"):format(round, number))
    if number % 10 == 0 then
      local other, alone = tested:apart(), copied(plain)
      for further = 1, math.random(2 * LIMIT) do
        step(other, alone)
        same(other, alone, ("round %d, step %d, %d alone"):format(round, number, further))
      end
      same(tested, plain, ("round %d, step %d, the first"):format(round, number))
    end
  end
end
print("ok")
