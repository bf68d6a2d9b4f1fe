"""The version of ds47, and nothing else: every room may import it. `tools/set_version.py` changes it."""

__version__ = "2.0.0.dev0"
