"""Parameter lists of users: read from CSV, XLSX and TOML, kept in their folder, looked up by device.

`lists` reads and checks, `columns` knows the usual headings, `store` keeps lists, `catalogue` says what a number
means on a device, `naming` adds that to transactions, `table` writes lists for Wireshark. spec/parameters.toml is
the list that ships with ds47; `ds47.profidrive.dictionary` has what a drive says about its own parameters.
"""
