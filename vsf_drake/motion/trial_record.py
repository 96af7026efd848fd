"""A trial as it drives the model (made by `motion.trial`): its record, its window, its person's mass by the plates."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import yaml

from vsf_drake.errors import InputError
from vsf_drake.files import resource
from vsf_drake.model_file import load_model
from vsf_drake.motion.contacts import Assignment, PlateContact
from vsf_drake.motion.events import MINIMUM_S, Span, Stance, common, find_scuffs, find_stances, words
from vsf_drake.motion.formats.recording import PlateRecording, Recording
from vsf_drake.motion.manifest import GeometricOffsets, Window, load_manifest, named_file
from vsf_drake.motion.markers.person_facts import LEAST_MASS_KG, MOST_MASS_KG
from vsf_drake.motion.markers.segments import Calibration, TrackedMotion
from vsf_drake.motion.opensim import LIGHTEST_BW
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import GRAVITY, ModelParameters, Subject
from vsf_drake.schema import load_yaml
from vsf_drake.sentences import say
from vsf_drake.yaml_file import read_yaml

LONGEST_STRIDE_S = 2.5
CONTRADICTED = (0.52, 1.25)
"""Share of a stated mass that plates may carry. More: over a step vertical momentum returns but for some 6 % of the
weight (0.3 m/s in half a second), plates are gauged to a few percent, shoes and a bag weigh 10 % (a choice). Less: a
harness or a rail may bear up to half of the weight; pounds taken for kilograms leave 0.45."""
POUND_KG, LIKE_POUNDS = 0.45359237, 0.1  # what a pound is, and how near to it a ratio suggests pounds


@dataclass(frozen=True, eq=False)
class Trial:
    """One recording of somebody walking, ready to drive the model. SI and radians."""

    path: Path  # the manifest, or the recording where there is none
    name: str  # as the manifest says, or its file's name without suffix
    subject: Subject
    synthetic: bool  # constructed rather than measured
    fulcrum_m: float  # where the fulcrum stood, from the keel's posterior end A
    start_s: float  # the window: kinematics, forces and the manifest's request all cover it
    end_s: float
    trajectory: CoordinateTrajectory  # see `motion.opensim`; over the whole recording
    plates: dict[str, PlateRecording]  # by side, over the whole recording; the prosthetic side is always there
    notes: tuple[str, ...]  # sentences on what was assumed, filled, turned or cut
    model: ModelParameters
    inputs: dict[str, str]  # SHA-256 of every file read, by its path as the manifest writes it
    offsets: GeometricOffsets = GeometricOffsets()  # noqa: RUF009 (frozen: one default can serve all)
    unmeasured: dict[str, tuple[Span, ...]] = field(default_factory=dict)
    """By side, when the foot stands on ground that no plate measures, so that its force is unknown though `plates` says
    zero; known only of a trial from markers."""
    recording: Recording | None = None  # this and the rest: what a trial from markers was made of
    calibration: Calibration | None = None
    tracked: TrackedMotion | None = None
    contacts: tuple[PlateContact, ...] = ()

    @property
    def prosthetic_plate(self) -> PlateRecording:
        return self.plates[self.subject.prosthetic_side]


def default_model() -> ModelParameters:
    """The model of a manifest that names none: models/nominal.yaml, calibrated to the published bench end points."""
    return load_model(resource("models/nominal.yaml"))


def load_subject(path: str | Path) -> Subject:
    """Reads subject.yaml, or the subject that a trial manifest names (a file with the key `subject`)."""
    path = Path(path)
    try:
        node = read_yaml(path)
    except InputError:  # `load_yaml` says why
        node = None
    if isinstance(node, yaml.MappingNode) and any(key.value == "subject" for key, _ in node.value):
        path = named_file(path, "subject", load_manifest(path).subject)
    return load_yaml(path, Subject)


# Body mass from the force plates of a walk.


def mass_from_walk(walk: Recording, assignment: Assignment) -> tuple[float, list[str]]:
    """Mean vertical force of both feet over a stride, in kg, and a note that says so.

    Over a stride the body's vertical momentum returns, so the mean force is the weight. Only strides, from one strike
    of a foot on a plate to its next, in which both feet stand on plates throughout, count; the mean of all is taken.
    """
    time = walk.force_time_s
    vertical = np.sum([plate.force_W[:, 2] for plate in assignment.plates.values()], axis=0)
    strikes = {side: [c.start_s for c in assignment.contacts if c.side == side and c.start_seen]
               for side in assignment.plates}
    strides = [(start, end) for strikes_of_foot in strikes.values() for start, end in pairwise(strikes_of_foot)
               if end - start < LONGEST_STRIDE_S and _measured((start, end), assignment.unmeasured)]
    if len(assignment.plates) < 2 or not strides:
        what = "the body mass is not stated, and there is no stride in which both feet stand on plates throughout"
    else:
        mass = float(np.mean([float(np.mean(vertical[(time >= a) & (time < b)])) for a, b in strides])) / GRAVITY
        if LEAST_MASS_KG <= mass <= MOST_MASS_KG:
            return mass, say("trial", "mass", mass_kg=mass, strides=strides)
        what = f"the plates carry {mass * GRAVITY:.0f} N over a stride, which is nobody's weight"
    raise InputError(what, file=walk.force_path or walk.path, where="mass_kg (--mass-kg)",
                     right="State the body mass, prosthesis included")


def check_mass(trial: Trial, *, file: str | Path | None) -> None:
    """Refuses a body mass that the plates contradict: mean vertical force over weight is outside CONTRADICTED.

    They tell it over steps: from the strike of one foot to that of the other, each time with the other foot on its
    plate, so that they carry the body throughout. Where there is no such step, any mass passes.
    """
    stances = {side: find_stances(plate.time_s, plate.force_W[:, 2]) for side, plate in trial.plates.items()}
    strikes = sorted((s.start_s, side) for side, carried in stances.items() for s in carried if s.start_seen)
    steps = [(start, end) for (start, first), (end, second) in pairwise(strikes)
             if first != second and _measured((start, end), trial.unmeasured)
             and all(any(s.start_s <= at <= s.end_s for s in stances[side]) for side, at in
                     ((second, start), (first, end)))]
    if not steps:
        return
    duration = sum(end - start for start, end in steps)
    force = sum(float(np.mean(plate.force_W[(plate.time_s >= start) & (plate.time_s < end), 2])) * (end - start)
                for plate in trial.plates.values() for start, end in steps) / duration
    carried, stated = force / GRAVITY, trial.subject.mass_kg
    if not CONTRADICTED[0] <= carried / stated <= CONTRADICTED[1]:
        pounds = abs(stated * POUND_KG / carried - 1.0) < LIKE_POUNDS
        raise InputError(
            f"the plates contradict a mass of {stated:g} kg: over {duration:.2f} s in which they carry both feet, the "
            f"mean vertical force is the weight of {carried:.1f} kg", file=file, where="mass_kg",
            right=f"Is it in pounds? {stated:g} lb are {stated * POUND_KG:.1f} kg" if pounds else
                  "Give the mass in kg, prosthesis included, or check the unit of the forces")


def _measured(span: Span, unmeasured: dict[str, tuple[Span, ...]]) -> bool:
    return not any(common(span, other) for spans in unmeasured.values() for other in spans)


# The part of a recording to simulate, where kinematics, forces and manifest overlap; a treadmill's belt.


DEFAULT_STANCE_S = 0.5
MINIMUM_LOAD_N = 200.0
BACKWARD_M_PER_S = -0.3


def trial_window(
    path: Path, requested: Window | None, trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording],
    subject: Subject, unmeasured: Mapping[str, Sequence[Span]] | None = None
) -> tuple[Span, list[str]]:
    """The window of a trial (s), and notes on it and on the stances in it; `path` is the manifest, for messages.

    `unmeasured` is when, by side, a foot stands on ground that no plate measures: a model's force there would be
    compared with zero. Without a requested window, the stretch between those of the prosthetic foot that holds most of
    its stances is taken; a requested one is kept. Refused where window, kinematics and forces do not overlap, or the
    prosthetic foot has hardly any load or less than 0.15 s of a stance, or the window is shorter than the shortest
    complete stance.
    """
    side = subject.prosthetic_side
    plate, stances = plates[side], {s: find_stances(one.time_s, one.force_W[:, 2]) for s, one in plates.items()}
    record = float(plate.time_s[0]), float(plate.time_s[-1])
    window, notes = _choose_window(requested, (trajectory.start_s, trajectory.end_s), record, path,
                                   (unmeasured or {}).get(side, ()), stances[side])
    _check_stances(window, plate, stances[side], side, subject.mass_kg, path)
    for s in sorted(plates, key=lambda s: s != side):
        in_window = [((c.start_s, c.end_s), [end for end, seen in (
            ("start", c.start_seen and c.start_s >= window[0]), ("end", c.end_seen and c.end_s <= window[1]))
            if not seen]) for c in stances[s] if common((c.start_s, c.end_s), window)]
        scuffs = [(c.start_s, c.end_s) for c in find_scuffs(plates[s].time_s, plates[s].force_W[:, 2])]
        notes += say("trial", "foot", side=s, prosthetic=s == side, stances=in_window,
                     scuffs=[scuff for scuff in scuffs if common(scuff, window)])
    at = (plate.time_s >= window[0]) & (plate.time_s <= window[1]) & (plate.force_W[:, 2] > MINIMUM_LOAD_N)
    at[1:] &= at[:-1]
    if plate.has_cop and at.sum() >= 3:  # runs backward under the foot as on a moving belt?
        speed = float(np.median(np.gradient(plate.cop_W[at, 0], plate.time_s[at])))
        notes += say("trial", "treadmill", speed=speed) if speed <= BACKWARD_M_PER_S else []
    return window, notes


def _choose_window(requested: Window | None, kinematics: Span, forces: Span, file: Path, unmeasured: Sequence[Span],
                   stances: Sequence[Stance]) -> tuple[Span, list[str]]:
    span = (kinematics[0] if requested is None or requested.start_s is None else requested.start_s,
            kinematics[1] if requested is None or requested.end_s is None else requested.end_s)
    part = common(span, kinematics)
    if part is None:
        raise InputError(f"the window of {words(span)} and the kinematics of {words(kinematics)} do not overlap",
                         file=file, where="window")
    both = common(part, forces)
    if both is None:
        raise InputError(f"the forces of {words(forces)} and the window of {words(part)} do not overlap",
                         file=file, where="window" if requested else "forces",
                         right="Do both recordings count time from the same instant?")
    notes = []
    for cut, whole, to in ((part, span, "kinematics"), (both, part, "force record")):
        if max(abs(cut[0] - whole[0]), abs(cut[1] - whole[1])) > 1e-3 and (requested or to != "kinematics"):
            notes += say("trial", "cut", whole=whole, part=cut, to=to)
    missed = sorted(span for span in unmeasured if common(span, both))
    if not missed:
        return both, notes

    def held(span: Span) -> float:
        return sum(max(0.0, min(s.end_s, span[1]) - max(s.start_s, span[0])) for s in stances)

    ends = [both[0], *(end for span in missed for end in span), both[1]]
    between = [(start, end) for start, end in zip(ends[::2], ends[1::2], strict=True) if end > start]
    best = max(between, key=lambda span: (held(span), span[1] - span[0]), default=None)
    if requested is not None or best is None or held(best) < MINIMUM_S:
        best = None
    return best or both, notes + say("trial", "unmeasured", window=both, best=best, missed=missed)


def _check_stances(window: Span, plate: PlateRecording, stances: Sequence[Stance], side: str, mass_kg: float,
                   file: Path) -> None:
    peak, weight = float(plate.force_W[:, 2].max()), mass_kg * GRAVITY
    if not stances:
        raise InputError(f"the {side} (prosthetic) foot has no stance: its largest vertical force is {peak:.3g} N",
                         file=file, where="forces")
    if peak < LIGHTEST_BW * weight:
        raise InputError(f"the {side} (prosthetic) foot is never loaded by more than {peak:.3g} N, {peak / weight:.2f} "
                         f"times the body weight", file=file, where="forces",
                         right="Check the unit of the forces and the subject's mass_kg")
    listed = f"The stances of the {side} foot are {', '.join(words((s.start_s, s.end_s)) for s in stances)}"
    shortest = min((s.duration_s for s in stances if s.complete), default=DEFAULT_STANCE_S)
    if window[1] - window[0] < shortest:
        raise InputError(f"the trial of {words(window)} is shorter than one stance ({shortest:.3f} s)",
                         file=file, where="window", right=listed)
    if max(min(s.end_s, window[1]) - max(s.start_s, window[0]) for s in stances) < MINIMUM_S:
        raise InputError(f"the {side} (prosthetic) foot carries no load from {words(window)}",
                         file=file, where="window", right=listed)


def on_the_belt(
    trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording], *, speed_m_per_s: float
) -> tuple[CoordinateTrajectory, dict[str, PlateRecording], list[str]]:
    """A treadmill recording seen from its belt, where the ground stands still, and a note that says so.

    Only the pelvis's forward position and the centres of pressure change, by speed (+ when the belt runs backward,
    against W's x) times time. Forces are the same in both frames, since neither accelerates.
    """
    if speed_m_per_s == 0.0:
        return trajectory, plates, []
    values = np.array(trajectory.values)
    values[:, trajectory.names.index("pelvis_tx")] += speed_m_per_s * trajectory.time_s
    moved = CoordinateTrajectory(trajectory.time_s, values, trajectory.names, source=trajectory.source)
    carried = {side: dataclasses.replace(plate, cop_W=plate.cop_W + np.outer(speed_m_per_s * plate.time_s, [1, 0, 0]))
               for side, plate in plates.items()}
    return moved, carried, say("trial", "belt", speed=speed_m_per_s)
