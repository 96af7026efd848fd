"""The person standing still on both feet: joints held, the pelvis as free as a stiff person can
stay up with.

Three ways, the freest first that stays up:

    all six     the pelvis is free altogether; takes a posture whose centre of mass is over both
                feet, in which the feet right the person faster than the weight topples it
    sideways    place and list free; tilt and rotation held
    upright     place free; the attitude held, at the list at which both unloaded soles touch the
                floor

The person is let go a little off rest (NUDGE_M, NUDGE_RAD), so that standing still means coming
back. At anatomically neutral angles the centre of mass is over the ankle, near the heel's end of
the foot: leaning back the feet lose their toes before they right the body, so that nobody of this
build balances fore and aft without leaning at the ankles.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.multibody.tree import BodyIndex
from scipy.optimize import brentq, root

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.sentences import say
from vsf_drake.model.model_file import stated_fulcrum
from vsf_drake.model.parameters import (
    GRAVITY,
    MID_FULCRUM_MM,
    PELVIS_COORDINATES,
    ModelParameters,
    Subject,
)
from vsf_drake.model.setting import setting_of
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.options import StandingOptions
from vsf_drake.simulation.results import NUDGE_M, NUDGE_RAD, Standing
from vsf_drake.simulation.walk import AT_REST, DEFAULT_STEP_S, Walk, Walker, step_notes

LARGEST_SWAY_RAD = np.radians(1.0)
"""Turn of a free pelvis from its equilibrium after which the person counts as falling (a
choice)."""
LONGEST_S = 120.0  # longest time (s) to stand: the record of every step stays in memory


def simulate_standing(
    subject: Subject,
    model: ModelParameters,
    *,
    fulcrum_m: float | None = None,
    duration_s: float = StandingOptions.duration_s,
    step_s: float = DEFAULT_STEP_S,
    angles: Mapping[str, float] | None = None,
    upright: bool = StandingOptions.upright,
    progress: Callable[[float], None] | None = None,
) -> Standing:
    """Stands the person on both feet for `duration_s`.

    Args:
        fulcrum_m: from the keel's posterior end; None: 108 mm, of a passive foot its clamp.
        angles: rad by coordinate, such as those of a recorded standing trial; 0 (anatomically
            neutral) where not named. Joints stay there; pelvis_tilt and pelvis_rotation are where
            the pelvis is held, or looked for.
        upright: whether to hold the attitude in any case, so that persons and settings compare.
        progress: called with the finished fraction of a run.
    """
    if not 0.0 < duration_s <= LONGEST_S:
        raise InputError(
            f"{duration_s:g} s is no time to stand",
            where="duration_s",
            right=f"It must be above 0 and at most {LONGEST_S:g} s",
        )
    if fulcrum_m is None:
        fulcrum_m = stated_fulcrum(None, model.foot, default_m=1e-3 * MID_FULCRUM_MM)
    posture = StandingPosture(subject, model, angles or {}, fulcrum_m=fulcrum_m)
    tilt = posture.angles["pelvis_tilt"]
    notes: list[str] = []
    for balance in () if upright else _balances(posture, tilt, notes):
        walker = Walker(subject, model, free=TRANSLATIONS + balance.freed)
        try:
            walk, rest_speed = _let_go(
                posture, walker, balance.tilt, balance.list, duration_s, step_s, progress
            )
        except SimulationError as error:
            notes += say("standing", "failed", free=balance.free, error=error, turn_deg=0.0)
            continue
        standing = _result(posture, walk, balance, rest_speed, [*notes])
        if standing.turn_rad < LARGEST_SWAY_RAD:
            return standing
        notes += say(
            "standing",
            "failed",
            free=balance.free,
            error=None,
            turn_deg=np.degrees(standing.turn_rad),
        )
    walk, rest_speed = _let_go(
        posture, posture.walker, tilt, posture.level_list(tilt), duration_s, step_s, progress
    )
    return _result(posture, walk, None, rest_speed, notes)


def _let_go(
    posture: StandingPosture,
    walker: Walker,
    tilt: float,
    list_: float,
    duration_s: float,
    step_s: float,
    progress: Callable[[float], None] | None,
) -> tuple[Walk, float]:
    """Settles the person at an attitude, nudges what is free and lets go; also the largest speed
    left when settled."""
    q, rest_speed = posture.settled(tilt, list_)
    q["pelvis_ty"] += NUDGE_M
    towards = 1.0 if walker.subject.prosthetic_side == "right" else -1.0
    for name, sign in zip(ROTATIONS, (1.0, towards, towards), strict=True):
        q[name] += sign * NUDGE_RAD if name in walker.free else 0.0
    return posture.run(
        walker, q, duration_s=duration_s, step_s=step_s, progress=progress
    ), rest_speed


def _balances(posture: StandingPosture, tilt: float, notes: list[str]) -> list[Equilibrium]:
    """Stable equilibria, the freest first; `notes` learns why there are no more."""
    full = None
    least = (0.0, 0.0)
    try:
        sideways = posture.sideways_equilibrium(tilt)
        if sideways is not None:
            full = posture.equilibrium(sideways)
            least = posture.least_tilt_moment(tilt, sideways.list) if full is None else least
    except SimulationError as error:
        notes += say("standing", "unknown", error=error)
        return []
    notes += say(
        "standing",
        "balances",
        sideways=sideways,
        full=full,
        tilt=np.degrees(least[0]),
        ahead_m=least[1] / posture.weight_n,
    )
    return [balance for balance in (full, sideways) if balance is not None and balance.stable]


def _result(
    posture: StandingPosture,
    walk: Walk,
    balance: Equilibrium | None,
    rest_speed: float,
    notes: list[str],
) -> Standing:
    tree = walk.mechanism.tree
    record = walk.record
    columns = [tree.index(name) for name in PELVIS_COORDINATES]
    free = TRANSLATIONS + (balance.freed if balance else ())
    held = {
        name: float(record.load[-1, tree.index(name)]) for name in ROTATIONS if name not in free
    }
    prosthetic = walk.prosthetic.grf_W[:, 2]
    intact = walk.intact.grf_W[:, 2]
    share = float(prosthetic.sum() / max((prosthetic + intact).sum(), 1e-9))
    to_prosthesis = (held.get("pelvis_list", 0.0) < 0.0) == (
        posture.walker.subject.prosthetic_side == "left"
    )
    notes += say(
        "standing",
        "result",
        tilt_nm=held.get("pelvis_tilt"),
        list_nm=held.get("pelvis_list"),
        towards="prosthetic" if to_prosthesis else "intact",
        weight_n=posture.weight_n,
        share=None if LEAST_SHARE < share < 1.0 - LEAST_SHARE else share,
        rest_speed=rest_speed if rest_speed > AT_REST else 0.0,
    )
    notes += step_notes(record, stop=".")
    body = posture.walker.gait.person.body
    return Standing(
        time_s=record.time_s,
        prosthetic_n=prosthetic,
        intact_n=intact,
        pelvis=np.vstack([record.q0[columns], record.q[:, columns]]),
        weight_n=posture.weight_n,
        setting=setting_of(posture.walker.model.foot, posture.fulcrum_m),
        side=posture.walker.subject.prosthetic_side,
        name=posture.walker.subject.name,
        free=free,
        held_nm=held,
        stiffness_nm_per_rad=None if balance is None else balance.least_nm_per_rad,
        leg_lengths_m=(body.prosthetic_leg_length, body.leg_length),
        notes=tuple(notes),
        **record.counts(),
    )


# Whether a person with stiff joints can balance, and how the pelvis must be turned for it.
#
# With every joint held, the person is one body on two springy feet: an inverted pendulum, which the
# weight topples with m g h times its angle (h: centre of mass above the ground) and the feet right.
# Where the moment that holds the pelvis at an angle is zero the person is in equilibrium, and where
# it grows with the angle the equilibrium is stable.


TRANSLATIONS = PELVIS_COORDINATES[:3]
ROTATIONS = PELVIS_COORDINATES[3:]
LARGEST_TURN_RAD = np.radians(6.0)
"""How far from upright an equilibrium is looked for (a choice: the spheres under a foot unload well
before)."""
SEARCH_STEP_RAD = np.radians(1.0)
LEAST_SHARE = 0.05  # share of the weight that a foot must carry for both to be stood on (a choice)
# moment left at an equilibrium, over weight times a metre: a micrometre of the centre of mass
MOMENT_TOLERANCE = 1e-6


class Hold(NamedTuple):
    """The settled person with the pelvis held at an attitude."""

    moments_nm: np.ndarray  # (2,) what it takes to hold pelvis_tilt and pelvis_list
    on_both_feet: bool  # whether each carries a share worth the name


@dataclass(frozen=True)
class Equilibrium:
    """An attitude (rad) of the pelvis that nothing needs to hold in the directions `free`."""

    tilt: float
    list: float
    free: tuple[str, ...]
    stiffness: np.ndarray
    """(k, k) N m/rad in the directions of `free`; the feet's less the weight's"""

    @property
    def least_nm_per_rad(self) -> float:
        """The least stiffness in any direction."""
        return float(np.linalg.eigvalsh(0.5 * (self.stiffness + self.stiffness.T)).min())

    @property
    def stable(self) -> bool:
        """Whether every small turn is righted."""
        return self.least_nm_per_rad > 0.0

    @property
    def freed(self) -> tuple[str, ...]:
        """The pelvis angles that go free: rotation, which only friction opposes, with the full
        balance alone."""
        return ROTATIONS if len(self.free) == 2 else self.free


class StandingPosture:
    """A subject with joints held at `angles` (rad by coordinate, 0 where not named), on both feet.

    They may hold pelvis_tilt and pelvis_rotation; the pelvis's place and list are worked out here.
    """

    def __init__(
        self,
        subject: Subject,
        model: ModelParameters,
        angles: Mapping[str, float],
        *,
        fulcrum_m: float,
    ) -> None:
        self.walker = Walker(subject, model, free=TRANSLATIONS)
        self.fulcrum_m = fulcrum_m
        self.weight_n = subject.mass_kg * GRAVITY
        names = self.walker.gait.person.coordinate_names
        for name, value in angles.items():
            if name not in names:
                raise InputError(
                    "is not a coordinate of this person",
                    where=f"angles[{name!r}]",
                    right=f"Known are: {', '.join(names)}",
                )
            if not np.isfinite(value):
                raise InputError(
                    f"{value} is not a finite angle",
                    where=f"angles[{name!r}]",
                    right="Give radians",
                )
        self.angles = {
            name: float(angles.get(name, 0.0)) for name in names if name not in TRANSLATIONS
        }

    def coordinates(self, tilt: float, list_: float) -> dict[str, float]:
        """Every anatomical coordinate; the lower sole's lowest point touches the ground, the pelvis
        is at x = y = 0."""
        q = {
            **dict.fromkeys(TRANSLATIONS, 0.0),
            **self.angles,
            "pelvis_tilt": tilt,
            "pelvis_list": list_,
        }
        return {**q, "pelvis_ty": -min(self._sole_heights(q))}

    def level_list(self, tilt: float) -> float:
        """The list (rad) at which both unloaded soles touch the floor, 0 for equal legs; InputError
        if none does."""

        def difference(list_: float) -> float:
            prosthetic, intact = self._sole_heights(self.coordinates(tilt, list_))
            return prosthetic - intact

        ends = -0.5, 0.5
        if difference(ends[0]) * difference(ends[1]) > 0.0:
            raise InputError(
                "in this posture the two feet cannot stand on the ground together",
                where="angles",
                right="Check the angles and the lengths of the two legs",
            )
        exact = abs(difference(0.0)) < 1e-12
        return 0.0 if exact else float(brentq(difference, *ends, xtol=1e-12))

    def hold(self, tilt: float, list_: float) -> Hold:
        """Lets the person settle in height and socket with the pelvis held at an attitude."""
        walk = self._settle(tilt, list_)
        load = walk.record.load[-1]
        tree = walk.mechanism.tree
        up = walk.prosthetic.grf_W[-1, 2], walk.intact.grf_W[-1, 2]
        share = float(up[0] / max(sum(up), 1e-9))
        moments = np.array([load[tree.index(name)] for name in ROTATIONS[:2]])
        return Hold(moments, on_both_feet=LEAST_SHARE < share < 1.0 - LEAST_SHARE)

    def settled(self, tilt: float, list_: float) -> tuple[dict[str, float], float]:
        """Coordinates at rest under the load with the pelvis held at an attitude, and the largest
        speed left."""
        walk = self._settle(tilt, list_)
        q = self.coordinates(tilt, list_)
        tree = walk.mechanism.tree
        return {name: float(walk.record.q0[tree.index(name)]) for name in q}, walk.rest_speed

    def _settle(self, tilt: float, list_: float) -> Walk:
        return self.run(
            self.walker,
            self.coordinates(tilt, list_),
            duration_s=DEFAULT_STEP_S,
            settle=TRANSLATIONS,
        )

    def run(
        self,
        walker: Walker,
        q: Mapping[str, float],
        *,
        duration_s: float,
        settle: tuple[str, ...] = (),
        step_s: float = DEFAULT_STEP_S,
        progress: Callable[[float], None] | None = None,
    ) -> Walk:
        """`walker` let go at rest at the coordinates `q`; those in `settle` come to rest under the
        load before."""
        moments = np.linspace(0.0, max(duration_s, 1e-2), 8)
        still = CoordinateTrajectory(moments, np.tile([*q.values()], (len(moments), 1)), tuple(q))
        return walker.walk(
            still,
            fulcrum_m=self.fulcrum_m,
            start_s=0.0,
            end_s=duration_s,
            step_s=step_s,
            initial={name: q[name] for name in settle},
            progress=progress,
        )

    def sideways_equilibrium(self, tilt: float) -> Equilibrium | None:
        """Balanced sideways with the tilt held: both feet loaded, stable if there is such, nearest
        to level."""
        level = self.level_list(tilt)
        balances = [
            Equilibrium(tilt, list_, ("pelvis_list",), self._stiffness(tilt, list_)[1:, 1:])
            for list_ in self._zeros(lambda x: self.hold(tilt, x), 1, level)
        ]
        return min(balances, key=lambda e: (not e.stable, abs(e.list - level)), default=None)

    def equilibrium(self, sideways: Equilibrium) -> Equilibrium | None:
        """Balanced in every direction, looked for from a sideways balance: stable if any is, else
        the nearest."""
        start = np.array([sideways.tilt, sideways.list])
        balances = []
        for tilt in self._zeros(lambda x: self.hold(x, sideways.list), 0, sideways.tilt):
            solved = root(
                lambda x: self.hold(*x).moments_nm / self.weight_n,
                [tilt, start[1]],
                options={"eps": 1e-5},
            )
            exact = np.abs(solved.fun).max() < MOMENT_TOLERANCE
            near = np.abs(solved.x - start).max() < LARGEST_TURN_RAD
            if exact and near and self.hold(*solved.x).on_both_feet:
                x, y = map(float, solved.x)
                balances.append(Equilibrium(x, y, ROTATIONS[:2], self._stiffness(x, y)))
        return min(
            balances, key=lambda e: (not e.stable, abs(e.tilt - sideways.tilt)), default=None
        )

    def least_tilt_moment(self, tilt: float, list_: float) -> tuple[float, float]:
        """The tilt (rad) at which holding it takes least, and that moment (N m)."""
        held = {x: float(self.hold(x, list_).moments_nm[0]) for x in _grid(tilt)}
        best = min(held, key=lambda x: abs(held[x]))
        return best, held[best]

    def _zeros(self, hold: Callable[[float], Hold], row: int, centre: float) -> list[float]:
        """Angles around `centre` where the moment `row` vanishes with both feet loaded."""
        grid = _grid(centre)
        holds = [hold(x) for x in grid]
        zeros = []
        for (low, at_low), (high, at_high) in itertools.pairwise(zip(grid, holds, strict=True)):
            if at_low.moments_nm[row] * at_high.moments_nm[row] < 0.0:
                x = float(brentq(lambda x: hold(x).moments_nm[row], low, high, xtol=1e-9))
                if hold(x).on_both_feet:
                    zeros.append(x)
        return zeros

    def _stiffness(self, tilt: float, list_: float, step: float = 1e-4) -> np.ndarray:
        at = np.array([tilt, list_])
        return np.column_stack(
            [
                (self.hold(*(at + d)).moments_nm - self.hold(*(at - d)).moments_nm) / (2 * step)
                for d in step * np.eye(2)
            ]
        )

    def _sole_heights(self, q: Mapping[str, float]) -> tuple[float, float]:
        """Heights (m) of the lowest points of the unloaded prosthetic and intact foot."""
        gait = self.walker.gait
        context = gait.plant.CreateDefaultContext()
        positions = np.zeros(gait.plant.num_positions())
        for name, value in q.items():
            positions[gait.plant.GetJointByName(name).position_start()] = value
        gait.plant.SetPositions(context, positions)
        lowest = []
        for foot in (gait.person.foot.sites, gait.person.intact_sites):
            centres = [
                (gait.plant.get_body(BodyIndex(int(body))).EvalPoseInWorld(context) @ p)[2]
                for body, p in zip(foot.body_indices, foot.p_BS, strict=True)
            ]
            lowest.append(float(np.min(np.array(centres) - foot.radius)))
        return lowest[0], lowest[1]


def _grid(centre: float) -> np.ndarray:
    count = round(2 * LARGEST_TURN_RAD / SEARCH_STEP_RAD) + 1
    return centre + np.linspace(-LARGEST_TURN_RAD, LARGEST_TURN_RAD, count)
