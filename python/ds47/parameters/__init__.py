"""Parameter lists of users: read from CSV, XLSX and TOML, kept in a folder of theirs, looked up by device.

`lists` reads and checks, `columns` knows how tables of engineers name their columns, `store` keeps lists,
`catalogue` answers what a number means on a device, `naming` tells it of transactions, `table` writes lists
for Wireshark. What ds47 ships itself is spec/parameters.toml; what a drive
says of its own parameters is `ds47.profidrive.dictionary`.
"""
