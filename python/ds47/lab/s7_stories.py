"""What an application note draws of S7 communication: two figures on consistency, and an example of USEND.

They are captures. Each rule by itself is a scene of the tests.
"""

from __future__ import annotations

from ds47.lab import s7_wire
from ds47.lab.client import Client
from ds47.lab.s7 import Cpu, Link
from ds47.lab.s7_wire import db
from ds47.lab.scenario import Book

BOOK = Book("s7")


def cpu(client: Client, block: int) -> Link:
    """A connection to a CPU that says how many bytes it handles consistently."""
    link = Cpu(client.stage).link().open()
    return link.szl(0x0131, 3, s7_wire.consistent(block))


@BOOK.scene("Figure 1: the block of the passive CPU has 8 bytes, and GET reads 32", "get ok, DS903")
def figure_1(client: Client) -> None:
    """Inconsistent GET: 32 bytes of a CPU with blocks of 8."""
    cpu(client, 8).get(db(10, 0, 32)).close()


@BOOK.scene(
    "Figure 2: the block of the passive CPU has 32 bytes, and PUT writes 64", "put ok, DS903"
)
def figure_2(client: Client) -> None:
    """Inconsistent PUT: 64 bytes to a CPU with blocks of 32."""
    cpu(client, 32).put((db(20, 0, 64), bytes(range(64)))).close()


@BOOK.scene("Near figures 1 and 2: GET and PUT of 32 bytes, which are one block", "get ok, put ok")
def within_a_block(client: Client) -> None:
    """GET and PUT that fill the block of the CPU."""
    link = cpu(client, 32).get(db(10, 0, 32))
    link.put((db(20, 0, 32), bytes(range(32)))).close()


@BOOK.scene("R_ID 0: MB100 to MB109 are 16#02 and arrive, then 16#03 the other way", "2 usend ok")
def usend_as_printed(client: Client) -> None:
    """USEND of ten bytes, and ten bytes back."""
    link = Cpu(client.stage).link().open()
    link.usend(0, b"\x02" * 10).usend(0, b"\x03" * 10, from_client=False).close()
