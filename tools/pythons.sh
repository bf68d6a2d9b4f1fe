#!/usr/bin/env bash
# Run the tests of the analyzer on newer Pythons than the one that everything else runs on. Those of the plugin
# (test_wireshark_*, test_lua_*), of pages in a browser, of the auditor, the documentation and the tools are left out: what
# they look at does not depend on the Python that starts them, or is compared byte for byte by the others.
#
#   tools/pythons.sh [--must] [SUITE...] [-- what pytest is told]
#
# The Pythons are from Debian's packages, each in a folder of its own, build/python/SUITE/root, with a virtual
# environment beside it. Nothing is installed (debian-root.sh). Kept until broken. Without root they cannot be
# made: that is said, and with --must it fails.
set -euo pipefail
cd "$(dirname "$0")/.."
# shellcheck source=tools/debian-root.sh
. tools/debian-root.sh

FOLDER=$PWD/build/python

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

must=0 suites=()
while [ $# -gt 0 ]; do
    case $1 in
        --must) must=1 ;;
        --) shift; break ;;
        *) suites+=("$1") ;;
    esac
    shift
done
[ ${#suites[@]} -gt 0 ] || suites=(trixie forky)

failed=0
lines=$(provide_all Python "${suites[@]}") || failed=$?
if [ "$failed" -eq "$CANNOT" ]; then exit "$must"; fi
while read -r version program; do
    [ -n "$version" ] || continue # none could be made
    venv=build/python/venv-$version
    echo "== Python $version"
    make --no-print-directory VENV="$venv" PYTHON="$program" venv
    left_out=()
    for pattern in wireshark_ lua_ audit readme site diagnoses.py upstream matrix_tools house; do left_out+=("--ignore-glob=*/test_$pattern*"); done
    "$venv/bin/python" -m pytest --ignore=tests/browser "${left_out[@]}" "$@" || failed=1
done <<<"$lines"
exit "$failed"
