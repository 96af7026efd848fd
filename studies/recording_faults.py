"""Whether `vsf-drake check` ranks recordings as their faults do.

A walk of each setting of data/sessions that no fit saw is spoiled in one thing at a time, and in
two at once: forces, clock, angles, mass, the setting's name; and, for A and C, markers laid on the
recorded motion, which are then imported. `effect_bw` is by how much that changes the force that the
foot fitted to the person (studies/results/session_fit.json) predicts with its offsets fitted to the
spoiled plate; `true_bw` is that prediction's error against the plate as recorded. Both are of the
resultant, root mean square, in the body weights that are stated. `expected_bw` is what the checks
expect, the walk beside the other walks of its session; `share_bw` is what they say of the fault
itself: the largest cost among the checks that are to see it.

Sizes of costs (FITTED_..., ..._BW in vsf_drake/recording) were chosen on A and B; C judges,
though its walks as recorded were in view when the limits of a lag by events and of a setting were
set. `ranks` has Spearman's correlation of expected and true error over the pooled walks; the null
beside it is the number of doubts. In `shares` a fault is `right` where its share is within a factor
of two of its effect, both as means over the walks, or both are below LEVEL_BW. `together`
has the effect of two faults over the root of the sum of squares of each alone, which is how costs
are added, and over their sum. All walks are SYNTHETIC. Results in
studies/results/recording_faults.json; some ten minutes. `--judge-again` keeps effects and true
errors, which the checks do not change.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.keeping import made_by
from floor_of_the_reference_subject import RESULTS, hashes
from make_sessions import DATA, EMBEDDED
from session_fit import PAIR, Case, solution_at
from virtual_laboratory.markers import MARKER_HZ, follow, shortening, standing
from virtual_laboratory.motion import COORDINATES, Person
from virtual_laboratory.prosthesis import prosthesis_of

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import read_json, write_json
from vsf_drake.model.contact_file import FittedContact
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import find_stances, within
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.formats.recording import Plate, PlateRecording, Recording
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.markers.posture import MID_FULCRUM_M
from vsf_drake.motion.trajectory import CoordinateTrajectory, low_pass, spacing
from vsf_drake.motion.trial import Trial, default_model, load_trial, trial_from_recordings
from vsf_drake.recording import LEVEL_BW, costs, force_checks
from vsf_drake.recording.examine import Examined, examine, settings_compared
from vsf_drake.simulation.archive import provenance
from vsf_drake.walks.comparison import compare
from vsf_drake.walks.recorded_walk import STEP_S, walk_trial

WALKS = ("low_2", "medium_2", "high_2")
SESSION = tuple(f"{setting}_{number}" for setting in ("low", "medium", "high") for number in "123")
CHOSEN_BY, JUDGED = ("a", "b"), ("c",)
MARKED = ("a", "c")
"""Persons on whom markers are laid: their prosthesis is on the right, as the laboratory's is."""
CLEAN, CLEAN_MARKERS = "nothing", "nothing (markers)"
REFUSED = "refused"
NOISE_M = 2e-4
"""Of all markers, along each axis: a good camera system."""

Spoil = Callable[[Trial], Trial]
Places = dict[str, np.ndarray]
SpoilMarkers = Callable[[Places, Places], tuple[Places, Places]]


@dataclass(frozen=True)
class Fault:
    """What is done to a trial, or to the markers of the standing trial and the walk, and the names
    of the checks that are to see it."""

    seen_by: tuple[str, ...]
    spoil: Spoil | None = None
    spoil_markers: SpoilMarkers | None = None


# Forces and clock.


def prosthetic_plate(change: Callable[[PlateRecording], PlateRecording]) -> Spoil:
    def spoil(trial: Trial) -> Trial:
        side = trial.subject.prosthetic_side
        return dataclasses.replace(trial, plates={**trial.plates, side: change(trial.plates[side])})

    return spoil


def both_plates(change: Callable[[PlateRecording], PlateRecording]) -> Spoil:
    return lambda trial: dataclasses.replace(
        trial, plates={side: change(plate) for side, plate in trial.plates.items()}
    )


def offset(newton: float, *, drifts: bool = False) -> Spoil:
    """A vertical load that nobody makes, in the middle of the footprints; `drifts`: from none."""

    def change(plate: PlateRecording) -> PlateRecording:
        more = newton * (np.linspace(0.0, 1.0, len(plate.time_s)) if drifts else 1.0)
        force = plate.force_W + np.outer(more * np.ones(len(plate.time_s)), [0.0, 0.0, 1.0])
        middle = np.nanmean(plate.cop_W, axis=0)
        moved = plate.cop_W * plate.force_W[:, 2:] + middle * (force - plate.force_W)[:, 2:]
        loaded = force[:, 2:] > 20.0
        cop = np.divide(moved, force[:, 2:], out=np.full_like(moved, np.nan), where=loaded)
        return dataclasses.replace(plate, force_W=force, cop_W=cop)

    return prosthetic_plate(change)


def displaced_plate(x_m: float) -> Spoil:
    return prosthetic_plate(
        lambda plate: dataclasses.replace(plate, cop_W=plate.cop_W + np.array([x_m, 0.0, 0.0]))
    )


def turned_plate(degrees: float) -> Spoil:
    """Each footprint about its middle."""
    angle = np.radians(degrees)
    R = np.array(
        [[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0, 0, 1]]
    )

    def change(plate: PlateRecording) -> PlateRecording:
        cop = plate.cop_W.copy()
        for stance in find_stances(plate.time_s, plate.force_W[:, 2]):
            rows = within(plate.time_s, [stance.span])
            middle = np.nanmean(cop[rows], axis=0)
            cop[rows] = (cop[rows] - middle) @ R.T + middle
        return dataclasses.replace(plate, force_W=plate.force_W @ R.T, cop_W=cop)

    return prosthetic_plate(change)


def scaled(factor: float) -> Spoil:
    return both_plates(lambda plate: dataclasses.replace(plate, force_W=factor * plate.force_W))


def late(lag_s: float) -> Spoil:
    return both_plates(lambda plate: dataclasses.replace(plate, time_s=plate.time_s + lag_s))


# What is stated, and angles.


def mass(factor: float) -> Spoil:
    return lambda trial: dataclasses.replace(
        trial,
        subject=dataclasses.replace(trial.subject, mass_kg=factor * trial.subject.mass_kg),
    )


def named(fulcrum_mm: float) -> Spoil:
    return lambda trial: dataclasses.replace(trial, fulcrum_m=1e-3 * fulcrum_mm)


def another_setting(trial: Trial) -> Trial:
    """The middle one for an end, and the soft end for the middle."""
    return named(66.0 if trial.fulcrum_m == MID_FULCRUM_M else 1e3 * MID_FULCRUM_M)(trial)


def other_motion(trial: Trial, values: np.ndarray) -> Trial:
    motion = trial.trajectory
    return dataclasses.replace(
        trial,
        trajectory=CoordinateTrajectory(motion.time_s, values, motion.names, source=motion.source),
    )


def moved(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """A coordinate of the pelvis, or of the prosthetic leg."""

    def spoil(trial: Trial) -> Trial:
        own = name if name.startswith("pelvis") else f"{name}_{trial.subject.prosthetic_side[0]}"
        values = np.array(trial.trajectory.values)
        values[:, trial.trajectory.names.index(own)] += change(trial.trajectory.time_s)
        return other_motion(trial, values)

    return spoil


def wave(degrees: float, hz: float = 0.9) -> Callable[[np.ndarray], np.ndarray]:
    return lambda time_s: np.radians(degrees) * np.sin(2.0 * np.pi * hz * time_s)


def filtered(cutoff_hz: float) -> Spoil:
    return lambda trial: other_motion(
        trial,
        low_pass(
            trial.trajectory.values,
            rate_hz=1.0 / spacing(trial.trajectory.time_s),
            cutoff_hz=cutoff_hz,
        ),
    )


def both(*spoils: Spoil) -> Spoil:
    def spoil(trial: Trial) -> Trial:
        for one in spoils:
            trial = one(trial)
        return trial

    return spoil


# Markers.


def noise(metres: float) -> SpoilMarkers:
    def spoil(stand: Places, walk: Places) -> tuple[Places, Places]:
        rng = np.random.default_rng(1)
        return stand, {
            label: place + metres * rng.standard_normal(place.shape)
            for label, place in walk.items()
        }

    return spoil


def slips(labels: Sequence[str], down_m: float) -> SpoilMarkers:
    """Steadily over the walk."""

    def spoil(stand: Places, walk: Places) -> tuple[Places, Places]:
        down = np.outer(np.linspace(0.0, down_m, len(walk[labels[0]])), [0.0, 0.0, -1.0])
        return stand, walk | {label: walk[label] + down for label in labels}

    return spoil


def exchanged(one: str, other: str) -> SpoilMarkers:
    return lambda stand, walk: (stand, walk | {one: walk[other], other: walk[one]})


def gap(labels: Sequence[str], start_s: float, end_s: float) -> SpoilMarkers:
    def spoil(stand: Places, walk: Places) -> tuple[Places, Places]:
        hidden = {label: walk[label].copy() for label in labels}
        for place in hidden.values():
            place[round(start_s * MARKER_HZ) : round(end_s * MARKER_HZ)] = np.nan
        return stand, walk | hidden

    return spoil


def misplaced(places_m: Mapping[str, tuple[float, float, float]]) -> SpoilMarkers:
    """In the standing trial alone."""
    return lambda stand, walk: (
        stand | {label: stand[label] + by for label, by in places_m.items()},
        walk,
    )


ZERO = tuple(f"zero of the {side} foot's plate" for side in ("right", "left"))
MASS, LAG = "mass from the forces", "lag of the forces at touch-down"
SLIP, STRIKE = "slip at foot-flat", "centre of pressure at heel strike"
RESIDUALS, NOISE, FAR = "marker residuals", "filter applied before", "angles filtered away"
THIGH, SHANK = ("RTH1", "RTH2", "RTH3"), ("RTB1", "RTB2", "RTB3")
FAULTS = {
    CLEAN: Fault((), lambda trial: trial),
    "plate's offset 30 N": Fault(ZERO, offset(30.0)),
    "plate's offset -30 N": Fault(ZERO, offset(-30.0)),
    "plate's offset 60 N": Fault(ZERO, offset(60.0)),
    "plate drifts by 60 N": Fault(ZERO, offset(60.0, drifts=True)),
    "plate 10 mm ahead": Fault((STRIKE,), displaced_plate(0.010)),
    "plate 20 mm ahead": Fault((STRIKE,), displaced_plate(0.020)),
    "plate 20 mm behind": Fault((STRIKE,), displaced_plate(-0.020)),
    "plate turned by 5 degrees": Fault(
        (force_checks.SHEAR, "centre of pressure under the foot"), turned_plate(5.0)
    ),
    "forces 10 % small": Fault((MASS,), scaled(0.9)),
    "forces 5 % large": Fault((MASS,), scaled(1.05)),
    "forces 10 % large": Fault((MASS,), scaled(1.1)),
    "forces 20 ms late": Fault((LAG,), late(0.02)),
    "forces 40 ms late": Fault((LAG,), late(0.04)),
    "forces 40 ms early": Fault((LAG,), late(-0.04)),
    "mass 10 % small": Fault((MASS,), mass(0.9)),
    "mass 10 % large": Fault((MASS,), mass(1.1)),
    "another setting named": Fault((force_checks.BENDING,), another_setting),
    "slides 0.05 m/s": Fault((SLIP,), moved("pelvis_tx", lambda time_s: 0.05 * time_s)),
    "slides 0.1 m/s": Fault((SLIP,), moved("pelvis_tx", lambda time_s: 0.1 * time_s)),
    "slides 0.2 m/s": Fault((SLIP,), moved("pelvis_tx", lambda time_s: 0.2 * time_s)),
    "hip off by 2 degrees": Fault((SLIP,), moved("hip_flexion", wave(2.0))),
    "hip off by 4 degrees": Fault((SLIP,), moved("hip_flexion", wave(4.0))),
    "knee off by 4 degrees": Fault((SLIP,), moved("knee_angle", wave(4.0))),
    "filtered at 3 Hz": Fault((FAR,), filtered(3.0)),
    "filtered twice at 6 Hz": Fault((FAR,), filtered(6.0)),
    "rough hip": Fault(("smoothness of angles",), moved("hip_flexion", wave(0.7, 20.0))),
    CLEAN_MARKERS: Fault((), None, lambda stand, walk: (stand, walk)),
    "noise of 2 mm": Fault((NOISE,), None, noise(2e-3)),
    "noise of 5 mm": Fault((NOISE,), None, noise(5e-3)),
    "thigh's markers slip 40 mm": Fault((RESIDUALS,), None, slips(THIGH, 0.04)),
    "shank's markers slip 20 mm": Fault((RESIDUALS,), None, slips(SHANK, 0.02)),
    "pair exchanged": Fault((REFUSED,), None, exchanged("RTH1", "RTH3")),
    "gap of a cluster": Fault(("gaps filled",), None, gap(SHANK, 0.5, 0.8)),
    "gap of the heel": Fault(("gaps filled",), None, gap(("RCAL",), 0.5, 0.7)),
    "knee's axis turned": Fault(
        (RESIDUALS, "knee's axis"),
        None,
        misplaced({"RLFC": (0.02, 0.0, 0.0), "RMFC": (-0.02, 0.0, 0.0)}),
    ),
    "hip centre 15 mm ahead": Fault(
        (RESIDUALS,), None, misplaced({label: (0.015, 0.0, 0.0) for label in ("RASI", "LASI")})
    ),
}
PAIRS = (
    ("plate's offset 30 N", "slides 0.1 m/s"),
    ("mass 10 % large", "hip off by 2 degrees"),
    ("forces 40 ms late", "forces 10 % small"),
    ("filtered at 3 Hz", "plate's offset -30 N"),
    ("rough hip", "forces 10 % large"),
)


def with_pairs() -> dict[str, Fault]:
    """FAULTS, and two at once."""
    made = dict(FAULTS)
    for pair in PAIRS:
        one, other = (FAULTS[name] for name in pair)
        assert one.spoil is not None and other.spoil is not None
        made[" + ".join(pair)] = Fault((*one.seen_by, *other.seen_by), both(one.spoil, other.spoil))
    return made


# One walk with every fault.


def file_of(person: str, name: str) -> Path:
    return DATA / person / "day_1" / EMBEDDED / f"{name}.yaml"


@cache
def fitted_foot(person: str) -> FittedContact:
    """As session_fit.json has it."""
    case = Case(person, 1, PAIR)
    return solution_at(case, read_json(RESULTS / "session_fit.json")["cases"][case.name]).contact()


def marked(trial: Trial, spoil: SpoilMarkers) -> Trial:
    """The trial as an import makes it of markers on its motion; InputError as that raises it."""
    person = Person(trial.subject, default_model())
    motion = trial.trajectory
    time_s = np.arange(motion.time_s[0], motion.time_s[-1], 1.0 / MARKER_HZ)
    shorter_m = shortening(
        prosthesis_of(trial.subject, MID_FULCRUM_M), 0.5 * GRAVITY * trial.subject.mass_kg
    )
    rng = np.random.default_rng(0)
    seen = (
        {
            label: place + NOISE_M * rng.standard_normal(place.shape)
            for label, place in follow(person, q).items()
        }
        for q in (standing(person, shorter_m), motion.ordered(COORDINATES).sample(time_s)[0])
    )
    stand, walk = spoil(*seen)
    forces = trial.prosthetic_plate.time_s
    return dataclasses.replace(
        trial_from_recordings(
            Recording(Path("static.trc"), stand, MARKER_HZ),
            Recording(
                Path("walk.trc"),
                walk,
                MARKER_HZ,
                tuple(
                    Plate(side, plate.force_W, plate.cop_W, plate.free_moment_nm)
                    for side, plate in trial.plates.items()
                ),
                1.0 / spacing(forces),
                float(time_s[0]),
                float(forces[0]),
            ),
            None,
            PersonFacts(
                mass_kg=trial.subject.mass_kg,
                stature_m=trial.subject.stature_m,
                sex=trial.subject.sex,
                prosthetic_side=trial.subject.prosthetic_side,
            ),
            fulcrum_m=trial.fulcrum_m,
            standing_fulcrum_m=MID_FULCRUM_M,
        ),
        start_s=trial.start_s,
        end_s=trial.end_s,
    )


def made_of(trial: Trial, fault: Fault) -> Trial:
    if fault.spoil_markers is not None:
        return marked(trial, fault.spoil_markers)
    assert fault.spoil is not None
    return fault.spoil(trial)


def true_errors(
    task: tuple[str, str], labels: Sequence[str] = ()
) -> dict[str, dict[str, float | None]]:
    """By fault, all or those of these names: `true_bw` and `effect_bw` of a walk, None where an
    import refuses it."""
    person, name = task
    trial = load_trial(file_of(person, name))
    foot = fitted_foot(person)
    weight_n = trial.subject.mass_kg * GRAVITY
    plate = trial.prosthetic_plate
    found: dict[str, dict[str, float | None]] = {}
    clean: dict[bool, tuple[np.ndarray, np.ndarray]] = {}
    for label, fault in with_pairs().items():
        of_markers = fault.spoil is None
        if (of_markers and person not in MARKED) or (labels and label not in labels):
            continue
        try:
            if fault.spoil is None:
                spoiled = trial_with(made_of(trial, fault), foot)
            else:
                spoiled = fault.spoil(trial_with(trial, foot))
        except InputError:
            found[label] = {"true_bw": None, "effect_bw": None}
            continue
        walk, _ = walk_trial(spoiled, with_fit=True, step_s=STEP_S)
        c = compare(walk, plate)
        force = np.linalg.norm(c.model, axis=1) / (spoiled.subject.mass_kg * GRAVITY)
        recorded = np.linalg.norm(c.measured, axis=1) / weight_n
        here = (c.time_s[c.scored], force[c.scored])
        usual = clean.setdefault(of_markers, here)
        shared = usual[0][(usual[0] >= here[0][0]) & (usual[0] <= here[0][-1])]
        found[label] = {
            "true_bw": rms(here[1] - recorded[c.scored]),
            "effect_bw": rms(np.interp(shared, *here) - np.interp(shared, *usual)),
        }
    print(person, name, flush=True)
    return found


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


# What the checks say, and how right they are.


@cache
def session(person: str) -> dict[str, Examined]:
    """The walks as recorded, by name."""
    return {name: examine(load_trial(file_of(person, name))) for name in SESSION}


def judged(person: str, name: str, label: str) -> dict[str, Any]:
    """What the checks say of a spoiled walk beside the others of its session."""
    fault = with_pairs()[label]
    try:
        spoiled = examine(made_of(load_trial(file_of(person, name)), fault))
    except InputError as error:
        return {"mark": REFUSED, "said": str(error)}
    subject = spoiled.trial.subject
    others = [
        dataclasses.replace(one, trial=dataclasses.replace(one.trial, subject=subject))
        for other, one in session(person).items()
        if other != name
    ]
    item = settings_compared([spoiled, *others])[0]
    every = costs(item.checks)
    return {
        "mark": item.mark,
        "expected_bw": item.expected_error_bw,
        "doubts": len({check.name for check in item.checks if check.mark != "good"}),
        "verdict": item.verdict,
        "share_bw": max((every.get(name, 0.0) for name in fault.seen_by), default=0.0),
    }


def ranks(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Spearman's correlation with the true error, and that of the null."""
    known = [row for row in rows if row["true_bw"] is not None]
    true = [row["true_bw"] for row in known]
    marks = {row["mark"] for row in known}
    return {
        "walks": len(known),
        "expected": float(spearmanr([row["expected_bw"] for row in known], true)[0]),
        "number_of_doubts": float(spearmanr([row["doubts"] for row in known], true)[0]),
        "true_bw_by_mark": {
            mark: float(np.mean([row["true_bw"] for row in known if row["mark"] == mark]))
            for mark in sorted(marks)
        },
        "walks_by_mark": {
            mark: sum(row["mark"] == mark for row in known) for mark in sorted(marks)
        },
    }


def shares(rows: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """By single fault: mean effect and mean share, and whether one is the other within a factor of
    two or both are below LEVEL_BW."""
    told: dict[str, dict[str, Any]] = {}
    for label, fault in FAULTS.items():
        own = [row for row in rows if row["fault"] == label]
        if not own or label in (CLEAN, CLEAN_MARKERS):
            continue
        if fault.seen_by == (REFUSED,):
            told[label] = {"right": all(row["mark"] == REFUSED for row in own)}
            continue
        effect, share = (
            float(np.mean([row[key] for row in own])) for key in ("effect_bw", "share_bw")
        )
        told[label] = {
            "effect_bw": effect,
            "share_bw": share,
            "right": max(effect, share) < LEVEL_BW or 0.5 <= share / effect <= 2.0,
        }
    return told


def together(rows: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """By pair: the mean effect of both over that of squares added, and of sums."""
    effects = {(row["walk"], row["fault"]): row["effect_bw"] for row in rows}
    told = {}
    for pair in PAIRS:
        label = " + ".join(pair)
        ratios = [
            (
                effects[walk, label] / math.hypot(*(effects[walk, name] for name in pair)),
                effects[walk, label] / sum(effects[walk, name] for name in pair),
            )
            for walk, fault in effects
            if fault == label
        ]
        told[label] = dict(
            zip(("over_squares", "over_sum"), map(float, np.mean(ratios, axis=0)), strict=True)
        )
    return told


def main() -> None:
    """Spoils, walks and judges; prints a table and writes recording_faults.json."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help=f"folder to write to; {RESULTS} without --quick")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--quick", action="store_true", help="one walk of C; needs --out")
    parser.add_argument(
        "--judge-again", action="store_true", help="keep the true errors, judge anew"
    )
    arguments = parser.parse_args()
    if arguments.quick and not arguments.out:
        parser.error("a part of the walks must not replace them all: give --out")
    out = arguments.out or RESULTS
    out.mkdir(parents=True, exist_ok=True)
    path = out / "recording_faults.json"
    tasks = [(person, name) for person in (*CHOSEN_BY, *JUDGED) for name in WALKS]
    if arguments.quick:
        tasks = tasks[-1:]
    if arguments.judge_again:
        stored = read_json(path)["rows"]
        true = [
            {
                row["fault"]: {key: row[key] for key in ("true_bw", "effect_bw")}
                for row in stored
                if row["walk"] == f"{person}/{name}"
            }
            for person, name in tasks
        ]
    else:
        with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as pool:
            true = list(pool.map(true_errors, tasks))
    rows = [
        {"walk": f"{person}/{name}", "fault": label, **errors, **judged(person, name, label)}
        for (person, name), of_walk in zip(tasks, true, strict=True)
        for label, errors in of_walk.items()
    ]
    chosen = [row for row in rows if row["walk"][0] in CHOSEN_BY]
    of_c = [row for row in rows if row["walk"][0] in JUDGED]
    inputs: dict[str, str] = {}
    for person in (*CHOSEN_BY, *JUDGED):
        for item in session(person).values():
            inputs |= hashes(item.trial)
    write_json(
        path,
        {
            "synthetic": True,
            "definitions": __doc__,
            "ranks": {"chosen_by": ranks(chosen) if chosen else None, "judged": ranks(of_c)},
            "shares": shares(of_c),
            "together": together(of_c),
            "rows": rows,
            "provenance": {**provenance(inputs, 0), "sources": made_by("recording_faults.py")},
        },
    )
    for label, told in shares(of_c).items():
        print(label, told)
    print(ranks(of_c), together(of_c))


if __name__ == "__main__":
    main()
