-- How the number of a parameter is written (Python: ds47.profidrive.naming).
--
-- The letter is a habit of Siemens, as are the four digits: `p` may be written, `r` may only be read, and
-- MICROMASTER has a capital `P`. On the wire there is the number alone; which parameters of a family of
-- drives may only be read is in the tables of spec, and any other is a `p` (docs/protocol.md D.3).

local tables = require("ds47.spec.tables")

local format = string.format

local M = {}

local BARE = 60000 -- from here on numbers are those of profiles, which have no letter

local WRITABLE = { micromaster = "P%04d" } -- of what may be written, where the letter is no `p`

--- A number as it is printed: `p0010`, `r0945`, `P0700`, `61000`.
-- @param family of the drive that has it (`family_of` of dictionary.lua); nil where no drive is named
function M.spelling(number, family)
  if number >= BARE then return format("%d", number) end
  if tables.read_only[family or "any"][number] then return format("r%04d", number) end
  return format(WRITABLE[family] or "p%04d", number)
end

--- One element of a parameter: `r0945[0]`.
function M.element(number, subindex, family) return format("%s[%d]", M.spelling(number, family), subindex) end

return M
