"""Writes one page for each public module, grouped by layer."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import pkgutil
import shutil
from pathlib import Path
from types import ModuleType

import vsf_drake

LAYERS = {
    "laws": "Laws: pure functions of arrays, without Drake",
    "systems": "Systems: LeafSystems that evaluate a law and pack its forces",
    "plants": "Plants: foot, socket, person; bench and gait diagrams",
    "motion": "Motion: recordings in, joint trajectories out",
    "simulation": "Simulation: the stepper, Drake's Simulator, results on disk",
    "collocation": "Collocation: optimal control of any trajectory problem",
    "mujoco": "MuJoCo: contact in newtons and metres for any model",
    "walks": "Walks: a recorded trial walked and compared",
    "recording": "Recording: import and checks of a laboratory's files",
    "fit": "Fit: contact, geometry and errors of motion to plates",
    "device": "Device: the foot with nobody on it",
    "tuning": "Tuning: stiffness for a person whose motion stays",
    "optimal_control": "Optimal control: stiffness for a person who adapts",
    "validation": "Validation: one module a chapter",
    "engines": "Engines: the foot for other programs, and their certificate",
    "report": "Report: figures and pages of saved results",
    "sessions": "Sessions: from a folder of recordings to a verdict",
    "cli": "Command line",
    "model": "Model: device, person, contact, ground, bench, scenario",
    "base": "Base: errors, files, records, tables, sentences",
}
OWN_PAGES = ("laws", "systems", "plants", "model")
"""Layers whose modules have a page each; in the others a package is one page."""
SHOWN_PRIVATE = ("vsf_drake.systems._system",)
"""Private modules whose class every system shows: `GetParameter`, `SetParameters`."""

ENGINES = ("exudyn", "mujoco", "opensim")
"""Optional packages that modules stand on."""


def public_modules() -> list[ModuleType]:
    """All modules of the package but private ones and packages that say nothing, imported; without
    those of engines that are not installed."""
    found = [info.name for info in pkgutil.walk_packages(vsf_drake.__path__, "vsf_drake.")]
    modules = []
    for name in sorted(found):
        if name in SHOWN_PRIVATE or "._" not in name:
            try:
                modules.append(importlib.import_module(name))
            except ModuleNotFoundError as error:
                if error.name not in ENGINES:
                    raise
    return modules


def layer(name: str) -> str:
    """The layer of the module `name`."""
    return name.split(".")[1]


def page_of(name: str) -> str:
    """The page that the module `name` stands on: its own where layers are to be composed, else its
    package's."""
    own = (
        layer(name) in OWN_PAGES
        or importlib.util.find_spec(name).submodule_search_locations is not None
    )
    return name if own or name.count(".") == 1 else name.rsplit(".", 1)[0]


def headed(text: str, sign: str) -> list[str]:
    """A heading in reStructuredText."""
    return [text, sign * len(text), ""]


def page(name: str, modules: list[ModuleType]) -> str:
    """The page of one module, or of the modules of a package, in reStructuredText."""
    title = f"``{name.removeprefix('vsf_drake.')}``"
    if name in SHOWN_PRIVATE:
        title = (modules[0].__doc__ or "").splitlines()[0].rstrip(".")
    lines = headed(title, "=")
    for module in modules:
        if len(modules) > 1 and module.__name__ != name:
            lines += headed(f"``{module.__name__.rsplit('.', 1)[1]}``", "-")
        lines += [f".. automodule:: {module.__name__}"]
        members = described(Path(module.__file__ or ""))
        lines += [f"   :members: {', '.join(members)}", ""] if members else [""]
    return "\n".join(lines)


def described(path: Path) -> list[str]:
    """Public names that a module defines and describes, in its order."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    names = []
    for node, following in zip(body, [*body[1:], None], strict=False):  # an empty file has no node
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                if ast.get_docstring(node):
                    names.append(name)
            case ast.Assign(targets=[ast.Name(id=name)]) | ast.AnnAssign(target=ast.Name(id=name)):
                if isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant):
                    names.append(name)
    return [name for name in names if not name.startswith("_")]


def index(title: str, modules: list[str]) -> str:
    """The page of one layer: a list of its modules' pages."""
    return "\n".join(
        [
            title,
            "=" * len(title),
            "",
            ".. toctree::",
            "   :maxdepth: 1",
            "",
            *(f"   {name}" for name in modules),
            "",
        ]
    )


def write(folder: Path, modules: list[ModuleType], more: dict[str, str]) -> None:
    """Writes pages and indices, and `more` by file name, into `folder`; what has not changed is
    left alone, what no longer exists goes."""
    folder.mkdir(exist_ok=True)
    grouped: dict[str, list[ModuleType]] = {}
    for module in modules:
        grouped.setdefault(page_of(module.__name__), []).append(module)
    pages = {
        f"{name}.rst": page(name, group)
        for name, group in grouped.items()
        if any(m.__doc__ for m in group)
    }
    names = [name.removesuffix(".rst") for name in pages]
    for key, title in LAYERS.items():
        pages[f"{key}.rst"] = index(title, [name for name in names if layer(name) == key])
    pages = pages | more | {"index.rst": index("API reference", list(LAYERS))}
    for old in folder.iterdir():
        if old.name not in pages:
            old.unlink() if old.is_file() else shutil.rmtree(old)
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
