"""Regression over stored captures: `ds47.toml`, stored results, and what changed against them.

Pure except for `baseline`, which reads and writes files, and `run`, which analyses captures.
"""
