"""A laboratory's folder of C3D files of the synthetic persons of data/sessions: markers on the
measured skeleton, plates under one step of each foot. SYNTHETIC: nobody walked."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import ezc3d
import numpy as np
from made_c3d import MadePlate, write_c3d
from virtual_laboratory.markers import follow, standing
from virtual_laboratory.motion import COORDINATES, Person
from virtual_laboratory.writing import mirrored

from vsf_drake.model.parameters import Subject
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trial import Trial, default_model, load_trial
from vsf_drake.sessions.plan import PlanRow
from vsf_drake.sessions.table import SessionTable, SessionWalk, StepTime

SESSIONS = Path(__file__).resolve().parents[2] / "data" / "sessions"
FACTS = {"sex": "male", "prosthetic_side": "right", "synthetic": True}
"""Of persons A and C, as `vsf.session` takes them."""
MARKER_HZ, SUBFRAMES = 100.0, 10
MARGIN_M = 0.12  # of a plate around the way of the centre of pressure
NOISE_M = 2e-4  # of a good camera system
SHORTER_M = {"a": 0.0135, "b": 0.0089, "c": 0.0143}
"""What half of the weight shortens each person's prosthesis by, as
`virtual_laboratory.markers.shortening` finds at 108 mm."""
NOON = 1_790_000_000.0  # s, when the first file was written
DAY_S = 86_400.0


def session_folder(
    person: str, folder: Path, names: Mapping[str, str], *, facts: bool = True, day: str = "day_1"
) -> Path:
    """`folder` with static.c3d and a C3D file for each trial: its name without suffix by the
    trial's ("low_1"); `facts` states mass and stature in them."""
    folder.mkdir(parents=True, exist_ok=True)
    manifests = SESSIONS / person / day / "1p1"
    trials = {name: load_trial(manifests / f"{trial}.yaml") for trial, name in names.items()}
    first = next(iter(trials.values()))
    skeleton, left = skeleton_of(first.subject)
    still = follow(skeleton, standing(skeleton, SHORTER_M[person]))
    stated = first.subject if facts else None
    write(folder / "static.c3d", still, (), left=left, stated=stated, number=0)
    for number, (name, trial) in enumerate(trials.items(), start=1):
        path = folder / f"{name}.c3d"
        seen = follow(skeleton, _as_right(trial, left))
        write(path, seen, plates_of(trial), left=left, stated=stated, number=number)
    return folder


@cache
def skeleton_of(subject: Subject) -> tuple[Person, bool]:
    """The measured person with the prosthesis on the right, and whether it is on the left."""
    right = dataclasses.replace(subject, prosthetic_side="right")
    return Person(right, default_model()), subject.prosthetic_side == "left"


def _as_right(trial: Trial, left: bool) -> np.ndarray:
    """(n, 21) m and rad at the markers' rate, as of a person with the prosthesis on the right."""
    time = np.arange(trial.trajectory.start_s, trial.trajectory.end_s, 1.0 / MARKER_HZ)
    names = COORDINATES if not left else mirrored(np.zeros((1, len(COORDINATES))))[0]
    values = trial.trajectory.ordered(names).sample(time)[0]
    return mirrored(values)[1] if left else values


def plates_of(trial: Trial) -> tuple[MadePlate, ...]:
    """A plate under the first whole step of each foot that has one."""
    frames = len(np.arange(trial.trajectory.start_s, trial.trajectory.end_s, 1.0 / MARKER_HZ))
    made = []
    for plate in trial.plates.values():
        time = np.arange(frames * SUBFRAMES) / (MARKER_HZ * SUBFRAMES)
        stance = next(
            (s for s in find_stances(plate.time_s, plate.force_W[:, 2]) if s.complete), None
        )
        if stance is None:
            continue
        at = np.clip(np.searchsorted(plate.time_s, time), 0, len(plate.time_s) - 1)
        on = (time > stance.start_s - 0.02) & (time < stance.end_s + 0.02)
        cop = np.nan_to_num(plate.cop_W[at])
        seen = plate.cop_W[(plate.time_s > stance.start_s) & (plate.time_s < stance.end_s)]
        low = np.nanmin(seen, axis=0)[:2] - MARGIN_M
        high = np.nanmax(seen, axis=0)[:2] + MARGIN_M
        middle = np.array([*(0.5 * (low + high)), 0.0])
        corners = [[high[0], low[1]], [low[0], low[1]], [low[0], high[1]], [high[0], high[1]]]
        loaded = on & np.isfinite(plate.cop_W[at]).all(axis=1)
        made.append(
            MadePlate(
                2,
                np.where(loaded[:, None], plate.force_W[at], 0.0),
                np.where(loaded[:, None], cop, middle),
                np.where(loaded, np.nan_to_num(plate.free_moment_nm[at]), 0.0),
                np.column_stack([corners, np.zeros(4)]),
            )
        )
    return tuple(made)


def write(
    path: Path,
    places: Mapping[str, np.ndarray],
    plates: tuple[MadePlate, ...],
    *,
    left: bool,
    stated: Subject | None,
    number: int,
) -> None:
    """One file, written `number` minutes after the first."""
    rng = np.random.default_rng(number)
    seen = {
        label: place + NOISE_M * rng.standard_normal(place.shape) for label, place in places.items()
    }
    if left:
        other = {"R": "L", "L": "R"}
        seen = {other[name[0]] + name[1:]: place * [1, -1, 1] for name, place in seen.items()}
    write_c3d(path, seen, rate=MARKER_HZ, plates=plates, subframes=SUBFRAMES)
    if stated is not None:
        file = ezc3d.c3d(str(path))
        file.add_parameter("PROCESSING", "Bodymass", [stated.mass_kg])
        file.add_parameter("PROCESSING", "Height", [1e3 * stated.stature_m])
        file.write(str(path))
    os.utime(path, (NOON + 60.0 * number,) * 2)


def made_session_table() -> SessionTable:
    """A session with everything on its page: long names, a walk left out, warnings."""
    walks = [
        SessionWalk(
            file=f"participant 03 walk {mm} mm, second visit.c3d",
            label=f"{mm}",
            role=role,
            fulcrum_mm=float(mm),
            mark="doubtful",
            error_bw=error,
            null_bw=error and 0.04,
            why="is truncated" * (role == "left out"),
        )
        for mm, role, error in (
            (66, "fitted", None),
            (108, "held out", 0.03),
            (151, "fitted", None),
            (129, "left out", None),
        )
    ]
    return SessionTable(
        folder="Montag",
        person="SYNTHETIC person",
        side="left",
        synthetic=True,
        success=True,
        verdict="One held-out walk decides nothing: " * 3,
        sentences=("A sentence.", "! A warning."),
        next=("Walks at a setting between.", "A bench."),
        walks=tuple(walks),
        layer="person",
        effect=("The angles change.", "! No setting was walked twice."),
        answer=None,
        files=tuple(PlanRow(file=walk.file, role="walk", remark="a remark " * 9) for walk in walks),
        chosen=("Fitted: two.",),
        notes=("! A note that stands out.",),
        steps=(StepTime(name="import", seconds=3.0, kept=False),),
        pages={
            "import": "import/import.html",
            "replay": "import/replay.html",
            "fit": "fit/report.html",
        },
        provenance={"versions": {"drake": "1"}, "inputs_sha256": {"a.c3d": 64 * "0"}},
    )


def spoil(folder: Path) -> None:
    """Two broken files and a standing trial of another day."""
    walk = sorted(folder.glob("*1.c3d"))[0]
    content = walk.read_bytes()
    (folder / "66mm_9.c3d").write_bytes(content[: len(content) // 2])
    (folder / "export_failed.c3d").write_text("export failed", encoding="utf-8")
    old = folder / "static yesterday.c3d"
    old.write_bytes((folder / "static.c3d").read_bytes())
    os.utime(old, (NOON - DAY_S,) * 2)
