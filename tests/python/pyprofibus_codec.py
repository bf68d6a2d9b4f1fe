"""A program: decodes frames of PROFIBUS with pyprofibus, one in hex a line from stdin, a line of JSON each.

It is run in a process of its own (test_profibus_oracle), and shares nothing with ds47.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from pyprofibus.dp import (
    DpError,
    DpTelegram,
    DpTelegram_ChkCfg_Req,
    DpTelegram_SetPrm_Req,
    DpTelegram_SlaveDiag_Con,
)
from pyprofibus.fdl import FdlError, FdlTelegram


def frame(data: bytes) -> dict[str, Any]:
    """The fields of a frame, or what is wrong with it."""
    try:
        item = FdlTelegram.fromRawData(bytearray(data))
    except FdlError as problem:
        return {"error": str(problem)}
    fields = {name: getattr(item, name) for name in ("da", "sa", "fc")}
    fields |= {name: bytes(getattr(item, name) or b"").hex() for name in ("dae", "sae", "du")}
    return {**fields, "raw": bytes(item.getRawData()).hex(), "dp": content(item)}


def content(item: FdlTelegram) -> dict[str, Any] | None:
    """What DP says in it, as far as pyprofibus decodes that."""
    if not item.dae or not item.sae:
        return None
    try:
        found = DpTelegram.fromFdlTelegram(item, thisIsMaster=not item.fc & FdlTelegram.FC_REQ)
    except DpError as problem:
        return {"error": str(problem)}
    if isinstance(found, DpTelegram_SlaveDiag_Con):
        names = ("b0", "b1", "b2", "masterAddr", "identNumber")
        return {name: getattr(found, name) for name in names}
    if isinstance(found, DpTelegram_SetPrm_Req):
        names = ("wdFact1", "wdFact2", "minTSDR", "identNumber", "groupIdent")
        return {name: getattr(found, name) for name in names}
    if isinstance(found, DpTelegram_ChkCfg_Req):
        return {"modules": [bytes(each.getDU()).hex() for each in found.cfgData]}
    return None


for line in sys.stdin:
    sys.stdout.write(json.dumps(frame(bytes.fromhex(line))) + "\n")
    sys.stdout.flush()
