"""What the section "Can two settings be told apart?" of a validation holds.

It takes long: `studies/shipped_sections` computes it, and says how; the package has what it found.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from vsf_drake.base.files import flat


@dataclass(frozen=True, kw_only=True)
class NoiseSizes:
    """Standard deviations."""

    session_deg: float = 1.2  # constant error of an angle in a session
    session_smooth_deg: float = 0.5  # root mean square, expected, of the smooth one
    recording_deg: float = 0.1  # constant errors of one recording
    recording_mm: float = 0.4


@dataclass(frozen=True, kw_only=True)
class OutcomeRow:
    """One outcome around the middle of the range, in its unit; None for what is not known.

    `limits` by design D: the smallest detectable difference `sdd_D` and travel of the fulcrum
    `smallest_travel_mm_D`, by the noise alone `noise_sdd_D` and `noise_travel_mm_D`;
    `smallest_change_n_per_mm_D` is what the former travel changes the stiffness by.
    """

    name: str
    title: str
    unit: str
    effect: float | None  # of REFERENCE_MM
    effect_ends: float | None  # of the whole range
    model_error_sd: float | None
    model_error_n: int
    limits: Mapping[str, float | None] = flat()


@dataclass(frozen=True, kw_only=True)
class PairRow:
    """One outcome and pair of positions with the motion held; `limits` are the smallest detectable
    differences `limit_D` by design, by the noise alone where the model's error in the outcome is
    not known."""

    outcome: str
    from_mm: float
    to_mm: float
    effect: float | None
    limits: Mapping[str, float | None] = flat()


@dataclass(frozen=True, kw_only=True)
class CurveDifference:
    """Root mean square over stance of the mean difference of the resultants at two positions, the
    motion held."""

    from_mm: float
    to_mm: float
    rms_bw: float | None


@dataclass(frozen=True, kw_only=True)
class WalkedPair:
    """One outcome and pair of recorded settings, each walked with its own motion: differences of
    their means."""

    outcome: str
    from_mm: float
    to_mm: float
    simulated: float | None
    measured: float | None
    error_half_width: float | None  # t times the standard error of what the model errs by in it
    told_apart: bool | None
    stride_half_width: float | None  # the same of the strides' own scatter
    beyond_strides: bool | None


@dataclass(frozen=True, kw_only=True)
class SettingsTable:
    """The section "Can two settings be told apart?"; with the first alone if nothing could be
    walked."""

    answer: str
    outcomes: tuple[OutcomeRow, ...] = ()
    pairs: tuple[PairRow, ...] = ()
    draws: int = 0  # sessions a trial
    seed: int = 0
    positions_mm: tuple[float, ...] = ()
    stiffness_n_per_mm: tuple[float, ...] = ()
    walks: int = 0
    failed_walks: int = 0
    synthetic: bool = True
    noise: NoiseSizes = field(default_factory=NoiseSizes)
    held_out_trials: int = 0
    held_out_rmse_bw: float | None = None
    trials_mm: tuple[float, ...] = ()  # where the fulcrum stood in the trials that were walked
    curves: tuple[CurveDifference, ...] = ()
    as_walked: tuple[WalkedPair, ...] = ()
    as_walked_apart_bw: tuple[float, ...] = ()
    """RMS between the mean measured resultants of two recorded settings"""
