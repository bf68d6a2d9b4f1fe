"""What is wrong with S7 communication (DS901 to DS917): each rule once with all it says, and what is near it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from ds47.analysis import AnalysisOptions, analyze
from ds47.findings.remark import Remark
from ds47.report.sentences import words
from ds47.s7.blocks import Blocks
from ds47.s7.judge import S7Judge
from ds47.s7.model import (
    BSEND,
    DONE,
    ERROR,
    GET,
    INCOMPLETE,
    OK,
    ORPHAN,
    PARTIAL,
    PUT,
    REFUSED,
    UNANSWERED,
    USEND,
    At,
    BsendSegment,
    End,
    S7Address,
    S7Connection,
    S7Item,
    S7Job,
    SzlEvidence,
)
from ds47.spec import rules, s7
from ds47.spec.semantics import limits
from ds47.spec.words import Flaw

PUBLIC = Path(__file__).resolve().parents[3] / "shared" / "captures" / "s7"
CLIENT, SERVER = End("10.0.0.1", 50_000), End("10.0.0.2", 102)
ENDS = {"device": "10.0.0.2", "controller": "10.0.0.1"}
R_ID = 0x1234


def db(start: int, size: int) -> S7Address:
    return S7Address(0x84, 1, 8 * start, 8, size)


class Line:
    """A connection, what goes past there, and what the judge says of it."""

    def __init__(
        self,
        blocks: dict[str, int] | None = None,
        kinds: dict[str, str] | None = None,
        *,
        pdu: int | None = 480,
        readback: bool = False,
    ) -> None:
        self.said: list[Remark] = []
        self.judge = S7Judge(
            limits(), self.said.append, Blocks(blocks or {}, kinds or {}, 8), readback
        )
        self.frame = 0
        self.connection = S7Connection(1, CLIENT, SERVER, self.at(), self.at(), True)
        self.judge.opened(self.connection)
        if pdu is not None:
            self.connection.pdu_length, self.connection.parallel = pdu, 1
            self.connection.setup = self.at()
            self.judge.agreed(self.connection)

    def at(self) -> At:
        self.frame += 1
        return At(self.frame, 1_000_000 * self.frame)

    def ask(
        self, operation: str, *items: S7Address | tuple[S7Address, bytes], from_client: bool = True
    ) -> S7Job:
        there = [S7Item(each) if isinstance(each, S7Address) else S7Item(*each) for each in items]
        job = S7Job(operation, self.connection, from_client, self.frame, self.at(), there)
        self.judge.asked(job)
        return job

    def answer(self, job: S7Job, *codes: int, error: int = 0) -> S7Job:
        job.answered, job.error = self.at(), error
        for item, code in zip(job.items, codes or [DONE] * len(job.items), strict=False):
            item.code = None if error else code
            if job.operation == GET and item.code == DONE and item.address and item.value is None:
                item.value = bytes(item.address.length)
        good = sum(each.code == DONE for each in job.items)
        job.state = (
            REFUSED if error else OK if good == len(job.items) else PARTIAL if good else ERROR
        )
        return self.over(job)

    def over(self, job: S7Job) -> S7Job:
        self.judge.over(job)
        job.phase = "closed"
        return job

    def do(self, operation: str, *items: S7Address | tuple[S7Address, bytes]) -> S7Job:
        return self.answer(self.ask(operation, *items))

    def bsend(
        self,
        sizes: Sequence[int],
        *,
        total: int | None = None,
        last: bool = True,
        silent: Sequence[int] = (),
        sequences: Sequence[int] = (),
        state: str = OK,
        lost: bool = False,
    ) -> S7Job:
        """A whole BSEND; `silent` are the segments that are not acknowledged."""
        announced = sum(sizes) if total is None else total
        job = S7Job(BSEND, self.connection, True, 7, self.at(), [], r_id=R_ID, total=announced)
        job.lost = lost
        self.judge.asked(job)
        for number, size in enumerate(sizes):
            at = self.at() if number else job.asked
            assert at is not None
            sequence = sequences[number] if sequences else 5 if number else 0
            part = BsendSegment(at, size, number, sequence, last and number == len(sizes) - 1)
            if number not in silent:
                part.acknowledged, part.assigned, part.error = self.at(), 5, 0
            job.segments.append(part)
        job.state = state
        return self.over(job)

    def usend(self, *sizes: int, r_id: int = R_ID, from_client: bool = True) -> S7Job:
        items = [S7Item(None, bytes(size)) for size in sizes]
        job = S7Job(USEND, self.connection, from_client, 7, self.at(), items, r_id=r_id, state=OK)
        self.judge.asked(job)
        return self.over(job)

    def found(self) -> list[Remark]:
        self.judge.closed(self.connection)
        return [*self.said, *self.judge.finish()]

    def one(self, rule: str) -> Remark:
        """The only finding, which is of this rule and can be worded in both languages."""
        (remark,) = self.found()
        assert remark.rule == rule
        row = rules()[rule]
        assert set(remark.args) <= set(row.args)
        for lang in ("en", "zh"):
            assert "?" not in words(rule, row.carried(remark.args), lang)
        return remark

    def told(self, rule: str) -> dict[str, Any]:
        """What it says, apart from who."""
        args = self.one(rule).args
        assert {key: args[key] for key in ENDS if key in args}.items() <= ENDS.items()
        return {key: value for key, value in args.items() if key not in ENDS}

    def rules(self) -> list[str]:
        return [each.rule for each in self.found()]


# Jobs


def test_a_job_without_an_answer() -> None:
    line = Line()
    job = line.ask(GET, db(0, 4), S7Address(0x83, 0, 800, 1, 1, 1))
    line.over(job)
    remark = line.one("DS901")
    assert job.asked is not None
    assert (remark.job, remark.frame) == (job, job.asked.frame)
    assert remark.args == {**ENDS, "operation": "GET", "area": "DB1.DBB0..3, M100.0"}


@pytest.mark.parametrize("state", [INCOMPLETE, ORPHAN])
def test_an_answer_that_may_be_there(state: str) -> None:
    line = Line()
    job = line.ask(GET, db(0, 4))
    job.state = state
    line.over(job)
    assert line.rules() == (["DS725"] if state == INCOMPLETE else [])


def test_items_are_refused() -> None:
    line = Line()
    job = line.ask(GET, *(db(start, 4) for start in (0, 10, 20, 30)))
    line.answer(job, DONE, 0x0A, 5, 0x0A)
    assert job.answered is not None
    told = line.found()
    assert [(each.rule, each.frame, each.args["area"], each.args["code"]) for each in told] == [
        ("DS908", job.answered.frame, "DB1.DBB10..13, DB1.DBB30..33", 0x0A),
        ("DS908", job.answered.frame, "DB1.DBB20..23", 5),
    ]  # fmt: skip
    assert "object does not exist" in words("DS908", told[0].args)
    assert "地址超出范围" in words("DS908", told[1].args, "zh")


def test_items_without_a_result_say_so() -> None:
    line = Line()
    job = line.answer(line.ask(PUT, (db(0, 1), b"\1"), (db(4, 1), b"\2"), (db(8, 1), b"\3")), DONE)
    remark = line.one("DS918")
    assert (remark.job, remark.args["area"]) == (job, "DB1.DBB4, DB1.DBB8")
    assert words("DS918", remark.args).startswith(
        "The answer of 10.0.0.2 to a PUT has no result for 2 of 3"
    )


def test_what_an_answer_refuses_is_told_without_its_job() -> None:
    line = Line()
    items = [S7Item(None, None, code) for code in (DONE, 3, 3)]
    line.over(S7Job(PUT, line.connection, True, 9, None, items, answered=At(7, 7), state=ORPHAN))
    remark = line.one("DS908")
    assert (remark.frame, remark.args["code"]) == (7, 3)
    assert words("DS908", remark.args).startswith("PUT 2 x unknown address refused by ")
    assert "2 个未知地址" in words("DS908", remark.args, "zh")


def test_a_job_is_refused() -> None:
    line = Line()
    job = line.answer(line.ask(PUT, (db(0, 1), b"\1")), error=0x8104)
    remark = line.one("DS909")
    assert (remark.job, remark.args["code"], remark.args["operation"]) == (job, 0x8104, "PUT")
    assert "(8104)" in words("DS909", remark.args)


ITEMS = "; the answer would need 251 bytes, the PDU has 240: one job has room for 16 of the items"


@pytest.mark.parametrize(
    ("operation", "sizes", "said"),
    [
        (GET, [3000], "; the answer would need 3018 bytes, the PDU has 240: 222 bytes fit in one job, so 14 jobs"),
        (GET, [9] * 17, ITEMS),
        (GET, [222], ""),
        (PUT, [300], "; the request needs 328 bytes, the PDU has 240: 212 bytes fit in one job, so 2 jobs"),
        (PUT, [99, 99], "; the request needs 243 bytes, the PDU has 240: one job has room for 1 of the items"),
    ],
)  # fmt: skip
def test_what_is_too_long_for_a_pdu_is_summed_up(
    operation: str, sizes: list[int], said: str
) -> None:
    """Each item of odd length has a fill byte but the last one."""
    line = Line(pdu=240)
    items = [(db(0, size), bytes(size)) for size in sizes]
    line.answer(line.ask(operation, *items), error=0x8500)
    sentence = words("DS909", line.one("DS909").args)
    assert sentence.endswith(f"(8500){said}")


def test_several_items_are_one_note_of_a_connection() -> None:
    line = Line()
    jobs = [line.do(GET, db(0, 1), db(4, 1)) for _ in range(3)]
    line.do(GET, db(0, 8))
    frames = [each.asked.frame for each in jobs if each.asked]
    assert line.told("DS906") == {"count": 3, "frames": frames}


# Blocks


def test_figure_1_of_the_seed() -> None:
    """The passive CPU copies 8 bytes at once, and 32 are read."""
    line = Line({"": 8})
    job = line.do(GET, db(0, 32))
    line.do(GET, db(0, 8))
    assert job.asked is not None
    assert job.answered is not None
    assert line.told("DS903") == {
        "operation": "GET", "area": "DB1.DBB0..31", "bytes": 32, "block": 8, "case": "block_chosen",
        "frame": None, "name": None, "count": 1, "frames": [job.asked.frame, job.answered.frame],
    }  # fmt: skip


def test_figure_2_of_the_seed() -> None:
    """It copies 32 bytes at once, and 64 are written."""
    line = Line(kinds={"10.0.0.2": "s7-400"})
    line.do(PUT, (db(0, 64), bytes(64)))
    line.do(PUT, (db(0, 32), bytes(32)))
    told = line.told("DS903")
    assert (told["operation"], told["bytes"], told["block"]) == ("PUT", 64, 32)
    assert (told["case"], told["name"]) == ("block_kind", "s7-400")


@pytest.mark.parametrize(
    ("name", "value", "case", "block"),
    [
        ("consistent", 240, "block_said", 240),
        ("order_number", "6ES7 315-2EH14-0AB0", "block_order", 240),
        ("order_number", "6ES7 416-3XL00-0AB0", "block_order", 32),
        ("order_number", "6ES7 414-3XM05-0AB0", "block_order", 462),
        ("order_number", "6ES7  317-2EK14-0AB0", "block_order", 160),
        ("order_number", "6ES7 211-1AE40-0XB0", None, None),
        ("module", "CPU 315-2 PN/DP", None, None),
    ],
)
def test_what_a_cpu_says_of_itself(
    name: str, value: int | str, case: str | None, block: int | None
) -> None:
    line = Line(pdu=960)
    at = line.at()
    line.judge.evidence(line.connection, SzlEvidence(at, 0x0131, 3, name, value))
    line.do(GET, db(0, 500))
    if case is None:
        assert line.rules() == []
        return
    told = line.told("DS903")
    assert (told["case"], told["block"], told["frame"]) == (case, block, at.frame)


def test_the_user_knows_more_than_the_cpu_says_and_the_larger_block_counts() -> None:
    found = SzlEvidence(At(5, 0), 0x0131, 3, "consistent", 240)
    order = SzlEvidence(At(6, 0), 0x0011, 1, "order_number", "6ES7 317-2EK14-0AB0")
    blocks = Blocks({"10.0.0.3": 8}, {"": "s7-400"}, 8)
    assert [getattr(blocks.of(ip), "size", None) for ip in ("10.0.0.2", "10.0.0.3")] == [32, 8]
    blocks = Blocks({}, {}, 1)
    assert blocks.of("10.0.0.2") is None
    for each in (order, found, order):
        blocks.evidence("10.0.0.2", each)
    blocks.evidence("10.0.0.3", found)
    told = blocks.of("10.0.0.2")
    assert told is not None
    assert (told.size, told.frame) == (240, 5)
    assert blocks.of("10.0.0.3") is None, "there is room for one"


@pytest.mark.parametrize("how", ["unknown", "refused", "timer", "one byte less"])
def test_nothing_is_larger_than_a_block(how: str) -> None:
    line = Line({} if how == "unknown" else {"": 32})
    if how == "timer":
        line.do(GET, S7Address(0x1D, 0, 0, 16, 100, 0x1D))
    elif how == "refused":
        line.answer(line.ask(GET, db(0, 33)), 5)
    else:
        line.do(GET, db(0, 32 if how == "one byte less" else 400))
    assert set(line.rules()) <= {"DS908"}


def test_every_kind_of_cpu_that_an_order_number_means_is_known() -> None:
    assert {row.cpu for row in s7.orders()} <= set(s7.cpus())
    for row in s7.orders():
        found = s7.cpu_of_order(row.number.replace("?", "1") + "1-0AB0")
        assert found is not None


# PDUs and jobs in flight


def test_a_pdu_is_longer_than_agreed() -> None:
    line = Line()
    for size in (500, 900, 600):
        line.judge.larger(line.connection, True, line.at(), size)
    remark = line.one("DS902")
    assert line.connection.setup is not None
    assert remark.args == {
        "device": "10.0.0.2", "sender": "10.0.0.1", "size": 900, "agreed": 480,
        "frame": line.connection.setup.frame, "count": 3, "frames": [4, 5, 6],
    }  # fmt: skip
    assert remark.frame == remark.args["frames"][1]


def test_a_pdu_before_the_setup_has_no_limit() -> None:
    line = Line(pdu=None)
    line.judge.larger(line.connection, True, line.at(), 5000)
    assert line.rules() == []


def test_more_jobs_are_open_than_agreed() -> None:
    line = Line()
    jobs = [line.ask(GET, db(10 * n, 4)) for n in range(3)]
    for job in jobs:
        line.answer(job)
    remark = line.one("DS914")
    assert jobs[2].asked is not None
    assert (remark.frame, remark.args["most"], remark.args["agreed"]) == (jobs[2].asked.frame, 3, 1)


@pytest.mark.parametrize("how", ["agreed", "one answered before", "never answered", "lost"])
def test_jobs_may_be_open(how: str) -> None:
    line = Line()
    if how == "agreed":
        line.connection.parallel = 2
    first = line.ask(GET, db(0, 4))
    if how == "one answered before":
        line.answer(first)
    if how == "lost":
        line.connection.lost_bytes = 10
    second = line.ask(GET, db(20, 4))
    if how == "never answered":
        line.over(first)
    elif how != "one answered before":
        line.answer(first)
    line.answer(second)
    assert "DS914" not in line.rules()


# Connections


@pytest.mark.parametrize(
    ("why", "tsap", "text"),
    [
        ("no_confirm", b"\3\2", "CR to TSAP 03.02 (rack 0, slot 2) has no CC"),
        ("disconnect", b"\3\x21", "CR to TSAP 03.21 (rack 1, slot 1) is answered with DR"),
        ("reset", b"\3\2", "TCP is reset after the CR to TSAP 03.02 (rack 0, slot 2)"),
        ("reset", None, "TCP is reset"),
        ("setup", b"\3\2", "the setup is refused, PDU has a wrong length (8500)"),
    ],
)
def test_a_connection_is_refused(why: str, tsap: bytes | None, text: str) -> None:
    line = Line(pdu=None)
    line.connection.server_tsap = tsap
    for _ in range(2):
        line.judge.refused(line.connection, why, line.at(), 0x8500 if why == "setup" else 0)
    remark = line.one("DS917")
    assert (remark.frame, remark.args["count"], len(remark.args["frames"])) == (3, 2, 2)
    assert words("DS917", remark.args).endswith(f": {text}")


def test_the_setup_was_not_seen() -> None:
    line = Line(pdu=None)
    job = line.do(GET, db(0, 4))
    line.do(GET, db(4, 4))
    assert job.asked is not None
    assert line.told("DS915") == {"count": 1, "frames": [job.asked.frame]}


@pytest.mark.parametrize("jobs", [0, 1])
def test_the_setup_is_not_missing(jobs: int) -> None:
    line = Line(pdu=480 if jobs else None)
    for _ in range(jobs):
        line.do(GET, db(0, 4))
    assert line.rules() == []


# Between programs


@pytest.mark.parametrize(
    ("more", "case"),
    [
        ({"last": False, "total": 300, "state": UNANSWERED}, "bsend_open"),
        ({"total": 300, "state": PARTIAL}, "bsend_sum"),
        ({"sequences": (0, 5, 6)}, "bsend_sequence"),
    ],
)
def test_a_bsend_is_not_whole(more: dict[str, Any], case: str) -> None:
    line = Line()
    job = line.bsend((100, 100, 50), **more)
    told = line.told("DS910")
    assert job.asked is not None
    assert told == {
        "r_id": R_ID, "case": case, "total": job.total, "size": 250, "segments": 3,
        "first": job.asked.frame,
    }  # fmt: skip


def test_segments_are_not_acknowledged() -> None:
    line = Line()
    job = line.bsend((100, 100, 50), silent=(1, 2), state=UNANSWERED)
    frames = [each.at.frame for each in job.segments[1:]]
    assert line.told("DS911") == {"r_id": R_ID, "count": 2, "segments": 3, "frames": frames}


def test_a_bsend_is_whole() -> None:
    line = Line()
    line.bsend((100, 100, 50))
    line.bsend((100,))
    line.bsend((100, 100), last=False, lost=True, state=UNANSWERED)
    line.bsend((100, 100), silent=(0,), state=ORPHAN)
    assert line.rules() == []


def test_an_r_id_is_in_use() -> None:
    line = Line()
    first = S7Job(BSEND, line.connection, True, 7, line.at(), [], r_id=R_ID, total=9)
    second = S7Job(BSEND, line.connection, True, 8, line.at(), [], r_id=R_ID, total=9)
    other = S7Job(BSEND, line.connection, True, 8, line.at(), [], r_id=R_ID + 1, total=9)
    back = S7Job(BSEND, line.connection, False, 8, line.at(), [], r_id=R_ID, total=9)
    for job in (first, second, other, back):
        line.judge.asked(job)
    for job in (first, second):
        assert job.asked is not None
        job.segments.append(BsendSegment(job.asked, 4, 0, 0, False))
        line.over(job)
    remark = line.one("DS912")
    assert first.asked is not None
    assert (remark.job, remark.args["case"], remark.args["frame"]) == (
        second, "r_id_open", first.asked.frame,
    )  # fmt: skip


def test_a_bsend_is_refused() -> None:
    line = Line()
    job = S7Job(BSEND, line.connection, True, 7, line.at(), [], r_id=R_ID, total=9)
    line.judge.asked(job)
    assert job.asked is not None
    job.segments.append(
        BsendSegment(job.asked, 9, 0, 0, True, acknowledged=line.at(), error=0xD202)
    )
    job.state, job.error, job.answered = REFUSED, 0xD202, line.at()
    line.over(job)
    assert line.told("DS912") == {"r_id": R_ID, "case": "r_id_refused", "code": 0xD202}


def test_a_bsend_of_which_no_part_is_there_says_nothing() -> None:
    line = Line()
    line.over(S7Job(BSEND, line.connection, True, 7, line.at(), [], r_id=R_ID, state=REFUSED))
    assert line.rules() == []


def test_the_areas_of_a_usend_change() -> None:
    line = Line()
    first = line.usend(10)
    line.usend(10, from_client=False)
    line.usend(12, r_id=9)
    line.usend(12, from_client=False, r_id=9)
    second = line.usend(10, 2)
    line.usend(10, 2)
    assert first.asked is not None
    assert second.asked is not None
    remark = line.one("DS913")
    assert (remark.job, remark.frame) == (second, second.asked.frame)
    assert line.told("DS913") == {
        "r_id": R_ID, "before": [10], "now": [10, 2], "first": first.asked.frame
    }  # fmt: skip


def test_a_usend_that_cannot_be_read_has_no_areas() -> None:
    line = Line()
    line.usend(10)
    job = S7Job(USEND, line.connection, True, 7, line.at(), [], r_id=R_ID, state=OK)
    job.flaws = [Flaw("cut", 4, {"have": 4, "want": 12})]
    line.judge.asked(job)
    line.over(job)
    line.usend(10)
    assert [each.rule for each in line.found() if each.rule == "DS913"] == []


def test_the_r_ids_whose_areas_are_remembered_are_bounded() -> None:
    """Those of a connection that is over make room."""
    line, most = Line(), limits().s7_notes
    for r_id in range(most + 2):
        line.usend(10, r_id=r_id)
    for r_id in (0, most - 1, most, most + 1):
        line.usend(12, r_id=r_id)
    assert [each.args["r_id"] for each in line.found()] == [0, most - 1]
    line.usend(10, r_id=most)
    line.usend(12, r_id=most)
    assert [each.args["r_id"] for each in line.said] == [0, most - 1, most]


# What is read is what was written


@pytest.mark.parametrize("readback", [False, True])
def test_something_else_is_read_than_was_written(readback: bool) -> None:
    line = Line(readback=readback)
    write = line.do(PUT, (db(0, 4), b"\1\2\3\4"))
    job = line.ask(GET, db(2, 4))
    job.items[0].value = b"\3\5\0\0"
    line.answer(job)
    line.do(GET, db(0, 4))
    if not readback:
        assert line.rules() == []
        return
    assert write.asked is not None
    assert line.told("DS916") == {
        "byte": "DB1.DBB3",
        "written": 4,
        "read": 5,
        "by": write.asked.frame,
    }


@pytest.mark.parametrize("how", ["same", "refused", "another write", "at the same time"])
def test_what_was_written_is_read(how: str) -> None:
    line = Line(readback=True)
    line.connection.parallel = 9
    early = line.ask(GET, db(0, 2)) if how == "at the same time" else None
    write = line.ask(PUT, (db(0, 2), b"\1\2"))
    line.answer(write, 5 if how == "refused" else DONE)
    if how == "another write":
        line.do(PUT, (db(1, 1), b"\7"))
    job = early or line.ask(GET, db(0, 2))
    job.items[0].value = (
        b"\1\2" if how == "same" else b"\1\7" if how == "another write" else b"\0\0"
    )
    line.answer(job)
    assert "DS916" not in line.rules()


# All of it


def test_every_rule_is_said_here_or_in_test_s7_moments() -> None:
    text = "".join(
        (Path(__file__).parent / f"test_s7_{name}.py").read_text("utf-8")
        for name in ("judge", "moments", "drives")
    )
    assert [each for each in rules() if each.startswith("DS9") and f'"{each}"' not in text] == []


@pytest.mark.skipif(not PUBLIC.is_dir(), reason="public captures are beside the checkout only")
@pytest.mark.parametrize(
    "path", sorted(PUBLIC.glob("*.pcap*")) if PUBLIC.is_dir() else [], ids=lambda path: path.name
)
def test_nothing_is_mixed_or_split_in_captures_of_others(path: Path) -> None:
    """None of their clients splits an area, and WinCC's 32 + 4 bytes are within the room of one job."""
    found = analyze(path, AnalysisOptions(channels=("s7",))).findings
    lacks = (
        {"DS725"} if path.name.startswith("wincc_s300_setup") else set()
    )  # short segments are missing there
    assert {each.rule for each in found} - {"DS906", "DS908"} == lacks
