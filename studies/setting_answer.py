"""What is predicted at a setting that was not recorded, on synthetic persons whose answer to the
setting is stated.

Three persons (virtual_laboratory/people.py) walk at three settings, by each of three answers
(virtual_laboratory/answering.py: none, people, strong), and are recorded as a session records. The
middle setting is predicted by `vsf_drake.predict` from the walks at the outer ones, with the
contact of the same person's session in data/sessions (studies/session_fit.py): the same foot and
the same errors of the day, other walks.

`middle` has how far the interpolated motion is off the walks at the middle setting: 12 joint angles
of hips and knees over stance, root mean square, against each walk and against their mean; beside it
the spread between walks of one setting and the recorded walk, at any setting, that turns out
nearest. `embedded` has the same of data/sessions, and of `pairs`: from one walk of each outer
setting. `reached` is what the answers came to from the softest to the stiffest setting, of the
prosthetic knee and the other angles (degrees) and of the vertical force (body weights): twice the
change from the middle to an outer setting of the same draw, over the middle walk's stance.

`force` is the vertical force at the middle setting by layer, and interpolated between the plates of
the outer ones (`between`), off the mean of the plates there, body weights.

`order`: three settings by each cost. Truth is the mean over the walks of a setting, of the
laboratory's own inverse dynamics (virtual_laboratory/leg_loads.py). Predicted is what
`vsf_drake.predict` says of the outer settings, from their plates, and of the middle one; `between`
is the null: the middle cost lies on the line between the outer ones. A pair of settings
counts if its true costs differ by more than their 95 % interval: Student's t times the standard
error of the difference of two means, the spread pooled over settings. `right` are those of them
whose sign is predicted; an order counts as right if all its pairs that count have theirs.

The results are in studies/results/setting_answer.json. The walks take a quarter of an hour of
processor time and are kept in results/setting_answer.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import combinations
from multiprocessing import get_context
from pathlib import Path
from typing import Any, cast

if __name__ == "__main__":  # sums in the same order whatever the machine has free
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from contact_fit_study.keeping import STUDIES, kept, made_by, sources
from floor_of_the_reference_subject import RESULTS, hashes
from make_reference_subject import STEPS
from make_sessions import DATA, EMBEDDED, SEED, SPEEDS, draws, moving, of_person, persons, session
from scipy.special import stdtrit
from session_fit import CASES, fit_of
from virtual_laboratory.answering import ANSWERS, MIDDLE, walks
from virtual_laboratory.figures import stance_of
from virtual_laboratory.leg_loads import true_costs
from virtual_laboratory.motion import COORDINATES
from virtual_laboratory.recording import Recorded
from virtual_laboratory.session import session_tier
from virtual_laboratory.targets import CONDITIONS, SETTINGS
from virtual_laboratory.writing import Label, write_subject, write_trial

from vsf_drake.base.files import plain, read_json, write_json
from vsf_drake.base.schema import to_plain
from vsf_drake.fit.solution import ContactFitSolution, JointEnd
from vsf_drake.model.contact_file import FittedContact
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.cases import digest
from vsf_drake.tuning.answered import SettingPrediction, predict
from vsf_drake.walks.answer import LEG_ANGLES, answer_of
from vsf_drake.walks.prediction import LAYERS

PARTS = Path("results/setting_answer")
NOTICE = "SYNTHETIC, nobody walked this (made by studies/setting_answer.py)"
COSTS = {
    "joint_load": ("joint_load", 1.0),
    "metabolic": ("joint_work_energy", 1.0),
    "push_off": ("push_off_work", -1.0),
}
"""By name, the row of a prediction, and its sign in the cost."""
OUTER = (SETTINGS[0], SETTINGS[-1])
NUMBERS = (1, 2)  # walks of each setting; the third of a session's draws is left out
ORDER = (0, 6, 3, 1, 7, 4)  # of draws: one of each setting, then the next
SETTINGS_MM = {name: float(CONDITIONS[name] or np.nan) for name in SETTINGS}
MIDDLE_M = 1e-3 * SETTINGS_MM[MIDDLE]


def main() -> None:
    """Makes the walks, fits, predicts, prints a table and writes setting_answer.json."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--walks", action="store_true", help="make the walks alone")
    parser.add_argument(
        "--out", type=Path, help=f"folder to write to; {RESULTS} unless --quick is given"
    )
    parser.add_argument(
        "--quick", action="store_true", help="data/sessions alone, no walks are made; needs --out"
    )
    arguments = parser.parse_args()
    if arguments.quick and not arguments.out:
        parser.error("a part must not replace the whole: give --out")
    told = {} if arguments.quick else of_persons(arguments.workers, only_walks=arguments.walks)
    if arguments.walks:
        return
    inputs: dict[str, str] = {}
    embedded = {}
    for person in persons():
        embedded[person.lower()] = middle_of_session(person)
        for trial in session_trials(person):
            inputs |= hashes(trial)
    content = {
        "synthetic": True,
        "definitions": __doc__,
        "persons": told,
        "right": {
            way: {cost: counted(told, cost, way) for cost in COSTS}
            | {"all": counted(told, None, way)}
            for way in ("predicted", "between")
        },
        "embedded": embedded,
        "provenance": {**provenance(inputs, SEED), "sources": made_by("setting_answer.py")},
    }
    write_json((arguments.out or RESULTS) / "setting_answer.json", plain(content))
    print(text_table(content))


def of_persons(workers: int, *, only_walks: bool) -> dict[str, Any]:
    """What comes of each person and answer, by their names; none if `only_walks` are made."""
    every = [(person, number) for number in ORDER for person in persons()]
    cases = [(person, answer) for person in persons() for answer in ANSWERS]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        known = dict(zip(every, pool.map(walked, *zip(*every, strict=True)), strict=True))
        if only_walks:
            return {}
        found = list(pool.map(predicted, *zip(*cases, strict=True)))
    told = {}
    for (person, answer), part in zip(cases, found, strict=True):
        truth = {
            walk["name"]: walk
            for (whose, _), row in known.items()
            if whose == person
            for walk in row["walks"]
            if walk["answer"] == answer
        }
        told[f"{person.lower()}_{answer}"] = {
            "reached": reached(truth),
            **part,
            "truth": {name: walk["costs"] for name, walk in sorted(truth.items())},
            "order": {cost: order(cost, truth, part) for cost in COSTS},
        }
    return told


# The laboratory: walks, and what is true of them.


def walked(person: str, number: int) -> dict[str, Any]:
    """A draw's walks by all answers: files, and what is true of them."""
    folder = STUDIES / "virtual_laboratory"
    lab = sources(
        {folder / f"{name}.py" for name in ("answering", "leg_loads", "session", "writing")},
        roots=(STUDIES,),
    )
    key = digest(
        {
            "person": person,
            "number": number,
            "steps": STEPS,
            "laboratory": sorted(lab.values()),
        }
    )
    name = draws(person, 1, EMBEDDED)[number].name
    return kept(PARTS / "walks" / person.lower(), name, key, lambda: make(person, number))[0]


def make(person: str, number: int) -> dict[str, Any]:
    true = persons()[person]
    body = moving(person)
    day = session(person, 1)
    folder = PARTS / person.lower()
    of_person(folder, true)
    draw = draws(person, 1, EMBEDDED)[number]
    subject = {key: value for key, value in to_plain(day.written).items() if value is not None}
    write_subject(
        folder,
        f"# {NOTICE}.\n"
        + "".join(
            f"{key}: {value}\n" for key, value in {**subject, "prosthetic_side": true.side}.items()
        ),
    )
    told = []
    for answer, trial, middle, prosthesis in walks(body, true, draw, STEPS):
        index = (list(SPEEDS).index(EMBEDDED), number, 1 + ANSWERS.index(answer))
        write_trial(
            folder,
            trial,
            session_tier(trial, day, answer, index),
            Label(
                name=day.written.name,
                notice=NOTICE,
                subject="../subject.yaml",
                mirrored=true.side == "left",
            ),
        )
        told.append(
            {
                "answer": answer,
                "name": draw.name,
                "costs": true_costs(body, prosthesis, trial),
                **changed(trial, middle, true.subject.mass_kg),
            }
        )
    return {"walks": told}


def changed(trial: Recorded, middle: Recorded, mass_kg: float) -> dict[str, Any]:
    """By how much the motion (degrees) and the vertical force (body weights) differ from the same
    draw's at the middle setting, root mean square over that one's stance."""
    start, end = stance_of(middle)
    at = np.linspace(start, end, 101)
    q, middle_q = (each.trajectory.sample(at)[0] for each in (trial, middle))
    force, middle_force = (
        np.interp(
            at,
            each.force_time_s,
            low_pass(each.right.force[:, 2], rate_hz=1000.0, cutoff_hz=40.0),
        )
        for each in (trial, middle)
    )
    angles = dict(zip(COORDINATES, np.degrees(rms(q - middle_q)).tolist(), strict=True))
    lumbar = trial.truth.shift - trial.truth.shift.mean(axis=0)
    return {
        "angles_deg": {name: angles[name] for name in LEG_ANGLES},
        "vertical_bw": float(rms(force - middle_force)) / (mass_kg * GRAVITY),
        "trunk_mm": float(1e3 * np.linalg.norm(lumbar, axis=1).max()),
    }


def reached(truth: dict[str, dict[str, Any]]) -> dict[str, float]:
    """What an answer came to: twice the mean over the outer walks of what they changed from the
    middle."""
    outer = [walk for name, walk in truth.items() if not name.startswith(MIDDLE)]
    others = [name for name in LEG_ANGLES if name != "knee_angle_r"]
    return {
        "knee_deg": 2.0 * float(np.mean([walk["angles_deg"]["knee_angle_r"] for walk in outer])),
        "others_deg": 2.0
        * float(
            np.mean(
                [rms(np.array([walk["angles_deg"][name] for name in others])) for walk in outer]
            )
        ),
        "vertical_bw": 2.0 * float(np.mean([walk["vertical_bw"] for walk in outer])),
        "trunk_mm": float(np.max([walk["trunk_mm"] for walk in outer])),
    }


# The prediction, from what was recorded at the outer settings.


def predicted(person: str, answer: str) -> dict[str, Any]:
    """The fit of the outer walks, the predicted middle one, and how far its motion is off."""
    folder = PARTS / person.lower() / answer
    every = {
        f"{name}_{number}": load_trial(folder / f"{name}_{number}.yaml")
        for name in SETTINGS
        for number in NUMBERS
    }
    outer = [trial for name, trial in every.items() if not name.startswith(MIDDLE)]
    inner = [trial for name, trial in every.items() if name.startswith(MIDDLE)]
    contact = fitted(person)
    found = predict(outer, contact, fulcrum_m=MIDDLE_M)
    rows = {row.name: row for row in found.table.rows()}
    return {
        "middle": middle(outer, inner),
        "costs": {
            cost: {
                OUTER[0]: sign * rows[name].soft,
                MIDDLE: sign * rows[name].predicted,
                OUTER[-1]: sign * rows[name].stiff,
            }
            for cost, (name, sign) in COSTS.items()
        },
        "force": force_errors(found, outer, inner),
    }


def force_errors(
    found: SettingPrediction, outer: Sequence[Trial], inner: Sequence[Trial]
) -> dict[str, float]:
    """Vertical force at the middle setting by layer, and interpolated between the outer plates,
    off the mean of the plates there: root mean square over stance, body weights."""
    answer = answer_of([*outer, *inner])
    weight = found.walk.seen.weight_n
    at = np.linspace(0.0, 1.0, 101)
    forces = [np.interp(at, answer.share, walk.force_n[:, 2]) / weight for walk in answer.walks]
    recorded = np.mean(forces[len(outer) :], axis=0)
    soft, stiff = found.arrays["plates"][[0, -1], :, 2]
    low, high = found.table.answer.settings_mm[0], found.table.answer.settings_mm[-1]
    share = (1e3 * MIDDLE_M - low) / (high - low)
    told = {name: found.arrays[name][:, 2] for name in LAYERS if name in found.arrays}
    told["between"] = (1.0 - share) * soft + share * stiff
    return {name: float(rms(force - recorded)) for name, force in told.items()}


@cache
def fitted(person: str) -> FittedContact:
    """The contact of the person's session in data/sessions, as studies/session_fit.py found it: the
    same foot, recorded on the same day with the same errors, in other walks."""
    (case,) = (
        one for one in CASES if (one.person, one.day, one.passive) == (person.lower(), 1, False)
    )
    stored = read_json(RESULTS / "session_fit.json")["cases"][case.name]
    fit = fit_of(case, DATA)
    u = fit.parameters.u(stored["values"])
    unasked = cast(Any, None)
    end = JointEnd(u=u, evaluation=unasked, uncertainty=unasked, searches=(), best=0)
    return ContactFitSolution(
        fit=fit, success=True, message=stored["ended"], end=end, wall_s=stored["wall_s"]
    ).contact()


def middle(outer: Sequence[Trial], inner: Sequence[Trial]) -> dict[str, Any]:
    """How far the motion interpolated from the outer walks is off those at the middle setting,
    degrees over the joint angles; and what lies beside it."""
    answer = answer_of([*outer, *inner])
    of_outer = replace(answer, walks=answer.walks[: len(outer)])
    table = answer.table()
    inside = range(len(outer), len(answer.walks))
    stance = (answer.share >= 0.0) & (answer.share <= 1.0)
    columns = [answer.names.index(name) for name in LEG_ANGLES]
    every = answer.values[:, stance][..., columns]
    from_means = of_outer.at(MIDDLE_M)[stance][:, columns]
    soft = [i for i in range(len(outer)) if answer.fulcrum_m[i] < MIDDLE_M]
    stiff = [i for i in range(len(outer)) if answer.fulcrum_m[i] > MIDDLE_M]
    share = (MIDDLE_M - answer.fulcrum_m[soft[0]]) / (
        answer.fulcrum_m[stiff[0]] - answer.fulcrum_m[soft[0]]
    )
    pairs = [
        degrees((1.0 - share) * every[a] + share * every[b] - every[i])
        for a in soft
        for b in stiff
        for i in inside
    ]
    return {
        "walks_deg": [degrees(from_means - every[i]) for i in inside],
        "mean_deg": degrees(from_means - every[len(outer) :].mean(axis=0)),
        "pairs_deg": float(np.mean(pairs)),
        "answer_deg": table.answer_deg,
        "spread_deg": table.spread_deg,
        "nearest_walk_deg": [
            min(degrees(every[k] - every[i]) for k in range(len(every)) if k != i) for i in inside
        ],
    }


def middle_of_session(person: str) -> dict[str, Any]:
    """The same of a person in data/sessions."""
    every = session_trials(person)
    inner = [trial for trial in every if trial.path.stem.startswith(MIDDLE)]
    return middle([trial for trial in every if trial not in inner], inner)


def session_trials(person: str) -> list[Trial]:
    """Walks of a person's first day in data/sessions, by setting."""
    folder = DATA / person.lower() / "day_1" / EMBEDDED
    return [load_trial(folder / f"{name}_{k}.yaml") for name in SETTINGS for k in (1, 2, 3)]


def rms(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def degrees(values: np.ndarray) -> float:
    return float(np.degrees(np.sqrt(np.mean(values**2))))


# Orders of settings.


def order(cost: str, truth: dict[str, dict[str, Any]], part: dict[str, Any]) -> dict[str, Any]:
    """Means of a cost by setting, true, predicted and `between`; and the pairs of settings."""
    true = {
        name: [walk["costs"][cost] for key, walk in truth.items() if key.startswith(name)]
        for name in SETTINGS
    }
    means = {name: float(np.mean(own)) for name, own in true.items()}
    free = sum(len(own) - 1 for own in true.values())
    spread = float(
        np.sqrt(sum((value - means[name]) ** 2 for name in true for value in true[name]) / free)
    )
    found = part["costs"][cost]
    share = (SETTINGS_MM[MIDDLE] - SETTINGS_MM[OUTER[0]]) / (
        SETTINGS_MM[OUTER[-1]] - SETTINGS_MM[OUTER[0]]
    )
    between = {**found, MIDDLE: (1.0 - share) * found[OUTER[0]] + share * found[OUTER[-1]]}
    pairs = []
    for one, other in combinations(SETTINGS, 2):
        apart = means[other] - means[one]
        error = spread * float(np.sqrt(1 / len(true[one]) + 1 / len(true[other])))
        interval = float(stdtrit(free, 0.975)) * error
        pairs.append(
            {
                "settings": [one, other],
                "apart": apart,
                "interval": interval,
                "counts": abs(apart) > interval,
                "predicted": (found[other] - found[one]) * apart > 0.0,
                "between": (between[other] - between[one]) * apart > 0.0,
            }
        )
    return {"true": means, "predicted": found, "spread": spread, "pairs": pairs}


def counted(told: dict[str, Any], cost: str | None, way: str) -> dict[str, int]:
    """Of a cost, or all, how many pairs and orders count, and how many have their sign."""
    orders = [
        [pair for pair in part["order"][name]["pairs"] if pair["counts"]]
        for part in told.values()
        for name in COSTS
        if cost in (None, name)
    ]
    pairs = [pair[way] for order in orders for pair in order]
    whole = [all(pair[way] for pair in order) for order in orders if order]
    return {
        "pairs": len(pairs),
        "pairs_right": sum(pairs),
        "orders": len(whole),
        "orders_right": sum(whole),
    }


def text_table(content: dict[str, Any]) -> str:
    """Lines for the screen."""
    lines = [
        f"{'person':<12}{'knee':>6}{'others':>8}{'vertical':>10}{'middle':>8}{'mean':>6}"
        f"{'spread':>8}{'nearest':>9}   costs, true / predicted at the three settings"
    ]
    for name, part in content["persons"].items():
        came = part["reached"]
        off = part["middle"]
        costs = "; ".join(
            " ".join(f"{order['true'][k]:.3g}/{order['predicted'][k]:.3g}" for k in SETTINGS)
            for order in part["order"].values()
        )
        lines.append(
            f"{name:<12}{came['knee_deg']:>6.1f}{came['others_deg']:>8.1f}"
            f"{100 * came['vertical_bw']:>9.1f}%{np.mean(off['walks_deg']):>8.2f}"
            f"{off['mean_deg']:>6.2f}{off['spread_deg']:>8.2f}"
            f"{np.mean(off['nearest_walk_deg']):>9.2f}   {costs}"
        )
    for name, part in content["persons"].items():
        told = ", ".join(f"{layer} {100 * off:.1f}" for layer, off in part["force"].items())
        lines.append(f"{name}: vertical force at the middle setting, % body weight: {told}")
    for name, off in content["embedded"].items():
        lines.append(
            f"{name} embedded: middle {np.mean(off['walks_deg']):.2f} (pairs "
            f"{off['pairs_deg']:.2f}), mean {off['mean_deg']:.2f}, spread {off['spread_deg']:.2f}, "
            f"nearest walk {np.mean(off['nearest_walk_deg']):.2f} deg"
        )
    for way, of in content["right"].items():
        for cost, row in of.items():
            lines.append(
                f"{way:<10}{cost:<12}{row['pairs_right']} of {row['pairs']} pairs, "
                f"{row['orders_right']} of {row['orders']} orders"
            )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
