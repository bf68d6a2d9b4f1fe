"""Whether a sentence says just its arguments: the one place where something is read out of a sentence.

Each rule has its expression here: where in its sentence which argument stands. Numbers that stand elsewhere in a
sentence must be arguments too.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from tests.audit.reading import Complaint, Finding, Reading

NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
PARAMETER = r"(?:[prP]0*)?(?P<pnu>\d+|\?)\[(?P<subindex>\d+|\?)\]"
CODE = r"(?P<code>0x[0-9A-F]{2,4}|no error number)"
STATUS = r"status (?P<status>[0-9A-F]{8}|-)"
DRIVE = r"(?P<device>[\d.]+|dp\d+)(?: slot (?P<slot>\d+))?"
STOOD = r"(?P<seconds>[\d.]+) s \(limit (?P<limit>[\d.]+) s\)"
PARTNER, STATION = r"(?P<device>[\d.]+)", r"(?P<controller>[\d.]+)"
JOB = r"(?P<operation>GET|PUT) (?P<area>.+)"
SENT = rf"BSEND with R_ID (?P<r_id>0x[0-9A-F]{{8}}) to {PARTNER}"
TSAP = r"TSAP (?P<tsap>[0-9A-F.]+) \(rack (?P<rack>\d+|\?), slot (?P<slot>\d+|\?)\)"
SAYS: dict[str, str] = {
    "DS101": r"RPC (?P<operation>\w+) request",
    "DS102": r"RPC (?P<operation>\w+) response",
    "DS103": r"RPC (?P<operation>\w+) request .*frame (?P<first>\d+|\?)",
    "DS104": r"RPC (?P<kind>\w+) with code (?P<fault>0x[0-9A-F]{8})",
    "DS105": r"(?P<kind>RPC|IP) fragments .* (?P<have>\d+)",
    "DS106": r"(?P<captured>\d+) of (?P<original>\d+) bytes",
    "DS109": r"Limit (?P<limit>\w+) = (?P<most>\d+) of ds47 reached: (?P<count>\d+) given up",
    "DS107": r"by (?P<milliseconds>[\d.]+) ms from frame (?P<first>\d+) to this one$",
    "DS201": STATUS,
    "DS202": r"says (?P<stated>\d+) bytes, (?P<present>\d+)",
    "DS203": STATUS,
    "DS204": r"(?P<count>\d+) times",
    "DS205": r"(?P<milliseconds>[\d.]+) ms .*limit (?P<limit>\d+) ms",
    "DS206": STATUS,
    "DS302": r"ID (?P<id>0x[0-9A-F]{2})",
    "DS304": r"parameters (?P<count>\d+) is above (?P<limit>\d+)",
    "DS305": r"attribute (?P<attribute>0x[0-9A-F]{2})",
    "DS307": r"elements (?P<count>\d+) is above (?P<limit>\d+)",
    "DS308": r"Subindex (?P<subindex>\d+) with (?P<count>\d+)",
    "DS309": r"format (?P<format>0x[0-9A-F]{2})",
    "DS310": r"number of values (?P<values>\d+) for number of elements (?P<elements>\d+)",
    "DS312": r"is (?P<pad>0x[0-9A-F]{2})",
    "DS313": r"(?P<count>\d+)$",
    "DS314": r"(?P<count>\d+)$",
    "DS315": r"missing: (?P<need>\d+) \((?P<what>.*)\)",
    "DS316": r"of (?P<length>\d+) bytes is longer than (?P<limit>\d+)",
    "DS317": r"Format (?P<format>\w+) .*with (?P<size>\d+) bytes",
    "DS318": r"with (?P<count>\d+) words",
    "DS319": r"ID (?P<id>0x[0-9A-F]{2})",
    "DS404": r"sent (?P<sent>\d+), got (?P<got>\d+)",
    "DS405": r"ID (?P<got>0x[0-9A-F]{2}) .*request ID (?P<sent>0x[0-9A-F]{2})",
    "DS406": r"sent (?P<sent>\d+), got (?P<got>\d+)",
    "DS407": r"asked for (?P<sent>\d+), got (?P<got>\d+)",
    "DS408": r"Parameter (?:[prP]0*)?(?P<pnu>\d+|\?)\D.* (?P<got>\d+) of (?P<asked>\d+)",
    "DS409": r"Parameter (?:[prP]0*)?(?P<pnu>\d+|\?)\D.* (?P<got>\d+) instead of (?P<asked>\d+)",
    "DS410": rf"{PARAMETER} has a negative response: {CODE} (.* )?\(info (?P<info>\d+|-)\)",
    "DS413": r"frame (?P<request>\d+) .*frame (?P<by>\d+)",
    "DS414": r"frame (?P<request>\d+) .*frame (?P<by>\d+)",
    "DS415": r"reference (?P<reference>\d+) .*\(frame (?P<first>\d+)\)$",
    "DS416": r"took (?P<milliseconds>[\d.]+) ms .*limit (?P<limit>\d+) ms",
    "DS417": rf"{PARAMETER} reads back (?P<read>.+), but (?P<written>.+) is the last .*\(frame (?P<by>\d+|\?)\)$",
    "DS418": r"request ID (?P<id>0x[0-9A-F]{2})",
    "DS501": rf"{PARAMETER} is negative: (?P<code>\d+|no error number)",
    "DS502": rf"{PARAMETER} by PKW is refused",
    "DS503": rf"{PARAMETER} .*after (?P<milliseconds>[\d.]+) ms",
    "DS504": rf"{PARAMETER} in frame (?P<request>\d+) .*frame (?P<by>\d+)",
    "DS505": r"\((?P<response>[0-9A-F ]+)\) .*\((?P<request>[0-9A-F ]+)\)",
    "DS506": rf"{PARAMETER} by PKW came in parts",
    "DS507": rf"{PARAMETER} .* frame (?P<read>\d+)",
    "DS508": rf"{PARAMETER} of {DRIVE} .* (?P<count>\d+) times .* than (?P<limit>\d+) times",
    "DS509": rf"{PARAMETER} of {DRIVE} .* (?P<count>\d+) times, more than (?P<limit>\d+) times",
    "DS510": rf"^(?P<count>\d+) requests .* to {DRIVE} .* layout (?P<layout>\w+), .* layout (?P<other>\w+)$",
    "DS511": rf"^(?P<count>\d+) responses .* of {DRIVE} .* than (?P<limit>[\d.]+) ms, .* (?P<slowest>[\d.]+) ms$",
    "DS512": rf"to {DRIVE} in",
    "DS513": rf"{PARAMETER}, .* is (?P<pwe>0x[0-9A-F]+) and not 0",
    "DS520": rf" of {DRIVE} while",
    "DS521": rf"^{DRIVE} .* {STOOD} ",
    "DS522": rf"STW1 (?P<word>0x[0-9A-F]+), which {DRIVE} .* bit 10",
    "DS523": rf"of {DRIVE} .* {STOOD}",
    "DS524": rf"of {DRIVE} .* {STOOD}",
    "DS525": rf"of {DRIVE} .* {STOOD} .* bits (?P<bits>[\d, ]+) = 0",
    "DS526": rf"^{DRIVE} .* (?P<percent>\d+) % .* {STOOD}",
    "DS527": rf"^{DRIVE} .*bit 9 = 0.* bit 10 is 1",
    "DS528": rf"^{DRIVE} was running, and ",
    "DS529": rf"^(?P<off>OFF[23]) .* in {DRIVE},",
    "DS530": rf"{PARAMETER} .*(?:frame (?P<since>\d+)|before the capture began)$",
    "DS531": rf"{PARAMETER}, ",
    "DS701": rf"response ID (?P<id>0x[0-9A-F]{{2}}), {CODE}",
    "DS702": r"in frame (?P<frame>\d+), .*frame (?P<by>\d+)",
    "DS703": r"(?P<count>\d+) x .* on (?P<device>[\d.]+|dp\d+) ",
    "DS704": r"of frame (?P<first>\d+) .*once more in frame (?P<frame>\d+), .*: it is the one",
    "DS706": r"in frame (?P<request>\d+) .*frame (?P<frame>\d+)\)",
    "DS707": r"index (?P<index>\d+|0x[0-9A-F]{4}) of (?P<device>[\d.]+|dp\d+) \((?P<status>[0-9A-F]{8}|-)\)",
    "DS708": r"^(?P<device>[\d.]+|dp\d+) .*\((?P<status>[0-9A-F]{8})\)",
    "DS709": r"^(?P<device>[\d.]+|dp\d+) says that drive object \(axis\) (?P<axis>\d+) does not exist$",
    "DS710": r"\((?P<axes>[\d, ]+)\)",
    "DS711": r"ends after (?P<have>\d+) bytes: ",
    "DS712": r"for (?P<asked>\d+) bytes .*needs at least (?P<need>\d+)$",
    "DS713": r"^Parameters answered: (?P<number>\d+) of (?P<parameters>\d+), ",
    "DS714": rf"^{PARAMETER} is written as (?P<format>\w+) (?P<values>.*); ",
    "DS715": r"swapped: (?P<meant>.*)$",
    "DS716": r": (?P<meant>.*)$",
    "DS717": rf"{PARAMETER} with number of elements (?P<elements>\d+) .*: {CODE} ",
    "DS718": rf"{PARAMETER} .* with (?P<state>.*?): {CODE} ",
    "DS719": rf"{PARAMETER} .*: {CODE} ",
    "DS720": rf"^{PARAMETER} is an interconnection, .*: {CODE} ",
    "DS721": r"^Changes on .* are followed by no save \(p0971 of the drive object or p0977\): (?P<count>\d+), the last in frame (?P<last>\d+); ",
    "DS722": r"frame (?P<frame>\d+|\?)",
    "DS723": r"(?P<count>\d+) times to (?P<device>[\d.]+|dp\d+), every (?P<period>[\d.]+) ms",
    "DS724": r"(?P<count>\d+) Reads on (?P<device>[\d.]+|dp\d+) .*every (?P<period>[\d.]+) ms.* (?P<time>[\d.]+) ms",
    "DS725": r"\((?P<count>\d+) in all\)$",
    "DS801": r"^Frames with a wrong check byte: (?P<count>\d+)$",
    "DS802": r"^Damaged frames, check byte aside: (?P<count>\d+) \(length bytes, end byte, addresses, or bytes that are missing\)$",
    "DS803": r"^Requests to (?P<device>dp\d+) that the master repeated: (?P<count>\d+), in (?P<of>\d+) requests$",
    "DS804": r"^Requests to (?P<device>dp\d+) without an answer in the capture: (?P<count>\d+) of (?P<of>\d+)$",
    "DS805": r"^(?P<count>\d+) x SAP (?P<sap>\d+) of (?P<device>dp\d+) not enabled \(RS\): ",
    "DS806": rf"^(?P<count>\d+) x (?P<operation>DS_Read|DS_Write) of (?P<place>slot \d+, index \d+) refused by (?P<device>dp\d+) with {STATUS}: ",
    "DS807": r"^Answers of (?P<device>dp\d+) that took more than (?P<limit>\d+) polls: (?P<count>\d+), one of them (?P<polls>\d+)$",
    "DS808": rf"^DS_Read of index (?P<index>\d+) from (?P<device>dp\d+), to which nothing was written since its start-up: {STATUS}, no data$",
    "DS809": r"^DS_Write of (?P<length>\d+) bytes to (?P<device>dp\d+): a record of MS1 has (?P<most>\d+) at most$",
    "DS810": r"^(?P<count>\d+) x Set_Prm to (?P<device>dp\d+) after data exchange; the last data exchange before the first of them is frame (?P<last>\d+)$",
    "DS811": r"^(?P<count>\d+) x data of (?P<device>dp\d+) not as in Chk_Cfg: (?P<outputs>\d+) bytes out \((?P<configured_outputs>\d+)\), (?P<inputs>\d+) bytes in \((?P<configured_inputs>\d+)\)$",
    "DS812": r"^(?P<device>dp\d+) asks for a diagnosis in (?P<count>\d+) answers in a row, and the master does not read it in between$",
    "DS813": r"^Chk_Cfg of (?P<device>dp\d+) configures PKW as (?P<identifier>[0-9A-F]+), without consistency over its whole length$",
    "DS814": r"^(?P<count>\d+) x Slave_Diag of (?P<device>dp\d+): ",
    "DS815": r"^Set_Prm switches off the watchdog of (?P<device>dp\d+)$",
    "DS901": rf"^{JOB} to {PARTNER} has no answer",
    "DS902": r"^(?P<count>\d+) x PDU of (?P<sender>\S+) above .*: (?P<size>\d+) bytes, (?P<agreed>\d+) .* frame (?P<frame>\d+)$",
    "DS903": rf"^(?P<count>\d+) x {JOB}: (?P<bytes>\d+) bytes, and {PARTNER} copies (?P<block>\d+) at once \(",
    "DS904": rf"^(?P<count>\d+) x {JOB} of {PARTNER} in (?P<jobs>\d+) jobs, ",
    "DS905": r": (?P<first>\S+) = (?P<first_value>0x\w\w) and (?P<second>\S+) = (?P<second_value>0x\w\w) .* frame (?P<write>\d+)\)$",
    "DS906": rf"^(?P<count>\d+) x several items in one job of {STATION}, which {PARTNER} does",
    "DS907": rf"^(?P<count>\d+) x {STATION} and (?P<other>\S+) write .* of {PARTNER} \((?P<byte>\S+)\) within a second$",
    "DS908": rf"^{JOB} refused by {PARTNER}: (?P<code>0x[0-9A-F]{{2}}) ",
    "DS909": rf"^{JOB} refused by {PARTNER} as a whole: .*\((?P<code>[0-9A-F]{{4}})\)$",
    "DS910": rf"^{SENT} is not whole: ",
    "DS911": rf"^{SENT}: of (?P<segments>\d+) segments (?P<count>\d+) without",
    "DS912": rf"^{SENT}: ",
    "DS913": rf"^U{SENT[1:]} sends areas of (?P<now>[\d, ]+) bytes, and of (?P<before>[\d, ]+) in frame (?P<first>\d+)$",
    "DS914": rf"^(?P<count>\d+) x {STATION} has .* at {PARTNER} than agreed: (?P<most>\d+), (?P<agreed>\d+) were",
    "DS915": rf"^(?P<count>\d+) x connection of {STATION} to {PARTNER} without",
    "DS916": rf"^(?P<byte>\S+) of {PARTNER} is read as (?P<read>\S+), .* as (?P<written>\S+) in frame (?P<by>\d+)$",
    "DS917": rf"^(?P<count>\d+) x {STATION} gets no S7 connection to {PARTNER}: ",
}  # fmt: skip
"""Rule -> where in its English sentence which argument stands."""
_BETTER = r"(?P<better>\w+) \((?P<better_code>0x[0-9A-F]{2})\)"
_STATION = r"[\d.]+|[0-9a-f:]{17}|dp\d+"
_WROTE = rf"^(?P<controller>{_STATION}) wrote in frame (?P<frame>\d+) "
STANDS = {
    "pzd_S1": ": S1 switching on inhibited$", "pzd_S2": ": S2 ready to switch on$", "pzd_S3": ": S3 switched on$",
    "pzd_S4": ": S4 operation enabled$", "pzd_S5": ": S5 switching off$", "pzd_not_ready": ": not ready to switch on$",
}  # fmt: skip
CLAUSES: dict[str, dict[str, str]] = {
    "DS401": {"end": "the capture ends(;|$)", "unseen": "its responses are not in the capture(;|$)",
              "later": "a later Write of its channel has no response in the capture, and may have displaced it(;|$)",
              "release": "the AR was released(;|$)", "expired": "nothing came for too long(;|$)"},
    "DS403": {"unasked": "the capture shows none open on its channel, ", "unasked_without_ar": "which request it belongs to is not known",
              "unasked_again": "when its transaction was over already"},
    "DS520": {"pzd_fault": "^Fault of", "pzd_fault_number": r"^Fault (?P<code>\d+) of"},
    "DS521": STANDS, "DS531": STANDS,
    "DS528": {"pzd_zero": "and its control word became 0$", "pzd_invalid": "and the data of the controller became invalid$"},
    "DS530": {"pzd_since": r"since frame (?P<since>\d+)$", "pzd_since_ever": "since before the capture began$"},
    "DS701": {"status_zero": "brought it is 0$",
              "status_zero_at_last": r"brought it is 0 \(after (?P<polls>\d+) x DE80B500: not ready yet\)$"},
    "DS704": {"again": "without a new request:", "again_unaccepted": "shows no new request that was accepted in between:",
        "again_without_ar": r"without an AR \(ReadImplicit\):",
              "again_after_refusal": r"after the Write in frame (?P<write>\d+) had been refused:"},
    "DS705": {
        "two_stations": rf"{_WROTE}while the request of (?P<other>{_STATION}) \(frame (?P<first>\d+)\) was open: two s",
        "two_ars": rf"{_WROTE}\(AR (?P<ar>\S+)\) while its request of frame (?P<first>\d+) "
                   r"\(AR (?P<other_ar>\S+)\) was open: two c",
        "one_station": rf"{_WROTE}while its own request of frame (?P<first>\d+) was open: ",
        "unseen_user": rf"^(?P<controller>{_STATION}) was turned away in frame (?P<frame>\d+): another request was open"},
    "DS711": {"length_short": r": number of parameters (?P<count>\d+) needs (?P<need>\d+)$",
              "length_or_count": r": number of parameters (?P<count>\d+) needs (?P<need>\d+), but it is just as long "
                                 r"as a request for (?P<fits>\d+)$"},
    "DS713": {"too_long": rf", {PARAMETER} has a negative response 0x15 ", "left_out": rf", {PARAMETER} and what follows",
              "room_stated": r"; PNU 974\[0\] of the device is (?P<limit>\d+) bytes$",
              "room_seen": r"; the capture shows a response of the device with (?P<limit>\d+) bytes$"},
    "DS714": {"format_read": rf"; [prP]\d+ is read as {_BETTER} in frame (?P<seen>\d+), ",
              "format_described": rf"; the drive describes [prP]\d+ as {_BETTER} in frame (?P<seen>\d+), ",
              "format_listed": rf"; by the list of parameters it is {_BETTER}, ",
              "format_bits": rf"; as {_BETTER} it would make sense, ",
              "bits_same": "the same bits are (?P<meant>.*) there$", "number_same": "the same number is (?P<meant>.*) there$",
              "number_other": "number instead, are (?P<meant>.*)$"},
    "DS715": {"all_bytes": "of every word are", "fields": "of PNU, subindex and values are", "values": "of the values are"},
    "DS716": {"zeros": "without the zeros between the bytes:", "even_offsets": "without the fill bytes after single bytes:"},
    "DS720": {"no_source": r", (?P<format>\w+) (?P<value>\S+) is the number of no source:",
              "source_refused": r", its source [prP]0*(?P<source>\d+) was not accepted:"},
    "DS721": {"unsaved": r" on (?P<device>[\d.]+|dp\d+) are followed", "all_known": "; no other change is in doubt$",
              "unsaved_targets": r" on (?P<device>[\d.]+|dp\d+), addressed in (?P<targets>\d+) ways \(",
              "some_unknown": r"; whether accepted, or saved, is not known of (?P<unknown>\d+) more$"},
    "DS725": {"one_direction": "requests without any response: ", "other_direction": "responses without any request: ",
              "no_write": "Read record brings responses, but no Write record ", "cut": "frames were cut ", "dropped": "frames were dropped "},
    "DS805": {"sap_dpv1": r": Set_Prm in frame (?P<frame>\d+) enabled DPV1$",
              "sap_no_dpv1": r": Set_Prm in frame (?P<frame>\d+) did not enable DPV1$",
              "sap_unknown": ": its Set_Prm is not in the capture$", "sap_other": ": it does not have this service$"},
    "DS814": {"diag_prm_fault": ": Prm_Fault, it refuses the parameters$",
              "diag_cfg_fault": ": Cfg_Fault, it refuses the configuration$",
              "diag_ident": ": its ident number is (?P<ident>0x[0-9A-F]{2,4}), Set_Prm says (?P<sent>0x[0-9A-F]{2,4})$",
              "diag_master": r": it belongs to master (?P<master>\d+)$"},
    "DS903": {"block_chosen": r"\(chosen with --s7-block\)$", "block_kind": r"\(--s7-cpu (?P<name>\S+)\)$",
              "block_said": r"\(SZL 0131 in frame (?P<frame>\d+)\)$",
              "block_order": r"\((?P<name>.+) in frame (?P<frame>\d+)\)$"},
    "DS905": {"mixed_split": rf"^What {STATION} reads from {PARTNER} in (?P<jobs>\d+) jobs is of two",
              "mixed_job": rf"^What {STATION} reads from {PARTNER} in one job is of two",
              "mixed_put": rf"^What {STATION} reads from {PARTNER}, which is written in parts meanwhile, is of two"},
    "DS910": {"bsend_open": r"after (?P<size>\d+) of (?P<total>\d+) bytes$",
              "bsend_sum": r": (?P<size>\d+) bytes in (?P<segments>\d+) segments, (?P<total>\d+) were announced$",
              "bsend_sequence": "do not have the sequence number"},
    "DS912": {"r_id_open": r": one that began in frame (?P<frame>\d+) is still open$",
              "r_id_refused": r": refused in the ack.*\((?P<code>[0-9A-F]{4})\)$"},
    "DS917": {"refused_no_confirm": f"CR to {TSAP} has no CC$", "refused_no_confirm_tcp": ": CR has no CC$",
              "refused_disconnect": f"CR to {TSAP} is answered with DR$", "refused_disconnect_tcp": ": CR is answered",
              "refused_reset": f"TCP is reset after CR to {TSAP}$", "refused_reset_tcp": ": TCP is reset$",
              "refused_setup": r": the setup is refused, .*\((?P<code>[0-9A-F]{4})\)$"},
}  # fmt: skip
"""Rule -> word of an argument -> the clause that stands for it, with the arguments that this clause shows."""
CLAUSES["DS402"] = CLAUSES["DS401"]
MANY: dict[str, str] = {
    "DS501": r"^Responses by PKW are negative: (?P<code>\d+|no error number)",
    "DS520": r"^Fault(?: (?P<code>\d+))? while running$",
    "DS528": "^Drives were running, and (?P<what>.*)$",
    "DS529": r"^(?P<off>OFF[23]) is active, and the control word does not ask for it$",
    "DS410": rf"^Parameters have a negative response: {CODE}( |$)",
    "DS701": rf"^Responses are negative \(response ID (?P<id>0x[0-9A-F]{{2}}), {CODE}.*the STATUS of the call that ended each",
    "DS702": "^Reads were sent before the Write was answered$",
    "DS703": r"^Reads were refused with DE80B500 on (?P<device>\S+) while no request was open$",
    "DS704": "^Responses were read once more, after they had been delivered$",
    "DS705": rf"^(?P<controller>{_STATION}) (wrote while (a request of (?P<other>{_STATION})|its) |was turned away: )",
    "DS706": "^Requests went to (?P<place>.*), their responses were looked for at (?P<other>.*)$",
    "DS707": r"^Parameter requests were written to record index (?P<index>\w+) of (?P<device>\S+)$",
    "DS708": r"^(?P<device>\S+) turns requests to (?P<place>.*) away$",
    "DS710": "^Different axis numbers are asked at (?P<place>.*): all reach",
    "DS711": "^Requests end before their last byte$",
    "DS712": "^Reads ask for fewer bytes than the response needs$",
    "DS713": "^Responses did not bring all parameters that their requests asked for$",
    "DS714": rf"^[prP]0*(?P<pnu>\d+) is written as (?P<format>\w+), not as {_BETTER}$",
    "DS715": "^Requests make sense when the bytes of (?P<what>.*) are swapped$",
    "DS716": "^Requests make sense without (?P<what>.*)$",
    "DS717": rf"^[prP]0*(?P<pnu>\d+) with several subindices or numbers of elements has negative responses: {CODE} ",
    "DS718": rf"^[prP]0*(?P<pnu>\d+) \(several subindices\) can be changed only with (?P<state>.*?): {CODE} ",
    "DS719": rf"^[prP]0*(?P<pnu>\d+) \(several subindices\) cannot be changed now: {CODE} ",
    "DS720": rf"^[prP]0*(?P<pnu>\d+) is an interconnection, and what was written to it was not accepted: {CODE} ",
    "DS721": r"^Changes on (?P<device>\S+) are followed by no save",
    "DS722": "^The connection ended while requests were open$",
    "DS723": r"^Equal changes were written again and again to (?P<device>\S+)$",
    "DS724": r"^Reads on (?P<device>\S+) came before the response was ready, again and again$",
    "DS725": "^The capture shows only a part: (?P<what>[^()]*)$",
}  # fmt: skip
"""Rule -> the sentence of several cases that differ in what the sentence of one names."""
MANY_CASES = {
    "two_stations": "two stations use one", "two_ars": "two connections of one", "one_station": "its own request was open",
    "unseen_user": "was turned away: another request was open",
}  # fmt: skip
"""The case of DS705 -> what its sentence of several cases says."""
FREE: dict[str, str] = {}
"""Rules whose sentence has no one form; their numbers are looked at all the same."""
SILENT = {"vendor_id", "family", "dropped", "place", "other", "device", "frames"}
"""Arguments that no number in the sentence shows."""
QUIET = {
    "DS106": {"length", "completed"},
    "DS714": {"code"},
    "DS705": {"ar", "other_ar"},
    "DS713": {"what"},
    "DS811": {"frame"},
    "DS813": {"count"},
    "DS815": {"count"},
    "DS903": {"controller", "frames"},
    "DS904": {"controller", "frames"},
    "DS910": {"controller", "first"},
    "DS911": {"controller", "frames"},
} | {
    **{rule: {"controller"} for rule in ("DS901", "DS908", "DS909", "DS912", "DS913", "DS916")},
    **{rule: {"frames"} for rule in ("DS902", "DS905", "DS906", "DS907", "DS914", "DS915", "DS917")},
}  # fmt: skip
"""Arguments of a rule that its sentence leaves out."""
OWN = {"DS903": {"0131"}, "DS502": {"8"}, "DS522": {"10", "0"}, "DS525": {"0"}, "DS527": {"9", "0", "10", "1"}, "DS523": {"1"}, "DS528": {"0"},
       "DS701": {"0", "0xDE80B500"}, "DS207": {"00000000"}, "DS713": {"0x15", "974", "0"}, "DS109": {"47"},
       "DS703": {"0xDE80B500"}, "DS204": {"0xDE80B500"}, "DS301": {"0"}, "DS303": {"0"},
       "DS306": {"0"}, "DS308": {"65535"}, "DS312": {"0"}, "DS318": {"1", "2"}, "DS317": {"2"},
       "DS418": {"0x80"}, "DS721": {"0971", "0977", "0xB02E"}}  # fmt: skip
"""Numbers that stand in the sentence of every finding of a rule."""
KEYS = {"case", "more", "what", "room", "bits", "reason"}
"""Arguments whose value stands for a clause."""
_WORDS = {
    "DS908",
    "DS909",
    "DS912",
    "DS917",
    "DS501",
    "DS521",
    "DS531",
    "DS410",
    "DS201",
    "DS203",
    "DS701",
    "DS717",
    "DS718",
    "DS719",
    "DS720",
    "DS715",
    "DS716",
}
"""Rules that end in the words of an error number, or in a line: numbers inside those are not looked at."""


def check(finding: Finding, reading: Reading) -> Iterator[Complaint]:
    """Whether the sentence of a finding is that of its arguments."""
    for text in problems(finding.rule, finding.message, finding.args):
        yield Complaint(finding.rule, f"frame {finding.frame}, sentence", text)


def problems(rule: str, sentence: str, args: dict[str, Any]) -> Iterator[str]:
    """What is wrong with a sentence of these arguments."""
    text = re.sub(r"^offset \d+: ", "", sentence)
    told: dict[str, str] = {}
    for form in forms(rule, args):
        found = re.search(form, text)
        if found is None:
            yield f"has another form: {text!r}"
            return
        told |= {name: word for name, word in found.groupdict().items() if word is not None}
    yield from _as_told(told, args)
    if rule in SAYS or rule in CLAUSES:
        bare = {"slot"} if args.get("slot") is None else set()  # a station has none
        for name in sorted(set(args) - set(told) - SILENT - unsaid(rule, args) - bare):
            yield f"does not say {name} {args[name]!r}"
    if rule not in _WORDS:
        yield from _strangers(rule, text, args)


def forms(rule: str, args: dict[str, Any]) -> list[str]:
    """The expressions that all must be found in a sentence of these arguments."""
    own = [SAYS[rule]] if rule in SAYS else []
    return own + [form for _, form in _clauses(rule, args)]


def _clauses(rule: str, args: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for name in KEYS & set(args):
        if rule in CLAUSES and isinstance(args[name], str):
            yield name, CLAUSES[rule].get(args[name], rf"no clause of {args[name]}")


def unsaid(rule: str, args: dict[str, Any]) -> set[str]:
    """The arguments that a sentence of these leaves out: the words of clauses, and what only other clauses name."""
    named = {
        name for form in CLAUSES.get(rule, {}).values() for name in re.compile(form).groupindex
    }
    mine = {name for form in forms(rule, args) for name in re.compile(form).groupindex}
    keys = {name for name, _ in _clauses(rule, args)}
    return (named - mine) | keys | QUIET.get(rule, set())


def named(rule: str, args: dict[str, Any]) -> set[str]:
    """The arguments that the sentence of one case shows."""
    return {name for form in forms(rule, args) for name in re.compile(form).groupindex} | {
        name for name, _ in _clauses(rule, args)
    }


def of_many(rule: str, sentence: str, args: dict[str, Any]) -> Iterator[str]:
    """What is wrong with the sentence of several cases that agree in these arguments."""
    found = re.search(MANY.get(rule, "$^"), sentence)
    if found is None:
        yield f"has another form for several cases: {sentence!r}"
        return
    told = {name: word for name, word in found.groupdict().items() if word is not None}
    if "what" in told:
        clause = CLAUSES[rule].get(str(args.get("what")), "$^")
        if not re.search(clause.removesuffix(":"), sentence):
            yield f"says what {told['what']}, which is {args.get('what')!r}"
        del told["what"]
    if rule == "DS705" and MANY_CASES.get(str(args.get("case")), "\0") not in sentence:
        yield f"is not that of {args.get('case')!r}"
    for name in ("place", "other"):
        placed = isinstance(args.get(name), dict) and name in told
        if placed and told.pop(name) != _place(args[name]):
            yield f"says another {name} than {args[name]!r}"
    yield from _as_told(told, args)
    yield from _strangers(rule, sentence, args) if rule not in _WORDS else ()


def _place(place: dict[str, Any]) -> str:
    index = place["index"]
    return f"slot {place['slot']}.{place['subslot']}, index " + (
        f"0x{index:04X}" if index > 0xFF else str(index)
    )


def _as_told(told: dict[str, str], args: dict[str, Any]) -> Iterator[str]:
    for name, word in told.items():
        if name not in args:
            yield f"says {name} {word}, which is no argument"
        elif not {word, f"0x{word}"} & renderings(args[name]):
            yield f"says {name} {word}, which is {args[name]!r}"


def _strangers(rule: str, text: str, args: dict[str, Any]) -> Iterator[str]:
    """Numbers in a sentence that no argument has."""
    allowed = set(OWN.get(rule, ()))
    for value in args.values():
        for word in renderings(value):
            allowed |= {word, *re.findall(r"0x[0-9A-F]+|\d+", word)}
    for word in re.findall(r"0x[0-9A-F]+|[0-9A-F]{8}|\b\d+(?:\.\d+)*", text):
        if word not in allowed and "0x" + word not in allowed and not _part(word, allowed):
            yield f"says {word}, which is in no argument"


def _part(word: str, allowed: set[str]) -> bool:
    return any(word in each for each in allowed if len(each) > len(word))


def renderings(value: Any) -> set[str]:
    """The ways in which an argument may stand in a sentence."""
    if value is None:
        return {"-", "?", "no error number"}
    if isinstance(value, bool):
        return {str(value)}
    if isinstance(value, int):
        words = {str(value), f"0x{value:02X}", f"0x{value:04X}", f"0x{value:08X}", f"{value:.1f}"}
        return words | {f"{float(value):.3f}"}
    if isinstance(value, float):
        return {str(value), f"{value:.1f}", f"{value:.3f}", repr(value)}
    if isinstance(value, dict):
        own = "slot {}, index {}".format(value.get("slot"), value.get("index"))
        return {own, "{}.{}".format(value.get("slot"), value.get("subslot")), *(
            word for each in value.values() for word in renderings(each)
        )}  # fmt: skip
    if isinstance(value, list):
        parts = [str(each) for each in value]
        cut = [*parts[:4], "..."] if len(parts) > 4 else parts
        return {", ".join(parts), ", ".join(cut)} if parts else {"-"}
    text = str(value)
    return {text, text[:97] + "..." if len(text) > 100 else text}
