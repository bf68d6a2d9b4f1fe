"""`ds47.toml`: what it may hold, where it is found, and what is said when it is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from ds47.regression.config import Config, ConfigError, find, load

WHOLE = """
[tolerance]
float_relative = 1e-6
duration_relative = 0.5

[[tolerance.parameter]]
pnu = 2902
subindex = 2
absolute = 0.5

[[mask]]
pnu = 60
reason = "actual speed"
device = "192.168.133.*"

[[ignore]]
rule = "DS415"
capture = "s7/*"
pnu = 2900
reason = "the program leaves its reference constant"

[labels]
"fw-5.2/*" = "5.2"

[check]
fail_on = "warning"
"""


def config(folder: Path, text: str) -> Config:
    (folder / "ds47.toml").write_text(text, encoding="utf-8")
    return load(folder / "ds47.toml")


def test_all_of_it(tmp_path):
    settings = config(tmp_path, WHOLE)
    assert settings.tolerance.float_relative == 1e-6
    assert settings.tolerance.duration_relative == 0.5
    assert settings.tolerance.duration_absolute_ms is None
    assert settings.parameters[0].absolute == 0.5
    assert settings.fail_on == "warning"
    assert settings.label(tmp_path / "fw-5.2" / "a.pcap") == "5.2"
    assert settings.label(tmp_path / "other" / "a.pcap") == "other"
    assert settings.ignored("DS415", tmp_path / "s7" / "a.pcap", {2900})
    assert not settings.ignored("DS415", tmp_path / "s7" / "a.pcap", {2901})
    assert not settings.ignored("DS415", tmp_path / "x" / "a.pcap", {2900})
    assert not settings.ignored("DS410", tmp_path / "s7" / "a.pcap", {2900})


def test_masks(tmp_path):
    settings = config(tmp_path, WHOLE)
    assert settings.masked("192.168.133.33", 60, 0)
    assert not settings.masked("10.0.0.1", 60, 0)
    assert not settings.masked("192.168.133.33", 61, 0)
    assert not settings.masked("192.168.133.33", None, None)


def test_known_volatile_parameters_are_masked_without_a_word():
    from ds47 import spec

    volatile = next(
        number for number in spec.parameters() if getattr(spec.parameter(number), "volatile", False)
    )
    assert Config().masked("192.168.133.33", volatile, 0)


@pytest.mark.parametrize(
    ("name", "masked"),
    [
        (None, False), ("Actual speed, smoothed", True), ("Actual frequency", True), ("n_act", True),
        ("平滑转速实际值", True),
    ],
)  # fmt: skip
def test_what_only_drives_of_one_make_change_is_masked_there(
    name: str | None, masked: bool
) -> None:
    """Number 21 is an actual value on SINAMICS and MICROMASTER 4; of a drive of another make nothing names it."""
    assert Config().masked("192.168.133.33", 21, 0, name) == masked
    assert not Config().masked("192.168.133.33", 1120, 0, name)


def test_the_nearest_file_counts(tmp_path):
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "ds47.toml").write_text('[check]\nfail_on = "never"\n')
    (tmp_path / "a" / "ds47.toml").write_text('[check]\nfail_on = "note"\n')
    assert find(tmp_path / "x.pcap").fail_on == "never"
    assert find(tmp_path / "a" / "b" / "x.pcap").fail_on == "note"


def test_a_byte_order_mark_and_crlf_do_no_harm(tmp_path):
    (tmp_path / "ds47.toml").write_bytes(b'\xef\xbb\xbf[check]\r\nfail_on = "note"\r\n')
    assert load(tmp_path / "ds47.toml").fail_on == "note"


def test_a_known_finding_may_stand_by_its_name(tmp_path):
    settings = config(tmp_path, '[[ignore]]\nrule = "drive-error"\nreason = "x"')
    assert settings.ignored("DS410", tmp_path / "a.pcap", set())
    assert not settings.ignored("DS411", tmp_path / "a.pcap", set())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[tolerances]", "unknown key 'tolerances'; known are tolerance, mask"),
        ("[tolerance]\nfloat = 1", "unknown key 'float'"),
        ("[tolerance]\nfloat_relative = -1", "float_relative: -1 is not a number, 0 or more"),
        ("[tolerance]\nfloat_relative = true", "True is not a number"),
        ("[[mask]]\npnu = 1", "reason is missing"),
        ('[[mask]]\npnu = "1"\nreason = "x"', "pnu: '1' is not a whole number"),
        ('[[mask]]\npnu = 1\nreason = ""', "reason: '' is not a text"),
        ('[mask]\npnu = 1\nreason = "x"', "write each as a table of its own, [[mask]]"),
        ('[[ignore]]\nrule = "DX1"\nreason = "x"', "no rule has the number or name 'DX1'"),
        ('[check]\nfail_on = "fatal"', "one of never, note, warning, error"),
        ("[labels]\na = 1", "a label is a text"),
        ("tolerance = 1", "write it as a table, [tolerance]"),
        ("[tolerance", "ds47.toml"),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path, text, says):
    with pytest.raises(ConfigError) as problem:
        config(tmp_path, text)
    assert says in str(problem.value)
    assert str(tmp_path) in str(problem.value)
    assert "\n" not in str(problem.value)
