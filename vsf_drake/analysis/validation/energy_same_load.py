"""A trial walked with the fulcrum elsewhere and the load on the foot kept: the pelvis rises and sinks as that takes.

The recorded motion prescribes where the limb goes, so that a stiffer foot under the same motion is pressed as far and
bears more. A person carries the same weight on either. Here the motion is changed by a course of the pelvis' height
until the vertical force on the prosthetic foot is that of the walk at the trial's own position; everything else of
the motion stays. The course is found by Newton's method instant by instant, with how the force depends on the height.

And the energy ledger of the prosthesis over any walk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from vsf_drake.analysis.comparison import cumulative_integral
from vsf_drake.analysis.validation.segment_power import SegmentMotion, distal_power, follow
from vsf_drake.laws.bushing import axis_force
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.filters import low_pass
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.courses import Course
from vsf_drake.simulation.reactions import (
    central,
    contact_terms,
    spring_loss,
    spring_strain,
    sum_sites,
    work,
)
from vsf_drake.simulation.stepping.assembly import SPRING_COLUMNS
from vsf_drake.simulation.walk import Walk, Walker

HEIGHT = "pelvis_ty"
MOST_WALKS = 8
CLOSE_ENOUGH = 0.002
"""Of body weight: root mean square over stance of what the forces differ by, at which the search ends."""
USABLE = 0.01
"""The same, beyond which the load does not count as kept."""
FORCE_CUTOFF_HZ, HEIGHT_CUTOFF_HZ = 20.0, 12.0
"""Of the forces that are compared and of the change of height (choices)."""
LEAST_N_PER_M = 8e3
"""Least stiffness in a Newton step, where the foot hardly bears (a choice)."""


@dataclass(frozen=True, eq=False)
class SameLoad:
    """A walk with the load of another.

    Attributes:
        walk: with the changed height, in the finer step.
        off_bw: root mean square over stance of what the low-passed vertical forces differ by, over body weight.
        height_mm: largest change of the pelvis' height.
    """

    walk: Walk
    off_bw: float
    height_mm: float

    @property
    def kept(self) -> bool:
        """Whether the load is that of the other walk."""
        return self.off_bw <= USABLE


def walk_with_same_load(
    walker: Walker, trial: Trial, *, fulcrum_m: float, search_step_s: float, step_s: float
) -> SameLoad:
    """Walks `trial` with the fulcrum at `fulcrum_m` (m from A) under the load that it has with its own.

    Args:
        search_step_s: of the walks that look for the height. step_s: of the one that is returned.

    Raises:
        InputError, SimulationError: see `Walker.walk`.
    """
    weight = walker.subject.mass_kg * float(np.linalg.norm(walker.gait.plant.gravity_field().gravity_vector()))
    own = _walk(walker, trial, trial.fulcrum_m, search_step_s)
    time, wanted = own.record.time_s, _vertical(own)
    stances = find_stances(time, own.prosthetic.grf_W[:, 2])
    grid = np.concatenate([[trial.start_s], time])
    height = np.zeros(len(grid))
    for _ in range(MOST_WALKS):
        walk = _walk(walker, trial, fulcrum_m, search_step_s, course=_course(grid, height), differentiated=True)
        too_much = _vertical(walk) - wanted
        if _rms(too_much, time, stances) <= CLOSE_ENOUGH * weight:
            break
        assert walk.sensitivity is not None
        falling = _smooth(-walk.sensitivity.grf_W[:, 2, 0], search_step_s, HEIGHT_CUTOFF_HZ)
        raised = _smooth(too_much / np.maximum(falling, LEAST_N_PER_M), search_step_s, HEIGHT_CUTOFF_HZ)
        height = height + np.concatenate([[0.0], raised])
    final = _walk(walker, trial, fulcrum_m, step_s, course=_course(grid, height))
    off = np.interp(time, final.record.time_s, _vertical(final)) - wanted
    return SameLoad(walk=final, off_bw=_rms(off, time, stances) / weight, height_mm=float(1e3 * np.abs(height).max()))


def _course(grid: np.ndarray, height: np.ndarray) -> Course:
    return Course(name="height", coordinate=HEIGHT, shape=make_interp_spline(grid, height, k=3))


def _walk(walker: Walker, trial: Trial, fulcrum_m: float, step_s: float, *, course: Course | None = None,
          differentiated: bool = False) -> Walk:
    return walker.walk(
        trial.trajectory, fulcrum_m=fulcrum_m, start_s=trial.start_s, end_s=trial.end_s, step_s=step_s,
        offsets=trial.offsets, courses=[] if course is None else [course],
        values={} if course is None else {f"course.{course.name}": 1.0},
        with_respect_to=(f"coordinate.{HEIGHT}",) if differentiated else ())


def _vertical(walk: Walk) -> np.ndarray:
    return _smooth(walk.prosthetic.grf_W[:, 2], walk.step_s, FORCE_CUTOFF_HZ)


def _smooth(values: np.ndarray, step_s: float, cutoff_hz: float) -> np.ndarray:
    return low_pass(values, rate_hz=1.0 / step_s, cutoff_hz=cutoff_hz)


def _rms(values: np.ndarray, time: np.ndarray, stances: list[Stance]) -> float:
    inside = np.zeros(len(time), dtype=bool)
    for stance in stances:
        inside |= (time >= stance.start_s) & (time <= stance.end_s)
    return float(np.sqrt(np.mean(values[inside] ** 2))) if inside.any() else 0.0


# The energy ledger of the prosthesis: what the residual limb puts in through the socket, and where it goes.
#
# The system is everything under the residual shank: the bushing, socket, pylon, foot. What passes into it is the work
# of the limb on the bushing; the ground is at rest and only takes. So
#
#     limb work = kinetic + gravity + strain of bushing, keel, foam and fulcrum support
#                 + loss in bushing, keel, foam, support and friction + remainder
#
# No term is made of the others. Strains, kinetic and gravity are functions of the state at an instant. Works are
# integrals (trapezoidal rule) of a force law at the instants times the velocity there, which is the mean of the steps'
# before and after, hence of second order in the step. The limb's wrench comes from the law of the bushing, not from a
# balance. What remains is what the first-order implicit stepper loses or gains: numerical dissipation. It gets a line
# of its own. The fulcrum rests in a walk of a trial, so the carriage does no work.


INPUT = "limb_work"
FOOT_STRAINS = ("keel_strain", "foam_strain", "fulcrum_strain")
STORED = (*FOOT_STRAINS, "bushing_strain", "kinetic", "gravity")
FOOT_LOSSES = ("keel_loss", "foam_loss", "friction_loss", "fulcrum_loss")
LOST = (*FOOT_LOSSES, "bushing_loss")
REMAINDER = "remainder"
TERMS = (INPUT, *STORED, *LOST, REMAINDER)


@dataclass(frozen=True, eq=False)
class ProsthesisEnergy:
    """Energy of the prosthesis over a walk.

    Attributes:
        time_s: (n,) ends of the steps.
        terms: TERMS, each (n,) J; differences between two instants count.
        socket_work: (n,) J of the bushing on the socket: the limb's work without what the bushing keeps.
        balance_work: (n,) J, the limb's work once more, without the bushing's law: from the wrench of the ground and
            the rate of the prosthesis' momentum.
        pylon_power, shank_power: (n,) W, `distal_power` of the pylon and of the residual shank.
        vertical_n: (n,) force of the ground on the prosthetic foot.
        keel_load: (n, 2) N and m: load on the keel across it, and where it acts, from A; NaN for the place unloaded.
    """

    time_s: np.ndarray
    terms: dict[str, np.ndarray]
    socket_work: np.ndarray
    balance_work: np.ndarray
    pylon_power: np.ndarray
    shank_power: np.ndarray
    vertical_n: np.ndarray
    keel_load: np.ndarray

    def total(self, names: tuple[str, ...]) -> np.ndarray:
        """(n,) J, sum of terms."""
        return np.sum([self.terms[name] for name in names], axis=0)


def prosthesis_energy(walker: Walker, walk: Walk) -> ProsthesisEnergy:
    """The ledger of a `walk` that `walker` made with a fulcrum at rest.

    Raises:
        ValueError: the fulcrum moved.
    """
    if np.ptp(walk.fulcrum_m) > 0.0:
        raise ValueError("this ledger has no line for the work of a fulcrum that moves")
    record, tree, person = walk.record, walk.mechanism.tree, walker.gait.person
    step = walk.step_s
    socket = [tree.index(name) for name in person.socket.coordinate_names]
    shank = person.segments[f"shank_{person.subject.prosthetic_side}"]
    bodies = [int(body.index()) for body in (shank, person.socket.pylon, person.foot.frame)]
    motion = follow(tree, record.q, central(record.v), bodies=bodies, coordinates=socket,
                    inside=tree.ancestors[:, socket[-1]])
    limb = _limb_wrench(walk, socket, motion)
    gravity = tree.gravity
    terms = {INPUT: _work(limb, motion.twist[:, 0], step), "kinetic": motion.kinetic_j,
             "gravity": -(motion.mass_moment @ gravity)}
    m, count = walk.mechanism, len(person.foot.sites.radius)
    keel = [tree.index(name) for name in person.foot.keel_joint_names]
    for name, own in (("keel", keel), ("bushing", socket)):
        rows = np.isin(m.spring_index, own)
        terms[f"{name}_strain"] = spring_strain(m, record.q, rows)
        terms[f"{name}_loss"] = work(spring_loss(m, record, rows), step)
    terms["foam_strain"], foam, friction = contact_terms(m, record, count)
    _, deflection, closing = record.fulcrum.T
    terms |= {"foam_loss": work(foam, step), "friction_loss": work(friction, step),
              "fulcrum_strain": 0.5 * m.fulcrum[0] * deflection**2,
              "fulcrum_loss": work(m.fulcrum[1] * closing * central(closing), step)}
    terms[REMAINDER] = (terms[INPUT] - np.sum([terms[name] for name in (*STORED, *LOST)], axis=0))
    ground = _ground_wrench(walk, walker)
    weight = np.column_stack([np.cross(motion.mass_moment, gravity),
                              np.tile(motion.mass * gravity, (len(record.q), 1))])
    balance = np.gradient(motion.momentum, step, axis=0) - ground - weight
    return ProsthesisEnergy(
        time_s=record.time_s, terms={name: terms[name] - terms[name][0] for name in TERMS},
        socket_work=_work(limb, motion.twist[:, 1], step), balance_work=_work(balance, motion.twist[:, 0], step),
        pylon_power=distal_power(walk.prosthetic, motion.twist[:, 1]),
        shank_power=distal_power(walk.prosthetic, motion.twist[:, 0]), vertical_n=walk.prosthetic.grf_W[:, 2],
        keel_load=_keel_load(walk, walker, motion))


def _work(wrench: np.ndarray, twist: np.ndarray, step: float) -> np.ndarray:
    return cumulative_integral(np.sum(wrench * twist, axis=1), step)


def _limb_wrench(walk: Walk, socket: list[int], motion: SegmentMotion) -> np.ndarray:
    """(n, 6) of the limb on the socket: what passes through all six joints, whose links weigh nothing."""
    constants = dict(zip(SPRING_COLUMNS, walk.mechanism.springs[-6:].T, strict=True))
    force = axis_force(walk.record.q[:, socket], walk.record.v[:, socket], **constants)
    wrench: np.ndarray = np.linalg.solve(motion.joints, force[..., None])[..., 0]
    return wrench


def _ground_wrench(walk: Walk, walker: Walker) -> np.ndarray:
    """(n, 6) of the ground on the prosthetic foot, about W's origin."""
    wrench = np.zeros((len(walk.record.q), 6))
    sum_sites(walk.record.sites, 0, len(walker.gait.person.foot.sites.radius), wrench)
    z = walk.mechanism.ground_height  # `sum_sites` has moments about the ground's height
    wrench[:, 0] -= z * wrench[:, 4]
    wrench[:, 1] += z * wrench[:, 3]
    return wrench


def _keel_load(walk: Walk, walker: Walker, motion: SegmentMotion) -> np.ndarray:
    """Force of the ground on the keel's spheres across the undeformed keel, and its lever about A along it."""
    sites, foot = walk.record, walker.gait.person.foot
    on_keel = np.flatnonzero(np.isin(foot.sites.body_indices, [int(body.index()) for body in foot.keel]))
    force = np.stack([sites.site(name)[:, on_keel] for name in ("friction_x", "friction_y", "normal_force")], axis=2)
    place = np.stack([sites.site("x")[:, on_keel], sites.site("y")[:, on_keel],
                      walk.mechanism.ground_height - sites.site("depth")[:, on_keel]], axis=2)
    in_K = np.einsum("nsi,nij->nsj", place - motion.p_WB[:, None], motion.R_WB)
    force_K = np.einsum("nsi,nij->nsj", force, motion.R_WB)
    across = force_K[..., 2].sum(1)
    moment = np.sum(in_K[..., 0] * force_K[..., 2] - in_K[..., 2] * force_K[..., 0], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        lever = np.where(across > 0.0, moment / across, np.nan)
    return np.column_stack([across, lever])
