-- Frames of a capture to the exchanges of a line of PROFIBUS (docs/profibus.md 6).
--
-- Takes the frames of the two link types that carry PROFIBUS; what an exchange is about is the business of
-- those who hear of it.

local line = require("ds47.profibus.line")
local telegram = require("ds47.profibus.telegram")

-- LINKTYPE_PROFIBUS_DL, and the link type that is everybody's own: PROFIBUS where a frame of it proves that.
local M = {PROFIBUS_DL = 257, USER0 = 147}

local PROVES = {SD1 = true, SD2 = true, SD3 = true}

local Bus = {}
Bus.__index = Bus

--- One line of PROFIBUS.
-- @param listeners  array; each hears of every exchange when it is over: listener:take(exchange); and where
--   it wants to of the request of one that waits for its answer: listener:begin(exchange)
function M.new(listeners)
  return setmetatable({
    listeners = listeners,
    proven = false, -- whether a frame with the right check byte was seen: USER0 may be anything
    line = line.Line.new(),
  }, Bus)
end

local function tell(self, name, exchange)
  for _, listener in ipairs(self.listeners) do
    if listener[name] then listener[name](listener, exchange) end
  end
end

--- Whether a frame proves that PROFIBUS is here: it has the right check byte.
-- @param item  what telegram.lua decoded
function M.proves(item) return not item.flaws[1] and PROVES[item.kind] or false end

--- A frame of one of the two link types.
-- @param cut  true: the recording has not all of it
-- @return what telegram.lua decoded; nil where nothing proves that it is a frame
function Bus:take(link_type, data, number, time_ns, cut)
  local item = telegram.decode(data)
  if not self.proven then
    self.proven = link_type == M.PROFIBUS_DL or M.proves(item)
    if not self.proven then return nil end
  end
  local seen = {frame = number, time_ns = time_ns, item = item}
  local over = self.line:take(seen, cut)
  if over then tell(self, "take", over) end
  local open = self.line.open
  if open and open.request == seen then tell(self, "begin", open) end
  return item
end

return M
