"""How a person answers the setting of the foot: recorded motion as a function of the fulcrum.

Every walk goes along W's x. Its motion is told over shares of stance, 0 at the prosthetic foot's
strike and 1 at lift-off, as far before and after as every walk was recorded: joint angles, the turn
of the pelvis, and the path of the pylon's end, which the contact feels to the millimetre. At a
setting each of these, and the time of stance, is the mean of the setting's walks; between two
settings it is linear over the fulcrum. The pelvis stands where the leg reaches that path: the mean
of two postures has another foot than the mean of the feet.

    answer    the outer settings' means, less each other, root mean square over stance
    spread    standard deviation between walks of one setting, pooled over settings, likewise

This interpolates. It knows nothing of how people adapt.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.sentences import say
from vsf_drake.model.model_file import check_movable
from vsf_drake.model.parameters import PELVIS_TRANSLATIONS
from vsf_drake.motion.events import Stance, known_stances
from vsf_drake.motion.formats.recording import PlateRecording, os_to_world, world_to_os
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.markers.joints import COORDINATES, coordinates_of, orientations_of
from vsf_drake.motion.trajectory import CoordinateTrajectory, columns_at, low_pass, spacing
from vsf_drake.motion.trial import Trial
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.walks.between_settings import between_settings, half_width, settings_of, spread_of
from vsf_drake.walks.comparison import FORCE_CUTOFF_HZ
from vsf_drake.walks.recorded_walk import labels_of

SPACING = 0.008  # of the instants, in stances: some 6 ms
MOST_BEFORE = 0.4
MOST_AFTER = 0.8
"""Stances before the strike and after lift-off that are told at most: a gait cycle and a little."""
FLAT = (0.2, 0.6)  # shares of stance in which the foot stands flat, where walks are laid together
LEG_ANGLES = tuple(
    f"{joint}_{side}"
    for side in "rl"
    for joint in (
        "hip_flexion",
        "hip_adduction",
        "hip_rotation",
        "knee_angle",
        "knee_adduction",
        "knee_rotation",
    )
)
"""By which an answer is judged: what is recorded of both legs in three dimensions."""
SEEN = 1.5  # times what chance makes, above which an answer is more than chance (a choice)
MIXED_SPEEDS = 0.15
OTHER_SPEED = 0.04
"""Shares of the mean speed: walks that differ from it by the first are of another speed (error),
settings whose means differ by the second answer speed too (sentence). Choices: a person's own walks
differ by 2 %, and 10 % of speed move joint angles as much as a setting does."""


@dataclass(frozen=True, eq=False)
class AnsweringWalk:
    """One recorded walk, over its stances."""

    label: str
    fulcrum_m: float
    stance_s: float
    speed_m_per_s: float
    values: np.ndarray
    """(n, m) coordinates at the shares of the answer, rad; in place of the pelvis's place that of
    the pylon's end, m, OpenSim's axes"""
    plate: np.ndarray
    """(n, 7) of the plate, in W's axes: force (3, N; zero but in stance), centre of pressure (3, m,
    from where the pylon's end stands; NaN unloaded) and free moment (N m)"""

    @property
    def force_n(self) -> np.ndarray:
        """(n, 3) of the plate: fore-aft, lateral, vertical."""
        return self.plate[:, :3]


@dataclass(frozen=True, kw_only=True)
class CoordinateAnswer:
    """What one coordinate does over stance, in degrees or mm."""

    name: str
    unit: str
    answer: float  # outer settings' means, less each other, root mean square
    spread: float | None  # between walks of one setting; None where none was walked twice
    bend: float | None
    """farthest that an inner setting's mean lies from the line through its neighbours, likewise;
    None without one"""


@dataclass(frozen=True, kw_only=True)
class AnswerTable:
    """An answer in numbers: by coordinate, and the root mean square over joint angles (degrees)."""

    settings_mm: tuple[float, ...]
    walks: tuple[str, ...]
    walks_mm: tuple[float, ...]
    speeds_m_per_s: tuple[float, ...]
    stances_s: tuple[float, ...]
    coordinates: tuple[CoordinateAnswer, ...]
    answer_deg: float
    spread_deg: float | None
    chance_deg: float | None
    """what the answer would be by chance, of walks with this spread that do not answer"""
    bend_deg: float | None
    from_share: float  # of stance: what was recorded of every walk
    to_share: float

    @property
    def larger_than_chance(self) -> bool | None:
        """Whether the setting is seen in the motion: the answer exceeds SEEN times what chance
        makes; None where no spread is known."""
        return None if self.chance_deg is None else self.answer_deg > SEEN * self.chance_deg


@dataclass(frozen=True, eq=False)
class Answer:
    """Walks of one person at two settings or more; see the module."""

    like: Trial  # whose person, device and contact all walks have
    names: tuple[str, ...]  # (m,) coordinates
    share: np.ndarray  # (n,) of stance
    walks: tuple[AnsweringWalk, ...]
    offsets: GeometricOffsets  # their mean

    @cached_property
    def fulcrum_m(self) -> np.ndarray:
        """(walks,) m from the keel's posterior end."""
        return np.array([walk.fulcrum_m for walk in self.walks])

    @cached_property
    def settings(self) -> list[np.ndarray]:
        """Indices of the walks of each setting, from the softest on."""
        return settings_of(self.fulcrum_m)

    @property
    def settings_m(self) -> np.ndarray:
        """(settings,) m."""
        return np.array([self.fulcrum_m[own].mean() for own in self.settings])

    @cached_property
    def values(self) -> np.ndarray:
        """(walks, n, m) as `AnsweringWalk.values`."""
        return np.array([walk.values for walk in self.walks])

    def at(self, fulcrum_m: float) -> np.ndarray:
        """(n, m) the same at a setting."""
        return between_settings(self.fulcrum_m, self.values, fulcrum_m)

    def spread_of(self, values: np.ndarray) -> np.ndarray | None:
        """`between_settings.spread_of` these walks."""
        return spread_of(self.fulcrum_m, values)

    def half_width(self, values: np.ndarray, fulcrum_m: float) -> float | None:
        """Of the 95 % interval of what one number of the walks (walks,) is at a setting, by their
        spread alone; None where no setting was walked twice."""
        spread = self.spread_of(values)
        if spread is None:
            return None
        shares = between_settings(self.fulcrum_m, np.eye(len(values)), fulcrum_m)
        return half_width(self.fulcrum_m, float(spread), shares)

    def stance_s(self, fulcrum_m: float) -> float:
        """The time of stance at a setting."""
        times = np.array([walk.stance_s for walk in self.walks])
        return float(between_settings(self.fulcrum_m, times, fulcrum_m))

    def trial_at(self, fulcrum_m: float) -> Trial:
        """The mean walk at a setting, strike at 0 s, without a plate; InputError outside of the
        recorded settings."""
        mm = 1e3 * fulcrum_m
        low, *_, high = 1e3 * self.settings_m
        require(
            low - 1e-6 <= mm <= high + 1e-6,
            f"{mm:g} mm lies outside of the recorded settings, {low:g} to {high:g} mm",
            "fulcrum_mm",
            "How a person goes on answering beyond them is not known: record a walk there",
        )
        return self._trial(f"{mm:g} mm", fulcrum_m, self.stance_s(fulcrum_m), self.at(fulcrum_m))

    def moved(self, i: int, fulcrum_m: float) -> Trial:
        """Recorded walk i as it would have been at a setting: it keeps by how much its motion, its
        times and its plate were off the mean of its own setting. At that, it is itself."""
        walk = self.walks[i]
        (own,) = (group for group in self.settings if i in group)
        plates = np.array([one.plate for one in self.walks])
        change = between_settings(self.fulcrum_m, plates, fulcrum_m) - plates[own].mean(axis=0)
        stances = [self.walks[k].stance_s for k in own]
        return self._trial(
            walk.label,
            fulcrum_m,
            walk.stance_s + self.stance_s(fulcrum_m) - float(np.mean(stances)),
            walk.values + self.at(fulcrum_m) - self.values[own].mean(axis=0),
            walk.plate + np.nan_to_num(change),
        )

    def _trial(
        self,
        name: str,
        fulcrum_m: float,
        stance_s: float,
        values: np.ndarray,
        plate: np.ndarray | None = None,
    ) -> Trial:
        values = standing_on(self.names, values, self.like)
        time_s = stance_s * self.share
        plates = {}
        if plate is not None:
            plates[self.like.subject.prosthetic_side] = PlateRecording(
                time_s=time_s,
                force_W=plate[:, :3],
                cop_W=plate[:, 3:6],
                free_moment_nm=plate[:, 6],
                has_cop=True,
            )
        return dataclasses.replace(
            self.like,
            name=name,
            fulcrum_m=fulcrum_m,
            start_s=float(time_s[0]),
            end_s=float(time_s[-1]),
            trajectory=CoordinateTrajectory(time_s, values, self.names, source="interpolated"),
            plates=plates,
            offsets=self.offsets,
            unmeasured={},
            judged=None,
        )

    def table(self) -> AnswerTable:
        """The answer in numbers."""
        stance = (self.share >= 0.0) & (self.share <= 1.0)
        values = self.values[:, stance]
        means = np.array([values[own].mean(axis=0) for own in self.settings])
        at = self.settings_m
        answer = _rms(means[-1] - means[0])
        each = self.spread_of(values)
        spread = None if each is None else _rms(each)
        bends = [
            _rms(
                means[k]
                - means[k - 1]
                - (at[k] - at[k - 1]) / (at[k + 1] - at[k - 1]) * (means[k + 1] - means[k - 1])
            )
            for k in range(1, len(at) - 1)
        ]
        bend = np.max(bends, axis=0) if bends else None
        angles = [self.names.index(name) for name in LEG_ANGLES if name in self.names]

        def degrees(found: np.ndarray | None) -> float | None:
            return None if found is None else float(np.degrees(_rms(found[angles])))

        spread_deg = degrees(spread)
        first, last = (len(self.settings[k]) for k in (0, -1))
        return AnswerTable(
            settings_mm=tuple((1e3 * at).tolist()),
            walks=tuple(walk.label for walk in self.walks),
            walks_mm=tuple((1e3 * self.fulcrum_m).tolist()),
            speeds_m_per_s=tuple(walk.speed_m_per_s for walk in self.walks),
            stances_s=tuple(walk.stance_s for walk in self.walks),
            coordinates=tuple(
                CoordinateAnswer(
                    name=_told(name),
                    unit=unit,
                    answer=float(factor * answer[k]),
                    spread=None if spread is None else float(factor * spread[k]),
                    bend=None if bend is None else float(factor * bend[k]),
                )
                for k, name in enumerate(self.names)
                for unit, factor in [_unit(name)]
            ),
            answer_deg=float(np.degrees(_rms(answer[angles]))),
            spread_deg=spread_deg,
            chance_deg=None
            if spread_deg is None
            else spread_deg * float(np.sqrt(1 / first + 1 / last)),
            bend_deg=degrees(bend),
            from_share=float(self.share[0]),
            to_share=float(self.share[-1]),
        )


def answer_of(trials: Sequence[Trial]) -> Answer:
    """How the person of these trials answers the setting; with the fitted contact applied, the
    motion is the corrected one.

    InputError: one walk, or one setting alone; other coordinates, another person or device; walks
    of different speeds; a trial without a plate, or without a whole stance with something recorded
    around it.
    """
    require(
        len(trials) > 1,
        "one walk tells nothing of how the person answers the setting",
        "trials",
        "Give walks at two settings or more, better two of each",
    )
    first = trials[0]
    for trial in trials[1:]:
        require(
            set(trial.trajectory.names) == set(first.trajectory.names),
            f"its coordinates are not those of {first.path.name}",
            "kinematics",
            "Walks that answer together must have been recorded alike",
            file=trial.path,
        )
        require(
            trial.subject == first.subject and trial.model == first.model,
            f"its subject or model is not that of {first.path.name}",
            "subject",
            "An answer is one person's on one foot, measured once",
            file=trial.path,
        )
    check_movable(first.model.foot, "How a person answers a setting needs a foot that has several")
    settings = settings_of(np.array([trial.fulcrum_m for trial in trials]))
    if len(settings) == 1:
        mm = sorted({round(1e3 * trial.fulcrum_m, 1) for trial in trials})
        raise InputError(
            f"all walks are of one setting ({', '.join(f'{at:g}' for at in mm)} mm; positions less "
            "than 5 mm apart are one: walks differ by more than such a step does)",
            where="prosthesis.fulcrum_mm",
            right="Give walks at two settings or more",
        )
    names = first.trajectory.names
    share, walks = over_stance(trials, names)
    speeds = np.array([walk.speed_m_per_s for walk in walks])
    far = int(np.argmax(np.abs(speeds - speeds.mean())))
    require(
        abs(speeds[far] / speeds.mean() - 1.0) <= MIXED_SPEEDS,
        f"it was walked at {speeds[far]:.2f} m/s, all on average at {speeds.mean():.2f}",
        "kinematics",
        "What speed does cannot be told from what the setting does: give walks of one speed",
        file=trials[far].path,
    )
    offsets = {
        name: float(np.mean([getattr(trial.offsets, name) for trial in trials]))
        for name in vars(first.offsets)
    }
    notes = dict.fromkeys(note for trial in trials for note in trial.notes)
    inputs = {
        f"{label}: {file}": digest
        for label, trial in zip(labels_of(trials), trials, strict=True)
        for file, digest in trial.inputs.items()
    }
    like = dataclasses.replace(
        first, notes=tuple(notes), inputs=inputs, synthetic=any(trial.synthetic for trial in trials)
    )
    return Answer(like, names, share, walks, GeometricOffsets(**offsets))


def over_stance(
    trials: Sequence[Trial], names: tuple[str, ...]
) -> tuple[np.ndarray, tuple[AnsweringWalk, ...]]:
    """Shares of stance (n,) that every trial has, and each over them with the coordinates `names`;
    InputError for one without a plate, or without a whole stance with something recorded around
    it."""
    share, stances = _covered(trials)
    return share, tuple(
        _walk(trial, label, own, names, share)
        for trial, label, own in zip(trials, labels_of(trials), stances, strict=True)
    )


def standing_on(names: tuple[str, ...], values: np.ndarray, like: Trial) -> np.ndarray:
    """(n, m) coordinates of `AnsweringWalk.values` with the pelvis where the leg of the trial's
    person reaches the pylon's end."""
    values = values.copy()
    place = [names.index(name) for name in PELVIS_TRANSLATIONS]
    path = os_to_world(values[:, place])
    values[:, place] = 0.0
    values[:, place] = world_to_os(path - _pylon_end(names, values, like))
    return values


def answer_sentences(table: AnswerTable) -> list[str]:
    """The answer in words, what is doubtful in it, and what it does not know."""
    walked = np.array(table.speeds_m_per_s)
    settings = settings_of(1e-3 * np.array(table.walks_mm))
    speeds = [float(walked[own].mean()) for own in settings]
    return say(
        "answer",
        t=table,
        speeds=speeds,
        other_speed=max(speeds) - min(speeds) > OTHER_SPEED * float(np.mean(speeds)),
        least=SEEN,
    )


def _rms(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def _unit(name: str) -> tuple[str, float]:
    return ("mm", 1e3) if name in PELVIS_TRANSLATIONS else ("deg", float(np.degrees(1.0)))


def _told(name: str) -> str:
    """What stands in the pelvis's columns is the place of the pylon's end."""
    return name.replace("pelvis_t", "pylon_end_t") if name in PELVIS_TRANSLATIONS else name


def _covered(trials: Sequence[Trial]) -> tuple[np.ndarray, list[list[Stance]]]:
    """Shares of stance (n,) that every trial has, and the stances of each that have them all."""
    rooms = []
    for trial in trials:
        require(
            trial.subject.prosthetic_side in trial.plates,
            "has no force of the prosthetic foot, which tells its stances",
            "forces",
            "Leave it out, or give the file of its force plates",
            file=trial.path,
        )
        own = [
            (stance, min(before, MOST_BEFORE), min(after, MOST_AFTER))
            for stance in known_stances(trial.prosthetic_plate)
            if stance.complete
            for before in [(stance.start_s - trial.start_s) / stance.duration_s]
            for after in [(trial.end_s - stance.end_s) / stance.duration_s]
            if before >= 0.0 and after >= 0.0
        ]
        require(
            own,
            "has no whole stance of the prosthetic foot on its plate within the window",
            "window",
            "Leave it out, or widen its window",
            file=trial.path,
        )
        rooms.append(own)
    best = [max(own, key=lambda room: room[1] + room[2]) for own in rooms]
    before = min(room[1] for room in best)
    after = min(room[2] for room in best)
    first = int(np.floor(before / SPACING + 1e-6))
    last = int(np.floor((1.0 + after) / SPACING + 1e-6))
    share = SPACING * np.arange(-first, last + 1)
    return share, [
        [stance for stance, early, late in own if early >= before and late >= after]
        for own in rooms
    ]


def _walk(
    trial: Trial,
    label: str,
    stances: Sequence[Stance],
    names: tuple[str, ...],
    share: np.ndarray,
) -> AnsweringWalk:
    motion = trial.trajectory.ordered(names)
    plate = trial.prosthetic_plate
    force = low_pass(plate.force_W, rate_hz=1.0 / spacing(plate.time_s), cutoff_hz=FORCE_CUTOFF_HZ)
    recorded = np.column_stack([force, plate.cop_W, plate.free_moment_nm])
    place = [names.index(name) for name in PELVIS_TRANSLATIONS]
    flat = (share >= FLAT[0]) & (share <= FLAT[1])
    told = []
    plates = []
    speeds = []
    for stance in stances:
        time_s = stance.start_s + share * stance.duration_s
        values, R_XW, travelled = _along_x(names, motion.sample(time_s)[0].copy())
        speeds.append(travelled / (time_s[-1] - time_s[0]))
        path = _pylon_end(names, values, trial)
        foot = path[flat].mean(axis=0) * [1.0, 1.0, 0.0]
        values[:, place] = world_to_os(path - foot)
        told.append(values)
        seen = columns_at(time_s, plate.time_s, recorded)
        seen[:, :3] = seen[:, :3] @ R_XW.T
        seen[:, 3:6] = seen[:, 3:6] @ R_XW.T - foot
        seen[(share < 0.0) | (share > 1.0)] = [0.0, 0.0, 0.0, np.nan, np.nan, np.nan, 0.0]
        plates.append(seen)
    return AnsweringWalk(
        label,
        trial.fulcrum_m,
        float(np.mean([stance.duration_s for stance in stances])),
        float(np.mean(speeds)),
        np.mean(told, axis=0),
        np.mean(plates, axis=0),
    )


def _whole(names: tuple[str, ...], values: np.ndarray) -> np.ndarray:
    """(n, 24) of all `COORDINATES`; what was not recorded is zero."""
    found = np.zeros((len(values), len(COORDINATES)))
    known = [k for k, name in enumerate(names) if name in COORDINATES]
    found[:, [COORDINATES.index(names[k]) for k in known]] = values[:, known]
    return found


def _along_x(names: tuple[str, ...], values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The same motion (n, m) turned about the vertical so that the pelvis goes along W's x; that
    turn (3, 3), and how far it goes (m)."""
    R_W, p_W = orientations_of(_whole(names, values))
    way = p_W[-1] - p_W[0]
    far = float(np.hypot(way[0], way[1]))
    x, y = way[:2] / far
    R_XW = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])
    turned = coordinates_of({segment: R_XW @ R for segment, R in R_W.items()}, p_W @ R_XW.T)
    pelvis = [name for name in names if name.startswith("pelvis")]
    values[:, [names.index(name) for name in pelvis]] = turned[
        :, [COORDINATES.index(name) for name in pelvis]
    ]
    return values, R_XW, far


def _pylon_end(names: tuple[str, ...], values: np.ndarray, trial: Trial) -> np.ndarray:
    """(n, 3) m in W: the end of the prosthetic leg's pylon, of the trial's person."""
    side = trial.subject.prosthetic_side
    body = scale_body(trial.subject, trial.model.foot, trial.model.socket)
    lateral = body.hip_lateral if side == "left" else -body.hip_lateral
    R_W, p_W = orientations_of(_whole(names, values))
    return np.asarray(
        p_W
        + R_W["pelvis"] @ np.array([body.hip_forward, lateral, body.hip_up])
        - body.prosthetic_thigh_length * R_W[f"thigh_{side}"][:, :, 2]
        - (body.residual_length + body.pylon_length) * R_W[f"shank_{side}"][:, :, 2]
    )
