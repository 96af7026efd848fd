"""The studies are scripts, not a package: their folder goes on the path."""

from __future__ import annotations

import sys
from pathlib import Path

STUDIES = str(Path(__file__).resolve().parents[2] / "studies")
if STUDIES not in sys.path:
    sys.path.insert(0, STUDIES)
