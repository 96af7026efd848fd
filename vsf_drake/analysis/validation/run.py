"""Runs the sections of the validation one after the other; what is finished survives an interruption."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.analysis.validation.bench_section import bench_section
from vsf_drake.analysis.validation.energy_section import energy_section
from vsf_drake.analysis.validation.keeping import SectionStore, study_key
from vsf_drake.analysis.validation.roll_over_section import roll_over_section
from vsf_drake.analysis.validation.sensitivity_section import sensitivity_section
from vsf_drake.analysis.validation.settings_section import settings_section
from vsf_drake.analysis.validation.standing import standing_section
from vsf_drake.analysis.validation.study import Progress, Section, Study
from vsf_drake.analysis.validation.walking_section import walking_section
from vsf_drake.errors import FitError, InputError, SimulationError

EXACT = "walking_exact"
"""The walking section of a second study: the same walks without errors of measurement."""
_SECTIONS: dict[str, tuple[Callable[..., Section], float]] = {
    "bench": (bench_section, 10.0), "standing": (standing_section, 10.0), "walking": (walking_section, 20.0),
    "energy": (energy_section, 30.0), "roll_over": (roll_over_section, 30.0), "settings": (settings_section, 90.0),
    "sensitivity": (sensitivity_section, 180.0)}
"""By name: what computes it, and about how long that takes (s), which only the progress depends on."""
NAMES = (*_SECTIONS, EXACT)


@dataclass(frozen=True, kw_only=True, eq=False)
class Finished:
    """A section with how long it took (s); `section` is None if it failed, and `failure` says why."""

    section: Section | None
    wall_s: float
    failure: str = ""


def run_sections(
    study: Study, *, exact: Study | None = None, folder: str | Path | None = None, progress: Progress | None = None
) -> dict[str, Finished]:
    """Every section of the validation, by name.

    A section that fails (a bench that gives way, a simulation that diverges) is named with the reason and stops no
    other.

    Args:
        exact: the same walks without errors of measurement, where there are such.
        folder: where finished sections are kept, so that an interrupted run of the same study goes on.
        progress: called with what is being done and the finished fraction of everything.
    """
    plan: dict[str, tuple[Callable[..., Section], float, Study]] = {
        name: (make, weight, study) for name, (make, weight) in _SECTIONS.items()}
    if exact is not None:
        plan[EXACT] = (walking_section, _SECTIONS["walking"][1], exact)
    total, before, finished = sum(weight for _, weight, _ in plan.values()), 0.0, {}
    for name, (make, weight, own) in plan.items():
        def show(what: str, fraction: float, name: str = name, before: float = before, weight: float = weight) -> None:
            if progress:
                progress(f"{name.replace('_', ' ')}: {what}", (before + weight * min(max(fraction, 0.0), 1.0)) / total)

        store = None if folder is None else SectionStore(Path(folder), study_key(own))
        finished[name] = _one(name, make, own, store, show)
        before += weight
    return finished


def failures(finished: Mapping[str, Finished]) -> dict[str, str]:
    """Why, by name, of the sections that failed."""
    return {name: one.failure for name, one in finished.items() if one.section is None}


def _one(name: str, make: Callable[..., Section], study: Study, store: SectionStore | None, show: Progress) -> Finished:
    kept = store.read(name) if store else None
    if kept is not None:
        return Finished(section=kept[0], wall_s=kept[1])
    show("starting", 0.0)
    began = time.perf_counter()
    try:
        section = make(study, progress=show)
    except (InputError, SimulationError, FitError) as error:
        return Finished(section=None, wall_s=time.perf_counter() - began, failure=str(error))
    took = time.perf_counter() - began
    if store:
        store.write(name, section, took)
    return Finished(section=section, wall_s=took)
