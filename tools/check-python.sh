#!/bin/sh
# Says in a sentence what is wrong with the Python that is to make the environment; silent when nothing is.
python=$1
if ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
    echo "ds47 needs Python 3.11 or later: '$python' is not one. Choose it with: make PYTHON=/path/to/python3" >&2
    exit 1
fi
if ! "$python" -c 'import venv, ensurepip' 2>/dev/null; then
    echo "'$python' cannot make virtual environments. On Debian: apt-get install python3-venv" >&2
    exit 1
fi
