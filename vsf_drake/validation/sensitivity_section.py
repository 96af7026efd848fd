"""What the sensitivity study of a validation holds.

It takes long: `studies/shipped_sections` computes it, and says how; the package has what it found.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Elementary effects of a factor over the whole of its range, in the output's unit;
    `mu_star_conf` is half of the 95 % bootstrap interval."""

    name: str
    mu: float
    mu_star: float
    mu_star_conf: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class Index:
    """Shares of an output's variance: first-order and total index of a factor or group, and half of
    their 95 % bootstrap intervals."""

    name: str
    s1: float
    s1_conf: float
    st: float
    st_conf: float


@dataclass(frozen=True, kw_only=True)
class FactorRange:
    """One factor of the study: `low` to `high` is its range, about no change."""

    name: str  # for people
    group: str  # one of GROUPS
    unit: str  # of `low` and `high`: "mm", "deg", "×" (times the study's value) or "1"
    low: float
    high: float
    why: str  # where the range comes from


@dataclass(frozen=True, kw_only=True)
class WalkedCondition:
    """The trial of a condition."""

    label: str
    fulcrum_mm: float
    role: str


@dataclass(frozen=True, kw_only=True)
class OutputRow:
    """One output; None where nothing can be said."""

    baseline: float | None  # as the study has it, mean over the conditions
    baseline_indexed: float | None  # in the condition that indices are of
    p05: float | None  # percentiles with everything uncertain
    p50: float | None
    p95: float | None
    stability: float | None  # lowest rank correlation of mu* between two conditions
    interaction: float | None  # share of the variance that no index of first order has
    interaction_conf: float | None  # half of its 95 % interval, as if these erred independently
    dropped: int  # trajectories and blocks
    morris: tuple[Effect, ...] | None
    sobol: tuple[Index, ...] | None  # of groups


@dataclass(frozen=True, kw_only=True)
class SensitivityTable:
    """The sensitivity study."""

    factors: tuple[FactorRange, ...]
    conditions: tuple[WalkedCondition, ...]
    indexed: int  # the place of the condition that indices and percentiles are of
    walks: int
    unconverged: int
    failed: int
    first_failure: str
    trajectories: int
    blocks: int | None  # Saltelli's
    seed: int
    synthetic: bool
    outputs: Mapping[str, OutputRow]  # by OUTPUTS
