"""Putting the plugin and its profile into Wireshark's folders, and taking them away again.

Lives here: writing the files so that a folder is there whole or not at all, knowing later which
files are ours (a list with digests beside them), and why it cannot be done. Not here: what the plugin
consists of (`bundle`), finding the folders (`locate`), judging them (`doctor`), words for people
(`ds47.cli.plugin`).
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from ds47.version import __version__
from ds47.wireshark.bundle import ENTRY, Sources, bundle

FOLDER = "ds47"
"""The plugin's folder in the plugins folder of Wireshark."""
PROFILE = "DS47"
MARKER = "ds47-installed.json"
"""The list of what was installed, beside it: the version, and the digest of each file."""
WINDOW_STATE = frozenset({"recent"})
"""Files of a profile that Wireshark itself writes whenever it is used: no change by the user."""

LISTS = "ds47-parameters.tsv"
"""Lists of parameters of the user, which `ds47 params export --wireshark` writes beside the plugin."""
_GONE = re.compile(rb"^(?:ds47\.s7_|[\"@!].*\bds47(?:_s7\b|\.s7\.)).*$", re.MULTILINE)
"""Rows of a profile that name what an older version of the plugin had: Wireshark tells of each at every start."""
_BUNDLE = re.compile(r"ds47([-_ (].*)?\.lua", re.IGNORECASE)
_NEW, _OLD = ".ds47-new-", ".ds47-old-"


class RefusedError(Exception):
    """Not done, and nothing was changed: files would be lost that we did not write, or a right is missing.

    The message says what, and what to do, in one line.
    """


@dataclass(frozen=True, slots=True)
class Marker:
    """What was installed into a folder."""

    version: str
    files: Mapping[str, str]
    """Path below the folder -> SHA-256 of what was written there, in hex."""


@dataclass(slots=True)
class InstallOutcome:
    """What was done to one folder."""

    folder: Path
    written: int = 0
    removed: int = 0
    replaced: str | None = None
    """The version that was there before."""
    kept: list[str] = field(default_factory=list)
    """Our files that the user changed, left as they are."""
    foreign: list[str] = field(default_factory=list)
    """Files beside ours that we did not write, left where they are."""
    left: Path | None = None
    """What was there before and could not be removed, under another name."""


def plugin_files(sources: Sources) -> dict[str, bytes]:
    """What belongs into the plugin's folder: path below it -> content."""
    return {ENTRY: bundle(sources).encode()}


def profile_files(sources: Sources) -> dict[str, bytes]:
    """What belongs into the profile's folder: name -> content."""
    return {name: path.read_bytes() for name, path in sources.profile.items()}


def install_plugin(plugins: Path, sources: Sources, force: bool = False) -> InstallOutcome:
    """Put the plugin into `plugins`/ds47, in place of an older one.

    Raises RefusedError where somebody else made a file that would be replaced (`force` replaces it),
    or a right is missing. Files that are not ours stay.
    """
    folder, files = plugins / FOLDER, plugin_files(sources)
    with _in_words(folder):
        marker = _found(folder, files, force)
        if marker is not None and not force and (touched := changed(folder, marker)):
            names = ", ".join(touched)
            raise RefusedError(
                f"changed since it was installed: {names} in {folder} (--force replaces it)"
            )
        return _put(folder, files, marker, kept=[])


def install_profile(folder: Path, sources: Sources, force: bool = False) -> InstallOutcome:
    """Put the profile into `folder`; files of it that the user changed stay unless `force`.

    Their rows that name what the plugin no longer has become comments.
    Raises RefusedError where a profile of this name has files that are not ours and would be replaced
    (not with `force`), or a right is missing.
    """
    files = profile_files(sources)
    with _in_words(folder):
        marker = _found(folder, files, force)
        kept = [] if marker is None or force else changed(folder, marker, missing=False)
        return _put(folder, files, marker, kept)


def uninstall(folder: Path, keep_changed: bool) -> InstallOutcome | None:
    """Remove what was installed into `folder`; None where nothing was.

    With `keep_changed` a folder stays as it is when somebody changed a file of ours in it or put
    one beside. Files that are not ours always stay. Raises RefusedError where a right is missing.
    """
    with _in_words(folder):
        _put_back(folder)
        marker = read_marker(folder)
        if marker is None or folder.is_symlink():
            return None
        outcome = InstallOutcome(folder, replaced=marker.version, foreign=foreign(folder, marker))
        if keep_changed:
            outcome.kept = changed(folder, marker, missing=False)
            if outcome.kept or outcome.foreign:
                return outcome
        _need_rights(folder)
        outcome.removed = _remove_own(folder, marker)
        return outcome


def read_marker(folder: Path) -> Marker | None:
    """What was installed into `folder`; None where nothing was, or its list cannot be read."""
    try:
        content = json.loads((folder / MARKER).read_text("utf-8"))
        files = {str(name): str(digest) for name, digest in content["files"].items()}
        if content["tool"] != "ds47" or not all(map(_inside, files)):
            return None
        return Marker(str(content["version"]), files)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def changed(folder: Path, marker: Marker, missing: bool = True) -> list[str]:
    """Files of ours that are no longer as we wrote them (with `missing`: or gone)."""
    return [
        name
        for name, digest in sorted(marker.files.items())
        if name not in WINDOW_STATE and (now := _digest(folder / name)) != digest
        if now is not None or missing
    ]


def foreign(folder: Path, marker: Marker | None) -> list[str]:
    """Files in `folder` that we did not write."""
    ours = {MARKER, LISTS, *WINDOW_STATE, *(marker.files if marker else ())}
    return [name for name in _files(folder) if name not in ours]


def outdated(folder: Path, marker: Marker) -> list[str]:
    """Files of our profile with rows that name what the plugin no longer has."""
    there = [name for name in sorted(marker.files) if asked((folder / name).is_file)]
    return [name for name in there if _GONE.search((folder / name).read_bytes())]


def stale(folder: Path, marker: Marker, files: Mapping[str, bytes]) -> list[str]:
    """Files in `folder` that differ from `files`, the present version."""
    present = {name: _sha256(data) for name, data in files.items()}
    return sorted(
        name
        for name in present.keys() | marker.files.keys()
        if name not in WINDOW_STATE and present.get(name) != _digest(folder / name)
    )


def copies(folder: Path) -> list[Path]:
    """Every ds47 plugin that Wireshark would load from `folder`: entries and single-file bundles."""
    return [path for path in _below(folder)[1] if is_entry(path)]


def not_ours(folder: Path, files: Mapping[str, bytes]) -> list[str]:
    """Which of `files` a folder has that we did not make: they would be replaced.

    No loss is what Wireshark writes of itself whenever a profile is used, and a file that is the same already:
    the plugin itself adds the profile, too.
    """
    there = (set(files) - WINDOW_STATE) & set(_files(folder))
    return sorted(name for name in there if _digest(folder / name) != _sha256(files[name]))


def leftovers(folder: Path) -> list[Path]:
    """Folders beside `folder` that an installation which was cut off, or could not remove them, left."""
    return sorted((*folder.parent.glob(f"{_NEW}*"), *folder.parent.glob(f"{_OLD}*")))


def obstacle(folder: Path) -> Path | None:
    """The folder that lacks the write permission needed to replace `folder`.

    None if no obstacle is known (on Windows, permissions show only when they are used).
    """
    parent = folder.parent
    while not os.path.lexists(parent) and parent != parent.parent:
        parent = parent.parent
    if not _may_write(parent) or not asked(folder.is_dir) or folder.is_symlink():
        return None if _may_write(parent) else parent
    return next((path for path in (folder, *_below(folder)[0]) if not _may_write(path)), None)


def mend(folder: Path) -> str:
    """How to get write permission for a folder, as a command if there is one."""
    if os.name != "posix":
        return f"give yourself the right to write into {folder}"
    if os.statvfs(folder).f_flag & os.ST_RDONLY:
        return f"{folder} is on a read-only file system: make it writable"
    quoted, user = shlex.quote(str(folder)), os.geteuid()
    if folder.stat().st_uid == user:
        return f"chmod -R u+rwX {quoted}"
    return f"sudo chown -R {_user_name(user)} {quoted}"


def asked(question: Callable[[], bool]) -> bool:
    """What a path says of itself; no where one has no right to ask."""
    with suppress(OSError):
        return question()
    return False


def is_entry(path: Path) -> bool:
    """Whether `path` is the file by which a copy of the plugin starts, whatever a browser named it."""
    return bool(_BUNDLE.fullmatch(path.name)) and asked(path.is_file)


def _put(
    folder: Path, files: Mapping[str, bytes], marker: Marker | None, kept: list[str]
) -> InstallOutcome:
    """Make `folder` anew beside the old one, then let it take its place."""
    _need_rights(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    _sweep(folder)
    # What we wrote once, nobody changed and the present version no longer has goes with the old one.
    present = set(_files(folder))
    ours = set(marker.files) if marker else set()
    state = WINDOW_STATE & present
    state |= {LISTS} & present
    others = sorted(present - ours - set(files) - state - {MARKER})
    names = sorted(set(files) - set(kept) - state)
    version = marker.version if marker else None
    outcome = InstallOutcome(folder, len(names), 0, version, kept, others)
    new = folder.with_name(f"{_NEW}{folder.name}-{os.getpid()}")
    try:
        digests = {name: _write(new / name, files[name]) for name in names}
        for name in (*kept, *state, *others):
            data = (folder / name).read_bytes()
            _write(new / name, _GONE.sub(rb"# \g<0>", data) if name in kept else data)
            if marker is not None and name in marker.files:
                digests[name] = marker.files[name]
        _write_marker(new, digests)
        outcome.left = _exchange(new, folder)
    except BaseException:
        shutil.rmtree(new, ignore_errors=True)
        raise
    return outcome


def _exchange(new: Path, folder: Path) -> Path | None:
    """Let `new` take the place of `folder`; when that fails, the old one is back.

    Returns the old one where it could not be removed.
    """
    old = folder.with_name(f"{_OLD}{folder.name}-{os.getpid()}")
    there = folder.exists()
    if there:
        folder.rename(old)
    try:
        new.rename(folder)
    except OSError:
        if there:
            old.rename(folder)
        raise
    if there:
        shutil.rmtree(old, ignore_errors=True)
    return old if old.exists() else None


def _put_back(folder: Path) -> None:
    """Undo an installation that was cut off inside `_exchange`: the old folder is there, none in its place.

    What the user changed is nowhere else.
    """
    if folder.exists() or folder.is_symlink():
        return
    name = re.compile(re.escape(f"{_OLD}{folder.name}-") + r"\d+")
    olds = [path for path in folder.parent.glob(f"{_OLD}*") if name.fullmatch(path.name)]
    if olds:
        max(olds, key=lambda path: path.stat().st_mtime_ns).rename(folder)


def _sweep(folder: Path) -> None:
    """Remove what an installation that was cut off left behind: Wireshark would load it too."""
    for left in leftovers(folder):
        if (marker := read_marker(left)) is not None:
            _need_rights(left)
            _remove_own(left, marker)


@contextmanager
def _in_words(folder: Path) -> Iterator[None]:
    """Says in one line what the system forbids."""
    try:
        yield
    except OSError as problem:
        _need_rights(folder)
        why = problem.strerror or str(problem)
        where = f" ({problem.filename})" if problem.filename else ""
        raise RefusedError(f"{folder} cannot be changed: {why}{where}") from problem


def _need_rights(folder: Path) -> None:
    """Raises RefusedError before anything is changed that could not be finished."""
    if (denied := obstacle(folder)) is not None:
        raise RefusedError(f"no right to write into {denied}: {mend(denied)}, then do this again")


def _may_write(folder: Path) -> bool:
    """Whether this process may make and remove what is in a folder."""
    if os.name != "posix":
        return True
    wanted = os.W_OK | os.X_OK
    return os.access(folder, wanted, effective_ids=os.access in os.supports_effective_ids)


def _user_name(user: int) -> str:
    """The name of a user, its number where it has none."""
    import pwd

    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return str(user)


def _found(folder: Path, files: Mapping[str, bytes], force: bool) -> Marker | None:
    """What is installed in a folder before `files` are put there; None where nothing is.

    Raises RefusedError where files that we did not make would be replaced (not with `force`).
    """
    _put_back(folder)
    _only_a_folder(folder)
    marker = read_marker(folder)
    if marker is None and not force and (lost := not_ours(folder, files)):
        names = listed(lost)
        raise RefusedError(f"{names} in {folder}: not of ds47 plugin install (--force replaces it)")
    return marker


def _remove_own(folder: Path, marker: Marker) -> int:
    """Remove our files, then the folders that are empty by that. Returns the number of files."""
    removed = 0
    for name in marker.files:
        with suppress(FileNotFoundError):
            (folder / name).unlink()
            removed += 1
    if not foreign(folder, marker):
        for name in (LISTS, *WINDOW_STATE):
            (folder / name).unlink(missing_ok=True)
    (folder / MARKER).unlink(missing_ok=True)
    for path in (*reversed(_below(folder)[0]), folder):
        with suppress(OSError):  # not empty: files of others
            path.rmdir()
    return removed


def _write_marker(folder: Path, digests: Mapping[str, str]) -> None:
    content = {"tool": "ds47", "version": __version__, "files": dict(sorted(digests.items()))}
    text = json.dumps(content, indent=1) + "\n"
    (folder / MARKER).write_text(text, "utf-8", newline="\n")


def _write(path: Path, data: bytes) -> str:
    """Write a new file with the usual rights; returns the digest."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return _sha256(data)


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _digest(path: Path) -> str | None:
    try:
        return _sha256(path.read_bytes())
    except OSError:
        return None


def _files(folder: Path) -> Iterator[str]:
    for path in _below(folder)[1]:
        yield path.relative_to(folder).as_posix()


def _below(folder: Path) -> tuple[list[Path], list[Path]]:
    """Folders and files below `folder`, sorted; a link is a file. What may not be read has nothing."""
    folders: list[Path] = []
    files: list[Path] = []
    for parent, inside, names in os.walk(folder):
        for name in (*inside, *names):
            path = Path(parent, name)
            is_folder = asked(path.is_dir) and not asked(path.is_symlink)
            (folders if is_folder else files).append(path)
    return sorted(folders), sorted(files)


def _inside(name: str) -> bool:
    """Whether a path of a marker stays below its folder: the file may have been edited."""
    path = Path(name)
    return bool(name) and not path.is_absolute() and ".." not in path.parts and not path.drive


def _only_a_folder(folder: Path) -> None:
    if folder.is_symlink():
        raise RefusedError(f"{folder} is a link, perhaps to a checkout; remove it first")
    if folder.exists() and not folder.is_dir():
        raise RefusedError(f"{folder} is not a folder")


def listed(names: Iterable[str], most: int = 4) -> str:
    """Some names for a sentence, and how many more there are."""
    all_names = list(names)
    more = len(all_names) - most
    return ", ".join(all_names[:most]) + (f" and {more} more" if more > 0 else "")
