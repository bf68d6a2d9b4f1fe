#!/usr/bin/env bash
# Takes the pictures of the documentation: real Wireshark with the plugin and the profile of this checkout,
# on a display that nobody sees. Installs nothing; says which packages are missing.
#
#   tools/screenshot.sh [CAPTURE [FRAME [NAME]]]    default: captures/tour-machine.pcapng, frame 33
#
# Writes docs/images/wireshark.png and docs/images/wireshark-statistics.png (DS47_IMAGES=FOLDER: elsewhere); with a
# NAME one picture alone, docs/images/NAME.png.
# Wireshark runs as an ordinary user: as root 4.4 and later load no plugin. Exit status: 0 taken; 1 not.
set -euo pipefail
cd "$(dirname "$0")/.."

CAPTURE=${1:-captures/tour-machine.pcapng}
FRAME=${2:-33} # a Read response
NAME=${3:-}
IMAGES=${DS47_IMAGES:-docs/images}
USER_FOR_ROOT=nobody
WIDTH=1400 HEIGHT=1060 # of the window
LIST=358               # height of the packet list

say() { echo "screenshot: $*" >&2; }

missing=
for each in wireshark:wireshark Xvfb:xvfb import:imagemagick xdotool:xdotool; do
    command -v "${each%%:*}" >/dev/null || missing="$missing ${each##*:}"
done
if [ -n "$missing" ]; then
    say "these packages are missing:$missing"
    say "on Debian: apt-get install --no-install-recommends$missing"
    exit 1
fi

work=$(mktemp -d)
wireshark='' xvfb=''
clean() {
    for each in $wireshark $xvfb; do kill "$each" 2>/dev/null || true; done
    wait 2>/dev/null || true
    rm -rf "$work"
}
trap clean EXIT

# A copy, because the ordinary user may not be allowed to look into the checkout.
home=$work/home
settings=$home/.config/wireshark
mkdir -p "$settings/profiles/DS47" "$work/run" "$IMAGES"
cp -r dissector lua "$work/run"
cp "$CAPTURE" "$work/run/"
cp dissector/profile/* "$settings/profiles/DS47/"
cat >>"$settings/profiles/DS47/recent" <<END
gui.geometry_main_upper_pane: $LIST
gui.geometry_main_lower_pane: 840
END
cat >"$settings/recent_common" <<END
gui.geometry_main_x: 0
gui.geometry_main_y: 0
gui.geometry_main_width: $WIDTH
gui.geometry_main_height: $HEIGHT
END
as_user=()
if [ "$(id -u)" -eq 0 ]; then
    chown -R "$USER_FOR_ROOT" "$work"
    as_user=(runuser -u "$USER_FOR_ROOT" --)
fi
chmod 711 "$work"
chmod 700 "$home"

# The server says which number is free.
mkfifo "$work/display"
Xvfb -displayfd 3 -screen 0 "$((WIDTH + 40))x$((HEIGHT + 40))x24" -nolisten tcp 3>"$work/display" 2>/dev/null &
xvfb=$!
read -r number <"$work/display"
export DISPLAY=:$number

"${as_user[@]}" env HOME="$home" XDG_CONFIG_HOME="$home/.config" XDG_RUNTIME_DIR="$home" LC_ALL=C.UTF-8 TZ=UTC \
    QT_QPA_PLATFORM=xcb wireshark -o gui.update.enabled:FALSE -C DS47 \
    -X "lua_script:$work/run/dissector/ds47.lua" -r "$work/run/$(basename "$CAPTURE")" -g "$FRAME" \
    >"$work/log" 2>&1 &
wireshark=$!

# The id of a window by its title, waiting for it.
window() {
    local id
    for _ in $(seq 60); do
        id=$(xdotool search --onlyvisible --name "$1" 2>/dev/null | tail -n 1) && [ -n "$id" ] && echo "$id" && return
        kill -0 "$wireshark" 2>/dev/null || break
        sleep 0.5
    done
    say "no window named $1"
    cat "$work/log" >&2
    return 1
}

keys() {
    xdotool key --delay 80 "$@"
    sleep 0.6
}

# A picture of a window, few colours, without what would make two runs differ.
picture() {
    import -window "$1" "$work/shot.png"
    convert "$work/shot.png" +dither -colors 128 -strip -define png:compression-level=9 "$IMAGES/$2"
    say "wrote $IMAGES/$2 ($(wc -c <"$IMAGES/$2") bytes)"
}

main=$(window "$(basename "$CAPTURE")")
sleep 2 # until the capture is loaded
xdotool windowsize --sync "$main" "$WIDTH" "$HEIGHT" || true
xdotool windowmove "$main" 0 0
xdotool windowfocus "$main"
sleep 1

# The list a little further, so that what follows is seen too. In the tree: to the last protocol, which is
# ours, open all of it, and turn the wheel until it stands at the top.
xdotool mousemove 300 300 click --repeat 4 --delay 80 5
xdotool mousemove 300 $((HEIGHT - 60)) click 1
sleep 0.5
keys Home End
if [ -n "$NAME" ]; then # the one before it is that of the frame: open both, and stand at the top
    keys Up
    keys shift+Right
    keys End Right
    keys Home Down
else
    keys shift+Right
    xdotool click --repeat 2 --delay 80 5
fi
xdotool mousemove $((WIDTH - 5)) $((HEIGHT - 5))
sleep 0.5
picture "$main" "${NAME:-wireshark}.png"
if [ -n "$NAME" ]; then
    if grep -E "Lua Error|Error during loading" "$work/log" >&2; then exit 1; fi
    exit 0
fi

# Tools > DS47 > Statistics: the last entry of the second menu from the end.
keys alt+t
keys Up Up
keys Right Up Return
statistics=$(window "DS47 statistics")
xdotool windowmove "$statistics" 0 0
xdotool windowsize --sync "$statistics" 900 980 || true
sleep 1
picture "$statistics" wireshark-statistics.png
if grep -E "Lua Error|Error during loading" "$work/log" >&2; then exit 1; fi
