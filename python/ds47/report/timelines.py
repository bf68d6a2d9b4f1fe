"""The events of a drive as every report shows them: what came in one frame, and how long after its command.

An event is joined with a command only if the drive proves it: it runs after ON or after its operation was enabled,
it stops after an effective OFF, a fault is gone after its acknowledgement. Findings say what is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

from ds47.model import CaptureResult, Event, Timeline
from ds47.report.bilingual import Both, joined, say
from ds47.report.formatting import duration
from ds47.report.reference import Reference
from ds47.spec.cyclic import edges, event_text, state_text, stopping
from ds47.spec.semantics import limits

_CAUSES = {
    "running": ("on", "enable-operation"),
    "stopped": ("off2", "off3", "off1", "disable-operation"),
    "fault-cleared": ("acknowledge",),
}
"""What a command brings about; of commands in one frame the first counts."""
_LOST = ("output-lost", "output-back", "input-lost", "input-back", "local")
_NEARER = {
    "running": ("stopped", "fault", "inhibited", "released", *_LOST),
    "stopped": ("fault", "off2-active", "off3-active", *_LOST),
    "fault-cleared": ("fault", *_LOST),
}
"""What explains the same where it comes between the command and its effect, or with the effect."""
_ASKED = {"off2-active": "off2", "off3-active": "off3"}
"""What a drive says of a command that it carries out: that explains nothing where the command is in force."""


_REFERENCE = 2000
"""p2000, the reference value: what 100 % of a setpoint is."""


def reference(result: CaptureResult, device: str, given: Reference | None) -> Reference | None:
    """What 100 % of a drive is: as given, else p2000 as read last; None if unknown.

    Its unit depends on the family (Hz on MICROMASTER, rpm on SINAMICS), and is not guessed.
    """
    if given is not None:
        return given
    for item in reversed(result.evidence):
        if item.device != device or item.operation != "read" or item.state not in ("ok", "partial"):
            continue
        for each in item.parameters:
            number = each.values[0] if each.pnu == _REFERENCE and each.values else None
            if isinstance(number, int | float) and not each.error and each.attribute == "value":
                return Reference(((float(number), ""),), item.frames.read_response)
    return None


def reference_words(found: Reference) -> Both:
    """`100 % is 50 Hz, 1395 rpm`, and where that is from."""
    if found.frame is None:
        return say("reference_given", value=found.shown(100))
    return say("reference_read", value=found.shown(100), frame=str(found.frame))


@dataclass(slots=True)
class EventRow:
    """Events of one word in one frame.

    `cause` is the command before it that brought about one of them, `after_ns` how long before that was.
    """

    events: list[Event]
    cause: Event | None = None

    @property
    def last(self) -> Event:
        """The event with the effective state."""
        return self.events[-1]

    @property
    def after_ns(self) -> int | None:
        """Nanoseconds since the command that brought it about; None without one."""
        return None if self.cause is None else self.last.time_ns - self.cause.time_ns


def rows(timeline: Timeline) -> list[EventRow]:
    """The events of a drive, those of one word in one frame together."""
    found: list[EventRow] = []
    for event in timeline.events:
        here = found[-1].last if found else None
        if here is not None and (here.frame, here.word) == (event.frame, event.word):
            found[-1].events.append(event)
        else:
            found.append(EventRow([event]))
    newest: dict[str, Event] = {}
    heeded = 0
    for row in found:
        newest |= {each.name: each for each in row.events}
        # The word before may have taken a command back, which is no event.
        for word in (row.last.before or 0, row.last.after or 0) if row.last.word == "STW1" else ():
            heeded = word if word >> stopping().heeded & 1 else heeded
        causes = (_cause(each, newest, heeded) for each in row.events if is_caused(each))
        row.cause = next(filter(None, causes), None)
    return found


def _cause(event: Event, newest: dict[str, Event], heeded: int) -> Event | None:
    """The newest command that brings about an event, if it is in force and nothing nearer explains the event."""
    commands = [newest[name] for name in _CAUSES[event.name] if name in newest]
    command = max(commands, key=lambda each: each.time_ns, default=None)
    if command is None or command.time_ns > event.time_ns:
        return None
    if event.name == "fault-cleared":
        in_force = event.time_ns - command.time_ns < limits().acknowledge_ns
    else:
        faulty = "fault" in (*command.overlays, *event.overlays)
        in_force = _is_asked(command.name, heeded) and not faulty
    nearer = (
        newest[name].time_ns >= command.time_ns
        for name in _NEARER[event.name]
        if name in newest and not _is_asked(_ASKED.get(name), heeded)
    )
    return command if in_force and not any(nearer) else None


def _is_asked(name: str | None, heeded: int) -> bool:
    """Whether the control word that the drive heeds says a command."""
    return any(edge.id == name and heeded >> edge.bit & 1 == edge.value for edge in edges("stw1"))


def is_caused(event: Event) -> bool:
    """Whether an event is one that a command brings about."""
    return event.name in _CAUSES


def words(row: EventRow) -> Both:
    """What happened, in both languages: `running, 1.2 s after ON`."""
    shown = joined([_event(each) for each in row.events])
    after = row.after_ns
    if row.cause is None or after is None:
        return shown
    time = _time(after)
    return shown.joined(say("after_command", time=time, command=_event(row.cause)), ", ", "，")


def _time(nanoseconds: int) -> str:
    """A time as people say it of a drive: `32.1 ms`, `1.22 s`, `99.1 s`."""
    seconds = nanoseconds / 1e9
    return f"{seconds:.2f} s" if 1 <= seconds < 10 else duration(nanoseconds)


def _event(event: Event) -> Both:
    return Both(event_text(event.name), event_text(event.name, "zh"))


def change(row: EventRow) -> str:
    """The word before and after, as PLC tables print it: `STW1 047E -> 047F`; empty where there is none."""
    last = row.last
    if last.word is None or last.after is None:
        return ""
    before = "" if last.before is None else f"{last.before:04X} -> "
    return f"{last.word} {before}{last.after:04X}"


def standing(row: EventRow) -> Both:
    """The state of the drive from then on, with what is shown beside it; empty where it is not known."""
    last = row.last
    if last.state is None:
        return Both.same("")
    return Both.of(state_text, last.state, last.overlays)
