"""The tables: they load, agree with each other and say what the reference says."""

from __future__ import annotations

import importlib.util
from collections import Counter
from pathlib import Path

import pytest

from ds47 import spec
from ds47.capture import scan
from ds47.profidrive import model
from ds47.spec import layouts
from ds47.spec.semantics import known, limits
from ds47.spec.statuses import status_hex, status_text


def test_response_ids_of_requests_are_known() -> None:
    for request in spec.request_ids().values():
        assert request.positive in spec.response_ids()
        assert request.negative in spec.response_ids()


def test_dialects_point_into_the_table() -> None:
    for name in ("profile_v3_types", "legacy_g120_formats"):
        assert set(spec.dialect(name).values()) <= spec.formats().keys()


def test_error_numbers_of_the_profile_are_complete() -> None:
    assert set(spec.errors()) == set(range(0x65))
    assert all(error.en and error.zh for error in spec.errors().values())


def test_error_texts() -> None:
    assert spec.error_text(0x15) == "Response too long for the transmission"
    assert spec.error_text(0x03, "zh") == "错误的下标"
    assert spec.error_text(0x6B, "zh", 0x002A) == "控制器使能时无修改权限"
    assert spec.error_text(0x6F, "en", 0x001A) == "Timeout"
    told = spec.error_text(0x6B, "en", 0x0493)
    assert told == "Manufacturer-specific error 0x6B: see the manual of rt-labs, vendor 0x0493"
    assert "SINAMICS" in spec.error_text(0x6B)
    assert spec.error_info_meaning(0x03) == "subindex"
    assert spec.error_info_meaning(0x00) == "none"
    sew = next(vendor for vendor in spec.vendors() if vendor.name == "SEW")
    assert 0x85 in sew.errors


def test_the_error_number_is_the_whole_word() -> None:
    assert spec.error_text(0x0811, "en", 0x010A) == "Function or parameter not implemented"
    assert spec.error_text(0x0811, "zh", 0x010A) == "功能或参数未实现"
    for vendor in (None, 0x002A, 0x0493):
        assert spec.error_text(0x0811, "en", vendor) == "Manufacturer-specific error 0x0811"
    assert (spec.error_hex(0x11), spec.error_hex(0xFF), spec.error_hex(0x100)) == (
        "0x11",
        "0xFF",
        "0x0100",
    )


def test_every_text_can_be_shown() -> None:
    for vendor in (None, 0x002A, 0x001A, 0x0493):
        for lang in ("en", "zh"):
            assert all(spec.error_text(code, lang, vendor) for code in range(256))


def test_status() -> None:
    assert status_hex(0xDE80B500) == "DE80B500"
    assert status_text(0xDE80B500) == "read: access: state conflict"
    assert status_text(0xDE80B500, "zh") == "读取：访问：状态冲突"
    assert status_text(0xDF80B700) == "write: access: invalid range"
    assert status_text(0) == "ok"
    for status in range(0, 2**32, 0x00FEDCBA):
        assert status_text(status)


def test_parameters() -> None:
    ramp = spec.parameter(50303, "sinamics")
    assert ramp is not None
    assert (ramp.unit, ramp.type) == ("s", "Float32")
    assert {952, 970, 971, 972, 977, 21, 25, 27} <= spec.changing()
    assert 922 not in spec.changing()
    names = [row and row.name_en for row in map(spec.parameter, (980, 985))]
    assert names[0] == names[1]


def test_a_number_means_what_its_family_says() -> None:
    found = [spec.parameter(1082, family) for family in ("sinamics", "micromaster", "profile")]
    assert [row and row.unit for row in found] == ["rpm", "Hz", None]
    assert [row and row.family for row in (spec.parameter(10, each) for each in spec.FAMILIES)] == [
        "sinamics",
        "siemens",
        None,
    ]
    assert all(spec.parameter(922, each) is spec.parameter(922) for each in spec.FAMILIES)
    assert spec.parameter(50303, "micromaster") is None


def test_what_a_number_usually_is() -> None:
    assert [row and row.family for row in map(spec.usual, (1082, 922, 10, 21, 700, 1999))] == [
        "sinamics", "profile", "sinamics", "sinamics", "micromaster", None,
    ]  # fmt: skip


def test_every_parameter_of_a_maker_says_where_it_was_read() -> None:
    """Sources that there are, none twice, and none that nobody names; of the profile those of the access."""
    rows = [row for families in spec.parameters().values() for row in families.values()]
    places = spec.parameter_sources()
    named = Counter(each for row in rows for each in set(row.sources))
    assert set(named) == set(places)
    for row in rows:
        assert len(set(row.sources)) == len(row.sources)
        of_maker = row.family not in ("profile", "encoder")
        assert bool(row.sources) == (of_maker or row.access is not None), row.number
        assert set(row.values_en) == set(row.values_zh)
        assert row.type == "unknown" or row.connects is None or row.type.startswith("Unsigned32")
        assert row.access in ("p", "r", None)
        assert not (row.connects and row.access == "r")


def test_every_vendor_says_where_its_numbers_were_read() -> None:
    assert all(row["source"] for row in (*spec.makers(), spec._load("vendors.toml")))


def test_rules() -> None:
    assert list(spec.rules()) == sorted(spec.rules())
    assert spec.rules()["DS315"].severity == "error"


def test_the_tables_of_a_wheel_are_the_toml_files(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    about = importlib.util.spec_from_file_location("hatch_build", repository / "hatch_build.py")
    assert about is not None
    assert about.loader is not None
    hook = importlib.util.module_from_spec(about)
    about.loader.exec_module(hook)
    folder = repository / "python/ds47/spec"
    ready = hook.tables(folder).encode()
    content = spec._content
    monkeypatch.setattr(
        spec, "_content", lambda name: ready if name == "tables.ndjson" else content(name)
    )
    for cached in (spec._ready, spec._load):
        cached.cache_clear()
    names = [file.relative_to(folder).as_posix() for file in folder.rglob("*.toml")]
    try:
        assert sorted(key.split()[0] for key in spec._ready()) == sorted(names)
        assert all(spec._load(name) == spec._parsed(content(name)) for name in names)
    finally:
        for cached in (spec._ready, spec._load):
            cached.cache_clear()


def test_a_row_stays_as_it_is_and_has_no_other_columns() -> None:
    row = spec.formats()[0x04]
    with pytest.raises(AttributeError, match="name of a Format"):
        row.name = "other"
    with pytest.raises(TypeError, match="Format has no column colour"):
        row.but(colour="red")
    other = row.but(unit="m")
    assert (other.code, other.unit, row.unit) == (row.code, "m", None)
    assert repr(other).startswith(f"Format(code={row.code}, name={row.name!r}")


def test_every_row_has_all_of_its_columns() -> None:
    tables = (
        spec.formats(), spec.attributes(), spec.request_ids(), spec.response_ids(), spec.errors(),
        spec.rules(), *spec.parameters().values(),
    )  # fmt: skip
    rows = [row for table in tables for row in table.values()]
    assert all(row.columns() for row in (*rows, *spec.vendors(), spec.status(), limits(), known()))


def test_every_name_of_a_format_leads_to_it() -> None:
    for row in spec.formats().values():
        for name in filter(None, (row.name, row.plc, row.wireshark)):
            assert spec.format_named(name) is row, name
            assert spec.format_named(name.upper()) is row, name
    assert spec.format_named("Float31") is None


# Layouts


def test_the_scan_and_the_codec_have_the_numbers_of_the_layouts() -> None:
    """The scan is compiled by itself and keeps its own; the codec names attributes and formats in its model."""
    data = bytearray(layouts.RPC_SIZE)
    data[layouts.RPC_VERSION] = layouts.RPC_VERSION_4
    data[layouts.RPC_INTERFACE : layouts.RPC_ACTIVITY] = scan.UUIDS[:16]
    assert scan.is_pnio(bytes(data), 0, len(data))
    assert (model.VALUE, model.DESCRIPTION, model.TEXT, model.ZERO, model.ERROR) == (
        layouts.ADDRESS_VALUE, layouts.ADDRESS_DESCRIPTION, layouts.ADDRESS_TEXT,
        layouts.VALUE_ZERO, layouts.VALUE_ERROR,
    )  # fmt: skip


def test_the_fields_of_a_layout_lie_inside_it_and_do_not_overlap() -> None:
    for name, table in spec._load("layouts.toml").items():
        if name == "block":
            continue  # of a block only the head has a size
        taken: set[int] = set()
        fields = dict(table["fields"])
        if name == "record":
            del fields[
                "status"
            ]  # the end of a response stands where a Read request has its target AR
        for at, size in fields.values():
            assert taken.isdisjoint(range(at, at + size))
            taken |= set(range(at, at + size))
        assert max(taken) < table["size"]
