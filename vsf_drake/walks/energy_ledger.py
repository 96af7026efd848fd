"""Energy of the prosthesis over a walk: what the residual limb puts in through the socket, and
where it goes.

The system is everything under the residual shank: the bushing, socket, pylon, foot. What passes
into it is the work of the limb on the bushing; the ground is at rest and only takes. So

    limb work = kinetic + gravity + strain of bushing, keel, foam and fulcrum support
                + loss in bushing, keel, foam, support and friction + remainder

No term is made of the others. Strains, kinetic and gravity are functions of the state. Works are
integrals (trapezoidal rule) of a force law at the instants times the velocity there, which is the
mean of the steps' before and after, hence of second order in the step. The limb's wrench comes from
the law of the bushing, not from a balance. What remains is what the first-order implicit stepper
loses or gains: numerical dissipation. It gets a line of its own. The fulcrum rests in a walk of a
trial, so the carriage does no work.

Vectors are spatial, in W and about its origin (`simulation.stepping.tree`): (angular velocity,
velocity of the point of the body at W's origin), (moment about W's origin, force).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from vsf_drake.base.files import flat
from vsf_drake.laws.beam import lumped_stiffness
from vsf_drake.laws.bushing import axis_force
from vsf_drake.model.model_file import bending_stiffness
from vsf_drake.model.parameters import FootParameters
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.reactions import (
    PROSTHETIC,
    FootReaction,
    SegmentMotion,
    central,
    contact_terms,
    follow,
    spring_loss,
    spring_strain,
    work,
)
from vsf_drake.simulation.stepping.assembly import SPRING_COLUMNS
from vsf_drake.simulation.variables import MotionPerturbation
from vsf_drake.simulation.walk import Walk, Walker
from vsf_drake.walks.comparison import cumulative_integral

INPUT = "limb_work"
REMAINDER = "remainder"
FOOT_STRAINS = ("keel_strain", "foam_strain", "fulcrum_strain")
STORED = (*FOOT_STRAINS, "bushing_strain", "kinetic", "gravity")
FOOT_LOSSES = ("keel_loss", "foam_loss", "friction_loss", "fulcrum_loss")
LOST = (*FOOT_LOSSES, "bushing_loss")
TERMS = (INPUT, *STORED, *LOST, REMAINDER)


@dataclass(frozen=True, eq=False)
class ProsthesisEnergy:
    """Energy of the prosthesis over a walk."""

    time_s: np.ndarray  # (n,) ends of the steps
    terms: dict[str, np.ndarray]  # TERMS, each (n,) J; differences between two instants count
    balance_work: np.ndarray
    """(n,) J, the limb's work without the bushing's law: of ground wrench and momentum's rate"""
    pylon_power: np.ndarray  # (n,) W, `distal_power` of the pylon
    shank_power: np.ndarray  # (n,) W, the same of the residual shank
    vertical_n: np.ndarray  # (n,) force of the ground on the prosthetic foot
    keel_load: np.ndarray
    """(n, 2) N and m: load across the keel, and where it acts, from A; NaN for the place
    unloaded"""


def prosthesis_energy(walker: Walker, walk: Walk) -> ProsthesisEnergy:
    """The ledger of a `walk` that `walker` made with a fulcrum at rest; ValueError if it moved."""
    if np.ptp(walk.fulcrum_m) > 0.0:
        raise ValueError("this ledger has no line for the work of a fulcrum that moves")
    record = walk.record
    m = walk.mechanism
    person = walker.gait.person
    step = walk.step_s
    tree = m.tree
    gravity = m.tree.gravity
    foot = person.foot
    socket = [tree.index(name) for name in person.socket.coordinate_names]
    keel = [tree.index(name) for name in foot.keel_joint_names]
    shank = person.segments[f"shank_{person.subject.prosthetic_side}"]
    bodies = [int(body.index()) for body in (shank, person.socket.pylon, foot.frame)]
    motion = follow(
        tree,
        record.q,
        central(record.v),
        bodies=bodies,
        coordinates=socket,
        inside=tree.ancestors[:, socket[-1]],
    )
    shank_twist = motion.twist[:, 0]
    pylon_twist = motion.twist[:, 1]
    count = len(foot.sites.radius)

    def worked(wrench: np.ndarray, twist: np.ndarray) -> np.ndarray:
        return cumulative_integral(np.sum(wrench * twist, axis=1), step)

    # the limb's wrench on the socket passes through all six joints of the bushing, whose links
    # weigh nothing
    constants = dict(zip(SPRING_COLUMNS, m.springs[-6:].T, strict=True))
    force, _, _ = axis_force(record.q[:, socket], record.v[:, socket], **constants)
    limb: np.ndarray = np.linalg.solve(motion.joints, force[..., None])[..., 0]

    terms = {
        INPUT: worked(limb, shank_twist),
        "kinetic": motion.kinetic_j,
        "gravity": -(motion.mass_moment @ gravity),
    }
    for name, own in (("keel", keel), ("bushing", socket)):
        rows = np.isin(m.spring_index, own)
        terms[f"{name}_strain"] = spring_strain(m, record.q, rows)
        terms[f"{name}_loss"] = work(spring_loss(m, record, rows), step)
    terms["foam_strain"], foam, friction = contact_terms(m, record, count)
    _, deflection, closing = record.fulcrum.T
    terms |= {
        "foam_loss": work(foam, step),
        "friction_loss": work(friction, step),
        "fulcrum_strain": 0.5 * m.fulcrum[0] * deflection**2,
        "fulcrum_loss": work(m.fulcrum[1] * closing * central(closing), step),
    }
    terms[REMAINDER] = terms[INPUT] - np.sum([terms[name] for name in (*STORED, *LOST)], axis=0)

    ground = record.wrench[:, PROSTHETIC].copy()
    # its moments are about the ground's height
    ground[:, 0] -= m.ground_height * ground[:, 4]
    ground[:, 1] += m.ground_height * ground[:, 3]
    weight = np.column_stack(
        [np.cross(motion.mass_moment, gravity), np.tile(motion.mass * gravity, (len(record.q), 1))]
    )
    balance = np.gradient(motion.momentum, step, axis=0) - ground - weight
    return ProsthesisEnergy(
        time_s=record.time_s,
        terms={name: terms[name] - terms[name][0] for name in TERMS},
        balance_work=worked(balance, shank_twist),
        pylon_power=distal_power(walk.prosthetic, pylon_twist),
        shank_power=distal_power(walk.prosthetic, shank_twist),
        vertical_n=walk.prosthetic.grf_W[:, 2],
        keel_load=_keel_load(walk, walker, motion),
    )


def _keel_load(walk: Walk, walker: Walker, motion: SegmentMotion) -> np.ndarray:
    """Force of the ground on the keel's spheres across the undeformed keel, and its lever about A
    along it."""
    sites = walk.record
    foot = walker.gait.person.foot
    keel = {int(body.index()) for body in foot.keel}
    on_keel = np.flatnonzero([int(body) in keel for body in foot.sites.body_indices])
    force = np.stack(
        [sites.site(name)[:, on_keel] for name in ("friction_x", "friction_y", "normal_force")],
        axis=2,
    )
    point = np.stack(
        [
            sites.site("x")[:, on_keel],
            sites.site("y")[:, on_keel],
            walk.mechanism.ground_height - sites.site("depth")[:, on_keel],
        ],
        axis=2,
    )
    in_K = np.einsum("nsi,nij->nsj", point - motion.p_WB[:, None], motion.R_WB)
    force_K = np.einsum("nsi,nij->nsj", force, motion.R_WB)
    across = force_K[..., 2].sum(1)
    moment = np.sum(in_K[..., 0] * force_K[..., 2] - in_K[..., 2] * force_K[..., 0], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        lever = np.where(across > 0.0, moment / across, np.nan)
    return np.column_stack([across, lever])


# The power that the ground gives to what is distal of a segment.


def distal_power(reaction: FootReaction, twist: np.ndarray) -> np.ndarray:
    """(n,) W, power that passes from all that is distal of a rigid segment into it, positive when
    it is pushed on.

        P = F . v_d + M_free . omega,        v_d = v_s + omega x (CoP - CM)

    with the force F of the ground and its free moment, and the velocity v_s of the segment's centre
    of mass CM: the distal segment power of Siegel (1996) in Takahashi's (2012) unified deformable
    segment, derived in the appendix of Zelik and Honert (2018, doi 10.1016/j.jbiomech.2018.04.017).
    The formula is that of a public program of E. Honert's, the papers' equations were not read. It
    is the power of the ground's wrench on a body that moves with the segment, exact if what lies
    distal has no mass. Zero where the foot bears too little for a centre of pressure.
    """
    loaded = ~np.isnan(reaction.cop_W[:, 0])
    turning = twist[:, :3]
    moving = twist[:, 3:]
    v_d = moving + np.cross(turning, np.where(loaded[:, None], reaction.cop_W, 0.0))
    power = np.sum(reaction.grf_W * v_d, axis=1) + reaction.free_moment_nm * turning[:, 2]
    return np.where(loaded, power, 0.0)


# A trial walked with the fulcrum elsewhere and the load on the foot kept: the pelvis rises and
# sinks as that takes.
#
# The recorded motion prescribes where the limb goes, so that a stiffer foot under the same motion
# is pressed as far and bears more. A person carries the same weight on either. Here the motion is
# changed by a perturbation of the pelvis' height until the vertical force on the prosthetic foot is
# that of the walk at the trial's own position. It is found by Newton's method instant by instant,
# with how the force depends on the height.

_HEIGHT = "pelvis_ty"
_MOST_WALKS = 8
_CLOSE_ENOUGH = 0.002
"""Of body weight: root mean square over stance of what the forces differ by, at which the search
ends."""
_USABLE = 0.01
"""The same, beyond which the load does not count as kept."""
_FORCE_CUTOFF_HZ, _HEIGHT_CUTOFF_HZ = 20.0, 12.0
"""Of the forces that are compared and of the change of height (choices)."""
_LEAST_N_PER_M = 8e3
"""Least stiffness in a Newton step, where the foot hardly bears (a choice)."""
_PROBE_M = 1e-4
"""Change of height by whose effect the stiffness is measured."""


@dataclass(frozen=True, eq=False)
class SameLoad:
    """A walk with the load of another."""

    walk: Walk  # with the changed height, in the finer step
    off_bw: float
    """root mean square over stance of what the low-passed vertical forces differ by, over body
    weight"""
    height_mm: float  # largest change of the pelvis' height

    @property
    def kept(self) -> bool:
        """Whether the load is that of the other walk."""
        return self.off_bw <= _USABLE


def walk_with_same_load(
    walker: Walker, trial: Trial, *, fulcrum_m: float, search_step_s: float, step_s: float
) -> SameLoad:
    """Walks `trial` with the fulcrum at `fulcrum_m` (m from A) under the load that it has with its
    own, in steps of `step_s` after a search for the height in steps of `search_step_s`; raises what
    `Walker.walk` does."""
    weight = walker.subject.mass_kg * float(
        np.linalg.norm(walker.gait.plant.gravity_field().gravity_vector())
    )

    def walked(x: float, step: float, height: np.ndarray | None = None) -> Walk:
        perturbations = (
            []
            if height is None
            else [
                MotionPerturbation(
                    name="height", coordinate=_HEIGHT, shape=make_interp_spline(grid, height, k=3)
                )
            ]
        )
        return walker.walk_trial(
            trial,
            fulcrum_m=x,
            step_s=step,
            perturbations=perturbations,
            values={"perturbation.height": 1.0} if perturbations else {},
        )

    def smooth(height: np.ndarray) -> np.ndarray:
        return low_pass(height, rate_hz=1.0 / search_step_s, cutoff_hz=_HEIGHT_CUTOFF_HZ)

    def vertical(walk: Walk) -> np.ndarray:
        return low_pass(
            walk.prosthetic.grf_W[:, 2], rate_hz=1.0 / walk.step_s, cutoff_hz=_FORCE_CUTOFF_HZ
        )

    def off_bw(values: np.ndarray) -> float:
        return float(np.sqrt(np.mean(values[inside] ** 2))) / weight if inside.any() else 0.0

    own = walked(trial.fulcrum_m, search_step_s)
    time = own.record.time_s
    wanted = vertical(own)
    inside = np.zeros(len(time), dtype=bool)
    for stance in find_stances(time, own.prosthetic.grf_W[:, 2]):
        inside |= (time >= stance.start_s) & (time <= stance.end_s)
    grid = np.concatenate([[trial.start_s], time])
    height = np.zeros(len(grid))
    for _ in range(_MOST_WALKS):
        found = vertical(walked(fulcrum_m, search_step_s, height))
        too_much = found - wanted
        if off_bw(too_much) <= _CLOSE_ENOUGH:
            break
        # A second walk tells the slope without the machine code of derivatives, which nothing needs
        # before.
        falling = smooth(
            (found - vertical(walked(fulcrum_m, search_step_s, height + _PROBE_M))) / _PROBE_M
        )
        height[1:] += smooth(too_much / np.maximum(falling, _LEAST_N_PER_M))
    final = walked(fulcrum_m, step_s, height)
    off = np.interp(time, final.record.time_s, vertical(final)) - wanted
    return SameLoad(walk=final, off_bw=off_bw(off), height_mm=float(1e3 * np.abs(height).max()))


# One stance of the ledger in numbers: stored, returned, lost, and how well it closes.
#
# Stored is the strain of keel, foam and fulcrum support above what it was at touch-down, at its
# largest. Returned is what of it is gone again at toe-off, without what keel, foam, support and
# friction lost on the way.

PERCENT = np.linspace(0.0, 100.0, 201)
"""Of stance, where curves are given; powers are means between neighbours."""
_LATE = 0.5
"""Share of stance after which the largest vertical load is that of push-off."""


@dataclass(frozen=True, kw_only=True)
class StanceNumbers:
    """One stance; shares are of the stored energy, None where nothing was stored."""

    fulcrum_mm: float
    stored_j: float
    stored_at_percent: float  # of stance: where the strain is largest
    keel_at_most_j: float  # of what is stored, when it is largest
    foam_at_most_j: float
    fulcrum_at_most_j: float
    returned_j: float
    return_ratio: float | None
    lost_j: float  # by the foot
    remainder_max_j: float  # at any instant
    remainder_share: float | None
    balance_share: float | None
    """by what the limb's work without the bushing's law is off from the ledger's at most"""
    distal_peak_w: float  # of the distal segment power, of the pylon
    distal_lowest_w: float
    distal_share: float | None  # by what its work is off from strain and losses of the foot at most
    late_load_n: float  # largest vertical force in the second half of stance
    beam_j: float | None  # F²/2k in closed form of what keel and support hold at the largest strain
    terms_j: Mapping[str, float] = flat()  # TERMS at toe-off, each as "<name>_j"


@dataclass(frozen=True, eq=False)
class StanceEnergy:
    """Numbers of one stance, and curves on PERCENT: `terms_j` (len(TERMS), 201) from touch-down on,
    and `pylon_power_w`, `shank_power_w` (200,)."""

    stance: Stance
    row: StanceNumbers
    curves: dict[str, np.ndarray]


def stance_energy(
    energy: ProsthesisEnergy, stance: Stance, *, foot: FootParameters, fulcrum_m: float
) -> StanceEnergy:
    """The ledger from the last instant before touch-down to the first after toe-off."""
    first = max(int(np.searchsorted(energy.time_s, stance.start_s)) - 1, 0)
    cut = slice(
        first, min(int(np.searchsorted(energy.time_s, stance.end_s)), len(energy.time_s) - 1) + 1
    )
    time = energy.time_s[cut]
    step = float(time[1] - time[0])
    terms = {name: energy.terms[name][cut] - energy.terms[name][first] for name in TERMS}
    strain = np.sum([terms[name] for name in FOOT_STRAINS], axis=0)
    lost = np.sum([terms[name] for name in FOOT_LOSSES], axis=0)
    balance = energy.balance_work[cut] - energy.balance_work[first]
    missed = float(np.abs(terms[REMAINDER]).max())

    # stored at its largest; returned = released since then, less what was lost on the way
    top = int(strain.argmax())
    stored = float(strain[top])
    returned = float(strain[top] - strain[-1] - (lost[-1] - lost[top]))

    def share(part: float) -> float | None:
        return part / stored if stored > 0.0 else None

    pylon, shank = (
        cumulative_integral(power[cut], step) for power in (energy.pylon_power, energy.shank_power)
    )
    grid = time[0] + 0.01 * PERCENT * (time[-1] - time[0])
    pylon_w, shank_w = (
        np.diff(np.interp(grid, time, work)) / np.diff(grid) for work in (pylon, shank)
    )
    load, lever = energy.keel_load[cut][top]
    keel, foam, support = (float(terms[name][top]) for name in FOOT_STRAINS)
    row = StanceNumbers(
        fulcrum_mm=round(1e3 * fulcrum_m, 6),
        stored_j=stored,
        stored_at_percent=100.0 * top / (len(time) - 1),
        keel_at_most_j=keel,
        foam_at_most_j=foam,
        fulcrum_at_most_j=support,
        returned_j=returned,
        return_ratio=share(returned),
        lost_j=float(lost[-1]),
        remainder_max_j=missed,
        remainder_share=share(missed),
        balance_share=share(float(np.abs(balance - terms[INPUT]).max())),
        distal_peak_w=float(pylon_w.max()),
        distal_lowest_w=float(pylon_w.min()),
        distal_share=share(float(np.abs(pylon + strain + lost).max())),
        late_load_n=float(energy.vertical_n[cut][int(_LATE * len(time)) :].max()),
        beam_j=_beam_energy(foot, fulcrum_m, float(load), float(lever)),
        terms_j={f"{name}_j": float(terms[name][-1]) for name in TERMS},
    )
    return StanceEnergy(
        stance=stance,
        row=row,
        curves={
            "terms_j": np.array([np.interp(grid, time, terms[name]) for name in TERMS]),
            "pylon_power_w": pylon_w,
            "shank_power_w": shank_w,
        },
    )


def _beam_energy(
    foot: FootParameters, fulcrum_m: float, load_n: float, place_m: float
) -> float | None:
    """F²/2k of keel and support in closed form under one load across the keel; None if it is not
    ahead of the fulcrum.

    A second method: small deflections, one load in place of the spheres', no time.
    """
    keel = foot.keel
    return (
        0.5
        * load_n**2
        / lumped_stiffness(
            bending_stiffness=bending_stiffness(keel),
            element_lengths=keel.element_lengths_m,
            support=fulcrum_m,
            load_point=place_m,
            fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m,
        )
        if place_m > fulcrum_m
        else None
    )
