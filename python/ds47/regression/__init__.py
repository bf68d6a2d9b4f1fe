"""Regression over stored captures: `ds47.toml`, stored results, and what changed against them.

Pure, but for `baseline`, which reads and writes the files, and `run`, which analyses captures.
"""
