"""Wireshark from the outside: find it, install the plugin, check that it works.

`locate` finds tshark and asks it for its folders. `bundle` makes one file of the plugin. `install`
installs and removes the plugin and the profile. `doctor` says what is wrong. The code inside Wireshark
is Lua: the folders dissector/ and lua/ of the repository.
"""
