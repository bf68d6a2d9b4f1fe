"""What `import ds47` gives: one capture, one message (docs/python.md).

Only what the page promises lives here; the rooms below are for the program itself and may change.
"""
