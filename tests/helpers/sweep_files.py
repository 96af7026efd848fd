"""Tables of sweeps, and trials to sweep."""

from __future__ import annotations

import csv
from pathlib import Path

import yaml


def rows(out: Path) -> list[dict[str, str]]:
    with (out / "sweep.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def copied(path: Path, folder: Path, **changes: object) -> Path:
    """A manifest like `path` in `folder`, with some keys changed."""
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    for key in ("subject", "kinematics"):
        content[key] = str(path.parent / content[key])
    content["forces"]["file"] = str(path.parent / content["forces"]["file"])
    folder.mkdir(exist_ok=True)
    made = folder / path.name
    made.write_text(yaml.safe_dump(content | changes), encoding="utf-8")
    return made
