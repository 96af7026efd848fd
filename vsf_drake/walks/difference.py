"""Two sides held beside each other: walks of a setting each, over stance of the prosthetic foot,
and whether they differ by more than walks of one side do.

    difference  mean of B's walks less mean of A's
    spread      standard deviation between walks of one side, pooled over the sides
    half width  of the 95 % interval of the difference, by Student's t, for all numbers of the table
                together (Bonferroni): of eleven numbers one would else be beyond in every second
                comparison of walks that do not differ

The spread is from walk to walk; what differs from day to day is not in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.integrate import trapezoid

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.schema import from_plain
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import GRAVITY, ModelParameters, Subject
from vsf_drake.model.setting import AtSetting, setting_of
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory, low_pass, spacing
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.results import WalkResult
from vsf_drake.walks.answer import OTHER_SPEED, SEEN, AnsweringWalk, over_stance
from vsf_drake.walks.between_settings import half_width, settings_of, spread_of
from vsf_drake.walks.comparison import FORCE_CUTOFF_HZ, PERCENT
from vsf_drake.walks.quantities import quantities_of

DIFFERENCES = quantities_of("walks/differences.csv")
"""The numbers that are compared, in the table's order."""
LEAST_WALKS = 4
"""On both sides together, with which a difference is judged (a choice): of three, one degree of
freedom is left, and the interval of one number is 140 spreads wide."""
MOMENT = "moment_"  # before the name of a coordinate: the load of the driver on it
JOINTS = ("hip_flexion", "knee_angle", "ankle_angle")
FORCES = ("vertical", "fore_aft", "medio_lateral")


@dataclass(frozen=True, eq=False)
class Side:
    """Walks of one person at one setting, over stance."""

    name: str
    trials: tuple[Trial, ...]
    simulated: bool
    share: np.ndarray  # (s,) of stance
    walks: tuple[AnsweringWalk, ...]

    @property
    def subject(self) -> Subject:
        return self.trials[0].subject

    @property
    def fulcrum_m(self) -> float:
        return float(np.mean([walk.fulcrum_m for walk in self.walks]))

    @cached_property
    def curves(self) -> dict[str, np.ndarray]:
        """(walks, 101) at 0-100 % of stance: force in body weights (forward, up, to the body's
        midline +), `cop` fore-aft in m from where the pylon's end stands, joint angles of the
        `prosthetic` and the `intact` leg in degrees, the prosthetic leg's moments in N m/kg."""
        mass = self.subject.mass_kg
        right = self.subject.prosthetic_side == "right"
        plates = self._at_percent([walk.plate for walk in self.walks])
        force = plates[..., :3] / (mass * GRAVITY)
        found = dict(zip(FORCES, (force[..., 2], force[..., 0], force[..., 1]), strict=True))
        found["medio_lateral"] = found["medio_lateral"] if right else -found["medio_lateral"]
        found["cop"] = plates[..., 3]
        values = self._at_percent([walk.values for walk in self.walks])
        names = self.trials[0].trajectory.names
        for leg, end in (("prosthetic", "rl"[not right]), ("intact", "rl"[right])):
            for joint in JOINTS:
                for before, scale in (("", np.degrees(1.0)), (MOMENT, 1.0 / mass)):
                    name = f"{before}{joint}_{end}"
                    if name in names:
                        found[f"{leg}_{before}{joint}"] = scale * values[..., names.index(name)]
        return found

    @cached_property
    def numbers(self) -> dict[str, np.ndarray]:
        """(walks,) of those of `DIFFERENCES` that are known of every walk."""
        curves = self.curves
        early = PERCENT <= 50.0
        stance = np.array([walk.stance_s for walk in self.walks])
        forward = curves["fore_aft"]
        found = {
            "speed_m_per_s": np.array([walk.speed_m_per_s for walk in self.walks]),
            "stance_s": stance,
            "first_peak_bw": curves["vertical"][:, early].max(axis=1),
            "push_off_bw": curves["vertical"][:, ~early].max(axis=1),
            "braking_bws": stance * trapezoid(np.minimum(forward, 0.0), PERCENT / 100.0),
            "propulsion_bws": stance * trapezoid(np.maximum(forward, 0.0), PERCENT / 100.0),
            **{f"cop_{at}_m": curves["cop"][:, at] for at in (20, 50, 80)},
        }
        if "prosthetic_knee_angle" in curves:
            knee = curves["prosthetic_knee_angle"][:, early]
            found["knee_flexion_rad"] = np.radians(knee.max(axis=1))
        if "prosthetic_hip_flexion" in curves:
            found["hip_extension_rad"] = np.radians(curves["prosthetic_hip_flexion"].min(axis=1))
        return {name: own for name, own in found.items() if np.isfinite(own).all()}

    @property
    def typical(self) -> int:
        """The walk whose vertical force is nearest to the side's mean."""
        force = self.curves["vertical"]
        return int(np.argmin(np.linalg.norm(force - force.mean(axis=0), axis=1)))

    def _at_percent(self, told: Sequence[np.ndarray]) -> np.ndarray:
        """(walks, 101, k) of values (s, k) over the shares."""
        return np.array(
            [
                np.column_stack(
                    [np.interp(PERCENT / 100.0, self.share, column) for column in values.T]
                )
                for values in told
            ]
        )


@dataclass(frozen=True, kw_only=True)
class Difference:
    """One number of both sides, in SI units and body weights."""

    name: str  # of `DIFFERENCES`
    a: float
    b: float
    spread: float | None  # between walks of one side; None where no side has two
    half_width: float | None  # None with fewer walks than LEAST_WALKS

    @property
    def difference(self) -> float:
        return self.b - self.a

    @property
    def larger(self) -> bool | None:
        """Whether it is beyond what walks of one side make; None where no spread is known."""
        return None if self.half_width is None else abs(self.difference) > self.half_width


@dataclass(frozen=True, kw_only=True)
class SideTable(AtSetting):
    """A side in words."""

    name: str
    person: str
    prosthetic_side: str
    mass_kg: float
    simulated: bool
    synthetic: bool
    walks: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class DifferenceTable:
    """Two sides in numbers."""

    a: SideTable
    b: SideTable
    differences: tuple[Difference, ...]
    same_subject: bool
    force_bw: float
    """root mean square over stance of the difference of the mean force, of three components"""
    force_chance_bw: float | None
    """the same by chance, of so many walks with this spread that do not differ"""

    @property
    def force_larger(self) -> bool:
        """Whether the force over stance differs by more than chance makes, as an answer to the
        setting is judged."""
        return self.force_chance_bw is not None and self.force_bw > SEEN * self.force_chance_bw

    @property
    def larger(self) -> list[Difference]:
        """Those beyond the spread, largest first in half widths."""
        found = [one for one in self.differences if one.larger]
        return sorted(found, key=lambda one: -abs(one.difference) / (one.half_width or 1.0))


def side_of(name: str, trials: Sequence[Trial], *, simulated: bool = False) -> Side:
    """The walks of a side; InputError unless they are of one person on one foot at one setting,
    each with a whole stance on a plate."""
    first = trials[0]
    for trial in trials[1:]:
        require(
            trial.subject == first.subject,
            f"its subject is not that of {first.path.name}",
            "subject",
            "The walks of a side are one person's: give the two persons as A and B",
            file=trial.path,
        )
    feet = sorted({trial.setting.foot or "one with a fulcrum" for trial in trials})
    require(
        len(feet) == 1,
        f"holds walks on {len(feet)} feet ({', '.join(feet)})",
        right="Name one foot behind the folder: FOLDER@NAME, or FOLDER@108 of a fulcrum",
        file=name,
    )
    settings = settings_of(np.array([trial.fulcrum_m for trial in trials]))
    if len(settings) > 1:
        means = [1e3 * np.mean([trials[i].fulcrum_m for i in own]) for own in settings]
        raise InputError(
            f"holds walks of {len(settings)} settings "
            f"({', '.join(f'{mm:.0f}' for mm in means)} mm)",
            file=name,
            right=f"Name the setting behind the folder, as in {name}@{means[0]:.0f}",
        )
    share, walks = over_stance(trials, first.trajectory.names)
    return Side(name, tuple(trials), simulated, share, walks)


def trial_of(result: WalkResult, folder: Path) -> Trial:
    """A saved walk as a trial: the model's motion, its force on the prosthetic foot as the plate,
    and the driver's loads among the coordinates, under their names after MOMENT."""
    loads = low_pass(
        result.generalized_force,
        rate_hz=1.0 / spacing(result.time_s),
        cutoff_hz=FORCE_CUTOFF_HZ,
    )
    end = f"_{result.side[0]}"
    moved = [
        k
        for k, name in enumerate(result.coordinate_names)
        if name in result.prescribed_names and name.removesuffix(end) in JOINTS
    ]
    names = (*result.coordinate_names, *(f"{MOMENT}{result.coordinate_names[k]}" for k in moved))
    plate = PlateRecording(
        result.time_s, result.grf_W, result.cop_W, result.free_moment_nm, has_cop=True
    )
    parts = result.parameters
    return Trial(
        path=folder,
        name=result.trial_name,
        subject=from_plain(Subject, parts["subject"]),
        synthetic=result.synthetic,
        fulcrum_m=float(result.fulcrum_m.mean()),
        start_s=float(result.time_s[0]),
        end_s=float(result.time_s[-1]),
        trajectory=CoordinateTrajectory(
            result.time_s, np.hstack([result.q, loads[:, moved]]), names, source=str(folder)
        ),
        plates={result.side: plate},
        notes=result.notes,
        model=from_plain(ModelParameters, parts["model"]),
        inputs={},
        offsets=from_plain(GeometricOffsets, parts["offsets"]),
    )


def difference_of(a: Side, b: Side) -> DifferenceTable:
    """The numbers of both sides; InputError where a walk is on both."""
    for trial in b.trials:
        require(
            not any(
                trial.path.resolve() == other.path.resolve()
                or (trial.inputs and [*trial.inputs.values()] == [*other.inputs.values()])
                for other in a.trials
            ),
            "is on both sides",
            right="Name two walks, or two settings, that are not the same",
            file=trial.path,
        )
    sides = np.repeat([0.0, 1.0], [len(a.walks), len(b.walks)])
    shares = np.repeat([-1.0 / len(a.walks), 1.0 / len(b.walks)], [len(a.walks), len(b.walks)])
    own = {
        name: np.concatenate([a.numbers[name], b.numbers[name]])
        for name in DIFFERENCES
        if name in a.numbers and name in b.numbers
    }
    differences = []
    for name, values in own.items():
        spread = spread_of(sides, values)
        differences.append(
            Difference(
                name=name,
                a=float(a.numbers[name].mean()),
                b=float(b.numbers[name].mean()),
                spread=None if spread is None else float(spread),
                half_width=None
                if spread is None or len(sides) < LEAST_WALKS
                else half_width(sides, float(spread), shares, covered=1.0 - 0.05 / len(own)),
            )
        )
    force_a, force_b = (np.stack([side.curves[name] for name in FORCES], -1) for side in (a, b))
    apart = force_b.mean(axis=0) - force_a.mean(axis=0)
    within = spread_of(sides, np.concatenate([force_a, force_b]))
    return DifferenceTable(
        a=_told(a),
        b=_told(b),
        differences=tuple(differences),
        same_subject=a.subject == b.subject,
        force_bw=float(np.sqrt(np.mean(np.sum(apart**2, axis=-1)))),
        force_chance_bw=None
        if within is None
        else float(np.sqrt(np.mean(np.sum(within**2, axis=-1))) * np.linalg.norm(shares)),
    )


def difference_sentences(table: DifferenceTable) -> list[str]:
    """The verdict first, then what is to be known of it."""
    (speeds,) = ((one.a, one.b) for one in table.differences if one.name == "speed_m_per_s")
    return say(
        "difference",
        t=table,
        quantities=DIFFERENCES,
        speeds=speeds,
        other_speed=abs(speeds[1] - speeds[0]) > OTHER_SPEED * float(np.mean(speeds)),
    )


def _told(side: Side) -> SideTable:
    return SideTable(
        name=side.name,
        person=side.subject.name,
        prosthetic_side=side.subject.prosthetic_side,
        mass_kg=side.subject.mass_kg,
        **vars(setting_of(side.trials[0].model.foot, side.fulcrum_m)),
        simulated=side.simulated,
        synthetic=any(trial.synthetic for trial in side.trials),
        walks=tuple(walk.label for walk in side.walks),
    )
