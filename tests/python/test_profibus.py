"""Frames of PROFIBUS in both implementations: FDL, what DP says in them, records by MS1 (docs/profibus.md).

What is expected is typed from printed telegrams, or stands in the vectors of the reference; Lua has to say what
Python says, for each of them and for bytes by chance. The command is in test_profibus_command.
"""

from __future__ import annotations

import json
import random
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lua_program import LUAS, lua_program

from ds47.cyclic import pzd
from ds47.profibus import dp, ms1, telegram
from ds47.report import profibus as shown
from ds47.report.bilingual import LANGUAGES
from ds47.spec import profibus as spec

ROOT = Path(__file__).resolve().parents[2]
DRIVER = ROOT / "tests/lua/profibus.lua"

STATUS = "100302494e16"
READ = "6809096883827d33335e002ff06516"
NOT_READY = "680909688283083333de80b5008616"
CHECK_PPO1 = "6807076883827d3e3ef3f1e216"
SET_PRM = "680f0f6883825d3d3e881e010080b501000000ba16"
DIAGNOSIS = "a28283083e3c000400ff80b5bf16"
OUTPUTS = "680f0f6803027d12bc000000000000047e33333816"
INPUTS = "680f0f6802030812bc000000000002fb3100000916"
TOKEN, SHORT = "dc0202", "e5"
WHOLE = (STATUS, READ, NOT_READY, CHECK_PPO1, SET_PRM, DIAGNOSIS, OUTPUTS, INPUTS)
"""Frames with a check byte."""


def frame(text: str) -> telegram.Telegram:
    return telegram.decode(bytes.fromhex(text))


def wrong(item: telegram.Telegram) -> list[str]:
    """What is wrong with a frame, in words."""
    return [spec.flaw_text(each.kind, each.args) for each in item.flaws]


def request(
    sap: int, du: str, fc: int = 0x7D, station: int = 3, ssap: int = 62
) -> telegram.Telegram:
    """A request of master 2 to a SAP."""
    return telegram.decode(telegram.encode(station, 2, fc, bytes.fromhex(du), sap, ssap))


def answer(sap: int, du: str, fc: int = 0x08, dsap: int = 62) -> telegram.Telegram:
    """An answer of station 3 to master 2."""
    return telegram.decode(telegram.encode(2, 3, fc, bytes.fromhex(du), dsap, sap))


# Frames


@pytest.mark.parametrize(
    ("text", "kind", "da", "sa", "function", "saps", "du"),
    [
        (STATUS, "SD1", 3, 2, "FDL status request", (None, None), ""),
        ("100203000516", "SD1", 2, 3, "OK, slave", (None, None), ""),
        ("6805056883826d3c3eec16", "SD2", 3, 2, "SRD high, first FCB", (60, 62), ""),
        (SET_PRM, "SD2", 3, 2, "SRD high, FCB 0", (61, 62), "881e010080b501000000"),
        (DIAGNOSIS, "SD3", 2, 3, "data, low priority (DL), slave", (62, 60), "000400ff80b5"),
        (READ, "SD2", 3, 2, "SRD high, FCB 1", (51, 51), "5e002ff0"),
        ("6803036802030a0f16", "SD2", 2, 3, "data, high priority (DH), slave", (None, None), ""),
    ],
)  # fmt: skip
def test_a_frame(
    text: str, kind: str, da: int, sa: int, function: str, saps: tuple[int | None, ...], du: str
) -> None:
    item = frame(text)
    assert (item.kind, item.da, item.sa, item.flaws) == (kind, da, sa, ())
    assert item.fc is not None
    assert spec.control_text(item.fc) == function
    assert (item.dsap, item.ssap) == saps
    assert item.du.hex() == du


def test_a_token_and_a_short_acknowledgement() -> None:
    item = frame(SHORT)
    assert (item.kind, item.data, item.da, item.fc, item.flaws) == ("SC", b"\xe5", None, None, ())
    item = frame("dc0502")
    assert (item.kind, item.da, item.sa, item.fc, item.flaws) == ("SD4", 5, 2, None, ())


def test_the_frame_count_bit() -> None:
    counts = [
        (item.front.fcb, item.front.fcv)
        for item in (request(60, "", fc) for fc in (0x6D, 0x5D, 0x7D))
    ]
    assert counts == [(1, 0), (0, 1), (1, 1)]
    item = frame(INPUTS)
    assert (item.request, item.front.fcb, item.front.fcv) == (False, None, None)
    assert (item.sa, item.ssap, item.da, item.dsap) == (3, None, 2, None)


def test_an_extension_names_a_segment_before_the_sap() -> None:
    content = bytes.fromhex("83827d") + bytes((0xC1, 0x33)) + b"\x33" + bytes.fromhex("5e002ff0")
    size = len(content)
    data = bytes((0x68, size, size, 0x68)) + content + bytes((telegram.check_byte(content), 0x16))
    item = telegram.decode(data)
    assert (item.dsap, item.ssap, item.front.dae.hex(), item.flaws) == (51, 51, "c133", ())


@pytest.mark.parametrize(
    ("text", "complaints"),
    [
        ("6809096883827d33335e002ff06416", ["check byte is 64, and the bytes give 65"]),
        ("68090a6883827d33335e002ff06516", ["length bytes differ: 9 and 10"]),
        ("6809096883827d33335e002ff065", ["cut off: 14 of 15 bytes"]),
        ("6809096783827d33335e002ff06516", ["the start byte comes again as 67, not 68"]),
        ("6809096883827d33335e002ff06517", ["end byte is 17, not 16"]),
        ("68020268aa16", ["length byte 2; it goes from 3 to 249"]),
        ("68fafa68", ["length byte 250; it goes from 3 to 249"]),
        ("6809", ["cut off: 2 of 4 bytes"]),
        ("10030249", ["cut off: 4 of 6 bytes"]),
        ("dc02", ["cut off: 2 of 3 bytes"]),
        ("", ["cut off: 0 of 1 bytes"]),
        ("00", ["no frame begins with 00"]),
        ("e5e5", ["1 bytes behind the end of the frame"]),
        ("dcff02", ["no station has the address 255"]),
        ("10037f49cb16", ["no station has the address 127"]),
        ("100302c9ce16", ["bit 7 of the function code C9 is set"]),
        ("10830249ce16", ["an address extension is announced and not there"]),
        ("68040468830249b38116", ["an address extension is announced and not there"]),
    ],
)
def test_what_is_wrong_with_a_frame(text: str, complaints: list[str]) -> None:
    assert wrong(frame(text)) == complaints


@given(
    st.integers(0, 127), st.integers(0, 126), st.integers(0, 127), st.binary(max_size=244),
    st.none() | st.integers(0, 63), st.none() | st.integers(0, 63),
)  # fmt: skip
def test_what_is_encoded_is_decoded_again(
    da: int, sa: int, fc: int, du: bytes, dsap: int | None, ssap: int | None
) -> None:
    item = telegram.decode(telegram.encode(da, sa, fc, du, dsap, ssap))
    assert (item.da, item.sa, item.fc, item.du, item.dsap, item.ssap) == (
        da,
        sa,
        fc,
        du,
        dsap,
        ssap,
    )
    assert item.flaws == ()


@pytest.mark.parametrize(
    "arguments", [(128, 2, 0x49), (3, 127, 0x49), (3, 2, 0x80), (3, 2, 0x7D, b"", 64), (3, 2, 0x7D, bytes(247))]
)  # fmt: skip
def test_what_no_frame_can_say_is_refused(arguments: tuple[Any, ...]) -> None:
    with pytest.raises(ValueError, match=r"no frame goes|SAPs go|do not fit"):
        telegram.encode(*arguments)


@pytest.mark.parametrize("text", WHOLE)
def test_every_change_of_a_byte_is_noticed(text: str) -> None:
    data = bytes.fromhex(text)
    for at in range(len(data)):
        for byte in range(256):
            if byte != data[at]:
                assert telegram.decode(data[:at] + bytes((byte,)) + data[at + 1 :]).flaws, (
                    at,
                    byte,
                )


@given(st.binary(max_size=40) | st.sampled_from([b"\x68\x09\x09\x68", b"\x10", b"\xa2"]).flatmap(
    lambda start: st.binary(max_size=20).map(start.__add__)))  # fmt: skip
def test_any_bytes_are_decoded(data: bytes) -> None:
    item = telegram.decode(data)
    assert item.data == data
    json.dumps(shown.document(item))
    for text in [each for _, each in shown.lines(item)] + list(shown.beside(item)):
        assert text.en
        assert text.zh


@given(st.binary(max_size=30), st.booleans())
def test_any_data_is_decoded(data: bytes, asked: bool) -> None:
    ms1.decode(data, asked)
    sap = 60 if not asked else 61
    for other in (sap, 62, 59, 58, 51):
        item = request(other, data.hex()) if asked else answer(other, data.hex())
        json.dumps(shown.document(item))
        assert all(text.en for _, text in shown.lines(item))


# DP


@pytest.mark.parametrize(
    ("item", "service"),
    [
        (request(60, ""), "diagnosis"),
        (answer(60, ""), "diagnosis"),
        (request(58, "0000", 0x46, 127), "control"),
        (request(51, "", ssap=51), "record"),
        (answer(51, "", dsap=51), "record"),
        (request(50, "", ssap=51), "alarm"),
        (request(49, "57", ssap=50), "resource"),
        (request(12, "5e002ff0", ssap=50), "ms2"),
        (answer(48, "48", dsap=50), "ms2"),
        (request(62, "", ssap=54), None),
        (frame(OUTPUTS), "exchange"),
        (frame(INPUTS), "exchange"),
        (frame(STATUS), None),
        (frame("100203000516"), None),
        (frame(TOKEN), None),
    ],
)
def test_the_service_of_a_frame(item: telegram.Telegram, service: str | None) -> None:
    assert dp.service(item) == service
    if service is not None:
        assert spec.service_text(service)
        assert spec.service_text(service, "zh")


def test_a_diagnosis() -> None:
    found = dp.decode(frame(DIAGNOSIS))
    assert found == dp.SlaveDiagnosis((), None, 0x80B5, (), ())
    found = dp.decode(
        answer(60, "440d0002 80b5 08 81000000000000 4403 a00207 c1 05aa".replace(" ", ""))
    )
    assert isinstance(found, dp.SlaveDiagnosis)
    assert found.flags == ("cfg_fault", "prm_fault", "prm_req", "watchdog")
    assert (found.master, found.ident) == (2, 0x80B5)
    kinds = [(each.kind, each.data.hex()) for each in found.blocks]
    assert kinds == [(0, "0881000000000000"), (1, "4403a002"), (0, "07c105aa")]
    assert [each.kind for each in found.flaws] == ["data"]


def test_blocks_of_a_channel_and_a_revision() -> None:
    found = dp.decode(answer(60, "080c00028 0b5 810203 c7".replace(" ", "")))
    assert isinstance(found, dp.SlaveDiagnosis)
    assert [(each.kind, each.data.hex()) for each in found.blocks] == [(2, "810203"), (3, "c7")]
    assert (found.flags, found.flaws) == (("ext_diag", "watchdog"), ())


@pytest.mark.parametrize(
    ("du", "flags", "watchdog"),
    [
        ("881e010080b501000000", ("watchdog", "lock"), 300),
        ("801e010080b501", ("lock",), None),
        ("b80a0a0b80b500840000", ("watchdog", "freeze", "sync", "lock", "watchdog_base_1ms", "dpv1"), 100),
        ("b80a0a0b80b500040000", ("watchdog", "freeze", "sync", "lock", "watchdog_base_1ms"), 1000),
    ],
)  # fmt: skip
def test_parameters(du: str, flags: tuple[str, ...], watchdog: int | None) -> None:
    found = dp.decode(request(61, du))
    assert isinstance(found, dp.Parameters)
    assert (found.flags, found.watchdog_ms, found.ident) == (flags, watchdog, 0x80B5)
    assert found.user == bytes.fromhex(du)[7:]


@pytest.mark.parametrize(
    ("du", "ppo", "consistent", "modules"),
    [
        ("f3f1", 1, True, ["4 words in+out, consistent over whole length (PKW)",
                           "2 words in+out, consistent over whole length (PZD)"]),
        ("f371", 1, True, ["4 words in+out, consistent over whole length (PKW)",
                           "2 words in+out, consistent piece by piece (PZD)"]),
        ("73f1", 1, False, ["4 words in+out, consistent piece by piece (PKW)",
                            "2 words in+out, consistent over whole length (PZD)"]),
        ("b7b3", 1, True, ["8 bytes in+out, consistent over whole length (PKW)",
                           "4 bytes in+out, consistent over whole length (PZD)"]),
        ("f3f5", 2, True, ["4 words in+out, consistent over whole length (PKW)",
                           "6 words in+out, consistent over whole length (PZD)"]),
        ("00f1", 3, None, ["empty slot", "2 words in+out, consistent over whole length (PZD)"]),
        ("f5", 4, None, ["6 words in+out, consistent over whole length (PZD)"]),
        ("f3f9", 5, True, ["4 words in+out, consistent over whole length (PKW)",
                           "10 words in+out, consistent over whole length (PZD)"]),
        ("d0e1", None, None, ["1 word in, consistent over whole length",
                              "2 words out, consistent over whole length"]),
        ("c1c3c1aa c0 41 41 ".replace(" ", ""), None, None,
         ["4 words out, consistent over whole length; 2 words in, consistent over whole length,"
          " 1 byte of the maker", "2 words in+out, consistent piece by piece"]),
        ("4fc1", None, None, ["2 words in, consistent over whole length"]),
        ("0201ff10", None, None, ["empty slot, 2 bytes of the maker", "1 byte in, consistent piece by piece"]),
    ],
)  # fmt: skip
def test_a_configuration(
    du: str, ppo: int | None, consistent: bool | None, modules: list[str]
) -> None:
    found = dp.decode(request(62, du))
    assert isinstance(found, dp.Configuration)
    assert (found.ppo, found.pkw_consistent, found.flaws) == (ppo, consistent, ())
    pairs = zip(found.modules, found.roles, strict=True)
    assert [shown.module_text(*each).en for each in pairs] == modules
    assert dp.decode(answer(59, du)) == found


def test_a_special_identifier_that_is_cut() -> None:
    found = dp.configuration(bytes.fromhex("f1c3"))
    assert [each.kind for each in found.flaws] == ["data"]
    assert (found.ppo, found.input_length, found.output_length) == (3, 4, 4)


def test_global_control() -> None:
    found = dp.decode(request(58, "2a04", 0x46, 127))
    assert found == dp.Control(("clear", "freeze", "sync"), 4, ())


def test_data_exchange_and_its_wish_for_a_diagnosis() -> None:
    assert dp.decode(frame(OUTPUTS)) == dp.DataExchange(
        True, bytes.fromhex("12bc000000000000047e3333"), False
    )
    found = dp.decode(telegram.decode(telegram.encode(2, 3, 0x0A, b"1234")))
    assert found == dp.DataExchange(False, b"1234", True)


# MS1


@pytest.mark.parametrize(
    ("du", "asked", "kind", "function", "head", "data"),
    [
        (
            "5f002f0a030102011001c47f0000",
            True,
            "request",
            "DS_Write",
            (0, 47, 10),
            "030102011001c47f0000",
        ),
        ("5f002f0a", False, "answer", "DS_Write positive", (0, 47, 10), ""),
        ("5e012ff0", True, "request", "DS_Read", (1, 47, 240), ""),
        ("5e002f0401020102", False, "answer", "DS_Read positive", (0, 47, 4), "01020102"),
        ("de80b500", False, "refusal", "DS_Read negative", (None, None, None), ""),
        ("df80b200", False, "refusal", "DS_Write negative", (None, None, None), ""),
        ("", True, "poll", None, (None, None, None), ""),
        ("", False, "taken", None, (None, None, None), ""),
        ("48", True, "request", "idle", (None, None, None), ""),
        ("d7800000", False, "refusal", "initiate negative", (None, None, None), ""),
        ("99", False, "answer", "unknown 0x99", (None, None, None), ""),
    ],
)
def test_a_record(
    du: str, asked: bool, kind: str, function: str | None, head: tuple[int | None, ...], data: str
) -> None:
    found = ms1.decode(bytes.fromhex(du), asked)
    assert (found.kind, found.flaws, found.data.hex()) == (kind, (), data)
    assert (found.slot, found.index, found.length) == head
    assert (None if found.code is None else spec.function_text(found.code, asked)) == function


def test_a_refusal_is_a_status_as_profinet_has_it() -> None:
    found = ms1.decode(bytes.fromhex("de80b500"), False)
    assert (found.status, found.not_ready, found.function) == (0xDE80B500, True, "read")
    assert not ms1.decode(bytes.fromhex("df80b500"), False).not_ready
    assert not ms1.decode(bytes.fromhex("de80b000"), False).not_ready
    assert ms1.decode(bytes.fromhex("de80"), False).status is None


@pytest.mark.parametrize(
    ("du", "asked", "kind", "data"),
    [
        ("5f002f140301020110", True, "record_length", "0301020110"),
        ("5e002f040102010203", False, "record_length", "01020102"),
        ("5e002f", True, "data", ""),
        ("5e002ff001", True, "more", "01"),
        ("5f002f0a00", False, "more", "00"),
        ("de80b5", False, "data", ""),
        ("de80b50000", False, "more", "00"),
    ],
)
def test_a_length_that_is_not_so(du: str, asked: bool, kind: str, data: str) -> None:
    found = ms1.decode(bytes.fromhex(du), asked)
    assert [each.kind for each in found.flaws] == [kind]
    assert found.data.hex() == data


# The vectors of the reference

MEANINGS = {
    "poll: SRD without data": ("poll", None, False),
    "state conflict: answer not ready, ask again": ("refusal", "state conflict", True),
    "invalid index": ("refusal", "invalid index", False),
    "invalid slot": ("refusal", "invalid slot", False),
}
"""What the vectors say of a message: its kind, words of its status, whether it is to be asked for again."""


def test_the_vectors_of_the_reference(shared: Path) -> None:
    known = json.loads((shared / "reference" / "channel_vectors.json").read_text("utf-8"))
    vectors = [each for each in known["vectors"] if each.get("row") == 18]
    for vector in vectors:
        if vector["channel"] == "ppo1":
            assert_ppo1(vector)
        else:
            assert_vector(vector)
    assert len(vectors) == 42


def assert_vector(vector: dict[str, Any]) -> None:
    """One frame says what its vector says."""
    item, expected = frame(vector["hex"]), dict(vector["expect"])
    if error := expected.pop("error", None):
        assert wrong(item)[0].startswith(error), vector["id"]
        return
    assert item.flaws == (), vector["id"]
    assert expected.pop("le", len(item.data) - 6) == len(item.data) - 6
    told = shown.document(item)
    record, said = told["ms1"] or {}, told["dp"] or {}
    for key, value in told.items():
        if key in expected and not record.get(key):
            assert expected.pop(key) == value, (vector["id"], key)
    for key in (
        "slot",
        "index",
        "length",
        "error_decode",
        "error_code_1",
        "error_code_2",
        "function",
    ):
        if key in expected:
            assert expected.pop(key) == record[key], (vector["id"], key)
    if "ds47" in expected:
        assert expected.pop("ds47") == record["data"]
    if "ident" in expected:
        assert expected.pop("ident") == said["ident"]
    if "pkw" in expected:
        data = said["outputs" if item.request else "inputs"]
        assert expected.pop("pkw") + expected.pop("pzd") == data
    if "modules" in expected:
        found = dp.decode(item)
        assert isinstance(found, dp.Configuration)
        pairs = zip(found.modules, found.roles, strict=True)
        assert expected.pop("modules") == [shown.module_text(*each).en for each in pairs]
    if meaning := expected.pop("meaning", None):
        assert_meaning(item, record, meaning)
    assert expected == {}, vector["id"]


def assert_meaning(item: telegram.Telegram, record: dict[str, Any], meaning: str) -> None:
    if item.kind == telegram.SC:
        assert meaning == "taken, answer later"
        return
    kind, words, again = MEANINGS[meaning]
    assert (record["kind"], record["not_ready"]) == (kind, again)
    assert words is None or words in record["status"]


def assert_ppo1(vector: dict[str, Any]) -> None:
    """Images of PPO1 travel as data exchange, and their words are those of the cyclic room."""
    expected = vector["expect"]
    for step in vector["steps"]:
        for side, fc in (("out", 0x7D), ("in", 0x08)):
            if step[side] is not None:
                data = bytes.fromhex(step[side])
                found = dp.decode(telegram.decode(telegram.encode(3, 2, fc, data)))
                assert found == dp.DataExchange(side == "out", data, False)
    first = vector["steps"][0]
    words = {
        "stw1": (first["out"] or "")[16:20],
        "zsw": first["in"][16:20],
        "hsw_raw": int((first["out"] or "0")[20:24] or "0", 16),
        "hiw_raw": int(first["in"][20:24], 16),
        "hiw_percent": pzd.percent(int(first["in"][20:24], 16)),
    }
    for key in expected.keys() & words.keys():
        assert expected[key] == words[key], (vector["id"], key)
    assert any(expected.get("zsw1", "") in (step["in"] or "") for step in vector["steps"])


# Lua says the same


def with_chinese(told: Any) -> Any:
    """A document of which every flaw has its words in Chinese as well."""
    if isinstance(told, list):
        return [with_chinese(each) for each in told]
    return (
        {key: with_chinese(each) for key, each in told.items()} if isinstance(told, dict) else told
    )


def python_says(data: bytes) -> dict[str, Any]:
    item = telegram.decode(data)
    told: dict[str, Any] = shown.document(item)
    record, content = shown.record(item), dp.decode(item)
    for found, place in ((item, told), (record, told["ms1"]), (content, told["dp"])):
        for flaw, document in zip(
            found.flaws if found else (), place["flaws"] if place else (), strict=True
        ):
            document["zh"] = spec.flaw_text(flaw.kind, flaw.args, "zh")
    return told


def asked(shared_vectors: list[str]) -> Iterator[bytes]:
    """Frames that were printed, frames by chance, and damaged ones."""
    known = [bytes.fromhex(each) for each in (*WHOLE, TOKEN, SHORT, "", *shared_vectors)]
    yield from known
    chance = random.Random(18)
    for _ in range(3000):
        du = chance.randbytes(chance.choice((0, 0, 1, 2, 4, 6, 8, 12, 30)))
        saps: tuple[int | None, int | None] = chance.choice(
            (
                (None, None),
                (60, 62),
                (61, 62),
                (62, 62),
                (58, 62),
                (51, 51),
                (62, 60),
                (62, 59),
                (7, 50),
            )
        )
        fc = chance.choice((0x5D, 0x7D, 0x6D, 0x46, 0x49, 0x08, 0x0A, 0x03, chance.randrange(128)))
        if saps[1] in (50, 51) and chance.random() < 0.8:
            head = chance.choice((0x5E, 0x5F, 0xDE, 0xDF, 0x48, 0xD7))
            du = bytes((head, 0, 47, max(len(du) - chance.choice((0, 0, 1)), 0))) + du
        data = bytearray(
            telegram.encode(chance.randrange(128), chance.randrange(127), fc, du, *saps)
        )
        if chance.random() < 0.3:
            data[chance.randrange(len(data))] = chance.randrange(256)
        yield bytes(
            data[
                : chance.choice((len(data), len(data), len(data), chance.randrange(len(data) + 1)))
            ]
        )
    for _ in range(1000):
        yield chance.choice(
            (b"", b"\x68\x05\x05\x68", b"\x10", b"\xa2", b"\xdc")
        ) + chance.randbytes(chance.randrange(20))


@pytest.mark.slow
@pytest.mark.parametrize("lua", LUAS)
def test_lua_says_the_same(lua: str) -> None:
    file = ROOT.parent / "shared" / "reference" / "channel_vectors.json"
    vectors = json.loads(file.read_text("utf-8"))["vectors"] if file.exists() else []
    frames = list(asked([each["hex"] for each in vectors if each["channel"] == "profibus"]))
    result = subprocess.run(
        [lua_program(lua), str(DRIVER)],
        input="".join(f"{each.hex()}\n" for each in frames).encode(), capture_output=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr.decode()
    for data, line in zip(frames, result.stdout.decode().splitlines(), strict=True):
        told = json.loads(line)
        assert all(told.pop(lang) for lang in LANGUAGES)
        assert told == python_says(data), data.hex()
