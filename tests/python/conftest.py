"""Puts this folder on the path: tests import the helper modules beside them (frames.py)."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
