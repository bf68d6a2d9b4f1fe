"""The base of what the library raises on purpose: `except ds47.Error` takes them all."""


class Error(Exception):
    """One line for a person: what happened, to which input, what to do about it."""
