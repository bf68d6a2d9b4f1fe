# Programs of another Debian suite beside this machine's own: their packages are fetched and unpacked into a
# folder, nothing is installed. To be sourced, by bash with errexit; messages go to stderr.
# The mirror is the one this machine's apt uses (DEBIAN_MIRROR=URI names another, for example an archive).
# Not here: how a program in such a folder is run (wireshark-roots.sh, pythons.sh).
# shellcheck shell=bash

CANNOT=77 # exit status where this machine cannot make any
KEYRING=/usr/share/keyrings/debian-archive-keyring.gpg

say() { echo "$*" >&2; }

# Call `provide SUITE`, which prints a line, for each suite, and exit: 0 all there; 1 some could not be made;
# 77 this machine cannot make any: provide_all WHAT SUITE...
provide_all() {
    local what=$1 suite status=0
    shift
    if [ "$(id -u)" -ne 0 ] || ! command -v apt-get >/dev/null || ! command -v dpkg-deb >/dev/null ||
        [ ! -r "$KEYRING" ]; then
        say "Other versions of $what are made only as root, on a Debian with apt."
        exit "$CANNOT"
    fi
    for suite in "$@"; do provide "$suite" || status=1; done
    exit $status
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

# Fetch packages of a suite and all they need into $1/cache/archives, with an apt that knows nothing of this
# machine: download WORK SUITE PACKAGE...
download() {
    local work=$1 suite=$2
    shift 2
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
    APT_CONFIG=$work/apt.conf apt-get -qq -y --no-install-recommends --download-only install "$@"
}

# What no test looks at, and half of the size.
LEAVE_OUT="--exclude=./usr/share/doc --exclude=./usr/share/man --exclude=./usr/share/locale --exclude=*/extcap/*"

# Unpack what was fetched: unpack WORK ROOT
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

# Make FOLDER/root, with packages of a suite and all they need; leaves nothing behind when that fails:
# make_root WHAT FOLDER SUITE PACKAGE...
make_root() {
    local what=$1 here=$2 suite=$3 log=$2.log start=$SECONDS
    shift 3
    rm -rf "$here"
    mkdir -p "$here/work"
    say "$what: fetching the packages of $suite (some 60 MB) ..."
    if ! { download "$here/work" "$suite" "$@" && unpack "$here/work" "$here/root"; } >"$log" 2>&1; then
        tail -n 8 "$log" >&2
        say "$what: $suite cannot be had from $(mirror); the log is $log. DEBIAN_MIRROR=URI names another mirror."
        rm -rf "$here"
        return 1
    fi
    rm -rf "$here/work" "$log"
    say "$what: made in $((SECONDS - start)) s"
}
