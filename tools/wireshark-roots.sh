#!/usr/bin/env bash
# Other versions of tshark, from Debian's packages, each in a folder of its own: build/wireshark/SUITE/root.
# Nothing is installed: apt gets a state of its own, the packages are only unpacked. Kept until broken.
# The mirror is the one this machine's apt uses (DEBIAN_MIRROR=URI names another, for example an archive).
#
#   tools/wireshark-roots.sh            the four versions of the matrix
#   tools/wireshark-roots.sh trixie     some of them
#
# Prints a line per version on stdout: SERIES VERSION LUA PROGRAM, where PROGRAM is a tshark to call. A
# series that this machine's own tshark has is not fetched. Messages go to stderr.
# Exit status: 0 all there; 1 some could not be made; 77 this machine cannot make any (no root, no apt).
set -euo pipefail
cd "$(dirname "$0")/.."

KEYRING=/usr/share/keyrings/debian-archive-keyring.gpg
FOLDER=$PWD/build/wireshark
ALL="bullseye bookworm trixie forky"
# What the tests do not look at, and half of the size.
LEAVE_OUT="--exclude=./usr/share/doc --exclude=./usr/share/man --exclude=./usr/share/locale --exclude=*/extcap/*"

say() { echo "$*" >&2; }

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

mirror() {
    local release
    [ -n "${DEBIAN_MIRROR:-}" ] && { echo "$DEBIAN_MIRROR"; return; }
    # shellcheck source=/dev/null
    release=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")
    # Parses debian.sources as well as sources.list, and knows which of them are switched on.
    apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 'Component: main' "Release: $release" |
        head -n 1
}

# Fetch tshark and all it needs into $1/cache/archives, with an apt that knows nothing of this machine.
download() {
    local work=$1 suite=$2
    mkdir -p "$work"/state/lists/partial "$work"/cache/archives/partial "$work"/etc
    : >"$work/status"
    echo "deb [signed-by=$KEYRING] $(mirror) $suite main" >"$work/etc/sources.list"
    cat >"$work/apt.conf" <<CONF
Dir::State "$work/state";
Dir::State::status "$work/status";
Dir::Cache "$work/cache";
Dir::Etc::sourcelist "$work/etc/sources.list";
Dir::Etc::sourceparts "-";
Dir::Etc::preferencesparts "-";
APT::Sandbox::User "root";
Acquire::Retries "3";
Acquire::Languages "none";
CONF
    APT_CONFIG=$work/apt.conf apt-get -qq update || return 1
    APT_CONFIG=$work/apt.conf apt-get -qq -y --no-install-recommends --download-only install \
        tshark libc-bin base-files
}

unpack() {
    local work=$1 root=$2 part deb link
    mkdir -p "$root"/usr/{bin,sbin,lib,lib64} "$root"/{tmp,proc,dev}
    for part in bin sbin lib lib64; do ln -s "usr/$part" "$root/$part"; done
    for deb in "$work"/cache/archives/*.deb; do
        # shellcheck disable=SC2086  # a list of options
        dpkg-deb --fsys-tarfile "$deb" | tar -x -C "$root" --keep-directory-symlink $LEAVE_OUT || return 1
    done
    # Nobody changes into the root, so a link to /etc/wireshark/init.lua would lead to this machine's.
    find "$root" -type l -lname '/*' | while read -r link; do
        ln -sfnr "$root$(readlink "$link")" "$link"
    done
}

# Make the root of a suite; leaves nothing behind when that fails.
make_root() {
    local suite=$1 here=$FOLDER/$1 log=$FOLDER/$1.log start=$SECONDS
    rm -rf "$here"
    mkdir -p "$here/work"
    say "tshark $(series_of "$suite"): fetching the packages of $suite (some 60 MB) ..."
    if ! { download "$here/work" "$suite" && unpack "$here/work" "$here/root"; } >"$log" 2>&1; then
        tail -n 8 "$log" >&2
        say "tshark $(series_of "$suite"): $suite cannot be had from $(mirror); the log is $log." \
            "DEBIAN_MIRROR=URI names another mirror."
        rm -rf "$here"
        return 1
    fi
    rm -rf "$here/work" "$log"
    wrapper "$here/root" "$here/tshark"
    say "tshark $(series_of "$suite"): made in $((SECONDS - start)) s"
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
            make_root "$suite" || return 1
            found=$(about "$program") || found=
        fi
    fi
    if [[ $found != $series.*\ * ]]; then
        say "tshark $series: $suite now has '$found': the matrix in tools/wireshark-roots.sh needs another suite"
        return 1
    fi
    echo "$series $found $program"
}

if [ "$(id -u)" -ne 0 ] || ! command -v apt-get >/dev/null || ! command -v dpkg-deb >/dev/null ||
    [ ! -r "$KEYRING" ]; then
    say "Other versions of tshark are made only as root, on a Debian with apt."
    exit 77
fi
status=0
# shellcheck disable=SC2086  # a list of words
for suite in ${*:-$ALL}; do provide "$suite" || status=1; done
exit $status
