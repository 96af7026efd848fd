"""What a stride that adapts (level 2 of a tuning) can be believed in, on the embedded walks (SYNTHETIC).

    found     a recorded stride is made consistent at its own fulcrum; tracked with the fulcrum free, from three
              starts, does it find that position? And the recording itself?
    costs     of a stride at each setting, for each cost: how long a search takes, and how far the full model is from it
    signs     which published signs stiffness has, for each weight of the hold and each setting of the recording

The results are in studies/results/adaptive_stride.json; the whole takes some fifteen minutes.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from floor_of_the_reference_subject import RESULTS

from vsf_drake.analysis.tuning.common import COSTS
from vsf_drake.analysis.tuning.level2 import StrideOptions, StrideTuning
from vsf_drake.analysis.tuning.level2.outcomes import SIGNS_OF, outcomes, published_signs
from vsf_drake.analysis.tuning.level2.search import StrideSearch, position_mm, tracked
from vsf_drake.analysis.tuning.level2.stride import MM
from vsf_drake.analysis.tuning.resimulation.resimulate import resimulate_prescribed, resimulate_with_feedback
from vsf_drake.analysis.tuning.resimulation.trajectory import solved_trajectory
from vsf_drake.analysis.validation import embedded_contact, embedded_trials
from vsf_drake.collocation.solution import TrajectorySolution
from vsf_drake.contact_file import load_contact
from vsf_drake.files import plain, write_json
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.archive import provenance

COARSE, FINE = 20, 40  # intervals, of the searches that are many and of those that the full model carries out
STARTS_MM = (66.0, 108.0, 151.0)
WEIGHTS = (0.125, 0.5, 2.0)
SHOWN = ("stored_energy", "push_off_work", "push_off_power", "dorsiflexion", "ankle_moment",
         "knee_extension", "knee_flexor_moment", "intact_first_peak", "metabolic", "stride_time")


class Recorded:
    """One trial's stride, consistent, and what its costs are there."""

    def __init__(self, path: Path, intervals: int) -> None:
        trial = trial_with(load_trial(path), load_contact(embedded_contact("exact")))
        began = time.perf_counter()
        self.tuning = StrideTuning([trial], cost="tracking", options=StrideOptions(intervals=intervals))
        self.recording, self.solution = self.tuning.stride, tracked(self.tuning.stride)
        self.wall_s = time.perf_counter() - began
        self.stride = dataclasses.replace(self.recording, consistent=self.solution)
        self.sizes = {name: self.recording.value(name, self.solution.y()) for name in COSTS}

    def search(self, cost: str, **options: Any) -> StrideSearch:
        search = StrideSearch(self.stride, cost, self.sizes)
        return search.changed(options=dataclasses.replace(self.stride.options, **options))


def found(one: Recorded) -> dict[str, Any]:
    """Where the fulcrum ends that is freed at each of STARTS_MM, in mm from A."""
    consistent, recording = one.search("tracking"), StrideSearch(one.recording, "tracking")
    ends = {}
    for mm in STARTS_MM:
        solution = consistent.free(consistent.at(mm, one.solution.last, "fixed").last, "free")
        ends[f"{mm:g}"] = position_mm(solution) if solution.success else None
    alone = recording.free(recording.at(STARTS_MM[1], one.solution.last, "fixed").last, "free")
    return {"own_mm": one.recording.own_m / MM, "consistent_mm": ends, "wall_s": one.wall_s,
            "recording_mm": position_mm(alone) if alone.success else None, "deviation": one.recording.value(
                "deviation", one.solution.y()), "errors": one.recording.recorded.errors}


def carried_out(one: Recorded, cost: str) -> dict[str, Any]:
    """The stride with the least of a cost, and what the full model makes of it, in percent of body weight."""
    began = time.perf_counter()
    solution = one.solution if cost == "tracking" else one.search(cost).free(one.solution.last, "free")
    row: dict[str, Any] = {"status": solution.status, "fulcrum_mm": position_mm(solution),
                           "wall_s": one.wall_s if cost == "tracking" else time.perf_counter() - began}
    if solution.success:
        row |= _resimulated(one, solution)
    return row


def _resimulated(one: Recorded, solution: TrajectorySolution) -> dict[str, Any]:
    trajectory = solved_trajectory(solution, one.tuning.walker, outputs=one.stride.function.names,
                                   offsets=one.tuning.trial.offsets)
    prescribed = resimulate_prescribed(one.tuning.walker, trajectory)
    driven = resimulate_with_feedback(one.tuning.walker, trajectory)
    assert driven.feedback is not None
    return {"prescribed_percent_bw": prescribed.percent_bw, "fell": driven.fell, "period_s": trajectory.period_s,
            "feedback_percent_bw": None if driven.fell else driven.percent_bw, "feedback_share": driven.feedback.share}


def signs(one: Recorded, cost: str, weight: float) -> dict[str, Any]:
    """The best strides at three settings and with the fulcrum free, with one weight of the hold."""
    search = one.search(cost, deviation_weight=weight)
    over = [search.at(mm, one.solution.last, "fixed") for mm in STARTS_MM]
    free = search.free(over[1].last, "free")
    rows = [outcomes(solution, search.stride) for solution in over]
    own = published_signs(rows) if all(solution.success for solution in over) else {}
    return {"recorded_mm": one.recording.own_m / MM, "cost": cost, "weight": weight,
            "status": [solution.status for solution in (*over, free)], "signs": own,
            "count": sum(value is True for value in own.values()) if own else None,
            "fulcrum_mm": position_mm(free) if free.success else None,
            "outcomes": {name: [row[name] for row in rows] for name in SHOWN}}


def main() -> None:
    """Computes, prints and stores all three."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--quick", action="store_true", help="one trial, one cost, one weight; needs --out")
    arguments = parser.parse_args()
    if arguments.quick and arguments.out == RESULTS:
        parser.error("a part of the study must not replace it all: give --out")
    paths = {path.stem: path for path in embedded_trials("exact")}
    quick = arguments.quick
    coarse = {name: Recorded(paths[name], COARSE) for name in (["medium_1"] if quick else paths)}
    results: dict[str, Any] = {"format": "vsf_drake adaptive stride 1", "synthetic": True, "signs_of": SIGNS_OF}
    results["found"] = {name: found(one) for name, one in coarse.items()}
    for name, row in results["found"].items():
        print(name, row["own_mm"], row["consistent_mm"], row["recording_mm"], flush=True)
    chosen = ["medium_1"] if quick else ["low_1", "medium_1", "high_1"]
    results["costs"] = {}
    for name in chosen:
        fine = Recorded(paths[name], COARSE if quick else FINE)
        results["costs"][name] = {cost: carried_out(fine, cost) for cost in (COSTS[:1] if quick else COSTS)}
        print(name, results["costs"][name], flush=True)
    results["signs"] = [signs(coarse[name], "joint_load", weight)
                        for name in chosen
                        for weight in (WEIGHTS[1:2] if quick else WEIGHTS)]
    for row in results["signs"]:
        print(row["recorded_mm"], row["cost"], row["weight"], row["count"], row["fulcrum_mm"], flush=True)
    results["provenance"] = provenance()
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_json(arguments.out / "adaptive_stride.json", plain(results), sort=False)


if __name__ == "__main__":
    main()
