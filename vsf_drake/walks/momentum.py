"""The person's own momentum: what the prosthesis must carry while the intact foot swings.

    F = m (a_com - g) = F_ground + F_held,        F_held the loads that hold the pelvis's prescribed
                                                  translations.

The walk has F_held for free. Height, hip, knee and alignment of one trial are corrected by
Gauss-Newton so that the foot gives what momentum needs, by Legendre coefficients 0, 1, 2 over each
window,

    minimise over c    |(L needed - bias - L foot(c)) / sigma|^2 + |c / prior|^2,

with bias the mean over the fitted trials of L (needed - plate): what the recorded motion misses of
the person's own momentum. Where it misses differently from trial to trial, sigma is so much larger.
The derivative of the foot's force is exact; that of m a_com, some hundredths of a percent of body
weight per degree, is left out of the Jacobian, not of the residual.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander

from vsf_drake.base.errors import SimulationError
from vsf_drake.model.contact_file import MomentumBias
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import common, runs
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.reactions import LOADED_N, follow
from vsf_drake.simulation.walk import Walk, Walker
from vsf_drake.walks.comparison import walk_axes, walking_direction

SIGMA_BW = np.array([1.6, 3.0, 3.0, 2.0, 2.4, 3.0]) / 100.0
"""Error of what momentum needs, fore-aft then vertical, coefficients 0, 1, 2 each."""
PRIOR = np.array([1e-3, *np.radians([0.5, 0.5, 0.5])])
"""Standard deviations (m, rad) of what height, hip, knee and alignment of one trial are off."""
# of Gauss-Newton; it ends when no correction moves by this share of its prior
MOST_STEPS = 4
ENOUGH = 0.02
FIT_STEP_S = 2e-3
SWINGING_M_PER_S, TRIMMED_S, SHORTEST_S = 0.75, 0.02, 0.2
"""A window: the intact foot's slowest sphere is faster than this, less so much at both ends, and as
long as this."""
MOST_SPREAD = 3.0
"""Times SIGMA_BW by which the fitted trials' biases may differ: where both components do by more,
nothing is believed (a choice). One that differs by less, but more than SIGMA_BW says, has so much
larger an error."""
STANDING_BW, MOST_MOVED_BW = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]), 0.3
"""What momentum needs of who stands, and how far a walk's single support departs from that at most
(a choice: the embedded walks do by 0.1): a motion that needs more was not recorded as it was. The
foot has no say in either test."""


@dataclass(frozen=True, kw_only=True)
class MomentumCorrection:
    """What the momentum layer did to one trial.

    Attributes:
        believed: whether it did anything. why_not: "bias" if the file has none, "spread" if the
            fitted trials' biases differ too much, "window" if the intact foot was not seen to
            swing, "motion" if the recorded motion needs forces that no walk does, "walk" if a walk
            failed.
        height_m, hip_flexion_rad, knee_angle_rad, alignment_rad: added to the trial.
        missing_bw: what the foot's force lacked before and after, as SIGMA_BW.
    """

    believed: bool
    why_not: str = ""
    height_m: float = 0.0
    hip_flexion_rad: float = 0.0
    knee_angle_rad: float = 0.0
    alignment_rad: float = 0.0
    missing_bw: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    windows_s: tuple[tuple[float, float], ...] = ()
    wall_s: float = 0.0

    @property
    def values(self) -> np.ndarray:
        """(4,) the corrections, in the order of PRIOR."""
        return np.array(
            [self.height_m, self.hip_flexion_rad, self.knee_angle_rad, self.alignment_rad]
        )


def variables_of(trial: Trial) -> tuple[str, ...]:
    """Variables of a walk that the momentum layer corrects, in the order of PRIOR."""
    side = trial.subject.prosthetic_side[0]
    return (
        "offset.height",
        f"coordinate.hip_flexion_{side}",
        f"coordinate.knee_angle_{side}",
        "offset.alignment",
    )


def with_corrections(errors: Mapping[str, float], trial: Trial, c: np.ndarray) -> dict[str, float]:
    """Values of the trial's walk with its errors and the corrections c (4,)."""
    return {
        **errors,
        **{
            name: errors.get(name, 0.0) + float(own)
            for name, own in zip(variables_of(trial), c, strict=True)
        },
    }


def corrected(
    walker: Walker,
    trial: Trial,
    bias: MomentumBias,
    *,
    heading: np.ndarray,
    errors: Mapping[str, float],
) -> MomentumCorrection:
    """What momentum makes of a trial that has the fitted contact; heading (2,) of its walk,
    `errors` as `predict`'s."""
    began = time.perf_counter()
    spread = spread_of(bias)
    if spread.min() > MOST_SPREAD:
        return MomentumCorrection(believed=False, why_not="spread")
    sigma = spread * SIGMA_BW
    bias_bw = np.array([*bias.fore_aft_bw, *bias.vertical_bw])
    c = np.zeros(len(PRIOR))
    missing = list[np.ndarray]()
    windows = tuple[slice, ...]()
    for _ in range(MOST_STEPS):
        try:
            walk = walker.walk_trial(
                trial,
                values=with_corrections(errors, trial, c),
                step_s=FIT_STEP_S,
                with_respect_to=variables_of(trial),
            )
        except SimulationError:
            return MomentumCorrection(believed=False, why_not="walk")
        windows = windows or swings(walk)
        if not windows:
            return MomentumCorrection(believed=False, why_not="window")
        assert walk.sensitivity is not None
        needed = coefficients(walk, windows, needed_force(walk), trial, heading) - bias_bw
        if np.abs(needed - STANDING_BW).max() > MOST_MOVED_BW:
            return MomentumCorrection(believed=False, why_not="motion")
        missing.append(needed - coefficients(walk, windows, walk.prosthetic.grf_W, trial, heading))
        by = np.stack(
            [
                coefficients(walk, windows, walk.sensitivity.grf_W[:, :, p], trial, heading)
                for p in range(len(c))
            ],
            axis=1,
        )
        # In units of sigma and prior a Gauss-Newton step is ridge regression on what would be
        # missing without c.
        r = (missing[-1] + by @ c) / sigma
        J = by * PRIOR / sigma[:, None]
        new = PRIOR * np.linalg.solve(J.T @ J + np.eye(len(c)), J.T @ r)
        after = missing[-1] - by @ (new - c)
        moved = np.abs(new - c) / PRIOR
        c = new
        if moved.max() < ENOUGH:
            break
    height, hip, knee, alignment = map(float, c)
    return MomentumCorrection(
        believed=True,
        height_m=height,
        hip_flexion_rad=hip,
        knee_angle_rad=knee,
        alignment_rad=alignment,
        missing_bw=(tuple(missing[0].tolist()), tuple(after.tolist())),
        wall_s=time.perf_counter() - began,
        windows_s=tuple(
            (float(walk.record.time_s[w][0]), float(walk.record.time_s[w][-1])) for w in windows
        ),
    )


def spread_of(bias: MomentumBias) -> np.ndarray:
    """(6,) by how many times SIGMA_BW the fitted trials' biases differ, at least 1: the root mean
    square over the coefficients of each component, since few trials do not tell them one by one; 1
    where one trial tells nothing."""
    if bias.fore_aft_sd_bw is None or bias.vertical_sd_bw is None:
        return np.ones(len(SIGMA_BW))
    ratio = np.array([bias.fore_aft_sd_bw, bias.vertical_sd_bw]) / SIGMA_BW.reshape(2, 3)
    return np.repeat(np.maximum(1.0, np.sqrt(np.mean(ratio**2, axis=1))), 3)


def needed_force(walk: Walk) -> np.ndarray:
    """(n, 3) N that the ground must give all in all, m (a_com - g): what it gives in the walk, and
    what holds the pelvis's translations, which are along OpenSim's axes (forward, up, right)."""
    forward, up, right = (
        walk.record.load[:, walk.mechanism.tree.index(name)]
        for name in ("pelvis_tx", "pelvis_ty", "pelvis_tz")
    )
    return np.asarray(
        np.column_stack([forward, -right, up]) + walk.prosthetic.grf_W + walk.intact.grf_W
    )


def swings(walk: Walk) -> tuple[slice, ...]:
    """Rows of the walk's record in which the intact foot swings, without the ends of the swing;
    those that the walk cuts are left out. Of the kinematics alone."""
    mechanism = walk.mechanism
    record = walk.record
    # the intact foot's stand last
    spheres = np.flatnonzero(mechanism.site_bodies == mechanism.site_bodies[-1])
    motion = follow(
        mechanism.tree,
        record.q,
        record.v,
        bodies=(int(mechanism.site_bodies[-1]),),
        coordinates=(),
        inside=np.zeros(len(mechanism.tree.body_names), dtype=bool),
    )
    p_WS = motion.p_WB[:, None] + np.einsum(
        "nij,sj->nsi", motion.R_WB, mechanism.sites[spheres, :3]
    )
    v_WS = motion.twist[:, :, 3:] + np.cross(motion.twist[:, :, :3], p_WS)
    fast = np.linalg.norm(v_WS, axis=2).min(axis=1) > SWINGING_M_PER_S
    trim = round(TRIMMED_S / walk.step_s)
    return tuple(
        slice(start + trim, stop - trim)
        for start, stop in runs(fast)
        if start > 0 and stop < len(fast) and (stop - start - 2 * trim) * walk.step_s >= SHORTEST_S
    )


def coefficients(
    walk: Walk, windows: Sequence[slice], force_W: np.ndarray, trial: Trial, heading: np.ndarray
) -> np.ndarray:
    """(6,) BW, in the order of SIGMA_BW, of a force (n, 3) N over the record; means over the
    windows."""
    along = force_W @ walk_axes(heading)[[0, 2]].T / (trial.subject.mass_kg * GRAVITY)
    return np.asarray(
        np.mean(
            [
                (
                    np.linalg.pinv(legvander(np.linspace(-1.0, 1.0, window.stop - window.start), 2))
                    @ along[window]
                ).T.ravel()
                for window in windows
            ],
            axis=0,
        )
    )


def bias_of(walker: Walker, trials: Mapping[str, Trial]) -> MomentumBias | None:
    """The bias of fitted trials that have the fitted contact, by fingerprint; None where none of
    them tells it."""
    known = {
        name: own for name, trial in trials.items() if (own := missed(walker, trial)) is not None
    }
    if not known:
        return None
    every = np.array([*known.values()])
    mean = every.mean(axis=0)
    sd = every.std(axis=0, ddof=1) if len(every) > 1 else None
    return MomentumBias(
        fore_aft_bw=tuple(mean[:3].tolist()),
        vertical_bw=tuple(mean[3:].tolist()),
        trials=tuple(known),
        fore_aft_sd_bw=None if sd is None else tuple(sd[:3].tolist()),
        vertical_sd_bw=None if sd is None else tuple(sd[3:].tolist()),
    )


def missed(walker: Walker, trial: Trial) -> np.ndarray | None:
    """(6,) BW by which m (a_com - g) exceeds the plate in the windows that the plate saw loaded;
    None without one."""
    walk = walker.walk_trial(trial, step_s=FIT_STEP_S)
    plate = trial.prosthetic_plate
    heading = walking_direction(walk)
    on_plate = np.column_stack(
        [np.interp(walk.record.time_s, plate.time_s, column) for column in plate.force_W.T]
    )
    time_s = walk.record.time_s
    windows = [
        window
        for window in swings(walk)
        if on_plate[window, 2].min() > LOADED_N
        and not any(
            common((time_s[window][0], time_s[window][-1]), span) for span in plate.unknown_s
        )
    ]
    return (
        coefficients(walk, windows, needed_force(walk) - on_plate, trial, heading)
        if windows
        else None
    )
