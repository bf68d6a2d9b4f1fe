"""`ds47 export`: the frames of what was found as a capture of their own, with or without names.

Here: options, names of files, what is said about them. The work is in `ds47.export`.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ds47.capture.names import ENDINGS, EXPORTED, STDIN, about
from ds47.cli.common import Misses, cannot_write, refused, stdout, warn
from ds47.cli.helping import helped
from ds47.cli.options import analysis_options, options_from, tz_option, zone_for_paths
from ds47.cli.selecting import CRITERIA, Choice, chosen, selection_options
from ds47.cli.series import series_option, tasks, tell_lacking, tell_nothing
from ds47.cli.targets import refuse_links, replaced_captures, spare_recordings
from ds47.model import Finding
from ds47.report.zones import Zone

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions
    from ds47.batch.tasks import Task
    from ds47.capture.series import SeriesPart
    from ds47.export import ExportOutcome, Replacements

_NOTHING = 1
_LINKS = {"profibus": 257, "user0": 147}
_FILES_SHOWN = 20
_FILTER_SHOWN = 100
"""The longest display filter that is printed unless asked for."""
"""The most files of a series to print filters for."""


@helped(
    "export",
    (
        "ds47 export -s failed --anonymise machine.pcapng -o for-the-maker.pcapng",
        "what failed, without names and addresses",
    ),
)
@click.argument("paths", metavar="CAPTURE...", nargs=-1, required=True)
@selection_options
@tz_option
@click.option(
    "--all-frames", is_flag=True, help="Other protocols too, for a time span or a device."
)
@click.option(
    "-o",
    "--output",
    "output_name",
    metavar="FILE",
    help="File, folder, or -.  [default: NAME.ds47.pcapng in this folder]",
)
@click.option(
    "--link",
    type=click.Choice(tuple(_LINKS)),
    help="Link type of PROFIBUS frames; every Wireshark opens user0 (147).",
)
@click.option("--force", is_flag=True, help="Let -o overwrite an existing capture.")
@click.option(
    "--anonymise", is_flag=True, help="Replace addresses and names; a key file maps them back."
)
@click.option(
    "--anonymise-values/--keep-values",
    "everything",
    default=None,
    help="Replace all values of parameters too, or keep them (default).",
)
@click.option("--key", "key_name", metavar="FILE", help="Key file; an existing one is extended.")
@click.option(
    "--filters", is_flag=True, help="Print the display filter for the original, even a long one."
)
@click.option(
    "--examples",
    is_flag=True,
    help="One example of each root cause, each a capture in the folder of -o.",
)
@series_option
@analysis_options
def command(
    paths: Sequence[str],
    where: Zone,
    all_frames: bool,
    output_name: str | None,
    force: bool,
    anonymise: bool,
    everything: bool | None,
    key_name: str | None,
    link: str | None,
    filters: bool,
    examples: bool,
    series: bool,
    lang: str,
    **options: Any,
) -> int:
    """Write the frames of transactions, findings, a device or a time span as pcapng.

    All criteria must apply; of a criterion given several times, one value is enough. Without
    any, every frame is written that the analysis understands. Wireshark shows a comment on each
    frame: what it is and what is wrong. A short display filter for the original is printed.
    """
    if not anonymise and (everything is not None or key_name):
        raise click.UsageError("--key, --keep-values and --anonymise-values need --anonymise")
    if anonymise and all_frames:
        raise click.UsageError(
            "--all-frames cannot be anonymised: nobody can tell which names and addresses "
            "frames of other protocols hold"
        )
    where = zone_for_paths(where, paths)
    asked = {name: options.pop(name) for name in CRITERIA}
    choice = chosen(where, all_frames=all_frames, **asked)
    selection = choice.selection
    if all_frames and not selection.by_frame:
        raise click.UsageError("--all-frames goes with --from, --to and --device only")
    if examples and (
        all_frames or anonymise or any(asked[name] for name in CRITERIA if name != "rules")
    ):
        raise click.UsageError("--examples goes with --rule, -o and --link only")
    if examples:
        return _examples(
            paths, output_name, selection.rules, _LINKS.get(link or ""), force, series, lang,
            options_from(**options),
        )  # fmt: skip
    run = _Run(options_from(**options), choice, bool(everything), lang)
    run.bus_link = _LINKS[link] if link else None
    run.filters = filters
    found = tasks(paths, series, run.misses)
    targets = _targets(found, output_name)
    refuse_links(targets)
    if force:
        run.replaced = replaced_captures(targets)
    else:
        spare_recordings(targets)
    run.key_path = _key_path(key_name, targets) if anonymise else None
    run.open_key()
    for task, target in zip(found, targets, strict=True):
        run.one(task, target)
    if not run.written:
        choice.refuse_backwards()
    if run.misses:
        return run.misses.status
    return 0 if run.written else _NOTHING


def _examples(
    paths: Sequence[str],
    output_name: str | None,
    rules: tuple[str, ...],
    bus_link: int | None,
    force: bool,
    series: bool,
    lang: str,
    options: AnalysisOptions,
) -> int:
    """Writes the examples of each capture, and says a line of each."""
    from ds47.batch.endings import fence
    from ds47.capture import CaptureError

    folder = Path(output_name or ".")
    if not folder.is_dir():
        raise click.UsageError(f"-o {folder}: the examples go into a folder, and this is not one")
    misses, written = Misses(), 0
    found = tasks(paths, series, misses)
    targets = _ExampleTargets(found, force)
    for task in found:
        stem = str(folder / (task.own_name or _stem(task.path)))
        try:
            with fence(click.ClickException), _source(task) as source:
                written += _examples_of(task, source, stem, rules, bus_link, targets, lang, options)
        except CaptureError as problem:
            misses.of(task.path, problem)
        except OSError as problem:
            raise cannot_write(str(problem.filename or stem), problem) from problem
    if misses:
        return misses.status
    return 0 if written else _NOTHING


def _examples_of(
    task: Task,
    source: str | Sequence[SeriesPart],
    stem: str,
    rules: tuple[str, ...],
    bus_link: int | None,
    targets: _ExampleTargets,
    lang: str,
    options: AnalysisOptions,
) -> int:
    """The examples of one capture; how many there are."""
    from ds47.export import MOST, export_examples
    from ds47.export import examples as causes
    from ds47.report.bilingual import say
    from ds47.report.formatting import escape
    from ds47.report.sentences import message, sentence

    lines, left_out = [], 0
    for each, done in export_examples(
        source, lambda item: targets.path(f"{stem}.{item.name}{EXPORTED}"), rules, options, bus_link
    ):
        left_out = left_out or len(causes(done.result, rules)) - MOST
        if not done.frames:
            continue
        text = (
            message(each.item, lang)
            if isinstance(each.item, Finding)
            else sentence(each.item, lang)
        )
        shown = say(
            "export_example",
            target=escape(f"{stem}.{each.name}{EXPORTED}"),
            frames=say("frames", n=len(done.frames)),
            text=escape(text),
        )
        lines.append("  " + shown.text(lang))
    name = "stdin" if task.path == STDIN else task.path
    if not lines:
        warn(f"{name}: nothing to export")
        return 0
    _print(say("export_examples", name=escape(name), n=len(lines)).text(lang))
    for line in lines:
        _print(line)
    if left_out > 0:
        _print("  " + say("export_examples_more", n=left_out).text(lang))
    return len(lines)


class _ExampleTargets:
    """The files of the examples: none twice, none over an input or a recording."""

    def __init__(self, found: Sequence[Task], force: bool) -> None:
        self._force = force
        self._taken = {Path(each.name).resolve() for task in found for each in task.sources}

    def path(self, name: str) -> str:
        """The name, where that may be written."""
        if Path(name).resolve() in self._taken:
            raise click.UsageError(f"{name} is read, or written already: choose another -o")
        self._taken.add(Path(name).resolve())
        refuse_links([name])
        if not self._force:
            spare_recordings([name])
        return name


class _Run:
    """Goes from capture to capture, and says what became of each."""

    def __init__(
        self,
        options: AnalysisOptions,
        choice: Choice,
        everything: bool,
        lang: str,
    ) -> None:
        self._options = options
        self._lang = lang
        self._choice = choice
        self._everything = everything
        self._key: Replacements | None = None
        self.bus_link: int | None = None
        self.key_path: Path | None = None
        self.replaced: Sequence[str] = ()
        self.misses = Misses()
        self.written = 0
        self.filters = False
        """Whether display filters are printed, however long they are."""

    def open_key(self) -> None:
        """The key to anonymise with: that of the file, if there is one."""
        from ds47.export import KeyFileError, Replacements

        if self.key_path is None:
            return
        with refused(KeyFileError):
            path = self.key_path
            self._key = Replacements.load(path) if path.exists() else Replacements()

    def one(self, task: Task, target: str) -> None:
        """Exports one capture."""
        from ds47.batch.endings import fence
        from ds47.capture import CaptureError
        from ds47.export import KeyFileError, SelectionError, export, first_time

        try:
            with fence(SelectionError, KeyFileError), _source(task) as source:
                selection = self._choice.of(first_time(source) if self._choice.relative else None)
                sink = sys.stdout.buffer if target == STDIN else target
                done = export(
                    source, sink, selection, self._options, self._key, self._everything,
                    self.bus_link,
                )  # fmt: skip
                if self._key is not None and self.key_path is not None and done.frames:
                    self._key.save(self.key_path)
        except CaptureError as problem:
            self.misses.of(task.path, problem)
            return
        except (SelectionError, KeyFileError) as problem:
            raise click.ClickException(about(task.path, str(problem))) from problem
        except OSError as problem:
            if target == STDIN:
                raise
            raise cannot_write(target, problem) from problem
        self._tell(task.path, target, done)

    def _tell(self, path: str, target: str, done: ExportOutcome) -> None:
        from ds47.report.bilingual import say
        from ds47.report.formatting import escape

        name, lang = "stdin" if path == STDIN else path, self._lang
        tell = warn if target == STDIN else _print
        result = done.result
        tell_lacking(path, result.missing_files, result.lacking, self.misses)
        self._tell_left_out(name, done)
        if not done.frames and not tell_nothing(result, lang):
            warn(f"{name}: nothing to export")
            return
        self.written += 1
        words = say(
            "export_frames",
            name=escape(name),
            part=len(done.frames),
            frames=say("frames", n=done.result.frames),
            transactions=say("transactions", n=done.transactions),
        )
        tell(words.text(lang))
        if target != STDIN:
            key = "export_replaced" if target in self.replaced else "export_written"
            tell("  " + say(key, target=escape(target)).text(lang))
        if self.key_path is not None:
            tell("  " + say("export_key", path=escape(str(self.key_path))).text(lang))
            if not self._everything:
                tell("  " + say("export_values_kept").text(lang))
        for line in _filters(done, lang, whole=self.filters):
            tell("  " + line)

    @staticmethod
    def _tell_left_out(name: str, done: ExportOutcome) -> None:
        from ds47.report.formatting import count

        if done.left_out:
            frames = count(len(done.left_out), "frame")
            warn(f"{name}: {frames} left out, of other protocols or of messages that are not whole")
        for frame, text in done.leaks:
            warn(f"{name}: frame {frame} left out, {text!r} is still in it")


def _filters(done: ExportOutcome, lang: str, *, whole: bool) -> Iterator[str]:
    """Display filters that show the frames in the original: of a series one for each file."""
    from ds47.export import display_filter
    from ds47.report.bilingual import say
    from ds47.report.file_frames import FileFrames
    from ds47.report.formatting import escape

    files = FileFrames(done.result.files).by_file(done.frames)
    for name, frames in files[:_FILES_SHOWN]:
        text, left_out = display_filter(frames)
        if len(text) > _FILTER_SHOWN and not whole:
            yield say("export_filter_long").text(lang)
            return
        more = "  " + say("frames_more", n=left_out).text(lang) if left_out else ""
        key = "export_filter_file" if name else "export_filter"
        yield say(key, file=escape(name), filter=text).text(lang) + more
    if len(files) > _FILES_SHOWN:
        yield say("export_files_more", n=len(files) - _FILES_SHOWN).text(lang)


def _print(text: str) -> None:
    stdout().write(text + "\n")


@contextmanager
def _source(task: Task) -> Iterator[str | Sequence[SeriesPart]]:
    """What can be read several times: stdin becomes a file for the while."""
    if task.path != STDIN:
        yield task.parts if task.series else task.path
        return
    with tempfile.TemporaryDirectory(prefix="ds47-") as folder:
        copy = Path(folder, "stdin")
        with copy.open("wb") as stream:
            shutil.copyfileobj(sys.stdin.buffer, stream)
        yield str(copy)


def _targets(found: Sequence[Task], name: str | None) -> list[str]:
    """Where each capture goes.

    Raises click.UsageError for names that would meet each other or a capture.
    """
    if name is not None and not Path(name).is_dir():
        if len(found) > 1:
            raise click.UsageError("-o must be a folder for more than one capture")
        targets = [name] * len(found)
    else:
        folder = Path(name or ".")
        targets = [str(folder / ((task.own_name or _stem(task.path)) + EXPORTED)) for task in found]
    paths = [source.name for task in found for source in task.sources]
    sources = {Path(path).resolve() for path in paths if path != STDIN}
    outputs = [Path(target).resolve() for target in targets if target != STDIN]
    for output in outputs:
        if output in sources:
            raise click.UsageError(f"{output} is a capture to read: choose another -o")
    if len(set(outputs)) < len(outputs):
        raise click.UsageError("captures of the same name: export them one by one, with -o")
    return targets


def _stem(path: str) -> str:
    """The name of a capture without its ending."""
    name = "stdin" if path == STDIN else Path(path).name
    for ending in sorted(ENDINGS, key=len, reverse=True):
        if name.lower().endswith(ending):
            return name[: -len(ending)]
    return name


def _key_path(name: str | None, targets: Sequence[str]) -> Path:
    if name is not None:
        return Path(name)
    if len(targets) == 1 and targets[0] != STDIN:
        target = Path(targets[0])
        stem = target.name.removesuffix(".pcapng")
        return target.with_name(f"{stem}.key.json")
    raise click.UsageError("--anonymise to stdout, or of several captures, needs --key FILE")
