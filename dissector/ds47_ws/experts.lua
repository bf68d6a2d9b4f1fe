-- Findings and events of drives as expert infos. Apart from tree.lua, because every file with a drive in it
-- has some, and nobody may look at a tree: what is not loaded is not looked through by the collector.
--
-- The text is that of the rule, so that Wireshark counts what has one cause together; what was seen in a
-- frame stands in its tree. How serious each is says spec/wireshark.toml.

local info = require("ds47_ws.info")
local tables = require("ds47.spec.tables")

local M = {}

--- Adds the expert info of a finding. Of the drive of a maker whose tables are not known it is a note, which
-- is none of the registered ones.
-- @param experts as fields.lua makes them
function M.add_finding(tree, experts, finding, lang)
  local rule = tables.rules[finding.rule]
  local title = finding.rule .. " " .. (lang == "zh" and rule.title_zh or rule.title)
  if finding.severity == rule.severity then
    tree:add_proto_expert_info(experts[finding.rule], title)
  else
    local rank = tables.experts.ranks[rule.expert]
    tree:add_expert_info(expert.group[rank.group], expert.severity[rank[finding.severity]], title)
  end
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
