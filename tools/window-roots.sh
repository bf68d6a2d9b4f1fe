#!/usr/bin/env bash
# Other versions of Wireshark with its window, from Debian's packages, each in a folder of its own:
# build/window/SUITE/root. Nothing is installed (debian-root.sh). Kept until broken.
#
#   tools/window-roots.sh            trixie (4.4) and forky (4.6)
#   tools/window-roots.sh forky      one of them
#
# Prints a line per version on stdout: VERSION PROGRAM, where PROGRAM is a Wireshark to call, for example by
# screenshots.py. Exit status: 0 all there; 1 some could not be made; 77 this machine cannot make any.
set -euo pipefail
cd "$(dirname "$0")/.."

# shellcheck source=tools/debian-root.sh
. tools/debian-root.sh

FOLDER=$PWD/build/window

version_of() { HOME=/nonexistent "$1" -v 2>/dev/null | sed -nE '1s/^Wireshark ([0-9.]+[0-9]).*/\1/p'; }

provide() {
    local suite=$1 program=$FOLDER/$1/wireshark version
    version=$(version_of "$program") || version=
    if [ -z "$version" ]; then
        [ -x "$FOLDER/$suite/root/usr/bin/wireshark" ] ||
            make_root "Wireshark of $suite" "$FOLDER/$suite" "$suite" wireshark tshark libqt6svg6 libc-bin base-files || return 1
        printf '#!/bin/sh\nDS47_PROGRAM=wireshark exec "%s" "%s" "$@"\n' "$PWD/tools/tshark-in-root.sh" \
            "$FOLDER/$suite/root" >"$program"
        chmod 755 "$program"
        version=$(version_of "$program") || version=
    fi
    [ -n "$version" ] || { say "Wireshark of $suite does not start"; return 1; }
    tools/dumpcap-in-root.sh "$FOLDER/$suite/root"
    echo "$version $program"
}

# shellcheck disable=SC2086  # a list of words
provide_all Wireshark ${*:-trixie forky}
