"""`ds47 export`: which frames, in which order, with which words; and the commands of its page."""

from __future__ import annotations

import gzip
import io
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from uuid import UUID

import frames as make
import pytest
from frames import whole_frames
from ringbuffer import NIGHT, pieces, recording, ring, write
from test_readme import Command, read_commands, run

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import Frame, Interface, PcapngWriter, WholeFrame, open_capture
from ds47.capture.series import SeriesPart
from ds47.cli import main
from ds47.export import Replacements, Selection, SelectionError, display_filter, export, first_time
from ds47.export.drafts import Drafts
from ds47.export.earlier import OF_THE_ORIGINAL, is_earlier_export
from ds47.export.tracking import Copy, TrackedMessage, Tracker
from ds47.lab import wire
from ds47.lab.wire import Call
from ds47.model import PKW, Transaction
from ds47.profinet.traces import MOST_COPIES, DatagramPiece, Trace
from ds47.spec.semantics import limits

ROOT = Path(__file__).resolve().parents[2]
WITHOUT_PROOF = AnalysisOptions(indices=frozenset((47,)), ppos=((3, 1),))
"""What is not in the frames of a transaction alone: whose index 47 is, and which PPO station 3 has."""
"""One broken message alone does not prove that index 47 is a parameter channel."""
CAPTURES = ROOT / "captures"
TOUR = CAPTURES / "tour-machine.pcapng"
PAGE = ROOT / "docs" / "export.md"


def exported(source: Path, target: Path, **wanted: object) -> tuple[list[int], list[WholeFrame]]:
    """Numbers of the exported frames in the original, and what is in the copy."""
    outcome = export(source, target, Selection(**wanted))  # type: ignore[arg-type]
    return outcome.frames, list(whole_frames(target)) if outcome.frames else []


def numbered(source: Path) -> dict[int, WholeFrame]:
    return {frame.number: frame for frame in whole_frames(source)}


@pytest.mark.slow
@pytest.mark.parametrize("source", sorted(CAPTURES.rglob("*.pcapng")), ids=lambda p: p.stem)
def test_every_transaction_alone(source: Path, tmp_path: Path) -> None:
    """Its frames are all there, byte for byte, and the analysis finds the transaction in them."""
    originals = numbered(source)
    result = analyze(source)
    chosen = result.transactions[:: max(1, len(result.transactions) // 5)]
    for transaction in chosen:
        frames, copies = exported(
            source, tmp_path / "t.pcapng", transactions=((transaction.id,) * 2,)
        )
        assert set(transaction.frames.all()) <= set(frames)
        for number, copy in zip(frames, copies, strict=True):
            original = originals[number]
            assert (copy.time_ns, copy.data, copy.original_length) == (
                original.time_ns, original.data, original.original_length,
            )  # fmt: skip
            assert copy.interface.link_type == original.interface.link_type
            assert copy.interface.snap_length == original.interface.snap_length
        after = [each for each in analyze(tmp_path / "t.pcapng", WITHOUT_PROOF).transactions
                 if each.start_ns == transaction.start_ns]  # fmt: skip
        if transaction.channel == PKW:
            assert plain(transaction) in map(plain, after)
        elif transaction.state in ("ok", "partial", "error", "mismatch", "refused"):
            for item in [item for each in after for item in each.parameters]:
                if item.described is not None:  # in a frame that came along
                    told = tuple(frames[frame - 1] for frame in item.described.frames)
                    item.described = item.described._replace(frames=told)
            if transaction.station is not None:  # whose parameters it has is said in other frames
                for item in transaction.parameters + [
                    item for each in after for item in each.parameters
                ]:
                    item.listed = item.unit = item.family = None
            assert transaction.parameters in [each.parameters for each in after]


def plain(transaction: Transaction) -> list[Any]:
    """Parameters without what only a start-up tells: whose drive it is, so units."""
    return [(each.pnu, each.subindex, each.values) for each in transaction.parameters]


@pytest.mark.parametrize("name", ["transport-ip-fragments", "transport-rpc-fragments",
                                  "transport-ip-fragments-disorder"])  # fmt: skip
def test_all_fragments_come_along(name: str, tmp_path: Path) -> None:
    source = CAPTURES / f"{name}.pcapng"
    frames, copies = exported(source, tmp_path / "t.pcapng", transactions=((1, 1),))
    assert len(frames) > len(analyze(source).transactions[0].frames.all())
    assert frames == sorted(frames)
    texts = ["\n".join(copy.comments) for copy in copies]
    assert any("1. of" in text for text in texts)
    assert analyze(tmp_path / "t.pcapng").transactions[0].state == "ok"


def test_incomplete_fragments_of_a_finding(tmp_path: Path) -> None:
    for kind in ("ip", "rpc"):
        source = CAPTURES / f"transport-{kind}-fragments-incomplete.pcapng"
        frames, _ = exported(source, tmp_path / f"{kind}.pcapng", rules=("DS105",))
        assert frames
        after = analyze(tmp_path / f"{kind}.pcapng", WITHOUT_PROOF)
        assert "DS105" in [each.rule for each in after.findings]


def test_comments_say_what_is_wrong(tmp_path: Path) -> None:
    frames, copies = exported(TOUR, tmp_path / "t.pcapng", states=("refused",))
    (text,) = copies[frames.index(23)].comments
    assert text.splitlines()[0] == "DS47 #5 [refused]: Write response (change p50303[0], DO 2)"
    assert "DS203 error: Write refused with status DF80B500" in text
    assert text.splitlines()[-1] == "frame 23 of the original"


def test_wireshark_shows_the_comment(tmp_path: Path, tshark: Callable[..., str]) -> None:
    exported(TOUR, tmp_path / "t.pcapng", states=("refused",))
    shown = tshark("-r", tmp_path / "t.pcapng", "-V", "-Y", 'frame.comment contains "DS203"')
    assert "Write refused with status DF80B500" in shown


def test_criteria_apply_together(tmp_path: Path) -> None:
    result = analyze(TOUR)
    first = result.transactions[0].start_ns
    target = tmp_path / "t.pcapng"
    both = exported(TOUR, target, rules=("DS410",))[0]
    assert both == [26, 27, 28, 29, 30, 31, 32, 33]
    assert exported(TOUR, target, rules=("DS410",), states=("partial",))[0] == [30, 31, 32, 33]
    assert exported(TOUR, target, transactions=((1, 2), (6, 6)), rules=("DS4",))[0] == both[:4]
    assert exported(TOUR, target, states=("ok",), end=first)[0] == [2, 3, 4, 5]
    refused = exported(TOUR, target, devices=("press-1-drive",), states=("refused",))[0]
    assert refused == [18, 19, 20, 21, 22, 23, 24, 25]  # with the open request that is the cause
    assert exported(TOUR, target, devices=("192.168.133.33",))[0] == list(range(1, 38))
    assert exported(TOUR, target, states=("orphan",))[0] == []


def test_a_copy_of_what_failed_has_the_same_causes(tmp_path: Path) -> None:
    target = tmp_path / "t.pcapng"
    exported(TOUR, target, states=("refused", "error", "partial"))
    causes = {each.rule for each in analyze(TOUR).diagnoses} - {
        "DS721"
    }  # of a change that did not fail
    assert {each.rule for each in analyze(target).diagnoses} == causes
    assert exported(TOUR, target, transactions=((5, 5),))[0] == [22, 23]


def test_a_time_span_is_inclusive(tmp_path: Path) -> None:
    start = first_time(TOUR)
    assert start is not None
    frames, _ = exported(TOUR, tmp_path / "t.pcapng", start=start, end=start + 4_000_000)
    assert frames == [1, 2, 3, 4, 5]


def test_transactions_count_of_which_a_frame_was_written(tmp_path: Path) -> None:
    first, *_, last = analyze(TOUR).transactions
    for start, end, number in (
        (None, None, 8), (first.start_ns, first.start_ns, 1), (first.start_ns + 1, last.start_ns, 8),
        (last.start_ns, None, 1), (0, 1, 0),
    ):  # fmt: skip
        assert (
            export(TOUR, tmp_path / "t.pcapng", Selection(start=start, end=end)).transactions
            == number
        )


def test_what_there_is_not(tmp_path: Path) -> None:
    with pytest.raises(SelectionError, match="no transaction 9; it has 1 to 8"):
        export(TOUR, tmp_path / "t.pcapng", Selection(transactions=((9, 9),)))
    with pytest.raises(SelectionError, match=r"no device 'x'; there is 192\.168\.133\.33"):
        export(TOUR, tmp_path / "t.pcapng", Selection(devices=("x",)))
    assert not list(tmp_path.iterdir())


def mixed(path: Path) -> None:
    """Two interfaces of different link types, times to the nanosecond, comments, foreign frames."""
    big = make.option(9, b"\x09") + make.option(2, b"left port") + make.option(0, b"")
    binary = make.option(9, b"\x94") + make.option(0, b"")  # 2^-20 s
    comment = make.option(1, b"look here") + make.option(2, b"\1\0\0\0") + make.option(0, b"")
    body = make.enhanced(make.call(), number=0, stamp=1_700_000_000_123_456_789)
    body = body[8:-4] + comment
    raw = make.ipv4(make.udp(make.rpc()))
    path.write_bytes(
        make.section()
        + make.interface(snap=333, options=big)
        + make.interface(link_type=101, options=binary)
        + make.block(6, body)
        + make.enhanced(make.DNS, number=0, stamp=1_700_000_000_200_000_000)
        + make.enhanced(raw, number=1, stamp=(1_700_000_000 << 20) + (1 << 19))
        + make.block(0x0BAD, b"\0\0\x7e\xd9abcd")
        + make.section()
        + make.interface(link_type=1)
        + make.enhanced(make.LLDP, stamp=1_700_000_001_000_000)
    )


def test_interfaces_times_and_comments_stay(tmp_path: Path) -> None:
    source, target = tmp_path / "in.pcapng", tmp_path / "out.pcapng"
    mixed(source)
    frames, copies = exported(source, target)
    assert frames == [1, 3, 5]
    assert [copy.time_ns for copy in copies] == [
        1_700_000_000_123_456_789, 1_700_000_000_500_000_000, 1_700_000_001_000_000_000,
    ]  # fmt: skip
    assert [copy.interface.link_type for copy in copies] == [1, 101, 1]
    assert copies[0].interface.snap_length == 333
    assert (2, b"left port") in copies[0].interface.options
    assert copies[0].comments[0] == "look here"
    assert copies[0].flags == 1
    assert exported(source, target, all_frames=True)[0] == [1, 2, 3, 5]


def test_capinfos_agrees(tmp_path: Path, tshark: Callable[..., str]) -> None:
    source, target = tmp_path / "in.pcapng", tmp_path / "out.pcapng"
    mixed(source)
    exported(source, target)
    shown = tshark("-r", target, "-T", "fields", "-e", "frame.time_epoch", "-e",
                   "frame.interface_id", "-e", "frame.encap_type")  # fmt: skip
    assert [line.split("\t")[:2] for line in shown.splitlines()] == [
        ["1700000000.123456789", "0"], ["1700000000.500000000", "1"],
        ["1700000001.000000000", "2"],
    ]  # fmt: skip


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("magic", [0xA1B2C3D4, 0xA1B23C4D, 0xA1B2CD34])
def test_every_frame_of_a_pcap(order: str, magic: int, tmp_path: Path) -> None:
    source = tmp_path / "in.pcap"
    source.write_bytes(make.pcap([make.RT, make.call(), make.DNS], order=order, magic=magic))
    fraction = 5 if magic == 0xA1B23C4D else 5000
    assert [(frame.number, frame.time_ns, frame.data) for frame in whole_frames(source)] == [
        (1, 1000 * 10**9 + fraction, make.RT), (2, 1001 * 10**9 + fraction, make.call()),
        (3, 1002 * 10**9 + fraction, make.DNS),
    ]  # fmt: skip
    assert exported(source, tmp_path / "out.pcapng")[0] == [2]


@pytest.mark.parametrize("source", sorted(CAPTURES.glob("*.pcapng"))[::9], ids=lambda p: p.stem)
def test_both_readers_number_alike(source: Path) -> None:
    raw = numbered(source)
    for frame in open_capture(source):
        same = raw[frame.number]
        assert (same.time_ns, same.data, same.original_length, same.interface.link_type) == (
            frame.time_ns, frame.data, frame.original_length, frame.link_type,
        )  # fmt: skip


def test_a_damaged_capture_gives_what_is_before(tmp_path: Path) -> None:
    whole = TOUR.read_bytes()
    for cut in (len(whole) - 7, len(whole) // 2, 300):
        source = tmp_path / "in.pcapng"
        source.write_bytes(whole[:cut])
        frames, _ = exported(source, tmp_path / "out.pcapng")
        assert frames == list(range(1, analyze(source).frames + 1))


# The filter


def test_filter() -> None:
    assert display_filter([7]) == ("frame.number == 7", 0)
    assert display_filter([3, 1, 2, 9, 8, 5, 5]) == (
        "frame.number in {1..3} or frame.number == 5 or frame.number in {8..9}", 0,
    )  # fmt: skip
    text, left_out = display_filter(range(0, 200, 2))
    assert text.count("frame.number") == 60
    assert left_out == 40


def test_tshark_takes_the_filter(tshark: Callable[..., str]) -> None:
    result = analyze(TOUR)
    frames = [frame for each in result.transactions[1::2] for frame in each.frames.all()]
    text, _ = display_filter(frames)
    shown = tshark("-r", TOUR, "-Y", text, "-T", "fields", "-e", "frame.number")
    assert [int(line) for line in shown.split()] == sorted(frames)


def test_no_set_has_two_elements() -> None:
    """Wireshark 3.4 wants blanks between them, 4.0 commas."""
    text, _ = display_filter([1, 2, 3, 7, 9, 10, 20])
    assert all(re.fullmatch(r"\d+\.\.\d+", inner) for inner in re.findall(r"\{(.*?)\}", text))


# The writer


def test_writer_keeps_its_old_bytes() -> None:
    stream = io.BytesIO()
    with PcapngWriter(stream) as writer:
        writer.write(5, b"abc", comment="x")
    interface = make.interface(options=make.option(9, b"\x09") + make.option(0, b""))
    body = make.enhanced(b"abc", stamp=5)[8:-4] + make.option(1, b"x") + make.option(0, b"")
    assert stream.getvalue() == make.section() + interface + make.block(6, body)


def test_writer_refuses_an_interface_that_is_not_there() -> None:
    with PcapngWriter(io.BytesIO(), link_type=None) as writer:
        with pytest.raises(ValueError, match="no interface 0"):
            writer.write(5, b"abc")
        assert writer.add_interface(113) == 0
        assert writer.add_interface(1) == 1
        with pytest.raises(ValueError, match="no interface 2"):
            writer.write(5, b"abc", interface=2)


def test_a_long_comment_is_cut_between_characters(tmp_path: Path) -> None:
    with PcapngWriter(tmp_path / "t.pcapng") as writer:
        writer.write(5, b"abc", comment="ä" * 40_000)
    (frame,) = whole_frames(tmp_path / "t.pcapng")
    assert frame.comments == ["ä" * 0x7FFE]


# The command


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(CAPTURES, tmp_path / "captures")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_default_name_and_what_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "captures/tour-machine.pcapng", "-t", "5,7-8"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "captures/tour-machine.pcapng: 8 of 37 frames, 3 transactions",
        "  written to tour-machine.ds47.pcapng",
        "  in the original: frame.number in {22..23} or frame.number in {30..35}",
    ]
    assert analyze("tour-machine.ds47.pcapng").summary["transactions"] == 3


@pytest.mark.parametrize(
    ("arguments", "count"),
    [(["--from", "0.25", "--to", "0.3"], 8), (["--to", "0.004"], 5),
     (["--from", "2026-01-01T08:00:01.195Z"], 12),
     (["--from", "2026-01-01T09:00:01.195000001+01:00"], 11),
     (["--from", "2026-01-01 08:00:01.195"], 12), (["--from", "2027-01-01"], 0)],
)  # fmt: skip
def test_times(folder: Path, arguments: list[str], count: int) -> None:
    status = main(["export", "captures/tour-machine.pcapng", *arguments])
    assert status == (0 if count else 1)
    if count:
        assert len(list(whole_frames("tour-machine.ds47.pcapng"))) == count


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["--from", "noon"], "is not a time"), (["-t", "x"], "12, 3-7 or 1,4,9"),
     (["-t", "7-3"], "backwards"), (["-t", "99"], "it has 1 to 8"), (["--rule", "DS99"], "no rule"),
     (["--device", "1.2.3.4"], "no device"), (["--key", "k"], "need --anonymise"),
     (["--all-frames", "-t", "1"], "--all-frames goes with"),
     (["--all-frames", "--anonymise"], "nobody can tell"),
     (["-o", "captures/tour-machine.pcapng"], "a capture to read"),
     (["--anonymise", "-o", "-"], "needs --key"),
     (["-o", "no/such/folder/x"], "cannot write")],
)  # fmt: skip
def test_wrong_use(
    folder: Path, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", "captures/tour-machine.pcapng", *arguments]) == 2
    assert words in capsys.readouterr().err
    assert [path.name for path in folder.iterdir()] == ["captures"]


def test_a_capture_that_is_there_stays(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = folder / "other.pcapng"
    shutil.copy(CAPTURES / "record-polls.pcapng", other)
    arguments = ["export", "captures/tour-machine.pcapng", "-t", "5", "-o", "other.pcapng"]
    assert main(arguments) == 2
    assert "other.pcapng is a capture" in (said := capsys.readouterr().err)
    assert "--force" in said
    assert other.read_bytes() == (CAPTURES / "record-polls.pcapng").read_bytes()
    assert main([*arguments, "--force"]) == 0
    assert len(list(whole_frames(other))) == 2
    assert main(["export", "other.pcapng", "-o", "other.pcapng", "--force"]) == 2


def test_an_earlier_export_is_replaced(folder: Path) -> None:
    for more in ([], ["-o", "."], ["-o", "tour-machine.ds47.pcapng"]):
        for chosen, frames in (("5", 2), ("7-8", 6)):
            assert main(["export", "captures/tour-machine.pcapng", "-t", chosen, *more]) == 0
            assert len(list(whole_frames("tour-machine.ds47.pcapng"))) == frames


def test_a_recording_of_that_name_is_no_earlier_export(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = folder / "tour-machine.ds47.pcapng"
    recording = (CAPTURES / "record-polls.pcapng").read_bytes()
    assert main(["export", "captures/tour-machine.pcapng", "-t", "5"]) == 0
    ours = target.read_bytes()
    for data in (recording, ours + recording, gzip.compress(recording)):
        target.write_bytes(data)
        assert main(["export", "captures/tour-machine.pcapng", "-t", "5"]) == 2
        assert "tour-machine.ds47.pcapng is a capture" in capsys.readouterr().err
        assert target.read_bytes() == data
    assert main(["export", "captures/tour-machine.pcapng", "-t", "5", "--force"]) == 0
    assert "over the capture that was there (--force)" in capsys.readouterr().out
    assert target.read_bytes() == ours
    assert main(["export", "captures/tour-machine.pcapng", "-t", "5", "--force"]) == 0
    assert "over the capture" not in capsys.readouterr().out


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
@pytest.mark.parametrize("more", [[], ["--force"], ["-o", "tour-machine.ds47.pcapng"]])
@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_not_followed(
    folder: Path, there: bool, more: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    recording = folder / "recording.pcapng"
    if there:
        shutil.copy(CAPTURES / "record-polls.pcapng", recording)
    link = folder / "tour-machine.ds47.pcapng"
    link.symlink_to(recording)
    assert main(["export", "captures/tour-machine.pcapng", "-t", "5", *more]) == 2
    said = capsys.readouterr().err
    assert f"it is a link to {recording}, and links are not followed" in said
    assert link.is_symlink()
    assert recording.exists() == there
    if there:
        assert recording.read_bytes() == (CAPTURES / "record-polls.pcapng").read_bytes()
    with pytest.raises(OSError, match="links are not followed"):
        export(TOUR, link, Selection())


@pytest.mark.skipif(sys.platform == "win32", reason="its devices are no files")
def test_a_link_to_a_device_is_no_file(folder: Path) -> None:
    (folder / "nowhere").symlink_to("/dev/null")
    assert main(["export", "captures/tour-machine.pcapng", "-t", "5", "-o", "nowhere"]) == 0
    assert (folder / "nowhere").is_symlink()


def test_a_long_comment_loses_its_end(folder: Path) -> None:
    with PcapngWriter(folder / "x.pcapng", application="ds47 1.0") as writer:
        writer.write(0, b"frame", comments=["é" * 40_000 + OF_THE_ORIGINAL])
        writer.write(0, b"frame", comments=[f"frame 2{OF_THE_ORIGINAL}"])
    assert is_earlier_export(folder / "x.pcapng")
    with PcapngWriter(folder / "x.pcapng", application="ds47 1.0") as writer:
        writer.write(0, b"frame", comments=["frame 2"])
    assert not is_earlier_export(folder / "x.pcapng")


def test_several_captures_into_a_folder(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "out").mkdir()
    names = ["captures/tour-machine.pcapng", "captures/record-polls.pcapng"]
    assert main(["export", *names, "-o", "out", "--state", "ok"]) == 0
    assert sorted(path.name for path in (folder / "out").iterdir()) == [
        "record-polls.ds47.pcapng", "tour-machine.ds47.pcapng",
    ]  # fmt: skip
    assert main(["export", *names, "-o", "one.pcapng"]) == 2


def test_through_a_pipe(folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "ds47", "export", "-", "-t", "5", "-o", "-"],
        input=TOUR.read_bytes(), capture_output=True, check=False, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert b"in the original" in done.stderr
    (folder / "x.pcapng").write_bytes(done.stdout)
    assert len(list(whole_frames(folder / "x.pcapng"))) == 2


def test_status_3_where_not_all_could_be_read(folder: Path) -> None:
    (folder / "cut.pcapng").write_bytes(TOUR.read_bytes()[:-5])
    assert main(["export", "cut.pcapng"]) == 3
    assert (folder / "cut.ds47.pcapng").exists()
    assert main(["export", "nowhere.pcapng"]) == 3


# A series of files


def as_parts(files: Sequence[Path]) -> list[SeriesPart]:
    return [SeriesPart(file.name, str(file)) for file in files]


def told(frame: WholeFrame) -> tuple[object, ...]:
    """A frame without the last line of its comment, which says where it was."""
    lines = [line for text in frame.comments for line in text.splitlines()]
    about = frame.interface
    return frame.time_ns, frame.data, frame.original_length, about.link_type, lines[:-1]


@pytest.mark.parametrize(
    ("name", "wanted"),
    [("tour-machine", {"rules": ("DS410",)}), ("transport-ip-fragments", {"transactions": ((1, 1),)}),
     ("transport-rpc-fragments", {"transactions": ((1, 1),)}),
     ("tour-machine", {"devices": ("press-1-drive",), "all_frames": True})],
    ids=str,
)  # fmt: skip
def test_a_series_gives_the_frames_of_the_whole(
    name: str, wanted: dict[str, Any], tmp_path: Path
) -> None:
    """Cut anywhere, between the frames of a transaction and of a message too."""
    originals = list(whole_frames(CAPTURES / f"{name}.pcapng"))
    whole = exported(write(tmp_path / "whole.pcapng", originals), tmp_path / "w.pcapng", **wanted)
    for cut in range(len(originals) + 1):
        files = pieces(tmp_path, originals, [cut])
        target = tmp_path / "s.pcapng"
        outcome = export(as_parts(files), target, Selection(**wanted))
        copies = list(whole_frames(target))
        assert outcome.frames == whole[0], cut
        assert [told(each) for each in copies] == [told(each) for each in whole[1]], cut
        assert len({id(each.interface) for each in copies}) == 1
        for number, copy in zip(outcome.frames, copies, strict=True):
            file, place = (files[0], number) if number <= cut else (files[1], number - cut)
            line = copy.comments[-1].splitlines()[-1]
            assert line == f"frame {number} ({place} of {file.name}) of the original"
            assert next(f for f in whole_frames(file) if f.number == place).data == copy.data


def test_interfaces_of_a_series_are_merged_where_they_say_the_same(tmp_path: Path) -> None:
    mixed(tmp_path / "a.pcapng")
    mixed(tmp_path / "b.pcapng")
    files = as_parts([tmp_path / "a.pcapng", tmp_path / "b.pcapng"])
    outcome = export(files, tmp_path / "out.pcapng", Selection())
    copies = list(whole_frames(tmp_path / "out.pcapng"))
    assert outcome.frames == [1, 3, 5, 6, 8, 10]
    assert [each.interface.link_type for each in copies] == [1, 101, 1] * 2
    assert len({id(each.interface) for each in copies}) == 3
    assert copies[3].comments[0] == "look here"


def test_a_series_without_names_is_the_whole_without_names(tmp_path: Path) -> None:
    originals = list(whole_frames(TOUR))
    files = pieces(tmp_path, originals, [8, 20, 31])
    key = Replacements()
    export(write(tmp_path / "whole.pcapng", originals), tmp_path / "w.pcapng", Selection(), key=key)
    export(as_parts(files), tmp_path / "s.pcapng", Selection(), key=key)
    assert (tmp_path / "s.pcapng").read_bytes() == (tmp_path / "w.pcapng").read_bytes()
    assert b"ring" not in (tmp_path / "s.pcapng").read_bytes()


def test_times_of_a_series_count_from_its_first_frame(tmp_path: Path) -> None:
    originals = list(whole_frames(TOUR))
    files = as_parts(pieces(tmp_path, originals, [0, 20]))  # the first file has no frame
    assert first_time(files) == originals[0].time_ns
    (tmp_path / files[1].name).unlink()
    assert first_time(files) == originals[20].time_ns
    assert first_time(files[:2]) is None


@pytest.fixture
def plant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a ring buffer; its last transactions go over the end of the third file."""
    monkeypatch.chdir(tmp_path)
    return recording(tmp_path / "plant", CAPTURES)


@pytest.mark.parametrize("named", ["plant", "plant/ring_00003_20240101020000.pcapng"])
def test_a_series_by_its_folder_or_one_of_its_files(
    named: str, plant: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", "--series", named, "-t", "7"]) == 0
    first = Path("plant", ring(1, NIGHT)) if named == "plant" else f"plant/{ring(1, NIGHT)}"
    assert capsys.readouterr().out.splitlines() == [
        f"{first}: 4 of 37 frames, 1 transaction",
        "  written to ring.ds47.pcapng",
        f"  in {ring(3, NIGHT)}: frame.number in {{10..11}}",
        f"  in {ring(4, NIGHT)}: frame.number in {{1..2}}",
    ]
    assert analyze("ring.ds47.pcapng", WITHOUT_PROOF).transactions[0].state == "partial"


def test_a_series_with_a_file_that_cannot_be_read_and_one_that_is_missing(
    plant: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (plant / ring(1, NIGHT)).write_bytes(b"no capture")
    (plant / ring(2, NIGHT)).unlink()
    assert main(["export", "--series", "plant", "--rule", "DS410"]) == 3
    shown = capsys.readouterr()
    first = Path("plant", ring(1, NIGHT))
    problems = shown.err.splitlines()
    assert problems[0] == f"ds47: {first}: 1 file of this series missing"
    assert problems[1].startswith(f"ds47: error: {first}: not a capture")
    assert len(problems) == 2
    assert f"{first}: 8 of 17 frames, 2 transactions" in shown.out
    assert len(list(whole_frames("ring.ds47.pcapng"))) == 8


def test_a_file_that_ends_early_does_not_move_the_numbers_of_the_next(plant: Path) -> None:
    """The frame that is cut counts for nobody, and the files behind it begin where report says."""
    path = plant / ring(2, NIGHT)
    path.write_bytes(path.read_bytes()[:-3])
    files = as_parts(sorted(plant.iterdir()))
    outcome = export(files, plant.parent / "s.pcapng", Selection(rules=("DS410",)))
    whole = exported(TOUR, plant.parent / "w.pcapng", rules=("DS410",))
    assert outcome.frames == [number - 1 for number in whole[0]]
    copies = list(whole_frames(plant.parent / "s.pcapng"))
    assert [each.data for each in copies] == [each.data for each in whole[1]]


def test_two_series_of_one_name_have_files_of_their_own(plant: Path) -> None:
    for path in sorted(plant.iterdir()):
        shutil.copy(path, plant / path.name.replace(NIGHT, "20240102020000"))
    assert main(["export", "--series", "plant", "-t", "7"]) == 0
    assert sorted(path.name for path in plant.parent.glob("*.pcapng")) == [
        f"ring_00001_{NIGHT}.ds47.pcapng", "ring_00001_20240102020000.ds47.pcapng",
    ]  # fmt: skip


def test_no_file_of_a_series_is_written_over(
    plant: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", "--series", "plant", "-o", f"plant/{ring(3, NIGHT)}"]) == 2
    assert "a capture to read" in capsys.readouterr().err


def test_a_long_series_prints_so_many_filters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    originals = list(whole_frames(TOUR))
    pieces(tmp_path, originals, range(1, len(originals)))
    assert main(["export", "--series", "."]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[2] == f"  in {ring(1, NIGHT)}: frame.number == 1"
    assert lines[22:] == ["  in 17 more files: see the comments of the frames"]


@pytest.fixture(scope="module")
def page_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    copy = tmp_path_factory.mktemp("export")
    shutil.copytree(CAPTURES, copy / "captures")
    recording(copy / "recording", CAPTURES)
    return copy


@pytest.mark.slow
@pytest.mark.parametrize("command", read_commands(PAGE.read_text("utf-8")), ids=lambda c: c.line)
def test_command_of_the_page(command: Command, page_folder: Path) -> None:
    status, output, errors = run(command, page_folder)
    assert status == command.status, errors
    assert "Traceback" not in errors
    lines = iter((output + errors).splitlines())
    for line in command.output:
        if line.strip() not in ("", "..."):
            assert line.rstrip() in (each.rstrip() for each in lines), line


# Fragments: what is kept of them, and how much


def captured(*frames: bytes, apart_ns: int = 1_000) -> list[Frame]:
    return [
        Frame(number, number * apart_ns, 1, data, len(data))
        for number, data in enumerate(frames, 1)
    ]


def fragment(offset: int, size: int = 800, *, ident: int = 7, more: bool = True) -> bytes:
    return make.ethernet(0x800, make.ipv4(b"x" * size, ident=ident, offset=offset, more=more))


def fed(tracker: Tracker, frames: list[Frame]) -> list[TrackedMessage | Copy]:
    return [found for frame in frames if (found := tracker.feed(frame)) is not None]


def lost(tracker: Tracker) -> list[list[int]]:
    return [[frame for trace in each for frame in trace.frames] for each in tracker.lost]


def test_copies_of_a_fragment_wait_up_to_a_number() -> None:
    tracker = Tracker()
    frames = captured(*[fragment(800)] * 1_000, fragment(1600, more=False), fragment(0))
    (whole,) = fed(tracker, frames)
    assert isinstance(whole, TrackedMessage)
    assert whole.frames == [*range(1, MOST_COPIES + 1), 1_001, 1_002]
    assert lost(tracker) == [[number] for number in range(MOST_COPIES + 1, 1_001)]


@pytest.mark.parametrize("what", ["ip_datagrams", "ip_fragments", "fragment_bytes"])
def test_unfinished_datagrams_are_as_many_as_in_the_analysis(what: str) -> None:
    bounds = limits()
    size = 60_000 if what == "fragment_bytes" else 8
    per = {"ip_datagrams": 1, "ip_fragments": 100, "fragment_bytes": 2}[what]
    count = {"ip_datagrams": bounds.ip_datagrams, "ip_fragments": bounds.ip_fragments // 100,
             "fragment_bytes": bounds.fragment_bytes // (2 * size)}[what]  # fmt: skip
    tracker = Tracker()
    for ident in range(count):
        fed(tracker, captured(*[fragment(8 * at, size, ident=ident) for at in range(per)]))
    assert not tracker.lost
    fed(tracker, captured(*[fragment(8 * at, size, ident=9_999) for at in range(per)]))
    assert [len(each) for each in lost(tracker)] == [per]  # the oldest
    tracker.finish()
    assert len(tracker.lost) == count + 1


def test_copies_count_as_fragments() -> None:
    """Their frames wait, too."""
    tracker, bounds = Tracker(), limits()
    copies = bounds.ip_fragments // MOST_COPIES
    for ident in range(copies // 100):
        fed(
            tracker,
            captured(*[fragment(8 * at, 8, ident=ident) for at in range(100)] * MOST_COPIES),
        )
    assert not tracker.lost
    for at in range(100):
        fed(tracker, captured(*[fragment(8 * at, 8, ident=9_999)] * MOST_COPIES))
    assert [len(each) for each in lost(tracker)] == [100 * MOST_COPIES]


def rpc_fragments(size: int, count: int, activity: int) -> list[bytes]:
    call = Call(UUID(int=activity), 0, wire.WRITE, wire.object_uuid(0x0501, 0x2A))
    parts = wire.pdus(wire.REQUEST, "<", call, bytes(size * count), size)
    return [make.ethernet(0x800, make.ipv4(make.udp(part))) for part in parts]


@pytest.mark.parametrize("what", ["rpc_messages", "rpc_fragments", "fragment_bytes"])
def test_unfinished_messages_are_as_many_as_in_the_analysis(what: str) -> None:
    bounds = limits()
    size, parts = (60_000, 2) if what == "fragment_bytes" else (8, 2)
    if what == "rpc_fragments":
        parts = 129
    held = parts - 1
    count = {"rpc_messages": bounds.rpc_messages, "rpc_fragments": bounds.rpc_fragments // held,
             "fragment_bytes": bounds.fragment_bytes // size}[what]  # fmt: skip
    tracker = Tracker()
    for activity in range(1, count + 1):
        fed(tracker, captured(*rpc_fragments(size, parts, activity)[:-1], apart_ns=1))
    assert not tracker.lost
    fed(tracker, captured(*rpc_fragments(size, parts, count + 1)[:-1], apart_ns=1))
    assert [len(each) for each in lost(tracker)] == [held]
    tracker.finish()
    assert len(tracker.lost) == count + 1


def test_a_copy_of_the_first_rpc_fragment_after_the_last() -> None:
    first, last = rpc_fragments(100, 2, 1)
    whole, copy = fed(Tracker(), captured(first, last, first))
    assert isinstance(whole, TrackedMessage)
    assert isinstance(copy, Copy)
    assert copy.message is whole
    assert copy.trace.frames == [3]


def test_rpc_fragments_behind_the_last_are_given_up() -> None:
    first, second, third = rpc_fragments(100, 3, 1)
    second = second[:44] + bytes((second[44] | 2,)) + second[45:]  # says that it is the last,
    third = third[:44] + bytes((third[44] & ~2,)) + third[45:]  # which this one does not
    tracker = Tracker()
    (whole,) = fed(tracker, captured(third, second, first))
    assert isinstance(whole, TrackedMessage)
    assert whole.frames == [2, 3]
    assert lost(tracker) == [[1]]


def test_the_body_of_cut_rpc_fragments_ends_at_the_first_hole() -> None:
    first, second, third = captured(*rpc_fragments(100, 3, 1))
    second.data = second.data[:-40]
    (whole,) = fed(Tracker(), [first, second, third])
    assert isinstance(whole, TrackedMessage)
    assert whole.pdu is not None
    assert (len(whole.pdu.body), whole.pdu.missing) == (160, 140)


def test_a_fragment_of_what_was_given_up_is_given_up_too() -> None:
    """An IP fragment of an RPC fragment whose message expired comes once more."""
    first = rpc_fragments(100, 2, 1)[0][34:]
    parts = [make.ethernet(0x800, make.ipv4(first[:80], offset=0, more=True)),
             make.ethernet(0x800, make.ipv4(first[80:], offset=80))]  # fmt: skip
    tracker = Tracker()
    assert not fed(tracker, captured(*parts))
    tracker.finish()
    assert not fed(tracker, captured(*parts, parts[1])[2:])
    assert lost(tracker) == [[1, 2], [3]]


def test_a_late_copy_of_an_ip_fragment_waits_with_its_rpc_message() -> None:
    first, last = rpc_fragments(100, 2, 1)
    parts = [make.ethernet(0x800, make.ipv4(first[34:][:80], offset=0, more=True)),
             make.ethernet(0x800, make.ipv4(first[34:][80:], offset=80))]  # fmt: skip
    whole, copy = fed(Tracker(), captured(*parts, parts[1], last, parts[0]))
    assert isinstance(whole, TrackedMessage)
    assert (whole.frame, whole.frames) == (4, [1, 2, 3, 4])
    assert isinstance(copy, Copy)
    assert (copy.message, copy.trace.frames, copy.sibling) == (whole, [5], whole.parts[0][0])


def test_an_impossible_ip_fragment_is_lost() -> None:
    tracker = Tracker()
    assert not fed(tracker, captured(fragment(65_528, 16), fragment(8, 0)))
    assert lost(tracker) == [[1], [2]]


def test_writing_leaves_no_byte_as_it_was() -> None:
    trace, drafts = Trace(), Drafts()
    for number, (offset, text) in enumerate(((0, b"in front"), (16, b"behind a hole"))):
        drafts.add(WholeFrame(number, 0, Interface(1, 0), text, 40))
        trace.add(DatagramPiece(number, 0, 0, offset, len(text)))
    assert drafts.image(trace) == b"in front" + bytes(8) + b"behind a hole"
    drafts.write(trace, b"IN")
    assert [bytes(drafts[number].data) for number in (0, 1)] == [b"IN" + bytes(6), bytes(13)]


# Examples


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["tour-machine", "real-stacks/o3_two_controllers", "cyclic-changed-after-off1", "s7-stacks/errors_pure_pure"],
)  # fmt: skip
def test_each_root_cause_has_an_example_that_shows_it(name, tmp_path, capsys):
    source = CAPTURES / f"{name}.pcapng"
    result = analyze(source)
    assert main(["export", "--examples", "-o", str(tmp_path), str(source)]) == 0
    told = capsys.readouterr().out.splitlines()
    files = sorted(tmp_path.iterdir())
    assert len(told) == len(files) + 1
    rules = {path.name.removeprefix(f"{source.stem}.").split("-")[0] for path in files}
    assert {each.rule for each in result.diagnoses} <= rules
    assert len(files) >= len(result.diagnoses)
    originals = {frame.data for frame in whole_frames(source)}
    for path in files:
        (line,) = [each for each in told if f"{path.name}," in each]
        rule = path.name.removeprefix(f"{source.stem}.").split("-")[0]
        copied = list(whole_frames(path))
        assert 0 < len(copied) <= 20
        assert f" {len(copied)} frame" in line
        assert all(frame.data in originals for frame in copied)
        assert any(rule in comment for frame in copied for comment in frame.comments)
        sentence = line.split(": ", 1)[1]
        assert len(sentence) > 20


def test_the_gaps_of_an_excerpt_are_intended(tmp_path, capsys):
    source, copy = CAPTURES / "real-stacks" / "o1_profinetpy062_be.pcapng", tmp_path / "copy.pcapng"
    assert main(["export", "-s", "failed", "-o", str(copy), str(source)]) == 0
    (told,) = (each for each in analyze(copy).findings if each.rule == "DS725")
    assert told.args["what"] == "excerpt"
    # a recording behind it is not intended to have gaps
    (tmp_path / "both.pcapng").write_bytes(copy.read_bytes() + TOUR.read_bytes())
    told = [each for each in analyze(tmp_path / "both.pcapng").findings if each.rule == "DS725"]
    assert told
    assert not any(each.args["what"] == "excerpt" for each in told)


def test_examples_of_a_rule_and_none_of_a_healthy_capture(tmp_path, capsys):
    words = ["export", "--examples", "-o", str(tmp_path), str(TOUR)]
    assert main([*words, "--rule", "DS719"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == [
        "tour-machine.DS719-drive-running.ds47.pcapng"
    ]
    assert {each.rule for each in analyze(next(tmp_path.iterdir())).findings} >= {"DS410"}
    assert main([*words, "--rule", "DS101"]) == 1
    assert "nothing to export" in capsys.readouterr().err


def test_an_example_goes_over_no_recording_and_no_other_example(tmp_path, capsys):
    target = tmp_path / "tour-machine.DS719-drive-running.ds47.pcapng"
    recording_of = TOUR.read_bytes()
    target.write_bytes(recording_of)
    words = ["export", "--examples", "-r", "DS719", "-o", str(tmp_path)]
    assert main([*words, str(TOUR)]) == 2
    assert target.read_bytes() == recording_of
    target.unlink()
    (tmp_path / "other").mkdir()
    copy = tmp_path / "other" / TOUR.name
    copy.write_bytes(recording_of)
    assert main([*words, str(TOUR), str(copy)]) == 2
    assert "written already" in capsys.readouterr().err
    for other in (["-t", "1"], ["--from", "1"], ["--anonymise"], ["--all-frames"]):
        assert main([*words, *other, str(TOUR)]) == 2
    assert main(["export", "--examples", "-o", str(tmp_path / "none"), str(TOUR)]) == 2


def test_of_many_root_causes_it_says_how_many_are_left_out(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("ds47.export.MOST", 2)
    assert main(["export", "--examples", "-o", str(tmp_path), str(TOUR)]) == 0
    assert "3 more root causes" in capsys.readouterr().out
    assert len(list(tmp_path.iterdir())) == 2
