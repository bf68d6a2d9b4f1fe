"""S7 communication: who reads, writes and sends on TCP port 102, and is the data consistent (docs/s7.md)?

Turns the bytes of a connection into jobs and transfers, each with its connection, its items and its times. Opens
no files. Counts S7CommPlus, which shares the port, but does not decode it.
"""
