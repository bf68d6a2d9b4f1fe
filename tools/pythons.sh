#!/usr/bin/env bash
# Run the tests of the analyzer on newer Pythons than the one that everything else runs on. Those of the
# plugin (test_wireshark_*, test_lua_*) are left out: they do not depend on the Python that starts them.
#
#   tools/pythons.sh [--must] [SUITE...] [-- what pytest is told]
#
# The interpreters are those of tools/python-roots.sh, each with a virtual environment beside it. Without
# root they cannot be made: that is said, and with --must it fails.
set -euo pipefail
cd "$(dirname "$0")/.."

CANNOT=77 # exit status of python-roots.sh where none can be made at all
must=0 suites=()
while [ $# -gt 0 ]; do
    case $1 in
        --must) must=1 ;;
        --) shift; break ;;
        *) suites+=("$1") ;;
    esac
    shift
done

status=0
lines=$(tools/python-roots.sh "${suites[@]}") || status=$?
if [ "$status" -eq "$CANNOT" ]; then exit "$must"; fi
failed=$status
while read -r version program; do
    [ -n "$version" ] || continue # none could be made
    venv=build/python/venv-$version
    echo "== Python $version"
    make --no-print-directory VENV="$venv" PYTHON="$program" venv
    "$venv/bin/python" -m pytest --ignore-glob='*/test_wireshark_*' --ignore-glob='*/test_lua_*' "$@" || failed=1
done <<<"$lines"
exit "$failed"
