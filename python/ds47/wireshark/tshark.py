"""tshark with the plugin of this package, run through pyshark: a capture in, its `ds47` trees out.

Lives here: whether tshark, pyshark and the plugin are there and fit, how tshark is called, and the
stream of PDML between pyshark and `fields`. Not here: what is given to tshark and what becomes of
its answer (`engine`). pyshark is needed only when something is run.
"""

from __future__ import annotations

import asyncio
import io
import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from html import unescape
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

from ds47.spec.extras import install
from ds47.spec.raised import Error
from ds47.version import __version__
from ds47.wireshark import bundle, doctor, fields
from ds47.wireshark.locate import NoWiresharkError, Wireshark, find, run

_HOMES = ("HOME", "XDG_CONFIG_HOME", "WIRESHARK_CONFIG_DIR", "WIRESHARK_APPDATA")
"""Where Wireshark looks for what belongs to a user."""
_LUA_ERROR = re.compile(rb'<field name="(?:_ws\.[a-z.]+)?"[^>]*="[^"]*Lua Error: ([^"]*)"')
_SHOWN = "ds47 || ds47.pzd.event || _ws.lua.error"
_TREES = "frame ds47 ds47_pzd _ws.lua.error"


class NotReadyError(Error):
    """tshark, pyshark or the plugin is missing or does not fit; one line, with the mend."""


class StoppedError(Exception):
    """tshark ended before the capture did; one line."""


@dataclass(frozen=True, slots=True)
class Tshark:
    """A tshark that runs the plugin."""

    program: Path
    script: Path


@dataclass(slots=True)
class Answer:
    """What tshark says about a capture: transactions and findings, and the errors of the plugin."""

    fields: fields.Fields
    errors: list[str] = field(default_factory=list)


def prepare(program: str | None = None) -> Tshark:
    """The tshark of this machine, or `program`, after a trial with the plugin.

    Raises NotReadyError.
    """
    try:
        _file_capture()
    except ImportError as problem:
        text = f"the engine tshark needs pyshark ({problem}): {install('tshark')}"
        raise NotReadyError(text) from problem
    try:
        wireshark = find(program)
        sources = bundle.plugin_sources()
        with own_settings():
            _try(wireshark, sources)
    except NoWiresharkError as problem:
        text = f"{problem}: install tshark, or name it with --tshark or DS47_TSHARK"
        raise NotReadyError(text) from problem
    except FileNotFoundError as problem:
        raise NotReadyError(f"{problem}: pip install . in a checkout") from problem
    return Tshark(wireshark.program, sources.modules[bundle.ENTRY])


def _try(wireshark: Wireshark, sources: bundle.Sources) -> None:
    """Shows the trial capture: only then is it sure that the plugin runs, and which one."""
    if wireshark.lua is None:
        raise NotReadyError(f"{wireshark.program} was built without Lua: install another tshark")
    if "wireshark" in wireshark.program.stem.lower():
        raise NotReadyError(f"there is {wireshark.program}, but no tshark: install tshark")
    script = f"lua_script:{sources.modules[bundle.ENTRY]}"
    trial = run(
        wireshark.program, "-n", "-X", script, "-r", sources.trial,
        "-Y", "ds47", "-T", "fields", "-e", "ds47.pnu",
    )  # fmt: skip
    if not trial.output.strip():
        raise NotReadyError(_not_loaded(wireshark, trial.errors))
    listed = run(wireshark.program, "-G", "plugins", "-X", script)
    for line in listed.output.splitlines():
        columns = [column.strip() for column in line.split("\t")]
        is_ours = columns[0].endswith(".lua") and Path(columns[0]).name.startswith("ds47")
        if is_ours and len(columns) > 1 and columns[1] not in ("", __version__):
            text = f"{columns[-1]} is version {columns[1]} of the plugin, this is {__version__}"
            raise NotReadyError(f"{text}: delete it, or ds47 plugin install")


def _not_loaded(wireshark: Wireshark, errors: str) -> str:
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    lua = doctor.errors_in(errors)
    if lua:
        return f"the plugin does not run in {wireshark.program}: {lua[0]}"
    if root and wireshark.version >= doctor.STRICT_ROOT:
        text = "as root, Wireshark 4.4 and later ignore Lua scripts without a word"
        return f"{text}: run as an ordinary user, or see ds47 plugin doctor"
    lines = errors.split("\n")
    said = next((line.strip() for line in lines if line.startswith("tshark:")), "no word why")
    return f"{wireshark.program} does not run the plugin ({said}): see ds47 plugin doctor"


@contextmanager
def own_settings() -> Iterator[None]:
    """Runs Wireshark without the user's settings and plugins: the same answer for everybody."""
    before = {name: os.environ.get(name) for name in _HOMES}
    with tempfile.TemporaryDirectory(prefix="ds47-home-") as folder:
        os.environ.update(dict.fromkeys(_HOMES, folder))
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value


def ask(tshark: Tshark, capture: Path, preferences: Sequence[str]) -> Answer:
    """Runs a capture through tshark in two passes, and reads what the plugin says.

    Args:
        tshark: from `prepare`.
        capture: a file.
        preferences: as for `-o`: `ds47.language:zh`.

    Raises:
        StoppedError: tshark did not get to the end.
    """
    arguments = ["-X", f"lua_script:{tshark.script}", "-2", "-R", "frame"]
    arguments += ["-Y", _SHOWN, "-J", _TREES]
    for preference in preferences:
        arguments += ["-o", preference]
    errors: list[str] = []
    loop = asyncio.new_event_loop()
    packets = _file_capture()(capture, tshark.program, arguments, loop)
    try:
        with own_settings():
            stream = _Stream(_document(packets, errors))
            return Answer(fields.read(io.BufferedReader(stream)), errors)
    except ParseError as problem:
        raise StoppedError(f"what tshark printed cannot be read: {problem}") from problem
    finally:
        packets.close()
        loop.close()


def _document(packets: Any, errors: list[str]) -> Iterator[bytes]:
    """The packets as one XML document, as `fields` reads it."""
    yield b"<pdml>"
    for packet in packets:
        found = _LUA_ERROR.findall(packet)
        errors += [unescape(text.decode("utf-8", "replace")) for text in found]
        yield packet
    packets.close()  # all that stands on stderr is read then
    if not packets.ended or packets.status != 0:
        why = packets.last_line or "it does not say why"
        raise StoppedError(f"tshark stopped early with status {packets.status}: {why}")
    yield b"</pdml>"


class _Stream(io.RawIOBase):
    """Pieces of bytes as a file."""

    def __init__(self, pieces: Iterator[bytes]) -> None:
        super().__init__()
        self._pieces = pieces
        self._left = b""

    def readable(self) -> bool:
        return True

    def readinto(self, room: Any, /) -> int:
        view = memoryview(room)
        if not self._left:
            self._left = next(self._pieces, b"")
        piece, self._left = self._left[: len(view)], self._left[len(view) :]
        view[: len(piece)] = piece
        return len(piece)


@cache
def _file_capture() -> Any:
    """The FileCapture of pyshark, which gives each packet as XML. Raises ImportError without pyshark.

    The layers that pyshark makes of it are flat: they do not say which field is below which.
    """
    from pyshark import FileCapture
    from pyshark.tshark.output_parser.tshark_xml import TsharkXmlParser

    class Parser(TsharkXmlParser):  # type: ignore[misc]
        ended = False

        def _extract_packet_from_data(self, data: bytes, got_first_packet: bool = True) -> Any:
            self.ended = b"</pdml>" in data[-16:]
            return super()._extract_packet_from_data(data, got_first_packet)

        def _parse_single_packet(self, packet: bytes) -> bytes:
            return packet

    class Packets(FileCapture):  # type: ignore[misc]
        def __init__(
            self, path: Path, program: Path, arguments: list[str], loop: asyncio.AbstractEventLoop
        ) -> None:
            self._program, self._parser = program, Parser()
            self.status: int | None = None
            super().__init__(path, keep_packets=False, custom_parameters=arguments, eventloop=loop)

        @property
        def ended(self) -> bool:
            """Whether all of tshark's answer was there."""
            return self._parser.ended

        @property
        def last_line(self) -> str | None:
            """The last line on tshark's stderr."""
            line: str | None = self._last_error_line
            return line

        def _get_tshark_path(self) -> str:
            return str(self._program)

        def _setup_tshark_output_parser(self) -> Parser:
            return self._parser

        def _created_new_process(
            self, _parameters: list[str], process: asyncio.subprocess.Process, *_name: str
        ) -> None:
            # pyshark looks here for a status that may not be there yet: `status` is looked at later.
            self._running_processes.add(process)

        async def _cleanup_subprocess(self, process: asyncio.subprocess.Process) -> None:
            # pyshark kills a tshark that is about to end by itself, and then misreads its status.
            if process.returncode is None and not self.ended:
                process.kill()
            self.status = await process.wait()

    return Packets
