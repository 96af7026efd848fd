"""Calibrates the foot's two unknown compliances to the published bench end points and writes models/nominal.yaml.

The published modulus and section make a keel that is too stiff over its range by itself; the fulcrum and the
foam in series with the load account for the rest (see `vsf_drake.analysis.calibration`).
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from vsf_drake.analysis.bench_metrics import bench_table
from vsf_drake.analysis.calibration import calibrate_device, with_compliances
from vsf_drake.files import replaced
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.schema import dump_yaml
from vsf_drake.simulation.bench import run_bench

SMALL_LOAD = (236e3, 54.8e3)
"""First guess (N/m) of fulcrum and series stiffness: the pair with which the closed form, for small loads on a uniform
beam of the published section, has the published end points."""
HEADER = """\
# Nominal model. Written by studies/calibrate_device.py; do not edit by hand.
# Fulcrum and series stiffness: calibrated (4 digits) so that the simulated bench (mean slope above 200 N, 600 N,
# 50 mm/min) gives the published 10.0 N/mm at 66 mm and 32.0 N/mm at 151 mm (Glanzer & Adamczyk 2018, PMC6289620;
# McGeehan et al. 2021, doi 10.1115/1.4050456). Everything else: see vsf_drake/parameters.py for unit and source.
"""


def four_digits(value: float) -> float:
    """`value` rounded to four significant digits."""
    return float(f"{value:.4g}")


def main() -> None:
    """Calibrates, writes the model, prints the bench that it gives."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parents[1] / "models")
    parser.add_argument("--quick", action="store_true", help="the same; it takes a few seconds")
    arguments = parser.parse_args()
    guess = with_compliances(FootParameters(), fulcrum_stiffness=SMALL_LOAD[0], series_stiffness=SMALL_LOAD[1])
    calibration = calibrate_device(guess)
    if not calibration.success:
        raise SystemExit(f"{calibration.solver} did not converge")
    foot = with_compliances(
        FootParameters(), fulcrum_stiffness=four_digits(calibration.fulcrum_stiffness),
        series_stiffness=four_digits(calibration.series_stiffness))
    model = replace(ModelParameters(), foot=foot)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with replaced(arguments.out / "nominal.yaml") as stream:
        stream.write(HEADER + dump_yaml(model))
    print(f"fulcrum {foot.fulcrum.stiffness_n_per_m:g} N/m, series {foot.series_stiffness_n_per_m:g} N/m")
    for row in bench_table(run_bench(model))["settings"]:
        kind = "prediction" if row["prediction"] else "calibrated"
        print(f"{row['fulcrum_mm']:5.0f} mm  {row['stiffness_n_per_mm']:6.2f} N/mm  {kind}")


if __name__ == "__main__":
    main()
