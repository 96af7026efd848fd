"""The studies and the examples are scripts, not packages: their folders go on the path."""

from __future__ import annotations

import sys
from pathlib import Path

STUDIES = Path(__file__).resolve().parents[2] / "studies"
for folder in (str(STUDIES / "examples"), str(STUDIES)):
    if folder not in sys.path:
        sys.path.insert(0, folder)
