"""Whether the transactions of a report are what the frames show: bytes, frames, statuses, states, values, sums."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from math import inf
from typing import Any

from tests.audit import message, wire
from tests.audit.claims import means
from tests.audit.reading import NOT_READY, SHORT, Complaint, Deal, Reading, instant

ALWAYS = (0xB02E, 0xB02F)
OK = (None, 0)


def check(reading: Reading) -> Iterator[Complaint]:
    """All complaints about the transactions of one capture."""
    for deal in reading.deals:
        if deal.cyclic:
            continue
        for text in [*_bytes(deal, reading), *_state(deal, reading), *_times(deal, reading)]:
            yield Complaint("transaction", f"#{deal.id}", text)
        for text in _values(deal):
            yield Complaint("transaction", f"#{deal.id}", text)
    for text in _all_of_them(reading):
        yield Complaint("transaction", "", text)
    for text in _summary(reading):
        yield Complaint("summary", "", text)


def _bytes(deal: Deal, reading: Reading) -> Iterator[str]:
    if deal.write is not None:
        yield from _asked(deal, deal.write, reading)
    if deal.read is not None:
        yield from _answered(deal, deal.read, reading)
    for pair in deal.polls:
        answers = reading.answered_at.get(pair["response"] or 0, [])
        if not any(each.status in (NOT_READY, SHORT) for each in answers) and answers:
            yield f"frame {pair['response']} is no poll"
    for pair in deal.rereads:
        answers = reading.answered_at.get(pair["response"] or 0, [])
        if deal.answer is None or not any(each.data == deal.answer.data for each in answers):
            yield f"frame {pair['response']} does not bring the response once more"


def _asked(deal: Deal, number: int, reading: Reading) -> Iterator[str]:
    asked = [each for each in reading.asked_at.get(number, []) if each.write]
    own = [each for each in asked if reading.same_place(deal, each)]
    frame = reading.capture.frame(number)
    if not own and frame is not None and frame.cut:
        return
    if not own:
        yield f"no Write on its channel is in frame {number}"
    elif deal.asked and not any(each.data == deal.asked.data for each in own):
        yield f"request {deal.asked.data.hex()} is {own[0].data.hex()}"
    else:
        yield from _write_answer(deal, own, reading)


def _answered(deal: Deal, number: int, reading: Reading) -> Iterator[str]:
    reads = [each for each in reading.answered_at.get(number, []) if not each.write]
    reads = [each for each in reads if reading.same_place(deal, each) or each.implicit]
    if not reads and number in reading.stray_at and deal.frames["read_request"] is None:
        return
    if not reads:
        yield f"no Read on its channel is answered in frame {number}"
        return
    data = deal.answer.data if deal.answer else b""
    if not any(each.data == data for each in reads):
        yield f"response {data.hex()} is {reads[0].data.hex()}"
    if not any(each.status == deal.read_status for each in reads):
        yield f"read status {deal.read_status} is {reads[0].status}"
    asked = [each.asked or None for each in reads]
    late = any(each.asked > number for each in reads)  # then it may not be told any more
    if deal.frames["read_request"] not in [*asked, *[None][:late]]:
        yield f"the Read request is in frame {reads[0].asked}"


def _write_answer(deal: Deal, own: list[wire.Record], reading: Reading) -> Iterator[str]:
    frames, told = [each.answered for each in own], deal.frames["write_response"]
    # Out of order, a Release may stand before the response, and ends the transaction.
    over = min(reading.ends(deal), default=inf) < max(frame or 0 for frame in frames)
    # Behind a later call of a client that waits as a rule, a refusal may be a second answer (docs/pairing.md, P81).
    read = next(iter(deal.polls), {"request": deal.frames["read_request"]})["request"]
    second = read is not None and any(
        each.status and each.answered > read for each in own if each.answered
    )
    if told not in frames and not (told is None and (over or second)):
        yield f"the Write response is in frame {frames[0]}, not in {told}"
    if told is not None and deal.write_status not in [each.status for each in own]:
        yield f"write status {deal.write_status} is {own[0].status}"


def state(deal: Deal, reading: Reading) -> tuple[str, ...]:
    """The states that are true of a transaction."""
    asked, answer = deal.asked, deal.answer
    if deal.write is None:
        return ("orphan",)
    answered = reading.by_frame.get(deal.frames["write_response"] or 0, [])
    fault = any(each.kind in (wire.FAULT, wire.REJECT) for each in answered)
    if deal.write_status or (deal.read_status not in OK) or fault:
        return ("refused",)
    if "DS110" in deal.plain["findings"] and (answer is None or (deal.short and answer.id is None)):
        return ("incomplete",)
    if answer is None or asked is None:
        return ("superseded",) if _displaced(deal, reading) else ("unanswered",)
    if not deal.fits:
        return ("mismatch",)
    if answer.id == 0x80:
        return ("error",)
    if answer.changes:
        return ("ok",)  # every change was done, also where the end of the header is missing
    return _outcome(deal, asked, answer, reading)


def _outcome(
    deal: Deal, asked: message.Message, answer: message.Message, reading: Reading
) -> tuple[str, ...]:
    """By the parameters asked for that are there whole: what the header announces beyond them is no parameter."""
    done = sum(
        not block.failed and len(block.raw) == block.size * block.count for block in answer.blocks
    )
    if answer.unknown is not None:
        return ("partial", "error", "ok")
    if deal.short and answer.missing:
        return _as_far_as_there(deal, answer, done)
    request = reading.capture.frame(deal.write or 0)
    if not deal.parameters_asked and request is not None and request.cut:
        return ("ok", "partial", "error")  # how many were asked for is not known
    if done == deal.parameters_asked:
        return ("error",) if (answer.id or 0) & 0x80 else ("ok",)
    return ("partial",) if done else ("error",)


def _as_far_as_there(deal: Deal, answer: message.Message, done: int) -> tuple[str, ...]:
    """By what the capture left of a response: where nothing shows what became of the others, nobody knows it."""
    failed = sum(block.failed for block in answer.blocks)
    fewer = answer.count is not None and answer.count < deal.parameters_asked
    if not failed and not fewer and not (answer.id or 0) & 0x80:
        return ("ok",)
    if done:
        return ("partial",)
    sure = deal.parameters_asked == 1 or 0 < deal.parameters_asked == failed
    return ("error",) if sure else ("incomplete",)


def _displaced(deal: Deal, reading: Reading) -> bool:
    """Whether a later Write was accepted; one without a response is, when a Read brings its record."""
    if deal.write_status is None and not deal.polls:
        return False  # nobody knows that it was accepted
    end = min((frame for frame in reading.ends(deal)), default=10**9)
    return any(
        each.write and not each.nested and (deal.write or 0) < each.asked < end
        and (each.status == 0 or (not each.status and (*deal.channel, each.asked) in reading.asked_and_answered))
        for each in reading.on_channel.get(deal.channel, [])
    )  # fmt: skip


def _state(deal: Deal, reading: Reading) -> Iterator[str]:
    true = state(deal, reading)
    if deal.state not in true:
        yield f"state {deal.state} is {' or '.join(true)}"
    words = {1: "read", 2: "change"}
    found = deal.asked.id if deal.asked else None
    if found in words and deal.operation != words[found]:
        yield f"operation {deal.operation} is {words[found]}"


def _times(deal: Deal, reading: Reading) -> Iterator[str]:
    asked = reading.time(deal.write) or 0
    early = [
        frame for frame in deal.all_frames
        if frame < (deal.write or 0) and (reading.time(frame) or 0) < asked
    ]  # fmt: skip
    if early:
        yield f"frame {early[0]} is one of its frames, and the request came in frame {deal.write}"
        return
    begin, end = reading.time(deal.write), reading.time(deal.read)
    got = deal.answer is not None and begin is not None and end is not None
    truth = (end - begin) / 1e6 if got and end is not None and begin is not None else None
    told = deal.duration_ms
    if (told is None) is not (truth is None) or (
        told is not None and truth is not None and abs(told - truth) > 1e-6
    ):
        yield f"duration {told} ms is {truth}"
    first = [deal.write] if deal.write is not None else deal.all_frames[:2]
    if instant(deal.plain["start"]) not in [reading.time(frame) for frame in first]:
        yield f"start {deal.plain['start']} is not the time of frame {first[0]}"


def _values(deal: Deal) -> Iterator[str]:
    asked, answer = deal.asked, deal.answer
    if asked is None or deal.state in ("mismatch", "orphan", "refused"):
        return
    blocks = asked.blocks if asked.changes else answer.blocks if answer else []
    for number, told in enumerate(deal.parameters):
        if number >= len(asked.addresses):
            yield f"parameter {number} was not asked for"
            continue
        address = asked.addresses[number]
        truth: dict[str, Any] = {"pnu": address.pnu, "subindex": address.subindex}
        truth["element_count"] = address.elements
        for name, value in truth.items():
            if told[name] != value:
                yield f"{name} {told[name]} of parameter {number} is {value}"
        failed = answer.blocks[number] if answer and number < len(answer.blocks) else None
        yield from _error(number, told["error"], failed)
        if number < len(blocks) and not blocks[number].failed:
            yield from _block(number, told, blocks[number])


def _error(number: int, told: dict[str, Any] | None, block: message.Block | None) -> Iterator[str]:
    failed = block is not None and block.failed
    if failed is not (told is not None):
        yield f"error of parameter {number} is {block.words if block else None}"
    elif (
        told is not None
        and block is not None
        and (told["code"], told["info"]) != (block.code, block.info)
    ):
        yield f"error {told['code']}, {told['info']} of parameter {number} is {block.words}"


def _block(number: int, told: dict[str, Any], block: message.Block) -> Iterator[str]:
    code = message.NAMES.get(told["format"] or "")
    if code not in (None, block.format, block.format + 0x50):
        yield f"format {told['format']} of parameter {number} is 0x{block.format:02X}"
    if block.format in message.STRINGS and len(block.raw) < block.count and told["values"]:
        yield f"value {told['values']} of parameter {number} is a part of a string"
    if told["value_count"] not in (None, block.count) and block.raw:
        yield f"{told['value_count']} values of parameter {number} are {block.count}"
    if block.format not in message.LETTERS or len(block.elements()) != len(told["values"]):
        return
    for value, bits in zip(told["values"], block.elements(), strict=True):
        if not means(value, bits, block.format):
            yield f"value {value} of parameter {number} is {bits.hex()}"


def _all_of_them(reading: Reading) -> Iterator[str]:
    """Each Write on an index that always is the parameter channel is one transaction."""
    told = Counter(each.write for each in reading.deals if each.index in ALWAYS)
    true = Counter(
        each.asked for each in reading.capture.records
        if each.write and each.index in ALWAYS and not each.nested and each.asked
    )  # fmt: skip
    for frame, count in true.items():
        if told[frame] != count:
            yield f"{count} Writes of frame {frame} are {told[frame]} transactions"


def _summary(reading: Reading) -> Iterator[str]:
    told, true = reading.plain["summary"], Counter(each.state for each in reading.deals)
    true += Counter(each.operation for each in reading.deals)
    true["transactions"] = len(reading.deals)
    for key in {*told, *true} - {"transactions"} | ({"transactions"} & {*told}):
        if told.get(key, 0) != true[key]:
            yield f"{told.get(key, 0)} {key} are {true[key]}"
    if reading.plain["frames"] != len(reading.capture.frames):
        yield f"{reading.plain['frames']} frames are {len(reading.capture.frames)}"
