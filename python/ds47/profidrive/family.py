"""Which response IDs belong to which request ID, and whether a response has the kind of a request.

Only the header says that (docs/protocol.md A.1 to A.3). What a response says about its request beyond that is
judged in `ds47.acyclic.judge`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from ds47.profidrive.model import Request
from ds47.spec import request_ids
from ds47.spec.layouts import MESSAGE_SIZE

NOT_SUPPORTED: Final = 0x80
"""Response id of a device that does not know the request id."""


@lru_cache(maxsize=4096)
def family_fits(request_id: int, response_id: int) -> bool:
    """Whether a response id belongs to a request id (docs/protocol.md A.3)."""
    known = request_ids().get(request_id)
    if known is None:
        return response_id & 0x7F == request_id & 0x7F or response_id == NOT_SUPPORTED
    return response_id in (known.positive, known.negative, NOT_SUPPORTED)


def kind_fits(request: Request, data: bytes) -> bool | None:
    """Whether a response is of the family of a request, of its axis, and has as many parameters.

    What stands behind the id 0x80 is not documented, and its number says nothing.

    Args:
        request: what was asked.
        data: the response. None where either lacks a part of its header.
    """
    asked, count = request.request_id, request.parameter_count
    if asked is None or count is None or len(data) < MESSAGE_SIZE:
        return None
    counted = data[3] == count or data[1] == NOT_SUPPORTED
    return family_fits(asked, data[1]) and data[2] == request.axis and counted
