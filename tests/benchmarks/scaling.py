"""Rows of the benchmark table: what a walk costs as its step, spheres, keel or free coordinates are refined."""

from __future__ import annotations

from cost_against_work import measure_costs
from table import Row

from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.trial import load_trial


def rows() -> list[Row]:
    """One row a walk; the whole run, settling before it included, fastest of a few."""
    return [
        Row(name=f"person, {cost.label}", simulated_s=cost.simulated_s, wall_s=cost.wall_s,
            accuracy=_accuracy(cost.difference_bw, cost.against, cost.unconverged))
        for cost in measure_costs(load_trial(embedded_trials("exact")[0]))]


def _accuracy(difference_bw: float, against: str, unconverged: int) -> str:
    said = f"{100 * difference_bw:.3f} % BW from {against}" if against else "finest of its family"
    return f"{said}; {unconverged} steps unconverged" if unconverged else said
