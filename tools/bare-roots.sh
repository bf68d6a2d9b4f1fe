#!/usr/bin/env bash
# Folders with a bare Debian each, to try a release in: build/bare/NAME/root. Nothing is installed (debian-root.sh).
#
#   tools/bare-roots.sh                       all of them
#   tools/bare-roots.sh python wheelhouse     some of them
#
#   python       Python and nothing else, not even a shell, the oldest that ds47 takes
#   wheelhouse   the same Python with venv
#   chromium     the browser and what it needs itself
#   firefox      likewise
#   base         Python with pip and a shell: in place of the image that the Containerfile begins with
#   buildah      what builds images
#   wine         what runs programs for Windows (tools/windows.py); not among "all"
#
# Prints a line per root on stdout: NAME FOLDER. Messages go to stderr.
# Exit status: 0 all there; 1 some could not be made; 77 this machine cannot make any (no root, no apt).
# Not here: what is tried in them (release/try_release.py).
set -euo pipefail
cd "$(dirname "$0")/.."

# shellcheck source=tools/debian-root.sh
. tools/debian-root.sh

FOLDER=$PWD/build/bare
ALL="python wheelhouse chromium firefox base buildah"

# The suite of a root and its packages.
packages() {
    case $1 in
        python) echo bookworm python3 ;;
        wheelhouse) echo bookworm python3-venv ;;
        chromium) echo bookworm chromium ;;
        firefox) echo bookworm firefox-esr ;;
        base) echo trixie python3-venv ca-certificates dash coreutils ;;
        buildah) echo trixie buildah netavark ;;
        wine) echo trixie wine64 wine dash coreutils ;;
        *) say "no such root: $1"; exit 2 ;;
    esac
}

# What the scripts of packages would have done, had they been installed.
settle() {
    local name=$1 root=$2
    case $name in
        base) # its pip reads the certificates, even without network
            mkdir -p "$root/etc/ssl/certs"
            cat "$root"/usr/share/ca-certificates/mozilla/*.crt >"$root/etc/ssl/certs/ca-certificates.crt"
            env -i PATH=/usr/bin:/bin "$(command -v chroot)" "$root" /usr/bin/python3 -m venv /usr/local
            ;;
        buildah)
            echo root:x:0:0:root:/root:/bin/sh >"$root/etc/passwd"
            echo root:x:0: >"$root/etc/group"
            mkdir -p "$root/var/tmp" "$root/sys"
            ;;
        wine) cp "$root"/usr/x86_64-w64-mingw32/lib/zlib1.dll "$root"/usr/lib/x86_64-linux-gnu/wine/x86_64-windows/ ;;
    esac
}

provide() {
    local name=$1 root=$FOLDER/$1/root
    if [ ! -e "$FOLDER/$name/.made" ]; then
        # shellcheck disable=SC2046  # a list of words
        make_root "bare $name" "$FOLDER/$name" $(packages "$name") libc-bin base-files || return 1
        settle "$name" "$root" || return 1
        touch "$FOLDER/$name/.made"
    fi
    echo "$name $root"
}

# shellcheck disable=SC2086  # a list of words
provide_all "bare systems" ${*:-$ALL}
