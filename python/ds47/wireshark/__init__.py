"""Wireshark from the outside: finding it, installing the plugin into it, checking that it works.

`folders` finds tshark and asks it for its folders, `bundle` makes one file of the plugin, `install`
puts it and the profile there and takes them away again, `doctor` says what is wrong. What runs
inside Wireshark is Lua: the folders dissector/ and lua/ of the repository.
"""
