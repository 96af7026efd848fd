"""The layers, sources and versions that the project promises itself."""

from __future__ import annotations

import ast
import dataclasses
import functools
import graphlib
import inspect
import re
import tomllib
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsf_drake.model import parameters

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "vsf_drake"
FILES = sorted(PACKAGE.rglob("*.py"))
FLOORS = (
    "base",
    "laws",
    "model",
    "motion",
    "systems",
    "plants",
    "simulation",
    "collocation",
    "mujoco",
    "walks",
    "recording",
    "fit",
    "device",
    "tuning",
    "optimal_control",
    "validation",
    "engines",
    "report",
    "sessions",
    "cli",
)
RANK = {name: rank for rank, name in enumerate(FLOORS)}
WITHOUT_DRAKE = (
    "base/*.py",
    "model/parameters.py",
    "model/model_file.py",
    "model/bench_curves.py",
    "model/contact_file.py",
    "laws/*.py",
    "motion/**/*.py",
    "simulation/results.py",
    "simulation/archive.py",
    "walks/metrics.py",
    "walks/numbers.py",
    "walks/sweep_table.py",
    "walks/comparison.py",
    "device/bench_metrics.py",
    "device/protocols.py",
    "mujoco.py",
    "engines/assisted_model.py",
    "engines/certificate/in_mujoco.py",
    "report/style.py",
    "report/figures.py",
    "report/*_figure*.py",
    "report/outputs.py",
    "report/tuning/*.py",
    "report/validation/*_chapter.py",
)
ONLY = {
    "laws": {"laws", "base"},
    "collocation": {"collocation", "base"},
    "mujoco": {"mujoco", "base"},
}
"""What these import at all."""
OPTIMAL_CONTROL_FOR = {"optimal_control", "report", "cli", "validation/published_trends.py"}
"""Who imports optimal control."""
ENGINES_FOR = {"engines", "report", "cli"}
"""Who imports the files for other engines and their certificate."""


@functools.cache
def syntax(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@functools.cache
def imports(path: Path, *, types: bool = True) -> frozenset[str]:
    """Dotted names of all modules that a file imports, wherever in it; without `types` only those
    that it imports when it runs."""
    names = set()
    nodes = [*ast.walk(syntax(path))]
    for_types = [
        node
        for node in nodes
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
    ]
    if not types:
        without = {inner for node in for_types for inner in ast.walk(node)}
        nodes = [node for node in nodes if node not in without]
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            assert all(alias.name != "*" for alias in node.names), (
                f"{path}:{node.lineno}: star import"
            )
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(names)


def layer(path: Path) -> str:
    """Top-level part of the package that a file belongs to; "" for the package's own __init__."""
    first = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    return "" if first in ("__init__", "__main__") else first


@functools.cache
def modules() -> dict[str, Path]:
    """Files of the package by dotted name."""
    parts = {path: path.relative_to(ROOT).with_suffix("").parts for path in FILES}
    return {".".join(names).removesuffix(".__init__"): path for path, names in parts.items()}


def imported(path: Path, *, types: bool = True) -> set[str]:
    """Modules of the package among what `imports` finds."""
    found = set()
    for name in imports(path, types=types):
        while name and name not in modules():
            name = name.rpartition(".")[0]  # noqa: PLW2901
        found.add(name)
    return {name for name in found if name.startswith("vsf_drake.")}


def test_imports_run_one_way():
    assert {layer(path) for path in FILES} - {""} <= set(RANK), (
        "a part has no place among the floors: give it one"
    )
    wrong = []
    for path in FILES:
        own = layer(path)
        parts = {name.split(".")[1] for name in imported(path)}
        allowed = {part for part in RANK if own and RANK[part] <= RANK[own]} & ONLY.get(
            own, set(RANK)
        )
        wrong += [f"{path.relative_to(PACKAGE)}: {part}" for part in sorted(parts - allowed) if own]
    assert not wrong, "imports of what stands above, or is none of its: " + ", ".join(wrong)


def test_no_module_is_imported_by_what_it_imports():
    graphlib.TopologicalSorter(
        {name: imported(path, types=False) - {name} for name, path in modules().items()}
    ).prepare()


def test_optimal_control_is_for_its_command_and_the_published_effects():
    users = {
        layer(path) if layer(path) != "validation" else str(path.relative_to(PACKAGE))
        for path in FILES
        if any(name.startswith("vsf_drake.optimal_control") for name in imported(path))
    }
    assert users <= OPTIMAL_CONTROL_FOR


def test_files_for_other_engines_are_for_commands_and_a_page():
    users = {
        layer(path)
        for path in FILES
        if any(name.startswith("vsf_drake.engines") for name in imported(path))
    }
    assert users <= ENGINES_FOR


def test_drake_is_imported_from_its_public_modules_and_not_where_it_is_not_needed():
    wrong = []
    without = {path: pattern for pattern in WITHOUT_DRAKE for path in PACKAGE.glob(pattern)}
    for pattern in WITHOUT_DRAKE:
        assert pattern in without.values() or any(PACKAGE.glob(pattern)), (
            f"nothing matches {pattern}"
        )
    for path in FILES:
        for name in imports(path):
            first, *parts = name.split(".")
            if first == "pydrake" and (
                path in without or parts[0] == "all" or any(p[0] == "_" for p in parts)
            ):
                wrong.append(f"{path.relative_to(PACKAGE)}: {name}")
    assert not wrong, wrong


def test_threads_begin_and_foreign_files_are_parsed_in_one_place_for_each_kind():
    # that of the processes
    doors = {
        "threads.py": r"ThreadPoolExecutor\((?!workers, thread_name_prefix=\"sweep\")",
        "yaml_file.py": r"yaml\.(\w+_)?(load|compose|parse|scan)\w*\(|(?<!Package)(?<!Choice)Loader",  # noqa: E501
        # npz (but for what foreign interpreters read), json (but for a cache that trusts nothing)
        # and ~
        "files.py": (
            r"np\.(load|fromfile|memmap)\((?!folder / FILE, allow_pickle=False\))|allow_pickle=True"
            r"|json\.loads?\((?!arrays\.pop\(ABOUT\))"
            r"|(?<!os\.path)\.expanduser\("
        ),
    }
    wrong = [
        f"{path.relative_to(PACKAGE)}: {match[0]}"
        for path in FILES
        for door, pattern in doors.items()
        if path.name != door and (match := re.search(pattern, path.read_text(encoding="utf-8")))
    ]
    assert not wrong, wrong


def test_everything_public_is_described():
    """A template `Name_` around a class has its docstring there."""
    missing = []
    for path in FILES:
        nodes = [
            node for node in syntax(path).body if isinstance(node, (ast.FunctionDef, ast.ClassDef))
        ]
        described = [syntax(path)] if path.name != "__init__.py" else []
        described += [
            next((inner for inner in node.body if isinstance(inner, ast.ClassDef)), node)
            if node.name.endswith("_")
            else node
            for node in nodes
            if not node.name.startswith("_")
        ]
        missing += [
            f"{path.relative_to(PACKAGE)}: {getattr(node, 'name', '')}"
            for node in described
            if not ast.get_docstring(node)
        ]
    assert not missing, f"without docstring: {', '.join(missing)}"


def quantities() -> dict[str, Mapping[str, Any]]:
    """What is known of each number of the parameters, by class and field."""

    def numeric(hint: object) -> bool:
        return hint in (float, int) or any(numeric(part) for part in typing.get_args(hint))

    return {
        f"{name}.{field.name}": field.metadata
        for name, cls in inspect.getmembers(parameters, dataclasses.is_dataclass)
        for field in dataclasses.fields(cls)
        if numeric(typing.get_type_hints(cls)[field.name])
    }


def test_every_number_has_unit_source_and_range():
    about = quantities()
    assert len(about) > 70
    bad = [
        name
        for name, each in about.items()
        if not (each.get("unit") and each.get("source") and each["low"] < each["high"])
    ]
    assert not bad, bad


def test_sources_are_those_that_the_documentation_spells_out():
    page = (ROOT / "docs" / "sources.md").read_text(encoding="utf-8")
    listed = re.findall(r"^- (\*\*.*?\*\*):", page, flags=re.MULTILINE)
    names = [name for entry in listed for name in re.findall(r"\*\*(.*?)\*\*", entry)]
    assert len(names) >= 4
    known = (*names, "measured", "stated", "G10/FR4 data sheets", "studies/")
    unknown = [
        name
        for name, about in quantities().items()
        if not any(each in about["source"] for each in known)
    ]
    assert not unknown, unknown


def test_versions_that_were_run_are_those_that_are_claimed_and_allowed():
    """Drake changed its bindings from 1.57 to 1.58: a version that nobody has run is not let in."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    said = re.search(
        r"The tests ran .*?\)\.\s",
        (ROOT / "docs" / "guide" / "install.md").read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )[0]
    run = {entry.rsplit(" ", 1)[1] for entry in project["classifiers"] if "Python :: 3." in entry}
    assert set(re.findall(r"\b3\.\d+", said)) == run
    oldest, newest = (int(minor) for minor in re.findall(r"Drake 1\.(\d+)", said))
    allowed = re.compile(rf"drake>=1\.{oldest}(\.\d+)?,<1\.{newest + 1}")
    assert any(map(allowed.fullmatch, project["dependencies"]))


def test_readme_starts_with_install_and_test_commands():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```bash\n(.*?)^```$", readme, flags=re.MULTILINE | re.DOTALL)
    assert blocks[0].splitlines()[-1] == "vsf-drake validate --out results"
    assert blocks[1].splitlines()[-2:] == ["pip install '.[test,engines]'", "pytest"]


def test_the_page_on_the_architecture_names_every_part_and_nothing_else():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([\w./]+)`", page))
    lacking = {layer(path) for path in FILES if layer(path)} - named
    assert not lacking, f"docs/architecture.md does not name {', '.join(sorted(lacking))}"
    for name in named:
        if name.endswith(".py") and "/" in name:
            assert (PACKAGE / name).is_file() or (ROOT / name).is_file(), (
                f"docs/architecture.md: there is no {name}"
            )
