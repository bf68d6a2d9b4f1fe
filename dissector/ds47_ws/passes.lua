-- Whether tshark showed in one pass what a second one knows more of, and the line on stderr that says so.
--
-- A frame that comes again is shown with everything (track.lua). Whoever asked for what only later frames say
-- (the state of a transaction) and got frames but once is told, at the end and once; in a window nobody is.

local words = require("ds47.report.formatting")

local M = {}

--- Forgets all: another file.
function M.reset()
  M.partly = false -- whether a transaction was shown of which later frames may say more
  M.again = false -- whether a frame came again
  M.blind = nil -- whether new frames had come before, in a first pass without fields; nil before the first
end

M.reset()

--- The capture is over: says what is missing above, if something is.
function M.finish(lang)
  if M.partly and not M.again then
    io.stderr:write("ds47: ", words.say(lang, M.blind and "blind_pass" or "one_pass"), "\n")
  end
  M.reset()
end

return M
