-- The display filter of a window, which is applied again when all frames are there.
--
-- While frames are dissected anew (a file is opened or read again, times are shifted, a preference changes)
-- and while they are captured, Wireshark asks the filter about each frame as it comes, when the frames behind
-- it are unknown, and keeps the answer: the list leaves out what only they prove, and does not say so.
--
-- Nobody tells a script that reading has ended. But Wireshark draws listeners then, and every few seconds,
-- those that were added or had packets since; so there is always a new one. Where no frame was dissected
-- between two draws, reading is over, or nothing is captured just now. In the midst of reading nothing is
-- applied: Wireshark would begin anew each time.

local collector = require("ds47_ws.collector")
local say = require("ds47.report.formatting").say

local M = {}

-- Frames that may be dissected since the last draw when reading is over: rows of the list, or a short file.
local FEW = 200
-- While frames go on to come, filtering again takes longer, and so it waits for longer silence: draws.
local LONGEST_SILENCE = 5
local IDLE = 20 -- draws without a frame behind which nobody waits for one
local LONG = 20 -- draws after which the window says that the list is not complete

M.wanted = false -- whether a frame came that a filter in force asked about, before later frames were known
local applied, silent, waiting -- how often the filter was applied, draws without a frame, and until it is
local seen -- calls of dissectors when frames began to be dissected anew, or at the last draw
local text -- what stood in the filter field at the last draw
local busy = false -- drawing: a filter that is applied draws too
local newest, former -- listeners
local window -- that says that the list is not complete
local get_lang

--- Forgets all: frames are dissected anew.
function M.reset()
  M.wanted, applied, silent, waiting, seen = false, 0, 0, 0, collector.calls
end

M.reset()

-- Says once that the list is not complete, and then that it is.
local function tell(key)
  if key == "list_partly" and window == nil then window = TextWindow.new("DS47") end
  if window then pcall(window.set, window, say(get_lang(), key) .. "\n") end -- the user may have closed it
end

-- Whether this is a filter of ours, perhaps in a macro.
local function is_ours(filter) return filter:find("ds47", 1, true) or filter:find("$", 1, true) end

-- Whether nobody is typing it: it stood there at the last draw, and Wireshark takes it.
local function is_typed(filter)
  local known, listener = pcall(Listener.new, "frame", filter)
  if known then listener:remove() end
  return known and filter == text
end

-- Whether all frames are there.
local function is_over(came)
  if applied == 0 then return came < FEW end
  return silent >= math.min(applied, LONGEST_SILENCE)
end

local function look()
  local came, filter = collector.calls - seen, get_filter()
  silent = came == 0 and silent + 1 or 0
  if M.wanted and is_ours(filter) then
    if is_over(came) and is_typed(filter) then
      M.wanted, applied, waiting = false, applied + 1, 0
      set_filter(filter) -- without it the filter is cleared
      apply_filter()
      tell("list_complete")
    else
      waiting = waiting + 1
      if waiting == LONG then tell("list_partly") end
    end
  end
  seen, text = collector.calls, filter
end

local listen

local function draw()
  if busy then return end
  busy = true
  look()
  if former then former:remove() end
  former = nil
  if M.wanted or silent < IDLE then listen() end
  busy = false
end

function listen()
  local mine = Listener.new("frame")
  former, newest = newest, mine
  function mine.draw()
    if mine == newest then draw() end
  end
end

--- Begins, in a window alone.
-- @param lang a function that gives the language of texts
function M.begin(lang)
  get_lang = lang
  listen()
end

return M
