"""What the paper's bench did not do: other speeds, the way back with its energy, other points of the load."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vsf_drake.analysis.validation.bench.passes import LOAD_N, Loop, Machine, moved_load, stiffness_n_per_mm
from vsf_drake.analysis.validation.bench.statistics import rising
from vsf_drake.bench_file import STIFFNESS_ABOVE_N
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.laws.beam import combined_stiffness, lumped_stiffness, section_inertia
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.simulation.bench import STEPS_PER_MM

SPEEDS_MM_PER_MIN = (5.0, 50.0, 500.0, 5000.0)
LOAD_POINT_SHIFTS_M = (-0.020, -0.010, 0.0, 0.010)
"""Of the load point from the model's own: 179, 189, 199 and 209 mm from A for the published foot."""
LOOP_SAMPLES = 101
"""Of each half of a loop, evenly in displacement."""


def rates(
    machine: Machine, fulcrums_m: Sequence[float | None], speeds_mm_per_min: Sequence[float],
    *, steps_per_mm: float = STEPS_PER_MM, progress: Callable[[float], None] | None = None
) -> tuple[list[dict[str, Any]], dict[str, np.ndarray], list[str]]:
    """Loading to 600 N and unloading at the same speed, at every position and speed.

    What is lost is the small difference of two large energies, and the steps leave an error in it in proportion to
    their size. So every loop is followed twice, with steps twice as long too, and the loss is extrapolated to none.

    Args:
        steps_per_mm: of the finer steps.

    Returns:
        One row each; the loops at the highest speed, `loop_mm` and `loop_n` (settings, 2, 101) with loading first;
        what could not be done.
    """
    rows: list[dict[str, Any]] = []
    missing: list[str] = []
    shape = len(fulcrums_m), 2, LOOP_SAMPLES
    loops = {"loop_mm": np.full(shape, np.nan), "loop_n": np.full(shape, np.nan)}
    for i, fulcrum in enumerate(fulcrums_m):
        for j, speed in enumerate(speeds_mm_per_min):
            where = "heel" if fulcrum is None else f"fulcrum at {1e3 * fulcrum:g} mm"
            try:
                loop, coarse = (machine.loop(fulcrum, LOAD_N, 1e-3 * speed / 60.0, steps_per_mm=share * steps_per_mm)
                                for share in (1.0, 0.5))
                rows.append(_row(fulcrum, speed, loop, coarse, where))
            except (InputError, SimulationError) as error:
                missing.append(f"Loading and unloading at {speed:g} mm/min, {where}: {error}.")
                continue
            if speed == max(speeds_mm_per_min):
                loops["loop_mm"][i], loops["loop_n"][i] = _sampled(loop)
            if progress:
                progress((i * len(speeds_mm_per_min) + j + 1) / (len(fulcrums_m) * len(speeds_mm_per_min)))
    return rows, loops, missing


def _row(fulcrum: float | None, speed: float, loop: Loop, coarse: Loop, where: str) -> dict[str, Any]:
    k = stiffness_n_per_mm(*rising(loop.up_mm, loop.up_n), where)  # at high speed the keel rings at first touch
    stored, top = loop.stored_j, float(loop.up_n[-1])
    with_steps, with_coarse = loop.stored_j - loop.returned_j, coarse.stored_j - coarse.returned_j
    lost = 2.0 * with_steps - with_coarse
    return {
        "fulcrum_mm": None if fulcrum is None else round(1e3 * fulcrum, 6), "speed_mm_per_min": speed,
        "stiffness_n_per_mm": k, "max_load_n": top, "max_displacement_mm": float(loop.up_mm[-1]),
        "loading_s": loop.loading_s, "stored_j": stored, "returned_j": stored - lost, "lost_j": lost,
        "lost_step_error_j": abs(with_steps - with_coarse), "return_ratio": 1.0 - lost / stored,
        "linear_spring_j": 1e-3 * top**2 / (2.0 * k),
        "unconverged_steps": loop.unconverged_steps + coarse.unconverged_steps,
    }


def _sampled(loop: Loop) -> tuple[np.ndarray, np.ndarray]:
    up = np.linspace(0.0, loop.up_mm[-1], LOOP_SAMPLES)
    way_mm = np.append(loop.up_mm[-1], loop.down_mm)[::-1]
    way_n = np.append(loop.up_n[-1], loop.down_n)[::-1]
    load = np.interp(up, loop.up_mm, loop.up_n), np.interp(up[::-1], way_mm, way_n)
    return np.array([up, up[::-1]]), np.array(load)


def load_points(
    model: ModelParameters, fulcrums_m: Sequence[float], progress: Callable[[float], None] | None = None
) -> tuple[list[dict[str, Any]], list[str]]:
    """Stiffness above 200 N with the load elsewhere on the keel, beside the closed form of the overhung beam.

    Returns:
        One row for every load point and fulcrum position; what could not be done.
    """
    rows: list[dict[str, Any]] = []
    missing: list[str] = []
    for i, shift in enumerate(LOAD_POINT_SHIFTS_M):
        point = round(model.foot.load_point_m + shift, 9)
        foot = moved_load(model.foot, point)
        if not foot.fulcrum.foremost_m < point <= sum(foot.keel.element_lengths_m) + 1e-12:
            missing.append(f"A load at {1e3 * point:g} mm from the keel's end is not on the free part of this keel.")
            continue
        machine = Machine(foot)
        for fulcrum in fulcrums_m:
            where = f"load at {1e3 * point:g} mm, fulcrum at {1e3 * fulcrum:g} mm"
            try:
                x, load, _ = machine.press(fulcrum)
            except (InputError, SimulationError) as error:
                missing.append(f"Stiffness with the {where}: {error}.")
                continue
            rows.append({
                "load_point_mm": round(1e3 * point, 6), "fulcrum_mm": round(1e3 * fulcrum, 6),
                "stiffness_n_per_mm": stiffness_n_per_mm(x, load, where),
                "closed_form_n_per_mm": 1e-3 * small_load_stiffness(foot, fulcrum),
                "chain_n_per_mm": 1e-3 * small_load_stiffness(foot, fulcrum, chain=True), "own_point": shift == 0.0})
        if progress:
            progress((i + 1) / len(LOAD_POINT_SHIFTS_M))
    return rows, missing


def small_load_stiffness(foot: FootParameters, fulcrum_m: float, *, chain: bool = False) -> float:
    """Stiffness (N/m) of the keel on its fulcrum while it is hardly bent, the foam's in series.

    The foam's is its mean slope between the two loads of the bench. The keel is a continuous overhung beam
    (`laws.beam.combined_stiffness`), or the model's chain of sprung joints (`laws.beam.lumped_stiffness`): what the
    two differ by is the chain's coarseness, and by what the simulation then exceeds the chain is large deflection.
    """
    k, n = foot.series_stiffness_n_per_m, foot.series_exponent
    low, high = ((load / k) ** (1.0 / n) for load in (STIFFNESS_ABOVE_N, LOAD_N))
    keel = foot.keel
    given = {
        "bending_stiffness": keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m),
        "support": fulcrum_m, "load_point": foot.load_point_m, "fulcrum_stiffness": foot.fulcrum.stiffness_n_per_m,
        "series_stiffness": (LOAD_N - STIFFNESS_ABOVE_N) / (high - low)}
    if chain:
        return lumped_stiffness(element_lengths=keel.element_lengths_m, **given)
    return float(combined_stiffness(**given))
