"""Writes the middle of docs/diagnoses.md: a chapter for each diagnosis, from the captures and rules.toml.

    .venv/bin/python tools/make_diagnoses.py            writes the page
    .venv/bin/python tools/make_diagnoses.py --check    fails when the page is not what would be written

What stands outside the two marks is written by hand and left alone. A chapter has what one notices at the
machine (diagnoses_noticed.toml), the cause, the conversation of the stored capture as a picture, what the report
says of it, and how the near miss differs. The pictures are drawn from the frames, not from the scenario.
"""

from __future__ import annotations

import argparse
import io
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ds47 import spec
from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import Frame, open_capture
from ds47.model import CaptureResult, Report
from ds47.profidrive import Block, decode_request, decode_response
from ds47.profidrive.notation import format_request_line
from ds47.profinet import rpc
from ds47.profinet.link import Packets
from ds47.profinet.records import Half, Record, parse_request, parse_response
from ds47.report import Options, text
from ds47.spec import Rule, rules
from ds47.spec.layouts import RPC_READ
from ds47.spec.statuses import status_hex

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "diagnoses.md"
CAPTURES = ROOT / "captures"
NOTICED = ROOT / "tools" / "diagnoses_noticed.toml"
MARKS = "<!-- made by tools/make_diagnoses.py -->\n", "<!-- end -->\n"
TOPIC, MISS = "diagnosis-", "-not"
WIDTH = 76
"""Columns between controller and drive,"""
MOST = WIDTH - 8
"""and of them for what is said."""
NAMES = {0: "Connect", 1: "Release", 2: "Read", 3: "Write", 4: "Control", 5: "ReadImplicit"}


# The conversation


@dataclass(frozen=True, slots=True)
class Step:
    """One frame of the picture."""

    frame: int
    time_ns: int
    to_drive: bool
    text: str
    same: str
    """What has to be equal where a conversation goes on in the same way: without references."""
    mark: str = ""


class Reader:
    """Turns the frames of a small capture into steps.

    Args:
        names: its controllers; they are named where there are several.
        places: whether to say slot, subslot and index.
    """

    def __init__(self, names: Sequence[str], places: bool) -> None:
        several = len(names) > 1
        self._names = {ip: f"{ip}: " if several else "" for ip in names}
        self._places = places

    def step(self, frame: Frame, pdu: rpc.Pdu | None) -> Step | None:
        """The step of a frame; None for a frame without RPC."""
        if pdu is None:
            return None
        request = pdu.ptype == 0
        who = self._names.get(pdu.client, "")
        said = self._request(pdu) if request else self._response(pdu)
        cut = frame.original_length - len(frame.data)
        if cut:
            said += f"  (cut: {cut} bytes missing)"
        return Step(frame.number, frame.time_ns, request, who + said, who + _constant(said))

    def _request(self, pdu: rpc.Pdu) -> str:
        records = parse_request(pdu).records
        if not records:
            return NAMES.get(pdu.opnum, "?")
        record = records[0]
        said = f"{'Write' if record.write else 'Read'}{self._place(record)}"
        half = record.request
        if half is None:
            return said
        if record.write:
            return f"{said}  {asked(half)}"
        return said if half.stated >= 240 else f"{said}  MLEN {half.stated}"

    def _response(self, pdu: rpc.Pdu) -> str:
        status, answers = parse_response(pdu)
        name = NAMES.get(pdu.opnum, "?")
        half = answers[0].response if answers else None
        if half is not None and half.status is not None:
            status = half.status
        if status:
            return f"{name} refused {status_hex(status)}"
        if pdu.opnum != RPC_READ or half is None:
            return f"{name} ok"
        return f"{name} ok  {answered(half)}"

    def _place(self, record: Record) -> str:
        if not self._places:
            return ""
        index = f"0x{record.index:04X}" if record.index > 255 else str(record.index)
        return f" {record.slot}.{record.subslot} index {index}"


def asked(half: Half) -> str:
    """A request in the notation of `ds47 encode`, or its bytes where it is none."""
    message = decode_request(half.data)
    if not message.flaws:
        try:
            return format_request_line(message)
        except ValueError:
            pass
    return half.data.hex(" ", 2)


def answered(half: Half) -> str:
    """A response in a few words: reference, id where it is negative, axis, and what each block holds."""
    message = decode_response(half.data)
    head = f"ref {message.request_reference}"
    if message.response_id is not None and message.response_id & 0x80:
        head += f" id 0x{message.response_id:02X}"
    blocks = [_block(block) for block in message.blocks]
    many = [f"{blocks[0]} and {len(blocks) - 1} more"] if len(blocks) > 3 else blocks
    return " ".join([f"{head} axis {message.axis}:", ", ".join(many) or "done"])


def _block(block: Block) -> str:
    if block.error is not None:
        return "error" if block.error.code is None else f"error {spec.error_hex(block.error.code)}"
    values = " ".join(str(value) for value in block.values[:4])
    return (values or "done") + (" .." if len(block.values) > 4 else "")


def _constant(said: str) -> str:
    words = said.split()
    return " ".join(
        "" if before == "ref" else word for before, word in zip(["", *words], words, strict=False)
    )


def steps(path: Path, result: CaptureResult) -> list[Step]:
    """All record calls, Connects and Releases of a capture."""
    pairs = []
    with open_capture(path) as capture:
        frames = list(capture)
    for frame in frames:
        packet = Packets().packet(frame)
        pairs.append(
            (frame, rpc.parse(packet) if packet is not None and packet.kind == "udp" else None)
        )
    pdus = [pdu for _, pdu in pairs if pdu is not None]
    clients = list(dict.fromkeys(pdu.client for pdu in pdus))
    places = {
        (record.slot, record.subslot, record.index)
        for pdu in pdus
        if pdu.ptype == 0
        for record in parse_request(pdu).records
    }
    reader = Reader(clients, len(places) > 1 or any(place[2] != 47 for place in places))
    found = [step for frame, pdu in pairs if (step := reader.step(frame, pdu)) is not None]
    marks: dict[int, str] = {}
    for each in result.diagnoses:
        for number in each.frames:
            marks[number] = f"  <- {each.rule}"
    return [replace(step, mark=marks.get(step.frame, "")) for step in found]


# The picture


def picture(path: Path, result: CaptureResult) -> list[str]:
    """The conversation: a line for each frame, the frames that a diagnosis names marked."""
    found = steps(path, result)
    if not found:
        return []
    start = found[0].time_ns
    lines = [f"frame      ms  {'controller':<{WIDTH // 2}}{'drive':>{WIDTH - WIDTH // 2 + 2}}"]
    for item in shortened(found):
        if isinstance(item, int):
            lines.append(f"  ...          |{f'{item} frames that go on in the same way':^{WIDTH}}|")
            continue
        time = (item.time_ns - start) / 1e6
        lines.append(f"{item.frame:5} {time:7.0f}  |{arrow(item)}|{item.mark}")
    return lines


def arrow(step: Step) -> str:
    """What is said, on an arrow from one side to the other."""
    said = step.text if len(step.text) <= MOST else step.text[: MOST - 2] + ".."
    if step.to_drive:
        return f"-- {said} ".ljust(WIDTH - 1, "-") + ">"
    return "<" + f" {said} --".rjust(WIDTH - 1, "-")


def shortened(found: list[Step]) -> Iterator[Step | int]:
    """The steps; of a run that repeats itself twice the first and the last round, between them a number."""
    at = 0
    while at < len(found):
        size, rounds = _repetition(found, at)
        if rounds < 4:
            yield found[at]
            at += 1
            continue
        end = at + size * rounds
        yield from found[at : at + size]
        yield size * (rounds - 2)
        yield from found[end - size : end]
        at = end


def _repetition(found: list[Step], at: int) -> tuple[int, int]:
    """The shortest round that repeats itself from here on, and how often it is seen."""
    best = (1, 1)
    for size in (2, 4):
        one = [step.same for step in found[at : at + size]]
        rounds = 1
        while [step.same for step in found[at + size * rounds : at + size * (rounds + 1)]] == one:
            rounds += 1
        if len(one) == size and size * rounds > best[0] * best[1] and rounds > 1:
            best = (size, rounds)
    return best


# A chapter


def result_of(path: Path) -> CaptureResult:
    """The analysis of a stored capture, named as a user in the checkout would name it."""
    result = analyze(path, AnalysisOptions())
    result.path = f"captures/{path.name}"
    return result


def told(result: CaptureResult) -> list[str]:
    """What the text report says to do."""
    stream = io.StringIO()
    text.write(Report([result]), stream, Options(rules=rules()))
    lines = stream.getvalue().splitlines()
    start = lines.index("What to do")
    return lines[start + 1 : lines.index("", start)]


def chapter(
    rule: Rule, noticed: dict[str, str], manifest: dict[str, dict[str, str]]
) -> Iterator[str]:
    """Everything that the page says of a diagnosis."""
    name = TOPIC + rule.name
    path = CAPTURES / f"{name}.pcapng"
    result = result_of(path)
    yield f"### {rule.id} {rule.name} ({rule.severity})"
    yield ""
    yield f"**You notice** {noticed[rule.id]}"
    yield ""
    yield f"**Why** {rule.cause}"
    yield ""
    yield f"[{path.name}](../captures/{path.name}): {manifest[name]['shows']}."
    yield ""
    yield "```text"
    yield from picture(path, result)
    yield "```"
    yield ""
    yield "What the report says to do:"
    yield ""
    yield "```text"
    yield from told(result)
    yield "```"
    yield ""
    others = variants(rule, manifest)
    missing = [each for each in others if each.endswith(MISS)]
    for each in [each for each in others if each not in missing]:
        yield f"* Also `{each}`: {manifest[each]['shows']}."
    for each in missing:
        yield f"* **Not** `{each}`: {manifest[each]['shows']}."
    yield ""


def variants(rule: Rule, manifest: dict[str, dict[str, str]]) -> list[str]:
    """The other captures of a diagnosis, near misses among them."""
    own = TOPIC + rule.name
    longer = [TOPIC + other.name for other in diagnoses() if other.name.startswith(f"{rule.name}-")]
    return [
        name
        for name in manifest
        if name.startswith(f"{own}-") and not any(f"{name}-".startswith(f"{o}-") for o in longer)
    ]


def diagnoses() -> list[Rule]:
    """The rules of the catalogue that are diagnoses."""
    return [rule for rule in rules().values() if rule.id.startswith("DS7")]


def anchor(rule: Rule) -> str:
    """The link to a chapter as GitHub makes it of the heading."""
    return f"#{rule.id.lower()}-{rule.name}-{rule.severity}"


def made() -> str:
    """The part between the marks."""
    noticed = tomllib.loads(NOTICED.read_text("utf-8"))["noticed"]
    entries = tomllib.loads((CAPTURES / "MANIFEST.toml").read_text("utf-8"))["capture"]
    manifest = {entry["file"].removesuffix(".pcapng"): entry for entry in entries}
    lines = ["| you notice | diagnosis |", "|---|---|"]
    for rule in diagnoses():
        lines.append(f"| {noticed[rule.id]} | [{rule.id} {rule.name}]({anchor(rule)}) |")
    lines.append("")
    for rule in diagnoses():
        lines += chapter(rule, noticed, manifest)
    return "\n".join(lines)


def main(arguments: list[str]) -> int:
    """Write the page, or compare it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare only; 1 when they differ")
    check = parser.parse_args(arguments).check
    page = PAGE.read_text("utf-8")
    before, rest = page.split(MARKS[0])
    after = rest.split(MARKS[1])[1]
    now = before + MARKS[0] + "\n" + made() + MARKS[1] + after
    if not check:
        PAGE.write_text(now, encoding="utf-8", newline="\n")
        return 0
    if now != page:
        sys.stderr.write("docs/diagnoses.md is not what tools/make_diagnoses.py writes: run it\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
