"""The floor of a trial: the error that the true prosthesis itself makes, driven by the kinematics
as recorded.

What remains is the recording's: misplaced markers, sliding skin, the plate's noise. A model whose
error is below the floor has fitted noise. What a fit may rightly correct lowers its floor: the
errors that all trials share, and in a trial that it is fitted to, the height.
"""

from __future__ import annotations

import csv
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from virtual_laboratory.motion import COORDINATES, Person
from virtual_laboratory.polish import FORCE_HZ, shank_poses
from virtual_laboratory.prosthesis import Prosthesis, prosthesis_of
from virtual_laboratory.recording import Recorded, in_radians
from virtual_laboratory.session import Session, foot_in_shank
from virtual_laboratory.tiers import PLACED, Tier, draw_placement, shared_error_deg
from vsf_drake.model.parameters import FootParameters
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import Trial, default_model
from vsf_drake.walks.metrics import walk_metrics

SCORES = (
    "grf_rmse_bw",
    "grf_r2",
    "vertical_rmse_bw",
    "fore_aft_rmse_bw",
    "medio_lateral_rmse_bw",
    "cop_rmse_fl",
    "impulse_rmse_bws",
    "stance_measured_s",
    "stance_model_s",
    "heel_strike_error_s",
    "toe_off_error_s",
    "unconverged_steps",
)
"""What is kept of `walk_metrics`."""
HIGHEST_M, HEIGHT_TOLERANCE_M = 5e-3, 5e-5
"""How far a trial's own height is searched, and to what."""


@dataclass(frozen=True, kw_only=True, eq=False)
class VirtualWalk:
    """A walk of the virtual prosthesis with what `compare` and `walk_metrics` read of a
    `WalkResult`.

    Attributes:
        time_s: (n,) s; grf_W, cop_W: (n, 3) N and m, as there.
        trajectory: what drove it.
    """

    time_s: np.ndarray
    grf_W: np.ndarray
    cop_W: np.ndarray
    trajectory: CoordinateTrajectory
    subject_mass_kg: float
    foot_length_m: float
    fulcrum_m: np.ndarray
    trial_name: str
    synthetic: bool
    unconverged_steps: int
    wall_s: float
    refined_steps: int = 0
    compile_s: float | None = None
    step_s: float = 1.0 / FORCE_HZ
    prescribed_names: tuple[str, ...] = ()

    @property
    def converged(self) -> bool:
        return self.unconverged_steps == 0

    @property
    def simulated_s(self) -> float:
        return float(self.time_s[-1] - self.time_s[0])

    def column(self, name: str) -> np.ndarray:
        """(n,) history of one recorded coordinate."""
        history: np.ndarray = self.trajectory.ordered((name,)).sample(self.time_s)[0][:, 0]
        return history


def virtual_walk(trial: Trial, trajectory: CoordinateTrajectory | None = None) -> VirtualWalk:
    """The virtual prosthesis at the trial's fulcrum position, driven through the trial's window.

    Args:
        trajectory: what drives it; the trial's own where None.

    Raises:
        ValueError: the trial's prosthesis is on the left, or sits elsewhere than the virtual one.
    """
    if trial.subject.prosthetic_side != "right" or trial.offsets != GeometricOffsets():
        raise ValueError(
            f"{trial.name}: the virtual prosthesis is the reference subject's: on the right, no "
            "offsets"
        )
    path = (trajectory or trial.trajectory).ordered(COORDINATES)
    began = time.perf_counter()
    instants = (
        trial.start_s
        + np.arange(int((trial.end_s - trial.start_s) * FORCE_HZ + 1e-6) + 1) / FORCE_HZ
    )
    person, prosthesis = (
        Person(trial.subject, trial.model),
        prosthesis_of(trial.subject, trial.fulcrum_m),
    )
    reaction = prosthesis.walk(instants, *shank_poses(person, path.time_s, path.values, instants))
    return VirtualWalk(
        time_s=instants,
        grf_W=reaction.force,
        cop_W=reaction.cop,
        trajectory=path,
        trial_name=trial.name,
        synthetic=trial.synthetic,
        subject_mass_kg=trial.subject.mass_kg,
        foot_length_m=trial.model.foot.length_m,
        fulcrum_m=np.array([trial.fulcrum_m]),
        unconverged_steps=reaction.unconverged,
        wall_s=time.perf_counter() - began,
    )


def scores(walk: VirtualWalk, plate: PlateRecording) -> dict[str, Any]:
    """SCORES of a walk against a plate, and the stance time's error (s), model minus measured."""
    metrics = walk_metrics(walk, plate)
    found = {name: getattr(metrics, name) for name in SCORES}
    times = found["stance_model_s"], found["stance_measured_s"]
    return {**found, "stance_time_error_s": None if None in times else times[0] - times[1]}


def floor(trial: Trial) -> dict[str, Any]:
    """Scores of the virtual prosthesis on the trial's own kinematics, against the trial's own
    plate."""
    return scores(virtual_walk(trial), trial.prosthetic_plate)


def floor_with_shared_errors_removed(trial: Trial, seed: int) -> dict[str, Any]:
    """The same with the errors taken off that all trials of the laboratory tier share; those of the
    trial remain.

    Args:
        trial: of the laboratory tier of the reference subject made with `seed`.

    Raises:
        ValueError: it is not.
    """
    return scores(virtual_walk(trial, without_shared_errors(trial, seed)), trial.prosthetic_plate)


def floor_with_height_fitted(trial: Trial, seed: int) -> dict[str, Any]:
    """As `floor_with_shared_errors_removed`, with the pelvis raised by what leaves the smallest
    resultant error.

    The floor of a fit with a height of its own for this very trial; `height_mm` says how much.
    """
    remaining = without_shared_errors(trial, seed)
    upright = np.isin(COORDINATES, "pelvis_ty")

    def raised(height_m: float) -> dict[str, Any]:
        values = remaining.values + height_m * upright
        walk = virtual_walk(trial, CoordinateTrajectory(remaining.time_s, values, COORDINATES))
        return scores(walk, trial.prosthetic_plate)

    found = minimize_scalar(
        lambda height: raised(height)["grf_rmse_bw"],
        bounds=(-HIGHEST_M, HIGHEST_M),
        method="bounded",
        options={"xatol": HEIGHT_TOLERANCE_M},
    )
    return {**raised(float(found.x)), "height_mm": 1e3 * float(found.x)}


def without_shared_errors(trial: Trial, seed: int) -> CoordinateTrajectory:
    """The trial's kinematics less the shared errors of `draw_placement(seed)`.

    Raises:
        ValueError: the trial is not one of the laboratory tier.
    """
    lines = (trial.path.parents[1] / "draws.csv").read_text(encoding="utf-8").splitlines()
    draws = {
        row["trial"]: row
        for row in csv.DictReader(line for line in lines if not line.startswith("#"))
    }
    if trial.path.parent.name != "laboratory" or trial.path.stem not in draws:
        raise ValueError(f"{trial.path}: only trials of the laboratory tier have shared errors")
    recorded = trial.trajectory.ordered(COORDINATES)
    values = np.array(recorded.values)
    draw = draws[trial.path.stem]
    stride_s = float(draw["stance_s"]) / float(draw["duty"])
    shared = shared_error_deg(draw_placement(seed), recorded.time_s, stride_s)
    values[:, [COORDINATES.index(name) for name in PLACED]] -= np.radians(shared)
    return CoordinateTrajectory(recorded.time_s, values, COORDINATES, source=recorded.source)


def session_floor(
    prosthesis: Prosthesis, session: Session, trial: Recorded, tier: Tier
) -> dict[str, Any]:
    """Scores of the true prosthesis of a session on a trial's coordinates as written, its foot
    where the written subject has it, against the plate as written."""
    path = CoordinateTrajectory(trial.time_s, in_radians(tier.coordinates), COORDINATES)
    # A true shank S such that the foot's place P is where the written one, S', has it: X_WS = X_WS'
    # X_S'P X_PS.
    X_FS = foot_in_shank(session.written) @ foot_in_shank(session.person).inverse()
    R_FS, p_FS = X_FS.rotation().matrix(), X_FS.translation()
    R, p = shank_poses(
        Person(session.written, default_model()), path.time_s, path.values, trial.force_time_s
    )
    reaction = prosthesis.walk(trial.force_time_s, R @ R_FS, p + R @ p_FS)
    walk = VirtualWalk(
        time_s=trial.force_time_s,
        grf_W=reaction.force,
        cop_W=reaction.cop,
        trajectory=path,
        synthetic=True,
        trial_name=trial.draw.name,
        subject_mass_kg=session.person.mass_kg,
        foot_length_m=FootParameters().length_m,
        fulcrum_m=np.array([trial.draw.fulcrum_m], dtype=float),
        unconverged_steps=reaction.unconverged,
        wall_s=0.0,
    )
    plate = tier.right
    return scores(
        walk,
        PlateRecording(
            trial.force_time_s, plate.force, plate.cop, np.nan_to_num(plate.free_moment), True
        ),
    )
