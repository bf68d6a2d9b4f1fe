"""Writes the middle of docs/diagnoses.md: a chapter for each diagnosis, from the scenes of the lab and rules.toml.

    .venv/bin/python tools/make_diagnoses.py            writes the page
    .venv/bin/python tools/make_diagnoses.py --check    fails when the page is not what would be written

What stands outside the two marks is written by hand and left alone. The table leads from what one notices at the
machine (diagnoses_noticed.toml) to a chapter: the cause, the conversation of the scene as a picture with what the
report says of it, and how the near miss differs. A scene is played once: it is the picture and the capture.
"""

from __future__ import annotations

import argparse
import io
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from ds47 import lab, spec
from ds47.analysis import AnalysisOptions, analyze
from ds47.lab import wire
from ds47.lab.stage import Stage
from ds47.lab.wire import PduContent
from ds47.model import CaptureResult, Report
from ds47.profidrive import Block, decode_request, decode_response
from ds47.profidrive.notation import format_request_line
from ds47.report import ReportOptions, text, write_all
from ds47.spec import Rule, rules
from ds47.spec.statuses import status_hex

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "diagnoses.md"
NOTICED = ROOT / "tools" / "diagnoses_noticed.toml"
MARKS = "<!-- made by tools/make_diagnoses.py -->\n", "<!-- end -->\n"
TOPIC, MISS = "diagnosis-", "-not"
WIDTH = 76
"""Columns between controller and drive,"""
MOST = WIDTH - 8
"""and of them for what is said."""
NAMES = {wire.CONNECT: "Connect", wire.RELEASE: "Release", wire.READ: "Read", wire.WRITE: "Write"}
"""The calls of the scenes that have a picture."""
USUAL_ROOM = 240
"""Bytes; a Read that leaves fewer says so."""
OTHERS, LOOK = "  Other findings", "    look at frame"
"""Lines of the report that the page has not."""


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


def steps(stage: Stage) -> list[Step]:
    """All PDUs of a scene. Several controllers are named; so are places, unless all is one place with index 47."""
    spoken = [shot.said for shot in stage.shots if shot.said is not None]
    several = len({said.controller for said in spoken}) > 1
    places = {(place.slot, place.subslot, place.index) for said in spoken if (place := said.target)}
    named = len(places) > 1 or any(index != 47 for _, _, index in places)
    found = []
    for number, shot in enumerate(stage.shots, start=1):
        if (said := shot.said) is not None:
            who = f"{said.controller}: " if several else ""
            words = request_text(said, named) if said.to_device else response_text(said)
            step = Step(number, shot.time_ns, said.to_device, who + words, who + _constant(words))
            found.append(step)
    return found


def request_text(said: PduContent, named: bool) -> str:
    """A request: the call, its place if wanted, and what it asks for."""
    words = NAMES[said.call.opnum]
    if said.target is not None and named:
        index = said.target.index
        number = f"0x{index:04X}" if index > 255 else str(index)
        words += f" {said.target.slot}.{said.target.subslot} index {number}"
    if said.record:
        words += f"  {asked(said.record)}"
    if said.room is not None and said.room < USUAL_ROOM:
        words += f"  MLEN {said.room}"
    return words


def response_text(said: PduContent) -> str:
    """A response: the call, and how it went or what it brings."""
    name = NAMES[said.call.opnum]
    if said.status:
        return f"{name} refused {status_hex(said.status)}"
    return f"{name} ok  {answered(said.record)}" if said.record else f"{name} ok"


def asked(record: bytes) -> str:
    """A request in the notation of `ds47 encode`, or its bytes where it is none."""
    message = decode_request(record)
    if not message.flaws:
        try:
            return format_request_line(message)
        except ValueError:
            pass
    return record.hex(" ", 2)


def answered(record: bytes) -> str:
    """A response in a few words: reference, id where it is negative, axis, and what each block holds."""
    message = decode_response(record)
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


# The picture


def picture(stage: Stage, result: CaptureResult) -> list[str]:
    """The conversation: a line for each frame, the frames that a diagnosis names marked."""
    marks = {frame: f"  <- {each.rule}" for each in result.diagnoses for frame in each.frames}
    found = steps(stage)
    start = found[0].time_ns
    lines = [f"frame      ms  {'controller':<{WIDTH // 2}}{'drive':>{WIDTH - WIDTH // 2 + 2}}"]
    for item in shortened(found):
        if isinstance(item, int):
            lines.append(f"  ...          |{f'{item} frames that go on in the same way':^{WIDTH}}|")
            continue
        time = (item.time_ns - start) / 1e6
        lines.append(f"{item.frame:5} {time:7.0f}  |{arrow(item)}|{marks.get(item.frame, '')}")
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


def played(name: str) -> tuple[Stage, CaptureResult]:
    """A scene, played once, and the analysis of its capture, named as a user in the checkout would name it."""
    with TemporaryDirectory() as folder:
        path = Path(folder, f"{name}.pcapng")
        stage = lab.write(name, path)
        result = analyze(path, AnalysisOptions())
    result.path = f"captures/{path.name}"
    return stage, result


def told(result: CaptureResult) -> list[str]:
    """What the text report says to do: the diagnoses alone, without the frames, which the picture marks."""
    stream = io.StringIO()
    write_all(text.Writer(stream, ReportOptions(rules=rules())), Report([result]))
    lines = stream.getvalue().splitlines()
    start = lines.index("What to do")
    found = lines[start + 1 : lines.index("", start)]
    if OTHERS in found:
        found = found[: found.index(OTHERS)]
    return [line for line in found if not line.startswith(LOOK)]


def chapter(rule: Rule) -> Iterator[str]:
    """Everything that the page says of a diagnosis."""
    name = TOPIC + rule.name
    scenes = lab.scenarios()
    stage, result = played(name)
    yield f"### {rule.id} {rule.name} ({rule.severity})"
    yield ""
    yield f"{rule.cause} [{name}](../captures/{name}.pcapng): {scenes[name].shows}."
    yield ""
    yield "```text"
    yield from picture(stage, result)
    yield ""
    yield from told(result)
    yield "```"
    yield ""
    others = variants(rule)
    if also := [f"`{each}`" for each in others if not each.endswith(MISS)]:
        yield f"* Also {', '.join(also)}"
    for each in others:
        if each.endswith(MISS):
            yield f"* **Not** `{each}`: {scenes[each].shows}."
    yield ""


def variants(rule: Rule) -> list[str]:
    """The other scenes of a diagnosis, near misses among them."""
    own = TOPIC + rule.name
    longer = [TOPIC + other.name for other in diagnoses() if other.name.startswith(f"{rule.name}-")]
    return [
        name
        for name in lab.scenarios()
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
    lines = ["| you notice | diagnosis |", "|---|---|"]
    for rule in diagnoses():
        lines.append(f"| {noticed[rule.id]} | [{rule.id} {rule.name}]({anchor(rule)}) |")
    lines.append("")
    for rule in diagnoses():
        lines += chapter(rule)
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
