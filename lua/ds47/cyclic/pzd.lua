-- The control word and the status word: the state of the drive, and what it waits for (docs/cyclic.md 3). One
-- word, or one pair of words, at a time; edges, times and who sent what are not here.

local bits = require("ds47.support.bits")
local tables = require("ds47.spec.tables")

local bit_of = bits.bit

local M = {}

-- Whether a status word is one of a row: of a state, or of what is shown beside it.
local function is_of(word, row) return bits.all(word, row.set) and not bits.any(word, row.clear) end

-- Whether a control word that the drive heeds asks it to switch off.
local function is_stopping(stw1, ending)
  if bit_of(stw1, ending.heeded) == 0 or bits.any(stw1, ending.unless) then return false end
  return not bits.all(stw1, ending.bits)
end

--- The state of a drive by its status word; S5 only with the control word that goes with it.
-- @return its id, and a list of the ids of what is shown beside it
function M.state(zsw1, stw1)
  local ending, found = tables.pzd.stopping, nil
  for _, row in ipairs(tables.pzd.states) do found = found or (is_of(zsw1, row) and row.id) end
  if stw1 and ending.states[found] and is_stopping(stw1, ending) then found = ending.id end
  local overlays = {}
  for _, row in ipairs(tables.pzd.overlays) do
    if is_of(zsw1, row) then overlays[#overlays + 1] = row.id end
  end
  return found, overlays
end

M.REVERSE = 11 -- the bit of STW1 that turns the sign of the setpoint

--- Whether a control word turns the sign of the setpoint; of a drive of `others` nobody knows bit 11.
function M.turns(stw1, others) return not others and bit_of(stw1, M.REVERSE) == 1 end

--- A word as PLC tables print it with a sign.
function M.signed(word) return word < 0x8000 and word or word - 0x10000 end

return M
