"""`python -m ds47`: the same as the `ds47` command. Nothing else lives here."""

import sys

from ds47.cli import main

if __name__ == "__main__":
    sys.exit(main())
