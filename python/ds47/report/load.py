"""A report in JSON back to the model: the reverse of `ds47.report.json`, by the same table (contract.py).

What the contract does not hold is not there again: `Transaction.position`. Written once more, in any format,
it is the same report. Texts that are those of this version are left out: the report words them anew. Results of
`ds47.report/1` have findings with a sentence and without args.
"""

from __future__ import annotations

import re
from typing import Any

from ds47.model import CaptureResult, Diagnosis, Finding, Transaction
from ds47.report import contract

_AT_OFFSET = re.compile(r"offset (\d+): (.*)", re.DOTALL)


def capture(item: dict[str, Any]) -> CaptureResult:
    """A capture of the contract; `problem` and `dropped` are not in it."""
    loaded: CaptureResult = contract.CAPTURE.load(
        item | {"transactions": [], "findings": [], "diagnoses": []}
    )
    vendors = {each.ip: each.vendor for each in loaded.devices}
    loaded.transactions = [
        transaction(each, vendors.get(each["device"])) for each in item["transactions"]
    ]
    loaded.findings = [finding(each) for each in item["findings"]]
    loaded.diagnoses = [diagnosis(each) for each in item["diagnoses"]]
    return loaded


def transaction(item: dict[str, Any], vendor_id: int | None = None) -> Transaction:
    """A transaction of the contract, with a device of this vendor. Raises ValueError where `start` is no time."""
    loaded: Transaction = contract.TRANSACTION.load(item, vendor_id)
    return loaded


def finding(item: dict[str, Any]) -> Finding:
    """A finding of the contract; of `ds47.report/1` the offset in front of its message is taken off."""
    if "args" in item:
        loaded: Finding = contract.FINDING.load(item)
        return loaded
    text, offset = message(item["message"])
    return Finding(
        item["rule"], item["severity"], item["frame"], [], item["transaction"], offset, said=text
    )


def message(text: str) -> tuple[str, int | None]:
    """The message of a finding of `ds47.report/1` without the offset in front of it, and that offset."""
    match = _AT_OFFSET.fullmatch(text)
    return (match[2], int(match[1])) if match else (text, None)


def diagnosis(item: dict[str, Any]) -> Diagnosis:
    """A diagnosis of the contract."""
    loaded: Diagnosis = contract.DIAGNOSIS.load(item)
    corrected = item["corrected"]
    if corrected is not None:
        loaded.corrected = bytes.fromhex(corrected["request"])
        loaded.corrected_in = corrected.get("transaction")
    if "args" not in item:
        loaded.said = item["message"]
    return loaded
