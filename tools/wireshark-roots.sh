#!/usr/bin/env bash
# Other versions of tshark, from Debian's packages, each in a folder of its own: build/wireshark/SUITE/root.
# Nothing is installed (debian-root.sh). Kept until broken.
#
#   tools/wireshark-roots.sh            the four versions of the matrix
#   tools/wireshark-roots.sh trixie     some of them
#
# Prints a line per version on stdout: SERIES VERSION LUA PROGRAM, where PROGRAM is a tshark to call. A
# series that this machine's own tshark has is not fetched. Messages go to stderr.
# Exit status: 0 all there; 1 some could not be made; 77 this machine cannot make any (no root, no apt).
set -euo pipefail
cd "$(dirname "$0")/.."

# shellcheck source=tools/debian-root.sh
. tools/debian-root.sh

FOLDER=$PWD/build/wireshark
ALL="bullseye bookworm trixie forky"

series_of() {
    case $1 in
        bullseye) echo 3.4 ;;
        bookworm) echo 4.0 ;;
        trixie) echo 4.4 ;;
        forky) echo 4.6 ;;
        *) say "no such suite in the matrix: $1"; exit 2 ;;
    esac
}

# What `tshark -v` of a program says: its version and that of its Lua, "4.4.18 5.4.7".
about() {
    local text
    text=$(HOME=/nonexistent "$1" -v 2>/dev/null) || return 1
    printf '%s %s\n' \
        "$(sed -nE '1s/^TShark \(Wireshark\) ([0-9]+(\.[0-9]+)*).*/\1/p' <<<"$text")" \
        "$(tr '\n' ' ' <<<"$text" | sed -nE 's/.*Lua:? +([0-9]+(\.[0-9]+)*).*/\1/p')"
}

# The program that runs a root's tshark (or, with /, this machine's) as an ordinary user.
wrapper() {
    local root=$1 program=$2
    mkdir -p "$(dirname "$program")"
    printf '#!/bin/sh\nexec "%s" "%s" "$@"\n' "$PWD/tools/tshark-in-root.sh" "$root" >"$program.part"
    chmod 755 "$program.part"
    mv "$program.part" "$program"
}

# The line of a suite, from this machine's own tshark, the root made before, or a new root.
provide() {
    local suite=$1 series program found
    series=$(series_of "$suite")
    if command -v tshark >/dev/null && found=$(about "$(command -v tshark)") && [[ $found == $series.* ]]; then
        program=$FOLDER/own/tshark
        wrapper / "$program"
    else
        program=$FOLDER/$suite/tshark
        found=$(about "$program" 2>/dev/null) || found=
        if [[ $found != $series.*\ * ]]; then
            make_root "tshark $series" "$FOLDER/$suite" "$suite" tshark libc-bin base-files || return 1
            wrapper "$FOLDER/$suite/root" "$program"
            found=$(about "$program") || found=
        fi
        tools/dumpcap-in-root.sh "$FOLDER/$suite/root"
    fi
    if [[ $found != $series.*\ * ]]; then
        say "tshark $series: $suite now has '$found': the matrix in tools/wireshark-roots.sh needs another suite"
        return 1
    fi
    echo "$series $found $program"
}

# shellcheck disable=SC2086  # a list of words
provide_all tshark ${*:-$ALL}
