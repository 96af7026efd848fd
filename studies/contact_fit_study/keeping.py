"""Finished parts of a long study, one file each: after an interruption only what is missing is
done.

And what the numbers of a study come from: the digest of its sources knows what they do, not how
they are written.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from vsf_drake.base.files import plain, write_json

STUDIES = Path(__file__).resolve().parents[1]
ONLY_SHOWS = (
    STUDIES.parent / "vsf_drake" / "report",
    STUDIES / "contact_fit_study" / "figures.py",
    STUDIES / "contact_fit_study" / "table.py",
)
MADE = "made by these sources"


def made_by(script: str) -> dict[str, str]:
    """For the provenance of what the study `script` made just now; see
    `studies/check_stored.py`."""
    return {"sha256": sources_sha256(STUDIES / script), "numbers": MADE}


def sources_sha256(script: Path) -> str:
    """Of `script` and of all that it imports, however far, of studies and package, but for what
    only shows.

    It changes with what the code says, not with comments, docstrings and format; with Python's
    minor version too.
    """
    found = sources({script}, but=ONLY_SHOWS)
    named = [
        (path.relative_to(STUDIES.parent).as_posix(), said) for path, said in sorted(found.items())
    ]
    return hashlib.sha256(json.dumps(named).encode()).hexdigest()


def sources(
    start: set[Path],
    roots: tuple[Path, ...] = (STUDIES, STUDIES.parent),
    but: tuple[Path, ...] = (),
) -> dict[Path, str]:
    """What sources say, as digests: those of `start` and all that they import from `roots`, however
    far, without what lies in `but`."""
    found: dict[Path, str] = {}
    waiting = set(start)
    while waiting:
        path = waiting.pop()
        found[path], imported = meaning(path, roots)
        waiting |= {
            file
            for file in imported
            if file not in found and not any(file.is_relative_to(part) for part in but)
        }
    return found


@cache
def meaning(
    path: Path, roots: tuple[Path, ...] = (STUDIES, STUDIES.parent)
) -> tuple[str, set[Path]]:
    """What a source says, as a digest, and the files that it imports from `roots`."""
    tree, names = ast.parse(path.read_text(encoding="utf-8")), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            within = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
            names |= {within + alias.name for alias in node.names}
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "import_module":
            # of a name that is put together: any module of that package
            folder = ast.unparse(node.args[0]).strip("f\"'").partition("{")[0]
            names |= {
                folder + file.stem
                for root in roots
                for file in root.joinpath(*folder.strip(".").split(".")).glob("*.py")
            }
        elif isinstance(getattr(node, "body", None), list):
            node.body = [
                line
                for line in node.body  # type: ignore[attr-defined]
                if not (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant))
            ]
    stems = {
        root.joinpath(*name.split(".")[: n + 1])
        for name in names
        if name.partition(".")[0] in beginnings(roots)
        for n in range(name.count(".") + 1)
        for root in roots
    }
    files = {
        file
        for stem in stems
        for file in (stem.with_suffix(".py"), stem / "__init__.py")
        if file.is_file()
    }
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest(), files


@cache
def beginnings(roots: tuple[Path, ...]) -> frozenset[str]:
    """What the name of a module in `roots` can begin with."""
    return frozenset(path.stem for root in roots for path in root.iterdir())


def kept(
    folder: Path, name: str, key: str, make: Callable[[], dict[str, Any]]
) -> tuple[dict[str, Any], bool]:
    """What `make` gives, from `folder` if it was made there with the same `key`.

    Returns:
        The part, and whether it was there.
    """
    path = folder / f"{name}.json"
    if path.exists():
        found = json.loads(path.read_text(encoding="utf-8"))
        if found["key"] == key:
            return found["part"], True
    folder.mkdir(parents=True, exist_ok=True)
    part: dict[str, Any] = plain(make())
    write_json(path, {"key": key, "part": part})
    return part, False
