"""PROFINET transport: from frames to record calls.

`link` gives packets out of frames (with `ip` for fragments), `dcp` and `lldp` name the stations,
`rpc` and what follows it read the calls. Files are opened in `ds47.capture`, records are decoded in
`ds47.profidrive`.
"""
