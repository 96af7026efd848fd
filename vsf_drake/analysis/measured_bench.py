"""The measured bench that a fit takes, from either file: what was made of the curves, or the curves themselves.

A file of curves (`bench_curves`, .csv) tells of each setting, as the mean over its passes, the stiffness above 200 N
and the mid-range displacement. All passes are cut to the smallest of their largest loads, so that there is one largest
load and one half of it.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from vsf_drake.analysis.validation.bench_lines import settings_of, up_to
from vsf_drake.bench_curves import STIFFNESS_ABOVE_N, BenchMeasurement, load_bench_curves, load_bench_file
from vsf_drake.errors import InputError

CURVES = ".csv"


def load_measured_bench(path: str | Path) -> BenchMeasurement:
    """Reads curves where the file's name ends in .csv, a bench file (`bench_curves`) else.

    Curves need the forefoot, and every setting pressed far enough for a stiffness above 200 N.
    """
    path = Path(path)
    if path.suffix.lower() != CURVES:
        return load_bench_file(path)
    curves = load_bench_curves(path)
    settings = [setting for setting in settings_of(curves, ()) if setting.passes]
    if all(setting.fulcrum_m is None for setting in settings):
        raise InputError("holds the heel only", file=path, where="column fulcrum",
                         right="A fit needs the forefoot at one position or more")
    for setting in settings:
        if not setting.judged:
            raise InputError(f"is pressed to {setting.load_n:.4g} N, too little for a stiffness above "
                             f"{STIFFNESS_ABOVE_N:g} N", file=path, where=f"{setting.where}, column load",
                             right="Press further, or leave this setting out of the file")
    load, told = min(setting.load_n for setting in settings), dict[float | None, tuple[float, float]]()
    for setting in settings:
        cut = dataclasses.replace(setting, load_n=load, passes=tuple(up_to(*one, load) for one in setting.passes))
        try:
            measured = cut.row()["measured"]
        except InputError as error:
            raise InputError(error.what, file=path, where=setting.where, right=error.right) from None
        told[setting.fulcrum_m] = 1e3 * measured["stiffness_n_per_mm"], 1e-3 * measured["mid_range_mm"]
    heel = told.pop(None, (None, None))
    return BenchMeasurement(
        name=curves.name, synthetic=curves.synthetic, fulcrum_m=tuple(told),  # type: ignore[arg-type]
        stiffness_n_per_m=tuple(stiffness for stiffness, _ in told.values()), heel_stiffness_n_per_m=heel[0],
        uncertainty_n_per_m=curves.stiffness_sd_n_per_m, max_load_n=load,
        mid_range_m=tuple(displacement for _, displacement in told.values()), heel_mid_range_m=heel[1],
        mid_range_uncertainty_m=curves.displacement_sd_m)
