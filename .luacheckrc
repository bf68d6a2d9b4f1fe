-- What luacheck holds the Lua half to: `make lint`, or just `luacheck .`
-- "min" is what Lua 5.1, 5.2, 5.3 and 5.4 have in common; newer syntax and library is an error.
std = "min"
max_line_length = 110
self = false -- a method may have no use for its object: listeners are tables of methods
exclude_files = {".venv", "build", "dist"}

-- Generated, an entry per line however long.
files["lua/ds47/spec/tables.lua"] = {max_line_length = false}

-- Only here may Wireshark be touched. What it has:
files["dissector"] = {
  read_globals = {
    -- dissectors, fields, trees
    "Proto", "ProtoField", "ProtoExpert", "Field", "FieldInfo", "Pref", "Dissector", "DissectorTable",
    "TreeItem", "Column", "Address", "Pinfo", "Tvb", "TvbRange", "ByteArray", "NSTime", "Int64", "UInt64",
    "base", "ftypes", "frametype", "expert", "register_postdissector", "all_field_infos",
    "PI_CHECKSUM", "PI_SEQUENCE", "PI_RESPONSE_CODE", "PI_REQUEST_CODE", "PI_UNDECODED", "PI_REASSEMBLE",
    "PI_MALFORMED", "PI_DEBUG", "PI_PROTOCOL", "PI_ASSUMPTION", "PI_DECRYPTION", "PI_COMMENTS_GROUP",
    "PI_CHAT", "PI_NOTE", "PI_WARN", "PI_ERROR", "PI_COMMENT",
    -- taps, windows, menus
    "Listener", "TextWindow", "ProgDlg", "new_dialog", "register_menu", "gui_enabled", "report_failure",
    "register_packet_menu", -- not in 4.0
    "retap_packets", "get_filter", "set_filter", "apply_filter", "copy_to_clipboard", "open_capture_file",
    "browser_open_url", "browser_open_data_file", "reload_lua_plugins", "GUI_ENABLED",
    "MENU_STAT_UNSORTED", "MENU_STAT_GENERIC", "MENU_STAT_CONVERSATION", "MENU_STAT_ENDPOINT",
    "MENU_STAT_RESPONSE", "MENU_STAT_RESPONSE_TIME", "MENU_ANALYZE_UNSORTED", "MENU_TOOLS_UNSORTED",
    -- the program and its files
    "get_version", "set_plugin_info", "running_superuser", "Dir", "persconffile_path", "datafile_path",
    "USER_DIR", "DATA_DIR", "critical", "warn", "message", "info", "Struct", "bit",
  },
}

-- Plays Wireshark's part, so that what the plugin registers can be printed.
files["tools/site/fields.lua"] = {globals = {"base", "frametype", "expert", "ProtoExpert", "ProtoField"}}

-- Runs in tshark beside the plugin.
files["bench/operations.lua"] = {read_globals = {"Listener"}}
