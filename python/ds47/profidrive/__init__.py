"""The PROFIdrive parameter channel without any I/O: messages to bytes and back.

Only names are collected here: `model` has the data, `formats` the values, `parameter` the decoder
and encoder. `build` makes messages, `notation` reads hexadecimal text and readable lines.
"""

from ds47.profidrive.build import build_request, error_block, make_block
from ds47.profidrive.model import Address, Block, Flaw, Options, Request, Response, Value
from ds47.profidrive.parameter import (
    decode_request,
    decode_response,
    encode_request,
    encode_response,
)

__all__ = [
    "Address",
    "Block",
    "Flaw",
    "Options",
    "Request",
    "Response",
    "Value",
    "build_request",
    "decode_request",
    "decode_response",
    "encode_request",
    "encode_response",
    "error_block",
    "make_block",
]
