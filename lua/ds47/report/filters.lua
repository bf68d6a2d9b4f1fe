--- Wireshark display filters for frames, in the form that every version from 3.4 on takes (Python:
-- ds47.report.filters).

local integer = require("ds47.report.formatting").integer

local M = {}

M.RUNS_PER_FILTER = 60 -- frames, or runs of frames that follow each other, that one filter names

-- Frames as an array of {first, last}, sorted.
local function runs_of(frames)
  local list, runs = {}, {}
  for number, frame in ipairs(frames) do
    list[number] = frame
  end
  table.sort(list)
  for _, frame in ipairs(list) do
    local run = runs[#runs]
    if run and frame <= run[2] + 1 then
      run[2] = frame
    else
      runs[#runs + 1] = { frame, frame }
    end
  end
  return runs
end

--- A display filter for these frames, and how many of them it had to leave out.
-- Sets of one element only, joined by `or`: of `{1 2}` and `{1, 2}` Wireshark 3.4 knows the first and 4.0 the
-- second.
function M.display_filter(frames)
  local terms, left_out = {}, 0
  for number, run in ipairs(runs_of(frames)) do
    local first, last = integer(run[1]), integer(run[2])
    if number > M.RUNS_PER_FILTER then
      left_out = left_out + run[2] - run[1] + 1
    elseif first == last then
      terms[number] = "frame.number == " .. first
    else
      terms[number] = "frame.number in {" .. first .. ".." .. last .. "}"
    end
  end
  return table.concat(terms, " or "), left_out
end

return M
