"""The channels inside cyclic frames: PKW (parameters) and PZD (control, status, setpoints; docs/cyclic.md).

`pkw` decodes the four words of a request or an answer, `pzd` the control and the status word. `relations` and
`channels` find them in frames.
"""
