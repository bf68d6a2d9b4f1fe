"""The parameter channel as scapy layers, below those of scapy.contrib.pnio_rpc.

    from ds47.scapy import DS47Request
    for packet in rdpcap("drive.pcapng"):
        if DS47Request in packet:
            print(packet[DS47Request].pnu)

Importing this binds the layers (and `scapy.contrib.pnio_rpc` to UDP port 34964, which scapy
leaves to the user). Bytes are decoded and made by `ds47.profidrive`: here are names for scapy only.
Scapy looks at one packet: fragments are not put together, and no request says what a response is
about. docs/engines.md has examples. The only room that needs scapy when it is imported.
"""

from ds47.scapy.layers import DS47Address, DS47Block, DS47Request, DS47Response

__all__ = ["DS47Address", "DS47Block", "DS47Request", "DS47Response"]
