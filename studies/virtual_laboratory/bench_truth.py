"""A virtual foot on its bench as a laboratory would hand it over: `bench.yaml` and
`bench_curves.csv`.

Static, from touch-down to 600 N, one pass a setting; this bench knows no unloading. The reference
subject's is the virtual bench's own without an error: the uncertainty beside the stiffness is a
choice, of the size of what two tests of one foot differ by. With a seed the files have the errors
of a test, choices too.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from virtual_laboratory.bench import LOADS_N, forefoot_curve, heel_curve
from virtual_laboratory.design import Design
from virtual_laboratory.writing import NOTICE
from vsf_drake.base.files import replaced
from vsf_drake.model.bench_curves import STIFFNESS_ABOVE_N

FULCRUMS_MM = (66, 87, 108, 129, 151)
"""The paper's positions."""
UNCERTAINTY_N_PER_MM = 0.5
LOADS = np.unique([0.0, 1.0, 2.0, 4.0, 6.0, 8.0, *np.arange(10.0, LOADS_N[1] + 5.0, 10.0)])
"""Of a curve (N): finer where the sole's rounding meets the platen."""
FULCRUM_SD_M, TRAVEL_SD, LOAD_SD_N = 3e-4, 0.01, 1.0
"""Errors of a test: of the fulcrum's place, of all travel of a setting (machine and fixture yield),
of each load."""
REFERENCE = "SYNTHETIC bench of the reference subject's foot"


def measured_curves(
    design: Design, seed: int | None = None
) -> dict[int | None, tuple[np.ndarray, np.ndarray]]:
    """Travel (m) and load (N), (n,) each, by fulcrum position (mm), the heel's at None.

    A foot without a support has its forefoot curve at 0. With `seed` there are errors of a test.
    """
    random = np.random.default_rng(seed)
    errors = 0.0 if seed is None else 1.0
    curves: dict[int | None, tuple[np.ndarray, np.ndarray]] = {}
    for fulcrum in (*(FULCRUMS_MM if design.support else (0,)), None):
        place, scale = errors * random.normal(size=2) * [FULCRUM_SD_M, TRAVEL_SD]
        noise = errors * LOAD_SD_N * random.normal(size=len(LOADS)) * (LOADS > 0.0)
        if fulcrum is None:
            travel = heel_curve(design, LOADS)
        else:
            support = design.support
            where = support and float(
                np.clip(1e-3 * fulcrum + place, support.rearmost_m, support.foremost_m)
            )
            travel = forefoot_curve(design, where, LOADS)
        curves[fulcrum] = (1.0 + scale) * travel, LOADS + noise
    return curves


def stiffness_n_per_mm(travel_m: np.ndarray, load_n: np.ndarray) -> float:
    """Mean slope between 200 and 600 N."""
    low, high = np.interp(LOADS_N, load_n, travel_m)
    return float(1e-3 * (LOADS_N[1] - LOADS_N[0]) / (high - low))


def write_bench(
    folder: Path,
    design: Design | None = None,
    *,
    name: str = REFERENCE,
    notice: str = NOTICE,
    seed: int | None = None,
) -> Path:
    """`bench.yaml` in `folder`, of a foot with a support: the reference subject's where None."""
    if LOADS_N[0] != STIFFNESS_ABOVE_N:
        raise RuntimeError(
            f"the virtual bench takes the slope from {LOADS_N[0]:g} N, bench files from "
            f"{STIFFNESS_ABOVE_N:g} N"
        )
    folder.mkdir(parents=True, exist_ok=True)
    design = design or Design()
    stiffness = {
        x: stiffness_n_per_mm(*curve) for x, curve in measured_curves(design, seed).items()
    }
    settings = "".join(
        f"  - {{fulcrum_mm: {x}, stiffness_n_per_mm: {stiffness[x]:.3f}}}\n" for x in FULCRUMS_MM
    )
    with replaced(folder / "bench.yaml") as stream:
        stream.write(
            (
                f"# {notice.replace('walked', 'measured')}.\n# The virtual foot on its bench "
                "(studies/virtual_laboratory/bench.py), pressed vertically "
                f"{1e3 * design.frame.load_point_m:.0f} mm from\n# the keel's posterior end; "
                f"static, {'no noise' if seed is None else 'with the errors of a test'}. "
                f"Stiffness is the mean slope from {LOADS_N[0]:g} to {LOADS_N[1]:g} N.\n"
            )
            + (
                (
                    "# That foot was tuned to 10 and 32 N/mm (Glanzer & Adamczyk 2018, PMC6289620) "
                    "and to a heel of 65\n# (McGeehan 2021, doi 10.1115/1.4050456); what lies "
                    "between follows.\n"
                )
                if design == Design()
                else ""
            )
            + "# The uncertainty is a choice.\n"
            f"name: {name}\n"
            "synthetic: true\n"
            f"forefoot:\n{settings}"
            f"heel_stiffness_n_per_mm: {stiffness[None]:.3f}\n"
            f"stiffness_uncertainty_n_per_mm: {UNCERTAINTY_N_PER_MM:g}\n"
            f"max_load_n: {LOADS_N[1]:g}\n"
        )
    return folder / "bench.yaml"


def write_bench_curves(
    folder: Path,
    design: Design | None = None,
    *,
    name: str = REFERENCE,
    notice: str = NOTICE,
    seed: int | None = None,
) -> Path:
    """`bench_curves.csv` in `folder`, of a foot with a support: the reference subject's where
    None."""
    folder.mkdir(parents=True, exist_ok=True)
    design = design or Design()
    with replaced(folder / "bench_curves.csv") as stream:
        stream.write(
            f"# {notice.replace('walked', 'measured')}.\n# The virtual foot on its bench "
            "(studies/virtual_laboratory/bench.py), pressed vertically "
            f"{1e3 * design.frame.load_point_m:.0f} mm from the\n# keel's posterior end, or on "
            "the heel (no fulcrum); static, loading only, "
            f"{'no noise' if seed is None else 'with the errors of a test'}, one pass a "
            f"setting.\n# name: {name}\n# synthetic: true\nfulcrum_mm,displacement_mm,load_n\n"
        )
        for fulcrum, (travel_m, load_n) in measured_curves(design, seed).items():
            for travel, load in zip(travel_m, load_n, strict=True):
                stream.write(f"{fulcrum or ''},{1e3 * travel:.4f},{round(load, 2):g}\n")
    return folder / "bench_curves.csv"
