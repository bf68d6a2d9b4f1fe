"""What is said of cyclic channels is true: requests in halves, requests without an edge, and without a drive.

Captures of others in ../shared say what is expected of them in their README; the rest is made by the lab.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path

import pytest
from test_cyclic_scenes import SCENES, capture
from test_lua_analysis import VERSIONS, Source, compare
from test_profibus_ppo import on_profibus

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.cyclic.named import parse
from ds47.lab import captured, ether, message
from ds47.lab.client import Client, drive
from ds47.lab.cyclic import INPUT, OUTPUT, Cyclic
from ds47.lab.cyclic_scenes import machine, parameters
from ds47.lab.drive import LabDrive, PkwParameter
from ds47.lab.machine import IDLE, OFF, ON, Machine
from ds47.lab.stage import Stage
from ds47.model import CaptureResult, Finding
from ds47.report.sentences import sentence

SENTENCES = Path(__file__).resolve().parents[3] / "shared" / "captures" / "sentences"
READ, HALF, WHOLE = (
    bytes.fromhex(each) for each in ("143a000000000000", "343a000000000000", "343a000042200000")
)


def of_others(name: str) -> CaptureResult:
    path = SENTENCES / name
    if not path.exists():
        pytest.skip("../shared is not there")
    return analyze(path)


def told(result: CaptureResult) -> tuple[list[str], list[str]]:
    """States of transactions, and rules."""
    return [each.state for each in result.transactions], [each.rule for each in result.findings]


def test_a_half_change_of_others_is_one() -> None:
    assert told(of_others("ppo1-half-change.pcap")) == (["ok", "ok"], ["DS506"])


def test_a_request_of_others_that_stands_from_the_first_exchange_on() -> None:
    assert told(of_others("ppo1-asked-from-first-exchange.pcap")) == (["ok"], [])


def of_rule(rule: str, result: CaptureResult) -> list[Finding]:
    return [each for each in result.findings if each.rule == rule]


def talk(*asked: tuple[bytes, int], pause: int = 3) -> bytes:
    """Requests, each for so many cycles, to a drive that stands."""
    stage = Stage()
    machine = Machine(Cyclic(Client(stage), reduction=4), LabDrive(cells=parameters(), pause=pause))
    machine.connect().control(OFF)
    for words, cycles in asked:
        machine.ask(words, cycles)
    return captured(stage)


def without_connect(
    content: bytes,
    ways: tuple[str, ...] = ("output", "input"),
    maker: int | None = None,
    *,
    first: bool = True,
) -> tuple[bytes, AnalysisOptions]:
    """These directions of the cyclic frames alone, their channels by name; DCP says the maker, first or last."""
    whole = analyze(io.BytesIO(content)).relations
    names = [
        f"{side.mac}@{side.frame_id:04x}:{side.offset}:{each.channel}"
        for each in whole for side in (each.output, each.input)
    ]  # fmt: skip
    kept = [getattr(each, way).mac for each in whole for way in ways]
    with open_capture(io.BytesIO(content)) as source:
        frames = [
            (each.time_ns, each.data) for each in source.everything()
            if each.data[12:14] == b"\x88\x92" and each.data[6:12].hex(":") in kept
        ]  # fmt: skip
    if maker is not None:
        at = 0 if first else len(frames) - 1
        said = frames[at][0], dcp(whole[0].input.mac, maker)
        frames.insert(0 if first else len(frames), said)
    target = io.BytesIO()
    with PcapngWriter(target) as writer:
        for time_ns, data in frames:
            writer.write(time_ns, data)
    return target.getvalue(), AnalysisOptions(cyclic=tuple(map(parse, names)))


def by_name(content: bytes, *ways: str) -> CaptureResult:
    named, options = without_connect(content, ways or ("output", "input"))
    return analyze(io.BytesIO(named), options)


IN_HALVES = ((IDLE, 20), (READ, 9), (HALF, 1), (WHOLE, 9), (IDLE, 5))
REPLACED = ((IDLE, 20), (READ, 9), (HALF, 2), (WHOLE, 9), (IDLE, 5))


@pytest.mark.parametrize("how", ["connect", "profibus", "named"])
def test_halves_are_a_cycle_apart_wherever_the_words_lie(how: str) -> None:
    def result(content: bytes) -> CaptureResult:
        if how == "profibus":
            bus = on_profibus(content)
            assert bus is not None
            return analyze(io.BytesIO(bus))
        return by_name(content) if how == "named" else analyze(io.BytesIO(content))

    assert told(result(talk(*IN_HALVES))) == (["ok", "ok"], ["DS506"])
    assert told(result(talk(*REPLACED))) == (["ok", "superseded", "ok"], ["DS504"])


def test_what_stands_in_the_first_exchange_is_asked_there() -> None:
    ended = ["DS110", "DS725"]
    for pause, cycles, state, rules in (
        (6, 40, "ok", []), (10_000, 40, "incomplete", ended), (10_000, 2600, "unanswered", ["DS514"]),
    ):  # fmt: skip
        bus = on_profibus(talk((READ, cycles), pause=pause))
        assert bus is not None
        assert told(analyze(io.BytesIO(bus))) == ([state], rules)


def test_of_one_direction_nothing_is_said_of_responses() -> None:
    content = talk((IDLE, 20), (READ, 9), (WHOLE, 9), (IDLE, 20))
    assert told(by_name(content)) == (["ok", "ok"], [])
    assert told(by_name(content, "output")) == (["superseded", "unanswered"], [])


DRIVE = "00:1f:f8:00:00:01"
FOREIGN, SIEMENS = 0x0493, 0x002A


def of_maker(vendor_id: int, *, trips: int = 0, error: int = 0, reads: int = 0) -> bytes:
    """A drive of some maker that runs, trips so often, and refuses a change."""
    stage = Stage()
    it = machine(Client(stage, device=drive(vendor_id=vendor_id))).start()
    for _ in range(trips):
        it.drive.fault = 30002
        it.run(0.2).control(0x04FE).run(0.2).control(OFF).run(0.5).control(ON).run(1)
    if error:
        it.drive.cells[700, 0].refused = error
        it.read(700).change(700, b"\0\2", ak=2)
    for _ in range(reads):
        it.change(1082, b"\x42\x20\0\0", ak=13)
    return captured(stage)


def printed(
    content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str], *options: str
) -> str:
    path = tmp_path / "machine.pcapng"
    path.write_bytes(content)
    assert main(["report", *options, str(path)]) == 0
    return capsys.readouterr().out


def test_a_drive_that_trips_is_not_ok(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(of_maker(SIEMENS, trips=3), tmp_path, capsys)
    assert "NOT OK" in text
    assert "DS520 error" in text
    text = printed(of_maker(FOREIGN, trips=3), tmp_path, capsys)
    assert "slot 2 had a fault while running, most recently until 08:00:" in text
    assert "DS520 note fault-while-running" in text
    assert "(3 times)" in text
    assert "Only a note, because the drive is not from Siemens" in text
    assert "仅为提示" in printed(of_maker(FOREIGN, trips=3), tmp_path, capsys, "--lang", "zh")
    page = printed(of_maker(FOREIGN, trips=3), tmp_path, capsys, "-f", "html")
    assert "Only a note, because the drive is not from Siemens" in page
    assert "OK: 1 drive in cyclic frames" in printed(of_maker(FOREIGN), tmp_path, capsys)


def test_not_ok_has_its_cause_whoever_made_the_drive(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = printed(of_maker(FOREIGN, error=17), tmp_path, capsys)
    assert "NOT OK: p0700[0] is refused by PKW: 17 Not possible" in text
    assert "DS501 note pkw-error" in text
    assert "Not possible in this operating state" in text


@pytest.mark.parametrize(
    ("vendor_id", "error", "words"),
    [
        (FOREIGN, 17, "17 Not possible in this operating state"),
        (FOREIGN, 107, f"see the manual of rt-labs, vendor 0x{FOREIGN:04X}"),
        (SIEMENS, 107, "107 No change while the controller is enabled"),
    ],
)
def test_of_other_makers_only_numbers_of_the_profile_have_words(
    vendor_id: int, error: int, words: str
) -> None:
    result = analyze(io.BytesIO(of_maker(vendor_id, error=error)))
    (found,) = of_rule("DS501", result)
    assert (found.args["code"], found.args["vendor_id"]) == (error, vendor_id)
    assert sentence(found).endswith(words)
    (failed,) = [each.parameters[0].error for each in result.transactions if each.state == "error"]
    assert failed is not None
    assert failed.text
    assert f"{error} {failed.text}".endswith(words)


def test_that_a_change_saves_is_said_of_the_maker_whose_table_it_is() -> None:
    assert told(analyze(io.BytesIO(of_maker(FOREIGN, reads=12))))[1] == []
    assert told(analyze(io.BytesIO(of_maker(SIEMENS, reads=12))))[1] == ["DS508"]


@pytest.mark.parametrize(
    ("vendor_id", "given", "severity"),
    [
        (FOREIGN, None, "note"), (SIEMENS, None, "error"), (None, None, "note"),
        (None, SIEMENS, "error"), (FOREIGN, SIEMENS, "note"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("first", [True, False])
def test_a_channel_named_by_hand_is_judged_by_the_vendor_that_the_capture_names(
    vendor_id: int | None, given: int | None, severity: str, first: bool
) -> None:
    """DCP says it before the words, or behind them; else --vendor. Where nothing does, all are notes."""
    content, options = without_connect(of_maker(SIEMENS, error=17), maker=vendor_id, first=first)
    result = analyze(io.BytesIO(content), options._replace(vendor_id=given))
    assert [each.severity for each in of_rule("DS501", result)] == [severity]


def dcp(mac: str, vendor_id: int) -> bytes:
    """An identify response of a station: its vendor and device id."""
    block = struct.pack(">BBHHHH", 2, 3, 6, 0, vendor_id, 0x0501)
    head = struct.pack(">HBBIHH", 0xFEFF, 5, 1, 1, 0, len(block))
    return ether.bare(mac, "00:1c:06:00:00:01", 0x8892, head + block)


@pytest.mark.parametrize("version", VERSIONS)
def test_lua_says_the_same(version: str, tmp_path: Path) -> None:
    halves, silent = talk(*IN_HALVES), talk((READ, 40), pause=10_000)
    foreign = of_maker(FOREIGN, trips=2, error=107, reads=12)
    plain = [halves, silent, foreign, *filter(None, map(on_profibus, (halves, silent, foreign)))]
    compare(version, "en", [Source(str(n), each, False) for n, each in enumerate(plain)], tmp_path)
    for content, maker in ((halves, None), (foreign, None), (foreign, FOREIGN), (foreign, SIEMENS)):
        named, options = without_connect(content, maker=maker, first=False)
        compare(version, "en", [Source("named", named, False)], tmp_path, options)
        given = options._replace(vendor_id=SIEMENS)
        compare(version, "en", [Source("given", named, False)], tmp_path, given)


def offered(text: str) -> list[str]:
    """The words of the line with which a report offers to follow channels."""
    return next((each.split() for each in text.splitlines() if "--cyclic" in each), [])


def noise() -> bytes:
    """Cyclic frames of a remote I/O: values that count, and states that are good."""
    stage = Stage()
    line = Cyclic(Client(stage), reduction=4)
    line.connect()
    for number in range(400):
        for module in line.modules:
            for kind in (INPUT, OUTPUT):
                line.say(module, kind, (number * 77 * kind).to_bytes(module.length))
        line.cycle()
    return captured(stage)


@pytest.mark.parametrize("name", ["start-and-stop", "fault", "fault-with-number", "long-ramp"])
def test_offsets_are_offered_that_the_frames_show(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = capture(SCENES[name])
    (drive_,) = [each for each in analyze(io.BytesIO(content)).relations if each.channel == "pzd"]
    bare, _ = without_connect(content)
    text = printed(bare, tmp_path, capsys)
    assert offered(text)[1::2] == [
        f"{side.mac}@{side.frame_id:04X}:{side.offset}:pzd"
        for side in (drive_.output, drive_.input)
    ]
    followed = printed(bare, tmp_path, capsys, *offered(text))
    assert "Control and status word, 00:1f" in followed


def test_where_frames_show_nothing_there_is_a_form_to_fill_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = noise()
    whole = analyze(io.BytesIO(content))
    assert [each.channel for each in whole.relations] == ["pkw"]
    with open_capture(io.BytesIO(content)) as source:
        frames = [each for each in source.everything() if each.data[12:14] == b"\x88\x92"]
    path = tmp_path / "noise.pcapng"
    with PcapngWriter(path) as writer:
        for each in frames:
            writer.write(each.time_ns, each.data)
    assert main(["report", str(path)]) == 0
    words = offered(capsys.readouterr().out)
    assert [each.split("@")[1] for each in words[1::2]] == ["8002:OFFSET:pzd", "8001:OFFSET:pzd"]
    for named in (
        [each.replace("OFFSET", str(at)) for each in words[1::2]] for at in range(0, 14, 3)
    ):
        result = analyze(path, AnalysisOptions(cyclic=tuple(map(parse, named))))
        assert result.findings == []


@pytest.mark.parametrize("version", VERSIONS)
def test_bytes_of_pkw_that_are_named_as_control_word_are_none(version: str, tmp_path: Path) -> None:
    """PKE 9033 is no ON, though its bit 0 is 1."""
    asked = [
        (bytes.fromhex(each) + bytes(4), 6)
        for each in ("1032 0000", "1033 0000", "9033 0000", "143b 0000")
    ]
    content, _ = without_connect(talk((IDLE, 20), *asked, (IDLE, 5), pause=10_000))
    names = ("00:1c:06:00:00:01@8002:0:pzd", "00:1f:f8:00:00:01@8001:0:pzd")
    options = AnalysisOptions(cyclic=tuple(map(parse, names)))
    result = analyze(io.BytesIO(content), options)
    assert result.findings == []
    assert [each.certainty for each in result.relations] == ["odd"]
    assert result.timelines == []
    compare(version, "en", [Source("named", content, False)], tmp_path, options)


def test_bits_that_few_use_refute_nothing_and_prove_less() -> None:
    """Bit 15 of STW1, as telegram 20 has it: the words alone prove no drive, its reaction to ON does."""

    def with_bit(scene: str) -> bytes:
        target = io.BytesIO()
        with (
            open_capture(io.BytesIO(capture(SCENES[scene]))) as source,
            PcapngWriter(target) as writer,
        ):
            for each in source.everything():
                data = bytearray(each.data)
                if data[12:16] == b"\x88\x92\x80\x02":
                    data[16 + (0 if "number" in scene else 9)] |= 0x80
                writer.write(each.time_ns, bytes(data))
        return target.getvalue()

    running = analyze(io.BytesIO(with_bit("fault-with-number")))
    assert [each.rule for each in running.findings] == ["DS520"]
    plain = capture(SCENES["on-without-control"])
    _, options = without_connect(plain)
    for content, rules in ((plain, ["DS522"]), (with_bit("on-without-control"), [])):
        result = analyze(io.BytesIO(without_connect(content)[0]), options)
        assert [each.rule for each in result.findings] == rules
        assert [each.certainty for each in result.relations] == [
            "named",
            "named" if rules else "odd",
        ]


@pytest.mark.parametrize("version", VERSIONS)
def test_a_value_of_unknown_type_has_its_signed_reading_beside_it(
    version: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stage = Stage()
    it = machine(Client(stage)).start()
    for pnu, value in ((1234, "ffe7"), (1235, "7fff"), (1236, "fffeee90"), (1237, "00000005")):
        it.drive.cells[pnu, 0] = PkwParameter(bytes.fromhex(value), double=len(value) > 4)
        it.read(pnu)
    content = captured(stage)
    text = printed(content, tmp_path, capsys)
    for line in (
        "p1234[0] = 65511 (signed -25)",
        "p1235[0] = 32767 ",
        "p1236[0] = 4294897296 (signed -70000)",
        "= 5 ",
    ):
        assert line in text
    assert "65511（有符号数 -25）" in printed(content, tmp_path, capsys, "--lang", "zh")
    compare(version, "en", [Source("signed", content, False)], tmp_path)


def test_a_drive_stands_once_whose_channels_are_named_by_hand(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A record shows its address, its PKW is known by its MAC address; the Connect is not in the capture."""
    stage = Stage()
    client = Client(stage)
    machine(client).start().read(700)
    asked = message.read(1, 2, message.address(50304))
    client.exchange(asked, message.answer(1, 1, 2, message.real(10.0)))
    _, options = without_connect(captured(stage))
    path = tmp_path / "running.pcapng"
    with (
        open_capture(io.BytesIO(captured(stage))) as source,
        PcapngWriter(path) as writer,
    ):
        for each in source.everything():
            if each.number > 2:
                writer.write(each.time_ns, each.data)
    result = analyze(path, options)
    assert {each.device for each in result.transactions} == {DRIVE, "192.168.133.33"}
    names = [f"{each.mac}@{each.frame_id:X}:{each.offset}:{each.kind}" for each in options.cyclic]
    given = [word for name in names for word in ("--cyclic", name)]
    assert main(["report", *given, str(path)]) == 0
    text = capsys.readouterr().out
    assert ": 1 drive, 2 transactions, all done" in text
    assert "Other devices" not in text
    (line,) = [each for each in text.splitlines() if each.startswith("  192.168.133.33  ")]
    assert "2 transactions, all done" in line
    assert main(["report", "-f", "html", *given, str(path)]) == 0


def test_what_stands_in_the_frames_to_another_makers_drive_is_not_ok(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for vendor_id, severity in ((SIEMENS, "warning"), (FOREIGN, "note")):
        stage = Stage()
        machine(Client(stage, device=drive(vendor_id=vendor_id)), pause=10_000).start().read(
            700, cycles=40
        )
        text = printed(captured(stage), tmp_path, capsys)
        assert text.splitlines()[1].startswith("WARNING")
        assert f"DS514 {severity}" in text
    bus = on_profibus(talk((IDLE, 5), (READ, 2600), pause=10_000))
    assert bus is not None
    text = printed(bus, tmp_path, capsys)
    assert "WARNING: what looks like a PKW request has no response" in text
    assert "DS514 warning" in text
