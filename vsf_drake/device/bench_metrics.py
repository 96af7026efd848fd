"""What the materials testing machine measures: stiffness, mid-range displacement, the table of
`bench.json`.

Stiffness (McGeehan 2021, eq. 3, doi 10.1115/1.4050456) is the mean slope dF/dx above 200 N, where
the foam no longer dominates. Published end points: Glanzer & Adamczyk 2018 (PMC6289620), 10 and
32 N/mm; heel 65 N/mm (McGeehan 2021). Between them nothing is published but the joints that the
paper's authors tuned on their bench, position by position, in their public model (GaitModel_VSF
scripts).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import from_plain
from vsf_drake.laws.beam import (
    combined_stiffness,
    lumped_stiffness,
    section_inertia,
    taper,
)
from vsf_drake.model.bench_curves import STIFFNESS_ABOVE_N
from vsf_drake.model.parameters import FootParameters
from vsf_drake.model.setting import AtSetting, moves, setting_of
from vsf_drake.simulation.results import BenchResult, BenchSetting

# fulcrum (m) -> stiffness (N/m), measured on the prototype
PUBLISHED_STIFFNESS_N_PER_M = {0.066: 10e3, 0.151: 32e3}
PUBLISHED_HEEL_STIFFNESS_N_PER_M = 65e3


def _tuned_joints(fulcrum_mm: float, *, series_n_per_m: float = 62.8e3) -> float:
    """Stiffness (N/m) for small loads of the keel in the GaitModel_VSF scripts, its fulcrum at one
    of its joints.

    A cantilever from the fulcrum on: 1 / k is the sum over the joints from there to the load, at
    199 mm, of (x_load - x_joint)^2 / k_joint, and 1 / series. The scripts have joints every 21 mm
    from 66 mm on, each of 13.839 - 0.0677 * fulcrum in mm (N m per degree), a regression that their
    authors tuned on the bench. They give no series spring; the 62.8 N/mm are ours, so that 150 mm
    has 32.0 N/mm, published for 151 mm.
    """
    return 1.0 / (
        sum((1e-3 * (199 - x)) ** 2 for x in range(66, 199, 21) if x >= fulcrum_mm)
        / tuned_joint_nm_per_rad(fulcrum_mm)
        + 1.0 / series_n_per_m
    )


def tuned_joint_nm_per_rad(fulcrum_mm: float) -> float:
    """Of each joint of the GaitModel_VSF scripts' keel."""
    return math.degrees(13.839 - 0.0677 * fulcrum_mm)


TUNED_JOINTS_N_PER_M = {x / 1000: _tuned_joints(x) for x in (66, 87, 108, 129, 150)}
"""Fulcrum (m) -> stiffness (N/m) of the authors' tuned joints: derived from their scripts, not a
measurement."""
LOAD_N = 600.0
"""Largest load of the paper's passes."""
BEAM_PIECES = 1000
"""Of the chain that is a keel that thins; a uniform one has the closed form's stiffness within
1e-6."""
_SAME_POSITION_M = 5e-4
_START_SHARE = 0.02  # share of the largest load with which a curve may start
_NOISE = 1e-6  # share of the largest load by which a load may fall without counting as not monotone


def displacement(setting: BenchSetting) -> np.ndarray:
    """(n,) travel (m) of the platen since it touched the foot, negative before; touch-down must be
    in the curve."""
    if setting.load_n[0] > _START_SHARE * np.max(setting.load_n):
        raise InputError(
            f"the load-displacement curve starts at {setting.load_n[0]:.3g} N",
            where=_label(setting),
            right="It must start before the platen touches the foot, or as it does",
        )
    return setting.platen_m


def at_loads(x: np.ndarray, load: np.ndarray, loads: Any) -> np.ndarray:
    """Displacement at which a rising curve bears each of `loads`, the farthest where it rests; NaN
    beyond its end."""
    return np.asarray(np.interp(loads, np.maximum.accumulate(load), x, right=np.nan))


def mean_slope(x: np.ndarray, load: np.ndarray, above_n: float = STIFFNESS_ABOVE_N) -> float:
    """Mean slope dF/dx of a rising curve from `above_n` to its largest load, eq. 3 of
    McGeehan 2021.

    The mean over the travel, (1/Δx) ∫ dF/dx dx = (F_max - F_above) / (x_max - x_above): it does not
    depend on how densely or evenly the curve is sampled.
    """
    return float((load[-1] - above_n) / (x[-1] - at_loads(x, load, above_n)))


def stiffness(
    displacement_m: np.ndarray,
    load_n: np.ndarray,
    *,
    above_n: float = STIFFNESS_ABOVE_N,
    where: str | None = None,
) -> float:
    """`mean_slope` (N/m) of a curve that is checked: displacement (n,) m, increasing; load (n,) N,
    not decreasing, above `above_n` at the end; `where` is what the curve is, for messages."""
    x, load = _checked(displacement_m, load_n, where)
    if load[-1] <= above_n:
        raise InputError(
            f"the largest load is {load[-1]:.4g} N, and stiffness is the mean slope above "
            f"{above_n:g} N",
            where=where,
            right="Press further: raise the largest load",
        )
    return mean_slope(x, load, above_n)


def mid_range_displacement(
    displacement_m: np.ndarray, load_n: np.ndarray, *, where: str | None = None
) -> float:
    """Displacement (m) at half of the largest load, interpolated linearly; see `stiffness`."""
    x, load = _checked(displacement_m, load_n, where)
    if load[-1] <= 0.0:
        raise InputError("the curve is never loaded", where=where)
    return float(at_loads(x, load, 0.5 * load[-1]))


@dataclass(frozen=True, kw_only=True)
class BenchPass(AtSetting):
    """One pass of the machine at the forefoot, beside what is published and the authors' tuned
    joints, of which a passive foot is none; None unknown."""

    stiffness_n_per_mm: float
    mid_range_displacement_mm: float
    max_load_n: float
    max_displacement_mm: float
    published_n_per_mm: float | None
    tuned_joints_n_per_mm: float | None


@dataclass(frozen=True, kw_only=True)
class BenchTable:
    """The content of `bench.json`."""

    settings: tuple[BenchPass, ...]  # of the forefoot, by fulcrum position
    heel_stiffness_n_per_mm: float | None
    heel_published_n_per_mm: float | None  # None of a passive foot
    speed_mm_per_min: float
    simulated_s: float
    wall_s: float
    compile_s: float
    unconverged_steps: int
    refined_steps: int


def bench_table(result: BenchResult) -> BenchTable:
    """The numbers of a bench."""
    rows = []
    heel = result.heel
    foot = from_plain(FootParameters, result.parameters["foot"])
    published = moves(foot)  # of the one device, whose fulcrum moves
    for setting in result.forefoot:
        where = _label(setting)
        x = displacement(setting)
        fulcrum = setting.fulcrum_m or 0.0
        rows.append(
            BenchPass(
                **vars(setting_of(foot, fulcrum)),
                stiffness_n_per_mm=1e-3 * stiffness(x, setting.load_n, where=where),
                mid_range_displacement_mm=1e3
                * mid_range_displacement(x, setting.load_n, where=where),
                max_load_n=float(np.max(setting.load_n)),
                max_displacement_mm=1e3 * float(x[-1]),
                published_n_per_mm=in_n_per_mm(published_stiffness(fulcrum)) if published else None,
                tuned_joints_n_per_mm=in_n_per_mm(tuned_joints_stiffness(fulcrum))
                if published
                else None,
            )
        )
    return BenchTable(
        settings=tuple(rows),
        heel_published_n_per_mm=1e-3 * PUBLISHED_HEEL_STIFFNESS_N_PER_M if published else None,
        heel_stiffness_n_per_mm=None
        if heel is None
        else 1e-3 * stiffness(displacement(heel), heel.load_n, where=_label(heel)),
        speed_mm_per_min=60e3 * result.speed_m_per_s,
        simulated_s=result.simulated_s,
        wall_s=result.wall_s,
        compile_s=result.compile_s,
        unconverged_steps=sum(setting.unconverged_steps for setting in result.settings),
        refined_steps=sum(setting.refined_steps for setting in result.settings),
    )


def closed_form_stiffness(foot: Mapping[str, Any], fulcrum_m: Any) -> np.ndarray:
    """Stiffness (N/m) at `fulcrum_m` (m) of the overhung beam with the compliances of a foot, given
    as plain values; a keel that thins is a chain of BEAM_PIECES.

    The foam, in series, has its mean slope between the two loads of the bench.
    """
    keel = foot["keel"]
    bending = keel["flexural_modulus_pa"] * section_inertia(keel["width_m"], keel["thickness_m"])
    k = foot["series_stiffness_n_per_m"]
    n = foot.get("series_exponent", 1.0)
    low, high = ((load / k) ** (1.0 / n) for load in (STIFFNESS_ABOVE_N, LOAD_N))
    support = np.asarray(fulcrum_m, dtype=float)
    held = {
        "load_point": foot["load_point_m"],
        "fulcrum_stiffness": foot["fulcrum"]["stiffness_n_per_m"],
        "series_stiffness": (LOAD_N - STIFFNESS_ABOVE_N) / (high - low),
    }
    tip = keel.get("tip_stiffness", 1.0)
    if tip == 1.0:
        return np.asarray(combined_stiffness(bending_stiffness=bending, support=support, **held))
    end = math.fsum(keel["element_lengths_m"])
    lengths = np.full(BEAM_PIECES, end / BEAM_PIECES)
    middles = np.cumsum(lengths) - 0.5 * lengths
    bending = bending * taper(middles, start=keel["taper_from_m"], end=end, tip=tip)
    stiffness = [
        lumped_stiffness(bending_stiffness=bending, element_lengths=lengths, support=at, **held)
        for at in support.flat
    ]
    return np.reshape(stiffness, support.shape)


def published_stiffness(fulcrum_m: float | None) -> float | None:
    """Published stiffness (N/m) at this fulcrum position (None for the heel); None where none is
    published."""
    return (
        PUBLISHED_HEEL_STIFFNESS_N_PER_M
        if fulcrum_m is None
        else _near(PUBLISHED_STIFFNESS_N_PER_M, fulcrum_m)
    )


def tuned_joints_stiffness(fulcrum_m: float | None) -> float | None:
    """Likewise of the authors' tuned joints, which stand at few positions and have no heel."""
    return None if fulcrum_m is None else _near(TUNED_JOINTS_N_PER_M, fulcrum_m)


def in_n_per_mm(stiffness_n_per_m: float | None) -> float | None:
    """The stiffness in N/mm, where it is known."""
    return None if stiffness_n_per_m is None else 1e-3 * stiffness_n_per_m


def _near(known: Mapping[float, float], fulcrum_m: float) -> float | None:
    return next(
        (k for position, k in known.items() if abs(position - fulcrum_m) < _SAME_POSITION_M), None
    )


def _checked(
    displacement_m: np.ndarray, load_n: np.ndarray, where: str | None
) -> tuple[np.ndarray, np.ndarray]:
    x = np.asarray(displacement_m, dtype=float)
    load = np.asarray(load_n, dtype=float)
    if x.ndim != 1 or x.shape != load.shape or len(x) < 2:
        raise ValueError(
            f"displacement {x.shape} and load {load.shape} must be (n,) both, n at least 2"
        )
    if not (np.isfinite(x).all() and np.isfinite(load).all()):
        raise InputError(
            "the load-displacement curve holds a value that is not finite", where=where
        )
    if np.any(np.diff(x) <= 0.0):
        row = int(np.argmax(np.diff(x) <= 0.0)) + 1
        raise InputError(
            f"the displacement does not increase at sample {row} ({1e3 * x[row]:.4g} mm)",
            where=where,
        )
    if np.any(np.diff(load) < -_NOISE * np.max(np.abs(load))):
        row = int(np.argmin(np.diff(load))) + 1
        raise InputError(
            f"the load falls from {load[row - 1]:.4g} to {load[row]:.4g} N at {1e3 * x[row]:.4g} "
            "mm",
            where=where,
            right="Stiffness needs a loading curve that rises all the way",
        )
    return x, load


def _label(setting: BenchSetting) -> str:
    return (
        "bench, heel"
        if setting.fulcrum_m is None
        else f"bench, fulcrum at {1e3 * setting.fulcrum_m:g} mm"
    )
