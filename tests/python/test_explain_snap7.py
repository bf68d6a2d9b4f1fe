"""Error numbers of Snap7 and its relatives, as their logs show them."""

from __future__ import annotations

from itertools import chain

import pytest

from ds47.explain import UnknownFormError, explain
from ds47.spec import _load, s7, snap7

LANGUAGES = ("en", "zh")


@pytest.mark.parametrize(
    ("texts", "code", "said"),
    [
        (("36700160", "0x2300000", "0x02300000", "s7 36700160"), 0x02300000, ["refused the job"]),
        (("665420", "0xa274c", "s7 0xA274C"), 0x000A274C, ["while receiving", "timed out"]),
        (("655420", "0xa003c"), 0x000A003C, ["while receiving", "timed out"]),
        (("589856", "0x90020"), 0x00090020, ["while sending", "closed by the other side"]),
        (("12582912", "0x00C00000"), 0x00C00000, ["object is not available"]),
        (("196608", "s7 0x30000"), 0x00030000, ["wrong form"]),
        (("7340032", "s7 0x00700000"), 0x00700000, ["more data than the PDU takes"]),
        (("0xffffff7e", "s7 -130", "s7 4294967166"), 0xFFFFFF7E, ["= -130:", "no buffer"]),
        (("0xFFFFFBFF", "FFFFFBFF", "s7 -1025"), 0xFFFFFBFF, ["libnodave", "no answer in time"]),
        (("s7 655362",), 0x000A0002, ["while receiving", "error 2 of the operating system"]),
    ],
)
def test_a_number_is_read_in_the_forms_of_logs(
    texts: tuple[str, ...], code: int, said: list[str]
) -> None:
    for text in texts:
        first = explain(text)[0]
        assert (first.kind, first.known, first.code) == ("s7_error", True, f"0x{code:08X}"), text
        assert all(each in first.title for each in said), text
        assert explain(first.name) == [first]


@pytest.mark.parametrize("lang", LANGUAGES)
def test_what_the_partner_said_gives_its_causes(lang: str) -> None:
    """A number that stands for a word of S7 names it, and has its causes."""
    for number, word in ((0x01400000, "s7 8104"), (0x00900000, "s7 0x05"), (0x00C00000, "s7 0x0A")):
        (library,), (partner, *_) = explain(f"s7 {number:#010x}", lang), explain(word, lang)
        assert library.causes == partner.causes
        assert any(word.removeprefix("s7 ") in part.text for part in library.parts)


def test_what_is_no_number_of_the_library() -> None:
    """A status, two words of SINA_PARA and an error word keep their meaning."""
    for text, kind in (
        ("00700000", "status"),
        ("0x00030000", "block_output"),
        ("s7 33028", "s7_error"),
    ):
        first, *others = explain(text)
        assert (first.kind, first.known) == (kind, True)
        assert not any("Snap7" in each.title for each in (first, *others)), text
    assert not any(each.known for each in explain("36700161"))


@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_number_of_the_table_has_an_answer(lang: str) -> None:
    table = _load("snap7.toml")
    clients = [row["code"] << 20 for row in table["client"]]
    connections = [row["code"] << 16 for row in table["connection"]]
    sockets = [0xA0000 | code for row in table["socket"] for code in row["codes"]]
    others = [(1 << 32) + row["code"] for row in table["libnodave"]]
    for number in chain(clients, connections, sockets, others):
        (meaning,) = explain(f"s7 {number:#x}", lang)
        assert meaning.causes
        assert all(part.text for part in meaning.parts)
    assert snap7.parts(0x02300001) == ()
    assert snap7.parts(0x00C00000)[0].stands_for == (0x0A, 0xD209)
    assert set(s7.codes("return_code")) >= {0x05, 0x06, 0x07, 0x0A}


@pytest.mark.parametrize(
    ("text", "kind", "code"),
    [
        ("err_cls 253 err_code 5", "status", "CF81FD05"),
        ("ABORT err_cls 253   err_code 18", "status", "CF81FD12"),
        ("ABORT err_cls 0   err_code 6", "status", "CF81FD06"),
        ("Error class: 0xfd of a protocol Error code: 0x24 unknown", "status", "CF81FD24"),
        ("Error Class: 133, Error Code 0.", "s7_error", "0x8500"),
        ("error class 0x83, error code 0x04", "s7_error", "0x8304"),
        ("error class 129 error code 4", "s7_error", "0x8104"),
    ],
)
def test_an_error_as_class_and_code(text: str, kind: str, code: str) -> None:
    """S7 communication and the connection of PROFINET have classes of their own."""
    (meaning,) = explain(text)
    assert (meaning.kind, meaning.known, meaning.code) == (kind, True, code)
    assert explain(meaning.name)[0] == meaning


@pytest.mark.parametrize(
    "text", ["err_cls 0 err_code 0", "error class: 299, error code: 1", "error class 1"]
)
def test_classes_of_nobody(text: str) -> None:
    with pytest.raises(UnknownFormError):
        explain(text)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("[15:22:09 INFO ] CMRPC(628) ERROR: 219, 129, 61, 0", "DB813D00"),
        ("ret = -1   error_code=219  error_decode=129  error_code_1=61  error_code_2=0", "DB813D00"),
        ("0xCF, 0x81, 0xFD, 0x18", "CF81FD18"),
        (
            "ErrorCode = RTA-ERR (0xCF), ErrorDecode = PNIO (0x81), ErrorCode1 = PROTOCOL (253) "
            "and ErrorCode2 = AR cmi timeout (06)",
            "CF81FD06",
        ),
        ("error code: 0xDE, error decode: 0x80, error code 1: 0xB5, error code 2: 0x00", "DE80B500"),
        ("222,128,181,0", "DE80B500"),
        ("0xDF 0x80 0xB7 0x00", "DF80B700"),
    ],
)  # fmt: skip
def test_a_status_as_four_numbers(text: str, code: str) -> None:
    (meaning,) = explain(text)
    assert (meaning.kind, meaning.known, meaning.code) == ("status", True, code)


@pytest.mark.parametrize(
    "text",
    ["1, 2, 3, 4", "0x01, 0x02, 0x03, 0x04", "219, 7, 61, 0", "219, 129, 61, 300", "219, 129, 61"],
)
def test_four_numbers_that_are_no_status(text: str) -> None:
    with pytest.raises(UnknownFormError):
        explain(text)
