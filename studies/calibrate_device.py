"""Calibrates the foot's two unknown compliances to the published bench end points and writes models/nominal.yaml.

The published modulus and section make a keel that is too stiff over its range by itself; the fulcrum and the
foam in series with the load account for the rest:

    minimise    sum over settings of ((k_bench(x) - k_measured) / (1 % of k_measured))^2
    over        x = logarithms of fulcrum and series stiffness relative to the first guess, bounded
    where       k_bench is the mean slope above 200 N of the simulated, large-deflection bench

Modulus and section stay as published. A static bench cannot tell more: a compliant anchor or a
tapered keel would need other data. With two settings the residual vanishes; with more it is a fit.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.solvers import MathematicalProgram, SnoptSolver, SolverOptions

from vsf_drake.analysis.bench_metrics import PUBLISHED_STIFFNESS_N_PER_M, bench_table, displacement, stiffness
from vsf_drake.errors import InputError
from vsf_drake.files import replaced
from vsf_drake.model_file import spheres_under_load
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.schema import dump_yaml
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench, run_bench

SMALL_LOAD = (236e3, 54.8e3)
"""First guess (N/m) of fulcrum and series stiffness: the pair with which the closed form, for small loads on a uniform
beam of the published section, has the published end points."""
HEADER = """\
# Nominal model. Written by studies/calibrate_device.py; do not edit by hand.
# Fulcrum and series stiffness: calibrated (4 digits) so that the simulated bench (mean slope above 200 N, 600 N,
# 50 mm/min) gives the published 10.0 N/mm at 66 mm and 32.0 N/mm at 151 mm (Glanzer & Adamczyk 2018, PMC6289620;
# McGeehan et al. 2021, doi 10.1115/1.4050456). Everything else: see vsf_drake/parameters.py for unit and source.
"""
LARGEST_RATIO = 4.0
"""Bound on calibrated / first guess, both ways."""
RELATIVE_ERROR = 0.01
"""Weight of a residual: share of the measured stiffness."""
DIFFERENCE = 1e-3
"""Step of the gradient's finite differences, in the logarithms."""
TOLERANCE = 1e-6
"""SNOPT's major optimality tolerance."""


@dataclass(frozen=True)
class DeviceCalibration:
    """What the calibration found.

    Attributes:
        foot: the parameters with the calibrated compliances.
        fulcrum_stiffness, series_stiffness: N/m.
        measured, simulated: stiffness (N/m) by fulcrum position (m).
        evaluations: bench passes run. success: the solver's verdict; solver: its name.
    """

    foot: FootParameters
    fulcrum_stiffness: float
    series_stiffness: float
    measured: dict[float, float]
    simulated: dict[float, float]
    evaluations: int
    success: bool
    solver: str


def with_compliances(foot: FootParameters, *, fulcrum_stiffness: float, series_stiffness: float) -> FootParameters:
    """`foot` with these stiffnesses (N/m), the keel's contact spheres in agreement with the latter.

    The foam that the bench finds in series with the keel is the foam that carries the walker: the
    linear zones with a sphere in the patch of `series_patch_m` about the load point, and those of the same
    stiffness, get the stiffness with which the spheres in that patch together have `series_stiffness`.

    Raises:
        InputError: no sphere lies in the patch, or one there has an exponent other than 1.
    """
    loaded = [zone for zone, _ in spheres_under_load(foot)]
    if not loaded or any(zone.exponent != 1.0 for zone in loaded):
        raise InputError("the bench's foam patch must hold contact spheres with exponent 1",
                         where="foot.series_patch_m", right="Widen the patch or fit the contact of this foot directly")
    each = series_stiffness / len(loaded)
    foam = {zone.name for zone in foot.zones if zone.stiffness in {other.stiffness for other in loaded}}
    zones = tuple(
        dataclasses.replace(zone, stiffness=each, damping_n_s_per_m=zone.damping_n_s_per_m / zone.stiffness * each)
        if zone.name in foam else zone for zone in foot.zones)
    fulcrum = dataclasses.replace(foot.fulcrum, stiffness_n_per_m=fulcrum_stiffness)
    return dataclasses.replace(foot, fulcrum=fulcrum, series_stiffness_n_per_m=series_stiffness, series_exponent=1.0,
                               zones=zones)


def calibrate_device(
    foot: FootParameters,
    *,
    measured: Mapping[float, float] = PUBLISHED_STIFFNESS_N_PER_M,
    max_load_n: float = 600.0,
    progress: Callable[[int, float], None] | None = None,
) -> DeviceCalibration:
    """Finds the compliances of fulcrum and series foam with which the bench measures `measured`.

    Args:
        foot: everything else, and the first guess.
        measured: stiffness (N/m) by fulcrum position (m), at least two settings.
        progress: called with the number of evaluations and the current cost.

    Raises:
        InputError: fewer than two settings.
        SimulationError: see `Bench.press`.
    """
    if len(measured) < 2:
        raise InputError("two compliances need the stiffness at two or more fulcrum positions", where="measured")
    positions, targets = np.array(list(measured)), np.array(list(measured.values()))
    guess = np.array([foot.fulcrum.stiffness_n_per_m, foot.series_stiffness_n_per_m])
    count = 0

    def at(x: np.ndarray) -> FootParameters:
        fulcrum, series = map(float, guess * np.exp(x))
        return with_compliances(foot, fulcrum_stiffness=fulcrum, series_stiffness=series)

    def simulate(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        bench = Bench(at(x))
        passes = [bench.press(fulcrum_m=p, max_load_n=max_load_n, speed_m_per_s=PUBLISHED_SPEED_M_PER_S)
                  for p in positions]
        return np.array([stiffness(displacement(run), run.load_n) for run in passes])

    def residual(x: np.ndarray) -> np.ndarray:
        r: np.ndarray = (simulate(x) - targets) / (RELATIVE_ERROR * targets)
        if progress:
            progress(count, float(r @ r))
        return r

    def cost(x: np.ndarray) -> Any:
        if x.dtype != object:
            r = residual(x)
            return float(r @ r)
        values = ExtractValue(x).ravel()
        r = residual(values)
        J = np.column_stack([(residual(values + DIFFERENCE * e) - r) / DIFFERENCE for e in np.eye(2)])
        gradient = (2.0 * r @ J) @ ExtractGradient(x)
        return AutoDiffXd(float(r @ r), gradient)

    prog = MathematicalProgram()
    x = prog.NewContinuousVariables(2, "stiffness")
    prog.AddBoundingBoxConstraint(-np.log(LARGEST_RATIO), np.log(LARGEST_RATIO), x)
    prog.AddCost(cost, vars=x)
    options = SolverOptions()
    options.SetOption(SnoptSolver.id(), "Major optimality tolerance", TOLERANCE)
    options.SetOption(SnoptSolver.id(), "Major step limit", 0.3)
    solution = SnoptSolver().Solve(prog, np.zeros(2), options)
    best = np.asarray(solution.GetSolution(x), dtype=float)
    simulated, fitted = simulate(best), at(best)
    return DeviceCalibration(
        foot=fitted, fulcrum_stiffness=fitted.fulcrum.stiffness_n_per_m,
        series_stiffness=fitted.series_stiffness_n_per_m, measured=dict(measured),
        simulated=dict(zip(map(float, positions), map(float, simulated), strict=True)), evaluations=count,
        success=bool(solution.is_success()), solver=solution.get_solver_id().name())


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
    model = dataclasses.replace(ModelParameters(), foot=foot)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with replaced(arguments.out / "nominal.yaml") as stream:
        stream.write(HEADER + dump_yaml(model))
    print(f"fulcrum {foot.fulcrum.stiffness_n_per_m:g} N/m, series {foot.series_stiffness_n_per_m:g} N/m")
    for row in bench_table(run_bench(model)).settings:
        kind = "prediction" if row.published_n_per_mm is None else "calibrated"
        print(f"{row.fulcrum_mm:5.0f} mm  {row.stiffness_n_per_mm:6.2f} N/mm  {kind}")


if __name__ == "__main__":
    main()
