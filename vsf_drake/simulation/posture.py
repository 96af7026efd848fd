"""Whether a person with stiff joints can balance, and how the pelvis must be turned for it.

With every joint held, the person is one body on two springy feet: an inverted pendulum. Turned by an angle, the
weight topples it with m g h times the angle (h: centre of mass above the ground), and the feet right it as far as
they are stiff and their spheres stay loaded. The moment that it takes to hold the pelvis at an angle tells all:
where it is zero the person is in equilibrium, and where it then grows with the angle the equilibrium is stable.
Divided by the weight it is the distance of the centre of mass from the centre of pressure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.tree import BodyIndex
from scipy.optimize import brentq, root

from vsf_drake.errors import InputError
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import GRAVITY, ModelParameters, Subject
from vsf_drake.plants.person import PELVIS_COORDINATES
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walk, Walker

TRANSLATIONS, ROTATIONS = PELVIS_COORDINATES[:3], PELVIS_COORDINATES[3:]
LARGEST_TURN_RAD = np.radians(6.0)
"""How far from upright an equilibrium is looked for (a choice: the spheres under a foot unload well before)."""
SEARCH_STEP_RAD = np.radians(1.0)
LEAST_SHARE = 0.05
"""Share of the weight that a foot must carry for both to be stood on (a choice)."""
MOMENT_TOLERANCE = 1e-6
"""Moment left at an equilibrium, over weight times a metre: a micrometre of the centre of mass."""


@dataclass(frozen=True)
class Hold:
    """The settled person with the pelvis held at an attitude.

    Attributes:
        moments_nm: (2,) what it takes to hold pelvis_tilt and pelvis_list.
        prosthetic_share: of the weight.
        com_height_m: centre of mass above the ground.
    """

    moments_nm: np.ndarray
    prosthetic_share: float
    com_height_m: float


@dataclass(frozen=True)
class Equilibrium:
    """An attitude (rad) that nothing needs to hold in the directions `free`, and how stiffly the feet keep it there.

    Attributes:
        tilt, list: of the pelvis. stable: whether the person returns to it.
        stiffness: (k, k) N m/rad in the directions of `free`; the feet's less the weight's.
    """

    tilt: float
    list: float
    free: tuple[str, ...]
    stiffness: np.ndarray

    @property
    def stable(self) -> bool:
        """Whether every small turn is righted."""
        return bool(np.linalg.eigvalsh(0.5 * (self.stiffness + self.stiffness.T)).min() > 0.0)


class Posture:
    """A subject with joints held at `angles` (rad by coordinate, 0 where not named), on both feet.

    Args:
        angles: may hold pelvis_tilt and pelvis_rotation; the pelvis's place and list are worked out here.

    Raises:
        InputError: `angles` names what the person does not have or holds no finite number; see also `Walker`.
    """

    def __init__(
        self, subject: Subject, model: ModelParameters, angles: Mapping[str, float], *, fulcrum_m: float
    ) -> None:
        self.walker = Walker(subject, model, free=TRANSLATIONS)
        self.fulcrum_m = fulcrum_m
        self.weight_n = subject.mass_kg * GRAVITY
        names = self.walker.gait.person.coordinate_names
        for name, value in angles.items():
            if name not in names:
                raise InputError("is not a coordinate of this person", where=f"angles[{name!r}]",
                                 right=f"Known are: {', '.join(names)}")
            if not np.isfinite(value):
                raise InputError(f"{value} is not a finite angle", where=f"angles[{name!r}]", right="Give radians")
        self.angles = {name: float(angles.get(name, 0.0)) for name in names if name not in TRANSLATIONS}

    def coordinates(self, tilt: float, list_: float) -> dict[str, float]:
        """Every anatomical coordinate; the lower sole's lowest point touches the ground, the pelvis is at x = y = 0."""
        q = {**dict.fromkeys(TRANSLATIONS, 0.0), **self.angles, "pelvis_tilt": tilt, "pelvis_list": list_}
        return {**q, "pelvis_ty": -min(self._sole_heights(q))}

    def level_list(self, tilt: float) -> float:
        """The list (rad) at which both unloaded soles touch the floor: 0 for legs of equal length.

        Raises:
            InputError: no list does.
        """
        def difference(list_: float) -> float:
            prosthetic, intact = self._sole_heights(self.coordinates(tilt, list_))
            return prosthetic - intact

        ends = -0.5, 0.5
        if difference(ends[0]) * difference(ends[1]) > 0.0:
            raise InputError("in this posture the two feet cannot stand on the ground together", where="angles",
                             right="Check the angles and the lengths of the two legs")
        exact = abs(difference(0.0)) < 1e-12
        return 0.0 if exact else float(brentq(difference, *ends, xtol=1e-12))

    def hold(self, tilt: float, list_: float) -> Hold:
        """Lets the person settle in height and socket with the pelvis held at an attitude."""
        walk = self._settle(tilt, list_)
        load, tree, plant = walk.record.load[-1], walk.mechanism.tree, self.walker.gait.plant
        up = walk.prosthetic.grf_W[-1, 2], walk.intact.grf_W[-1, 2]
        plant.SetPositions(walk.mechanism.context, walk.record.q[-1])
        height = plant.CalcCenterOfMassPositionInWorld(walk.mechanism.context)[2] - walk.mechanism.ground_height
        return Hold(moments_nm=np.array([load[tree.index(name)] for name in ROTATIONS[:2]]),
                    prosthetic_share=float(up[0] / max(sum(up), 1e-9)), com_height_m=float(height))

    def settled(self, tilt: float, list_: float) -> tuple[dict[str, float], float]:
        """Coordinates at rest under the load with the pelvis held at an attitude, and the largest speed left."""
        walk = self._settle(tilt, list_)
        q, tree = self.coordinates(tilt, list_), walk.mechanism.tree
        return {name: float(walk.record.q0[tree.index(name)]) for name in q}, walk.rest_speed

    def _settle(self, tilt: float, list_: float) -> Walk:
        return self.run(self.walker, self.coordinates(tilt, list_), duration_s=DEFAULT_STEP_S, settle=TRANSLATIONS)

    def run(
        self, walker: Walker, q: Mapping[str, float], *, duration_s: float, settle: tuple[str, ...] = (),
        step_s: float = DEFAULT_STEP_S, progress: Callable[[float], None] | None = None
    ) -> Walk:
        """`walker` let go at rest at the coordinates `q`; those in `settle` come to rest under the load before."""
        moments = np.linspace(0.0, max(duration_s, 1e-2), 8)
        still = CoordinateTrajectory(moments, np.tile([*q.values()], (len(moments), 1)), tuple(q))
        return walker.walk(still, fulcrum_m=self.fulcrum_m, start_s=0.0, end_s=duration_s, step_s=step_s,
                           initial={name: q[name] for name in settle}, progress=progress)

    def sideways_equilibrium(self, tilt: float) -> Equilibrium | None:
        """Balanced sideways with the tilt held: both feet loaded, stable if there is such, nearest to level."""
        level = self.level_list(tilt)
        found = []
        for list_ in self._zeros(lambda x: self.hold(tilt, x), 1, level):
            stiffness = self._stiffness(tilt, list_)[1:, 1:]
            found.append(Equilibrium(tilt=tilt, list=list_, free=("pelvis_list",), stiffness=stiffness))
        return min(found, key=lambda e: (not e.stable, abs(e.list - level)), default=None)

    def equilibrium(self, sideways: Equilibrium) -> Equilibrium | None:
        """Balanced in every direction, looked for from a sideways balance: stable if any is, else the nearest."""
        start, found = np.array([sideways.tilt, sideways.list]), []
        for tilt in self._zeros(lambda x: self.hold(x, sideways.list), 0, sideways.tilt):
            solved = root(lambda x: self.hold(*x).moments_nm / self.weight_n, [tilt, start[1]], options={"eps": 1e-5})
            exact = np.abs(solved.fun).max() < MOMENT_TOLERANCE
            near = np.abs(solved.x - start).max() < LARGEST_TURN_RAD
            if exact and near and _on_both_feet(self.hold(*solved.x)):
                found.append(Equilibrium(tilt=float(solved.x[0]), list=float(solved.x[1]), free=ROTATIONS[:2],
                                         stiffness=self._stiffness(*solved.x)))
        return min(found, key=lambda e: (not e.stable, abs(e.tilt - sideways.tilt)), default=None)

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
        for i in range(len(grid) - 1):
            if holds[i].moments_nm[row] * holds[i + 1].moments_nm[row] < 0.0:
                x = float(brentq(lambda x: hold(x).moments_nm[row], grid[i], grid[i + 1], xtol=1e-9))
                if _on_both_feet(hold(x)):
                    zeros.append(x)
        return zeros

    def _stiffness(self, tilt: float, list_: float, step: float = 1e-4) -> np.ndarray:
        turns = step * np.eye(2)
        at = np.array([tilt, list_])
        return np.column_stack([
            (self.hold(*(at + d)).moments_nm - self.hold(*(at - d)).moments_nm) / (2 * step) for d in turns])

    def _sole_heights(self, q: Mapping[str, float]) -> tuple[float, float]:
        """Heights (m) of the lowest points of the unloaded prosthetic and intact foot."""
        gait = self.walker.gait
        context = gait.plant.CreateDefaultContext()
        positions = np.zeros(gait.plant.num_positions())
        for name, value in q.items():
            positions[gait.plant.GetJointByName(name).position_start()] = value
        gait.plant.SetPositions(context, positions)
        lowest = []
        for foot in (gait.ground["prosthetic"].sites, gait.ground["intact"].sites):
            centres = [(gait.plant.get_body(BodyIndex(int(body))).EvalPoseInWorld(context) @ p)[2]
                       for body, p in zip(foot.body_indices, foot.p_BS, strict=True)]
            lowest.append(float(np.min(np.array(centres) - foot.radius)))
        return lowest[0], lowest[1]


def _on_both_feet(held: Hold) -> bool:
    return LEAST_SHARE < held.prosthetic_share < 1.0 - LEAST_SHARE


def _grid(centre: float) -> np.ndarray:
    count = round(2 * LARGEST_TURN_RAD / SEARCH_STEP_RAD) + 1
    return centre + np.linspace(-LARGEST_TURN_RAD, LARGEST_TURN_RAD, count)
