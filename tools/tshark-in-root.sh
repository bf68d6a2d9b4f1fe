#!/bin/sh
# Runs the tshark of an unpacked root (tools/wireshark-roots.sh), or with / this machine's own.
# Usage: tshark-in-root.sh ROOT [tshark's arguments]; DS47_PROGRAM=wireshark in front runs that instead
#
# The root's own loader runs it on the root's own libraries, without chroot or mounts: so files keep
# their paths, and a container that forbids both is no obstacle. Started by root it goes on as user 1000,
# because Wireshark 4.4 and later silently load no scripts as root. It keeps the right to enter folders
# that root made for itself (a checkout in /root, the scratch folders of pytest) and no other.
root=$1
shift

# What a start registers is a hundred thousand small pieces of memory: taken in large ones they cost a tenth less.
export GLIBC_TUNABLES=glibc.malloc.hugetlb=1:glibc.malloc.top_pad=67108864:glibc.malloc.mmap_threshold=67108864

if [ "$root" = / ]; then
    set -- "${DS47_PROGRAM:-tshark}" "$@"
else
    libraries=$(echo "$root"/usr/lib/*-linux-gnu*)
    loader=
    for each in "$root"/lib64/ld-linux*.so.* "$root"/lib/ld-linux*.so.*; do
        [ -e "$each" ] && loader=$each && break
    done
    export WIRESHARK_DATA_DIR="$root/usr/share/wireshark"
    export WIRESHARK_PLUGIN_DIR="$libraries/wireshark/plugins"
    export WIRESHARK_EXTCAP_DIR="$root/none"
    export QT_PLUGIN_PATH="$libraries/qt6/plugins"
    export GCONV_PATH="$libraries/gconv" LOCPATH="$root/usr/lib/locale"
    path="$libraries:$libraries/wireshark"
    [ "${DS47_PROGRAM:-tshark}" = tshark ] || path="$path:$libraries/pulseaudio:$libraries/libproxy" # of the window
    set -- "${loader:?none in $libraries}" --library-path "$path" "$root/usr/bin/${DS47_PROGRAM:-tshark}" "$@"
fi
[ "$(id -u)" -eq 0 ] || exec "$@"

capability=-all,+dac_override
exec setpriv --reuid=1000 --regid=1000 --clear-groups --inh-caps=$capability --ambient-caps=$capability \
    --bounding-set=$capability "$@"
