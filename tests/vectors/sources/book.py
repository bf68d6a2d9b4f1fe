"""The book of the conversation vectors: how a scene becomes a case, and the words of what is expected.

A scene plays on a `Tape`, the stage of the lab that keeps UDP payloads and no frames, so scapy is not
needed. The scenes are in `conversations` and `diagnoses`. Many are those of the lab: `Vectors.lab` takes the
scene from there, and only what is expected stands here, in full.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "python"))

from ds47.lab import scenarios, wire  # noqa: E402
from ds47.lab.client import CONTROLLER_AR, Client  # noqa: E402
from ds47.lab.ether import PNIO_PORT, Host  # noqa: E402
from ds47.lab.scenario import DIAGNOSES, Build, Scenes  # noqa: E402
from ds47.lab.stage import START_NS, Stage  # noqa: E402

CLIENT_PORT = 49152
RAMP = 1120
REQUEST_KINDS = (wire.REQUEST, wire.PING)
Row = dict[str, Any]


# The tape: what goes past, as steps


@dataclass(slots=True)
class Tape(Stage):
    """A stage that keeps UDP payloads and no frames."""

    steps: list[Row] = field(default_factory=list)
    options: Row = field(default_factory=dict)
    """What the user sets: `indices`."""

    def send(
        self, source: Host, target: Host, payload: bytes, ports: tuple[int, int] | None = None
    ) -> None:
        """A UDP datagram goes past; ports are (source, target)."""
        asked = payload[1] & 0x1F in REQUEST_KINDS
        client, server = (source, target) if asked else (target, source)
        here, there = ports or (source.port, target.port)
        ours, theirs = (here, there) if asked else (there, here)
        step: Row = {
            "t": self.now_ns - START_NS,
            "direction": "request" if asked else "response",
            "client": client.ip,
            "server": server.ip,
            "ip_id": next(source.identification) & 0xFFFF,
            "bytes": payload.hex(),
        }
        if ours != CLIENT_PORT:
            step["client_port"] = ours
        if theirs != PNIO_PORT:
            step["server_port"] = theirs
        if not self.deaf:
            self.steps.append(step)
        self.now_ns += self.gap_ns

    def cut(self, count: int, number: int = -1) -> None:
        """The capture cuts so many bytes off a frame, the newest one where no other is named."""
        step = self.steps[number]
        step["bytes"] = step["bytes"][: -2 * count]
        step["cut"] = count

    def repeat(self) -> None:
        """The newest datagram is seen again, with its IP id."""
        self.steps.append({**self.steps[-1], "t": self.now_ns - START_NS})
        self.now_ns += self.gap_ns

    def bring_forward(self, last: int, first: int) -> None:
        """The datagram at a place, from 0, stands before those from another place on; the times stay."""
        self.steps.insert(first, self.steps.pop(last))

    def lose(self, number: int = -1) -> None:
        """A datagram goes past unseen."""
        del self.steps[number]


def tape(client: Client) -> Tape:
    """The tape on which a client plays, for what only a tape can do."""
    assert isinstance(client.stage, Tape)
    return client.stage


# What is expected


GOOD = "00000000"
HOME: Row = {
    "controller": "192.168.133.2",
    "device": "192.168.133.33",
    "ar": str(CONTROLLER_AR),
    "api": 0,
    "slot": 1,
    "subslot": 1,
    "index": 47,
}


def par(
    pnu: int | None,
    form: str | None = None,
    *values: float,
    subindex: int = 0,
    error: tuple[int | None, int | None] | None = None,
) -> Row:
    """A parameter; without a PNU it has no address at all."""
    return {
        "pnu": pnu,
        "subindex": None if pnu is None else subindex,
        "attribute": None if pnu is None else "value",
        "format": form,
        "values": list(values),
        "error": None if error is None else {"code": error[0], "info": error[1]},
    }


def real(*values: float, pnu: int | None = 21) -> Row:
    """What a Float32 becomes."""
    return par(pnu, "Float32", *values)


def ramp(value: float) -> Row:
    """What a Float32 of the ramp time becomes."""
    return real(value, pnu=RAMP)


NOTHING = par(21)


def tx(
    number: int,
    state: str,
    frames: Sequence[int | None],
    ms: float | None,
    *parameters: Row,
    ref: int | None = 1,
    axis: int | None = 1,
    write: str | None = GOOD,
    read: str | None = GOOD,
    polls: Sequence[tuple[int | None, int]] = (),
    rereads: Sequence[tuple[int, int]] = (),
    **place: Any,
) -> Row:
    """A transaction.

    `state` is of a read where it names no other operation. `frames` are Write request and response,
    Read request and response, as far as they go; a response that is not there has no status.
    """
    write_request, write_response, read_request, read_response = [*frames, None, None, None][:4]
    return {
        "id": number,
        "operation": (["read", *state.split()])[-2],
        "state": state.split()[-1],
        **HOME,
        **place,
        "request_reference": ref,
        "axis": axis,
        "frames": {
            "write_request": write_request,
            "write_response": write_response,
            "read_request": read_request,
            "read_response": read_response,
            "polls": [{"request": one, "response": two} for one, two in polls],
            "rereads": [{"request": one, "response": two} for one, two in rereads],
        },
        "duration_ns": None if ms is None else round(ms * 1_000_000),
        "status": {
            "write": write if write_response else None,
            "read": read if read_response else None,
        },
        "parameters": list(parameters),
    }


def row(
    number: int,
    *parameters: Row,
    state: str = "ok",
    first: int | None = None,
    ms: float = 3,
    **more: Any,
) -> Row:
    """A transaction whose four frames follow each other, the n-th of such if no first frame is named.

    Its reference is its number if no other is named.
    """
    begin = first or 4 * number - 3
    frames = range(begin, begin + 4)
    return tx(number, state, frames, ms, *parameters, **{"ref": number, **more})


def orphan(number: int, first: int, *parameters: Row, state: str = "orphan", **more: Any) -> Row:
    """A Read that no request goes before, by its first frame."""
    return tx(number, state, (None, None, first, first + 1), None, *parameters, **more)


def found(text: str) -> list[Row]:
    """Findings from words such as `DS413@3#1`: rule, frame, transaction (none without #)."""
    result = []
    for word in text.split():
        rule, _, place = word.partition("@")
        frame, _, owner = place.partition("#")
        transaction = int(owner) if owner else None
        result.append({"rule": rule, "frame": int(frame), "transaction": transaction})
    return sorted(result, key=lambda one: (one["frame"], one["rule"], one["transaction"] or 0))


# The book


class Vectors(Scenes[Client, Row]):
    """The scenes of one file of vectors.

    A scene's name begins with the sentence (p24_..) or the rule (ds704_..) that it shows. `shows` has further
    sentences, and flags: what is out of the ordinary, or `none`. `rules` has all findings, as `found` reads them.
    """

    def __init__(self, target: str, about: str) -> None:
        self._target = target
        self._about = about
        self._cases: list[Row] = []

    def add(
        self,
        name: str,
        title: str,
        shows: str,
        build: Build,
        transactions: Sequence[Row],
        rules: str = "",
    ) -> None:
        """Play a scene, and enter it with what is expected of it."""
        tape = Tape()
        build(Client(tape))
        shown, _, rest = name.partition("-")
        words = [shown.upper(), *shows.split()]
        flags = [word for word in words if word.islower()]
        row: Row = {
            "id": f"{shown.upper()}-{rest}",
            "comment": " ".join(title.split()) + ".",
            "shows": [word for word in words if word not in flags],
            "flags": flags,
        }
        if tape.options:
            row["options"] = tape.options
        if tape.dropped is not None:
            row["dropped"] = tape.dropped
        listed = found(rules)
        symptoms = [one for one in listed if not one["rule"].startswith(DIAGNOSES)]
        diagnoses = [one for one in listed if one not in symptoms]
        if tape.dropped is not None:
            symptoms = [{**one, "says_dropped": True} for one in symptoms]
        row["steps"] = tape.steps
        row["expect"] = {"transactions": list(transactions), "findings": symptoms}
        if diagnoses:
            row["expect"]["diagnoses"] = diagnoses
        self._cases.append(row)

    def lab(self, shown: str, name: str, shows: str, *transactions: Row, rules: str = "") -> None:
        """Enter a scene of the lab under the sentence or rule that it shows here."""
        scenario = scenarios()[name]
        own = f"{shown}-{name.partition('-')[2]}"
        title = f"{scenario.title} ({scenario.shows})"
        self.add(own, title, shows, scenario.build, transactions, rules)

    def write(self, arguments: Sequence[str]) -> None:
        """Write the file: that of the vectors, or the one that is named."""
        target = Path(arguments[0]) if arguments else ROOT / "tests/vectors" / self._target
        target.write_text(self._text(), "utf-8", newline="\n")

    def _text(self) -> str:
        shown = ",\n".join(render(one) for one in self._cases)
        head = f'{{\n"$schema": "conversations.schema.json",\n"about": {dump(self._about)},\n'
        return f'{head}"count": {len(self._cases)},\n"cases": [\n{shown}\n]\n}}\n'


# The file


def rows(items: Sequence[Row]) -> str:
    """A list with one line per item."""
    if not items:
        return "[]"
    return "[\n    " + ",\n    ".join(dump(item) for item in items) + "\n   ]"


def dump(value: Any) -> str:
    """JSON on one line."""
    return json.dumps(value, ensure_ascii=False)


def render(one: Row) -> str:
    """A case: a line per field, step, transaction and finding."""
    lines = [f"  {dump(k)}: {dump(v)}" for k, v in one.items() if k not in ("steps", "expect")]
    lines.append(f'  "steps": {rows(one["steps"])}')
    expect = ",\n".join(f"   {dump(k)}: {rows(v)}" for k, v in one["expect"].items())
    return " {\n" + ",\n".join([*lines, '  "expect": {\n' + expect + "}"]) + "\n }"
