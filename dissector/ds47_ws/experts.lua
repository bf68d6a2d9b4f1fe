-- Findings and events of drives as expert infos. Apart from tree.lua, because every file with a drive in it
-- has some, and nobody may look at a tree: what is not loaded is not looked through by the collector.

local info = require("ds47_ws.info")
local tables = require("ds47.spec.tables")
local words = require("ds47.report.formatting")

local M = {}

--- The key of the expert info of a finding: of the drive of a maker whose tables are not known it is a note.
function M.key_of(finding)
  if finding.severity ~= tables.rules[finding.rule].severity then
    return finding.rule .. " note"
  end
  return finding.rule
end

--- What the expert info of a finding says.
function M.of_finding(finding, lang)
  return words.escape(words.message(finding, lang))
end

--- The key of the expert info of an event, and what it says.
function M.of_event(event, lang)
  return event.name == "fault" and "pzd.fault" or "pzd.event", info.what({ event }, lang)
end

--- Findings and events as expert infos and nothing else: for a frame of which nobody wants fields.
-- @param experts as fields.lua makes them
function M.add(tree, experts, findings, events, lang)
  for _, each in ipairs(events) do
    local key, text = M.of_event(each.event, lang)
    tree:add_proto_expert_info(experts[key], text)
  end
  for _, finding in ipairs(findings) do
    tree:add_proto_expert_info(experts[M.key_of(finding)], M.of_finding(finding, lang))
  end
end

return M
