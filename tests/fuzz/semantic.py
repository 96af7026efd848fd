"""Fifty mistakes of meaning in what a laboratory gives, each made in three recordings: every file
can be read, a number in it means something else.

    python tests/fuzz/semantic.py [--all]      the table: refused, doubted or silent, and the
                                               consequence

A mistake is *refused* if the trial cannot be read, *doubted* if a check or the trial's mark is
worse than that of the right recording, else *silent*. Its consequence is what a user then believes
wrongly of the force on the prosthetic foot: root mean square over stance of the difference, all
three components, in body weights as told, of the prediction with the offsets fitted (`simulate
--fit-offsets`) or of the plate's force, whichever is larger.
"""

from __future__ import annotations

import copy
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from vsf_drake.base.errors import VsfError
from vsf_drake.base.files import resource
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.recording import MARKS
from vsf_drake.recording.examine import Examined, examine
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.offsets import fit_offsets

SILENT_BW = 0.05  # consequence above which a silent mistake counts
STEP_S = 2e-3
_POUND_KG, _FOOT_M = 0.45359237, 0.3048
ROOT = Path(__file__).resolve().parents[2]
_REFERENCE, _SESSIONS = "data/reference_subject", "data/sessions"


@dataclass
class Table:
    """A text table: lines above the numbers, labels, and (n, columns) numbers as the file has
    them."""

    head: list[str]
    labels: list[str]
    values: np.ndarray

    def column(self, name: str) -> int:
        return self.labels.index(name)

    def scale(self, part: str, factor: float) -> None:
        """Multiplies every column whose name contains `part`."""
        self.values[:, [part in label for label in self.labels]] *= factor

    def add(self, part: str, value: float) -> None:
        self.values[:, [part in label for label in self.labels]] += value


@dataclass
class Recording:
    """One trial as its files have it."""

    manifest: dict[str, Any]
    subject: dict[str, Any]
    motion: Table  # joint angles, or markers
    forces: Table
    standing: Table | None = None

    @property
    def plates(self) -> list[str]:
        return ["ground_force_r", "ground_force_l"]

    def write(self, folder: Path) -> Path:
        """Writes its files; the manifest's path."""
        markers = self.standing is not None
        suffix = ".trc" if markers else ".mot"
        manifest = self.manifest | {"subject": "subject.yaml"}
        manifest["markers" if markers else "kinematics"] = f"motion{suffix}"
        manifest["forces"] = {**self.manifest["forces"], "file": "forces.mot"}
        if self.standing is not None:
            manifest["standing"] = "standing.trc"
            _write(self.standing, folder / "standing.trc")
        _write(self.motion, folder / f"motion{suffix}")
        _write(self.forces, folder / "forces.mot")
        for name, content in (("subject.yaml", self.subject), ("trial.yaml", manifest)):
            (folder / name).write_text(yaml.safe_dump(content), encoding="utf-8")
        return folder / "trial.yaml"


def _write(table: Table, path: Path) -> None:
    head = [
        f"nRows={len(table.values)}" if line.startswith("nRows") else line for line in table.head
    ]
    if path.suffix == ".trc":
        labels = ["Frame#\tTime\t" + "\t\t\t".join(table.labels[2::3])]
        rows = "\n".join(
            "\t".join([f"{row[0]:.0f}", *(f"{x:.7g}" for x in row[1:])]) for row in table.values
        )
    else:
        labels = ["\t".join(table.labels)]
        rows = "\n".join("\t".join(f"{x:.8g}" for x in row) for row in table.values)
    path.write_text(
        "\n".join([*head, *labels, *([""] if path.suffix == ".trc" else []), rows, ""]),
        encoding="utf-8",
    )


@cache
def _read(path: Path) -> Table:
    lines = path.read_text(encoding="utf-8").splitlines()
    if path.suffix == ".trc":
        names = lines[3].split("\t")[2::3]
        labels = ["Frame#", "Time", *(name for name in filter(None, names) for _ in range(3))]
        return Table(
            lines[:3], labels, np.loadtxt(lines[6:], delimiter="\t", usecols=range(len(labels)))
        )
    at = lines.index("endheader") + 1
    return Table(lines[:at], lines[at].split("\t"), np.loadtxt(lines[at + 1 :]))


def recording(place: str) -> Recording:
    """The right recording that a manifest leads to: joint angles, or for `place` without one the
    reference markers."""
    path = ROOT / place
    manifest = yaml.safe_load(path.read_text(encoding="utf-8"))
    subject = yaml.safe_load((path.parent / manifest.pop("subject")).read_text(encoding="utf-8"))
    motion = path.parent / manifest.pop("kinematics")
    return copy.deepcopy(
        Recording(manifest, subject, _read(motion), _read(path.parent / manifest["forces"]["file"]))
    )


def from_markers(name: str) -> Recording:
    """The same from ideal markers of the reference subject."""
    made = recording(f"{_REFERENCE}/exact/{name}.yaml")
    made.motion = copy.deepcopy(_read(resource(f"{_REFERENCE}/markers/{name}.trc")))
    made.standing = copy.deepcopy(_read(resource(f"{_REFERENCE}/markers/static.trc")))
    made.manifest["already_filtered"] = True
    made.manifest.pop("window")
    return made


ANGLES = (
    f"{_REFERENCE}/exact/medium_1.yaml",
    f"{_REFERENCE}/laboratory/low_1.yaml",
    f"{_SESSIONS}/b/day_1/1p1/high_1.yaml",
)
MARKERS = ("low_1", "medium_1", "high_1")


# The mistakes: each changes a right recording in place.


def _angles(r: Recording) -> list[int]:
    return [
        i
        for i, name in enumerate(r.motion.labels)
        if name not in ("time", "pelvis_tx", "pelvis_ty", "pelvis_tz")
    ]


def _radians_as_degrees(r: Recording) -> None:
    r.motion.values[:, _angles(r)] = np.radians(r.motion.values[:, _angles(r)])


def _degrees_as_radians(r: Recording) -> None:
    r.motion.head = [line.replace("inDegrees=yes", "inDegrees=no") for line in r.motion.head]


def _pelvis_in(factor: float) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        for axis in "xyz":
            r.motion.scale(f"pelvis_t{axis}", factor)

    return wrong


def _forces(factor: float, parts: str = "v") -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        for part in parts.split():
            r.forces.scale(part, factor)

    return wrong


def _subject(**changes: Any) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        r.subject |= {key: change(r.subject[key]) for key, change in changes.items()}

    return wrong


def _sign(*names: str) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        for name in names:
            r.motion.scale(name, -1.0)

    return wrong


def _prosthetic(r: Recording) -> str:
    return str(r.subject["prosthetic_side"])[0]


def _late(seconds: float) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        r.forces.values[:, 0] += seconds

    return wrong


def _filtered(table: str, cutoff_hz: float) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        of = getattr(r, table)
        rate = 1.0 / float(np.median(np.diff(of.values[:, 0])))
        columns = [
            i for i, name in enumerate(of.labels) if i and (table == "motion" or "_v" in name)
        ]
        of.values[:, columns] = low_pass(of.values[:, columns], rate_hz=rate, cutoff_hz=cutoff_hz)

    return wrong


def _noisy(degrees: float) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        draw = np.random.default_rng(0)
        r.motion.values[:, _angles(r)] += draw.normal(
            0.0, degrees, (len(r.motion.values), len(_angles(r)))
        )

    return wrong


def _cop(forward_m: float, right_m: float) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        r.forces.add("_px", forward_m)
        r.forces.add("_pz", right_m)

    return wrong


def _turned(r: Recording) -> None:
    """A plate turned by 90 degrees: its x is the laboratory's z."""
    for stem in r.plates:
        x, z = (r.forces.column(f"{stem}_v{axis}") for axis in "xz")
        r.forces.values[:, [x, z]] = r.forces.values[:, [z, x]]


def _at_centre(r: Recording) -> None:
    for stem in r.plates:
        for axis in "xz":
            column = r.forces.column(f"{stem}_p{axis}")
            used = r.forces.values[:, column] != 0.0
            r.forces.values[used, column] = float(np.mean(r.forces.values[used, column]))


def _all_on_one(r: Recording) -> None:
    """The forces of both plates as one foot's, which the other has none of."""
    own, other = (
        f"ground_force_{side}" for side in (_prosthetic(r), "rl".replace(_prosthetic(r), ""))
    )
    for axis in "xyz":
        r.forces.values[:, r.forces.column(f"{own}_v{axis}")] += r.forces.values[
            :, r.forces.column(f"{other}_v{axis}")
        ]


def _fulcrum(change: Callable[[float], float]) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        r.manifest["prosthesis"] = {"fulcrum_mm": change(r.manifest["prosthesis"]["fulcrum_mm"])}

    return wrong


def _manifest(**changes: Any) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        r.manifest |= changes

    return wrong


def _other_side(side: str) -> str:
    return "left" if side == "right" else "right"


def _other_columns(r: Recording) -> None:
    other = {"_r": "_l", "_l": "_r"}
    r.motion.labels = [label[:-2] + other.get(label[-2:], label[-2:]) for label in r.motion.labels]


def _other_forces(r: Recording) -> None:
    """The forces of another walk of the same person and setting."""
    place = {
        "medium": f"{_REFERENCE}/exact/medium_2.yaml",
        "low": f"{_REFERENCE}/laboratory/low_2.yaml",
        "high": f"{_SESSIONS}/b/day_1/1p1/high_2.yaml",
    }
    [word] = [word for word in place if f"{word} stiffness" in r.manifest["name"]]
    r.forces = recording(place[word]).forces


def _marker(
    label: str, *shift_mm: float, standing: bool = True, walk: bool = True
) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        for table in (r.motion if walk else None, r.standing if standing else None):
            if table is not None:
                first = table.labels.index(label)
                table.values[:, first : first + 3] += shift_mm

    return wrong


def _marker_names(one: str, other: str) -> Callable[[Recording], None]:
    def wrong(r: Recording) -> None:
        r.motion.labels = [{one: other, other: one}.get(label, label) for label in r.motion.labels]

    return wrong


def _standing_of_another(r: Recording) -> None:
    assert r.standing is not None
    r.standing.values[:, 2:] *= 0.93


HIP_ROTATIONS = ("hip_rotation_r", "hip_rotation_l")
MISTAKES: dict[str, Callable[[Recording], None]] = {
    "units: angles in radians, header says degrees": _radians_as_degrees,
    "units: angles in degrees, header says radians": _degrees_as_radians,
    "units: pelvis in mm": _pelvis_in(1e3),
    "units: pelvis in feet": _pelvis_in(1.0 / _FOOT_M),
    "units: forces in kN": _forces(1e-3),
    "units: forces in kgf": _forces(1.0 / GRAVITY),
    "units: forces in lbf": _forces(1.0 / (_POUND_KG * GRAVITY)),
    "units: centre of pressure in cm": _forces(100.0, "_px _pz"),
    "units: moments in N mm": _forces(1e3, "torque"),
    "units: mass in pounds": _subject(mass_kg=lambda kg: kg / _POUND_KG),
    "units: stature in feet": _subject(stature_m=lambda m: m / _FOOT_M),
    "signs: hip flexion": _sign("hip_flexion"),
    "signs: knee flexion": _sign("knee_angle"),
    "signs: ankle": _sign("ankle_angle"),
    "signs: hip adduction, both sides": _sign("hip_adduction"),
    "signs: hip rotation, both sides": _sign(*HIP_ROTATIONS),
    "signs: hip rotation, prosthetic side": lambda r: r.motion.scale(
        f"hip_rotation_{_prosthetic(r)}", -1.0
    ),
    "signs: knee rotation and adduction": _sign("knee_rotation", "knee_adduction"),
    "signs: pelvic tilt": _sign("pelvis_tilt"),
    "signs: pelvic list": _sign("pelvis_list"),
    "signs: pelvic rotation": _sign("pelvis_rotation"),
    "signs: vertical force": _forces(-1.0, "vy"),
    "signs: fore-aft force": _forces(-1.0, "vx"),
    "signs: sideways force": _forces(-1.0, "vz"),
    "signs: centre of pressure, sideways": _forces(-1.0, "pz"),
    "sides: columns of the angles": _other_columns,
    "sides: feet of the plates": lambda r: r.manifest["forces"].update(
        right="ground_force_l", left="ground_force_r"
    ),
    "sides: prosthetic side": _subject(prosthetic_side=_other_side),
    "times: forces 20 ms late": _late(0.020),
    "times: forces 60 ms early": _late(-0.060),
    "times: angles at half their rate": lambda r: r.motion.values.__setitem__(
        (slice(None), 0), 2.0 * r.motion.values[:, 0]
    ),
    "filters: angles again at 3 Hz": _filtered("motion", 3.0),
    "filters: forces at 3 Hz": _filtered("forces", 3.0),
    "filters: angles with 1 degree of noise": _noisy(1.0),
    "plates: centre of pressure 30 mm forward": _cop(0.030, 0.0),
    "plates: centre of pressure 100 mm to the right": _cop(0.0, 0.100),
    "plates: gain 10 % too high": _forces(1.1),
    "plates: turned by 90 degrees": _turned,
    "plates: centre of pressure at the plate's centre": _at_centre,
    "plates: both feet on one": _all_on_one,
    "subject: mass 20 % too low": _subject(mass_kg=lambda kg: 0.8 * kg),
    "subject: the other sex": _subject(sex=lambda sex: "female" if sex == "male" else "male"),
    "manifest: fulcrum counted from the other end": _fulcrum(
        lambda mm: 217.0 - mm if mm != 108 else 151.0
    ),
    "manifest: forces of another walk": _other_forces,
}
MARKER_MISTAKES: dict[str, Callable[[Recording], None]] = {
    "markers: left and right": lambda r: setattr(
        r.motion,
        "labels",
        [
            label[0].translate(str.maketrans("RL", "LR")) + label[1:]
            if label[1:2].isupper()
            else label
            for label in r.motion.labels
        ],
    ),
    "markers: heel and toe of the prosthetic foot": _marker_names("RCAL", "RTOE"),
    "markers: standing trial of a shorter person": _standing_of_another,
    "markers: lateral knee marker 30 mm forward, standing only": _marker(
        "RLFC", 30.0, 0.0, 0.0, walk=False
    ),
    "markers: front pelvis marker 40 mm low": _marker("RASI", 0.0, -40.0, 0.0),
    "markers: laboratory 15 mm too low": lambda r: r.motion.values.__setitem__(
        (slice(None), slice(3, None, 3)), r.motion.values[:, 3::3] - 15.0
    ),
}


# What becomes of them.


@dataclass(frozen=True)
class Outcome:
    """One mistake in one recording."""

    mistake: str
    recording: str
    answer: str  # "refused", "doubted" or "silent"
    because: str
    consequence_bw: float | None  # None where it was not measured, or nothing came out


def _examined(path: Path) -> Examined:
    return examine(load_trial(path))


def answer(
    wrong: Callable[[Recording], None], made: Recording, right: Examined, folder: Path
) -> tuple[str, str, Trial | None]:
    """What becomes of a mistake in a recording that is examined as `right`, why, and the trial that
    came of it."""
    with np.errstate(all="ignore"):
        wrong(made)
    try:
        found = _examined(made.write(folder))
    except VsfError as error:
        return "refused", str(error).rpartition("trial.yaml: ")[2][:120], None
    because = _doubts(found, right)
    return "doubted" if because else "silent", because, found.trial


class Right:
    """A right recording: what is found of it, and the force that is predicted from it and
    measured."""

    def __init__(self, made: Recording, folder: Path) -> None:
        self.examined = _examined(made.write(folder))
        trial = self.examined.trial
        self.time_s = np.arange(trial.start_s, trial.end_s, STEP_S)
        self.scored = _measured(trial, self.time_s)[:, 2] * trial.subject.mass_kg * GRAVITY > 20.0

    @cached_property
    def predicted_bw(self) -> np.ndarray:
        return _predicted(self.examined.trial, self.time_s)

    def consequence_bw(self, trial: Trial) -> float | None:
        """Of what became of it by a mistake; None where nothing can be predicted."""
        try:
            predicted = _predicted(trial, self.time_s)
        except VsfError:
            return None
        pairs = (
            (predicted, self.predicted_bw),
            (_measured(trial, self.time_s), _measured(self.examined.trial, self.time_s)),
        )
        return max(
            float(np.sqrt(np.mean(np.sum((one - other)[self.scored] ** 2, axis=1))))
            for one, other in pairs
        )


def _predicted(trial: Trial, time_s: np.ndarray) -> np.ndarray:
    """(n, 3) BW on the prosthetic foot once the offsets are fitted."""
    walker = Walker(trial.subject, trial.model)
    offsets = fit_offsets(trial, walker=walker).offsets
    walk = walker.walk(
        trial.trajectory,
        fulcrum_m=trial.fulcrum_m,
        start_s=trial.start_s,
        end_s=trial.end_s,
        step_s=STEP_S,
        offsets=offsets,
    )
    return _in_bw(
        walker.result(walk, trial, offsets, energy=False).time_s,
        walk.prosthetic.grf_W,
        trial,
        time_s,
    )


def _in_bw(own_s: np.ndarray, force: np.ndarray, trial: Trial, time_s: np.ndarray) -> np.ndarray:
    weight = trial.subject.mass_kg * GRAVITY
    return np.column_stack([np.interp(time_s, own_s, column) for column in force.T]) / weight


def _measured(trial: Trial, time_s: np.ndarray) -> np.ndarray:
    plate = trial.prosthetic_plate
    return _in_bw(plate.time_s, plate.force_W, trial, time_s)


def _doubts(found: Examined, right: Examined) -> str:
    """Names of checks that are worse than those of the right recording; the trial's mark where only
    that is."""
    before: dict[tuple[str, str | None], int] = {}
    for check in right.checks:
        key = check.name, check.side
        before[key] = max(before.get(key, 0), MARKS.index(check.mark))
    worse = dict.fromkeys(
        check.name
        for check in found.checks
        if MARKS.index(check.mark) > before.get((check.name, check.side), 0)
    )
    if not worse and MARKS.index(found.mark) > MARKS.index(right.mark):
        worse = {f"{found.mark}, {100 * found.expected_error_bw:.0f} % BW": None}
    return ", ".join(worse)


def outcomes(*, every: bool = False) -> Iterator[Outcome]:
    """All mistakes in all recordings; consequences of the silent ones, or of `every` one that is
    not refused."""
    pairs = [
        (MISTAKES, [lambda place=place: recording(place) for place in ANGLES]),
        (MARKER_MISTAKES, [lambda name=name: from_markers(name) for name in MARKERS]),
    ]
    with tempfile.TemporaryDirectory() as folder:
        for mistakes, makers in pairs:
            for make in makers:
                right = Right(make(), Path(folder))
                for mistake, wrong in mistakes.items():
                    said, because, trial = answer(wrong, make(), right.examined, Path(folder))
                    told = said == "silent" or every
                    yield Outcome(
                        mistake,
                        right.examined.trial.name,
                        said,
                        because,
                        right.consequence_bw(trial) if told and trial is not None else None,
                    )


def main() -> None:
    """Prints the table."""
    for one in outcomes(every="--all" in sys.argv):
        bw = "" if one.consequence_bw is None else f"{100 * one.consequence_bw:.1f} %"
        print(
            f"{one.answer:8} {bw:>8}  {one.mistake}  [{one.recording}]  {one.because}", flush=True
        )


if __name__ == "__main__":
    main()
