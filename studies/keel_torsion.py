"""Whether a keel that twists and bends sideways would bring the model nearer to force plates.

The model's keel bends in one plane. The keels of the synthetic persons A, B and C twist on six
hinges; the reference subject's does not. Two walks of each that no fit saw, at 66 and 151 mm:

`closed_form` has what the model's own ground forces would do to its keel, a leaf of one section
with a laminate's shear modulus: `twist_deg` of the toe, held at A alone, which is more than with
the fulcrum's help; `yaw_deg` and `sideways_mm` of the toe by bending sideways, a cantilever from A.
Largest over the walk.

`twisting` has what twisting does to the true foot on the true motion: walks of it with a keel that
twists and with one that cannot (the reference subject's keel is the second). `soft` has the same
with a shear modulus lowered in the ratio in which the keel's effective bending modulus is below the
laminate's; `step` has twisting in half the steps, which is what such a difference is worth.
`on_edge` has what twisting changes in a foot mounted inverted and everted by 5 degrees, the larger
of each quantity. `inverted` has what 1 degree of inversion of the whole foot does in the fitted
model.

`error` has the fitted model against the recorded plate; `with_torsion` the same after the true
foot's `twisting` is added to the model, which is as much as a perfect model of torsion could give.
Beside them stand the fitted model with its friction chosen anew for the free moment of the two
fitted walks (`friction`), the mean free moment of those (`constant`, without any model), and the
true foot on the recorded motion, wrong in what is drawn for each trial anew alone (`own_floor`).

All are root mean squares over stance: forces in body weights, centre of pressure in mm, free moment
in N m about the vertical through it; forces at 40 Hz, the others at 6 Hz (walks/comparison.py).
Results in studies/results/keel_torsion.json; some ten minutes, most of it for making the walks.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any

if __name__ == "__main__":  # sums in the same order whatever the machine has free
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from contact_fit_study.cases import PAIR
from contact_fit_study.keeping import made_by
from floor_of_the_reference_subject import RESULTS, SEED, hashes
from make_reference_subject import DATA as REFERENCE
from make_reference_subject import STEPS, walk_trial
from make_sessions import DATA, EMBEDDED, SPEEDS, draws, moving, persons, session
from session_fit import Case, solution_at
from virtual_laboratory.design import Design, KeelDesign
from virtual_laboratory.floor import VirtualWalk, without_shared_errors
from virtual_laboratory.keel import torsional_stiffness
from virtual_laboratory.motion import COORDINATES, Person
from virtual_laboratory.polish import FORCE_HZ, shank_poses
from virtual_laboratory.prosthesis import STEP_S, prosthesis_of
from virtual_laboratory.recording import in_radians
from virtual_laboratory.session import session_tier

from vsf_drake.base.files import plain, read_json, write_json
from vsf_drake.laws.beam import section_inertia
from vsf_drake.model.contact_file import FittedContact, load_contact
from vsf_drake.model.parameters import FootParameters
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import Walker
from vsf_drake.validation.walking_curves import walk_curves
from vsf_drake.walks.comparison import PERCENT, compare, r_squared, rmse
from vsf_drake.walks.embedded import embedded_contact

REFERENCE_SUBJECT = "reference"
PERSONS = (REFERENCE_SUBJECT, "a", "b", "c")
WALKS = ("low_2", "high_2")
SHEAR_MODULUS_PA = 3.8e9
"""Of E-glass in epoxy, 55 % glass: the plies of the course TMM4175 of NTNU Trondheim (N. P.
Vedvik); a laminate of plies at right angles has that of its plies. The virtual laboratory's keels
are drawn about 4.0 GPa."""
LAMINATE_PA = 18.6e9
"""In bending: McGeehan 2021 (doi 10.1115/1.4050456)."""
SOFTER = FootParameters().keel.flexural_modulus_pa / LAMINATE_PA
TWISTS = 6
INVERTED_RAD, EDGE_RAD = np.radians(1.0), np.radians(5.0)
FRICTION = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
THRESHOLD = (0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Factors on both coefficients of friction and on the speed at which the foot slips."""
MODEL_STEP_S = 1e-3
QUANTITIES = {
    "resultant": 1.0,
    "vertical": 1.0,
    "fore_aft": 1.0,
    "medio_lateral": 1.0,
    "cop": 1e3,
    "lateral_cop": 1e3,
    "free_moment": 1.0,
}
"""Scales to body weights, mm and N m."""
ASIDE = ("medio_lateral", "lateral_cop", "free_moment")
"""What changes its sign with the side of the prosthesis."""
TOLD = ("twisting", "soft", "on_edge", "error", "with_torsion", "friction", "constant", "own_floor")
Curves = dict[str, np.ndarray]
"""(2, 101) over stance by quantity: plate, walk."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class TrueWalk(VirtualWalk):
    """free_moment_nm: (n,) N m, NaN unloaded."""

    free_moment_nm: np.ndarray

    @property
    def plate(self) -> PlateRecording:
        """What an exact plate records of it."""
        moment = np.nan_to_num(self.free_moment_nm)
        return PlateRecording(self.time_s, self.grf_W, self.cop_W, moment, True)


def main() -> None:
    """Walks, prints a table and writes keel_torsion.json."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument(
        "--quick", action="store_true", help="the reference subject alone; needs --out"
    )
    parser.add_argument("--out", type=Path, help=f"folder; {RESULTS} unless --quick is given")
    arguments = parser.parse_args()
    if arguments.quick and not arguments.out:
        parser.error("a part of the study must not replace it: give --out")
    chosen = PERSONS[: 1 if arguments.quick else None]
    with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as pool:
        found = dict(zip(chosen, pool.map(study, chosen), strict=True))
    inputs: dict[str, str] = {}
    for person in chosen:
        for name in (*PAIR, *WALKS):
            inputs |= hashes(recorded(person, name))
    out = arguments.out or RESULTS
    out.mkdir(parents=True, exist_ok=True)
    content = {
        "synthetic": True,
        "definitions": __doc__,
        "keel": keel_numbers(),
        "persons": found,
        "provenance": {**provenance(inputs), "sources": made_by("keel_torsion.py")},
    }
    write_json(out / "keel_torsion.json", plain(content))
    for person, part in found.items():
        for name, walk in part["walks"].items():
            parts = [f"{key} {walk[key]['free_moment']:.2f}" for key in TOLD if key in walk]
            print(f"{person} {name}, free moment, N m: {', '.join(parts)}")


def study(person: str) -> dict[str, Any]:
    """All of one person."""
    contact = fitted_contact(person)
    pair = [recorded(person, name) for name in PAIR]
    fitted = [model_curves(trial, contact) for trial in pair]
    constant_nm = float(np.nanmean([curves["free_moment"][0] for curves in fitted]))
    rubbed = with_friction(contact, pair)
    return {
        "constant_nm": constant_nm,
        "friction": {
            name: value for name, value in rubbed.values.items() if name.startswith("friction.")
        },
        "walks": {name: of_walk(person, name, contact, rubbed, constant_nm) for name in WALKS},
    }


def of_walk(
    person: str, name: str, contact: FittedContact, rubbed: FittedContact, constant_nm: float
) -> dict[str, Any]:
    """One walk that no fit saw."""
    trial = recorded(person, name)
    foot = true_foot(person, name)
    rigid, twisting = foot.walk(twists=0), foot.walk(twists=TWISTS)
    change = stance_curves(twisting, rigid.plate)
    soft = foot.walk(twists=TWISTS, shear_modulus_pa=SOFTER * foot.design.keel.shear_modulus_pa)
    edges = [foot.on_edge(sign * EDGE_RAD) for sign in (-1.0, 1.0)]
    curves = model_curves(trial, contact)
    tilted = model_curves(trial, contact, inverted_rad=INVERTED_RAD)
    constant = np.array([curves["free_moment"][0], np.full(len(PERCENT), constant_nm)])
    found = {
        "fulcrum_mm": 1e3 * trial.fulcrum_m,
        "free_moment_sd_nm": float(np.nanstd(curves["free_moment"][0])),
        "closed_form": closed_form(model_walk(trial, contact)),
        "twisting": differences(change),
        "soft": differences(stance_curves(soft, rigid.plate)),
        "step": differences(stance_curves(foot.walk(0.5 * STEP_S, twists=TWISTS), twisting.plate)),
        "on_edge": {key: max(edge[key] for edge in edges) for key in edges[0]},
        "inverted": differences(
            {key: np.array([curves[key][1], tilted[key][1]]) for key in curves}
        ),
        "error": scored(curves),
        "friction": scored(model_curves(trial, rubbed)),
        "constant": scored({"free_moment": constant}),
        "own_floor": scored(stance_curves(foot.walk(motion=foot.wrong), foot.walk().plate)),
    }
    if person != REFERENCE_SUBJECT:
        left = trial.subject.prosthetic_side == "left"
        found["with_torsion"] = scored(
            {
                key: np.array([plate, model + (-1.0) ** (left and key in ASIDE) * by])
                for key, (plate, model) in curves.items()
                for by in [change[key][1] - change[key][0]]
            }
        )
    return found


# Closed form.


def leaf() -> KeelDesign:
    """The model's keel, of one section, as the laboratory describes keels."""
    keel = FootParameters().keel
    return KeelDesign(
        length_m=sum(keel.element_lengths_m),
        thickness_rear_m=keel.thickness_m,
        thickness_tip_m=keel.thickness_m,
        width_rear_m=keel.width_m,
        width_tip_m=keel.width_m,
        shear_modulus_pa=SHEAR_MODULUS_PA,
    )


def keel_numbers() -> dict[str, float]:
    """Stiffness (N m²) against twist, bending sideways and bending up, of the model's keel."""
    keel = FootParameters().keel
    return {
        "torsion_nm2": float(torsional_stiffness(leaf(), np.array(0.0))),
        "sideways_nm2": keel.flexural_modulus_pa * section_inertia(keel.thickness_m, keel.width_m),
        "bending_nm2": keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m),
        "shear_modulus_pa": SHEAR_MODULUS_PA,
        "softer": SOFTER,
    }


def closed_form(walk: WalkResult) -> dict[str, float]:
    """Largest twist, yaw and sideways deflection of the toe by the ground's forces ahead of the
    heel block, each at its sphere; the keel straight along the walk."""
    foot, stiffness = FootParameters(), keel_numbers()
    x = np.concatenate([zone.x_mm for zone in foot.zones]) * 1e-3
    y = np.concatenate([zone.y_mm for zone in foot.zones]) * 1e-3
    length = leaf().length_m
    on_keel = x > foot.keel.element_lengths_m[0]
    below = foot.foam_thickness_m + 0.5 * foot.keel.thickness_m
    force = np.where(on_keel, walk.sphere_normal_n, 0.0)
    aside = np.where(on_keel, walk.sphere_friction_W[:, :, 1], 0.0)
    # a torque at x twists the keel behind it, a force at x bends it there
    twist = (y * force + below * aside) @ x / stiffness["torsion_nm2"]
    yaw = aside @ x**2 / (2.0 * stiffness["sideways_nm2"])
    sideways = aside @ (x**2 * (3.0 * length - x)) / (6.0 * stiffness["sideways_nm2"])
    return {
        "twist_deg": float(np.degrees(np.max(np.abs(twist)))),
        "yaw_deg": float(np.degrees(np.max(np.abs(yaw)))),
        "sideways_mm": float(1e3 * np.max(np.abs(sideways))),
    }


# The true foot.


@dataclasses.dataclass(frozen=True)
class TrueFoot:
    """A true foot through one trial's window.

    Attributes:
        trial: as recorded.
        body: moves the shank. residual_length_m: of the limb, the model's where None.
        design: as it is.
        right, wrong: the true motion, and as recorded, wrong in what is drawn for each trial alone.
    """

    trial: Trial
    body: Person
    residual_length_m: float | None
    design: Design
    right: CoordinateTrajectory
    wrong: CoordinateTrajectory

    def walk(
        self,
        step_s: float = STEP_S,
        *,
        motion: CoordinateTrajectory | None = None,
        inverted_rad: float = 0.0,
        **keel: float,
    ) -> TrueWalk:
        """On the true motion, or another; the whole foot inverted by so much; the keel changed."""
        path = motion or self.right
        count = int((self.trial.end_s - self.trial.start_s) * FORCE_HZ + 1e-6) + 1
        instants = self.trial.start_s + np.arange(count) / FORCE_HZ
        poses = shank_poses(self.body, path.time_s, path.values, instants)
        subject = self.body.subject
        inversion_rad = inverted_rad + (subject.prosthesis_inversion_rad or 0.0)
        prosthesis = prosthesis_of(
            dataclasses.replace(subject, prosthesis_inversion_rad=inversion_rad),
            self.trial.fulcrum_m,
            design=dataclasses.replace(
                self.design, keel=dataclasses.replace(self.design.keel, **keel)
            ),
            residual_length=self.residual_length_m,
            step_s=step_s,
        )
        reaction = prosthesis.walk(instants, *poses)
        return TrueWalk(
            time_s=instants,
            grf_W=reaction.force,
            cop_W=reaction.cop,
            free_moment_nm=reaction.free_moment,
            trajectory=path,
            trial_name=self.trial.name,
            synthetic=True,
            subject_mass_kg=subject.mass_kg,
            foot_length_m=FootParameters().length_m,
            fulcrum_m=np.array([self.trial.fulcrum_m]),
            unconverged_steps=reaction.unconverged,
            wall_s=0.0,
        )

    def on_edge(self, inverted_rad: float) -> dict[str, float]:
        """What twisting changes in a foot that is inverted by so much."""
        rigid, twisting = (
            self.walk(twists=twists, inverted_rad=inverted_rad) for twists in (0, TWISTS)
        )
        return differences(stance_curves(twisting, rigid.plate))


def true_foot(person: str, name: str) -> TrueFoot:
    """Walks of the sessions are made again as studies/make_sessions.py makes them."""
    trial = recorded(person, name)
    if person == REFERENCE_SUBJECT:
        exact = load_trial(REFERENCE / "exact" / f"{name}.yaml")
        return TrueFoot(
            trial,
            Person(exact.subject, exact.model),
            None,
            Design(),
            exact.trajectory.ordered(COORDINATES),
            without_shared_errors(trial, SEED),
        )
    true, body = persons()[person.upper()], moving(person.upper())
    every = draws(person.upper(), 1, EMBEDDED)
    (number,) = [i for i, draw in enumerate(every) if draw.name == name]
    made = walk_trial(body, true.prosthesis(every[number].fulcrum_m), every[number], STEPS)
    day, index = session(person.upper(), 1), (list(SPEEDS).index(EMBEDDED), number)
    tier = session_tier(made, day.of_trials_alone(), EMBEDDED, index)
    wrong = CoordinateTrajectory(made.time_s, in_radians(tier.coordinates), COORDINATES)
    return TrueFoot(trial, body, true.residual_length_m, true.foot, made.trajectory, wrong)


# The fitted model.


@cache
def recorded(person: str, name: str) -> Trial:
    """With the errors of recordings, as the fits see it."""
    if person == REFERENCE_SUBJECT:
        return load_trial(REFERENCE / "laboratory" / f"{name}.yaml")
    return load_trial(DATA / person / "day_1" / EMBEDDED / f"{name}.yaml")


@cache
def fitted_contact(person: str) -> FittedContact:
    """Fitted to PAIR: as shipped, and as session_fit.json has it."""
    if person == REFERENCE_SUBJECT:
        return load_contact(embedded_contact("laboratory"))
    case = Case(person, 1, PAIR)
    return solution_at(case, read_json(RESULTS / "session_fit.json")["cases"][case.name]).contact()


def model_walk(trial: Trial, contact: FittedContact, inverted_rad: float = 0.0) -> WalkResult:
    fitted = trial_with(trial, contact)
    offsets = dataclasses.replace(
        fitted.offsets, inversion_rad=fitted.offsets.inversion_rad + inverted_rad
    )
    walker = Walker(fitted.subject, fitted.model)
    walk = walker.walk_trial(fitted, step_s=MODEL_STEP_S, offsets=offsets)
    return walker.result(walk, fitted, offsets)


def model_curves(trial: Trial, contact: FittedContact, inverted_rad: float = 0.0) -> Curves:
    return stance_curves(model_walk(trial, contact, inverted_rad), trial.prosthetic_plate)


def with_friction(contact: FittedContact, trials: Sequence[Trial]) -> FittedContact:
    """The contact with the friction whose free moment on `trials` is nearest to their plates'."""
    tried = []
    for share, slower in product(FRICTION, THRESHOLD):
        values = dict(contact.values)
        for key in ("friction.mu_static", "friction.mu_kinetic"):
            values[key] *= share
        values["friction.threshold_velocity"] *= slower
        other = dataclasses.replace(contact, values=values)
        moments = [scored(model_curves(trial, other))["free_moment"] for trial in trials]
        tried.append((float(np.mean(np.square(moments))), other))
    return min(tried, key=lambda one: one[0])[1]


# Curves and scores.


def stance_curves(walk: WalkResult | TrueWalk, plate: PlateRecording) -> Curves:
    """Plate and walk over the whole stances, in the units of the walk's own axes."""
    comparison = compare(walk, plate)
    beside: Any = SimpleNamespace(
        comparison=comparison, result=walk, recorded=SimpleNamespace(prosthetic_plate=plate)
    )
    curves = walk_curves(beside)
    centres = np.array([[s.measured_cop, s.model_cop] for s in comparison.stances if s.inside])
    fore_aft, lateral = np.moveaxis(centres.mean(axis=0), 2, 0)
    return curves | {"cop": fore_aft, "lateral_cop": lateral}


def differences(curves: Curves) -> dict[str, float]:
    """Root mean square by quantity."""
    return {
        key: QUANTITIES[key] * rmse(*known(both))
        for key, both in curves.items()
        if key in QUANTITIES
    }


def scored(curves: Curves) -> dict[str, float]:
    """`differences`, and R² of the free moment."""
    plate, model = known(curves["free_moment"])
    return {**differences(curves), "free_moment_r2": r_squared(model, plate)}


def known(both: np.ndarray) -> np.ndarray:
    """(2, n) where both are."""
    return both[:, np.isfinite(both).all(axis=0)]


if __name__ == "__main__":
    main()
