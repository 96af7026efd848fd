"""A trial as it drives the model (made by `motion.trial`); its person, weighed by the plates."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import yaml

from vsf_drake.errors import InputError
from vsf_drake.files import resource
from vsf_drake.model_file import load_model
from vsf_drake.motion.contacts import Assignment, Contact
from vsf_drake.motion.events import Span, common, find_stances
from vsf_drake.motion.formats.recording import PlateRecording, Recording
from vsf_drake.motion.manifest import GeometricOffsets, load_manifest, named_file
from vsf_drake.motion.markers.person_facts import LEAST_MASS_KG, MOST_MASS_KG
from vsf_drake.motion.markers.schema import Calibration, TrackedMotion
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
    start_s: float  # the window: kinematics, forces and the manifest's wish all cover it
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
    contacts: tuple[Contact, ...] = ()

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
    Refused if there is no such stride, or the mass is nobody's.
    """
    time = walk.force_time_s
    vertical = sum(plate.force_W[:, 2] for plate in assignment.plates.values())
    strikes = {side: [c.start_s for c in assignment.contacts if c.side == side and c.start_seen]
               for side in assignment.plates}
    strides = [(start, end) for own in strikes.values() for start, end in pairwise(own)
               if end - start < LONGEST_STRIDE_S and _measured((start, end), assignment.unmeasured)]
    place = {"file": walk.force_path or walk.path, "where": "mass_kg (--mass-kg)",
             "right": "State the body mass, prosthesis included"}
    if len(assignment.plates) < 2 or not strides:
        raise InputError("the body mass is not stated, and there is no stride in which both feet stand on plates "
                         "throughout", **place)
    mass = float(np.mean([float(np.mean(vertical[(time >= a) & (time < b)])) for a, b in strides])) / GRAVITY
    if not LEAST_MASS_KG <= mass <= MOST_MASS_KG:
        raise InputError(f"the plates carry {mass * GRAVITY:.0f} N over a stride, which is nobody's weight", **place)
    return mass, say("trial", "mass", mass_kg=mass, strides=strides)


def check_mass(trial: Trial, *, file: str | Path | None) -> None:
    """Refuses a body mass that the plates contradict: mean vertical force over weight is outside CONTRADICTED.

    They tell it over steps: from the strike of one foot to that of the other, each time with the other foot on its
    plate, so that they carry the body throughout. Where there is no such step, any mass passes.
    """
    stances = {side: find_stances(plate.time_s, plate.force_W[:, 2]) for side, plate in trial.plates.items()}
    strikes = sorted((s.start_s, side) for side, found in stances.items() for s in found if s.start_seen)
    steps = [(start, end) for (start, first), (end, second) in pairwise(strikes)
             if first != second and _measured((start, end), trial.unmeasured)
             and all(any(s.start_s <= at <= s.end_s for s in stances[side]) for side, at in
                     ((second, start), (first, end)))]
    if not steps:
        return
    duration = sum(end - start for start, end in steps)
    force = sum(float(np.mean(plate.force_W[(plate.time_s >= start) & (plate.time_s < end), 2])) * (end - start)
                for plate in trial.plates.values() for start, end in steps) / duration
    found, stated = force / GRAVITY, trial.subject.mass_kg
    if not CONTRADICTED[0] <= found / stated <= CONTRADICTED[1]:
        pounds = abs(stated * POUND_KG / found - 1.0) < LIKE_POUNDS
        raise InputError(
            f"the plates contradict a mass of {stated:g} kg: over {duration:.2f} s in which they carry both feet, the "
            f"mean vertical force is the weight of {found:.1f} kg", file=file, where="mass_kg",
            right=f"Is it in pounds? {stated:g} lb are {stated * POUND_KG:.1f} kg" if pounds else
                  "Give the mass in kg, prosthesis included, or check the unit of the forces")


def _measured(span: Span, unmeasured: dict[str, tuple[Span, ...]]) -> bool:
    """Whether both feet are on plates or in the air throughout."""
    return not any(common(span, other) for spans in unmeasured.values() for other in spans)
