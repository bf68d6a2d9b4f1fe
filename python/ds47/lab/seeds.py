"""Scenarios: the worked examples of the application notes that this project started from."""

from __future__ import annotations

from ds47.lab.client import Client
from ds47.lab.scenario import Book

BOOK = Book("seed")

DCM_READ = ("03010201 1001c47f0000", "03010201 0801 41200000")
DCM_CHANGE = ("02020201 1001c4800000 0801 42c80000", "02020201")
G120_READ = (
    "01010102 10000b540000 10040b560002",
    "01010102 0801 00000000 0804 41200000 41a00000 42480000 42c80000",
)
G120_CHANGE = (
    "01020102 10010b540000 10010b550000 0801 41300000 0801 41b00000",
    "01020102",
)


def _play(client: Client, *examples: tuple[str, str], buffer: int = 0) -> None:
    """Each example as a transaction; requests are filled with zeros up to `buffer` bytes."""
    client.order = ">"
    for request, response in examples:
        client.exchange(bytes.fromhex(request).ljust(buffer, b"\0"), bytes.fromhex(response))
        client.wait(100)


BOOK.scenes(
    _play,
    ("dcm-read", "SINAMICS DCM: read p50303", "one parameter, Float32 10.0, DO 2", "read ok", DCM_READ),
    ("dcm-change", "SINAMICS DCM: change p50304", "one parameter, Float32 100.0, DO 2",
     "change ok, DS721", DCM_CHANGE),
    ("g120-read", "G120: read P2900 and r2902[2..5]",
     "two parameters, one of them four elements of an array", "read ok", G120_READ),
    ("g120-change", "G120: change P2900 and P2901", "two parameters in one change", "change ok, DS721",
     G120_CHANGE),
    ("g120-constant-reference", "G120: read, then change, with the reference left as it is",
     "the two G120 programs one after the other, both with reference 1",
     "read ok, change ok, DS415 DS721", G120_READ, G120_CHANGE),
)  # fmt: skip


@BOOK.scene(
    "WRREC sends its whole buffer of 40 bytes: zeros behind a request of 16",
    "change ok, DS314 DS721",
)
def dcm_buffer(client: Client) -> None:
    """SINAMICS DCM: change p50304 from a buffer of 40 bytes."""
    _play(client, DCM_CHANGE, buffer=40)
