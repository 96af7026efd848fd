"""`vsf-drake doctor`: what this installation is made of, and what it lacks."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import re
import sys

from vsf_drake.base.errors import SimulationError
from vsf_drake.cli.app import app, fail, print_text

_REQUIREMENT = re.compile(r"(?P<name>[\w.-]+)[^;]*;.*extra == ['\"](?P<extra>\w+)['\"]")
_ENGINES = ("opensim", "mujoco", "exudyn")
"""Packages, and their groups, that `certify` compares with Drake and with the stepper."""
_FOR_USERS = ("tables", "cluster", "bench", "spm", "docs", *_ENGINES)
"""Groups of packages that a command or a method asks for."""


@app.command()
def doctor() -> None:
    """Prints versions, cores, solvers, optional packages and the compiled code that is kept;
    presses the foot once."""
    try:
        from pydrake.solvers import ClarabelSolver, IpoptSolver, NloptSolver, SnoptSolver
    except Exception as error:
        # of any kind: a library that is missing, a numpy that does not fit, a foreign module
        _say_drake_is_missing()
        fail(f"Drake cannot be imported: {type(error).__name__}: {error}")
        sys.exit(SimulationError.exit_code)

    from vsf_drake.device.bench_metrics import bench_table
    from vsf_drake.laws.compiled import kept_code
    from vsf_drake.model.parameters import ModelParameters
    from vsf_drake.simulation.archive import provenance
    from vsf_drake.simulation.bench import run_bench

    before = kept_code()
    try:
        pressed = bench_table(run_bench(ModelParameters(), fulcrums_m=[0.108], heel=False))
        stiffness = pressed.settings[0].stiffness_n_per_mm
        broken = ""
    except SimulationError as error:
        stiffness = None
        broken = str(error)
    solvers = {
        solver.solver_id().name(): solver.available() and solver.enabled()
        for solver in (SnoptSolver(), IpoptSolver(), NloptSolver(), ClarabelSolver())
    }
    print_text(
        "doctor",
        python=sys.executable,
        system=platform.platform(),
        versions=provenance()["versions"],
        cores=os.cpu_count(),
        usable=len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None,
        solvers=solvers,
        engines={name: _version(name) for name in _ENGINES},
        lacking=_lacking(),
        before=before,
        after=kept_code(),
        stiffness=stiffness,
    )
    if broken or not all(solvers.values()):
        fail(broken or "a solver that Drake's own wheel has is missing: install Drake from PyPI")
        sys.exit(SimulationError.exit_code)


def _say_drake_is_missing() -> None:
    """Prints where this Python looks for Drake and what to do; without Drake nothing else can be
    asked."""
    found = importlib.util.find_spec("pydrake")
    installed = next(iter(importlib.metadata.distributions(name="drake")), None)
    own = installed and str(installed.locate_file("pydrake/__init__.py"))
    needed = next(
        line for line in importlib.metadata.requires("vsf-drake") or () if line.startswith("drake")
    )
    print_text(
        "no_drake",
        version=importlib.metadata.version("vsf-drake"),
        drake=installed and installed.version,
        needed=needed,
        found=found and found.origin,
        own=own,
        system=platform.platform(),
        python=sys.executable,
        python_version=platform.python_version(),
    )


def _lacking() -> dict[str, list[str]]:
    """By optional group the packages that are not installed; none of a group that is complete."""
    groups: dict[str, list[str]] = {}
    for line in importlib.metadata.requires("vsf-drake") or ():
        found = _REQUIREMENT.match(line)
        wanted = found and found["extra"] in _FOR_USERS and found["name"] != "vsf-drake"
        if found and wanted and _version(found["name"]) is None:
            groups.setdefault(found["extra"], []).append(found["name"])
    return groups


def _version(package: str) -> str | None:
    """None for a package that is not installed."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
