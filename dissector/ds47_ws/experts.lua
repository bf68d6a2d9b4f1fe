-- Findings and events of drives as expert infos. Apart from tree.lua, because every file with a drive in it
-- has some, and nobody may look at a tree: what is not loaded is not looked through by the collector.

local info = require("ds47_ws.info")
local tables = require("ds47.spec.tables")
local words = require("ds47.report.formatting")

local M = {}

--- Adds the expert info of a finding: of the drive of a maker whose tables are not known it is a note.
-- @param experts as fields.lua makes them
function M.add_finding(tree, experts, finding, lang)
  local is_note = finding.severity ~= tables.rules[finding.rule].severity
  local key = is_note and finding.rule .. " note" or finding.rule
  tree:add_proto_expert_info(experts[key], words.escape(words.message(finding, lang)))
end

--- The same of an event.
function M.add_event(tree, experts, event, lang)
  local key = event.name == "fault" and "pzd.fault" or "pzd.event"
  tree:add_proto_expert_info(experts[key], info.what({ event }, lang))
end

--- Findings and events as expert infos and nothing else: for a frame of which nobody wants fields.
function M.add(tree, experts, findings, events, lang)
  for _, each in ipairs(events) do M.add_event(tree, experts, each.event, lang) end
  for _, finding in ipairs(findings) do M.add_finding(tree, experts, finding, lang) end
end

return M
