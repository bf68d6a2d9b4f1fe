"""The acyclic parameter channel: record calls to transactions, and what is wrong with them (docs/pairing.md).

Here: whose index 47 is (`index47`), which call belongs to which (`record_calls`, `pairing`), what a pair says
(`transactions`, `judge`, `readback`). Not here: frames and RPC (`ds47.profinet`), and the bytes of a message
(`ds47.profidrive`).
"""
