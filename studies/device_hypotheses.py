"""Both explanations of the bench, models/nominal.yaml and models/soft_support.yaml, side by side.

Of each device:

    bench       stiffness above 200 N at 66 to 151 mm, beside what is published, the tuned joints of
                the GaitModel_VSF scripts for small loads and pressed from 200 to 600 N, the
                device's own closed form (an overhung beam, small loads) and its keel in 64 elements
    energy      strain of keel, support, foam and socket over a step, by part: embedded walks at
                three settings, the foot's place fitted to each plate; and what one of them stores
                with the fulcrum elsewhere, its load kept and its motion kept
    roll_over   radius and effective foot length under the loading profile of ISO 22675
    fit         the joint fit of one soft and one stiff walk with the bench, keel or support free;
                errors of all walks

The walks and the bench file of the fit are synthetic. The results are in
studies/results/device_hypotheses.json. The whole takes a minute.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import fsolve

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study import inputs
from contact_fit_study.cases import PAIR, TRIALS
from contact_fit_study.keeping import made_by
from floor_of_the_reference_subject import DATA, RESULTS, hashes

from vsf_drake.base.errors import FitError, SimulationError
from vsf_drake.base.files import resource, sha256, write_json
from vsf_drake.base.schema import to_plain
from vsf_drake.device.bench_metrics import (
    bench_table,
    closed_form_stiffness,
    tuned_joint_nm_per_rad,
)
from vsf_drake.device.roll_over import iso_roll_over
from vsf_drake.fit.assessment import assess
from vsf_drake.fit.options import ContactFitOptions
from vsf_drake.fit.problem import ContactFit
from vsf_drake.fit.solution import solve
from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import GRAVITY, FootParameters, ModelParameters
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trial import Trial
from vsf_drake.plants.foot import with_elements
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, run_bench
from vsf_drake.simulation.walk import Walker
from vsf_drake.validation.energy_section import EnergyCase, walk_cases
from vsf_drake.validation.roll_over_section import ISO_STEPS, QUICK_ISO_STEPS
from vsf_drake.walks.energy_ledger import FOOT_STRAINS, REMAINDER, prosthesis_energy, stance_energy
from vsf_drake.walks.offsets import fit_offsets

SOFT = "../../models/soft_support.yaml"
"""By its path in the reference subject's folder, as the nominal model."""
DEVICES = {"nominal": "keel.flexural_modulus", "soft_support": "fulcrum.stiffness"}
"""Model file -> what its fit frees."""
TIER, WALKED = "laboratory", ("low_1", "medium_1", "high_1")
POSITIONS_M = (*PUBLISHED_FULCRUMS_M[:-1], 0.150, PUBLISHED_FULCRUMS_M[-1])
ELEMENTS = 64
FINE_S, MOVED_S, SEARCH_S = 1.25e-4, 5e-4, 2e-3
"""Steps: of the walks by part, of those with the fulcrum elsewhere, of the search for the height
that keeps a load."""
STARTS, SEED = 3, 0


def main() -> None:
    """Does all of it for both devices, writes device_hypotheses.json, prints it in short."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument(
        "--quick", action="store_true", help="one walk in coarse steps, no fit; needs --out"
    )
    arguments = parser.parse_args()
    if arguments.quick and arguments.out == RESULTS:
        parser.error("a part of the study must not replace it all: give --out")
    devices = {}
    for name, freed in DEVICES.items():
        model = load_model(resource(f"models/{name}.yaml"))
        devices[name] = {
            "bench": bench(model, quick=arguments.quick),
            "energy": energy(model, quick=arguments.quick),
            "roll_over": roll_over(model.foot, quick=arguments.quick),
            "fit": None if arguments.quick else fit(model, freed),
        }
        tell(name, devices[name])
    files = {"bench.yaml": sha256(inputs.BENCH), SOFT: sha256(DATA / SOFT)}
    for name in TRIALS:
        files |= hashes(inputs.trial(TIER, name))
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_json(
        arguments.out / "device_hypotheses.json",
        {
            "synthetic": True,
            "tier": TIER,
            "devices": devices,
            "provenance": {**provenance(files, SEED), "sources": made_by("device_hypotheses.py")},
        },
    )


def tell(name: str, found: dict[str, Any]) -> None:
    """In short."""
    print(f"{name}: heel {found['bench']['heel_n_per_mm']:.1f} N/mm")
    for row in found["bench"]["settings"]:
        print(
            "  ".join(
                f"{key} {'-' if value is None else f'{value:.2f}'}" for key, value in row.items()
            )
        )
    for row in found["energy"]["walks"]:
        parts = ", ".join(f"{part} {joule:.1f}" for part, joule in row["largest_j"].items())
        print(
            f"{row['fulcrum_mm']:g} mm: stored {row['stored_j']:.1f} J, support "
            f"{100 * row['support_share']:.1f} %, ledger within "
            f"{100 * row['remainder_share']:.2f} %; largest {parts}"
        )
    if found["fit"]:
        print(
            {key: found["fit"].get(key) for key in ("failed", "freed", "fitted_bw", "held_out_bw")}
        )


# Bench.


def bench(model: ModelParameters, *, quick: bool) -> dict[str, Any]:
    """Stiffness (N/mm) by fulcrum position (mm), and of the heel."""
    foot, positions_m = model.foot, POSITIONS_M[::5] if quick else POSITIONS_M
    fine = dataclasses.replace(model, foot=with_elements(foot, ELEMENTS))
    own, finer = (bench_table(run_bench(one, fulcrums_m=positions_m)) for one in (model, fine))
    return {
        "heel_n_per_mm": own.heel_stiffness_n_per_mm,
        "settings": [
            {
                "fulcrum_mm": row.fulcrum_mm,
                "published": row.published_n_per_mm,
                "tuned_joints": row.tuned_joints_n_per_mm,
                "tuned_joints_pressed": row.tuned_joints_n_per_mm
                and 1e-3 * _pressed_joints(row.fulcrum_mm),
                "simulated": row.stiffness_n_per_mm,
                "of_64_elements": refined.stiffness_n_per_mm,
                "closed_form": 1e-3
                * float(closed_form_stiffness(to_plain(foot), 1e-3 * row.fulcrum_mm)),
                "chain_small_loads": 1e-3 * _chain(foot, 1e-3 * row.fulcrum_mm),
            }
            for row, refined in zip(own.settings, finer.settings, strict=True)
        ],
    }


def _chain(foot: FootParameters, fulcrum_m: float) -> float:
    """Stiffness (N/m) for small loads of the chain of elements as it is, with support and series
    spring."""
    keel = foot.keel
    return lumped_stiffness(
        bending_stiffness=keel.flexural_modulus_pa
        * section_inertia(keel.width_m, keel.thickness_m),
        element_lengths=keel.element_lengths_m,
        support=fulcrum_m,
        load_point=foot.load_point_m,
        fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m,
        series_stiffness=foot.series_stiffness_n_per_m,
    )


def _pressed_joints(fulcrum_mm: float, *, series_n_per_m: float = 62.8e3) -> float:
    """Stiffness (N/m) of the tuned joints as a bench tells it: mean slope from 200 to 600 N of a
    vertical load at 199 mm, rigid links between the joints, any deflection, with the series spring
    that small loads were given."""
    joints = [x for x in range(66, 199, 21) if x >= fulcrum_mm - 0.5]
    links, stiffness = 1e-3 * np.diff([*joints, 199]), tuned_joint_nm_per_rad(fulcrum_mm)

    def raised(load_n: float) -> float:
        def unbalanced(bent: np.ndarray) -> np.ndarray:
            x = np.concatenate(([0.0], np.cumsum(links * np.cos(np.cumsum(bent)))))
            return np.asarray(stiffness * bent - load_n * (x[-1] - x[:-1]))

        bent = fsolve(unbalanced, np.zeros(len(links)))
        return float(links @ np.sin(np.cumsum(bent))) + load_n / series_n_per_m

    return 400.0 / (raised(600.0) - raised(200.0))


# Energy.


def on(trial: Trial, model: ModelParameters, *, quick: bool) -> Trial:
    """The trial on this device, the foot's place fitted to its plate unless `quick`."""
    moved = dataclasses.replace(trial, model=model)
    return moved if quick else dataclasses.replace(moved, offsets=fit_offsets(moved).offsets)


def energy(model: ModelParameters, *, quick: bool) -> dict[str, Any]:
    """By part over a step of each walk; and what the middle one stores with the fulcrum
    elsewhere."""
    names = WALKED[1:2] if quick else WALKED
    trials = {name: on(inputs.trial(TIER, name), model, quick=quick) for name in names}
    middle = trials[WALKED[1]]
    moved: dict[str, list[dict[str, Any]]] = {}
    for key, search_s in (("same_motion", None), ("same_load", SEARCH_S)):
        walks = walk_cases(
            [
                EnergyCase(
                    label=WALKED[1],
                    trial=middle,
                    fulcrum_m=x,
                    step_s=SEARCH_S if quick else MOVED_S,
                    search_step_s=search_s,
                )
                for x in (PUBLISHED_FULCRUMS_M[::4] if quick else PUBLISHED_FULCRUMS_M)
            ],
            workers=None,
        )
        moved[key] = [
            {
                "fulcrum_mm": round(1e3 * walk.case.fulcrum_m, 6),
                "failed": walk.failure or None,
                **(
                    {}
                    if walk.failure
                    else {
                        "stored_j": (row := walk.stances[0].row).stored_j,
                        "returned_j": row.returned_j,
                        "late_load_n": row.late_load_n,
                    }
                ),
            }
            for walk in walks
        ]
    return {
        "walks": [by_part(trial, SEARCH_S if quick else FINE_S) for trial in trials.values()],
        "moved_trial": WALKED[1],
        **moved,
    }


def by_part(trial: Trial, step_s: float) -> dict[str, Any]:
    """The first stance: the foot's strain (J) by part when it is largest, and the largest of each
    part."""
    walker = Walker(trial.subject, trial.model)
    walk = walker.walk(
        trial.trajectory,
        fulcrum_m=trial.fulcrum_m,
        start_s=trial.start_s,
        end_s=trial.end_s,
        step_s=step_s,
        offsets=trial.offsets,
    )
    ledger = prosthesis_energy(walker, walk)
    stance = next(one for one in find_stances(ledger.time_s, ledger.vertical_n) if one.complete)
    inside = (ledger.time_s >= stance.start_s) & (ledger.time_s <= stance.end_s)
    sites = walker.gait.person.foot.sites
    count = len(sites.radius)
    k, n = walk.mechanism.sites[:count, 4], walk.mechanism.sites[:count, 5]
    each = k * np.maximum(walk.record.site("depth")[:, :count], 0.0) ** (n + 1) / (n + 1)
    at_heel = np.array([sites.zone_names[zone].startswith("heel") for zone in sites.zone])
    parts = {
        "keel": ledger.terms["keel_strain"],
        "support": ledger.terms["fulcrum_strain"],
        "heel": each[:, at_heel].sum(axis=1),
        "foam": each[:, ~at_heel].sum(axis=1),
        "socket": ledger.terms["bushing_strain"],
    }
    parts = {name: strain[inside] - strain[inside][0] for name, strain in parts.items()}
    row = stance_energy(ledger, stance, foot=trial.model.foot, fulcrum_m=trial.fulcrum_m).row
    top = int(np.argmax(np.sum([ledger.terms[name][inside] for name in FOOT_STRAINS], axis=0)))
    missed = ledger.terms[REMAINDER][inside]
    return {
        "trial": trial.name,
        "fulcrum_mm": row.fulcrum_mm,
        "stored_j": row.stored_j,
        "returned_j": row.returned_j,
        "at_most_strain_j": {name: float(strain[top]) for name, strain in parts.items()},
        "largest_j": {name: float(strain.max()) for name, strain in parts.items()},
        "support_share": row.fulcrum_at_most_j / row.stored_j,
        "remainder_share": float(np.abs(missed - missed[0]).max()) / row.stored_j,
        "step_s": step_s,
    }


# Rolling over, and the fit.


def roll_over(foot: FootParameters, *, quick: bool) -> list[dict[str, Any]]:
    """Under the ISO 22675 profile with the weight of the embedded person as its first peak."""
    weight = inputs.trial(TIER, WALKED[0]).subject.mass_kg * GRAVITY
    rows, _, failed = iso_roll_over(
        foot,
        PUBLISHED_FULCRUMS_M[::2] if quick else PUBLISHED_FULCRUMS_M,
        force_n=weight,
        steps=QUICK_ISO_STEPS if quick else ISO_STEPS,
    )
    keys = (
        "fulcrum_mm",
        "radius_m",
        "effective_foot_length_ratio",
        "deflection_forefoot_mm",
        "dorsiflexing_moment_nm",
        "stored_forefoot_j",
    )
    return [{key: getattr(row, key) for key in keys} for row in rows] + [
        {"failed": text} for text in failed
    ]


def fit(model: ModelParameters, freed: str) -> dict[str, Any]:
    """The joint fit of PAIR with this device as its first guess, judged on the other walks."""
    trials = {name: dataclasses.replace(inputs.trial(TIER, name), model=model) for name in TRIALS}
    options = ContactFitOptions(starts=STARTS, seed=SEED)
    pair = [trials[name] for name in PAIR]
    known = ContactFit(pair, bench=inputs.bench(), options=options)
    parameters = known.parameters.changed([*DEVICES.values()], frozen=True).changed(
        [freed], frozen=False
    )
    problem = ContactFit(
        pair, bench=known.bench, options=options, walker=known.walker, parameters=parameters
    )
    try:
        solution = solve(problem)
        found = assess(
            solution,
            [trials[name] for name in TRIALS if name not in PAIR],
            sweep=False,
            leave_out=False,
        )
    except (FitError, SimulationError) as error:
        return {"failed": str(error)}
    by = {score.label: score.metrics.grf_rmse_bw for score in found.scores}
    bench_n_per_mm = 1e-3 * problem.bench_stiffness(problem.parameters.u(solution.values))
    return {
        "freed": {freed: solution.values[freed]},
        "socket_tz_n_per_m": solution.values["socket.tz.stiffness"],
        "bench_n_per_mm": list(map(float, bench_n_per_mm)),
        "by_trial_bw": by,
        **{
            f"{role.replace(' ', '_')}_{short}": found.mean(role, f"{key}_{short[-2:]}")
            for role in ("fitted", "held out")
            for key, short in (("grf_rmse", "bw"), ("cop_rmse", "cop_fl"))
        },
    }


if __name__ == "__main__":
    main()
