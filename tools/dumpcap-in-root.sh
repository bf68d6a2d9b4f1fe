#!/bin/sh
# Lets the Wireshark of an unpacked root (tools/wireshark-roots.sh, tools/window-roots.sh) read a live capture.
# Usage: dumpcap-in-root.sh ROOT
#
# Wireshark and tshark start dumpcap, for a pipe as well (`-i -`), from the folder of the program that runs. In such a
# root that is the loader, and there is no dumpcap beside it: this writes one there, which runs the root's own.
set -eu
for loader in "$1"/lib64/ld-linux*.so.* "$1"/lib/ld-linux*.so.*; do
    [ -e "$loader" ] && break
done
loader=$(readlink -f "$loader")
target=$(dirname "$loader")/dumpcap
cat >"$target.part" <<SH
#!/bin/sh
here=\$(dirname "\$0")
exec "\$here/$(basename "$loader")" --library-path "\$here:\$here/wireshark" "\$here/../../bin/dumpcap" "\$@"
SH
chmod 755 "$target.part"
mv "$target.part" "$target"
