"""The two tiers: `exact` as it drove the virtual prosthesis, `laboratory` as markers and plates
would have told it.

Errors of the laboratory tier are drawn from the seed, never chosen. Their sizes are those that
laboratories report for placing markers anew (a degree or two of offset at hip and knee) and for
repeating a trial with the markers left on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_laboratory.motion import COORDINATES
from virtual_laboratory.placing import MARGIN_S
from virtual_laboratory.reaction import LOADED_ABOVE_N
from virtual_laboratory.recording import DECIMALS, Foot, Recorded
from vsf_drake.model.parameters import PELVIS_TRANSLATIONS

CONSTANT_DEG = 1.2
"""Standard deviation of the constant error of each hip and knee angle, the same in all trials:
misplaced markers."""
CURVE_DEG, HARMONICS = 0.5, 3
"""Expected root mean square of a smooth error over the gait cycle, the same in all trials: sliding
skin, crosstalk."""
TRIAL_DEG, TRIAL_M = 0.1, 0.4e-3
"""Standard deviation of the constant error of one trial in every angle and in the pelvis's
place."""
PLATE_N, PLATE_M = 2.0, 0.2
"""Standard deviation of every sample of every force, and the lever at which it moves the centre of
pressure."""
PLACED = tuple(name for name in COORDINATES if name.startswith(("hip", "knee")))


@dataclass(frozen=True)
class Tier:
    """What is written of one trial: coordinates (N, 21) in m and degrees, and both feet."""

    name: str
    coordinates: np.ndarray
    right: Foot
    left: Foot


@dataclass(frozen=True)
class Placement:
    """Errors (degrees) that all trials share, by angle of `PLACED`.

    Attributes:
        constant: (12,).
        waves: (12, HARMONICS, 2) cosine and sine amplitudes over the gait cycle.
    """

    constant: np.ndarray
    waves: np.ndarray


def draw_placement(seed: int) -> Placement:
    random = np.random.default_rng([seed, 1])
    amplitude = CURVE_DEG / np.sqrt(HARMONICS)
    return Placement(
        CONSTANT_DEG * random.standard_normal(len(PLACED)),
        amplitude * random.standard_normal((len(PLACED), HARMONICS, 2)),
    )


def exact(trial: Recorded) -> Tier:
    """Without any error."""
    return Tier("exact", trial.coordinates, trial.right, trial.left)


def laboratory(trial: Recorded, placement: Placement, seed: int, index: int) -> Tier:
    """With the shared errors of `placement` and those of the trial `index` of its own."""
    random = np.random.default_rng([seed, 2, index])
    shifted = np.isin(COORDINATES, PELVIS_TRANSLATIONS)
    error = np.where(shifted, TRIAL_M, TRIAL_DEG) * random.standard_normal(len(COORDINATES))
    coordinates = trial.coordinates + error
    shared = shared_error_deg(placement, trial.time_s, trial.draw.stride_s)
    coordinates[:, [COORDINATES.index(name) for name in PLACED]] += shared
    right, left = (measured(foot, random) for foot in (trial.right, trial.left))
    return Tier("laboratory", coordinates.round(DECIMALS), right, left)


def shared_error_deg(placement: Placement, time_s: np.ndarray, stride_s: float) -> np.ndarray:
    """(N, 12) degrees that the markers' placement adds to the angles `PLACED` at `time_s` (N,) of a
    recording."""
    phase = (time_s - MARGIN_S) / stride_s
    turn = 2.0 * np.pi * np.multiply.outer(phase, np.arange(1, HARMONICS + 1))
    waves = np.stack([np.cos(turn), np.sin(turn)], axis=2)
    shared: np.ndarray = placement.constant + np.einsum("nhc,ahc->na", waves, placement.waves)
    return shared


def measured(foot: Foot, random: np.random.Generator) -> Foot:
    """The foot's plate with noise; its centre of pressure suffers the more, the lighter the
    load."""
    force = foot.force + PLATE_N * random.standard_normal(foot.force.shape)
    noise = PLATE_N * PLATE_M * random.standard_normal((len(force), 3))
    loaded = force[:, 2] > LOADED_ABOVE_N
    known = np.flatnonzero(np.isfinite(foot.cop[:, 0]))
    # Where the noise alone lifts the load over the threshold, the foot stands where it last or next
    # does.
    nearest = known[np.abs(np.flatnonzero(loaded)[:, None] - known).argmin(axis=1)]
    cop, moment = np.full(foot.cop.shape, np.nan), np.full(len(force), np.nan)
    cop[loaded] = foot.cop[nearest]
    cop[loaded, :2] += noise[loaded, :2] / force[loaded, 2:]
    moment[loaded] = foot.free_moment[nearest] + noise[loaded, 2]
    return Foot(force, cop, moment)
