"""A trial as it drives the model. Schema only; `motion.trial` and `motion.from_markers` make it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import yaml

from vsf_drake.errors import InputError
from vsf_drake.files import resource
from vsf_drake.model_file import load_model
from vsf_drake.motion.contacts import Contact
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.manifest import GeometricOffsets, load_manifest, named_file
from vsf_drake.motion.markers.schema import Calibration, TrackedMotion
from vsf_drake.motion.plates import PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.schema import load_yaml
from vsf_drake.yaml_file import read_yaml


@dataclass(frozen=True, eq=False)
class Trial:
    """One recording of somebody walking, ready to drive the model. SI and radians.

    Attributes:
        path: the manifest, or the recording where there is none.
        name: the manifest's `name`, or its file name without suffix.
        subject: the person.
        synthetic: whether the recording was constructed rather than measured.
        fulcrum_m: where the fulcrum stood, from the keel's posterior end A.
        start_s, end_s: the window: kinematics, forces and the manifest's wish all cover it.
        trajectory: the person's coordinates (see `motion.kinematics`), over the whole recording.
        plates: the force on each foot by "left" and "right", over the whole recording, in the world frame
            (x forward, y left, z up); the prosthetic side is always there, the other may be missing.
        notes: sentences on what was assumed, filled, turned or cut.
        model: the device's and the contact's parameters.
        inputs: SHA-256 of every file read, by its path as the manifest writes it.
        offsets: how the prosthesis sits under the person.
        unmeasured: by side, when the foot stands on ground that no plate measures, so that its force is unknown though
            `plates` says zero; known only of a trial from markers.
        recording, calibration, tracked, contacts: what a trial from markers was made of; None and () without them.
    """

    path: Path
    name: str
    subject: Subject
    synthetic: bool
    fulcrum_m: float
    start_s: float
    end_s: float
    trajectory: CoordinateTrajectory
    plates: dict[str, PlateRecording]
    notes: tuple[str, ...]
    model: ModelParameters
    inputs: dict[str, str]
    offsets: GeometricOffsets = GeometricOffsets()  # noqa: RUF009 (frozen: one default can serve all)
    unmeasured: dict[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    recording: Recording | None = None
    calibration: Calibration | None = None
    tracked: TrackedMotion | None = None
    contacts: tuple[Contact, ...] = ()

    @property
    def prosthetic_plate(self) -> PlateRecording:
        return self.plates[self.subject.prosthetic_side]


def default_model() -> ModelParameters:
    """The model of a manifest that names none: models/nominal.yaml, calibrated to the published bench end points."""
    return load_model(resource("models/nominal.yaml"))


# The person of a file: a subject's own, or that of a trial manifest.


def load_subject(path: str | Path) -> Subject:
    """Reads subject.yaml, or the subject that a trial manifest names (a file with the key `subject`).

    Raises:
        InputError: a file is missing or not what it should be; see `vsf_drake.schema.load_yaml`.
    """
    path = Path(path)
    if not _names_a_subject(path):
        return load_yaml(path, Subject)
    return load_yaml(named_file(path, "subject", load_manifest(path).subject), Subject)


def _names_a_subject(path: Path) -> bool:
    """Whether the file is a manifest. What cannot be read is left to `load_yaml`, which says why."""
    try:
        node = read_yaml(path)
    except InputError:
        return False
    return isinstance(node, yaml.MappingNode) and any(key.value == "subject" for key, _ in node.value)
