"""Faults and alarms of drives by number: in the forms of watch tables, and those that the bus brings about."""

from __future__ import annotations

import pytest

from ds47.explain import explain


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("alarm 0x1D2C", "A07468"),
        ("alarm 16#1D2C", "A07468"),
        ("alarm 1D2C", "A07468"),
        ("alarm 7468", "A07468"),
        ("SINA_POS WarnAct 16#1D2C", "A07468"),
        ("SINA_POS ActWarn 7468", "A07468"),
        ("fault W#16#2135", "F08501"),
        ("SINA_POS ActFault 8501", "F08501"),
    ],
)
def test_a_number_is_read_as_a_watch_table_shows_it(text: str, code: str) -> None:
    first = explain(text)[0]
    assert first.code == code
    assert f"{code}: number {int(code[1:])} = 16#" in first.title


@pytest.mark.parametrize("lang", ["en", "zh"])
@pytest.mark.parametrize(
    ("text", "said", "cause"),
    [
        ("F08501", "PROFINET", "047E"),
        ("F1910", "PROFIBUS", "047E"),
        ("F07220", "STW1", "007E"),
        ("F0070", "p2040", "047E"),
    ],
)
def test_a_fault_of_the_bus_has_its_causes(text: str, said: str, cause: str, lang: str) -> None:
    (meaning,) = explain(text, lang)
    assert said in meaning.title
    assert any(cause in each.text for each in meaning.causes)
    assert meaning.advice is None


def test_any_other_fault_is_in_the_list_manual() -> None:
    (meaning,) = explain("F07900")
    assert meaning.causes == ()
    assert meaning.advice is not None
    assert "list manual" in meaning.advice
    assert explain("alarm 8501")[0].causes == ()
