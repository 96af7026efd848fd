"""What need not run again: slow tests and studies that stand on what they did when they passed.

`tests/checked.json` holds a digest for each file of them. A run that has passed writes it, nobody
else: `pytest -m slow --all`, and `CI_FULL=1 .ci/run` for both. As a command it says which of the
files it is given changed since, and with `--passed` notes them.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import re
import sys
import tomllib
from collections.abc import Iterable
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "studies"))

from contact_fit_study.keeping import sources  # noqa: E402

import vsf_drake  # noqa: E402

STORED = ROOT / "tests" / "checked.json"
PROMISED = re.compile(
    r"^\s*import vsf_drake as |"
    rf"^\s*from vsf_drake import \(?[\w\s,]*\b({'|'.join(vsf_drake.__all__)})\b",
    re.MULTILINE,
)
"""Names that are only imported when they are used."""
ALWAYS = (
    "tests/fuzz",
    "tests/simulation/batch",
    "tests/test_readme.py",
    "tests/test_real_walks.py",
    "tests/test_checked.py",
)
"""Damaged files that are drawn, processes that are killed; an installation; recordings that lie
outside the repository; what is said here."""
OF_CODE = re.compile(r'"-[cm]"')
"""A process that runs code or a module, whose imports nobody sees."""
SHOWN = "tests/docs"
"""Pages quote code, docstrings and comments: their tests stand on every source as it is written."""


def guarded(within: Iterable[str] = (str(ROOT),)) -> list[str]:
    """Files whose slow tests only run if something changed, as far as they lie `within` a file or
    folder: all but those in which chance or the clock has a part."""
    asked = [Path(one.partition("::")[0]).resolve() for one in within]
    return sorted(
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "tests").rglob("test_*.py")
        if any(path.is_relative_to(one) for one in asked)
        and not any(path.is_relative_to(ROOT / folder) for folder in ALWAYS)
        and "mark.slow" in path.read_text(encoding="utf-8")
    )


def inputs_sha256(file: str) -> str:
    """Of what the test file or study stands on, by its path from the root.

    What it says and whatever it imports or names of this repository, comments, docstrings and
    layout aside; what lies beside those sources (templates, stored results); models and data;
    Python's minor version and the versions of what the package stands on. For tests of pages all
    there is.
    """
    above = [folder / "conftest.py" for folder in (ROOT / file).parents]
    above = [path for path in above if path.is_file()]
    wanted = names(ROOT / file, ast.arg)
    used = (path for path in above if wanted & names(path, ast.FunctionDef))
    text = (ROOT / file).read_text(encoding="utf-8")
    mentioned = {
        folder / name
        for name in re.findall(r"\w[\w/]*\.\w+", text)
        for folder in imported_from()
        if (folder / name).is_file()
    }
    start = {ROOT / file, *used, *(path for path in mentioned if path.suffix == ".py")}
    said = sources(start, imported_from())
    if OF_CODE.search(text) or any(promised(path) for path in said):
        said = sources(start | set((ROOT / "vsf_drake").rglob("*.py")), imported_from())
    folders = {path.parent for path in said}
    beside = ("vsf_drake", "studies", "docs")
    whole = ("data", "models")
    read = {ROOT / "pyproject.toml", *above, *mentioned}
    read |= {
        path
        for folder in beside
        for path in files_under(folder)
        if path.suffix != ".py" and belongs_to(path) in folders
    }
    if file.startswith(SHOWN):
        whole = (*whole, *beside)
        read |= set(ROOT.glob("*.md"))
    read |= {path for folder in whole for path in files_under(folder)}
    named = {
        "says": {path.relative_to(ROOT).as_posix(): digest for path, digest in said.items()},
        "reads": {path.relative_to(ROOT).as_posix(): of_bytes(path) for path in read},
        "versions": versions(file.startswith(SHOWN)),
    }
    return hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()


@cache
def promised(path: Path) -> bool:
    """Whether a source uses what the package only imports then."""
    text = path.read_text(encoding="utf-8")
    return path != ROOT / "vsf_drake" / "__init__.py" and bool(PROMISED.search(text))


@cache
def names(path: Path, kind: type) -> set[str]:
    """Of arguments, by which tests ask for fixtures, or of the functions that a source defines."""
    found = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return {getattr(node, "arg", None) or node.name for node in found if isinstance(node, kind)}


@cache
def imported_from() -> tuple[Path, ...]:
    """Folders that tests and studies import from."""
    options = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pytest"]
    return ROOT, *(ROOT / folder for folder in options["ini_options"]["pythonpath"])


@cache
def files_under(folder: str) -> tuple[Path, ...]:
    """All but what Python, numba and Sphinx leave there."""
    left = {"__pycache__", "_build", "api"}
    found = (ROOT / folder).rglob("*")
    return tuple(path for path in found if path.is_file() and not left & set(path.parts))


@cache
def belongs_to(path: Path) -> Path:
    """The nearest folder above with sources."""
    return next(folder for folder in path.parents if any(folder.glob("*.py")) or folder == ROOT)


@cache
def of_bytes(path: Path) -> str:
    """The digest of a file as it is."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def versions(pages: bool) -> list[str]:
    """Of Python and of what numbers come from; for pages of what makes them, too."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = project["dependencies"] + (project["optional-dependencies"]["docs"] if pages else [])
    names = {re.match(r"[\w-]+", one)[0] for one in named} - {"vsf-drake"}
    python = f"python {sys.version_info.major}.{sys.version_info.minor}"
    return [python, *(f"{name} {metadata.version(name)}" for name in sorted(names))]


def stored() -> dict[str, str]:
    """The digests of what passed, by file."""
    return json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}


def note(passed: dict[str, str]) -> None:
    """Stores the digests of what has passed just now beside those of other files."""
    all_of = {file: digest for file, digest in stored().items() if (ROOT / file).is_file()} | passed
    STORED.write_text(json.dumps(all_of, indent=1, sort_keys=True) + "\n", encoding="utf-8")


class Passed:
    """Notes of which files all slow tests passed, none failed and none was skipped."""

    def __init__(self, digests: dict[str, str]) -> None:
        self.digests = digests
        self.ran: dict[str, bool] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Of one phase of one test."""
        if "slow" in report.keywords:
            file, _, _ = report.nodeid.partition("::")
            self.ran[file] = self.ran.get(file, True) and report.passed

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Nothing of a run that was of a part or that was broken off."""
        config = session.config
        whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS
        whole = whole and config.option.markexpr in ("slow", "") and not config.option.keyword
        if whole and not session.shouldfail and not session.shouldstop:
            passed = {file for file, well in self.ran.items() if well}
            note({file: self.digests[file] for file in passed & set(self.digests)})


def digests(files: Iterable[str]) -> dict[str, str]:
    """By file."""
    return {file: inputs_sha256(file) for file in files}


def main() -> None:
    """Prints which of the files changed since they passed, or notes that they have."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("files", nargs="+")
    parser.add_argument("--passed", action="store_true", help="they have, just now")
    given = parser.parse_args()
    now = digests(given.files)
    if given.passed:
        note(now)
    else:
        print(*(file for file in now if stored().get(file) != now[file]), sep="\n")


if __name__ == "__main__":
    main()
