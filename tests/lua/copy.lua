-- The copy of the open state under plain Lua: what is copied, what is shared. Exit status 1 for a failure.

local root = arg[0]:match("^(.*[/\\])[^/\\]*$") or "./"
package.path = root .. "../../lua/?.lua;" .. package.path

local copy = require("ds47.acyclic.copy")
local pairing = require("ds47.acyclic.pairing")
local tables = require("ds47.spec.tables")

local class = {}
local part = {number = 1}
local shared, replaced, instead = {}, {}, {}
local original = setmetatable({
  part = part, again = part, [part] = "key", limits = tables.limits, rule = tables.rules.DS101,
  module = pairing, shared = shared, replaced = replaced, fixed = {}, text = "x",
}, class)
original.itself = original
local made = copy.copy(original, {[shared] = shared, [replaced] = instead}, {fixed = true})

assert(made ~= original and made.itself == made and getmetatable(made) == class)
assert(made.part ~= part and made.part == made.again and made.part.number == 1)
assert(made[made.part] == "key" and made[part] == nil)
assert(made.limits == tables.limits and made.rule == tables.rules.DS101 and made.module == pairing)
assert(made.shared == shared and made.replaced == instead and made.fixed == original.fixed)
assert(made.text == "x")

local chain, length = {}, 300000
local last = chain
for _ = 1, length do
  last.after = {}
  last = last.after
end
local link, count = copy.copy(chain, {}, {}), 0
while link.after do
  link, count = link.after, count + 1
end
assert(count == length)
print("ok")
