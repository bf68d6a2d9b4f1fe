"""Every case of `captures/field/cases.toml`, run as it stands there: what is said, and what no longer is.

The same cases are in ../shared, where newer ones may be; one that has no row here fails.
"""

from __future__ import annotations

import io
import shlex
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import pytest
from fake_tshark import real_tshark
from test_lua_analysis import VERSIONS, Source, compare

from ds47.analysis import analyze
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.lab import message
from ds47.lab.client import Client, drive
from ds47.lab.cyclic import INPUT, OUTPUT, PKW, PZD, Cyclic
from ds47.lab.stage import Stage
from ds47.model import CaptureResult
from ds47.report.sentences import advice
from ds47.spec import rules


class Said(NamedTuple):
    """The words that an answer has, and those that it must not have."""

    words: tuple[str, ...]
    never: tuple[str, ...] = ()


FILES: Final = {
    "record47-position.pcap": Said(
        ("EMPTY: 164 frames, no parameter transaction", "nothing shows that they are DS47: 82"), ("DS711",)
    ),
    "acknowledge-without-control.txt": Said(
        ("ignores the acknowledgement in STW1 0xFE", "control by PLC) is 0 (3 times)", "16#047E, then 16#04FE")
    ),
    "s7-drive.pcap": Said(
        (
            "data blocks with numbers of parameters", "(r2114[0] of drive object 1, if it is a drive)",
            "on a drive, ask for one element per item", "a drive has no such parameter there",
        )
    ),
    "s7-drive-elements.pcap": Said(
        ("OK: 1 S7 connection, 9 transactions", "DO 2 p1120[1] (Ramp-function generator, ramp-up time) = 25.0 s"),
        ("DS916", "DS907"),
    ),
    "s7-answer-too-long.pcap": Said(
        ("the answer would need 3018 bytes, the PDU has 240: 222 bytes fit in one job, so 14 jobs",)
    ),
    "data-exchange-refused.txt": Said(
        (
            "3 x data exchange refused by dp8 with RS: the last one before was 182.0 ms earlier",
            "frame 5) is 50 ms", "shorten the cycle of the master", "75.8 ms (182.0 ms)",
        )
    ),
    "serial-master.log": Said(("14 frames", "dp5 slave 806A"), ("not a capture",)),
    "read-0x11.pcap": Said(
        ("0x11: the drive does not execute the request in its present state; read again later",),
        ("DS719", "cannot be changed"),
    ),
    "len-0x18.pcap": Said(
        (
            "NOT OK: p2900 is refused: the record has 36 bytes, the message only 16",
            "number of elements 1, which agrees with the number of values",
            "Set LEN of WRREC to the length of the message",
            "Accepted with 16 bytes; the same request with 36 bytes",
        ),
        ("Not an array:",),
    ),
    "single-access.pcap": Said(
        ("0x23, several parameters: the drive takes one per request (PNU 974, subindex 1",
         "send a request for each"),
        ("DS315", "MLEN"),
    ),
    "mlen-then-right.pcap": Said(
        (
            "r0945[0..7] (Fault code) = 1355, 1355", "1 transaction, all with a response", "DS712",
            "asks for at most 10 bytes, but the response needs at least 22",
        ),
        ("orphan", "not in the capture", "start the capture before"),
    ),
    "vacon-10001.pcap": Said(
        (
            "vendor 0x01BA", "0x6B Request too short", "0x67 Invalid axis number (DO-ID)",
            "0x03 Invalid subindex; of PNU 10001: the drive has no parameter with this ID",
        ),
        ("DS717", "Manufacturer-specific"),
    ),
}  # fmt: skip
COMMANDS: Final = {
    "explain 8104": Said(("0x8104: error word of S7 communication: function is not supported", "C0810400")),
    "explain 8500": Said(("0x8500: error word of S7 communication: PDU has a wrong length", "C0850000")),
    "decode --as pkw-answer '7023 0000 0000 0068'": Said(
        ("error number 104: Manufacturer-specific error 104",), ("Illegal value",)
    ),
    "explain 81813F02": Said(("no device with the configured station name answers",)),
    "explain CF81FD20": Said(("the device was reset to factory settings by DCP",)),
    "decode --as request": Said(
        ("request, 16 bytes", "request_id 0x02 change", "axis 2", "p2900[0] := 10.0"), ("DS302", "unknown")
    ),
    "decode --as request '01 01 00 01 82 01 20 11 00 00'": Said(
        ("p8209[0].0x82 0x82 (Stöber: floating point), 1 element",), ("DS305", "16#10", "warning")
    ),
    "explain 'GET 2'": Said(("negative acknowledgement from the partner", "STATUS 2 = 16#0002")),
}  # fmt: skip
"""By the words behind `ds47`; what is printed in front of a pipe goes to stdin."""

OF_THE_PLUGIN: Final = (
    "acknowledge-without-control.txt", "data-exchange-refused.txt", "len-0x18.pcap", "mlen-then-right.pcap",
    "read-0x11.pcap", "record47-position.pcap", "single-access.pcap", "vacon-10001.pcap",
)  # fmt: skip
"""Those with the parameter channel, PKW or PZD."""


@pytest.fixture(params=["captures", "shared/captures"])
def folder(request: pytest.FixtureRequest, captures: Path) -> Path:
    """The cases of the checkout, and those beside it."""
    if request.param == "captures":
        return captures / "field"
    shared: Path = request.getfixturevalue("shared")
    found = shared / "captures/field"
    if not found.is_dir():
        pytest.skip("../shared has no cases")
    return found


@pytest.fixture
def run(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[[str, str | Path], str]:
    """Runs a command line of a case, with its FILE; what it says, on one line."""

    def said(line: str, file: str | Path) -> str:
        printed, _, behind = line.rpartition(" | ")
        if printed:
            text = shlex.split(printed)[1]
            monkeypatch.setattr("sys.stdin", io.StringIO(text.replace("\\n", "\n")))
        words = [str(file) if each == "FILE" else each for each in shlex.split(behind)[1:]]
        assert main(words) == 0, line
        out, err = capsys.readouterr()
        assert err == "", line
        return " ".join(out.split())

    return said


def check(text: str, wanted: Said) -> None:
    assert [each for each in wanted.words if each not in text] == []
    assert [each for each in wanted.never if each in text] == []


def test_every_case_says_what_is_right(folder: Path, run: Callable[[str, str | Path], str]) -> None:
    cases = tomllib.loads((folder / "cases.toml").read_text("utf-8"))["case"]
    seen = set()
    for case in cases:
        file = case.get("file", "")
        for line in case.get("command", ["ds47 report FILE"]):
            asked = line.rpartition(" | ")[2].removeprefix("ds47 ")
            wanted = FILES[file] if file else COMMANDS[asked]
            check(run(line, folder / file), wanted)
            seen.add(file or asked)
    assert seen == FILES.keys() | COMMANDS.keys()


@pytest.mark.parametrize("name", OF_THE_PLUGIN)
def test_the_plugin_says_the_same(
    captures: Path, name: str, run: Callable[[str, str | Path], str]
) -> None:
    line = f"ds47 report --engine tshark --tshark {shlex.quote(real_tshark())} FILE"
    check(run(line, captures / "field" / name), FILES[name])


def refused_by_pkw(folder: Path, vendor_id: int) -> Path:
    """A change of parameter 35 by PKW is answered with 7023 0000 0000 0068."""
    client = Client(Stage(), device=drive(vendor_id=vendor_id))
    line = Cyclic(client, (PKW, PZD), reduction=16)
    line.connect()
    for asked, answer in (
        ("", ""),
        ("2023000000000005", ""),
        ("2023000000000005", "7023000000000068"),
        ("", ""),
    ):
        line.say(PKW, OUTPUT, bytes.fromhex(asked.ljust(16, "0")))
        line.say(PKW, INPUT, bytes.fromhex(answer.ljust(16, "0")))
        line.cycle()
        line.cycle()
    path = folder / f"{vendor_id}.pcapng"
    path.write_bytes(recorded(client))
    return path


@pytest.mark.parametrize("engine", ["default", "tshark"])
@pytest.mark.parametrize(
    ("vendor_id", "wanted"),
    [
        (0x002A, Said(("104: Illegal value for this request",))),
        (0x0493, Said(("104: Manufacturer-specific error 104",), ("Illegal value",))),
        (0x0002, Said(("104: Parameter does not exist",), ("Illegal value",))),
    ],
)
def test_a_number_of_pkw_is_that_of_the_maker(
    engine: str, vendor_id: int, wanted: Said, tmp_path: Path, run: Callable[[str, str | Path], str]
) -> None:
    path = refused_by_pkw(tmp_path, vendor_id)
    tshark = f"--engine tshark --tshark {shlex.quote(real_tshark())}" if engine == "tshark" else ""
    check(run(f"ds47 report {tshark} FILE", path), wanted)


# Variations of cases that no other test has


def recorded(client: Client) -> bytes:
    file = io.BytesIO()
    with PcapngWriter(file, link_type=1) as writer:
        for shot in client.stage.shots:
            writer.write(shot.time_ns, shot.data)
    return file.getvalue()


def result_of(client: Client) -> CaptureResult:
    return analyze(io.BytesIO(recorded(client)))


def test_a_change_of_two_parameters_of_a_drive_that_takes_one() -> None:
    """It mirrors the number of parameters, and brings one block."""
    client = Client(Stage())
    pairs = [(message.address(pnu), message.real(1.0)) for pnu in (1120, 1121)]
    client.exchange(message.change(1, 1, *pairs), bytes((1, 0x82, 1, 2)) + message.error(0x23))
    findings = {each.rule: each for each in result_of(client).findings}
    assert findings.keys() == {"DS410", "DS701"}
    assert advice(rules()["DS701"], findings["DS701"].args).startswith("0x23, several parameters:")


def test_two_reads_that_were_too_short_leave_the_response_in_the_drive() -> None:
    client = Client(Stage())
    client.write(message.read(1, 1, message.address(945, 0, 8)))
    for room in (10, 16):
        client.refuse_read(client.ask_read(maximum=room), 0xDE80B100)
    client.read(message.answer(1, 1, 1, message.block(0x06, "H", *[7860] * 8)))
    result = result_of(client)
    (item,) = result.transactions
    assert (item.state, [each.values for each in item.parameters]) == ("ok", [[7860] * 8])
    assert {each.rule for each in result.findings} == {"DS201", "DS712"}


def refused_with_0x18(elements: int, values: int, behind: bytes) -> Client:
    client = Client(Stage())
    pair = message.address(2900, 0, elements), message.real(*[10.0] * values)
    refused = message.answer(1, 0x82, 1, message.error(0x18))
    client.exchange(message.change(1, 1, pair) + behind, refused)
    return client


COUNTED: Final = {
    (1, 1, bytes(20)): "record_longer", (0, 1, bytes(1)): "record_longer", (2, 2, b"\0\1"): "record_longer",
    (1, 1, b""): "counts_agree", (0, 1, b""): "counts_agree", (2, 1, bytes(20)): "counts", (1, 2, b""): "counts",
}  # fmt: skip


@pytest.mark.parametrize(("asked", "case"), COUNTED.items(), ids=str)
def test_what_0x18_can_mean(asked: tuple[int, int, bytes], case: str) -> None:
    told = [each for each in result_of(refused_with_0x18(*asked)).findings if each.rule == "DS717"]
    assert [each.args["case"] for each in told] == [case]


@pytest.mark.parametrize("version", VERSIONS)
def test_lua_counts_the_same(version: str, tmp_path: Path) -> None:
    sources = [Source(str(each), recorded(refused_with_0x18(*each)), False) for each in COUNTED]
    compare(version, "en", sources, tmp_path)
