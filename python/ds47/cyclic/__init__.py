"""The channels inside cyclic frames: PKW (parameters) and PZD (control, status, setpoints).

Here are words and what they say (docs/cyclic.md): `pkw` the four words of a request or an answer, `pzd`
the control and the status word. Frames, and which bytes of them are a channel, are not known here.
"""
