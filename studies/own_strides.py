"""Strides that adapt (level 2 of a tuning), held to the person's own strides, on the synthetic
persons of data/sessions, whose feet are turned out and inverted as markers show it.

Per person the first two walks of each setting, with the contact that studies/session_fit.py found
from the session, squared activations least, one start, nothing drawn. `fulcrum_mm` and
`interval_mm` are the optimum and its interval, `undecided` why no recommendation follows (empty
where one does), `moves_mm` how far half and twice the hold move the optimum. By position `cost` is
of the strides that adapt, `walked` of the person's own before they adapt, `equal_load` of the
spring alone under an equal load, to which nobody answers: the null. `left_out` is what the sagittal
plane leaves out of the recorded strides, means over the walks: the foot's turn out of the way of
walking, how far its spheres near the floor are off along the way and in height one against another.
`tracked` has the worst angle and the worse foot's force by which the possible motions nearest to
the person's own strides are off them, root mean square, at the worst position; `believed` whether
both are within the limits of level 2, else nothing follows; "no: search failed" where no strides
were found.

The grid is coarse: `mesh_mm` is by how much twice as many intervals move the optimum. The results
are in studies/results/own_strides.json; some minutes of processor time a person.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.keeping import kept, made_by
from floor_of_the_reference_subject import RESULTS, hashes
from setting_answer import NUMBERS, fitted, session_trials

from vsf_drake.base.files import plain, write_json
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial
from vsf_drake.optimal_control.own import OwnStrides
from vsf_drake.optimal_control.recorded_stride import RecordedStride
from vsf_drake.optimal_control.saved import stride_table
from vsf_drake.optimal_control.search import StrideTuning
from vsf_drake.optimal_control.solve import solve
from vsf_drake.optimal_control.stride import StrideOptions
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.cases import digest

PARTS = Path("results/own_strides")
PERSONS = "abc"
COST = "activation"
INTERVALS, QUICK = 20, 10  # of the stride; `mesh` has what twice as many change
FAILED = "no: search failed"
LEFT_OUT = ("toe_out_deg", "prosthetic_foot_along_mm", "sole_tilt_mm")


def main() -> None:
    """Tunes for every person, prints a table and writes own_strides.json."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=2, help="processes, a person each")
    parser.add_argument(
        "--out", type=Path, help=f"folder to write to; {RESULTS} unless --quick is given"
    )
    parser.add_argument(
        "--quick", action="store_true", help="one person, a coarse grid; needs --out"
    )
    arguments = parser.parse_args()
    if arguments.quick and not arguments.out:
        parser.error("a part of the study must not replace it all: give --out")
    out = arguments.out or RESULTS
    persons = PERSONS[:1] if arguments.quick else PERSONS
    parts = (arguments.out or PARTS) / "parts"
    with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as pool:
        cases = [(person, parts, arguments.quick) for person in persons]
        told = dict(zip(persons, pool.map(done, *zip(*cases, strict=True)), strict=True))
    inputs = {
        file: sha
        for person in persons
        for trial in walks(person)
        for file, sha in hashes(trial).items()
    }
    content = {
        "synthetic": True,
        "definitions": __doc__,
        "persons": told,
        "provenance": {**provenance(inputs), "sources": made_by("own_strides.py")},
    }
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / "own_strides.json", plain(content))
    print(text_table(told))


def walks(person: str) -> list[Trial]:
    return [
        trial for trial in session_trials(person) if int(trial.path.stem.split("_")[1]) in NUMBERS
    ]


def done(person: str, parts: Path, quick: bool) -> dict[str, Any]:
    """The person's part, made now unless it was made before by the same sources."""
    key = digest({"person": person, "quick": quick, **made_by("own_strides.py")})
    return kept(parts, person, key, lambda: tuned(person, quick))[0]


def tuned(person: str, quick: bool) -> dict[str, Any]:
    began = time.process_time()
    trials = fitted_walks(person)
    options = StrideOptions(
        starts=1, confirm=(), draws=0, intervals=QUICK if quick else INTERVALS, positions=3
    )
    result = solve(StrideTuning(trials, cost=COST, options=options))
    table = stride_table(result)
    checks = {check.name: check.value for check in table.checks}
    recorded = result.tuning.recorded
    assert isinstance(recorded, OwnStrides)
    return {
        "optimal": table.optimal,
        "status": table.status,
        "fulcrum_mm": table.fulcrum_mm,
        "interval_mm": table.fulcrum_interval_mm,
        "undecided": table.undecided,
        "believed": table.believed if table.optimal else FAILED,
        "moves_mm": checks.get("hold"),
        "mesh_mm": checks.get("mesh"),
        "positions_mm": [point.fulcrum_mm for point in table.sweep],
        "cost": [point.cost for point in table.sweep],
        "walked": [point.walked for point in table.sweep],
        "equal_load": [point.equal_load.get("cost") for point in table.sweep],
        "left_out": left_out(recorded.strides),
        "tracked": {
            "angle_deg": checks.get("tracking_motion"),
            "force_percent_bw": checks.get("tracking_force"),
        },
        "processor_s": time.process_time() - began,
    }


def fitted_walks(person: str) -> list[Trial]:
    return [trial_with(trial, fitted(person)) for trial in walks(person)]


def left_out(strides: Sequence[RecordedStride]) -> dict[str, float]:
    return {name: float(np.mean([stride.errors[name] for stride in strides])) for name in LEFT_OUT}


def text_table(told: dict[str, dict[str, Any]]) -> str:
    """Lines for the screen."""
    lines = []
    for person, part in told.items():
        decided = "decided" if part["optimal"] else "no optimum"
        lines.append(
            f"{person}: {part['status']}; fulcrum {part['fulcrum_mm']:.1f} mm, interval "
            f"{part['interval_mm']}, hold halved and doubled {part['moves_mm']} mm; "
            f"{part['undecided'] or decided}"
        )
        for row in ("positions_mm", "cost", "walked", "equal_load"):
            values = " ".join("    none" if x is None else f"{x:8.3f}" for x in part[row])
            lines.append(f"   {row:<14}{values}")
        lines.append(f"   {part['left_out']}, tracked {part['tracked']}")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
