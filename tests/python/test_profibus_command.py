"""Frames of PROFIBUS on the command line: `decode --as profibus` (docs/profibus.md 1)."""

from __future__ import annotations

import json

import pytest

from ds47.cli import main

Capture = pytest.CaptureFixture[str]
WRITE = "6813136883827d33335f002f0a030102011001c47f0000db16"
READ_ANSWER = "6813136882830833335e002f0a030102010801412000007b16"
NOT_READY = "680909688283083333de80b5008616"


def run(capsys: Capture, *arguments: str) -> tuple[int, str, str]:
    status = main(list(arguments))
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def decoded(capsys: Capture, *arguments: str) -> str:
    status, out, err = run(capsys, "decode", "--as", "profibus", *arguments)
    assert (status, err) == (0, "")
    return out


def test_a_write_with_the_request_inside(capsys: Capture) -> None:
    assert decoded(capsys, WRITE) == (
        "SD2, frame with data, 25 bytes\n"
        "     0  68 13 13 68              start bytes, length 19\n"
        "     4  83 82                    station 2 to 3\n"
        "     6  7d                       SRD high, FCB 1\n"
        "     7  33 33                    to SAP 51, from SAP 51: read and write of records (MS1)\n"
        "     9  5f 00 2f 0a              DS_Write, slot 0, index 47, length 10\n"
        "    13  03                       request_reference 3\n"
        "    14  01                       request_id 0x01 read\n"
        "    15  02                       axis 2\n"
        "    16  01                       parameter_count 1\n"
        "    17  10 01 c4 7f 00 00        p50303[0] value, 1 element\n"
        "    23  db 16                    check byte, end byte\n"
    )


def test_several_frames_in_one_string(capsys: Capture) -> None:
    out = decoded(capsys, WRITE + "e5" + NOT_READY, "DC 02 02")
    assert [line for line in out.splitlines() if line.startswith(("SD", "byte"))] == [
        "SD2, frame with data, 25 bytes",
        "byte 25: SC, short acknowledgement, 1 byte",
        "byte 26: SD2, frame with data, 15 bytes",
        "byte 41: SD4, token, 3 bytes",
    ]
    assert "DS_Read negative: read: access: state conflict" in out
    assert "\nthe answer is not ready: ask again\n" in out
    assert "token from 2 to 2" in out


def test_json_has_the_frame_and_the_response_inside(capsys: Capture) -> None:
    (found,) = json.loads(decoded(capsys, "-f", "json", READ_ANSWER))["telegrams"]
    assert {key: found[key] for key in ("sd", "da", "sa", "fc", "dsap", "ssap", "service", "flaws")} == {
        "sd": "SD2", "da": 2, "sa": 3, "fc": 8, "dsap": 51, "ssap": 51,
        "service": "read and write of records (MS1)", "flaws": [],
    }  # fmt: skip
    assert (found["ms1"]["function"], found["ms1"]["slot"]) == ("DS_Read positive", 0)
    inside = found["ms1"]["ds47"]
    assert (inside["kind"], inside["axis"]) == ("response", 2)
    assert inside["parameters"][0]["values"] == [10.0]


def test_a_configuration_says_the_ppo_and_what_may_come_apart(capsys: Capture) -> None:
    out = decoded(capsys, "6807076883827d3e3ef3f1e216")
    assert "4 words in+out, consistent over whole length (PKW)" in out
    assert out.endswith("PPO1: 12 bytes to the slave, 12 from it\n")
    out = decoded(capsys, "6807076883827d3e3e73f16216")
    assert (
        "PKW is not consistent over its whole length: its four words may come from different cycles"
        in out
    )
    assert "PKW 未按全长一致" in decoded(capsys, "--lang", "zh", "6807076883827d3e3e73f16216")


def test_a_diagnosis_and_parameters(capsys: Capture) -> None:
    out = decoded(capsys, "a28283083e3c000400ff80b5bf16")
    assert "nothing is set" in out
    assert "ident number 80B5" in out
    out = decoded(capsys, "680f0f6883825d3d3e881e010080b501000000ba16")
    assert "watchdog on; locked for other masters" in out
    assert "watchdog 300 ms" in out


def test_a_refused_configuration(capsys: Capture) -> None:
    out = decoded(capsys, "a28283083e3c020505ff80b5c716")
    assert "not ready for data exchange; wants parameters and configuration anew" in out


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("6809096883827d33335e002ff06416", "error at byte 13: check byte is 64, and the bytes give 65"),
        ("68090a6883827d33335e002ff06516", "error at byte 1: length bytes differ: 9 and 10"),
        ("6809096883827d33335e002ff065", "error at byte 14: cut off: 14 of 15 bytes"),
        ("00", "error at byte 0: no frame begins with 00"),
        ("6813136882830833335e002f14030102010801412000008516",
         "length byte says 20, and 10 bytes of data follow"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(capsys: Capture, text: str, complaint: str) -> None:
    assert complaint in decoded(capsys, text)


def test_a_message_that_is_wrong_inside_has_its_finding(capsys: Capture) -> None:
    out = decoded(capsys, "680e0e6883827d33335f002f0501010102008016")
    assert out.splitlines()[-1].startswith(
        "in the record: DS315 error: offset 5: Message ends too early"
    )


def test_wrong_use_is_one_line(capsys: Capture) -> None:
    status, out, err = run(capsys, "decode", "--as", "profibus", "--request", "00", "e5")
    assert (status, out) == (2, "")
    assert "it does not go with --as profibus" in err.splitlines()[-1]
