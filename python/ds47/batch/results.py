"""Stored results: one file a capture, `ds47.report/2` with what it was made of; what is done already.

The first line of a file holds all that `--resume` and the overview ask for. With it stands the digest of
the whole file, so that a damaged one is found before it is used. Not here: baselines
(`ds47.regression.baseline`), which stand beside their captures and are compared.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, BinaryIO, ClassVar, cast

from ds47.analysis import AnalysisOptions
from ds47.batch.products import discard, whole
from ds47.batch.settings import expected_for, options_for
from ds47.batch.tasks import Task, read
from ds47.capture import CaptureError
from ds47.capture.drafts import draft_of
from ds47.capture.remote import is_url
from ds47.capture.special import special
from ds47.model import CaptureResult
from ds47.parameters.file_names import REFUSED, is_device
from ds47.report import SCHEMA, ReportOptions, load
from ds47.report import json as contract
from ds47.report.overview import CaptureRow, document
from ds47.version import __version__

if TYPE_CHECKING:
    from ds47.parameters.expected import Expectation

OVERVIEW = "overview.json"
DAMAGED = "damaged result"
_UNSEALED = "0" * 64
_SEAL = b'"seal": "'
"""Stands nowhere else in a first line: a text there has its quotes escaped."""
LOOKED_AT = 256
_SCHEMA = b'{"schema": "ds47.'
_OURS = re.compile(_SCHEMA + rb'(?:overview/|report/\d+", "tool": [^\n]*(?:"run": |\Z))')
"""How a result or an overview begins, also a damaged one."""
_REST = "]}"
"""What makes a document of the first line of a result."""


class NotOursError(Exception):
    """A file of the name of a result is none, so it is not written over; the text names it."""


class SameNameError(Exception):
    """Two captures would give results of the same name; the text names both."""


@dataclass(frozen=True)
class StoredResult:
    """A product: the result as it is stored."""

    options: AnalysisOptions
    lang: str = "en"
    expected: tuple[Expectation, ...] = ()
    is_kept: ClassVar[bool] = True

    def __call__(self, task: Task, stream: BinaryIO) -> None:
        """Writes `ds47.report/2` with the key `run`, which stands in the first line."""
        result = read(task, self.options, expected=self.expected)
        sealed = _Sealed(stream)
        text = io.TextIOWrapper(
            cast(BinaryIO, sealed), "utf-8", errors="backslashreplace", newline="\n"
        )
        writer = contract.Writer(text, ReportOptions(lang=self.lang))
        run = {"seal": _UNSEALED, **self.made_of(task), "row": CaptureRow.of(result).plain()}
        writer.about = {"run": run}
        writer.capture(result)
        writer.close()
        text.flush()
        text.detach()
        sealed.seal()

    def made_of(self, task: Task) -> dict[str, Any]:
        """What a result depends on, besides the version: when it is the same, so is the result."""
        options = options_for(task.path, self.options)
        chosen = options._asdict() | {
            "indices": sorted(options.indices),
            "codec": options.codec._asdict(),
            "cyclic": [each._asdict() for each in options.cyclic],
            "s7": options.s7._asdict(),
            "lists": [asdict(each) for each in options.lists],
            "lang": self.lang,
        }
        if expected := self.expected or expected_for(task.sources[0].location):
            chosen["expected"] = expected
        sources = [
            {
                "path": each.name,
                "size": each.size,
                "mark": each.mark,
                "missing_before": each.missing,
            }
            for each in task.sources
        ]
        # as it reads after a way through a file: tuples are lists there
        made: dict[str, Any] = json.loads(json.dumps({"sources": sources, "options": chosen}))
        return made


class _Sealed(io.BufferedIOBase):
    """Writes to a file that has nothing yet; at last the digest of all goes to its place in the first line."""

    def __init__(self, stream: BinaryIO) -> None:
        super().__init__()
        self._stream = stream
        self._digest = hashlib.sha256()
        self._position: int | None = None

    def writable(self) -> bool:
        return True

    def write(self, data: Any, /) -> int:
        """Writes `data`; the first of it holds the place of the digest."""
        piece = bytes(data)
        if self._position is None:
            self._position = piece.index(_SEAL) + len(_SEAL)
        self._digest.update(piece)
        return self._stream.write(piece)

    def seal(self) -> None:
        """Writes the digest."""
        assert self._position is not None
        self._stream.seek(self._position)
        self._stream.write(self._digest.hexdigest().encode())
        self._stream.seek(0, io.SEEK_END)


def _whole(data: bytes, seal: str) -> bool:
    """Whether the bytes of a result are those that were written."""
    unsealed = data.replace(_SEAL + seal.encode(), _SEAL + _UNSEALED.encode(), 1)
    return len(seal) == len(_UNSEALED) and hashlib.sha256(unsealed).hexdigest() == seal


class Results:
    """A folder of results, and which of them there are already."""

    def __init__(self, folder: Path, make: StoredResult) -> None:
        self.folder = folder
        self.make = make
        self._names: dict[str, str] = {}

    def path_of(self, task: Task) -> Path:
        """The path of the result of a task."""
        return self.folder / self._names[task.path]

    def name(self, tasks: Sequence[Task], roots: Sequence[str]) -> None:
        """Gives each task the name of its result: its path below the folder that was named.

        Raises:
            SameNameError: two would have the same.
        """
        owners: dict[str, str] = {}
        for task in tasks:
            name = f"{_below(task.path, roots)}.json"
            other = owners.setdefault(name.casefold(), task.path)
            if other != task.path:
                raise SameNameError(f"{other} and {task.path} would have the same result {name}")
            self._names[task.path] = name

    def undone(self, task: Task) -> str | None:
        """Why a task is to be done: there is no result, or it is of something else. None when done."""
        try:
            head = self._head(task)
            version, made = head["tool"]["version"], head["run"]
        except (OSError, *_MISSHAPEN):
            # os.path: a name that is too long is no error there
            return DAMAGED if os.path.exists(self.path_of(task)) else "no result"  # noqa: PTH110
        now = self.make.made_of(task)
        if version != __version__:
            return "another version of ds47"
        if not self._intact(task, made):
            return DAMAGED
        if made.get("options") != now["options"]:
            return "other options"
        if made.get("sources") != now["sources"] or any(each.mark is None for each in task.sources):
            return "changed"
        return None

    def _intact(self, task: Task, made: dict[str, Any]) -> bool:
        """Whether all of a result is as it was written; its first line may be whole, and the rest damaged."""
        try:
            return _whole(self.path_of(task).read_bytes(), made["seal"])
        except (OSError, *_MISSHAPEN):
            return False

    def row(self, task: Task) -> CaptureRow:
        """What the overview tells of a task that is done.

        Raises:
            CaptureError: its result is whole, and still none.
        """
        with self._misshapen(task):
            return CaptureRow.loaded(self._head(task)["run"]["row"])

    def load(self, task: Task) -> CaptureResult:
        """The result of a task that is done. Raises CaptureError, as `row`."""
        with self._misshapen(task):
            stored = json.loads(self.path_of(task).read_bytes())
            result = load.capture(stored["captures"][0])
            row = stored["run"]["row"]
            result.problem, result.dropped = row["problem"], row["dropped"]
            return result

    @contextmanager
    def _misshapen(self, task: Task) -> Iterator[None]:
        """A digest that is right is no proof: who writes a result by hand can make that, too."""
        try:
            yield
        except (OSError, *_MISSHAPEN) as problem:
            raise CaptureError(
                f"{self.shown(task)}: {DAMAGED}; the next run makes it again"
            ) from problem

    def shown(self, task: Task | None = None) -> str:
        """How people know the folder, or the result of a task."""
        return str(self.folder if task is None else self.path_of(task))

    def fetch(self, tasks: Sequence[Task]) -> None:
        """Gets the results that are there. Here they are."""

    def keep(self, task: Task) -> None:
        """Takes a new result to where it stays. Here it does."""

    def reported(self, task: Task) -> None:
        """The report has a result. Here it stays."""

    def done(self, tasks: Sequence[Task]) -> int:
        """How many results there are when a run is ended before its end."""
        return sum(self.undone(task) is None for task in tasks)

    def forget(self, task: Task) -> None:
        """A capture that cannot be read any more has no result."""
        discard(self.path_of(task))

    def spare(self, tasks: Sequence[Task]) -> None:
        """Whether all that stands under the names of results is what an earlier run wrote.

        Raises:
            NotOursError: something is not.
            OSError: nobody can look.
        """
        for name, head in self._heads([OVERVIEW, *(self._names[task.path] for task in tasks)]):
            if not _OURS.match(head) and not _SCHEMA.startswith(
                head
            ):  # a disk that failed leaves nothing
                raise NotOursError(
                    f"{name} is not a result of ds47 report --results and is not overwritten: "
                    "move it, or choose another folder"
                )

    def _heads(self, names: Sequence[str]) -> Iterator[tuple[str, bytes]]:
        """The beginnings of those files of these names that are there."""
        for path in (self.folder / name for name in names):
            if (kind := special(path)) is not None:
                raise NotOursError(f"{path} is {kind}: move it, or choose another folder")
            if os.path.isfile(path):  # noqa: PTH113 (of a name that is too long: False)
                with path.open("rb") as stream:
                    yield str(path), stream.read(LOOKED_AT)

    def begin(self) -> None:
        """Makes the folder; an overview of an earlier run is not that of this one.

        Raises:
            OSError: it cannot be written.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / OVERVIEW).unlink(missing_ok=True)
        probe = draft_of(self.folder / OVERVIEW, os.getpid())
        probe.touch()  # else every capture would be analysed first
        probe.unlink()

    def end(self, rows: Sequence[CaptureRow], owner: int) -> None:
        """Writes the overview."""
        path = self.folder / OVERVIEW
        with whole(path, draft_of(path, owner)) as stream:
            for piece in document(rows):
                stream.write(piece.encode("utf-8", errors="backslashreplace"))

    def _head(self, task: Task) -> dict[str, Any]:
        with self.path_of(task).open("rb") as stream:
            head: dict[str, Any] = json.loads(stream.readline() + _REST.encode())
        if head["schema"] != SCHEMA:
            raise ValueError(head["schema"])
        return head


_MISSHAPEN = (ValueError, LookupError, TypeError, AttributeError, RecursionError)
"""What comes of reading JSON that is damaged, or is of another shape."""


def _below(path: str, roots: Sequence[str]) -> str:
    """The path of a capture below the one of `roots` that it came from, with `/`.

    Of several folders each has its own name in front, so that their results do not mix. It leads
    nowhere but down, whatever the files of a folder or the keys of a bucket are called.
    """
    pure = _pure(path)
    for root in roots:
        given = _pure(root)
        if pure != given and given in pure.parents:
            below = pure.relative_to(given)
            folder = given.name if given.name not in ("", "..") else "folder"
            return _harmless(str(below) if len(roots) == 1 else f"{folder}/{below}")
    return _harmless(pure.name)


def _pure(path: str) -> PurePosixPath:
    """A path with `/`; a backslash is a letter like any other where the system says so, and in a URL."""
    return PurePosixPath(path.split("://")[1] if is_url(path) else path.replace(os.sep, "/"))


def _harmless(name: str) -> str:
    """The name with what leads out of a folder written as a URL writes it: `..` is `%2E%2E`.

    Windows also leaves a folder by a backslash and by a colon (a drive), and takes some names for devices.
    """
    parts = name.replace(os.sep, "/").split("/")
    parts = [part if part.strip(". ") else part.replace(".", "%2E") for part in parts]
    return "/".join(map(_for_windows, parts) if os.sep == "\\" else parts)


def _for_windows(part: str) -> str:
    """The name of a file or folder as Windows takes it: a bucket may have any, such as `aux` and `a?b `."""
    coded = "".join(f"%{ord(char):02X}" if char in REFUSED else char for char in part)
    if coded.endswith((".", " ")):  # would be left out
        coded = f"{coded[:-1]}%{ord(coded[-1]):02X}"
    return f"%{ord(coded[0]):02X}{coded[1:]}" if is_device(coded) else coded
