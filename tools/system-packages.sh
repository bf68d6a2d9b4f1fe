#!/bin/sh
# Installs what the tests need from the system: tshark and capinfos, Lua 5.2 to 5.4 and luacheck for the
# plugin, Chromium for the HTML report, Firefox and npm for the page that has the analyzer in it, and venv
# where Python lacks it.
# As root on Debian and its relatives it installs, on a terminal only if the user says so (YES=1: without asking);
# elsewhere it says what is missing and goes on.
# Usage: system-packages.sh PYTHON VENV_PYTHON
python=$1
venv_python=$2
missing=

need() { missing="$missing $1"; }

command -v tshark >/dev/null 2>&1 || need tshark
command -v capinfos >/dev/null 2>&1 || need wireshark-common
for lua in lua5.2 lua5.3 lua5.4; do command -v "$lua" >/dev/null 2>&1 || need "$lua"; done
command -v luacheck >/dev/null 2>&1 || need lua-check
command -v chromium >/dev/null 2>&1 || need chromium
command -v chromedriver >/dev/null 2>&1 || need chromium-driver
command -v firefox-esr >/dev/null 2>&1 || command -v firefox >/dev/null 2>&1 || need firefox-esr
command -v npm >/dev/null 2>&1 || need npm
if [ ! -x "$venv_python" ] && ! "$python" -c 'import venv, ensurepip' 2>/dev/null; then
    need python3-venv
fi
[ -z "$missing" ] && exit 0

if [ "$(id -u)" -ne 0 ] || ! command -v apt-get >/dev/null 2>&1; then
    echo "Not installed:$missing. Tests that need them are skipped; as root: apt-get install$missing" >&2
    exit 0
fi

if [ -t 0 ] && [ -t 2 ] && [ -z "$CI" ] && [ "$YES" != 1 ]; then
    printf 'The tests need these packages of the system:%s. Install them? [Y/n] ' "$missing" >&2
    read -r answer
    case $answer in
        [Nn]*) echo "Going on without; tests that need them are skipped." >&2; exit 0 ;;
    esac
fi
echo "Installing:$missing ..." >&2
export DEBIAN_FRONTEND=noninteractive
log=$(mktemp)
# shellcheck disable=SC2086  # a list of words
if { apt-get update && apt-get install --yes --no-install-recommends $missing; } >"$log" 2>&1 </dev/null; then
    rm -f "$log"
else
    tail -n 20 "$log" >&2
    rm -f "$log"
    echo "Could not install:$missing. Going on without." >&2
fi
exit 0
