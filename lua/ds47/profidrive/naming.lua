-- How the number of a parameter is written (Python: ds47.profidrive.naming).
--
-- The letter is a habit of Siemens, as are the four digits: `p` may be written, `r` may only be read. On the
-- wire there is the number alone; which parameters may only be read is in the tables of spec, and any other
-- is a `p`.

local tables = require("ds47.spec.tables")

local format = string.format

local M = {}

local BARE = 60000 -- from here on numbers are those of profiles, which have no letter

--- A number as it is printed: `p0010`, `r0945`, `p50303`, `61000`.
function M.spelling(number)
  if number >= BARE then return format("%d", number) end
  return format(tables.read_only[number] and "r%04d" or "p%04d", number)
end

--- One element of a parameter: `r0945[0]`.
function M.element(number, subindex)
  return format("%s[%d]", M.spelling(number), subindex)
end

return M
