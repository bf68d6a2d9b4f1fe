"""`ds47 explain` of what PLC blocks show, and of words that nobody named: every row of spec/blocks.toml, the names
people give, and the line that is left where nothing fits."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from ds47 import spec
from ds47.cli import main
from ds47.explain import CodeMeaning, UnknownFormError, explain
from ds47.report.explanation import lines
from ds47.report.wrap import columns
from ds47.spec import blocks

LANGUAGES = ("en", "zh")
CHINESE = re.compile(r"[\u4e00-\u9fff]")
S7 = ("GET", "PUT", "USEND", "URCV", "BSEND", "BRCV")
SCREEN, WIDE = 32, 140


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    status = main(["explain", *arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def rows() -> Iterator[tuple[str, blocks.Output, int, blocks.BlockCode]]:
    for row in blocks.codes():
        for block in row.blocks:
            output = next(each for each in blocks.outputs(block) if each.name == row.output)
            yield from ((block, output, code, row) for code in row.codes)


# ------------------------------------------------------------------------------------ the tables


@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_row_is_found_by_the_name_of_its_block(lang: str) -> None:
    for block, output, code, row in rows():
        for text in (
            f"{block} {output.name} 16#{code:04X}",
            f"{block} {code:04X}h",
            f"{block} {code}",
        ):
            first = explain(text, lang)[0]
            assert row.text(lang) in first.title, text
            assert re.match(rf"{block}[:：] ?{output.name} ", first.title), text
            assert f"{output.error} {int(row.error)}" in first.title or output.reads == "access", (
                text
            )
            assert [each.text for each in first.causes] == [
                each.text(lang) for each in row.causes()
            ]
            assert first.look
            assert first.plc[0].note
            for said in (first.title, first.look, *(each.text for each in first.causes)):
                assert bool(CHINESE.search(said)) == (lang == "zh"), said
        assert explain(f"{block} {output.name} {code}", lang)[0] == explain(first.name, lang)[0]


def test_a_number_alone_lists_every_block_that_may_show_it() -> None:
    for block, _, code, row in rows():
        if code:
            titles = [each.title for each in explain(f"0x{code:X}") if each.kind == "block_output"]
            assert any(block in title and row.en in title for title in titles), (block, code)


def test_every_row_has_its_source_and_no_number_twice() -> None:
    seen = [(block, output.name, code) for block, output, code, _ in rows()]
    assert len(seen) == len(set(seen)) > 80
    sources = {row["id"] for row in spec._load("blocks.toml")["source"]}
    for row in blocks.codes():
        assert row.source
        assert set(row.source) <= sources
    assert {key for row in blocks.codes() for key in row.source} == sources


def test_what_is_no_error_is_called_none() -> None:
    good = {
        (block, code) for block, _, code, row in rows() if not row.error and block in S7 and code
    }
    assert good == {
        *((block, 25) for block in S7), *((block, 11) for block in S7), ("URCV", 9), ("BRCV", 17),
    }  # fmt: skip


# ------------------------------------------------------------------------------- what people write


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("GET 2", "GET: STATUS 2 = 16#0002, ERROR 1: negative acknowledgement from the partner"),
        ("get status 16#0002", "GET: STATUS 2 = 16#0002, ERROR 1: negative"),
        ("PUT STATUS=W#16#000B", "PUT: STATUS 11 = 16#000B, ERROR 0: warning: the new job does not run"),
        ("GET 25", "GET: STATUS 25 = 16#0019, ERROR 0: the job has started and is running; no error"),
        ("GET 12", "GET: STATUS 12 = 16#000C, ERROR 1: the instance DB"),
        ("GET 14", "GET: STATUS 20 = 16#0014, ERROR 1: too many jobs"),
        ("USEND 0x12", "USEND: STATUS 18 = 16#0012, ERROR 1: the R_ID exists already"),
        ("BSEND 7", "BSEND: STATUS 7 = 16#0007, ERROR 1: the partner has not called BRCV"),
        ("BRCV 17", "BRCV: STATUS 17 = 16#0011, ERROR 0: warning: data is being received"),
        ("URCV 19", "URCV: STATUS 19 = 16#0013, ERROR 1: the partner's USEND sends faster"),
        ("PUT 80C3", "PUT: STATUS 16#80C3, ERROR 1: S7-1500: too many jobs at once"),
        ("SINA_POS 8402", "SINA_POS: Status 16#8402, Error 1: switching on is inhibited"),
        ("SinaSpeed Status -31742", "SINA_SPEED: Status 16#8402, Error 1: switching on is inhibited"),
        ("SINA POS 16#8600", "SINA_POS: Status 16#8600, Error 1: error of DPRD_DAT"),
        ("sina_pos 7002", "SINA_POS: Status 16#7002, Error 0: no error"),
        ("SINA_POS DiagID 80B1", "SINA_POS DiagId: 0x80B1 = -32591: RET_VAL of SFC14 (DPRD_DAT)"),
        ("SINA_SPEED 8090", "SINA_SPEED DiagId: 0x8090 = -32624: RET_VAL of SFC14"),
        ("SINA_POS ActFault 7900", "SINA_POS ActFault: F07900"),
        ("SINA_PARA 3", "SINA_PARA: Status 16#00000003: RDREC or WRREC failed"),
        ("SINA_PARA ErrorId 16#00030005",
         "SINA_PARA: Status 16#00030005: RDREC or WRREC failed; access failed: parameter 1, 3"),
        ("SINA_PARA Status 00000001", "SINA_PARA: Status 16#00000001: access failed: parameter 1"),
        ("SINA_PARA_S errorId = 2", "SINA_PARA_S: Status 16#00000002: wrong input of the block"),
        ("SinaPara.DiagId = 80B5", "SINA_PARA DiagId: 80B5, middle of DE80B500: Read refused"),
        ("Sina Para S DiagId 16#80C2", "SINA_PARA_S DiagId: 80C2, middle of DE80C200: Read refused"),
        ("SINA_PARA 80B5", "SINA_PARA DiagId: 80B5, middle of DE80B500: Read refused"),
        ("SINA_PARA Parameter[3].swErrorNo 6B", "SINA_PARA swErrorNo: 0x6B = 107: error number of"),
        ("SINA_PARA_S ErrorNo 17", "SINA_PARA_S ErrorNo: 0x11 = 17: error number: Request cannot be"),
        ("RDREC 80C2", "80C2, middle of DE80C200: Read refused, resource busy"),
        ("WRREC ERROR 1 STATUS DF80B700", "DF80B700: Write refused, invalid range"),
        ("SFB53 80B7", "80B7, middle of DF80B700: Write refused"),
        ("RDREC -32574", "80C2, middle of DE80C200: Read refused"),
        ("WR_REC 80A2", "0x80A2 = -32606: RET_VAL of SFC58 (WR_REC)"),
    ],
)  # fmt: skip
def test_outputs_as_people_write_them(text: str, wanted: str) -> None:
    assert explain(text)[0].title.startswith(wanted)


def test_error_that_does_not_go_with_the_number_is_told() -> None:
    (meaning,) = explain("GET ERROR 1 STATUS 11")
    assert meaning.advice == "With ERROR 1 no document has this number: ERROR is 0 with it."
    for text in ("GET ERROR 0 STATUS 11", "GET 11", "GET error true 4"):
        assert explain(text)[0].advice is None


def test_both_orders_of_the_words_of_sina_para() -> None:
    first, second = explain("SINA_PARA Status 16#00030001")
    assert [each.value for each in first.parts] == ["word 1 = 16#0003", "word 2 = 16#0001"]
    assert [each.text for each in first.parts] == ["kind of error", "a bit for each parameter"]
    assert second.title.endswith("internal error in the message; access failed: parameter 1, 2")
    assert [each.text for each in second.parts] == ["a bit for each parameter", "kind of error"]
    assert [each.title for each in explain("00030001")] == [first.title]
    assert explain("SINA_PARA 16#00008000")[0].title.endswith("access failed: parameter 16")


def test_a_word_that_may_be_two_outputs_names_both() -> None:
    titles = [each.title for each in explain("SINA_PARA 5")]
    assert "a data type that the block does not know" in titles[0]
    assert any("swErrorNo: 0x05" in title for title in titles)
    assert titles[-1].endswith("access failed: parameter 1, 3")


def test_sina_para_talks_to_no_other_drives() -> None:
    assert {each.vendor for each in explain("error 6B")} == {"SINAMICS", "KEB", "Vacon"}
    for text in ("SINA_PARA swErrorNo 6B", "SINA_PARA_S ErrorNo 16#6B", "SINA_PARA_S ErrorNo 107"):
        assert [each.vendor for each in explain(text) if each.known] == ["SINAMICS"], text


def test_of_a_call_only_what_it_can_show() -> None:
    assert {each.code[:2] for each in explain("RDREC 80B1")} == {"DE", "C0"}
    assert {each.code[:2] for each in explain("WRREC 80B1")} == {"DF", "C0"}
    assert explain("RDREC 7002")[0].code == "00700200"


@pytest.mark.parametrize("text", ["GET", "GET status", "SINA_POS", "GET x", "GET STATUS DiagId"])
def test_a_block_without_a_number_is_no_code(text: str) -> None:
    with pytest.raises(UnknownFormError):
        explain(text)


# -------------------------------------------------------------------------- words that nobody named


def first(text: str, lang: str = "en") -> CodeMeaning:
    return explain(text, lang)[0]


@pytest.mark.parametrize(
    ("text", "kind", "named"),
    [
        ("047E", "stw1", "stw1 16#047E"), ("047F", "stw1", "stw1 16#047F"), ("16#04FE", "stw1", "stw1 16#04FE"),
        ("FB31", "zsw1", "zsw1 16#FB31"), ("-1231", "zsw1", "zsw1 16#FB31"), ("0237", "zsw1", "zsw1 16#0237"),
        ("707B", "pkw", "pkw 16#707B"), ("70 7B", "pkw", "pkw 16#707B"), ("7023", "pkw", "pkw 16#7023"),
    ],
)  # fmt: skip
def test_words_of_cyclic_frames_are_recognised(text: str, kind: str, named: str) -> None:
    for lang in LANGUAGES:
        meaning = first(text, lang)
        assert (meaning.kind, meaning.name, meaning.known) == (kind, named, True)
        assert explain(named, lang)[0] == meaning


@pytest.mark.parametrize("text", ["7900", "07900", "30003"])
def test_a_bare_number_may_be_a_fault_as_r0945_has_it(text: str) -> None:
    fault = f"F{int(text):05d}"
    assert [each.code for each in explain(text) if each.kind == "fault"] == [fault]
    assert explain(text)[0].kind != "fault" or len(explain(text)) == 1


@pytest.mark.parametrize("text", ["8180", "00030001", "0900", "70000"])
def test_what_has_another_meaning_or_is_no_such_number_is_no_fault(text: str) -> None:
    assert not any(each.kind == "fault" for each in explain(text))


def test_pkw_says_answer_and_request() -> None:
    assert "parameter 123; in an answer 7 (" in first("707B").title
    assert "in a request 1 (read value)" in first("pkw 1B54").title
    assert 'decode --as pkw-answer "707B 0000 0000 0001"' in str(first("707B").advice)


@pytest.mark.parametrize(
    "text", ["1150", "0x0601", "0200", "0400", "0911", "7000", "7001", "8104", "2600"]
)
def test_other_words_are_none_of_cyclic_frames(text: str) -> None:
    assert first(text).kind not in ("stw1", "zsw1", "pkw")


@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("0601", "ds47 explain stw1 0601"), ("EF01", "EF01"), ("GET 99", "20"), ("PUT 16#8123", "16#80C3"),
        ("SINA_POS 8405", "16#8403"), ("SFC58 80A5", "80A3"), ("SFC14 80B4", "80B3"), ("12345678", "12345678"),
        ("response 3", "0x03"), ("DS999", "DS999"),
    ],
)  # fmt: skip
def test_where_nothing_fits_one_line_is_left(text: str, wanted: str, lang: str) -> None:
    (line,) = lines(explain(text, lang), lang)
    assert wanted in line
    assert columns(line) <= WIDE


@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize("text", ["xyz", "speed limit of none", "no code " * 20, "GET", "1.5"])
def test_what_is_no_code_takes_one_line(
    text: str, lang: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = run(capsys, text, "--lang", lang)
    assert (status, out) == (2, "")
    (line,) = err.splitlines()
    assert columns(line) <= WIDE


# ---------------------------------------------------------------------------------- several at once


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["GET", "2", "4", "PUT", "4"], ["GET: STATUS 2", "GET: STATUS 4", "PUT: STATUS 4"]),
        (["GET", "2", "4"], ["GET: STATUS 2", "GET: STATUS 4"]),
        (["GET 2", "SINA_POS 8402"], ["GET: STATUS 2", "SINA_POS: Status 16#8402"]),
        (
            ["RDREC", "80B5", "WRREC", "80B5"],
            ["80B5, middle of DE80B500", "80B5, middle of DF80B500"],
        ),
        (["GET", "2", "DE80B500"], ["GET: STATUS 2", "DE80B500: Read refused"]),
        (["error", "82", "83"], ["0x82 = 130: error number", "0x83 = 131: error number"]),
        (["DE", "80", "B5", "00"], ["DE80B500: Read refused"]),
    ],
)
def test_words_in_front_hold_for_the_codes_behind(
    words: list[str], wanted: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, _ = run(capsys, *words)
    assert status == 0
    starts = [each.splitlines()[0] for each in re.split(r"\n\n(?!Or |No meaning)", out)]
    assert len(starts) == len(wanted)
    for start, text in zip(starts, wanted, strict=True):
        assert start.startswith(text)


def test_one_that_is_none_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "GET", "2", "xyz")
    assert (status, out) == (2, "")
    assert "unknown code 'xyz'" in err


@pytest.mark.parametrize("lang", LANGUAGES)
def test_an_answer_fits_on_a_screen(lang: str) -> None:
    for block, output, code, _ in rows():
        for text in (f"{block} {output.name} {code}", f"0x{code:X}"):
            shown = list(lines(explain(text, lang), lang))
            assert len(shown) <= SCREEN, text
            assert all(
                columns(line) <= 100 or "pn_io" in line or "s7comm" in line for line in shown
            )


def test_a_block_for_one_parameter_has_no_bits_of_others() -> None:
    """SINA_PARA_S 3 is a kind of error; of SINA_PARA it may be parameters 1 and 2, too."""
    several = [each.title for each in explain("SINA_PARA Status 3")]
    single = [each.title for each in explain("SINA_PARA_S Status 3")]
    assert any("access failed: parameter 1, 2" in each for each in several)
    assert not any("parameter 1, 2" in each for each in single)
    assert any("RDREC or WRREC failed" in each for each in single)
    assert "parameter 1" in explain("SINA_PARA_S Status 16#00030001")[0].title
