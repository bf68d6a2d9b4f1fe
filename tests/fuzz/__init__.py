"""Fuzzing guided by coverage: `python -m tests.fuzz`, or `make fuzz`.

`targets.py` says what is fuzzed, `__main__.py` runs it by atheris. What once broke a target, and inputs that reach
far into it, stay in `kept/`: test_fuzz.py gives them to the targets without atheris.
"""
