"""The curves of a session for other programs: one tidy table, or files for OpenSim.

A row of the table is one number: trial, side, time_s, percent_stance, quantity, value, unit. Side
is right or left; pelvis and residual motion have none. Percent of stance is that of the side's foot
on its plate (of the prosthetic one where there is no side), from strike to lift-off; empty
elsewhere. Axes are W's: x forward, y left, z up; joint angles in degrees, signs as in
docs/frames.md. `model_*` is the force that the fitted contact predicts, by the layer to believe;
of a fitted walk it is no prediction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.tables import tables_module
from vsf_drake.model.contact_file import FittedContact
from vsf_drake.model.parameters import PELVIS_TRANSLATIONS
from vsf_drake.motion.events import known_stances
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import columns_at
from vsf_drake.motion.trial import Trial
from vsf_drake.report.outputs import write_motion
from vsf_drake.report.page import write_csv
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walker
from vsf_drake.walks.comparison import walk_axes
from vsf_drake.walks.prediction import MOMENTUM, LayeredWalk, predict
from vsf_drake.walks.recorded_walk import with_contact

COLUMNS = ("trial", "side", "time_s", "percent_stance", "quantity", "value", "unit")
EXCEL_ROWS = 1_048_575  # below the heading, of a sheet
_FORCES = ("force_x", "force_y", "force_z")
_PLACES = ("cop_x", "cop_y")
_SIDES = {"_r": "right", "_l": "left"}


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkedTrial:
    """A recorded trial and what the fitted contact makes of it; None without one."""

    name: str
    trial: Trial
    walk: LayeredWalk | None


def walked_with(trials: Sequence[Trial], contact: FittedContact | None) -> list[WalkedTrial]:
    """The trials walked with the contact in layers; SimulationError where a walk fails."""
    walks: list[LayeredWalk | None] = [None] * len(trials)
    if contact is not None:
        applied = [with_contact(trial, contact) for trial in trials]
        walker = Walker(applied[0].subject, applied[0].model)
        walks = [predict(trial, contact, walker=walker, step_s=DEFAULT_STEP_S) for trial in applied]
    return [
        WalkedTrial(name=trial.path.stem, trial=trial, walk=walk)
        for trial, walk in zip(trials, walks, strict=True)
    ]


def tidy_rows(walked: Sequence[WalkedTrial]) -> Iterator[tuple[object, ...]]:
    """The rows of the table, at the instants of each trial's motion within its window; a number
    that is not known has no row."""
    for one in walked:
        trial = one.trial
        own = trial.subject.prosthetic_side
        times = trial.trajectory.time_s
        time_s = times[(times >= trial.start_s) & (times <= trial.end_s)]
        percent = {side: _percent(time_s, plate) for side, plate in trial.plates.items()}
        for side, name, values, unit in _series(one, time_s):
            shares = percent.get(side or own, np.full(len(time_s), np.nan))
            for at, share, value in zip(time_s, shares, values, strict=True):
                if np.isfinite(value):
                    told = None if np.isnan(share) else round(float(share), 3)
                    yield one.name, side, round(float(at), 6), told, name, float(value), unit


def _series(one: WalkedTrial, time_s: np.ndarray) -> Iterator[tuple[str, str, np.ndarray, str]]:
    trial = one.trial
    values = trial.trajectory.sample(time_s)[0]
    for name, column in zip(trial.trajectory.names, values.T, strict=True):
        side = _SIDES.get(name[-2:], "")
        stem = name[:-2] if side else name
        if name in PELVIS_TRANSLATIONS:
            yield side, stem, column, "m"
        else:
            yield side, stem, np.degrees(column), "deg"
    for side, plate in trial.plates.items():
        for k, name in enumerate(_FORCES):
            yield side, name, np.interp(time_s, plate.time_s, plate.force_W[:, k]), "N"
        cop = columns_at(time_s, plate.time_s, plate.cop_W, np.nan)
        for k, name in enumerate(_PLACES):
            yield side, name, cop[:, k], "m"
        yield side, "free_moment", np.interp(time_s, plate.time_s, plate.free_moment_nm), "N m"
    if one.walk is None:
        return
    result = one.walk.results[MOMENTUM]
    at, force = result.time_s, result.grf_W
    if one.walk.person is not None:
        at = one.walk.person.time_s
        force = one.walk.person.force_n @ walk_axes(one.walk.seen.heading)
    for k, name in enumerate(_FORCES):
        told = np.interp(time_s, at, force[:, k], left=np.nan, right=np.nan)
        yield trial.subject.prosthetic_side, f"model_{name}", told, "N"


def _percent(time_s: np.ndarray, plate: PlateRecording) -> np.ndarray:
    """(n,) of the whole stances on a plate; NaN elsewhere."""
    share = np.full(len(time_s), np.nan)
    for stance in known_stances(plate):
        on = (time_s >= stance.start_s) & (time_s <= stance.end_s)
        if stance.complete:
            share[on] = 100.0 * (time_s[on] - stance.start_s) / stance.duration_s
    return share


def write_tidy_csv(folder: Path, walked: Sequence[WalkedTrial]) -> None:
    """`curves.csv`."""
    write_csv(folder / "curves.csv", COLUMNS, tidy_rows(walked))


def excel_writer() -> Any:
    """pandas, if it can write Excel; InputError that says what to install if it cannot."""
    if find_spec("openpyxl") is None:
        raise InputError(
            "is not installed, without which pandas writes no Excel",
            where="openpyxl",
            right="Install it: pip install openpyxl",
        )
    return tables_module("pandas")


def write_excel(folder: Path, walked: Sequence[WalkedTrial]) -> None:
    """`curves.xlsx`, the same table."""
    pandas = excel_writer()
    rows = [*tidy_rows(walked)]
    require(
        len(rows) <= EXCEL_ROWS,
        f"there are {len(rows)} rows, a sheet of Excel has {EXCEL_ROWS}",
        "--excel",
        "Take --csv",
    )
    pandas.DataFrame(rows, columns=COLUMNS).to_excel(
        folder / "curves.xlsx", sheet_name="curves", index=False, engine="openpyxl"
    )


def write_opensim_walks(folder: Path, walked: Sequence[WalkedTrial]) -> None:
    """`opensim/TRIAL/walk_ik.mot` and `walk_grf.mot` of the modelled walks, all coordinates and the
    model's forces; the recorded ones are in the import's folder."""
    for one in walked:
        if one.walk is not None:
            own = folder / "opensim" / one.name
            own.mkdir(parents=True)
            write_motion(one.walk.results[MOMENTUM], own)


WRITERS = {"csv": write_tidy_csv, "excel": write_excel, "opensim": write_opensim_walks}
"""What writes each kind of curves."""
