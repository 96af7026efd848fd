"""The virtual foot on its bench as a laboratory would hand it over: `bench.yaml` of the reference subject.

The stiffness is the virtual bench's own, without an error: the uncertainty beside it is a choice, of the size of what
two tests of one foot differ by.
"""

from __future__ import annotations

from pathlib import Path

from virtual_laboratory.bench import LOADS_N, bench_device, forefoot_stiffness, heel_stiffness
from virtual_laboratory.design import Design
from virtual_laboratory.writing import NOTICE
from vsf_drake.bench_curves import STIFFNESS_ABOVE_N
from vsf_drake.files import replaced

FULCRUMS_MM = (66, 87, 108, 129, 151)
"""The paper's positions."""
UNCERTAINTY_N_PER_MM = 0.5
DECIMALS = 3
"""Of N/mm."""


def forefoot_n_per_mm(design: Design | None = None) -> dict[int, float]:
    """Stiffness by fulcrum position (mm), mean slope between 200 and 600 N."""
    made = design or Design()
    return {x: 1e-3 * forefoot_stiffness(bench_device(made, 1e-3 * x)) for x in FULCRUMS_MM}


def heel_n_per_mm(design: Design | None = None) -> float:
    """The heel's, likewise; the fulcrum does not matter there."""
    return 1e-3 * heel_stiffness(bench_device(design or Design(), 1e-3 * FULCRUMS_MM[0]))


def write_bench(folder: Path) -> Path:
    """`bench.yaml` in `folder`."""
    if LOADS_N[0] != STIFFNESS_ABOVE_N:
        raise RuntimeError(f"the virtual bench takes the slope from {LOADS_N[0]:g} N, bench files from "
                           f"{STIFFNESS_ABOVE_N:g} N")
    folder.mkdir(parents=True, exist_ok=True)
    settings = "".join(f"  - {{fulcrum_mm: {x}, stiffness_n_per_mm: {k:.{DECIMALS}f}}}\n"
                       for x, k in forefoot_n_per_mm().items())
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
            f"heel_stiffness_n_per_mm: {heel_n_per_mm():.{DECIMALS}f}\n"
            f"stiffness_uncertainty_n_per_mm: {UNCERTAINTY_N_PER_MM:g}\n"
            f"max_load_n: {LOADS_N[1]:g}\n")
    return folder / "bench.yaml"
