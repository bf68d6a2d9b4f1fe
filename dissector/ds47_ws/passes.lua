-- Whether tshark showed in one pass what a second one knows more of, and the line on stderr that says so.
--
-- A frame that comes again is shown with everything (track.lua). Whoever asked for what only later frames say
-- (the state of a transaction) and got frames but once is told, at the end and once; in a window nobody is.

local words = require("ds47.report.formatting")

local M = {}

local partly -- whether a transaction was shown of which later frames may say more
local again -- whether a frame came again
local blind -- whether the frames came in a second pass for the first time: the first one had no fields; nil
-- before the first

--- Forgets all: another file.
function M.reset()
  partly, again, blind = false, false, nil
end

M.reset()

--- A transaction was shown of which later frames may say more.
function M.shown_partly()
  partly = true
end

--- A frame came again.
function M.came_again()
  again = true
end

--- A new frame comes.
-- @param pinfo what Wireshark knows of it: whether it has dissected it before, without fields
function M.came(pinfo)
  if blind == nil then
    blind = pinfo.visited
  end
end

--- The capture is over: says what is missing above, if something is.
function M.finish(lang)
  if partly and not again then
    io.stderr:write("ds47: ", words.say(lang, blind and "blind_pass" or "one_pass"), "\n")
  end
  M.reset()
end

return M
