"""What a walk costs against how finely it is modelled: step size, spheres, keel elements, free coordinates.

Walks an embedded trial, which is synthetic. Run it on a machine that does nothing else.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path

from vsf_drake.analysis.cost import REPEATS, WALK_S, Cost, measure_costs
from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.files import replaced
from vsf_drake.motion.trial import load_trial
from vsf_drake.report.cost_figure import cost_figure
from vsf_drake.report.style import save_figure
from vsf_drake.simulation.walk import DEFAULT_STEP_S

COLUMNS = ("family", "size", "walk", "simulated_s", "wall_s", "settling_s", "times_faster_than_real_time",
           "newton_iterations_a_step", "unconverged_steps", "difference_percent_body_weight", "difference_from")


def main() -> None:
    """Measures, prints a table, writes it as CSV and the figure as PNG and SVG."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/cost_against_work"))
    parser.add_argument("--quick", action="store_true", help="fewer walks, each run once")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    trial = load_trial(embedded_trials("exact")[0])
    costs = measure_costs(trial, quick=arguments.quick, repeats=1 if arguments.quick else REPEATS)
    for cost in costs:
        print(f"{cost.label:52} {1e3 * cost.wall_s:8.1f} ms for {cost.simulated_s:.2f} s  "
              f"{100 * cost.difference_bw:7.4f} % BW" + (f" from {cost.against}" if cost.against else ""))
    write_table(arguments.out / "cost_against_work.csv", costs)
    title = (f"Cost against work. {trial.name}: {WALK_S:g} s, whole person, {1e3 * DEFAULT_STEP_S:g} ms unless said,\n"
             "one core, without the settling before the start")
    save_figure(cost_figure(costs, title=title), arguments.out / "cost_against_work")


def write_table(path: Path, costs: Sequence[Cost]) -> None:
    """One row a walk."""
    with replaced(path) as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(COLUMNS)
        for cost in costs:
            table.writerow([cost.family, cost.size, cost.label, cost.simulated_s, cost.wall_s, cost.settling_s,
                            cost.simulated_s / cost.wall_s, cost.iterations, cost.unconverged,
                            100 * cost.difference_bw, cost.against])


if __name__ == "__main__":
    main()
