-- When Lua collects what is not needed any more.
--
-- Every call of a dissector leaves three objects behind, which Wireshark makes and which want to be closed
-- one by one. Left to its own pace the collector lets them pile up to the size of everything that is alive,
-- twice, because what wants to be closed outlives one collection; by then they have pushed Wireshark's own
-- memory, and Lua's, out of the processor's caches, which costs more than collecting. So it is told to
-- collect while the pile still fits there. That is half of what the plugin costs on cyclic frames.
-- Its own pace stays behind that, only slower, for where nobody calls: a plugin that is switched off must
-- not stop the collector of the others.

local collect = collectgarbage

local M = {}

local LOOK_EVERY = 64 -- calls
local YOUNG = _VERSION >= "Lua 5.4" -- knows what was there before, and leaves it alone
local PILE = YOUNG and 80 or 250 -- kB that may pile up between two collections
-- Looking through everything that is alive takes longer the more there is: then more may pile up. What is
-- larger than a cache is out of it anyway: then as much again may.
local PILE_SHARE, LARGE_SHARE, LARGE = 0.15, 1, 8192 -- kB
local OWN_PAUSE = 400 -- per cent of what is alive, where Lua collects all: its own pace
local OWN_YOUNG, OWN_OLD = 100, 100 -- per cent by which that grows, where it collects the young ones

M.calls = 0 -- of dissectors: frames that were dissected
local next_look, enough = LOOK_EVERY, 0

if YOUNG then
  collect("generational", OWN_YOUNG, OWN_OLD)
else
  collect("setpause", OWN_PAUSE)
end

--- Gives back what another file needed: where the young ones are collected, the old ones are looked through
-- only when they have doubled.
function M.collect_all()
  collect()
  local alive = collect("count")
  if alive >= LARGE then -- what was closed just now still counts: the pile would double itself
    collect()
    alive = collect("count")
  end
  enough = alive + math.max(PILE, alive * (alive < LARGE and PILE_SHARE or LARGE_SHARE))
end

local function collect_young()
  -- A step that is larger than what its own pace still allows; then it looks too whether the old ones have
  -- become too many.
  collect("step", math.ceil(collect("count")) * 2)
  enough = collect("count") + PILE
end

local collect_now = YOUNG and collect_young or M.collect_all

--- To be called once for every frame.
function M.called()
  local calls = M.calls + 1
  M.calls = calls
  if calls >= next_look then
    next_look = calls + LOOK_EVERY
    if collect("count") >= enough then collect_now() end
  end
end

return M
