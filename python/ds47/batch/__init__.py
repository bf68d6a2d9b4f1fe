"""Many captures in one run: which there are, who analyses them, where the results go.

    names -> `tasks` -> `local` (processes here) or `cluster` (Dask workers) -> products, in order

A task is a capture, or a series of files read as one. What is made of a task is a *product*
(`products`): a spool for the report that is being written, or the stored result of a capture
(`results`). Both runners give the same products in the same order. How a report looks is the
business of `ds47.report`, the command line that of `ds47.cli`.
"""
