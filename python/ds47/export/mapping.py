"""What stands for what: the key of an anonymised capture.

Lives here: replacements that are the same for the same original, of the same length, and the file that
maps them back. Where the originals stand in a frame is in `anonymise`, `blocks`, `stations`, `values`.
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from struct import pack
from typing import Any
from uuid import UUID

from ds47.capture.drafts import draft_of

SCHEMA = "ds47.key/1"
KINDS = ("mac", "ip", "name", "uuid", "value")
_NETS = 512
"""Networks of 198.18.0.0/15, which is set aside for tests; then 10.0.0.0/8."""
_DIGITS = "0123456789abcdefghijklmnopqrstuvwxyz"
_LEAST_NAME = 4
"""Bytes from which on a name that is found anywhere is no chance."""

_REALS = {4: ">f", 8: ">d"}
_MOST_EXACT = 1 << 24
"""Up to here every whole number is one of a Float32."""


_FORMS = {
    "mac": re.compile(r"[0-9a-f]{2}(:[0-9a-f]{2}){5}"),
    "name": re.compile(r"[\0-\xff]+"),
    "uuid": re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}"),
    "value": re.compile(r"[^ ]+ ([0-9a-f]{2})+"),
}
"""How a key file writes each kind, besides IP addresses; names are Latin-1."""


class KeyFileError(Exception):
    """The key file cannot be read or written; the message is one line."""


class Replacements:
    """Replacements for addresses, names, UUIDs and values.

    It is used twice: first every original is met while `learning` (nothing is replaced), then they are
    replaced. So no replacement is an original of another place.
    """

    def __init__(self) -> None:
        self.learning = True
        self._maps: dict[str, dict[str, str]] = {kind: {} for kind in KINDS}
        self._met: dict[str, dict[str, None]] = {kind: {} for kind in KINDS}
        self._taken: dict[str, set[str]] = {kind: set() for kind in KINDS}
        self._nets: dict[str, tuple[str, int]] = {}
        self._counts: dict[str, int] = {}

    def __len__(self) -> int:
        return sum(map(len, self._maps.values()))

    def mac(self, data: bytes) -> bytes:
        """A MAC address; groups (multicast, broadcast) and zeros stay. Zeros for a part of one."""
        if len(data) != 6:
            return bytes(len(data))
        if data[0] & 1 or not any(data):
            return data
        return bytes.fromhex(self._one("mac", data.hex(":"), self._next_mac).replace(":", ""))

    def ip(self, data: bytes) -> bytes:
        """An IPv4 address; 0.*, loopback, multicast and broadcast stay. Zeros for a part of one."""
        if len(data) != 4:
            return bytes(len(data))
        if data[0] in (0, 127) or data[0] >= 224:
            return data
        text = ".".join(map(str, data))
        return bytes(int(part) for part in self._one("ip", text, self._next_ip).split("."))

    def uuid(self, data: bytes) -> bytes:
        """A UUID in network order; the nil UUID stays. Zeros for a part of one."""
        if len(data) != 16 or not any(data):
            return bytes(len(data))
        return UUID(self._one("uuid", str(UUID(bytes=data)), self._next_uuid)).bytes

    def name(self, data: bytes) -> bytes:
        """A text; zeros and blanks at its end stay."""
        core = data.rstrip(b"\0 ")
        if not core:
            return data
        text = self._one("name", core.decode("latin-1"), self._next_name)
        return text.encode("latin-1") + data[len(core) :]

    def value(self, group: str, data: bytes) -> bytes:
        """A value of a parameter, as bytes; `group` is what its format is called."""
        if not data:
            return data
        original = f"{group} {data.hex()}"
        return bytes.fromhex(self._one("value", original, self._next_value).split(" ")[1])

    def originals(self) -> list[bytes]:
        """Byte strings that must not stand in any frame: MAC addresses, names, addresses as text."""
        found = [bytes.fromhex(text.replace(":", "")) for text in self._met["mac"]]
        for kind in ("mac", "ip", "uuid"):
            found += [text.encode("ascii") for text in self._met[kind]]
        names = [text.encode("latin-1") for text in self._met["name"]]
        return found + [name for name in names if len(name) >= _LEAST_NAME]

    def _one(self, kind: str, original: str, make: Any) -> str:
        if self.learning:
            self._met[kind][original] = None
            return original
        known = self._maps[kind].get(original)
        if known is not None:
            return known
        for _ in range(100_000):
            new = str(make(original))
            if kind == "value" or (new not in self._met[kind] and new not in self._taken[kind]):
                break
        self._maps[kind][original] = new
        self._taken[kind].add(new)
        return new

    def _count(self, group: str) -> int:
        self._counts[group] = self._counts.get(group, 0) + 1
        return self._counts[group]

    def _next_mac(self, _original: str) -> str:
        return (0x02D4_7000_0000 + self._count("mac")).to_bytes(6, "big").hex(":")

    def _next_ip(self, original: str) -> str:
        """Hosts of one /24 stay together; .0 and .255 keep their meaning."""
        net, _, host = original.rpartition(".")
        if net not in self._nets:
            self._nets[net] = (self._next_net(), 0)
        new, used = self._nets[net]
        if host in ("0", "255"):
            return f"{new}.{host}"
        self._nets[net] = (new, used % 254 + 1)
        return f"{new}.{used % 254 + 1}"

    def _next_net(self) -> str:
        """A network that no original belongs to."""
        met = {text.rpartition(".")[0] for text in self._met["ip"]}
        for _ in range(_NETS + 65_536):
            number = self._count("net") - 1
            beyond = number - _NETS
            net = f"198.{18 + number // 256}.{number % 256}"
            if beyond >= 0:
                net = f"10.{beyond // 256 % 256}.{beyond % 256}"
            if net not in met:
                break
        return net

    def _next_uuid(self, _original: str) -> str:
        return f"d4700000-0000-4000-8000-{self._count('uuid'):012x}"

    def _next_name(self, original: str) -> str:
        """Letters and digits only, so that a station name stays one."""
        length = len(original)
        number = self._count(f"name {length}")
        if length == 1:
            return _DIGITS[-number % 36]
        digits = ""
        while number:
            number, digit = divmod(number, 36)
            digits = _DIGITS[digit] + digits
        return "n" + digits.rjust(length - 1, "0")[-(length - 1) :]

    def _next_value(self, original: str) -> str:
        """The n-th value of a format becomes the number n: different values stay different.

        Four and eight bytes become a floating-point number: most are one, and as such a small whole
        number is next to nothing, which an analysis would take for a mistake (DS714).
        """
        group, _, data = original.partition(" ")
        size = len(data) // 2
        number = self._count(f"value {group} {size}") - 1
        code = _REALS.get(size)
        if code is not None and number < _MOST_EXACT:
            return f"{group} {pack(code, number + 1).hex()}"
        return f"{group} {(number % (1 << 8 * size)).to_bytes(size, 'big').hex()}"

    # The file

    def save(self, path: Path) -> None:
        """Writes the key, readable for its owner only. Raises KeyFileError."""
        document = {
            "schema": SCHEMA,
            **{kind: self._maps[kind] for kind in KINDS},
            "networks": {net: list(words) for net, words in self._nets.items()},
            "counts": self._counts,
        }
        draft = draft_of(path)
        try:
            number = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            with os.fdopen(number, "w", encoding="utf-8", newline="\n") as stream:
                json.dump(document, stream, ensure_ascii=False, indent=1)
                stream.write("\n")
            draft.replace(path)
        except OSError as problem:
            draft.unlink(missing_ok=True)
            raise KeyFileError(f"cannot write {path}: {problem.strerror}") from problem

    @classmethod
    def load(cls, path: Path) -> Replacements:
        """Reads a key, to go on with it. Raises KeyFileError."""
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
            key = cls()
            if document["schema"] != SCHEMA:
                raise KeyFileError(f"{path}: not a key file ({SCHEMA})")
            for kind in KINDS:
                key._maps[kind] = dict(document[kind])
                for original, new in key._maps[kind].items():
                    if not _replaces(kind, original, new):
                        text = f"{path}: {new!r} cannot replace the {kind} {original!r}"
                        raise KeyFileError(f"{text}: this key file was changed")
                key._taken[kind] = set(key._maps[kind].values())
                key._met[kind] = dict.fromkeys(key._maps[kind])
            key._nets = {net: (a, int(b)) for net, (a, b) in document["networks"].items()}
            if not all(
                _is_ip(f"{net}.1") and _is_ip(f"{a}.1") for net, (a, _) in key._nets.items()
            ):
                raise ValueError("networks")
            key._counts = {str(a): int(b) for a, b in document["counts"].items()}
        except OSError as problem:
            raise KeyFileError(f"cannot read {path}: {problem.strerror}") from problem
        except (
            ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError,
        ) as problem:  # fmt: skip
            raise KeyFileError(f"{path}: not a key file ({SCHEMA})") from problem
        return key


def _replaces(kind: str, original: object, new: object) -> bool:
    """Whether both are of this kind, and as long: anything else would make another frame."""
    if not isinstance(original, str) or not isinstance(new, str):
        return False
    if kind == "ip":
        return _is_ip(original) and _is_ip(new)
    if kind == "value" and original.partition(" ")[0] != new.partition(" ")[0]:
        return False
    form = _FORMS[kind]
    return len(original) == len(new) and bool(form.fullmatch(original) and form.fullmatch(new))


def _is_ip(text: object) -> bool:
    parts = text.split(".") if isinstance(text, str) else ()
    return len(parts) == 4 and all(part.isdecimal() and int(part) < 256 for part in parts)
