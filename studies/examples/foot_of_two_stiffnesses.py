"""A foot of another make from the stiffness of its forefoot and its heel at one load (800 N)."""

from __future__ import annotations

import vsf_drake as vsf
from vsf_drake.device.foot_from_curves import curves_of_stiffness


def main() -> dict[str, float]:
    """Travel (mm) of the model's platen, level, at 800 N."""
    told = curves_of_stiffness(forefoot_n_per_m=28e3, heel_n_per_m=60e3, load_n=800.0)
    foot = vsf.foot_from_curves(told, length_m=0.270, mass_kg=0.600)
    bench = vsf.run_bench(foot.model, max_load_n=800.0)
    return {
        "heel" if each.fulcrum_m is None else "forefoot": 1e3 * float(each.platen_m[-1])
        for each in bench.settings
    }


if __name__ == "__main__":
    print(main())
