"""Presses the foot on the bench, at each fulcrum position and at the heel; the keel's shape under
its load."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError, require
from vsf_drake.base.schema import to_plain
from vsf_drake.laws.beam import combined_stiffness
from vsf_drake.laws.keel import chain, piece_at
from vsf_drake.model.model_file import (
    bending_stiffness,
    check_fulcrum,
    check_model,
    secant_stiffness,
)
from vsf_drake.model.parameters import FootParameters, ModelParameters
from vsf_drake.model.setting import moves, setting_of
from vsf_drake.plants.bench import BenchDiagram, make_bench
from vsf_drake.plants.foot import keel_joint_positions, keel_joint_stiffness
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.mechanism import bench_mechanism
from vsf_drake.simulation.options import BenchOptions
from vsf_drake.simulation.results import BenchResult, BenchSetting
from vsf_drake.simulation.stepping.runs import Inputs, Record
from vsf_drake.simulation.stepping.stepper import Stepper

PUBLISHED_FULCRUMS_M = tuple(x / 1e3 for x in BenchOptions.fulcrum_mm)
PUBLISHED_SPEED_M_PER_S = 1e-3 * BenchOptions.speed_mm_per_min / 60.0
LARGEST_HEEL_DEPTH_M = 0.1
STEPS_PER_MM = 40.0  # resolution of the platen's path


def advance_to_load(
    stepper: Stepper,
    inputs: Inputs,
    q0: np.ndarray,
    load_n: float,
    travel_m: np.ndarray,
    *,
    foot: str,
    setting: str,
) -> tuple[Record, int]:
    """The run from rest at q0 until the sites bear `load_n`, and after how many steps they do.

    SimulationError if they never do, with the `travel_m` (n + 1,) until then, of which part of the
    foot and with which setting.
    """

    def reached(done: int, record: Record) -> bool:
        return bool(record.wrench[done - 1, 0, 5] >= load_n)

    record = stepper.run(inputs, q0, np.zeros_like(q0), stop=reached)
    load = record.wrench[:, 0, 5]
    above = np.flatnonzero(load >= load_n)
    end = len(load)
    if not above.size:
        raise SimulationError(
            f"the {foot} gave way: {load.max():.0f} N of {load_n:g} N after "
            f"{1e3 * travel_m[end]:.0f} mm ({setting})",
            time_s=float(inputs.time_s[end]),
        )
    return record, int(above[0]) + 1


def check_pass(*, max_load_n: float, speed_m_per_s: float) -> None:
    """InputError unless a foot can be pressed to this load by a platen of this speed."""
    require(
        200.0 < max_load_n <= 5000.0,
        f"{max_load_n:g} N is no useful load",
        "max_load_n",
        "Stiffness is the slope above 200 N: choose between 200 and 5000 N",
    )
    require(
        0.0 < speed_m_per_s <= 1.0,
        f"{speed_m_per_s:g} m/s is not a platen speed",
        "speed_m_per_s",
        "It must be above 0 and at most 1 m/s",
    )


class Bench:
    """One bench, built once and pressed often: forefoot, or with `heel` the heel."""

    def __init__(self, parameters: FootParameters, *, heel: bool = False) -> None:
        self.bench: BenchDiagram = make_bench(parameters, heel=heel)
        self.context = self.bench.diagram.CreateDefaultContext()
        self.parameters = parameters
        self.heel = heel

    def warm_up(self) -> float:
        """Compiles what is not compiled yet; returns the seconds that took."""
        return Stepper(bench_mechanism(self.bench, self.context)).warm_up()

    def press(self, *, fulcrum_m: float, max_load_n: float, speed_m_per_s: float) -> BenchSetting:
        """Raises the platen at constant speed until the load is reached.

        InputError if a value is out of range; SimulationError if the foot gives way before, or the
        run diverges.
        """
        check_fulcrum(fulcrum_m, self.parameters)
        check_pass(max_load_n=max_load_n, speed_m_per_s=speed_m_per_s)
        travel = self._travel_bound(fulcrum_m, max_load_n)
        steps = int(np.ceil(travel * 1e3 * STEPS_PER_MM))
        moments = np.linspace(0.0, travel / speed_m_per_s, steps + 1)
        return self.follow(
            fulcrum_m=fulcrum_m,
            time_s=moments,
            platen_m=speed_m_per_s * moments,
            stop_at_n=max_load_n,
        )

    def follow(
        self,
        *,
        fulcrum_m: float,
        time_s: np.ndarray,
        platen_m: np.ndarray,
        stop_at_n: float | None = None,
    ) -> BenchSetting:
        """Moves the platen along the path `platen_m` (m, from first touch, up) at `time_s` (s),
        both (n + 1,).

        It ends at the first load (N) beyond `stop_at_n`; then not reaching it is a failure. Raises
        what `press` does.
        """
        stepper = Stepper(bench_mechanism(self.bench, self.context))
        tree = stepper.mechanism.tree
        carriage = tree.index(self.bench.foot.carriage_joint_name)
        q0 = np.zeros(tree.num_coordinates)
        q0[carriage] = fulcrum_m
        inputs = Inputs(
            time_s=time_s,
            prescribed=np.array([carriage]),
            prescribed_q=np.full((len(time_s), 1), fulcrum_m),
            fulcrum=np.full(len(time_s), fulcrum_m),
            ground=self.bench.contact_height + np.asarray(platen_m),
        )
        if stop_at_n is None:
            record = stepper.run(inputs, q0, np.zeros_like(q0))
            end = len(record.time_s)
        else:
            record, end = advance_to_load(
                stepper,
                inputs,
                q0,
                stop_at_n,
                platen_m,
                foot="heel" if self.heel else "forefoot",
                setting=setting_of(self.parameters, fulcrum_m).setting_words,
            )
        return BenchSetting(
            fulcrum_m=None if self.heel else fulcrum_m,
            time_s=record.time_s[:end],
            platen_m=np.asarray(platen_m, dtype=float)[1 : end + 1],
            load_n=record.wrench[:end, 0, 5],
            **record.counts(end),
        )

    def _travel_bound(self, fulcrum_m: float, max_load_n: float) -> float:
        """Twice what the contact law or the small-load stiffness needs: large deflections only
        stiffen the keel."""
        if self.heel:
            return 2.0 * self._heel_depth(max_load_n)
        p = self.parameters
        stiffness = combined_stiffness(
            bending_stiffness=bending_stiffness(p.keel).min(),
            support=fulcrum_m,
            load_point=p.load_point_m,
            fulcrum_stiffness=p.fulcrum.stiffness_n_per_m,
            series_stiffness=secant_stiffness(
                p.series_stiffness_n_per_m, p.series_exponent, max_load_n
            ),
        )
        return float(2.0 * max_load_n / stiffness + 0.005)

    def _heel_depth(self, load_n: float) -> float:
        """Depth (m), in steps of a tenth, at which the heel's spheres together bear `load_n`."""
        machine = self.bench.machine
        context = machine.GetMyContextFromRoot(self.context)
        stiffness, exponent, p_BS = (
            machine.GetParameter(context, name) for name in ("stiffness", "exponent", "p_BS")
        )
        height = p_BS[:, 2]
        depth = 1e-4
        while (
            np.sum(stiffness * np.maximum(depth - (height - height.min()), 0.0) ** exponent)
            < load_n
        ):
            depth *= 1.1
            if depth > LARGEST_HEEL_DEPTH_M:
                raise InputError(
                    f"the heel bears less than {load_n:g} N at {1e3 * LARGEST_HEEL_DEPTH_M:g} mm",
                    where="foot.zones",
                    right="Raise the stiffness of the zones on the heel block",
                )
        return depth


def run_bench(
    model: ModelParameters,
    *,
    fulcrums_m: Sequence[float] | None = None,
    heel: bool = BenchOptions.heel,
    max_load_n: float = BenchOptions.max_load_n,
    speed_m_per_s: float = PUBLISHED_SPEED_M_PER_S,
    progress: Callable[[float], None] | None = None,
    inputs: dict[str, str] | None = None,
) -> BenchResult:
    """The bench test of the paper: every fulcrum position (m), then the heel; raises what
    `Bench.press` does. Of None it is the paper's five positions, of a passive foot its own.

    `progress` is called with the finished fraction; `inputs` are the SHA-256 of the model's files
    by name.
    """
    check_model(model)
    if fulcrums_m is None:
        own = (model.foot.fulcrum.rearmost_m,)
        fulcrums_m = PUBLISHED_FULCRUMS_M if moves(model.foot) else own
    passes = []
    if fulcrums_m:
        forefoot = Bench(model.foot)
        passes = [(forefoot, position) for position in fulcrums_m]
    if heel:
        passes.append((Bench(model.foot, heel=True), model.foot.fulcrum.rearmost_m))
    compile_s = passes[0][0].warm_up() if passes else 0.0
    settings = []
    started = time.perf_counter()
    for i, (bench, position) in enumerate(passes):
        settings.append(
            bench.press(fulcrum_m=position, max_load_n=max_load_n, speed_m_per_s=speed_m_per_s)
        )
        if progress:
            progress((i + 1) / len(passes))
    return BenchResult(
        settings=tuple(settings),
        wall_s=time.perf_counter() - started,
        compile_s=compile_s,
        simulated_s=float(sum(setting.time_s[-1] for setting in settings)),
        speed_m_per_s=speed_m_per_s,
        max_load_n=max_load_n,
        parameters=to_plain(model),
        provenance=provenance(inputs),
    )


# The keel's shape at rest under a load on its load point: joint angles, quickly enough to follow a
# slider.
#
# The keel is the planar chain of `plants.foot`: joint i at s_i from A, piece i from there to the
# next joint, inclined by phi_i = q_0 + ... + q_i. The material point at x from A is at the height
#
#     z(x) = sum_i l_i sin phi_i,   l_i = how much of piece i lies behind x,
#
# in the keel frame K. A load F along n on the load point C and the fulcrum's spring at l leave the
# potential energy
#
#     E(q) = 1/2 q' k q + 1/2 k_f z(l)^2 - F u(C),   u = n . p_AC,   n = (-sin g, cos g),
#
# with g the tilt of the platen that presses, 0 for a load along z_K.
#
# whose minimum is the shape. Its Hessian is exact, so Newton's method takes a handful of
# iterations; the load is put on in steps that are halved where it fails. Large deflections are
# included; damping, inertia and weight are not. By a parameter p of the energy the angles change as
# the balance has it, E'' dq/dp = -d/dp E'.


FIRST_STEP_N = 100.0  # load that is put on at once (a choice)
LEAST_STEP = 2.0**-12  # of the whole load; a step that has been halved to less has failed
ITERATIONS = 25
# moment left in any joint, over the load's about A (plus a millionth of a newton metre)
BALANCED = 1e-10


@dataclass(frozen=True)
class KeelShape:
    """The keel at rest."""

    angles: np.ndarray
    """(m,) rad, of the pin at A and the sprung joints, as in `FootHandles.keel_joint_names`;
    positive lifts the toe."""
    load_n: float  # under which it rests
    load_point_K: np.ndarray  # (2,) m, x and z of the load point C in K
    travel_m: float  # of C along the load, from the straight keel
    support_force_n: float
    """on the keel along z_K, as of `FootForces`: negative while the toe is pressed up"""
    rise_by: np.ndarray
    """(2,) derivatives of C's travel along the load by the keel's flexural modulus (m/Pa) and the
    fulcrum's stiffness (m^2/N).
    """
    travel_by_joints: np.ndarray
    """(m - 1,) derivatives of that travel by the stiffness (N m/rad) of each sprung joint"""
    travel_by_place: float  # its derivative by the fulcrum's place (m/m)


def keel_shape(
    foot: FootParameters,
    *,
    fulcrum_m: float,
    load_n: float,
    tilt_rad: float = 0.0,
    after: KeelShape | None = None,
) -> KeelShape:
    """The keel of `foot` under `load_n` (N, on the load point) with the fulcrum at `fulcrum_m` (m
    from A).

    The load is along z_K, or tilted back from it by `tilt_rad`, as that of a platen whose front is
    turned up by so much. It is put on from none, or from `after`, of the same foot, on.

    InputError if the fulcrum is out of the carriage's reach; SimulationError if no rest was found.
    """
    check_fulcrum(fulcrum_m, foot, where="fulcrum_m")
    if not np.isfinite(load_n):
        raise InputError(
            f"{load_n} is no load", where="load_n", right="Give a finite number of newtons"
        )
    stiffness: np.ndarray = np.diag(np.concatenate(([0.0], keel_joint_stiffness(foot.keel))))
    starts = np.concatenate(([0.0], keel_joint_positions(foot.keel)))
    points = fulcrum_m, foot.load_point_m
    support = foot.fulcrum.stiffness_n_per_m
    along = -math.sin(tilt_rad), math.cos(tilt_rad)
    q = np.zeros(len(starts)) if after is None else after.angles
    before = 0.0 if after is None else after.load_n
    hessian = stiffness
    share = 0.0
    step = min(1.0, FIRST_STEP_N / max(abs(load_n - before), 1e-300))
    while share < 1.0:
        tried = min(share + step, 1.0)
        load = before + tried * (load_n - before)
        moved, hessian = _balance(q, load, along, stiffness, support, starts, points)
        if moved is None:
            step *= 0.5
            if step < LEAST_STEP:
                raise SimulationError(
                    f"the keel finds no rest under {load_n:g} N with the fulcrum at "
                    f"{1e3 * fulcrum_m:g} mm",
                    time_s=0.0,
                )
        else:
            q = moved
            share = tried
    c, s, _, _ = chain(starts, q)
    _, z_P, by_P, _ = _material_point(starts, q, fulcrum_m)
    p_C, _, by_C, _ = _material_point(starts, q, foot.load_point_m, along)
    moments = np.column_stack([stiffness @ q / foot.keel.flexural_modulus_pa, z_P * by_P])
    answer = np.linalg.solve(hessian, by_C)
    piece = piece_at(starts, fulcrum_m)
    turned = np.where(np.arange(len(starts)) <= piece, c[piece], 0.0)
    return KeelShape(
        angles=q,
        load_n=load_n,
        load_point_K=p_C,
        travel_m=float(along[0] * (p_C[0] - foot.load_point_m) + along[1] * p_C[1]),
        support_force_n=-support * z_P,
        rise_by=-by_C @ np.linalg.solve(hessian, moments),
        travel_by_joints=-answer[1:] * q[1:],
        travel_by_place=float(-support * answer @ (s[piece] * by_P + z_P * turned)),
    )


def _balance(
    q: np.ndarray,
    load: float,
    along: tuple[float, float],
    stiffness: np.ndarray,
    support: float,
    starts: np.ndarray,
    points: tuple[float, float],
) -> tuple[np.ndarray | None, np.ndarray]:
    """The stable equilibrium that Newton's method reaches from `q`, None where it reaches none; and
    the Hessian. `points` (m from A) are where support and load are, the latter `along` x and z."""
    supported, loaded = points
    enough = BALANCED * (abs(load) * loaded + 1e-6)
    for _ in range(ITERATIONS):
        _, z_P, by_P, twice_P = _material_point(starts, q, supported)
        _, _, by_C, twice_C = _material_point(starts, q, loaded, along)
        moment = stiffness @ q + support * z_P * by_P - load * by_C
        hessian = stiffness + support * (np.outer(by_P, by_P) + z_P * twice_P) - load * twice_C
        try:
            np.linalg.cholesky(hessian)
        except np.linalg.LinAlgError:
            return None, hessian
        if np.abs(moment).max() <= enough:
            return q, hessian
        q = q - np.linalg.solve(hessian, moment)
        if not np.abs(q).max() < np.pi:
            return None, hessian
    return None, hessian


def _material_point(
    starts: np.ndarray,
    turns: np.ndarray,
    position: float,
    direction: tuple[float, float] = (0.0, 1.0),
) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
    """x and z of a point of the keel, z alone, and the gradient (m,) and Hessian (m, m) of its
    place along a direction (x, z), by the joint angles."""
    c, s, x, z = chain(starts, turns)
    piece = piece_at(starts, position)
    along = position - starts[piece]
    x_P = x[piece] + along * c[piece]
    z_P = z[piece] + along * s[piece]
    joints = np.arange(len(starts))
    outer = np.maximum.outer(joints, joints)
    turn = direction[1] * (x_P - x) - direction[0] * (z_P - z)
    return (
        np.array([x_P, z_P]),
        z_P,
        np.where(joints <= piece, turn, 0.0),
        np.where(
            outer <= piece, direction[1] * (z[outer] - z_P) + direction[0] * (x[outer] - x_P), 0.0
        ),
    )
