"""The measured bench that a fit takes, from either file: what was made of the curves, or the curves themselves.

A file of curves (`bench_curves`, .csv) tells of each setting, as the mean over its passes, the stiffness above 200 N
and the mid-range displacement. All passes are cut to the smallest of their largest loads, so that there is one largest
load and one half of it.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from vsf_drake.analysis.validation.bench_lines import Setting, settings_of, up_to
from vsf_drake.bench_curves import STIFFNESS_ABOVE_N, BenchMeasurement, load_bench_curves, load_bench_file
from vsf_drake.errors import InputError

CURVES = ".csv"


def load_measured_bench(path: str | Path) -> BenchMeasurement:
    """Reads curves where the file's name ends in .csv, a bench file (`bench_curves`) else.

    Raises:
        InputError: see `load_bench_file` and `load_bench_curves`; curves hold no forefoot, a setting is pressed too
            little for a stiffness above 200 N, or an uncertainty is none.
    """
    path = Path(path)
    return _from_curves(path) if path.suffix.lower() == CURVES else load_bench_file(path)


def _from_curves(path: Path) -> BenchMeasurement:
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
    load = min(setting.load_n for setting in settings)
    told = {setting.fulcrum_m: _told(setting, load, path) for setting in settings}
    positions, heel = tuple(x for x in told if x is not None), told.get(None)
    return BenchMeasurement(
        name=curves.name, synthetic=curves.synthetic, fulcrum_m=positions,
        stiffness_n_per_m=tuple(told[x][0] for x in positions),
        heel_stiffness_n_per_m=None if heel is None else heel[0],
        uncertainty_n_per_m=curves.stiffness_sd_n_per_m, max_load_n=load,
        mid_range_m=tuple(told[x][1] for x in positions), heel_mid_range_m=None if heel is None else heel[1],
        mid_range_uncertainty_m=curves.displacement_sd_m)


def _told(setting: Setting, load_n: float, path: Path) -> tuple[float, float]:
    """Stiffness (N/m) and mid-range displacement (m) of a setting up to this load."""
    cut = dataclasses.replace(setting, load_n=load_n, passes=tuple(up_to(*one, load_n) for one in setting.passes))
    try:
        measured = cut.row()["measured"]
    except InputError as error:
        raise InputError(error.what, file=path, where=setting.where, right=error.right) from None
    return 1e3 * measured["stiffness_n_per_mm"], 1e-3 * measured["mid_range_mm"]
