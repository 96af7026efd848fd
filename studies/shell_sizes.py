"""What a fit reaches on a person whose shell is longer or shorter than the published one, over the
same device.

One synthetic person (virtual_laboratory/people.py) walks at 66, 108 and 151 mm in shells of 220,
245, 270 and 300 mm over one keel and carriage, and is recorded as a session records; the manifests
state the length of the shell (prosthesis.foot_length_mm). For each shell the softest and the
stiffest first walk are fitted with the foot's own bench. The second walks at these settings and two
at the middle one judge: `grf_rmse_bw` by the foot's physics, `person_grf_rmse_bw` by the layer with
the person's own curve (body weights), `cop_rmse_fl` fore-aft by the physics in lengths of the
shell, means over the four. Of each walk `null_grf_rmse_bw` is the error of the fitted walks'
measured curves without any foot (`vsf_drake.walks.null_model`): by how much the walks themselves
differ. `asked` has whether the error is at most MOST_MORE_BW above that of the published shell, and
the centre of pressure within MOST_COP_FL.

`exchanged` has the same with first and second walks exchanged: what then differs is not the
shell's, but of which walks were fitted.

The results are in studies/results/shell_sizes.json. Walks and fits are kept in results/shell_sizes;
they take less than a minute of processor time each.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

if __name__ == "__main__":  # sums in the same order whatever the machine has free
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from contact_fit_study.keeping import STUDIES, kept, made_by, sources
from floor_of_the_reference_subject import NOMINAL, RESULTS
from make_reference_subject import DATA as REFERENCE
from make_reference_subject import STEPS, walk_trial
from make_sessions import EMBEDDED, SEED, SPEEDS
from virtual_laboratory.bench_truth import write_bench_curves
from virtual_laboratory.motion import Person
from virtual_laboratory.people import TruePerson, person_in_shell
from virtual_laboratory.session import Session, draw_session, session_tier
from virtual_laboratory.targets import LEG_M, REFERENCE_STATURE_M, Draw, draw_trials
from virtual_laboratory.writing import Label, write_subject, write_trial

from vsf_drake.base.files import plain, sha256, write_json
from vsf_drake.base.schema import to_plain
from vsf_drake.device.bench_lines import load_measured_bench
from vsf_drake.fit.assessment import assess
from vsf_drake.fit.options import ContactFitOptions
from vsf_drake.fit.problem import ContactFit
from vsf_drake.fit.solution import solve
from vsf_drake.motion.trial import default_model, load_trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.cases import digest
from vsf_drake.walks.prediction import PERSON, PHYSICS

PARTS = Path("results/shell_sizes")
NOTICE = "SYNTHETIC, nobody walked this (made by studies/shell_sizes.py)"
SHELLS_MM = (245, 220, 270, 300)
"""The published length first: the others are held against it."""
LABORATORY = ("people", "polish", "session", "writing")
FITTED = ("low_1", "high_1")
JUDGING = ("low_2", "medium_1", "medium_2", "high_2")
EXCHANGED = {"low_1": "low_2", "low_2": "low_1", "high_1": "high_2", "high_2": "high_1"}
MOST_MORE_BW, MOST_COP_FL = 0.003, 0.04
"""Asked for: held-out error over that of the published shell, centre of pressure."""


def main() -> None:
    """Makes the walks, fits, prints a table and writes shell_sizes.json."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--walks", action="store_true", help="make the walks alone")
    parser.add_argument(
        "--quick", action="store_true", help="the bench curves of every shell, without walks"
    )
    parser.add_argument("--out", type=Path, default=RESULTS, help=f"folder; {RESULTS} by default")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    if arguments.quick:
        for mm in SHELLS_MM:
            write_bench(arguments.out / f"{mm}", mm)
        return
    walks = [(mm, name) for name in (*FITTED, *JUDGING) for mm in SHELLS_MM]
    with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as pool:
        list(pool.map(walked, *zip(*walks, strict=True)))
        if arguments.walks:
            return
        found = dict(zip(SHELLS_MM, pool.map(fitted, SHELLS_MM), strict=True))
        exchanged = dict(zip(SHELLS_MM, pool.map(fitted_exchanged, SHELLS_MM), strict=True))
    inputs = {NOMINAL: sha256(REFERENCE / NOMINAL)}
    content = {
        "synthetic": True,
        "definitions": __doc__,
        "shells": {
            f"{mm}": {
                **part,
                "asked": asked(part, found[SHELLS_MM[0]]),
                "exchanged": {
                    **exchanged[mm],
                    "asked": asked(exchanged[mm], exchanged[SHELLS_MM[0]]),
                },
            }
            for mm, part in found.items()
        },
        "provenance": {**provenance(inputs, SEED), "sources": made_by("shell_sizes.py")},
    }
    write_json(arguments.out / "shell_sizes.json", plain(content))
    for mm, part in (*found.items(), *exchanged.items()):
        print(
            f"{mm} mm: force {100 * part['grf_rmse_bw']:.2f} % BW, with the person's curve "
            f"{100 * part['person_grf_rmse_bw']:.2f}, centre of pressure "
            f"{100 * part['cop_rmse_fl']:.2f} % FL"
        )


def asked(part: dict[str, Any], base: dict[str, Any]) -> dict[str, bool]:
    """Whether a shell has what was asked for."""
    return {
        "force": part["grf_rmse_bw"] <= base["grf_rmse_bw"] + MOST_MORE_BW,
        "person_force": part["person_grf_rmse_bw"] <= base["person_grf_rmse_bw"] + MOST_MORE_BW,
        "cop": part["cop_rmse_fl"] <= MOST_COP_FL,
    }


# The laboratory: walks.


def walked(mm: int, name: str) -> dict[str, Any]:
    """Files of a walk in a shell."""
    folder = STUDIES / "virtual_laboratory"
    laboratory = sources({folder / f"{part}.py" for part in LABORATORY}, roots=(STUDIES,))
    key = digest({"mm": mm, "name": name, "steps": STEPS, "by": sorted(laboratory.values())})
    return kept(PARTS / "walks" / f"{mm}", name, key, lambda: make(mm, name))[0]


def make(mm: int, name: str) -> dict[str, Any]:
    person = of_shell(mm)
    day = session()
    number, draw = next((i, each) for i, each in enumerate(draws()) if each.name == name)
    body = Person(person.subject, default_model())
    trial = walk_trial(body, person.prosthesis(draw.fulcrum_m), draw, STEPS)
    tier = session_tier(trial, day, EMBEDDED, (list(SPEEDS).index(EMBEDDED), number))
    folder = PARTS / f"{mm}"
    subject = {key: value for key, value in to_plain(day.written).items() if value is not None}
    write_subject(
        folder, f"# {NOTICE}.\n" + "".join(f"{key}: {value}\n" for key, value in subject.items())
    )
    write_bench(folder, mm)
    label = Label(
        name=day.written.name, notice=NOTICE, subject="../subject.yaml", foot_length_mm=mm
    )
    write_trial(folder, trial, tier, label)
    return {"peak_n": float(np.max(trial.reaction.force[:, 2]))}


def write_bench(folder: Path, mm: int) -> None:
    write_bench_curves(
        folder, of_shell(mm).foot, name=f"SYNTHETIC foot in {mm} mm", notice=NOTICE, seed=SEED
    )


@cache
def of_shell(mm: int) -> TruePerson:
    return person_in_shell(SEED, 1e-3 * mm)


@cache
def session() -> Session:
    return draw_session(
        of_shell(SHELLS_MM[0]).subject, seed=(SEED, ord("S"), 1), name="SYNTHETIC person S"
    )


@cache
def draws() -> list[Draw]:
    subject = of_shell(SHELLS_MM[0]).subject
    return draw_trials(
        [SEED, ord("S"), 1, list(SPEEDS).index(EMBEDDED)],
        SPEEDS[EMBEDDED],
        leg_m=LEG_M * subject.stature_m / REFERENCE_STATURE_M,
    )


# Fits.


def fitted(mm: int) -> dict[str, Any]:
    """What a fit of the outer settings reaches on the other walks."""
    key = digest({"mm": mm, **made_by("shell_sizes.py")})
    return kept(PARTS / "fits", f"{mm}", key, lambda: fit(mm, FITTED, JUDGING))[0]


def fitted_exchanged(mm: int) -> dict[str, Any]:
    """As `fitted`, with first and second walks exchanged."""
    key = digest({"mm": mm, **made_by("shell_sizes.py")})
    fitting, judging = (
        [EXCHANGED.get(name, name) for name in names] for names in (FITTED, JUDGING)
    )
    return kept(PARTS / "exchanged", f"{mm}", key, lambda: fit(mm, fitting, judging))[0]


def fit(mm: int, fitting: Sequence[str], held_out: Sequence[str]) -> dict[str, Any]:
    folder = PARTS / f"{mm}"
    trials = [load_trial(folder / EMBEDDED / f"{name}.yaml") for name in fitting]
    judging = [load_trial(folder / EMBEDDED / f"{name}.yaml") for name in held_out]
    solution = solve(
        ContactFit(
            trials,
            bench=load_measured_bench(folder / "bench_curves.csv"),
            options=ContactFitOptions(seed=SEED),
        )
    )
    layers = assess(solution, judging, sweep=False, leave_out=False, angle_errors=False).layers
    assert layers is not None
    return {
        "success": solution.success,
        "grf_rmse_bw": layers.mean(PHYSICS),
        "person_grf_rmse_bw": layers.mean(PERSON),
        "cop_rmse_fl": layers.mean(PHYSICS, "cop_rmse_fl"),
        "walks": {
            name: {layer: row.layers[layer] for layer in (PHYSICS, PERSON)}
            | {"null_grf_rmse_bw": row.null_model_grf_rmse_bw}
            for name, row in zip(held_out, layers.trials[len(fitting) :], strict=True)
        },
        "values": solution.values,
    }


if __name__ == "__main__":
    main()
