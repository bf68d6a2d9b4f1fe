"""The acyclic parameter channel: record calls to transactions, and what is wrong with them (docs/pairing.md).

Here: whether index 47 is ours (`index47`), which call belongs to which (`record_calls`, `record_events`,
`pairing`), what a pair means (`transactions`, `judge`, `readback`). Not here: frames and RPC (`ds47.profinet`),
and the bytes of a message (`ds47.profidrive`).
"""
