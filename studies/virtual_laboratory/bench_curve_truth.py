"""The virtual foot's load-displacement curves as a laboratory would hand them over: `bench_curves.csv`.

Static and without noise; one pass a setting, from touch-down to 600 N and no way back: this bench knows no unloading.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from virtual_laboratory.bench import LOADS_N, bench_device, forefoot_curve, heel_compression
from virtual_laboratory.bench_truth import FULCRUMS_MM
from virtual_laboratory.design import Design
from virtual_laboratory.writing import NOTICE
from vsf_drake.files import replaced

STEP_N = 10.0
FIRST_N = (1.0, 2.0, 4.0, 6.0, 8.0)
"""Finer where the sole's rounding meets the platen."""
DECIMALS = 4
"""Of mm."""


def curve_loads() -> np.ndarray:
    """Loads (N) of a curve, from touch-down to the largest."""
    return np.unique(np.concatenate(([0.0], FIRST_N, np.arange(STEP_N, LOADS_N[1] + 0.5 * STEP_N, STEP_N))))


def travel_mm(fulcrum_mm: float | None, loads: np.ndarray, design: Design | None = None) -> np.ndarray:
    """Travel (mm) of the machine since it touched, at `loads` (N, increasing); the heel's for no fulcrum."""
    device = bench_device(design or Design(), 1e-3 * (FULCRUMS_MM[0] if fulcrum_mm is None else fulcrum_mm))
    if fulcrum_mm is None:
        return 1e3 * np.array([heel_compression(device, float(load)) for load in loads])
    return 1e3 * forefoot_curve(device, loads)


def write_bench_curves(folder: Path) -> Path:
    """`bench_curves.csv` in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    loads = curve_loads()
    with replaced(folder / "bench_curves.csv") as stream:
        stream.write(
            f"# {NOTICE.replace('walked', 'measured')}.\n"
            "# The virtual foot on its bench (studies/virtual_laboratory/bench.py), pressed vertically 199 mm from "
            "the\n# keel's posterior end, or on the heel (no fulcrum); static, loading only, no noise, one pass a "
            "setting.\n"
            "# name: SYNTHETIC bench of the reference subject's foot\n"
            "# synthetic: true\n"
            "fulcrum_mm,displacement_mm,load_n\n")
        for fulcrum in (*FULCRUMS_MM, None):
            for travel, load in zip(travel_mm(fulcrum, loads), loads, strict=True):
                stream.write(f"{'' if fulcrum is None else fulcrum},{travel:.{DECIMALS}f},{load:g}\n")
    return folder / "bench_curves.csv"
