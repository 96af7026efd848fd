"""What a stride that adapts (level 2 of a tuning) can be believed in, on the embedded walks
(SYNTHETIC).

    able_bodied  walking of an able-bodied person with the same model at three speeds, against
                 published bands, for each weight of able-bodied walking: the least that meets them
                 all is `StrideOptions.normal_weight`
    found        a recorded stride is made consistent at its own fulcrum; tracked with the fulcrum
                 free, from three starts, does it find that position? And the recording itself?
    costs        of a stride at each setting, for each cost: how long a search takes, and how far
                 the full model is off
    speeds       nine positions at each of three speeds, and with the fulcrum free
    signs        which published signs stiffness has, for each weight and each setting of the
                 recording, which of those that the foot alone lacks, and where searches from three
                 settings end, fulcrum free
    equal_load   the null of the signs: the foot alone under the ISO 22675 profile, with nobody on
                 it

The results are in studies/results/adaptive_stride.json; the whole takes some fifty minutes.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.keeping import made_by
from floor_of_the_reference_subject import RESULTS, hashes

from vsf_drake.base.files import plain, write_json
from vsf_drake.collocation.problem import Grid
from vsf_drake.collocation.solution import Start, TrajectorySolution, resampled
from vsf_drake.device.equal_load import at_equal_load
from vsf_drake.model.contact_file import load_contact
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.optimal_control.outcomes import (
    SIGNS_OF,
    beyond_the_load,
    muscle_energy,
    outcomes,
    published_signs,
    steady_signs,
)
from vsf_drake.optimal_control.resimulate import resimulate_prescribed, resimulate_with_feedback
from vsf_drake.optimal_control.search import (
    Fixed,
    StrideSearch,
    StrideTuning,
    eased,
    position_mm,
    swept,
    tracked,
)
from vsf_drake.optimal_control.stride import MM, Stride, StrideOptions
from vsf_drake.optimal_control.trajectory import solved_trajectory
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.sagittal.model import SagittalModel, Smoothing
from vsf_drake.simulation.walk import Walker
from vsf_drake.tuning.common import FREE_COSTS
from vsf_drake.walks.embedded import embedded_contact, embedded_trials

BANDS = Path(__file__).resolve().parents[1] / "data" / "published" / "walking_bands.csv"
# intervals, of the searches that are many and of those that are refined for the full model
COARSE, FINE = 20, 40
STARTS_MM = (66.0, 108.0, 151.0)
POSITIONS = 9
SPEEDS = (0.9, 1.1, 1.4)  # m/s
# weights of able-bodied walking, of which one is chosen
TRIED = (0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0)
FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the chosen one, for the signs
# for a first stride without any known
SOFT = Smoothing(depth_m=6e-3, rate_m_per_s=0.1, friction_velocity_m_per_s=0.2)
SDS = 2.0  # standard deviations between persons within which a peak is able-bodied (a choice)
SHOWN = (
    "stored_energy",
    "returned_energy",
    "push_off_work",
    "push_off_power",
    "dorsiflexion",
    "ankle_moment",
    "knee_extension",
    "knee_flexor_moment",
    "intact_first_peak",
    "com_push_off_work",
    "metabolic",
    "activation",
    "muscle_energy",
    "stride_time",
)


def exact(path: Path) -> Trial:
    """A trial with the contact that was fitted to it."""
    return trial_with(load_trial(path), load_contact(embedded_contact("exact")))


def able_bodied(trial: Trial, weights: tuple[float, ...]) -> dict[str, Any]:
    """Strides of the person with two intact legs, for the largest weight first: by weight and
    speed, each with the bands that it is held against."""
    walker = Walker(trial.subject, trial.model)
    body, model = walker.gait.person.body, SagittalModel(walker, able_bodied=True)
    rows: dict[str, Any] = {}
    for speed in SPEEDS:
        bands = _bands(speed)
        time_s = sum(bands["stride_time"]) / 2.0
        stride = Stride(
            model=model,
            recorded=None,
            advance_m=speed * time_s,
            tilt_rad=0.0,
            own_m=trial.fulcrum_m,
            leg_m=body.thigh_length + body.shank_length,
            hip_height_m=body.leg_length,
            options=StrideOptions(intervals=FINE),
            grid=Grid(intervals=FINE, duration_s=time_s),
            smoothing=SOFT,
        )
        before: Start | None = None
        for weight in sorted(weights, reverse=True):
            search = StrideSearch(stride, "activation").changed(
                options=StrideOptions(intervals=FINE, normal_weight=weight)
            )
            if before is None:
                before = search.at(
                    trial.fulcrum_m / MM, stride.start(trial.fulcrum_m / MM), "soft"
                ).last
            search = search.changed(smoothing=stride.options.stages[-1])
            began = time.perf_counter()
            solution = search.at(trial.fulcrum_m / MM, before, "able-bodied")
            before = solution.last
            row: dict[str, Any] = _measured(search.stride, solution) | {
                "status": solution.status,
                "wall_s": time.perf_counter() - began,
            }
            force = stride.able_bodied.force["prosthetic"][:, 1] / model.weight
            sd = SDS * stride.gait.sd["force_up"]
            peaks = {
                name: (peak - sd, peak + sd)
                for name, peak in zip(("first_peak", "second_peak"), _peaks(force), strict=True)
            }
            row["bands"] = bands | peaks
            row["within"] = solution.success and all(
                low <= row[name] <= high for name, (low, high) in row["bands"].items()
            )
            rows.setdefault(f"{weight:g}", {})[f"{speed:g}"] = row
    met = [
        float(weight) for weight, own in rows.items() if all(row["within"] for row in own.values())
    ]
    return {"weights": rows, "least_that_meets_all": min(met) if met else None}


def _bands(speed: float) -> dict[str, tuple[float, float]]:
    """Of able-bodied adults, from data/published/walking_bands.csv."""
    lines = [
        line for line in BANDS.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
    ]
    bands = {}
    for row in csv.DictReader(lines):
        if row["side"] == "able-bodied" and row["quantity"] in ("stride_time", "step_length"):
            low, _, high = row["speed_m_per_s"].partition(" to ")
            if float(low) <= speed <= float(high):
                bands[row["quantity"]] = float(row["low"]), float(row["high"])
    return bands


def _peaks(force: np.ndarray) -> tuple[float, float]:
    """Of the first 30 % of the stride, and of the rest of stance."""
    early = round(0.3 * len(force))
    return float(force[:early].max()), float(force[early:].max())


def _measured(stride: Stride, solution: TrajectorySolution) -> dict[str, float]:
    y, pace = solution.last_y(), float(solution.last.p[-1])
    first, second = _peaks(y[:, stride.function.index("prosthetic_fz")[0]] / stride.model.weight)
    return {
        "stride_time": pace * stride.grid.duration_s,
        "step_length": 0.5 * pace * stride.advance_m,
        "first_peak": first,
        "second_peak": second,
        "ankle_power_w_per_kg": float(
            y[:, stride.function.index("prosthesis_power")[0]].max() / stride.model.subject.mass_kg
        ),
        "muscle_energy_j_per_kg_m": muscle_energy(solution, stride),
    }


class Recorded:
    """One trial's stride, consistent, and what its costs are there."""

    def __init__(self, path: Path, intervals: int) -> None:
        trial = exact(path)
        began = time.perf_counter()
        self.tuning = StrideTuning(
            [trial], cost="tracking", options=StrideOptions(intervals=intervals)
        )
        self.recording, self.solution = self.tuning.stride, tracked(self.tuning.stride)
        self.wall_s = time.perf_counter() - began
        self.stride = dataclasses.replace(self.recording, consistent=self.solution)
        self.sizes = {name: self.recording.value(name, self.solution.y()) for name in FREE_COSTS}

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
    return {
        "own_mm": one.recording.own_m / MM,
        "consistent_mm": ends,
        "wall_s": one.wall_s,
        "recording_mm": position_mm(alone) if alone.success else None,
        "deviation": one.recording.value("deviation", one.solution.y()),
        "errors": one.recording.recorded.errors,
    }


def carried_out(one: Recorded, cost: str) -> dict[str, Any]:
    """The stride with the least of a cost, the fulcrum free, and what the full model makes of it on
    twice as many intervals, in percent of body weight; `wall_s` of the search, `fine_wall_s` of
    that on the finer grid."""
    began, search, start, own = (
        time.perf_counter(),
        one.search(cost),
        one.solution.last,
        one.recording.own_m / MM,
    )
    if cost != "tracking":
        start = search.at(own, eased(search, own, start)[1], "own").last
    free = search.free(start, "free")
    wall_s, grid = (
        time.perf_counter() - began,
        dataclasses.replace(one.stride.grid, intervals=2 * one.stride.grid.intervals),
    )
    fine = search.changed(grid=grid).free(resampled(free, grid), "fine")
    row: dict[str, Any] = {
        "status": [free.status, fine.status],
        "fulcrum_mm": [position_mm(free), position_mm(fine)],
        "wall_s": wall_s,
        "fine_wall_s": time.perf_counter() - began - wall_s,
    }
    return row | (_resimulated(one, fine) if fine.success else {})


def _resimulated(one: Recorded, solution: TrajectorySolution) -> dict[str, Any]:
    trajectory = solved_trajectory(
        solution,
        one.tuning.walker,
        outputs=one.stride.function.names,
        offsets=one.tuning.trial.offsets,
    )
    prescribed = resimulate_prescribed(one.tuning.walker, trajectory)
    driven = resimulate_with_feedback(one.tuning.walker, trajectory)
    assert driven.feedback is not None
    return {
        "prescribed_percent_bw": prescribed.percent_bw,
        "fell": driven.fell,
        "period_s": trajectory.period_s,
        "feedback_percent_bw": None if driven.fell else driven.percent_bw,
        "feedback_share": driven.feedback.share,
    }


def speeds(one: Recorded) -> dict[str, Any]:
    """By speed, the least costs over the fulcrum and the best position."""
    began, search, rows = time.perf_counter(), one.search("activation", positions=POSITIONS), {}
    for speed in SPEEDS:
        stride, start = search.stride.at_speed(speed, one.solution.last)
        there, sweep = dataclasses.replace(search, stride=stride), list[Fixed]()
        swept(there, start, sweep, chains=False)
        known = [row.solution for row in sweep if row.solution is not None]
        free = there.free(min(known, key=lambda end: end.last_cost).last, "free")
        rows[f"{speed:g}"] = {
            "cost": [None if row.solution is None else row.solution.last_cost for row in sweep],
            "fulcrum_mm": position_mm(free) if free.success else None,
            "least": free.last_cost,
            "outcomes": {name: outcomes(free, stride)[name] for name in SHOWN},
        }
    return {
        "positions_mm": np.linspace(*search.stride.reach_mm, POSITIONS),
        "wall_s": time.perf_counter() - began,
        "speeds": rows,
    }


def equal_load(trial: Trial) -> dict[str, Any]:
    """What stiffness does to the foot alone: by setting the outcomes, and which published signs
    they have."""
    rows = [
        one.outcomes
        for one in at_equal_load(trial.subject, trial.model, [MM * mm for mm in STARTS_MM])
    ]
    found = published_signs(rows)
    return {
        "settings_mm": STARTS_MM,
        "signs": found,
        "count": sum(value is True for value in found.values()),
        "steady": steady_signs(rows),
        "outcomes": {name: [row[name] for row in rows] for name in rows[0]},
    }


def signs(one: Recorded, weight: float, load: dict[str, Any]) -> dict[str, Any]:
    """The best strides at three settings and where searches with the fulcrum free end from each,
    squared activations least, with one weight of able-bodied walking; `beyond` of what `equal_load`
    lacks."""
    search, sweep = one.search("activation", normal_weight=weight, positions=3), list[Fixed]()
    swept(search, one.solution.last, sweep, chains=True)
    over = [row.solution for row in sweep if row.solution is not None]
    free = [search.free(solution.last, "free") for solution in over]
    rows = [outcomes(solution, search.stride) for solution in over]
    published, steady = (
        (published_signs(rows), steady_signs(rows)) if len(over) == len(sweep) else ({}, {})
    )
    null = [
        {name: values[k] for name, values in load["outcomes"].items()}
        for k in range(len(load["settings_mm"]))
    ]
    return {
        "recorded_mm": one.recording.own_m / MM,
        "weight": weight,
        "tried": [row.tried for row in sweep],
        "signs": published,
        "count": sum(value is True for value in published.values()) if published else None,
        "steady": steady,
        "beyond": beyond_the_load(rows, null) if published else {},
        "free": [
            {"status": end.status, "fulcrum_mm": position_mm(end), "cost": end.last_cost}
            for end in free
        ],
        "outcomes": {name: [row[name] for row in rows] for name in SHOWN},
    }


def main() -> None:
    """Computes, prints and stores all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument(
        "--quick", action="store_true", help="one trial, one weight, one cost; needs --out"
    )
    arguments = parser.parse_args()
    if arguments.quick and arguments.out == RESULTS:
        parser.error("a part of the study must not replace it all: give --out")
    paths = {path.stem: path for path in embedded_trials("exact")}
    quick = arguments.quick
    results: dict[str, Any] = {
        "format": "vsf_drake adaptive stride 4",
        "synthetic": True,
        "signs_of": SIGNS_OF,
    }
    own = StrideOptions().normal_weight
    results["able_bodied"] = able_bodied(exact(paths["medium_1"]), (own,) if quick else TRIED)
    for weight, rows in results["able_bodied"]["weights"].items():
        print(
            "able-bodied", weight, {speed: row["within"] for speed, row in rows.items()}, flush=True
        )
    coarse = {name: Recorded(paths[name], COARSE) for name in (["medium_1"] if quick else paths)}
    results["found"] = {} if quick else {name: found(one) for name, one in coarse.items()}
    for name, row in results["found"].items():
        print(name, row["own_mm"], row["consistent_mm"], row["recording_mm"], flush=True)
    chosen = ["medium_1"] if quick else ["low_1", "medium_1", "high_1"]
    results["costs"] = {}
    for name in chosen:
        one = coarse[name] if quick else Recorded(paths[name], FINE)
        results["costs"][name] = {"consistent_wall_s": one.wall_s} | {
            cost: carried_out(one, cost) for cost in (("activation",) if quick else FREE_COSTS)
        }
        print(name, results["costs"][name], flush=True)
    results["speeds"] = {} if quick else speeds(coarse["medium_1"])
    results["equal_load"] = (
        {} if quick else {name: equal_load(coarse[name].tuning.trial) for name in chosen}
    )
    results["signs"] = [
        signs(coarse[name], factor * own, results["equal_load"][name])
        for name in chosen
        for factor in (() if quick else FACTORS)
    ]
    for row in results["signs"]:
        print(
            row["recorded_mm"], row["weight"], row["count"], row["beyond"], row["free"], flush=True
        )
    inputs = {
        file: sha for path in paths.values() for file, sha in hashes(load_trial(path)).items()
    }
    results["provenance"] = provenance(inputs) | {"sources": made_by("adaptive_stride.py")}
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_json(arguments.out / "adaptive_stride.json", plain(results), sort=False)
    if quick and set(results["costs"]["medium_1"]["activation"]["status"]) != {"optimal"}:
        sys.exit("the stride that adapts was not found")


if __name__ == "__main__":
    main()
