"""The layers themselves, and where scapy finds them. Importing this binds them.

Bytes are decoded and made by `ds47.profidrive`: here are names for scapy only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from scapy.contrib.pnio_rpc import IODReadRes, IODWriteReq
from scapy.fields import (
    ByteField,
    ConditionalField,
    Field,
    PacketListField,
    ShortField,
    StrField,
    XByteEnumField,
)
from scapy.layers.dcerpc import DceRpc, DceRpc4
from scapy.layers.inet import UDP
from scapy.packet import Packet, Raw, bind_bottom_up, bind_layers, bind_top_down

from ds47 import profidrive, spec
from ds47.profidrive.model import ERROR
from ds47.profidrive.naming import element
from ds47.spec.layouts import MESSAGE_SIZE

__all__ = ["DS47Address", "DS47Block", "DS47Request", "DS47Response"]

PNIO_PORT = 34964
INDEX_47, LOCAL, GLOBAL = 47, 0xB02E, 0xB02F
_ATTRIBUTES = {code: row.name for code, row in spec.attributes().items()}
_FORMATS = {code: row.name for code, row in spec.formats().items()} | {ERROR: "Error"}
_REQUESTS = {code: row.name for code, row in spec.request_ids().items()}
_RESPONSES = {code: row.name for code, row in spec.response_ids().items()}


class _ListField(Field):  # type: ignore[misc]
    """A Python list as it is; the bytes are the affair of the message."""

    islist = 1

    def any2i(self, pkt: Packet | None, x: Any) -> Any:  # noqa: ARG002
        if x is None or isinstance(x, list):
            return x
        return list(x) if isinstance(x, tuple | range | set) else [x]

    def i2repr(self, pkt: Packet | None, x: Any) -> str:  # noqa: ARG002
        return repr(x)

    def do_copy(self, x: Any) -> Any:
        return None if x is None else list(x)


class _Part(Packet):  # type: ignore[misc]
    """Something inside a message. A change of it must not leave the bytes that were received."""

    def setfieldval(self, attr: str, val: Any) -> None:
        super().setfieldval(attr, val)
        if isinstance(self.parent, _Message):
            self.parent.clear_cache()

    def extract_padding(self, s: bytes) -> tuple[bytes, bytes]:
        return b"", s


class DS47Address(_Part):
    """One parameter address of a request (docs/protocol.md A.1)."""

    name = "DS47 address"
    fields_desc = [  # noqa: RUF012
        XByteEnumField("attribute", 0x10, _ATTRIBUTES),
        ByteField("element_count", 1),
        ShortField("pnu", 0),
        ShortField("subindex", 0),
    ]

    def mysummary(self) -> str:
        """The address as it stands in a summary."""
        return element(self.pnu, self.subindex)


class DS47Block(_Part):
    """One value block (docs/protocol.md A.5 to A.7).

    `values` are the values, as in a report. A block of an error (`format` 0x44) has no values but
    `error_words`: the error number, and mostly further information. `raw` and `pad` are bytes to
    send as they are, whatever stands in `values`; a block that was received has them only where its
    bytes are not those that its values give.
    """

    name = "DS47 value block"
    fields_desc = [  # noqa: RUF012
        XByteEnumField("format", 0x08, _FORMATS),
        ByteField("value_count", None),
        _ListField("values", []),
        ConditionalField(_ListField("error_words", []), lambda block: block.format == ERROR),
        ConditionalField(StrField("raw", None), lambda block: "raw" in block.fields),
        ConditionalField(StrField("pad", None), lambda block: "pad" in block.fields),
    ]

    def self_build(self) -> bytes:
        """The bytes of the block. Raises ValueError like `block`."""
        block = self.block()
        return bytes((block.format, block.value_count)) + block.raw + block.pad

    def block(self) -> profidrive.Block:
        """The block of the codec. Raises ValueError for values that the format cannot carry."""
        made = _made(self.format, self.values, self.error_words or [], self.raw is not None)
        made.format = self.format
        if self.raw is not None:
            made.raw, made.pad = self.raw, bytes(len(self.raw) % 2)
        if self.pad is not None:
            made.pad = self.pad
        if self.value_count is not None:
            made.value_count = self.value_count
        return made

    @classmethod
    def of(cls, block: profidrive.Block, parent: Packet) -> DS47Block:
        """The layer of a decoded block."""
        words = block.error.words if block.error else []
        layer = cls(format=block.format, value_count=block.value_count, values=block.values,
                    error_words=words, _parent=parent)  # fmt: skip
        try:
            same = layer.block()
        except ValueError:
            same = None
        if same is None or (same.raw, same.pad) != (block.raw, block.pad):
            layer.fields |= {"raw": block.raw, "pad": block.pad}
        return layer


def _made(code: int, values: list[Any], words: list[int], raw: bool) -> profidrive.Block:
    """A block from values; one whose bytes are given needs no more than its header."""
    if raw:
        return profidrive.Block(code, len(values), [], None, None, b"")
    if code != ERROR:
        return profidrive.make_block(code, values)
    if not 1 <= len(words) <= 2:
        raise ValueError(f"an error block has one or two error_words, not {len(words)}: set raw")
    return profidrive.error_block(words[0], words[1] if len(words) == 2 else None)


class _Message(Packet):  # type: ignore[misc]
    """What requests and responses have in common: they are read and made by the codec."""

    decode: Callable[[bytes], Any]
    encode: Callable[[Any], bytes]

    def do_dissect(self, s: bytes) -> bytes:
        data = bytes(s)
        self._fill(self.decode(data))
        self.raw_packet_cache = data
        self.explicit = 1
        return b""

    def self_build(self) -> bytes:
        # Not from raw_packet_cache: what it is made of may have changed, and the same comes out.
        return self.encode(self.message())

    def message(self) -> Any:
        raise NotImplementedError

    def _fill(self, message: Any) -> None:
        for each in self.fields_desc[:4]:
            self.fields[each.name] = getattr(message, each.name)
        self.fields["blocks"] = [DS47Block.of(each, self) for each in message.blocks]
        self.fields["rest"] = message.rest

    def _blocks(self) -> list[profidrive.Block]:
        return [layer.block() for layer in self.blocks]


def _layer(cls: type[_Message], /, _pkt: bytes | None = None, **others: Any) -> type[Packet]:
    """Record 47 may hold anything: what has not the shape of such a message stays Raw."""
    if _pkt is None or not others.get("_internal"):
        return cls  # made by hand: it is what the caller says
    index = getattr(others.get("_underlayer"), "index", None)
    if len(_pkt) < MESSAGE_SIZE or (index == INDEX_47 and not cls.decode(_pkt).shaped):
        return Raw  # type: ignore[no-any-return]
    return cls


def _of_first(layers: str, name: str, about: str) -> property:
    """A field of the first address or block as one of the message."""

    def read(self: _Message) -> Any:
        parts = getattr(self, layers)
        return getattr(parts[0], name) if parts else None

    return property(read, doc=about)


class DS47Request(_Message):
    """A parameter request: the data of a Write record (docs/protocol.md A.1).

    `pnu`, `subindex`, `attribute` and `element_count` are those of the first address.
    `parameter_count` counts the addresses by itself. `rest` stands behind everything.
    """

    name = "DS47 request"
    decode = staticmethod(profidrive.decode_request)
    encode = staticmethod(profidrive.encode_request)
    dispatch_hook = classmethod(_layer)  # scapy looks for it in the class itself
    fields_desc = [  # noqa: RUF012
        ByteField("request_reference", 1),
        XByteEnumField("request_id", 1, _REQUESTS),
        ByteField("axis", 1),
        ByteField("parameter_count", None),
        PacketListField("addresses", [], DS47Address),
        PacketListField("blocks", [], DS47Block),
        StrField("rest", b""),
    ]

    def _fill(self, message: profidrive.Request) -> None:
        super()._fill(message)
        self.fields["addresses"] = [
            DS47Address(attribute=each.attribute, element_count=each.element_count, pnu=each.pnu,
                        subindex=each.subindex, _parent=self)
            for each in message.addresses
        ]  # fmt: skip

    def message(self) -> profidrive.Request:
        """The request of the codec. Raises ValueError for values that a format cannot carry."""
        addresses = [
            profidrive.Address(each.attribute, each.element_count, each.pnu, each.subindex)
            for each in self.addresses
        ]
        count = len(addresses) if self.parameter_count is None else self.parameter_count
        head = (self.request_reference, self.request_id, self.axis, count)
        return profidrive.Request(*head, addresses=addresses, blocks=self._blocks(), rest=self.rest)

    pnu = _of_first("addresses", "pnu", "Parameter number of the first address, None without one.")
    subindex = _of_first("addresses", "subindex", "Subindex of the first address.")
    attribute = _of_first("addresses", "attribute", "Attribute of the first address.")
    element_count = _of_first("addresses", "element_count", "Elements of the first address.")

    def mysummary(self) -> str:
        """What is asked, in one line."""
        parameters = ", ".join(each.mysummary() for each in self.addresses)
        return f"{self.sprintf('DS47 %DS47Request.request_id%')} {parameters}"


class DS47Response(_Message):
    """A parameter response: the data of a Read record (docs/protocol.md A.2).

    `format`, `value_count`, `values` and `error_words` are those of the first block.
    `parameter_count` counts the blocks by itself; for a change that was done, which has none, it is
    1 unless given.
    """

    name = "DS47 response"
    decode = staticmethod(profidrive.decode_response)
    encode = staticmethod(profidrive.encode_response)
    dispatch_hook = classmethod(_layer)  # scapy looks for it in the class itself
    fields_desc = [  # noqa: RUF012
        ByteField("request_reference", 1),
        XByteEnumField("response_id", 1, _RESPONSES),
        ByteField("axis", 1),
        ByteField("parameter_count", None),
        PacketListField("blocks", [], DS47Block),
        StrField("rest", b""),
    ]

    def message(self) -> profidrive.Response:
        """The response of the codec. Raises ValueError for values that a format cannot carry."""
        blocks = self._blocks()
        count = self.parameter_count
        count = (len(blocks) or 1) if count is None else count
        head = (self.request_reference, self.response_id, self.axis, count)
        return profidrive.Response(*head, blocks=blocks, rest=self.rest)

    format = _of_first("blocks", "format", "Format of the first block, None without one.")
    value_count = _of_first("blocks", "value_count", "Value count of the first block.")
    values = _of_first("blocks", "values", "Values of the first block.")
    error_words = _of_first(
        "blocks", "error_words", "Error words of the first block; empty where it is no error."
    )

    def mysummary(self) -> str:
        """What is answered, in one line."""
        return str(self.sprintf("DS47 %DS47Response.response_id% response"))


def _bind() -> None:
    """Hangs the layers below the record blocks, and those below UDP."""
    # scapy takes the record of a Read response for the next block.
    if "payload_length" not in vars(IODReadRes):
        IODReadRes.payload_length = lambda block: block.recordDataLength or 0
    for below, layer in ((IODWriteReq, DS47Request), (IODReadRes, DS47Response)):
        for index in (LOCAL, GLOBAL):
            bind_bottom_up(below, layer, index=index)
        bind_layers(below, layer, index=INDEX_47)
    bind_bottom_up(UDP, DceRpc, dport=PNIO_PORT)
    bind_bottom_up(UDP, DceRpc, sport=PNIO_PORT)
    bind_top_down(UDP, DceRpc4, sport=PNIO_PORT, dport=PNIO_PORT)


_bind()
