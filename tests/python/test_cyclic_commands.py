"""The words of cyclic frames on the command line: `decode --as`, `encode pkw`, `explain stw1` and `zsw1`."""

from __future__ import annotations

import json

import pytest

from ds47.cli import main

Capture = pytest.CaptureFixture[str]


def run(capsys: Capture, *arguments: str) -> tuple[int, str, str]:
    status = main(list(arguments))
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_a_request_in_words(capsys: Capture) -> None:
    status, out, err = run(capsys, "decode", "--as", "pkw", "343A 0000 4220 0000")
    assert (status, err) == (0, "")
    assert out == (
        "PKW request, 8 bytes\n"
        "     0  34 3a                    PKE: AK 3 write double word, SPM 0\n"
        "     2  00 00                    IND: p1082[0], page 16#00, layout cyclic\n"
        "     4  42 20 00 00              PWE: 40.0 (16#4220_0000)\n"
    )


def test_a_refusal_in_chinese(capsys: Capture) -> None:
    _, out, _ = run(capsys, "decode", "--as", "pkw-answer", "743a000000000011", "--lang", "zh")
    assert "PWE：错误号 17：当前运行状态下不能执行（16#0000_0011）" in out


@pytest.mark.parametrize(
    ("vendor", "words"),
    [
        ((), "Manufacturer-specific error 104"),
        (("--vendor", "sinamics"), "Illegal value for this request"),
        (("--vendor", "0x01BA"), "Manufacturer-specific error 104: see the manual of Vacon, vendor 0x01BA"),
    ],
)  # fmt: skip
def test_error_numbers_of_pkw_have_the_words_of_their_maker(
    vendor: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ("decode", "--as", "pkw-answer", *vendor, "7023000000000068")
    assert f"error number 104: {words} (16#0000_0068)\n" in run(capsys, *asked)[1]
    document = json.loads(run(capsys, *asked, "-f", "json")[1])
    assert document["error"] == {"code": 104, "text": words}


def test_the_names_that_are_offered_are_taken(capsys: Capture) -> None:
    status, _, err = run(
        capsys, "decode", "--as", "pkw-answer", "--vendor", "nobody", "7023000000000068"
    )
    assert status == 2
    names = err.split("of their own: ")[1].partition(". Try: ")[0].split(", ")
    assert "SINAMICS" in names
    for name in names:
        asked = ("decode", "--as", "pkw-answer", "--vendor", name, "7023000000000068")
        assert run(capsys, *asked)[0] == 0, name


def test_an_answer_as_json(capsys: Capture) -> None:
    _, out, _ = run(capsys, "decode", "--as", "pkw-answer", "-f", "json", "743a000000000005")
    assert json.loads(out) == {
        "ak": 7, "meaning": "cannot be executed (error number)", "spm": 0, "pnu": 1082, "subindex": 0,
        "layout": "cyclic", "pwe1": 0, "pwe2": 5, "value": None, "connector": None,
        "error": {"code": 5, "text": "Wrong data type"},
    }  # fmt: skip


def test_the_other_layout(capsys: Capture) -> None:
    _, out, _ = run(capsys, "decode", "--as", "pkw", "--pkw-layout", "uss", "100a800100000000")
    assert "IND: p2010[1], page 16#80, layout uss" in out
    _, out, _ = run(capsys, "decode", "--as", "pkw", "1731900200000000")
    assert "page 16#02 does not exist in layout cyclic; --pkw-layout for the other" in out


def test_a_control_word_and_its_setpoint(capsys: Capture) -> None:
    _, out, _ = run(capsys, "decode", "--as", "stw1", "047E3333")
    lines = out.splitlines()
    assert lines[1] == "     0  04 7e                    STW1 16#047E = 1150"
    assert lines[2].endswith("setpoint 79.9988 % of p2000 (16#3333 = 13107)")
    assert "  bit  0 = 0  OFF1: ramp down, then switch off" in lines
    assert lines[-1] == "missing to run: ON (bit 0, as an edge)"


def test_a_whole_ppo1(capsys: Capture) -> None:
    _, out, _ = run(capsys, "decode", "--as", "ppo1-in", "-f", "json", "243a000042200000fb31e000")
    document = json.loads(out)
    assert document["pkw"]["value"] == 40.0
    assert document["pzd"]["state"] == "S2"
    assert document["pzd"]["signed"] == -1231
    assert document["pzd"]["actual_percent"] == -50.0
    assert [each["bit"] for each in document["pzd"]["bits"] if each["value"]] == [
        0, 4, 5, 8, 9, 11, 12, 13, 14, 15,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("decode", "--as", "pkw", "12bc"), "--as pkw takes 8 bytes, and here are 2"),
        (("decode", "--as", "zsw1", "fb31fb"), "--as zsw1 takes 2 or 4 bytes, and here are 3"),
        (("decode", "--as", "pkw", "--request", "00", "00"), "it does not go with --as pkw"),
        (("encode", "pkw", "read", "p1[0..3]"), "PKW carries one value"),
        (("encode", "--eeprom", "pkw", "read", "p1"), "only a change goes to the EEPROM"),
        (("encode", "--eeprom", "read", "p1"), "--eeprom is for a change by PKW"),
        (("explain", "stw1", "ON"), "unknown code 'stw1 ON'"),
    ],
)
def test_wrong_use_is_one_line(capsys: Capture, arguments: tuple[str, ...], complaint: str) -> None:
    status, out, err = run(capsys, *arguments)
    assert (status, out) == (2, "")
    assert complaint in err.splitlines()[-1]


def test_a_request_is_encoded(capsys: Capture) -> None:
    assert run(capsys, "encode", "pkw change p1082=Float32:40.0") == (
        0,
        "34 3a 00 00 42 20 00 00\n",
        "",
    )
    _, out, _ = run(capsys, "encode", "--eeprom", "pkw", "change", "p1082=Float32:40.0")
    assert out == "d4 3a 00 00 42 20 00 00\n"
    _, out, _ = run(capsys, "encode", "-f", "words", "--pkw-layout", "uss", "pkw read p2010[1]")
    assert out == "16#100A 16#8001 16#0000 16#0000\n"


def test_a_read_with_an_index_says_what_else_a_drive_may_want(capsys: Capture) -> None:
    status, out, err = run(capsys, "encode", "pkw read p2010[1]")
    assert (status, out) == (0, "10 0a 01 80 00 00 00 00\n")
    assert "`read array` (AK 6)" in err


@pytest.mark.parametrize("text", ["047F", "16#047F", "1151", "2#0100_0111_1111"])
def test_a_control_word_is_explained(capsys: Capture, text: str) -> None:
    _, out, _ = run(capsys, "explain", "stw1", text)
    assert out.startswith("STW1 16#047F = 1151: control word, controller to drive\n")
    assert "0 ON · 1 no OFF2 · 2 no OFF3 · 3 enable operation" in out


@pytest.mark.parametrize("text", ["-1231", "64305", "FB31"])
def test_a_status_word_is_explained(capsys: Capture, text: str) -> None:
    _, out, _ = run(capsys, "explain", "zsw1", text)
    assert out.startswith(
        "ZSW1 16#FB31 = -1231: status word, drive to controller: S2 ready to switch on\n"
    )
    assert "To the next state: ON (STW1 bit 0: 0 to 1" in out


def test_a_fault_comes_first(capsys: Capture) -> None:
    _, out, _ = run(capsys, "explain", "zsw1", "fb38", "-f", "json")
    (meaning,) = json.loads(out)["meanings"]
    assert meaning["advice"].startswith(
        "To the next state: the cause of the fault gone, then an edge"
    )


def test_what_a_control_word_lacks_is_told_in_chinese(capsys: Capture) -> None:
    _, out, _ = run(capsys, "explain", "控制字", "047E", "--lang", "zh")
    assert "运行还缺：ON（位 0，上升沿）。" in out
