"""Whose parameters are named on a line of PROFIBUS: by what the frames say the stations are."""

from __future__ import annotations

import io
import json
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.audit import run

from ds47.analysis import AnalysisOptions, analyze
from ds47.cli import main
from ds47.lab import captured, message
from ds47.lab.fdl import PARAMETERS
from ds47.lab.master import READY, SET_PRM, Master, Way
from ds47.model import SIEMENS, error_words
from ds47.report import json as report
from ds47.report import load
from ds47.spec import maker_names

STATION = 3
IDENTS = MM4, SINAMICS, OTHER, VLT = "80b5", "80e5", "4711", "0402"
LENZE, DANFOSS = 0x0106, maker_names.number("danfoss")
WITHOUT_IDENT = SET_PRM[:8]
"""A Set_Prm that ends before the ident number."""
SPEC = Path(__file__).parents[2] / "python/ds47/spec"
NUMBERS = (10, 21, 700, 922, 1082, 2900, 3996)
"""Of both makes, of MICROMASTER (three), of the profile, of MICROMASTER, of SINAMICS (two)."""


def sent(ident: str) -> str:
    return SET_PRM[:8] + ident + SET_PRM[12:]


def asked(master: Master, reference: int = 1, station: int = STATION) -> None:
    places = [message.address(number) for number in NUMBERS]
    told = bytes((reference, 1, 1, len(NUMBERS))) + b"".join(
        message.real(float(number)) for number in range(len(NUMBERS))
    )
    master.parameters(Way(station), message.read(reference, 1, *places), told)


def names(master: Master) -> list[list[str | None]]:
    """Of each transaction of records what its parameters are called."""
    result = analyze(io.BytesIO(captured(master.stage)))
    return [[one.name for one in each.parameters] for each in result.transactions]


def expected(*families: str) -> list[str | None]:
    """The names of the tables that are of these families, read from the files themselves."""
    known = {}
    for name in ("parameters.toml", "drives.toml"):
        rows = tomllib.loads((SPEC / name).read_text(encoding="utf-8"))["parameter"]
        known |= {
            row["number"]: row["en"] for row in rows if row.get("family", "profile") in families
        }
    return [known.get(number) for number in NUMBERS]


MICROMASTER = expected("profile", "siemens", "micromaster")
PROFILE = expected("profile")
REFUSED = {SINAMICS: "Maximum speed", MM4: "Maximum frequency", OTHER: None}
"""What 1082 is."""


def test_the_lists_differ() -> None:
    assert [name is None for name in MICROMASTER] == [False] * 5 + [True] * 2
    assert [name is None for name in PROFILE] == [True] * 3 + [False] + [True] * 3


def lines() -> Iterator[tuple[str, Master, list[list[str | None]]]]:
    """Lines by name, and what the parameters of each transaction on them are called."""
    started = Master()
    started.start(STATION, sent(MM4))
    asked(started)
    yield "a start-up names the make", started, [MICROMASTER]
    nothing = Master()
    asked(nothing)
    yield "nothing names it: the profile is left", nothing, [PROFILE]
    later = Master()
    asked(later)
    later.diagnose(STATION)
    asked(later, 2)
    yield "it counts from its frame on", later, [PROFILE, MICROMASTER]
    for project, device, found in ((MM4, OTHER, PROFILE), (OTHER, MM4, MICROMASTER)):
        wrong = Master()
        wrong.start(STATION, sent(project), diagnosis=READY[:8] + device)
        asked(wrong)
        yield f"the project says {project}, the slave {device}", wrong, [found]
    for cut in (WITHOUT_IDENT, SET_PRM[:2], ""):
        short = Master()
        short.ask(STATION, cut, PARAMETERS)
        short.short()
        asked(short)
        yield f"a Set_Prm of {len(cut) // 2} bytes", short, [PROFILE]
    other = Master()
    other.start(STATION + 1, sent(MM4))
    asked(other)
    yield "another station", other, [PROFILE]
    both = Master()
    both.start(STATION, sent(MM4))
    both.start(STATION + 1, sent(OTHER))
    for number in range(4):
        asked(both, 1, STATION + number % 2)
    yield "equal requests to two makes", both, [MICROMASTER, PROFILE] * 2
    for ident in (SINAMICS, MM4, OTHER):
        yield f"{ident} refuses a change", refused(ident), [[REFUSED[ident]]]


def refused(ident: str) -> Master:
    """A change of parameter 1082 is refused with 0x6B."""
    master = Master()
    master.start(STATION, sent(ident))
    asked = message.change(1, 1, (message.address(1082), message.real(40.0)))
    master.parameters(Way(STATION), asked, bytes((1, 0x82, 1, 1)) + message.error(0x6B))
    return master


@pytest.mark.parametrize(
    ("master", "found"), [pytest.param(*rest, id=name) for name, *rest in lines()]
)
def test_parameters_are_named_by_what_the_frames_say(
    master: Master, found: list[list[str | None]]
) -> None:
    assert names(master) == found


# What an error number means


@pytest.mark.parametrize(
    ("ident", "said"),
    [(SINAMICS, ["DS719"]), (MM4, ["DS701"]), (OTHER, ["DS701"]), (VLT, ["DS701"])],
)
def test_a_drive_that_is_enabled_is_known_as_on_profinet(
    ident: str, said: list[str], tmp_path: Path
) -> None:
    """Of SINAMICS the manual has 0x6B; that of MICROMASTER has no such number."""
    path = tmp_path / "refused.pcapng"
    path.write_bytes(captured(refused(ident).stage))
    found = [each for each in analyze(path).findings if each.rule.startswith("DS7")]
    assert [each.rule for each in found] == said
    assert found[0].args["vendor_id"] == {SINAMICS: SIEMENS, VLT: DANFOSS}.get(ident)
    assert run.audit(path) == []


ASSUMED = {
    (SINAMICS, LENZE): (SIEMENS, "Maximum speed", "No change access while the controller is enabled"),
    (MM4, LENZE): (None, "Maximum frequency", "(SINAMICS: No change access while the controller is enabled)"),
    (VLT, LENZE): (DANFOSS, None, "Manufacturer-specific error 0x6B"),
    (VLT, SIEMENS): (DANFOSS, None, "Manufacturer-specific error 0x6B"),
    (OTHER, LENZE): (LENZE, None, "see the manual of Lenze, vendor 0x0106"),
    (OTHER, DANFOSS): (DANFOSS, None, "Manufacturer-specific error 0x6B"),
    (OTHER, SIEMENS): (SIEMENS, "Maximum speed", "No change access while the controller is enabled"),
    (OTHER, None): (None, None, "(SINAMICS: No change access while the controller is enabled)"),
}  # fmt: skip
"""By ident number and assumed vendor: whose error number it is, what 1082 is, how the words of 0x6B end."""


@pytest.mark.parametrize(("given", "expected"), ASSUMED.items(), ids=str)
def test_a_vendor_is_assumed_where_no_ident_number_tells_it(
    given: tuple[str, int | None], expected: tuple[int | None, str | None, str]
) -> None:
    ident, assumed = given
    result = analyze(io.BytesIO(captured(refused(ident).stage)), AnalysisOptions(vendor_id=assumed))
    (parameter,) = result.transactions[0].parameters
    assert parameter.error is not None
    assert (parameter.error.vendor_id, parameter.name) == expected[:2]
    assert parameter.error.text.endswith(expected[2])
    (found,) = (each for each in result.findings if each.rule == "DS410")
    assert found.args["vendor_id"] == expected[0]
    document = report.capture(result)
    loaded = load.capture(json.loads(json.dumps(document)))
    assert report.capture(loaded) == document
    if assumed != LENZE or ident != OTHER:  # which has no table of its own
        again = loaded.transactions[0].parameters[0].error
        assert again is not None
        assert error_words(again, "zh") == error_words(parameter.error, "zh")


def test_the_maker_of_pkw_is_assumed_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """104 is an illegal value on drives of Siemens, and parameter does not exist on those of Rockwell."""
    master = Master()
    master.start(STATION, sent(OTHER))
    for request, response in (("2023000000000005", "7023000000000068"), ("0" * 16, "0" * 16)):
        master.exchange(STATION, request + "00" * 4, response + "00" * 4)
    path = tmp_path / "pkw.pcapng"
    path.write_bytes(captured(master.stage))
    for more, words in (
        ((), "104: Manufacturer-specific error 104"),
        (("--vendor", "rockwell"), "104: Parameter does not exist"),
        (("--vendor", "sinamics"), "104: Illegal value for this request"),
    ):
        assert main(["report", str(path), *more]) == 0
        assert words in " ".join(capsys.readouterr().out.split())
