"""Presses the foot on the bench, at each fulcrum position and at the heel, by the implicit stepper."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from vsf_drake.errors import InputError, SimulationError
from vsf_drake.laws.beam import combined_stiffness, section_inertia
from vsf_drake.model_file import check_fulcrum, check_model, secant_stiffness
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.plants.bench import BenchDiagram, make_bench
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.mechanism import bench_mechanism
from vsf_drake.simulation.results import BenchResult, BenchSetting
from vsf_drake.simulation.stepping.stepper import Inputs, Record, Stepper

PUBLISHED_FULCRUMS_M = (0.066, 0.087, 0.108, 0.129, 0.151)
"""The five settings of McGeehan et al. (2021)."""
PUBLISHED_SPEED_M_PER_S = 0.050 / 60.0
"""50 mm/min, the same."""
LARGEST_HEEL_DEPTH_M = 0.1
STEPS_PER_MM = 40.0
"""Resolution of the platen's path."""


class Bench:
    """One bench, built once and pressed often: forefoot, or heel.

    Args:
        parameters: the foot.
        heel: press the heel instead of the forefoot.
    """

    def __init__(self, parameters: FootParameters, *, heel: bool = False) -> None:
        self.bench: BenchDiagram = make_bench(parameters, heel=heel)
        self.context = self.bench.diagram.CreateDefaultContext()
        self.parameters, self.heel = parameters, heel

    def warm_up(self) -> float:
        """Compiles what is not compiled yet; returns the seconds that took."""
        return Stepper(bench_mechanism(self.bench, self.context)).warm_up()

    def press(self, *, fulcrum_m: float, max_load_n: float, speed_m_per_s: float) -> BenchSetting:
        """Raises the platen at constant speed until the load is reached.

        Raises:
            InputError: a value is out of range.
            SimulationError: the foot gives way before the load is reached, or the run diverges.
        """
        check_fulcrum(fulcrum_m, self.parameters)
        if not 200.0 < max_load_n <= 5000.0:
            raise InputError(f"{max_load_n:g} N is no useful load", where="max_load_n",
                             right="Stiffness is the slope above 200 N: choose between 200 and 5000 N")
        if not 0.0 < speed_m_per_s <= 1.0:
            raise InputError(f"{speed_m_per_s:g} m/s is not a platen speed", where="speed_m_per_s",
                             right="It must be above 0 and at most 1 m/s")
        travel = self._travel_bound(fulcrum_m, max_load_n)
        steps = int(np.ceil(travel * 1e3 * STEPS_PER_MM))
        moments = np.linspace(0.0, travel / speed_m_per_s, steps + 1)
        return self.follow(fulcrum_m=fulcrum_m, time_s=moments, platen_m=speed_m_per_s * moments, stop_at_n=max_load_n)

    def follow(
        self, *, fulcrum_m: float, time_s: np.ndarray, platen_m: np.ndarray, stop_at_n: float | None = None
    ) -> BenchSetting:
        """Moves the platen along the path `platen_m` (m, from first touch, up) at `time_s` (s), both (n + 1,).

        Args:
            stop_at_n: ends at the first load (N) beyond this; then not reaching it is a failure.

        Raises:
            SimulationError: see `press`.
        """
        stepper = Stepper(bench_mechanism(self.bench, self.context))
        tree = stepper.mechanism.tree
        carriage = tree.index(self.bench.foot.carriage_joint_name)
        q0 = np.zeros(tree.num_coordinates)
        q0[carriage] = fulcrum_m
        inputs = Inputs(
            time_s=time_s, prescribed=np.array([carriage]), prescribed_q=np.full((len(time_s), 1), fulcrum_m),
            fulcrum=np.full(len(time_s), fulcrum_m), ground=self.bench.contact_height + np.asarray(platen_m))

        def reached(done: int, record: Record) -> bool:
            return stop_at_n is not None and record.site("normal_force")[done - 1].sum() >= stop_at_n

        record = stepper.run(inputs, q0, np.zeros_like(q0), stop=reached)
        load = record.site("normal_force").sum(axis=1)
        end = len(load)
        if stop_at_n is not None:
            above = np.flatnonzero(load >= stop_at_n)
            if not above.size:
                raise SimulationError(
                    f"the {'heel' if self.heel else 'forefoot'} gave way: {load.max():.0f} N of {stop_at_n:g} N after "
                    f"{1e3 * platen_m[end]:.0f} mm with the fulcrum at {1e3 * fulcrum_m:g} mm",
                    time_s=float(time_s[end]))
            end = int(above[0]) + 1
        return BenchSetting(
            fulcrum_m=None if self.heel else fulcrum_m, time_s=record.time_s[:end],
            platen_m=np.asarray(platen_m, dtype=float)[1 : end + 1], load_n=load[:end],
            unconverged_steps=int(np.sum(~record.converged[:end])), refined_steps=int(np.sum(record.parts[:end] > 1)))

    def _travel_bound(self, fulcrum_m: float, max_load_n: float) -> float:
        """Twice what the contact law or the small-load stiffness needs: large deflections only stiffen the keel."""
        if self.heel:
            return 2.0 * self._heel_depth(max_load_n)
        p = self.parameters
        bending = p.keel.flexural_modulus_pa * section_inertia(p.keel.width_m, p.keel.thickness_m)
        stiffness = combined_stiffness(
            bending_stiffness=bending, support=fulcrum_m, load_point=p.load_point_m,
            fulcrum_stiffness=p.fulcrum.stiffness_n_per_m,
            series_stiffness=secant_stiffness(p.series_stiffness_n_per_m, p.series_exponent, max_load_n))
        return 2.0 * max_load_n / stiffness + 0.005

    def _heel_depth(self, load_n: float) -> float:
        """Depth (m), in steps of a tenth, at which the heel's spheres together bear `load_n`."""
        machine = self.bench.machine
        own = machine.GetMyContextFromRoot(self.context)
        stiffness, exponent = (machine.GetParameter(own, name) for name in ("stiffness", "exponent"))
        height = machine.GetParameter(own, "p_BS")[:, 2]
        depth = 1e-4
        while np.sum(stiffness * np.maximum(depth - (height - height.min()), 0.0) ** exponent) < load_n:
            depth *= 1.1
            if depth > LARGEST_HEEL_DEPTH_M:
                raise InputError(f"the heel bears less than {load_n:g} N at {1e3 * LARGEST_HEEL_DEPTH_M:g} mm",
                                 where="foot.zones", right="Raise the stiffness of the zones on the heel block")
        return depth


def run_bench(
    model: ModelParameters,
    *,
    fulcrums_m: Sequence[float] = PUBLISHED_FULCRUMS_M,
    heel: bool = True,
    max_load_n: float = 600.0,
    speed_m_per_s: float = PUBLISHED_SPEED_M_PER_S,
    progress: Callable[[float], None] | None = None,
    inputs: dict[str, str] | None = None,
) -> BenchResult:
    """The bench test of the paper: every fulcrum position (m), then the heel.

    Args:
        progress: called with the finished fraction.
        inputs: SHA-256 by name of the files that the model was made of, for the result's provenance.

    Raises:
        InputError, SimulationError: see `Bench.press`.
    """
    check_model(model)
    passes = [(Bench(model.foot), position) for position in fulcrums_m[:1]]
    forefoot = passes[0][0] if passes else None
    passes += [(forefoot, position) for position in fulcrums_m[1:]]
    if heel:
        passes.append((Bench(model.foot, heel=True), model.foot.fulcrum.rearmost_m))
    compile_s = passes[0][0].warm_up() if passes else 0.0
    settings, started = [], time.perf_counter()
    for i, (bench, position) in enumerate(passes):
        settings.append(bench.press(fulcrum_m=position, max_load_n=max_load_n, speed_m_per_s=speed_m_per_s))
        if progress:
            progress((i + 1) / len(passes))
    return BenchResult(
        settings=tuple(settings), wall_s=time.perf_counter() - started, compile_s=compile_s,
        simulated_s=float(sum(setting.time_s[-1] for setting in settings)), speed_m_per_s=speed_m_per_s,
        max_load_n=max_load_n, parameters=to_plain(model), provenance=provenance(inputs))
