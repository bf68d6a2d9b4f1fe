"""Watching a line live: transactions as they finish, findings as they happen.

    dumpcap or a pipe -> `feed` -> capture -> `traffic` (the analysis that hands out at once) -> `show`

Nothing here keeps what is finished: memory does not grow with the time that a watch runs.
"""
