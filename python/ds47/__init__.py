"""ds47: the PROFIdrive parameter channel (record 47, 0xB02E, 0xB02F) of PROFINET captures as transactions.

Only the version lives here. Import what you need from the rooms: `ds47.profidrive` (the codec),
`ds47.capture` (files), `ds47.profinet` (transport), `ds47.analysis` (capture to transactions),
`ds47.report` (a result to text, JSON, CSV).
"""

__version__ = "0.1.0"
__all__ = ["__version__"]
