"""`ds47 explain`: the forms of a code, complete answers in both languages, answers as people read them."""

from __future__ import annotations

import itertools
import json
import os
import re
import shlex
import string
import subprocess
import tomllib
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
from fake_tshark import real_tshark

from ds47 import spec
from ds47.cli import main
from ds47.explain import CodeMeaning, Reading, UnknownFormError, explain, find_vendor, read
from ds47.model import Parameter
from ds47.report import values
from ds47.report.explanation import lines as _lines
from ds47.report.wrap import columns
from ds47.spec import explanations, s7

ROOT = Path(__file__).resolve().parents[2]
LANGUAGES = ("en", "zh")
SCREEN = 32
CHINESE = re.compile(r"[\u4e00-\u9fff]")

STATUS_CODES = sorted(spec.status().code)
MS2 = (0xD1, 0xD7)
"""Services of PROFIBUS alone: no protocol machine of PROFINET answers them."""
ACCESS = sorted(spec.status().access)
PROTOCOL = sorted(spec.status().protocol)
CONNECTION = {
    0x81813F02: ("no device with the configured station name", "站名"),
    0x81813F03: ("several devices have the configured station name", "多台"),
    0x81813F06: ("DCP Set failed", "DCP Set"),
    0x81813F07: ("the IP address is used more than once", "重复"),
    0xCF81FD0B: ("an alarm could not be handled", "报警"),
    0xCF81FD0D: ("a partner gave it up itself", "主动放弃"),
    0xCF81FD20: ("reset to factory settings by DCP", "恢复出厂设置"),
    0xCF81FD24: ("no port offers the required speed", "端口"),
    0xCF81FD28: ("did not report ready in time", "就绪"),
    0xDEFE0102: ("PROFIBUS FMS", "FMS"),
    0xDFFF0102: ("HART", "HART"),
    0xD1FE0102: ("PROFIBUS FMS (FE) or of HART (FF)", "HART"),
    0xD180B000: ("Data transport (PROFIBUS) refused: access: invalid index", "数据传输"),
    0xD780C200: ("Initiate (PROFIBUS) refused: resource: busy", "发起连接"),
}
STATUSES = [
    *(code << 24 | 0x80 << 16 | first << 8 for code in STATUS_CODES for first in ACCESS),
    *(code << 24 | 0x81 << 16 | first << 8 for code in STATUS_CODES if code not in MS2 for first in PROTOCOL),
    *(code << 24 | decode << 16 | 0x0102 for code in (*MS2, 0xDE, 0xDF) for decode in (0xFE, 0xFF)),
    *(code << 24 | 0x82 << 16 | 0x1234 for code in (0xDE, 0xDF)),
    0xCF81FD05, 0xCF81FD06, 0xCF81FD25, *CONNECTION,
]  # fmt: skip
S7 = ["00700000", "00700100", "00700200", "7000", "7001", "7002", "16#0070_0200", "0x700200"]
S7 += [
    f"C080{code:02X}00" for code in (0x90, 0x92, 0x93, 0x96, 0xA3, 0xA4, 0xB1, *range(0xC2, 0xC8))
]
S7 += [
    "C0820000",
    "C0840000",
    "C08F0000",
    "C080B000",
    "40820000",
    "40000115",
    "40000113",
    "00000000",
]
NUMBERS = [
    *(f"error 0x{code:02X}" for code in range(0x100)),
    *(f"response 0x{code:02X}" for code in spec.response_ids()),
    *(f"request 0x{code:02X}" for code in spec.request_ids()),
    *(f"attribute 0x{code:02X}" for code in (*spec.attributes(), *spec.vendor_attributes())),
    *(f"format 0x{code:02X}" for code in spec.formats()),
    *("47", "16#2F", "index 71", "B02E", "0xB02F", "45102"),
    *(f"status {code:02X}" for code in STATUS_CODES),
    *spec.rules(),
]


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    status = main(["explain", *arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def every_meaning(lang: str) -> Iterator[CodeMeaning]:
    for code in itertools.chain((f"{status:08X}" for status in STATUSES), S7, NUMBERS):
        yield from explain(code, lang)


# ------------------------------------------------------------------------------------- the forms


@pytest.mark.parametrize(
    ("text", "readings"),
    [
        ("DE80B500", [("status", 0xDE80B500)]),
        ("de80b500", [("status", 0xDE80B500)]),
        ("16#DE80B500", [("status", 0xDE80B500)]),
        ("16#DE80_B500", [("status", 0xDE80B500)]),
        ("DW#16#DE80_B500", [("status", 0xDE80B500)]),
        ("0xDE80B500", [("status", 0xDE80B500)]),
        ("DE 80 B5 00", [("status", 0xDE80B500)]),
        ("DE-80-B5-00", [("status", 0xDE80B500)]),
        ("3732976896", [("status", 0xDE80B500)]),
        ("-561990400", [("status", 0xDE80B500)]),
        ("１６＃DE80B500", [("status", 0xDE80B500)]),
        ("00700000", [("status", 0x00700000)]),
        ("80B5", [("word", 0x80B5)]),
        ("W#16#80B5", [("word", 0x80B5)]),
        ("80B5h", [("word", 0x80B5)]),
        ("80 B5", [("word", 0x80B5)]),
        ("-32587", [("word", 0x80B5)]),
        ("0x6B", [("byte", 0x6B)]),
        ("6B", [("byte", 0x6B)]),
        ("0x006B", [("byte", 0x6B)]),
        ("0x0000006B", [("status", 0x6B), ("byte", 0x6B)]),
        ("B#16#82", [("byte", 0x82)]),
        ("10#107", [("byte", 107)]),
        ("107", [("word", 0x107), ("byte", 107)]),
        ("82", [("byte", 0x82), ("byte", 82)]),
        ("-126", [("byte", 0x82)]),
        ("DS410", [("rule", 410)]),
        ("drive-error", [("rule", 410)]),
        ("Two-Users", [("rule", 705)]),
        ("DS47", [("byte", 47)]),
    ],
)
def test_forms(text: str, readings: list[tuple[str, int]]) -> None:
    assert [(each.size, each.value) for each in read(text).readings] == readings


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("error 107", "error", 107),
        ("Error number 0x6B", "error", 0x6B),
        ("错误 0x6B", "error", 0x6B),
        ("错误号0x6B", "error", 0x6B),
        ("response id: 0x82", "response_id", 0x82),
        ("format=0x44", "format", 0x44),
        ("RET_VAL 80B5", "status", 0x80B5),
    ],
)
def test_a_word_in_front_says_the_kind(text: str, kind: str, value: int) -> None:
    code = read(text)
    assert code.kind == kind
    assert value in [each.value for each in code.readings]


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("Float32", 0x08),
        ("float32", 0x08),
        ("REAL", 0x08),
        ("DINT", 0x04),
        ("format Word", 0x42),
        ("data type LREAL", 0x0F),
        ("Dword", 0x43),
        ("Float32+Unsigned8", 0x65),
        ("N2 Normalized value (16 bit)", 0x71),
    ],
)
def test_a_format_by_its_name(text: str, code: int) -> None:
    (named,) = explain(text)
    assert named in explain(f"format 0x{code:02X}")
    assert named.title.startswith(f"0x{code:02X} = {code}: format: {spec.formats()[code].name}")


@pytest.mark.parametrize("name", ["C4", "D2", "E2", "BCD"])
def test_a_format_whose_name_is_a_number_needs_the_word_in_front(name: str) -> None:
    named = spec.format_named(name)
    assert named is not None
    title = f"0x{named.code:02X} = {named.code}: format: {name}, "
    assert explain(f"format {name}")[0].title.startswith(title)
    assert not [each for each in explain(name) if each.title.startswith(title)]


def test_the_other_names_of_a_format(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "format", "0x43")
    assert "  Also called DWORD in a PLC · Dword in Wireshark's own dissector\n" in out
    assert "Also called" not in run(capsys, "format", "0x0A")[1]


@pytest.mark.parametrize(
    "text", ["", " ", "xyz", "16#", "0x", "DE80B50011", "4294967296", "-2147483649", "1.5", "error",
             "format 0x2B1", "format DE80B500", "DS4100", "DS4", "two users", "16#6G", "٣"],
)  # fmt: skip
def test_what_is_no_code_is_refused(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(UnknownFormError):
        explain(text)
    for lang in LANGUAGES:
        status, out, err = run(capsys, "--lang", lang, text)
        assert (status, out) == (2, "")
        assert len(err.splitlines()) == 1
        assert "DE80B500" in err or "ds47 params show" in err


# ----------------------------------------------------------------------------------- completeness


def _texts(item: Any, path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    if isinstance(item, dict):
        yield path, item
        for key, value in item.items():
            yield from _texts(value, f"{path}.{key}")
    elif isinstance(item, list):
        for place, value in enumerate(item):
            yield from _texts(value, f"{path}[{place}]")


def _placeholders(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name}


def test_every_text_is_there_in_both_languages_with_the_same_placeholders() -> None:
    table = tomllib.loads((resources.files("ds47.spec") / "explain.toml").read_text("utf-8"))
    assert table["words"]["en"].keys() == table["words"]["zh"].keys()
    for key, text in table["words"]["en"].items():
        assert _placeholders(text) == _placeholders(table["words"]["zh"][key]), key
    count = 0
    for path, row in _texts(table):
        for key, text in row.items():
            if (key == "en" or key.endswith("_en")) and isinstance(text, str):
                other = row[key[:-2] + "zh"]
                count += 1
                assert text.strip(), path
                only_names = not re.search(r"[a-z]", re.sub(r"\{\w+\}", "", other))
                assert CHINESE.search(other) or only_names, f"{path}.{key}: {other}"
                assert not CHINESE.search(text), path
                assert _placeholders(text) == _placeholders(other), path
    assert count > 300


def test_causes_say_how_sure_they_are() -> None:
    table = tomllib.loads((resources.files("ds47.spec") / "explain.toml").read_text("utf-8"))
    causes = [cause for name in ("status", "local", "error", "number") for row in table[name]
              for cause in row.get("cause", ())]  # fmt: skip
    assert {cause["basis"] for cause in causes} == set(explanations.BASES)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_code_of_the_tables_has_a_complete_answer(lang: str) -> None:
    for meaning in every_meaning(lang):
        where = f"{meaning.code} {meaning.kind}"
        texts = [meaning.title, meaning.look, *(cause.text for cause in meaning.causes)]
        texts += [block.note for block in meaning.plc] + [part.text for part in meaning.parts]
        assert meaning.title, where
        assert meaning.look, where
        assert meaning.causes, where
        assert meaning.plc, where
        for text in texts:
            assert not re.search(r"\{|\}|\bNone\b", text), f"{where}: {text}"
        for text in (meaning.title, meaning.look, *(cause.text for cause in meaning.causes)):
            assert bool(CHINESE.search(text)) == (lang == "zh"), f"{where}: {text}"
        if meaning.known:
            rule = spec.rules().get(meaning.code)
            shown = rule is None or not rule.analyzer_only
            assert bool(meaning.filter or meaning.plugin_filter) == shown, where
            assert explain(meaning.name.split(" --")[0], lang), where


@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_status_of_the_tables_is_known(lang: str) -> None:
    for status in STATUSES:
        code = f"{status:08X}"
        (meaning,) = explain(code, lang)
        assert meaning.known, code
        assert meaning.title.startswith(code)
        assert meaning.kind == "status"
        assert [part.value for part in meaning.parts] == re.findall("..", code)
        assert meaning.filter.startswith(f"pn_io.error_code == 0x{code[:2].lower()}")


@pytest.mark.parametrize(("status", "wanted"), CONNECTION.items(), ids=lambda item: str(item)[:10])
def test_words_of_connections_and_of_profibus(status: int, wanted: tuple[str, str]) -> None:
    for lang, text in zip(LANGUAGES, wanted, strict=True):
        (meaning,) = explain(f"{status:08X}", lang)
        assert text in meaning.title


@pytest.mark.parametrize("vendor", [None, *(each.name for each in spec.vendors())])
@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_error_number_has_the_text_of_its_table(lang: str, vendor: str | None) -> None:
    maker = None if vendor is None else find_vendor(vendor)
    for code in range(0x100):
        meanings = explain(f"error 0x{code:02X}", lang, maker)
        titles = " / ".join(each.title for each in meanings)
        tables = [each for each in spec.vendors() if code in each.errors]
        wanted = [each for each in tables if vendor in (None, each.name)]
        for table in wanted:
            row = table.errors[code]
            text = row.zh if lang == "zh" else row.en
            assert table.name in [each.vendor for each in meanings]
            assert text.format(code=code, above=code - row.code) in titles
        if not wanted or (vendor is None and code in spec.errors()):
            assert spec.error_text(code, lang, -1) in titles  # of a maker that has a table


@pytest.mark.parametrize("code", S7)
def test_states_that_the_plc_makes_are_known(code: str) -> None:
    for lang in LANGUAGES:
        assert explain(code, lang)[0].known


# ------------------------------------------------------------------------------- what PLCs show


def outputs(code: str) -> dict[str, tuple[Any, ...]]:
    rows = explain(code)[0].plc
    return {row.block: (row.done, row.busy, row.error, row.status) for row in rows}


@pytest.mark.parametrize(
    ("code", "wrrec", "rdrec"),
    [
        ("DE80B500", (True, False, False, "00000000"), (False, False, True, "DE80B500")),
        ("DF80B700", (False, False, True, "DF80B700"), (None, None, None, None)),
        ("00700000", (False, False, False, "00700000"), (False, False, False, "00700000")),
        ("00700100", (False, True, False, "00700100"), (False, True, False, "00700100")),
        ("7002", (False, True, False, "00700200"), (False, True, False, "00700200")),
        ("C0809300", (False, False, True, "C0809300"), (False, False, True, "C0809300")),
        ("0x6B", (True, False, False, "00000000"), (True, False, False, "00000000")),
        ("82", (True, False, False, "00000000"), (True, False, False, "00000000")),
        ("00000000", (True, False, False, "00000000"), (True, False, False, "00000000")),
    ],
)
def test_what_the_blocks_show(code: str, wrrec: tuple[Any, ...], rdrec: tuple[Any, ...]) -> None:
    assert outputs(code) == {"WRREC": wrrec, "RDREC": rdrec}


@pytest.mark.parametrize("status", [status for status in STATUSES if status >> 24 in (0xDE, 0xDF)])
def test_a_refusal_is_an_error_of_the_block_that_was_refused(status: int) -> None:
    code = f"{status:08X}"
    block = "RDREC" if code.startswith("DE") else "WRREC"
    assert outputs(code)[block] == (False, False, True, code)


# -------------------------------------------------------------------------- which meaning is first


def brief(code: str, vendor: str | None = None) -> list[tuple[str, str, str | None]]:
    maker = None if vendor is None else find_vendor(vendor)
    found = explain(code, "en", maker)
    return [(each.kind, each.code, each.vendor) for each in found if each.known]


NAMED = (None, "SINAMICS", "ABB", "KEB", "SEW")
"""Makers that the cases below name: one that comes later changes none of them."""


@pytest.mark.parametrize(
    ("code", "meanings"),
    [
        ("82", [("response_id", "0x82", None), ("error", "0x82", "SINAMICS"),
                ("error", "0x82", "ABB"), ("attribute", "0x82", None), ("error", "0x82", "SEW")]),
        ("0x82", [("response_id", "0x82", None), ("error", "0x82", "SINAMICS"),
                  ("error", "0x82", "ABB"), ("attribute", "0x82", None), ("error", "0x82", "SEW")]),
        ("130", [("response_id", "0x82", None), ("error", "0x82", "SINAMICS"),
                 ("error", "0x82", "ABB"), ("error", "0x82", "SEW")]),
        ("107", [("error", "0x6B", "SINAMICS"), ("error", "0x6B", "KEB")]),
        ("20", [("error", "0x20", None), ("error", "0x14", None), ("error", "0x14", "KEB"),
                ("block_output", "GET 20", None), ("attribute", "0x20", None),
                ("format", "0x20", None)]),
        ("47", [("index", "0x2F", None), ("index", "0x47", None)]),
        ("16#44", [("format", "0x44", None)]),
        ("16#80B5", [("status", "DE80B500", None), ("status", "DF80B500", None),
                     ("record_data", "0x80B5", None)]),
        ("16#80B1", [("status", "DE80B100", None), ("status", "DF80B100", None),
                     ("status", "C080B100", None), ("consistent_data", "0x80B1", None),
                     ("record_data", "0x80B1", None)]),
        ("8093", [("status", "C0809300", None), ("consistent_data", "0x8093", None),
                  ("record_data", "0x8093", None)]),
        ("8402", [("block_output", "SINA_POS 16#8402", None), ("s7_error", "0x8402", None),
                  ("status", "C0840200", None)]),
        ("7002", [("status", "00700200", None), ("block_output", "SINA_POS 16#7002", None),
                  ("record_data", "0x7002", None)]),
        ("25", [("error", "0x19", None), ("block_output", "GET 25", None), ("format", "0x25", None)]),
        ("3", [("error", "0x03", None), ("error", "0x03", "KEB"), ("block_output", "BSEND 3", None),
               ("block_output", "SINA_PARA 16#0003", None), ("format", "0x03", None),
               ("s7_item", "0x03", None)]),
        ("0x0000006B", [("error", "0x6B", "SINAMICS"), ("error", "0x6B", "KEB"),
                        ("format", "0x6B", None)]),
        ("DS410", [("rule", "DS410", None)]),
    ],
)  # fmt: skip
def test_where_a_code_means_several_things_all_are_shown(
    code: str, meanings: list[tuple[str, str, str | None]]
) -> None:
    assert [each for each in brief(code) if each[2] in NAMED] == meanings


def test_a_number_that_means_nothing_in_one_reading_says_so() -> None:
    assert "0x0107 = 263" in explain("107")[-1].title
    assert not explain("107")[-1].known
    assert "Reserved" in explain("82")[-1].title


def test_bytes_in_the_order_of_a_little_endian_pdu() -> None:
    (meaning,) = explain("00 B5 80 DE")
    assert meaning.code == "DE80B500"
    assert "reversed" in meaning.title


@pytest.mark.parametrize("vendor", ["SINAMICS", "sinamics", "Siemens", "0x002A", "16#2a", "42"])
def test_a_vendor_picks_its_table(vendor: str) -> None:
    assert brief("error 0x82", vendor) == [("error", "0x82", "SINAMICS")]


def test_a_vendor_without_a_table_leaves_the_number_open() -> None:
    (meaning,) = explain("error 0x6B", "en", find_vendor("0x0123"))
    assert not meaning.known
    assert "Manufacturer-specific error 0x6B" in meaning.title


def test_the_number_of_a_vendor_goes_before_that_of_the_profile() -> None:
    assert brief("error 0x11", "KEB") == [("error", "0x11", "KEB")]
    assert brief("error 0x11", "ABB") == [("error", "0x11", None)]


@pytest.mark.parametrize(
    ("code", "part"),
    [("DEADBEEF", "AD"), ("0x1234", "12"), ("DE80", "DE"), ("DS999", None), ("error 0x40", None),
     ("format 0x7F", None), ("attribute 0x55", None), ("response 3", None), ("index 12", None)],
)  # fmt: skip
def test_understood_but_without_a_meaning(
    code: str, part: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    for lang in LANGUAGES:
        meaning = explain(code, lang)[0]
        assert not meaning.known
        if part:
            assert part in [each.value for each in meaning.parts]
        assert run(capsys, code, "--lang", lang)[0] == 0


def test_no_number_is_an_exception() -> None:
    for value in range(0x10000):
        if value < 0x1000 or value & 0xFF in (0, 0x93, 0xB5):
            assert explain(f"0x{value:X}")
            assert explain(str(value), "zh")
    for code in range(0x100):
        for decode in (0x00, 0x70, 0x7F, 0x80, 0x81, 0x84, 0x8F, 0xFE):
            assert explain(f"{code:02X}{decode:02X}B5FF")


# ------------------------------------------------------------------------------------- the command


@pytest.mark.slow
@pytest.mark.parametrize("lang", LANGUAGES)
def test_an_answer_fits_on_a_screen_and_begins_with_the_answer(lang: str) -> None:
    wide = re.compile(r"pn_io|s7comm|ds47\.|ds47 explain")
    codes = [f"{status:08X}" for status in STATUSES] + S7 + NUMBERS
    for code in [*codes, *map(str, range(256)), *(f"0x{value:02X}" for value in range(256))]:
        meanings = explain(code, lang)
        lines = list(_lines(meanings, lang))
        assert len(lines) <= SCREEN, code
        assert lines[0].split()[0] in meanings[0].title
        for line in lines:
            assert columns(line) <= 100 or wide.search(line), f"{code}: {line}"
            assert line == line.rstrip()


def test_json_has_all_of_every_meaning(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "82", "-f", "json", "--lang", "zh")
    assert status == 0
    document = json.loads(out)
    assert (document["code"], document["lang"]) == ("82", "zh")
    first, second = document["meanings"][:2]
    assert (first["kind"], first["code"], first["known"]) == ("response_id", "0x82", True)
    assert first["plc"][0]["done"] is True
    assert first["plc"][1]["valid"] is True
    assert second["vendor"] == "SINAMICS"
    assert {cause["basis"] for cause in first["causes"]} <= set(explanations.BASES)
    assert set(first) == {"kind", "code", "name", "vendor", "title", "known", "parts", "plc",
                          "causes", "advice", "look", "filter", "plugin_filter"}  # fmt: skip


def test_the_code_may_be_several_arguments(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "DE", "80", "B5", "00")[1] == run(capsys, "DE80B500")[1]
    assert run(capsys, "error", "107", "--vendor", "KEB")[1].startswith("0x6B = 107")


def test_a_negative_number_is_no_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "-561990400")[1] == run(capsys, "DE80B500")[1]
    status, _, err = run(capsys, "--vendr", "82")
    assert status == 2
    assert "--vendr" in err


def test_an_unknown_vendor_is_wrong_use(capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = run(capsys, "107", "--vendor", "nobody")
    assert status == 2
    assert "SINAMICS" in err


# ------------------------------------------------------------------------------------- Wireshark


def _found(home: Path, capture: str, wanted: str, plugin: bool) -> int:
    """How many frames of a stored capture a display filter finds."""
    command = [real_tshark(), "-n"]
    if plugin:
        command += ["-X", f"lua_script:{ROOT / 'dissector' / 'ds47.lua'}", "-2"]
    command += ["-r", str(ROOT / "captures" / capture), "-Y", wanted]
    environment = {**os.environ, "HOME": str(home), "XDG_CONFIG_HOME": str(home)}
    environment.pop("WIRESHARK_CONFIG_DIR", None)
    shown = subprocess.run(command, capture_output=True, env=environment, timeout=120, check=False)
    assert shown.returncode == 0, shown.stderr.decode("utf-8", "replace")
    return len(shown.stdout.splitlines())


@pytest.mark.parametrize("plugin", [False, True], ids=["wireshark", "plugin"])
def test_every_filter_can_be_pasted(plugin: bool, tmp_path: Path) -> None:
    real_tshark()
    filters = {each.plugin_filter if plugin else each.filter for each in every_meaning("en")}
    shapes: dict[str, str] = {}
    for wanted in sorted(filter(None, filters)):
        shapes.setdefault(re.sub(r'0x[0-9a-f]+|"[^"]*"', "?", wanted), wanted)
    assert len(shapes) > 5
    _found(
        tmp_path,
        "record-polls.pcapng",
        " || ".join(f"({each})" for each in shapes.values()),
        plugin,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "capture", "plugin"),
    [
        ("DE80B500", "record-polls.pcapng", False),
        ("DE80B500", "record-polls.pcapng", True),
        ("DE80B500", "record-nothing-to-read.pcapng", True),
        ("47", "record-polls.pcapng", False),
        ("B02F", "record-global.pcapng", True),
        ("82", "conversation-error-change.pcapng", False),
        ("82", "conversation-error-change.pcapng", True),
        ("16#44", "conversation-error.pcapng", True),
        ("request 1", "record-polls.pcapng", True),
        ("attribute 0x10", "record-polls.pcapng", True),
        ("DS410", "conversation-error.pcapng", True),
    ],
)
def test_a_filter_finds_the_frames(code: str, capture: str, plugin: bool, tmp_path: Path) -> None:
    real_tshark()
    meaning = explain(code)[0]
    wanted = meaning.plugin_filter if plugin else meaning.filter
    assert wanted
    assert _found(tmp_path, capture, wanted, plugin) > 0


def test_a_diagnosis_of_the_whole_capture_has_no_filter_and_says_so() -> None:
    meaning = explain("DS721")[0]
    assert (meaning.filter, meaning.plugin_filter) == (None, None)
    assert "Only ds47 report has it" in meaning.look


# ------------------------------------------------------------------------------------------ page


def _commands() -> list[tuple[str, int, str]]:
    """The commands of docs/explain.md with their exit status and the output shown below them."""
    text = (ROOT / "docs" / "explain.md").read_text("utf-8")
    found = []
    for block in re.findall(r"^```console\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            line, _, output = part.partition("\n")
            line, _, comment = line.partition("  # exit ")
            found.append((line, int(comment or 0), output))
    return found


@pytest.mark.parametrize(("line", "wanted", "shown"), _commands(), ids=lambda item: str(item)[:40])
def test_the_page_shows_what_happens(
    line: str, wanted: int, shown: str, capsys: pytest.CaptureFixture[str]
) -> None:
    name, command, *arguments = shlex.split(line)
    assert (name, command) == ("ds47", "explain")
    status, out, _ = run(capsys, *arguments)
    assert status == wanted
    actual = iter(out.splitlines())
    for expected in filter(None, shown.splitlines()):
        assert expected == "..." or expected in actual, expected


def test_readings_are_compared_by_value() -> None:
    assert Reading("byte", 1) == Reading("byte", 1, False)


# ------------------------------------------------------------------- numbers beyond a byte, doubts


@pytest.mark.parametrize("code", ["0x0811", "16#0811", "0811h", "2065", "error 0x0811"])
def test_a_number_of_two_bytes_is_that_of_its_maker(code: str) -> None:
    meaning = explain(code)[0]
    assert (meaning.kind, meaning.code, meaning.vendor) == ("error", "0x0811", "SEW")
    assert meaning.title.endswith("Function or parameter not implemented")
    assert meaning.plugin_filter == "ds47.error.code == 0x0811"
    assert "功能或参数未实现" in explain(code, "zh")[0].title


def test_a_number_of_two_bytes_that_nobody_has_is_a_word_unless_asked_for() -> None:
    assert [each.kind for each in explain("0x0911")] == ["word"]
    (meaning,) = explain("error 0x0911")
    assert not meaning.known
    assert meaning.title.endswith("Manufacturer-specific error 0x0911")
    (other,) = explain("error 0x0811", "en", find_vendor("ABB"))
    assert other.title.endswith("Manufacturer-specific error 0x0811")


@pytest.mark.parametrize("code", [0x6D, 0x78, 0x79, 0x7A, 0x7B, 0x7C])
def test_what_no_source_prints_is_not_called_documented(code: int) -> None:
    (meaning,) = explain(f"error 0x{code:02X}", "en", find_vendor("SINAMICS"))
    assert meaning.causes[0].basis == "unconfirmed"


@pytest.mark.parametrize("code", [0x71, 0x75, 0x7E, 0x7F])
def test_an_answer_about_one_number_speaks_of_no_other(code: int) -> None:
    for lang in LANGUAGES:
        (meaning,) = explain(f"error 0x{code:02X}", lang, find_vendor("SINAMICS"))
        (cause,) = meaning.causes
        assert "0x" not in cause.text
        assert ("p0010" in cause.text) is (code < 0x78)
        assert ("p0009" in cause.text) is (code > 0x78)


@pytest.mark.parametrize(("code", "doubted"), [(0x10, True), (0x15, True), (0x08, False)])
def test_a_size_that_no_source_prints_is_called_unconfirmed(code: int, doubted: bool) -> None:
    (meaning,) = explain(f"format 0x{code:02X}")
    assert ("unconfirmed" in meaning.title) is doubted
    (chinese,) = explain(f"format 0x{code:02X}", "zh")
    assert ("未确认" in chinese.title) is doubted


RETURNED = {
    "consistent_data": ("SFC14", "SFC15", "sfc 14", "DPRD_DAT", "dpwr_dat"),
    "record_data": ("SFC58", "SFC59", "WR_REC", "rd_rec"),
}


@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize("kind", RETURNED)
def test_what_system_functions_return(kind: str, lang: str) -> None:
    table = tomllib.loads((resources.files("ds47.spec") / "explain.toml").read_text("utf-8"))
    codes = [code for row in table["number"] if row["kind"] == kind for code in row["codes"]]
    assert len(codes) > 10
    assert len(set(codes)) == len(codes)
    for code in codes:
        for word in RETURNED[kind]:
            signed = code - 0x10000 if code > 0x7FFF else code
            forms = (f"{code:04X}", f"16#{code:04X}", *([str(signed)] if code else ()))
            for text in (f"{word} {form}" for form in forms):
                meaning = next(each for each in explain(text, lang) if each.known)
                assert (meaning.kind, meaning.code) == (kind, f"0x{code:04X}"), text
        assert f"0x{code:04X} = {signed}" in meaning.title
        assert explain(meaning.name, lang)[0] == meaning
        assert meaning.look
        assert meaning.plc
        for text in (meaning.title, meaning.look, *(each.text for each in meaning.causes)):
            assert bool(CHINESE.search(text)) == (lang == "zh"), text
        assert bool(meaning.filter) == (kind == "record_data")


def test_what_a_system_function_does_not_return() -> None:
    (meaning, *_) = explain("SFC14 8123")
    assert not meaning.known
    assert "RET_VAL 0x8123" in meaning.title
    assert meaning.title.endswith("near: 80C0, 80C1, 80C2")
    kinds = [each.kind for each in explain("80B1")]
    assert kinds == ["status"] * 3 + ["consistent_data", "record_data"], "a bare word is both"


def test_lengths_of_ppo_are_told_where_the_length_is_wrong() -> None:
    (meaning,) = explain("SFC14 80B1")
    assert "8 bytes for PKW" in meaning.causes[0].text


# ----------------------------------------------------------------- parameters, faults, shifted bytes


@pytest.mark.parametrize(
    "text",
    ["p945", "P0945", "r0945[0]", "R945", "PNU 945", "pnu945", "p 945", "parameter 945", "PNU: 0945", "参数 945",
     "参数p945"],
)  # fmt: skip
def test_a_parameter_in_every_spelling(text: str) -> None:
    (meaning,) = explain(text)
    assert (meaning.kind, meaning.code, meaning.known) == ("parameter", "r0945", True)
    assert (
        meaning.title == "r0945 = 16#03B1: parameter: Fault code, Unsigned16[] (PROFIdrive profile)"
    )
    assert meaning.plugin_filter == "ds47.pnu == 945"
    assert explain(meaning.name) == [meaning]


@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_parameter_of_the_table(lang: str) -> None:
    rows = [(number, row) for number, all_ in spec.parameters().items() for row in all_.values()]
    for number, row in rows:
        (meaning,) = explain(f"parameter {number}", lang)
        assert (row.name_zh if lang == "zh" else row.name_en) in meaning.title
        assert row.type in meaning.title or row.type == "unknown"
        assert "unknown" not in meaning.title
        assert not row.unit or row.unit in meaning.title
        assert f"16#{number:04X}" in meaning.plc[0].note
        assert bool(CHINESE.search(meaning.title + meaning.look + meaning.plc[0].note)) == (
            lang == "zh"
        )


def test_a_parameter_that_no_table_has_is_not_made_up() -> None:
    (meaning,) = explain("P1999[0]")
    assert not meaning.known
    assert meaning.title == "p1999 = 16#07CF: parameter: not one that the tables know"
    assert 'ds47 encode "read axis 1 p1999.description[0]"' in str(meaning.advice)
    assert meaning.filter == "pn_io.profidrive.parameter.number == 1999"


def test_a_name_of_a_format_that_is_a_parameter_too_has_both() -> None:
    meanings = explain("R2")
    assert [each.kind for each in meanings] == ["parameter", "format"]
    assert meanings[1] == explain("format R2")[0]


@pytest.mark.parametrize("text", ["r0722.2", "R722.02", "p722[2]", "p 722.2"])
def test_a_bit_or_an_element_is_that_of_its_parameter(text: str) -> None:
    (meaning,) = explain(text)
    assert (
        meaning.title == "r0722 = 16#02D2: parameter: Digital inputs, state, Unsigned32 (SINAMICS)"
    )


@pytest.mark.parametrize(
    ("lang", "label", "text"),
    [("en", "Values", "1 = induction motor"), ("zh", "取值", "1 = 异步电机")],
)
def test_the_values_of_a_parameter_are_told(lang: str, label: str, text: str) -> None:
    meanings = explain("p300", lang)
    assert [(each.value, each.name) for each in meanings[0].parts][:2] == [("0", "="), ("1", "=")]
    printed = "\n".join(_lines(meanings, lang))
    assert label in printed
    assert text in printed


def test_a_parameter_of_two_families_is_told_of_both() -> None:
    (meaning,) = explain("p1082")
    both = "Maximum speed, Float32, rpm (SINAMICS) · Maximum frequency, Float32, Hz (MICROMASTER 4)"
    assert meaning.title == f"p1082 = 16#043A: parameter: {both}"


@pytest.mark.parametrize(
    ("text", "code"), [("922", "p0922"), ("1120", "p1120"), ("61000", "61000"), ("2900", "p2900")]
)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_number_without_a_letter_is_that_of_a_parameter_too(
    lang: str, text: str, code: str
) -> None:
    first, *others = explain(text, lang)
    assert (first.kind, first.code, first.known) == ("parameter", code, True)
    assert explain(first.name, lang) == [first]
    assert not any(each.known for each in others)


@pytest.mark.parametrize("text", ["45", "65535", "0922", "16#922", "922h", "status 922", "70000"])
def test_other_numbers_are_no_parameters(text: str) -> None:
    assert "parameter" not in {each.kind for each in explain(text)}


@pytest.mark.parametrize(
    ("text", "code", "kind", "number"),
    [
        ("F7900", "F07900", "fault", 7900),
        ("F07900", "F07900", "fault", 7900),
        ("f30002", "F30002", "fault", 30002),
        ("F0022", "F0022", "fault", 22),
        ("fault 7900", "F07900", "fault", 7900),
        ("fault code F07900", "F07900", "fault", 7900),
        ("故障 7900", "F07900", "fault", 7900),
        ("A07991", "A07991", "alarm", 7991),
        ("A0922", "A0922", "alarm", 922),
        ("alarm 7991", "A07991", "alarm", 7991),
    ],
)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_fault_is_no_status(lang: str, text: str, code: str, kind: str, number: int) -> None:
    (meaning,) = explain(text, lang)
    assert (meaning.kind, meaning.code, meaning.known) == (kind, code, True)
    assert f"{number} = 16#{number:04X}" in meaning.title
    assert code in str(meaning.advice)
    assert not meaning.causes, "no text of a fault is known, and none is made up"
    assert (
        meaning.filter == f"pn_io.profidrive.parameter.number == {945 if kind == 'fault' else 2122}"
    )
    assert bool(CHINESE.search(meaning.title + meaning.look)) == (lang == "zh")
    assert explain(meaning.name, lang) == [meaning]


@pytest.mark.parametrize(
    "text",
    ["F99999", "p65536", "p945[", "p945[0..1]", "fault A07991", "alarm F07900", "parameter x"],
)
def test_what_is_no_number_of_a_drive(text: str) -> None:
    try:
        kinds = {each.kind for each in explain(text)}
    except UnknownFormError:
        return
    assert kinds.isdisjoint({"parameter", "fault", "alarm"})


@pytest.mark.parametrize("text", ["F001", "F0", "A1", "status F7900", "16#F7900", "F7900h"])
def test_hexadecimal_that_looks_like_a_fault_stays_what_it_was(text: str) -> None:
    assert {each.kind for each in explain(text)}.isdisjoint({"fault", "alarm"})


@pytest.mark.parametrize(
    ("text", "code"), [("80DE80B5", "DE80B500"), ("00DF80B7", "DF80B700"), ("80C080C3", "C080C300")]
)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_status_with_a_byte_in_front(lang: str, text: str, code: str) -> None:
    (meaning,) = explain(text, lang)
    (inner,) = explain(code, lang)
    assert meaning.known
    assert meaning.title.startswith(text)
    assert code in meaning.title
    assert (meaning.causes, meaning.filter, meaning.plc) == (inner.causes, inner.filter, inner.plc)


def test_a_status_without_its_first_byte() -> None:
    meanings = explain("80B50000")
    assert [each.code for each in meanings if each.known] == ["DE80B500", "DF80B500"]
    assert not meanings[-1].known


@pytest.mark.parametrize("text", ["12345678", "80DE0000", "80000000", "DEADBEEF", "B580DE00"])
def test_bytes_that_are_no_status_however_they_are_turned(text: str) -> None:
    assert [each.known for each in explain(text)] == [False]


@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize("code", ["error 0x09", "error 0x0F", "error 0x16"])
def test_drives_without_descriptions_and_texts_are_named(code: str, lang: str) -> None:
    (meaning,) = explain(code, lang, find_vendor("SINAMICS"))
    told = [
        each
        for each in meaning.causes
        if "SINAMICS DCM" in each.text and "MICROMASTER 4" in each.text
    ]
    assert [each.basis for each in told] == ["documented"]


@pytest.mark.parametrize("lang", LANGUAGES)
def test_0x18_may_be_the_length_of_the_record(lang: str) -> None:
    (meaning,) = explain("error 0x18", lang)
    assert len(meaning.causes) == 3
    assert "LEN" in meaning.causes[1].text
    assert ("pad byte" if lang == "en" else "填充字节") in meaning.causes[2].text
    assert "4 + 6 x" in meaning.look


@pytest.mark.parametrize(
    ("code", "source", "value"),
    [("p0840", "r0722.2", 0x02D2FC02), ("p1070", "r2050[1]", 0x0802FC01)],
)
def test_a_connection_says_how_its_value_is_read(code, source, value):
    """The example is one that a report would word so."""
    (parts,) = [each.parts for each in explain(code) if each.parts]
    assert (parts[1].value, parts[1].text) == (f"for example 16#{value:08X}", source)
    row = spec.parameter(int(code[1:]), "sinamics")
    item = Parameter(row.number, 0, "value", 1, row, values=[value], format="Unsigned32")
    assert source in values.meaning(item).en
    (parts,) = [each.parts for each in explain(code, "zh") if each.parts]
    assert parts[1].value.startswith("例如")


@pytest.mark.parametrize(
    ("code", "text", "also"),
    [
        ("8104", "function is not supported, or not now", "status"),
        ("8500", "PDU has a wrong length", "status"),
        ("8304", "no resources for one more job of this kind at the same time", "status"),
        ("33028", "function is not supported, or not now", "status"),
        ("-32508", "function is not supported, or not now", "status"),
        ("D241", "not permitted at this protection level", None),
        ("53825", "not permitted at this protection level", None),
        ("D201", "class D2, block or file", None),
        ("s7 8100", "class 81, application relation", None),
        ("s7 33028", "function is not supported, or not now", None),
        ("s7 272", "invalid block number", None),
        ("s7 8702", "service is not supported by the module", None),
    ],
)
def test_error_words_of_s7(code: str, text: str, also: str | None) -> None:
    first, *others = explain(code)
    assert (first.kind, first.known) == ("s7_error", True)
    assert first.title.endswith(f"error word of S7 communication: {text}")
    assert [each.kind for each in others if each.known] == ([also] if also else [])
    assert first.filter is not None
    assert first.filter.startswith("s7comm.param.errcod == 0x")


def test_a_class_of_s7_stands_behind_the_status_that_a_word_may_be() -> None:
    status, of_class = explain("8100")
    assert (status.kind, status.known) == ("status", True)
    assert of_class.title.endswith("communication: class 81, application relation")
    assert explain(of_class.name) == [of_class]


@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize(
    ("code", "other"), [("8104", True), ("81FF", True), ("D241", False), ("D801", False)]
)
def test_an_error_word_of_s7_speaks_of_itself(code: str, other: bool, lang: str) -> None:
    (meaning,) = explain(f"s7 {code}", lang)
    pair = f"{code[:2]}, {code[2:]}" if lang == "en" else f"{code[:2]}、{code[2:]}"
    assert pair in meaning.plc[0].note
    assert (("other meaning" if lang == "en" else "另一种含义") in meaning.look) is other
    assert len(explain(code, lang)) == 1 + other


@pytest.mark.parametrize("lang", LANGUAGES)
def test_return_codes_of_items_of_s7(lang: str) -> None:
    for code, row in s7.codes("return_code").items():
        for text in (f"s7 {code:02X}", f"s7 0x{code:02x}", f"s7 {code}"):
            found = [each for each in explain(text, lang) if each.code == f"0x{code:02X}"]
            assert [(each.kind, each.known) for each in found] == [("s7_item", True)], text
            assert found[0].title.endswith(row.text(lang))
            assert found[0].filter == f"s7comm.data.returncode == 0x{code:02x}"
        if code:  # as `decode --as s7` prints it, behind what the same byte is for a drive
            bare = [each.kind for each in explain(f"0x{code:02X}", lang) if each.known]
            assert bare[-1] == "s7_item", code
            assert len(bare) > 1 or code not in (0x03, 0x05, 0x0A), code


@pytest.mark.parametrize(("lang", "other"), [("en", "tables"), ("zh", "表中")])
def test_an_error_word_of_s7_that_no_table_has_is_named_one(lang: str, other: str) -> None:
    """`decode --as s7` prints such a word; it may be another one, too, so that comes first."""
    for code, first in (("D6FF", "stw1"), ("EF01", "word")):
        unknown, *_, meaning = explain(code, lang)
        assert (unknown.kind, meaning.kind, meaning.known) == (first, "s7_error", False)
        assert "S7" in meaning.title
        assert code[:2] in meaning.title.rpartition(other)[2]
    assert [each.kind for each in explain("D201", lang)] == ["s7_error"]
    assert "s7_error" not in {each.kind for each in explain("80B5", lang)}


@pytest.mark.parametrize("code", ["272", "449", "0x00D2", "s7 9901", "s7 0B", "7123"])
def test_what_s7_does_not_say(code: str) -> None:
    assert not [each for each in explain(code) if each.known and each.kind.startswith("s7")]


def test_what_decode_prints_of_s7_can_be_looked_up(capsys: pytest.CaptureFixture[str]) -> None:
    """Of each class a word that no table has, and each word that one has; return codes of items."""
    classes = [code << 8 | 0xEE for code in s7.codes("error_class") if code]
    for code in (*classes, *s7.codes("error")):
        assert main(["decode", "--as", "s7", f"32020000000000000000{code:04x}"]) == 0
        (told,) = re.findall(r"error: (.*) \((\w{4})\)", capsys.readouterr().out)
        assert any(each.title.endswith(told[0]) for each in explain(told[1])), told
        assert explain(f"s7 {told[1]}")[0].title.endswith(told[0])
    for code in set(s7.codes("return_code")) - {0xFF}:
        assert main(["decode", "--as", "s7", f"3203000000000002000500000401{code:02x}000000"]) == 0
        (told,) = re.findall(r"(0x\w\w) (.*)", capsys.readouterr().out)
        assert explain(f"s7 {told[0]}")[0].title.endswith(told[1])


def test_the_help_names_every_word_in_front(capsys):
    table = tomllib.loads((resources.files("ds47.spec") / "explain.toml").read_text("utf-8"))
    assert main(["explain", "-h"]) == 0
    said = re.split(r"[\s,:.]+", capsys.readouterr().out)
    assert {row["say"] for row in table["kind"]} - {"rule"} <= set(said)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_line_about_forms_is_short(lang: str) -> None:
    assert len(explanations.forms(lang)) + len("ds47: error: unknown code 'xyz'. ") <= 140
