"""One end of an S7 connection: client, server or partner of the python-snap7 that this Python has.

Runs in the environments of `make oracles`: 3.x is a stack in Python, 2.x the C++ library Snap7. It takes a command
per line of stdin as JSON and answers it with a line of JSON: {"ok": ...}, or {"error": ...} with what the stack
says. Not here: what is done in which order (record.py), and any knowledge of the protocol.
"""

from __future__ import annotations

import ctypes
import json
import sys
import time
from importlib.metadata import version
from typing import Any

import snap7
from snap7.partner import Partner
from snap7.server import Server
from snap7.type import Area, Parameter, S7DataItem, SrvArea

CPP = version("python-snap7").startswith("2.")
PORT, SECONDS = 102, 10
AREAS = {"I": Area.PE, "Q": Area.PA, "M": Area.MK, "DB": Area.DB, "C": Area.CT, "T": Area.TM}
SHARED = {
    "I": SrvArea.PE, "Q": SrvArea.PA, "M": SrvArea.MK, "DB": SrvArea.DB, "C": SrvArea.CT, "T": SrvArea.TM,
}  # fmt: skip
WORDS = {"bit": 1, "byte": 2, "word": 4, "dword": 6, "real": 8, "C": 28, "T": 29}
SIZES = {"bit": 1, "byte": 1, "word": 2, "dword": 4, "real": 4, "C": 2, "T": 2}


def word_of(area: str, word: str) -> str:
    return area if area in ("C", "T") else word


class ServerEnd:
    """A server with areas of given content."""

    def __init__(self) -> None:
        self.server = Server(log=False)
        self.memory: list[Any] = []

    def serve(self, ip: str, areas: list[tuple[str, int, str]], clients: int | None = None) -> None:
        """Start on an address; areas are (name, number, bytes as hex), `clients` the most it takes at once."""
        if not CPP and clients:
            self.server = Server(log=False, max_clients=clients)
        if CPP and clients:
            self.server.set_param(Parameter.MaxClients, clients)
        for name, number, content in areas:
            data = bytearray.fromhex(content)
            block = (ctypes.c_uint8 * len(data)).from_buffer(data) if CPP else data
            self.memory.append(block)
            self.server.register_area(SHARED[name], number, block)
        self.server.start_to(ip, PORT)

    def stop(self) -> None:
        self.server.stop()


class PureClient:
    """The client of python-snap7 3.x, through its documented calls."""

    def __init__(self) -> None:
        self.client = snap7.Client()

    def connect(self, ip: str, rack: int, slot: int, pdu: int) -> int:
        self.client.pdu_length = pdu
        self.client.connect(ip, rack, slot, PORT)
        return self.client.pdu_length

    def disconnect(self) -> None:
        self.client.disconnect()

    def read(self, area: str, db: int, start: int, count: int, word: str) -> str:
        kind = snap7.type.WordLen(WORDS[word_of(area, word)])
        return bytes(self.client.read_area(AREAS[area], db, start, count, kind)).hex()

    def write(self, area: str, db: int, start: int, data: str, word: str) -> None:
        kind = snap7.type.WordLen(WORDS[word_of(area, word)])
        self.client.write_area(AREAS[area], db, start, bytearray.fromhex(data), kind)

    def read_many(self, items: list[tuple[str, int, int, int]]) -> list[str]:
        asked = [
            {"area": AREAS[area], "db_number": db, "start": start, "size": size}
            for area, db, start, size in items
        ]
        return [bytes(each).hex() for each in self.client.read_multi_vars(asked)[1]]

    def szl(self, number: int, index: int) -> int:
        return int(self.client.read_szl(number, index).Header.LengthDR)

    def cpu(self) -> str:
        return str(self.client.get_cpu_state())


class CppClient:
    """The client of the C++ library; a code that is not 0 is an error, with the library's text."""

    def __init__(self) -> None:
        self.client = snap7.client.Client()
        self.lib, self.handle = self.client._lib, self.client._s7_client

    def checked(self, code: int) -> None:
        if code:
            raise RuntimeError(f"{code:08x} {self.client.error_text(code)}")

    def connect(self, ip: str, rack: int, slot: int, pdu: int) -> int:
        self.client.set_param(Parameter.PDURequest, pdu)
        self.checked(self.lib.Cli_ConnectTo(self.handle, ip.encode(), rack, slot))
        return self.client.get_pdu_length()

    def disconnect(self) -> None:
        self.client.disconnect()

    def read(self, area: str, db: int, start: int, count: int, word: str) -> str:
        word = word_of(area, word)
        data = (ctypes.c_uint8 * (count * SIZES[word]))()
        self.checked(
            self.lib.Cli_ReadArea(
                self.handle, int(AREAS[area]), db, start, count, WORDS[word], ctypes.byref(data)
            )
        )
        return bytes(data).hex()

    def write(self, area: str, db: int, start: int, data: str, word: str) -> None:
        word, content = word_of(area, word), bytes.fromhex(data)
        block = (ctypes.c_uint8 * len(content)).from_buffer_copy(content)
        count = len(content) // SIZES[word]
        self.checked(
            self.lib.Cli_WriteArea(
                self.handle, int(AREAS[area]), db, start, count, WORDS[word], ctypes.byref(block)
            )
        )

    def many(self, items: list[tuple[str, int, int, bytes]]) -> tuple[Any, list[Any]]:
        blocks = [(ctypes.c_uint8 * len(data)).from_buffer_copy(data) for *_, data in items]
        table = (S7DataItem * len(items))()
        for row, (area, db, start, data), block in zip(table, items, blocks, strict=True):
            row.Area, row.WordLen, row.Result = int(AREAS[area]), WORDS["byte"], 0
            row.DBNumber, row.Start, row.Amount = db, start, len(data)
            row.pData = ctypes.cast(block, type(row.pData))
        return table, blocks

    def read_many(self, items: list[tuple[str, int, int, int]]) -> list[str]:
        table, blocks = self.many([(*rest, bytes(size)) for *rest, size in items])  # type: ignore[misc]
        self.checked(self.lib.Cli_ReadMultiVars(self.handle, ctypes.byref(table), len(table)))
        return [
            f"error {row.Result:08x}" if row.Result else bytes(block).hex()
            for row, block in zip(table, blocks, strict=True)
        ]

    def write_many(self, items: list[tuple[str, int, int, str]]) -> list[str]:
        table, _ = self.many([(*rest, bytes.fromhex(data)) for *rest, data in items])  # type: ignore[misc]
        self.checked(self.lib.Cli_WriteMultiVars(self.handle, ctypes.byref(table), len(table)))
        return [f"error {row.Result:08x}" if row.Result else "" for row in table]

    def szl(self, number: int, index: int) -> int:
        return int(self.client.read_szl(number, index).Header.LengthDR)

    def cpu(self) -> str:
        return str(self.client.get_cpu_state())


class PurePartner:
    """A partner of python-snap7 3.x."""

    def __init__(self) -> None:
        self.partner = Partner()

    def start(self, active: bool, local: str, remote: str, pdu: int | None = None) -> None:
        self.partner = Partner(active)
        self.partner.port, self.partner.pdu_length = PORT, pdu or self.partner.pdu_length
        self.partner.running = True  # its accepting thread looks at this before start_to sets it
        self.partner.start_to(local, remote, 0x1002, 0x1002)

    def linked(self) -> bool:
        return bool(self.partner.connected)

    def send(self, r_id: int, data: str) -> None:
        self.partner.r_id = r_id
        self.partner.set_send_data(bytes.fromhex(data))
        self.partner.b_send()

    def receive(self) -> dict[str, Any]:
        self.partner.b_recv()
        return {
            "r_id": self.partner.get_recv_r_id(),
            "data": (self.partner.get_recv_data() or b"").hex(),
        }

    def stop(self) -> None:
        self.partner.stop()


class CppPartner:
    """A partner of the C++ library: what the wrapper leaves out, R_ID and data, is called by ctypes."""

    def __init__(self) -> None:
        self.partner = Partner()
        self.lib, self.handle = self.partner._library, self.partner._pointer
        for name in ("Par_BSend", "Par_BRecv"):
            getattr(self.lib, name).argtypes = None

    def start(self, active: bool, local: str, remote: str, pdu: int | None = None) -> None:
        self.partner = Partner(active)
        self.handle = self.partner._pointer
        if pdu:
            self.partner.set_param(Parameter.PDURequest, pdu)
        self.partner.set_param(Parameter.BSendTimeout, 1000 * SECONDS)
        code = self.lib.Par_StartTo(self.handle, local.encode(), remote.encode(), 0x1002, 0x1002)
        if code:
            raise RuntimeError(f"{code:08x}")

    def linked(self) -> bool:
        return self.partner.get_status().value == 3  # par_linked

    def send(self, r_id: int, data: str) -> None:
        content = bytes.fromhex(data)
        code = self.lib.Par_BSend(self.handle, ctypes.c_uint32(r_id), content, len(content))
        if code:
            raise RuntimeError(f"{code & 0xFFFFFFFF:08x}")

    def receive(self) -> dict[str, Any]:
        r_id, size = ctypes.c_uint32(), ctypes.c_int32()
        buffer = (ctypes.c_uint8 * 65536)()
        code = self.lib.Par_BRecv(
            self.handle, ctypes.byref(r_id), buffer, ctypes.byref(size), 1000 * SECONDS
        )
        if code:
            raise RuntimeError(f"{code & 0xFFFFFFFF:08x}")
        return {"r_id": r_id.value, "data": bytes(buffer[: size.value]).hex()}

    def stop(self) -> None:
        self.partner.stop()


def linked_soon(partner: Any) -> None:
    end = time.monotonic() + SECONDS
    while not partner.linked():
        if time.monotonic() > end:
            raise RuntimeError("not connected")
        time.sleep(0.01)


ROLES = {
    "server": ServerEnd,
    "client": CppClient if CPP else PureClient,
    "partner": CppPartner if CPP else PurePartner,
}


def main() -> None:
    role = ROLES[sys.argv[1]]()
    for line in sys.stdin:
        command = json.loads(line)
        name = command.pop("do")
        try:
            call = linked_soon if name == "linked_soon" else getattr(role, name)
            answer = {"ok": call(role) if name == "linked_soon" else call(**command)}
        except Exception as error:  # noqa: BLE001  whatever a stack says goes into the log
            answer = {"error": f"{type(error).__name__}: {error}"}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
