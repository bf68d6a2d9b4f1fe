-- What a mirror port's copy of a frame shows: that it is one, and a link to the frame that was captured
-- first.
--
-- The message itself stands there; a copy is no frame of `ds47`, so that a filter finds each message once.
-- Which frame is a copy of which is told by track.lua.

local words = require("ds47.report.formatting")

local M = {}

-- `duplicate of frame 62`.
local function text(original, lang)
  return words.say(lang, "duplicate", { frame = words.integer(original) })
end

--- Sets the columns of a copy.
function M.set_columns(columns, original, lang)
  columns.protocol, columns.info = "DS47", text(original, lang)
end

--- Adds the link.
-- @param tree the tree of the frame
-- @param proto the protocol of copies
-- @param field ds47.duplicate_of
-- @param original number of the frame that was captured first
function M.add(tree, proto, field, original, lang)
  local root = tree:add(proto, "DS47 " .. text(original, lang))
  root:add(field, original):set_generated()
end

return M
