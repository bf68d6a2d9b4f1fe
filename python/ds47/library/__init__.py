"""What `import ds47` gives: captures, a line that goes on, messages (docs/python.md).

Only what the page promises lives here; the rooms below are for the program itself and may change.
"""
