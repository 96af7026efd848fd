"""Makes data/reference_subject: nine walks of a synthetic person in a virtual laboratory. Nobody
walked them.

Each trial is drawn at random (one seed), a whole-body motion is fitted to it whose force on a
virtual prosthesis looks as people's does, and what that prosthesis then carries when the motion *as
written* drives it is the recording. data/reference_subject/README.md says what the result is and is
not. The same files come out again on the same machine.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

if __name__ == "__main__":  # sums in the same order whatever the machine has free
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

from virtual_laboratory.bench_truth import write_bench, write_bench_curves
from virtual_laboratory.figures import null_error, stance_curve, trial_figures
from virtual_laboratory.markers import write_standing, write_walk
from virtual_laboratory.motion import Person, base_motion
from virtual_laboratory.placing import place, rise_of_legs, set_stage, start
from virtual_laboratory.polish import polish
from virtual_laboratory.prosthesis import Prosthesis, prosthesis_of
from virtual_laboratory.recording import Recorded, in_radians, record
from virtual_laboratory.targets import Draw, describe, draw_trials, lifted
from virtual_laboratory.tiers import draw_placement, exact, laboratory
from virtual_laboratory.writing import (
    NAME,
    NOTICE,
    write_readme,
    write_subject,
    write_tables,
    write_trial,
)

from vsf_drake.base.schema import load_yaml
from vsf_drake.model.parameters import GRAVITY, Subject
from vsf_drake.motion.trial import default_model

DATA = Path(__file__).resolve().parents[1] / "data" / "reference_subject"
SEED = 1
STEPS, QUICK_STEPS = 8, 1
"""How often the motion is corrected by what the virtual prosthesis carries."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Make the embedded reference subject. It is synthetic."
    )
    parser.add_argument(
        "--out", type=Path, help=f"folder to write to; {DATA} unless --quick or --only is given"
    )
    parser.add_argument("--quick", action="store_true", help="one trial, coarsely; needs --out")
    parser.add_argument(
        "--only",
        metavar="TRIAL",
        help="one trial, such as medium_1, as in the whole set; needs --out",
    )
    arguments = parser.parse_args()
    draws = draw_trials(SEED)
    chosen = arguments.only or (draws[0].name if arguments.quick else None)
    if chosen not in (None, *(draw.name for draw in draws)):
        parser.error(
            f"there is no trial {chosen}; there are {', '.join(draw.name for draw in draws)}"
        )
    if chosen and not arguments.out:
        parser.error("a part of the set must not replace it: give --out")
    out = arguments.out or DATA
    make(
        out,
        [d for d in draws if chosen in (None, d.name)],
        draws,
        QUICK_STEPS if arguments.quick else STEPS,
    )


def make(out: Path, wanted: list[Draw], draws: list[Draw], steps: int) -> None:
    """Writes the trials `wanted` of `draws` to `out`."""
    subject = load_yaml(write_subject(out), Subject)
    person, weight = Person(subject, default_model()), subject.mass_kg * GRAVITY
    placement = draw_placement(SEED)
    figures, curves, drawn = {}, {}, {}
    write_bench(out)
    write_bench_curves(out)
    write_standing(out / "markers", person)
    for draw in wanted:
        began = time.perf_counter()
        trial = walk_trial(person, prosthesis_of(subject, draw.fulcrum_m), draw, steps)
        for tier in (exact(trial), laboratory(trial, placement, SEED, draws.index(draw))):
            write_trial(out, trial, tier)
        write_walk(out / "markers", person, draw.name, in_radians(trial.coordinates))
        drawn[draw.name] = describe(trial.draw)
        figures[draw.name], curves[draw.name] = (
            trial_figures(trial, person),
            stance_curve(trial, weight),
        )
        stance, took = figures[draw.name]["stance_s"], time.perf_counter() - began
        print(f"{draw.name}: stance {stance:.3f} s, made in {took:.0f} s")
    null = {
        one: {other: null_error(curves[one], curves[other]) for other in curves} for one in curves
    }
    write_tables(out, {"figures.csv": figures, "draws.csv": drawn}, f"{NAME}: {NOTICE}")
    write_readme(out, figures, null)


def walk_trial(person: Person, prosthesis: Prosthesis, draw: Draw, steps: int) -> Recorded:
    """One trial from its draw to its recording, whose draw is the one given that the forces suit
    the legs."""
    attempt = start(draw, base_motion)
    rise = rise_of_legs(person, attempt, set_stage(person, draw, prosthesis, attempt.time_s))
    draw = lifted(draw, rise)
    attempt = start(draw, base_motion)
    stage = set_stage(person, draw, prosthesis, attempt.time_s)
    place(person, attempt, stage)
    polish(person, attempt, prosthesis, stage, steps)
    return record(person, prosthesis, attempt, stage)


if __name__ == "__main__":
    main()
