"""Files that people write or keep, changed by chance: no command ends with the status of a fault of ours.

Each kind is changed in its own structure: tokens of a text, values of a document, parts of an archive. What is
found once becomes a case of test_hurtful_files.py. For longer: DS47_CHANCES=5000.
"""

from __future__ import annotations

import copy
import gzip
import io
import json
import os
import random
import re
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ds47.batch import settings
from ds47.cli import main
from ds47.regression import config

CHANCES = int(os.environ.get("DS47_CHANCES", "20"))
OURS = 70
TOKENS = [
    *"\0\t\n\r ;,|\"'#=[]{}", "\ufeff", "\u202e", "\x9b", "-1", "0", "65536", "9" * 20, "9" * 400, "1e400", "nan",
    "-inf", "0x", "0x" + "f" * 5000, "1,5", "٣.٥", "²", "25:61:61", "9999-12-31 23:59:59.999999999", "2026-13-45",
    "E5", "zz", "10 03 02 49 4E 16", "p1120[0..70000]", "p2900[3..1]", "F999999999", "true", "[[parameter]]",
    "[do.3]", "[cyclic]", '"""', "a.b=1", "*", "名", "a" * 300, "Data;Time us", "[" * 3000,
]  # fmt: skip
VALUES: list[Any] = [
    None, True, 0, -1, 1 << 64, 10**400, 1.5, "", "x", "9" * 50, [], {}, [[]], {"a": 1}, [None], [{}],
]  # fmt: skip
LOG = "Index;Time us;Dirn;Data\n1;100;Request;1003 0249 4E16\n2;200;Response;E5\n"
PLAIN = (
    "12:00:01.250 -> 10 03 02 49 4E 16\n[0.001250] E5\nDEBUG TX   10 03 02 49 4E 16\n1250 us E5\n"
)
DUMP = (
    "0000  00 11 22 33 44 55 66 77 88 99 aa bb 88 92 fe fe\n0010  01 02 03 04\n\n0000  00 11 22\n"
)
TABLE = "Number;Name;Unit;Type;Access;Values\np1120;Ramp;s;Float32;p;0: a; 1: b\nF07900;Motor;;;;\n"
LIST = """[list]
name = "x"\nvendor_id = 0x2A\ndevice_ids = [1, 2]\nfirmware = "4.7"
[[parameter]]\nnumber = 1120\nname = "Ramp"\naccess = "p"\ntype = "Float32"\nvalues = {0 = "a"}
[[message]]\nnumber = "F07900"\ntext = "Motor"
"""
GOLDEN = """p1120 = 4.5\np1121 = {value = 4.5, within = 0.1}\n"p2900[0..3]" = {min = 1.0, max = 10.0}
[do.3]\np1120 = 1\n[drive."press-1".do.3]\np1120 = 3
"""
GOLDEN_TABLE = (
    "drive,drive object,parameter,index,value,within\npress-1,3,p1120,0,4.5,0.1\n*,,p1121,,1,\n"
)
SETTINGS = """[cyclic]\npkw_layout = ["uss"]\nppo = ["3=ppo1"]\n[s7]\nports = [102]\ncpu = ["s7-300"]
[names]\nvendor = "SINAMICS"\n[report]\ntitle = "x"\ntz = "UTC"\n[tolerance]\nfloat_relative = 0.1
[[mask]]\npnu = 964\n[[ignore]]\nrule = "DS410"\ncapture = "*"\n[labels]\n"a/*" = "b"\n[check]\nfail_on = "error"
"""


def text(chance: random.Random, *texts: str) -> bytes:
    """One of the texts, with some tokens and pieces changed."""
    found = chance.choice(texts)
    for _ in range(chance.choice((1, 1, 2, 4))):
        at = chance.randrange(len(found) + 1)
        end = min(len(found), at + chance.choice((0, 1, 4, 16)))
        words = list(re.finditer(r"[^\s;,=|\[\]{}\"]+", found))
        kind = chance.randrange(5)
        if kind == 0 and words:
            word = chance.choice(words)
            found = found[: word.start()] + chance.choice(TOKENS) + found[word.end() :]
        elif kind == 1:
            found = found[:at]
        elif kind == 2:
            found = found[:at] + found[at:end] * chance.choice((2, 50)) + found[end:]
        else:
            found = found[:at] + chance.choice(TOKENS) + found[end:]
    return found.encode(chance.choice(("utf-8", "utf-8", "utf-8-sig", "utf-16")), "replace")


def document(chance: random.Random, found: Any) -> bytes:
    """A document with other values, keys and shapes somewhere."""
    found = copy.deepcopy(found)
    for _ in range(chance.choice((1, 1, 2, 4))):
        node, place = found, None
        while isinstance(node, (dict, list)) and node and chance.random() < 0.85:
            key = (
                chance.choice(list(node)) if isinstance(node, dict) else chance.randrange(len(node))
            )
            place, node = (node, key), node[key]
        if place is None:
            continue
        inside, key = place
        if chance.random() < 0.3:
            del inside[key]
        else:
            inside[key] = copy.deepcopy(chance.choice([*VALUES, [node] * 2, {"x": node}]))
    return json.dumps(found).encode()


def octets(chance: random.Random, data: bytes) -> bytes:
    """Bytes that are changed, gone, new, or cut."""
    found = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 8))):
        at, size = chance.randrange(len(found) + 1), chance.choice((1, 1, 4, 64))
        kind = chance.randrange(4)
        if kind == 0:
            found[at : at + size] = chance.randbytes(size)
        elif kind == 1:
            del found[at : at + size]
        elif kind == 2:
            found[at:at] = chance.randbytes(size)
        else:
            found = found[:at] or found
    return bytes(found)


class Place:
    """A folder with what commands read, one file of which is changed."""

    def __init__(self, folder: Path, captures: Path) -> None:
        self.folder, self.capture = folder, folder / "a.pcapng"
        shutil.copy(captures / "conversation-error.pcapng", self.capture)
        self.results = folder / "r"
        self.key, self.stored = folder / "key.json", folder / "a.ds47.json"
        main(["baseline", str(self.capture)])
        main(["report", "--results", str(self.results), str(self.capture)])
        words = ["--anonymise", "--key", str(self.key), "-o", str(folder / "x.pcapng")]
        main(["export", *words, str(self.capture)])
        self.documents = {
            path: json.loads(path.read_text())
            for path in (self.key, self.stored, self.results / "a.pcapng.json")
        }

    def put(self, name: str, data: bytes) -> Path:
        """Writes one of the files."""
        path = self.folder / name
        path.write_bytes(data)
        return path


def _log(place: Place, chance: random.Random) -> list[Any]:
    path = place.put("log.txt", text(chance, LOG, PLAIN, DUMP))
    return ["report", "-f", chance.choice(("text", "json", "html", "csv")), path]


def _list(place: Place, chance: random.Random) -> list[Any]:
    name, own = chance.choice((("l.toml", LIST), ("l.csv", TABLE)))
    return ["report", "--params", place.put(name, text(chance, own)), place.capture]


def _golden(place: Place, chance: random.Random) -> list[Any]:
    name, own = chance.choice((("g.toml", GOLDEN), ("g.csv", GOLDEN_TABLE)))
    return ["report", "--expect", place.put(name, text(chance, own)), place.capture]


def _settings(place: Place, chance: random.Random) -> list[Any]:
    place.put("ds47.toml", text(chance, SETTINGS))
    settings._nearest.cache_clear()
    config._for_folder.cache_clear()
    return [chance.choice(("report", "check")), place.capture]


def _workbook(place: Place, chance: random.Random) -> list[Any]:
    openpyxl = pytest.importorskip("openpyxl")
    book, parts = openpyxl.Workbook(), dict[str, bytes]()
    for row in (["Number", "Name"], ["p1120", "Ramp"], [945, True]):
        book.active.append(row)
    book.save(whole := io.BytesIO())
    with zipfile.ZipFile(whole) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    name = chance.choice(list(parts))
    changed = [octets(chance, parts[name]), text(chance, parts[name].decode()), b"", None]
    parts[name] = chance.choice(changed)  # type: ignore[assignment]
    with zipfile.ZipFile(found := io.BytesIO(), "w", zipfile.ZIP_DEFLATED) as archive:
        for each, data in parts.items():
            if data is not None:
                archive.writestr(each, data)
    data = found.getvalue()
    data = octets(chance, data) if chance.random() < 0.3 else data
    return ["params", "import", "--name", "x", place.put("l.xlsx", data)]


def _stored(place: Place, chance: random.Random) -> list[Any]:
    place.stored.write_bytes(document(chance, place.documents[place.stored]))
    return [
        *chance.choice((["check"], ["check", "-f", "json"], ["accept", "--yes"])),
        place.capture,
    ]


def _difference(place: Place, chance: random.Random) -> list[Any]:
    found = place.put("d.json", document(chance, place.documents[place.stored]))
    return ["diff", found, place.capture]


def _results(place: Place, chance: random.Random) -> list[Any]:
    path = place.results / "a.pcapng.json"
    whole = (
        json.dumps(place.documents[path]).replace('"captures": [', '"captures": [\n', 1).encode()
    )
    path.write_bytes(octets(chance, whole))
    return ["report", "--results", place.results, "--resume", place.capture]


def _key(place: Place, chance: random.Random) -> list[Any]:
    place.key.write_bytes(document(chance, place.documents[place.key]))
    target = place.folder / "y.pcapng"
    return ["export", "--anonymise", "--key", place.key, "--force", "-o", target, place.capture]


def _packed(place: Place, chance: random.Random) -> list[Any]:
    data = place.capture.read_bytes()
    pieces = [gzip.compress(data[at : at + 300]) for at in range(0, len(data), 300)]
    pieces.insert(
        chance.randrange(4), chance.choice((bytes(5), gzip.compress(b""), b"\x1f\x8b", b""))
    )
    return ["report", "-f", "csv", place.put("z.pcapng", octets(chance, b"".join(pieces)))]


KINDS: list[Callable[[Place, random.Random], list[Any]]] = [
    _log, _list, _golden, _settings, _workbook, _stored, _difference, _results, _key, _packed,
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__[1:])
def test_no_file_is_a_fault_of_ours(
    kind: Any, tmp_path: Path, captures: Path, capsys: Any, monkeypatch: Any
) -> None:
    monkeypatch.setenv("DS47_PARAMS", str(tmp_path / "lists"))
    place = Place(tmp_path, captures)
    for number in range(CHANCES):
        words = kind(place, random.Random(number))
        capsys.readouterr()
        status = main([str(each) for each in words])
        said = capsys.readouterr().err
        assert status != OURS, f"{kind.__name__} {number}: {said}"
        assert "internal fault" not in said
