#!/usr/bin/env bash
# Newer Pythons, from Debian's packages, each in a folder of its own: build/python/SUITE/root.
# Nothing is installed (debian-root.sh). Kept until broken.
#
#   tools/python-roots.sh               those that are newer than the oldest supported one
#   tools/python-roots.sh forky         some of them
#
# Prints a line per interpreter on stdout: VERSION PROGRAM. Messages go to stderr.
# Exit status: 0 all there; 1 some could not be made; 77 this machine cannot make any (no root, no apt).
set -euo pipefail
cd "$(dirname "$0")/.."
# shellcheck source=tools/debian-root.sh
. tools/debian-root.sh

FOLDER=$PWD/build/python
ALL="trixie forky"

version_of() { "$1" -c 'import platform, venv, ensurepip; print(platform.python_version())' 2>/dev/null; }

# Make ROOT/usr/bin/python3 a program that runs on the root's own loader and libraries, without chroot or
# mounts. It tells Python by which name it was called: so a virtual environment, which has a link to it, is
# found. What Debian's Python and the compiler look for under /usr is in the root.
settle() {
    local root=$1 libraries loader name machine
    libraries=$(echo "$root"/usr/lib/*-linux-gnu*)
    loader=$(find "$root"/lib64/ "$root"/lib/ -maxdepth 1 -name 'ld-linux*.so.*' | head -n 1)
    name=$(basename "$(readlink -f "$root/usr/bin/python3")")
    machine=$(basename "$libraries")
    rm "$root/usr/bin/python3"
    printf '#!/bin/sh\nexec "%s" --library-path "%s" --argv0 "$0" "%s" "$@"\n' \
        "$loader" "$libraries" "$root/usr/bin/$name" >"$root/usr/bin/python3"
    chmod 755 "$root/usr/bin/python3"
    find "$root/usr/lib/$name" -name '_sysconfig*' -type f \
        -exec sed -i "s#\\([\"']\\)/usr/share/python-wheels#\\1$root/usr/share/python-wheels#" {} +
    ln -sfn "../$machine" "$root/usr/include/$name/$machine"
}

provide() {
    local suite=$1 program=$FOLDER/$1/root/usr/bin/python3 found
    if ! found=$(version_of "$program"); then
        make_root "Python of $suite" "$FOLDER/$suite" "$suite" python3-venv libpython3-dev libc-bin || return 1
        settle "$FOLDER/$suite/root"
        if ! found=$(version_of "$program"); then
            say "Python of $suite: does not run"
            return 1
        fi
    fi
    echo "$found $program"
}

# shellcheck disable=SC2086  # a list of words
provide_all Python ${*:-$ALL}
