"""Runs the certificate: asks every engine that is there, each in a process of its own, and judges
what they answer."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import plain, read_npz, table_of
from vsf_drake.base.progress import Progress, part_of
from vsf_drake.base.schema import to_plain
from vsf_drake.base.threads import side_by_side
from vsf_drake.engines.certificate.ask import ask
from vsf_drake.engines.certificate.rows import FAILED, NOT_RUN, ROWS, Judged, agree, judged
from vsf_drake.engines.condensed_error import CondensedError
from vsf_drake.model.parameters import FootParameters
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.processes import cores

REFERENCE = "stepper"
"""This package, with which the others are compared."""
LONGEST_S = 1200.0
"""That an engine may take."""
FORMAT = "vsf_drake certificate 2"


@dataclass(frozen=True, kw_only=True)
class Engine:
    """Who can answer."""

    name: str
    label: str
    module: str  # beside this one
    package: str  # that has it
    least: str  # version of it that is known to work


@dataclass(frozen=True, kw_only=True)
class Ran:
    """What became of an engine."""

    name: str
    label: str
    status: str  # "" where it answered, else NOT_RUN or FAILED
    version: str | None  # that it says it has
    why: str  # it did not answer


@dataclass(frozen=True, kw_only=True, eq=False)
class Certificate:
    """What all engines answered, and the verdict."""

    engines: tuple[Ran, ...]
    rows: tuple[Judged, ...]
    table: dict[str, Any]  # all of this as certificate.json has it
    arrays: dict[str, np.ndarray]  # ENGINE/ANSWER, without mass matrices

    @property
    def agreed(self) -> bool:
        """See `rows.agree`."""
        return agree(self.rows)


KEPT = ("fulcrum_mm", "load_n", "time_s", "roll_fulcrum_mm", "poses_rad")
"""Of what was asked (`Asked`) what the results hold."""
ENGINES = {row["name"]: Engine(**row) for row in table_of("engines/certificate/engines.csv")}


def certify(
    parameters: FootParameters,
    *,
    engines: Sequence[str] | None = None,
    inputs: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> Certificate:
    """Has every engine compute the foot from its exported file, and compares the answers.

    Args:
        engines: packages of `ENGINES`, without this one, that must be there, each for all that it
            is asked; None takes those that are, and says which are not.
        inputs: SHA-256 of the files that the parameters come from, by name.

    Raises:
        InputError: there is no such engine; it is not installed, or of a version that is too old; a
            fulcrum position is out of the foot's reach, its support does not move, its keel thins,
            or a part of its sole bears nothing.
        SimulationError: the foot cannot be rolled over, or finds no rest under a load.
        FitError: no condensed foot stands for it.
    """
    others = list(dict.fromkeys(e.package for e in ENGINES.values() if e.name != REFERENCE))
    for name in engines or ():
        right = f"There are {', '.join(others)}"
        require(name in others, f"{name!r} is no engine", "engines", right)
        require(not missing(ENGINES[name]), missing(ENGINES[name]), name)
    packages = {ENGINES[name].package for name in (*(engines or ENGINES), REFERENCE)}
    chosen = [engine for engine in ENGINES.values() if engine.package in packages]
    show = part_of(progress)
    show("asking", 0.0)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        asked, condensed = ask(folder, parameters)
        show("asking", 0.1)
        ran, answers = run(folder, chosen, part_of(progress, 0.1, 0.85))
    own = {name: np.asarray(getattr(asked, name)) for name in KEPT}
    return certificate_of(parameters, own, ran, answers, condensed, inputs or {})


def certificate_of(
    parameters: FootParameters,
    asked: Mapping[str, np.ndarray],
    ran: Mapping[str, Ran],
    answers: Mapping[str, Mapping[str, np.ndarray]],
    condensed: CondensedError,
    inputs: Mapping[str, str],
) -> Certificate:
    """The verdict on the answers, by engine, to what was `asked` (KEPT); the
    error of the `condensed` foot is reported with it."""
    rows = judge(ran, answers)
    drawn = {
        f"{name}/{answer}": values
        for name, own in answers.items()
        for answer, values in own.items()
        if answer.startswith(("rise", "roll"))
    }
    return Certificate(
        engines=tuple(ran.values()),
        rows=rows,
        arrays={f"asked/{name}": values for name, values in asked.items()} | drawn,
        table={
            "format": FORMAT,
            "agreed": agree(rows),
            "engines": plain(tuple(ran.values())),
            "rows": plain(rows),
            "condensed": plain(condensed),
            "foot": to_plain(parameters),
            "provenance": provenance(dict(inputs)),
        },
    )


def missing(engine: Engine) -> str:
    """Why the engine cannot be asked; "" where it can."""
    right = f"pip install 'vsf-drake[{engine.package}]' brings {engine.least} or later"
    try:
        installed = version(engine.package)
    except PackageNotFoundError:
        return f"{engine.package} is not installed: {right}"
    if _numbers(installed) < _numbers(engine.least):
        return f"{engine.package} is of version {installed}: {right}"
    return ""


def run(
    folder: Path, engines: Sequence[Engine], progress: Progress | None = None
) -> tuple[dict[str, Ran], dict[str, dict[str, np.ndarray]]]:
    """Has the engines answer what is asked in `folder`; what became of each, and what they
    answered, by name."""
    show = part_of(progress)
    ran = {}
    answers = {}
    with side_by_side(min(cores(), len(engines))) as pool:
        running = {pool.submit(answer_of, folder, engine): engine for engine in engines}
        for done, future in enumerate(as_completed(running)):
            engine = running[future]
            ran[engine.name], answers[engine.name] = future.result()
            show(f"{engine.label} has answered", (done + 1) / len(engines))
    return {engine.name: ran[engine.name] for engine in engines}, answers


def answer_of(folder: Path, engine: Engine) -> tuple[Ran, dict[str, np.ndarray]]:
    """What becomes of the engine that is asked in `folder`, in a process of its own, and its arrays
    by name."""
    why = missing(engine)
    if why:
        return _no_answer(engine, NOT_RUN, why), {}
    try:
        done = subprocess.run(
            [sys.executable, "-m", f"{__package__}.{engine.module}", str(folder)],
            capture_output=True,
            check=False,
            encoding="utf-8",
            errors="replace",
            env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            timeout=LONGEST_S,
        )
    except subprocess.TimeoutExpired:
        return _no_answer(engine, FAILED, f"no answer after {LONGEST_S:g} s"), {}
    if done.returncode:
        said = done.stderr.strip().splitlines() or [f"it ended with {done.returncode}"]
        return _no_answer(engine, FAILED, said[-1]), {}
    try:
        found = read_npz(folder / f"{engine.name}.npz")
    except InputError as error:
        return _no_answer(engine, FAILED, error.what), {}
    told = str(found.pop("version", "")) or None
    return Ran(name=engine.name, label=engine.label, status="", version=told, why=""), found


def judge(
    ran: Mapping[str, Ran], answers: Mapping[str, Mapping[str, np.ndarray]]
) -> tuple[Judged, ...]:
    """Every row of the engines that were to run."""
    return tuple(
        judged(row, ran[row.engine].status, answers[row.engine], answers[REFERENCE])
        for row in ROWS
        if row.engine in ran
    )


def _no_answer(engine: Engine, status: str, why: str) -> Ran:
    return Ran(name=engine.name, label=engine.label, status=status, version=None, why=why)


def _numbers(text: str) -> list[int]:
    """Of a version, as far as they are told: 4.6.0.dev1 has 4, 6, 0."""
    return [int(part) for part in re.split(r"[^0-9.]", text)[0].split(".") if part]
