"""Frames of PROFIBUS for people and for JSON: what stands at which byte, and what it means.

Of single frames, as `ds47 decode --as profibus` shows them. Decoding is `ds47.profibus`; the record inside (DS47)
and what a capture shows of a station are not here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ds47.profibus import dp, ms1
from ds47.profibus.telegram import SC, SD2, SD4, Telegram
from ds47.report.bilingual import Both, joined, say
from ds47.spec import profibus
from ds47.spec.statuses import status_text
from ds47.spec.words import Flaw

Line = tuple[int, Both]
"""Where something stands in the frame, and what it means."""
RECORDS = (dp.RECORD, dp.ALARM, dp.RESOURCE, dp.MS2)
"""The services whose data is a message of MS1 or MS2."""


def record(item: Telegram) -> ms1.Ms1Message | None:
    """The message of MS1 or MS2 that a frame carries; None for none."""
    if item.request is None or dp.service(item) not in RECORDS:
        return None
    return ms1.decode(item.du, item.request)


def flaw(found: Flaw) -> Both:
    """What is wrong."""
    return Both.of(profibus.flaw_text, found.kind, found.args)


# For JSON


def document(item: Telegram) -> dict[str, Any]:
    """A frame for JSON; what it does not have is None."""
    fc, name = item.fc, dp.service(item)
    return {
        "sd": item.kind or None, "length": len(item.data), "da": item.da, "sa": item.sa, "fc": fc,
        "function": None if fc is None else profibus.control_text(fc),
        "request": item.request, "fcb": item.front.fcb, "fcv": item.front.fcv,
        "dsap": item.dsap, "ssap": item.ssap, "du": item.du.hex(), "fcs": item.fcs,
        "service": name and profibus.service_text(name),
        "flaws": _flaws(item.flaws), "dp": _dp_document(dp.decode(item)),
        "ms1": _ms1_document(record(item), item),
    }  # fmt: skip


def _flaws(found: Sequence[Flaw]) -> list[dict[str, Any]]:
    return [
        {
            "kind": each.kind,
            "offset": each.offset,
            "text": profibus.flaw_text(each.kind, each.args),
        }
        for each in found
    ]


def _dp_document(found: dp.Content | None) -> dict[str, Any] | None:
    if found is None:
        return None
    flaws = {"flaws": _flaws(found.flaws)}
    if isinstance(found, dp.SlaveDiagnosis):
        blocks = [{"kind": each.kind, "data": each.data.hex()} for each in found.blocks]
        return {
            "flags": list(found.flags),
            "master": found.master,
            "ident": found.ident,
            "blocks": blocks,
        } | flaws
    if isinstance(found, dp.Parameters):
        return {
            "flags": list(found.flags), "watchdog_ms": found.watchdog_ms, "tsdr": found.tsdr,
            "ident": found.ident, "groups": found.groups, "user": found.user.hex(), **flaws,
        }  # fmt: skip
    if isinstance(found, dp.Configuration):
        modules = [_module_document(*each) for each in zip(found.modules, found.roles, strict=True)]
        return {
            "ppo": found.ppo, "pkw_consistent": found.pkw_consistent, "input_length": found.input_length,
            "output_length": found.output_length, "modules": modules, **flaws,
        }  # fmt: skip
    if isinstance(found, dp.Control):
        return {"flags": list(found.flags), "groups": found.groups} | flaws
    side = "outputs" if found.outputs else "inputs"
    return {side: found.data.hex(), "wants_diagnosis": found.wants_diagnosis} | flaws


def _module_document(module: dp.Module, role: str | None) -> dict[str, Any]:
    return {
        "data": module.data.hex(), "special": module.special, "inputs": _area_document(module.inputs),
        "outputs": _area_document(module.outputs), "maker": module.maker.hex(), "role": role,
    }  # fmt: skip


def _area_document(area: dp.ModuleArea | None) -> dict[str, Any] | None:
    if area is None:
        return None
    return {"length": area.length, "words": area.words, "consistent": area.consistent}


def _ms1_document(found: ms1.Ms1Message | None, item: Telegram) -> dict[str, Any] | None:
    if found is None:
        return None
    code = found.code
    return {
        "kind": found.kind,
        "function": None if code is None else profibus.function_text(code, bool(item.request)),
        "slot": found.slot, "index": found.index, "length": found.length, "data": found.data.hex(),
        "error_decode": found.error_decode, "error_code_1": found.error_code_1,
        "error_code_2": found.error_code_2,
        "status": None if found.status is None else status_text(found.status),
        "not_ready": found.not_ready, "flaws": _flaws(found.flaws),
    }  # fmt: skip


# In words


def headline(item: Telegram) -> Both:
    """`SD2, frame with data`, or that no frame begins so."""
    row = profibus.codes("start").get(item.data[0]) if item.data else None
    if row is None:
        return say("dp_no_frame")
    return Both.same(f"{row.id}").joined(Both.of(row.text), ", ", "，")


def lines(item: Telegram) -> Iterator[Line]:
    """A frame in words, field by field, with its data if DP and MS1 know it."""
    yield 0, _start(item)
    if item.fc is None:
        if item.kind == SD4 and None not in (item.da, item.sa):
            yield 1, say("dp_token", sa=str(item.sa), da=str(item.da))
        return
    head = _head(item)
    to = say("dp_all") if item.da == 127 else Both.same(str(item.da))
    yield head, say("dp_stations", sa=str(item.sa), da=to)
    yield head + 2, Both.of(profibus.control_text, item.fc)
    at, name = head + 3, dp.service(item)
    known = say("dp_service_unknown") if name is None else Both.of(profibus.service_text, name)
    if item.front.dae or item.front.sae:
        saps = {"dsap": _sap(item.dsap), "ssap": _sap(item.ssap), "service": known}
        yield at, say("dp_saps", **saps)
    at = _data_start(item)
    if item.du:
        message = record(item)
        rows = _ms1_lines(message, item) if message else _dp_lines(dp.decode(item), item.du)
        yield from ((at + offset, text) for offset, text in rows)
    at += len(item.du)
    if item.fcs is not None:
        yield at, say("dp_check")


def record_start(item: Telegram) -> int:
    """Where the record of a message of MS1 begins."""
    return _data_start(item) + 4


def beside(item: Telegram) -> Iterator[Both]:
    """What is said about the frame as a whole: what it means, and what is wrong."""
    message, content = record(item), dp.decode(item)
    if item.kind == SC and not item.flaws:
        yield say("dp_taken")
    if message is not None and message.kind in (ms1.POLL, ms1.TAKEN):
        yield say(f"ms1_{message.kind}")
    if message is not None and message.not_ready:
        yield say("ms1_not_ready")
    if isinstance(content, dp.DataExchange) and content.wants_diagnosis:
        yield say("dp_wants_diagnosis")
    if isinstance(content, dp.Configuration):
        yield from _ppo(content)
    start = _data_start(item)
    for found in item.flaws:
        yield say("dp_flaw", offset=str(found.offset), text=flaw(found))
    for each in (message, content):
        for found in each.flaws if each else ():
            yield say("dp_flaw", offset=str(start + found.offset), text=flaw(found))


def _start(item: Telegram) -> Both:
    """The first bytes that say something."""
    if not item.kind:
        return say("decode_rest")
    if item.kind == SD2 and item.fc is not None:
        return say("dp_start_length", le=str(item.data[1]))
    return say("dp_start")


def _head(item: Telegram) -> int:
    """Where the addresses begin."""
    return 4 if item.kind == SD2 else 1


def _data_start(item: Telegram) -> int:
    return _head(item) + 3 + len(item.front.dae) + len(item.front.sae)


def _sap(sap: int | None) -> str:
    return "-" if sap is None else str(sap)


def _ppo(found: dp.Configuration) -> Iterator[Both]:
    lengths = {"outputs": str(found.output_length), "inputs": str(found.input_length)}
    yield say("dp_ppo", ppo=str(found.ppo), **lengths) if found.ppo else say("dp_no_ppo", **lengths)
    if found.pkw_consistent is False:
        yield say("dp_pkw_torn")


def _ms1_lines(found: ms1.Ms1Message, item: Telegram) -> Iterator[Line]:
    """The head of a message; its data is the record, or not known here."""
    code = found.code or 0
    name = Both.of(profibus.function_text, code, bool(item.request))
    if found.kind == ms1.REFUSAL:
        status = found.status
        words = say("dp_cut_data") if status is None else Both.of(status_text, status)
        yield 0, name.joined(words, ": ", "：")
    elif code in (ms1.READ, ms1.WRITE) and found.length is not None:
        about = {"slot": str(found.slot), "index": str(found.index), "length": str(found.length)}
        yield 0, say("ms1_record", function=name, **about)
        if found.data:
            yield 4, say("ms1_data")
    else:
        yield 0, name


def _dp_lines(found: dp.Content | None, data: bytes) -> Iterator[Line]:
    if isinstance(found, dp.SlaveDiagnosis):
        yield from _diagnosis_lines(found)
    elif isinstance(found, dp.Parameters):
        yield from _parameter_lines(found)
    elif isinstance(found, dp.Configuration):
        at = 0
        for module, role in zip(found.modules, found.roles, strict=True):
            yield at, module_text(module, role)
            at += len(module.data)
    elif isinstance(found, dp.Control):
        yield 0, _flag_words("control", found.flags)
        if found.groups is not None:
            yield (
                1,
                say("dp_groups", bits=f"{found.groups:08b}")
                if found.groups
                else say("dp_all_groups"),
            )
    elif isinstance(found, dp.DataExchange):
        yield 0, say("dp_outputs" if found.outputs else "dp_inputs", n=len(data))
    else:
        yield 0, say("dp_data", n=len(data))


def _flag_words(table: str, ids: Sequence[str]) -> Both:
    found = [Both.of(row.text) for row in profibus.flags(table) if row.id in ids]
    return joined(found, "; ", "；") if found else say("dp_no_flag")


def _diagnosis_lines(found: dp.SlaveDiagnosis) -> Iterator[Line]:
    yield 0, _flag_words("diagnosis", found.flags)
    if found.ident is not None:
        master = (
            say("dp_no_master") if found.master is None else say("dp_master", sa=str(found.master))
        )
        yield 3, master
        yield 4, say("dp_ident", ident=f"{found.ident:04X}")
    at = 6
    for each in found.blocks:
        yield at, say("dp_block", kind=Both.of(profibus.codes("block")[each.kind].text))
        at += len(each.data)


def _parameter_lines(found: dp.Parameters) -> Iterator[Line]:
    yield 0, _flag_words("parameters", found.flags)
    if found.tsdr is None:
        return
    watchdog = found.watchdog_ms
    yield 1, say("dp_watchdog_off") if watchdog is None else say("dp_watchdog", ms=str(watchdog))
    yield 3, say("dp_tsdr", bits=str(found.tsdr))
    if found.ident is not None:
        yield 4, say("dp_ident", ident=f"{found.ident:04X}")
    if found.groups is not None:
        yield (
            6,
            say("dp_groups", bits=f"{found.groups:08b}") if found.groups else say("dp_no_groups"),
        )
    if found.user:
        yield 7, say("dp_user")


def module_text(module: dp.Module, role: str | None) -> Both:
    """`4 words in+out, consistent over whole length (PKW)`."""
    inputs, outputs = module.inputs, module.outputs
    if inputs is not None and inputs == outputs:
        own = _area_text(inputs, "dp_in_out")
    else:
        sides = ((outputs, "dp_out"), (inputs, "dp_in"))
        own = joined([_area_text(area, key) for area, key in sides if area is not None], "; ", "；")
    if module.empty:
        own = say("dp_empty_slot")
    if module.maker:
        own = own.joined(say("dp_maker", n=len(module.maker)), ", ", "，")
    return (
        own if role is None else own.joined(Both.same(role), " (", "（").joined(Both(")", "）"), "")
    )


def _area_text(area: dp.ModuleArea, side: str) -> Both:
    count = area.length // 2 if area.words else area.length
    unit = "dp_words" if area.words else "dp_bytes"
    whole = "dp_whole" if area.consistent else "dp_piecewise"
    return say(unit, n=count).joined(say(side)).joined(say(whole), ", ", "，")
