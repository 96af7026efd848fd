"""The virtual foot on its bench as a laboratory would hand it over: `bench.yaml` and `bench_curves.csv`.

Static, the virtual bench's own without an error or noise: the uncertainty beside the stiffness is a choice, of the size
of what two tests of one foot differ by. One pass a setting, from touch-down to 600 N; this bench knows no unloading.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from virtual_laboratory.bench import (
    LOADS_N,
    bench_device,
    forefoot_curve,
    forefoot_stiffness,
    heel_compression,
    heel_stiffness,
)
from virtual_laboratory.design import Design
from virtual_laboratory.writing import NOTICE
from vsf_drake.bench_curves import STIFFNESS_ABOVE_N
from vsf_drake.files import replaced

FULCRUMS_MM = (66, 87, 108, 129, 151)
"""The paper's positions."""
UNCERTAINTY_N_PER_MM = 0.5
LOADS = np.unique([0.0, 1.0, 2.0, 4.0, 6.0, 8.0, *np.arange(10.0, LOADS_N[1] + 5.0, 10.0)])
"""Of a curve (N): finer where the sole's rounding meets the platen."""


def write_bench(folder: Path) -> Path:
    """`bench.yaml` in `folder`."""
    if LOADS_N[0] != STIFFNESS_ABOVE_N:
        raise RuntimeError(f"the virtual bench takes the slope from {LOADS_N[0]:g} N, bench files from "
                           f"{STIFFNESS_ABOVE_N:g} N")
    folder.mkdir(parents=True, exist_ok=True)
    devices = {x: bench_device(Design(), 1e-3 * x) for x in FULCRUMS_MM}
    settings = "".join(f"  - {{fulcrum_mm: {x}, stiffness_n_per_mm: {1e-3 * forefoot_stiffness(device):.3f}}}\n"
                       for x, device in devices.items())
    with replaced(folder / "bench.yaml") as stream:
        stream.write(
            f"# {NOTICE.replace('walked', 'measured')}.\n"
            "# The virtual foot on its bench (studies/virtual_laboratory/bench.py), pressed vertically 199 mm from\n"
            f"# the keel's posterior end; static, no noise. Stiffness is the mean slope from {LOADS_N[0]:g} to "
            f"{LOADS_N[1]:g} N. That foot was\n"
            "# tuned to 10 and 32 N/mm (Glanzer & Adamczyk 2018, PMC6289620) and to a heel of 65 N/mm (McGeehan 2021,\n"
            "# doi 10.1115/1.4050456); what lies between follows. The uncertainty is a choice.\n"
            "name: SYNTHETIC bench of the reference subject's foot\n"
            "synthetic: true\n"
            f"forefoot:\n{settings}"
            f"heel_stiffness_n_per_mm: {1e-3 * heel_stiffness(devices[FULCRUMS_MM[0]]):.3f}\n"
            f"stiffness_uncertainty_n_per_mm: {UNCERTAINTY_N_PER_MM:g}\n"
            f"max_load_n: {LOADS_N[1]:g}\n")
    return folder / "bench.yaml"


def write_bench_curves(folder: Path) -> Path:
    """`bench_curves.csv` in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
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
            device = bench_device(Design(), 1e-3 * (fulcrum or FULCRUMS_MM[0]))
            travel_m = forefoot_curve(device, LOADS) if fulcrum else [heel_compression(device, load) for load in LOADS]
            for travel, load in zip(travel_m, LOADS, strict=True):
                stream.write(f"{fulcrum or ''},{1e3 * travel:.4f},{load:g}\n")
    return folder / "bench_curves.csv"
