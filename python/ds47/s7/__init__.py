"""S7 communication: who reads, writes and sends on TCP port 102, and is the data whole (docs/s7.md).

Bytes of a connection to jobs and transfers, each with its connection, its items and its times. Files are opened
elsewhere, and S7CommPlus, which shares the port, is named and left.
"""
