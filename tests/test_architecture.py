"""The layers, sources, sizes and versions that the project promises itself."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import tomllib
import typing
from pathlib import Path

import pytest
import yaml

from vsf_drake import parameters

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "vsf_drake"
FILES = sorted(PACKAGE.rglob("*.py"))
BESIDE_LAWS = ("errors", "files", "text_table", "yaml_file", "schema", "ground",
               "parameters", "model_file", "bench_curves", "contact_file",
               "sentences", "motion", "scenario")
LAYERS = ("laws", "systems", "plants", "simulation", "collocation", "analysis", "report", "cli")
RANK = {name: 0 for name in BESIDE_LAWS} | {name: rank for rank, name in enumerate(LAYERS)}
WITHOUT_DRAKE = (
    *(f"{name}.py" for name in ("errors", "files", "text_table", "yaml_file", "schema",
                                "parameters", "model_file", "bench_curves", "contact_file")),
    "laws/*.py", "motion/**/*.py", "simulation/results.py", "simulation/archive.py",
    "analysis/metrics.py", "analysis/sweep_table.py", "analysis/comparison.py", "analysis/bench_metrics.py",
    "report/style.py", "report/figures.py", "report/*_figure*.py", "report/outputs.py",
    "report/tuning/*.py", "report/validation/*_chapter.py",
)
MOST_LINES = 700

every_file = pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))


def imports(path: Path) -> set[str]:
    """Dotted names of all modules that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            assert all(alias.name != "*" for alias in node.names), f"{path}:{node.lineno}: star import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def layer(path: Path) -> str:
    """Top-level part of the package that a file belongs to; "" for the package's own __init__."""
    first = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    return "" if first in ("__init__", "__main__") else first


@every_file
def test_imports_run_one_way(path):
    own = layer(path)
    assert not own or own in RANK, f"{own} has no place among the layers: give it one"
    parts = {name.split(".")[1] for name in imports(path) if name.startswith("vsf_drake.")}
    for part in parts & set(RANK) if own else ():
        assert RANK[part] <= RANK[own], f"{own} imports {part}, which stands above it"
        if own == "laws":
            assert part in ("laws", "errors"), f"a law imports {part}"
        if own == "collocation":
            assert part in ("collocation", "errors", "schema", "files"), f"collocation imports {part}"


@every_file
def test_drake_is_imported_from_its_public_modules(path):
    for name in imports(path):
        assert not name.startswith("pydrake.all"), "pydrake.all loads everything"
        assert not any(part.startswith("_") for part in name.split(".")[1:]) or not name.startswith("pydrake"), name


@every_file
def test_foreign_files_are_parsed_in_one_place_for_each_kind(path):
    doors = {"yaml": ("yaml_file.py", r"yaml\.(\w+_)?(load|compose|parse|scan)\w*\(|(?<!Package)(?<!Choice)Loader"),
             "npz": ("files.py", r"np\.(load|fromfile|memmap)\(|allow_pickle=True"),
             "json": ("files.py", r"json\.loads?\((?!arrays\.pop\(ABOUT\))"),  # a cache that trusts nothing
             "~": ("files.py", r"(?<!os\.path)\.expanduser\(")}
    text = path.read_text(encoding="utf-8")
    for kind, (door, pattern) in doors.items():
        assert path.name == door or not re.search(pattern, text), kind


@pytest.mark.parametrize("pattern", WITHOUT_DRAKE)
def test_laws_motion_results_and_figures_know_no_drake(pattern):
    paths = sorted(PACKAGE.glob(pattern))
    assert paths, f"nothing matches {pattern}"
    for path in paths:
        assert not any(name.split(".")[0] == "pydrake" for name in imports(path)), path


def test_a_file_is_one_thought_that_a_reader_wants_to_see_at_once():
    lines = [len(path.read_text(encoding="utf-8").splitlines()) for path in FILES if path.name != "__init__.py"]
    assert max(lines) < MOST_LINES
    assert 150 <= sum(lines) / len(lines) <= 300


def described(node: ast.AST) -> bool:
    """Whether it has a docstring, or is a template `Name_` around a class that has one."""
    if node.name.endswith("_"):
        return any(isinstance(inner, ast.ClassDef) and ast.get_docstring(inner) for inner in node.body)
    return bool(ast.get_docstring(node))


@every_file
def test_everything_public_is_described(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    if path.name != "__init__.py":
        assert ast.get_docstring(tree), "the module has no docstring"
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
    missing = [node.name for node in tree.body
               if isinstance(node, kinds) and not node.name.startswith("_") and not described(node)]
    assert not missing, f"without docstring: {', '.join(missing)}"


def numeric(hint: object) -> bool:
    """Whether a type holds numbers: float, int, or a union or a container of them."""
    return hint in (float, int) or any(numeric(part) for part in typing.get_args(hint))


def quantities():
    for name, cls in inspect.getmembers(parameters, dataclasses.is_dataclass):
        hints = typing.get_type_hints(cls)
        for field in dataclasses.fields(cls):
            if numeric(hints[field.name]):
                yield pytest.param(field, id=f"{name}.{field.name}")


@pytest.mark.parametrize("field", list(quantities()))
def test_every_number_has_unit_source_and_range(field):
    assert field.metadata.get("unit"), "unit"
    assert field.metadata.get("source"), "source"
    assert field.metadata["low"] < field.metadata["high"], "range"


def test_sources_are_those_that_the_readme_spells_out():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    listed = re.findall(r"^- (\*\*.*?\*\*):", readme, flags=re.MULTILINE)
    names = [name for entry in listed for name in re.findall(r"\*\*(.*?)\*\*", entry)]
    assert len(names) >= 4
    known = (*names, "measured", "stated", "G10/FR4 data sheets", "studies/")
    for parameter in quantities():
        source = parameter.values[0].metadata["source"]
        assert any(name in source for name in known), f"{parameter.id}: {source!r}"


def test_versions_agree():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    changelog = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert changelog[0] == version
    assert str(citation["version"]) == version
    assert citation["references"][0]["doi"] == "10.1115/1.4050456"


def test_versions_that_were_run_are_those_that_are_claimed_and_allowed():
    """Drake changed its bindings from 1.57 to 1.58: a version that nobody has run is not let in."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    said = re.search(r"Its tests ran .*?;", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.DOTALL)[0]
    run = {entry.rsplit(" ", 1)[1] for entry in project["classifiers"] if "Python :: 3." in entry}
    assert set(re.findall(r"\b3\.\d+", said)) == run
    oldest, newest = (int(minor) for minor in re.findall(r"Drake 1\.(\d+)", said))
    assert f"drake>=1.{oldest},<1.{newest + 1}" in project["dependencies"]


def test_readme_starts_with_install_and_test_commands():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```bash\n(.*?)^```$", readme, flags=re.MULTILINE | re.DOTALL)
    assert blocks[0].splitlines()[-1] == "vsf-drake validate --out results"
    assert blocks[1].splitlines()[-2:] == ["pip install '.[test]'", "pytest"]
