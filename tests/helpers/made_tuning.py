"""Records and arrays of tunings, MADE UP from formulas for the tests: no foot and no person is
behind any number."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from vsf_drake.tuning import table as records
from vsf_drake.tuning.common import TuningCheck

NAMES = (
    "pelvis_tilt",
    "pelvis_tx",
    "pelvis_ty",
    "hip_flexion_r",
    "knee_angle_r",
    "hip_flexion_l",
    "knee_angle_l",
    "ankle_angle_l",
)
BEST_MM = 104.2
POSITIONS = np.linspace(66.0, 151.0, 18)


def cost_of(mm: Any) -> Any:
    """A parabola with its least value, 2, at BEST_MM."""
    return 2.0 + 2e-4 * (np.asarray(mm) - BEST_MM) ** 2


def made_table(**changes: Any) -> records.TuningTable:
    """A tuning of level 1 that ended well."""

    def load(mm: Any) -> Any:
        return 0.6 * cost_of(mm) + 2e-3 * (mm - BEST_MM)

    def outcome(
        name: str, label: str, unit: str, at: Any, uncertainty: float, matters: bool | None
    ) -> records.Outcome:
        return records.Outcome(
            name,
            label,
            unit,
            softest=at(66.0),
            optimum=at(BEST_MM),
            stiffest=at(151.0),
            recorded=at(66.0),
            uncertainty=uncertainty,
            matters=matters,
            sentence=f"{label} is made up.",
        )

    best = float(cost_of(BEST_MM))
    sweep = tuple(
        records.SweepPoint(
            mm,
            float(cost_of(mm)),
            {"knee": float(load(mm)), "socket": float(cost_of(mm) - load(mm))},
            {"cost": float(cost_of(mm)), "push_off": 20.0 - 0.05 * mm, "peak": 800.0 + 0.01 * mm},
        )
        for mm in POSITIONS.tolist()
    )
    return dataclasses.replace(
        records.TuningTable(
            format=records.FORMAT,
            level=1,
            cost_name="joint_load",
            cost_label="load of the intact knee",
            cost_unit="BW",
            optimal=True,
            status="first-order optimality to 1e-6",
            fulcrum_mm=BEST_MM,
            cost=best,
            at_bound=(),
            fulcrum_interval_mm=(98.0, 111.0),
            interval_meaning="cost within its uncertainty",
            design=(records.DesignValue("fulcrum", "mm", BEST_MM, 66.0, 151.0, 66.0),),
            terms=(
                records.Term("knee", "intact knee", float(load(BEST_MM))),
                records.Term("socket", "socket", float(best - load(BEST_MM))),
            ),
            sweep=sweep,
            outcomes=(
                outcome(
                    "cost",
                    "load of the intact knee",
                    "BW",
                    lambda mm: float(cost_of(mm)),
                    0.05,
                    True,
                ),
                outcome("push_off", "push-off work", "J", lambda mm: 20.0 - 0.05 * mm, 0.5, True),
                outcome(
                    "peak", "first peak of the force", "N", lambda mm: 800.0 + 0.01 * mm, 5.0, False
                ),
            ),
            solver=records.SolverEnd("SNOPT", "optimal", 12, 30, 2e-7),
            confirmed_by=(records.Confirmation("IPOPT", 104.3, 2.0001, True, "solved"),),
            starts=tuple(
                records.SearchEnd(x, BEST_MM + 1e-3 * x, 2.0, True) for x in (66.0, 108.0, 151.0)
            ),
            checks=(
                TuningCheck(
                    "brute",
                    "fine sweep",
                    0.3,
                    "mm",
                    1.0,
                    True,
                    "The sweep's least is as near as that.",
                ),
            ),
            pareto=tuple(
                records.ParetoPoint(w, 80.0 + 50.0 * w, 2.0 + w**2, 2.0 + (1.0 - w) ** 2)
                for w in (0.0, 0.25, 0.5, 0.75, 1.0)
            ),
            pareto_names=("joint_load", "push_off"),
            robustness=(
                records.ChangedOptimum("contact stiffness + 1 SD", 107.0, 2.1),
                records.ChangedOptimum("contact stiffness - 1 SD", 101.5, 1.9),
                records.ChangedOptimum("friction + 1 SD: not solved", None, None),
            ),
            trials=("low_2", "medium_2", "high_2"),
            recorded_mm=(66.0, 108.0, 151.0),
            synthetic=True,
            notes=("MADE UP FOR A TEST.",),
            wall_s=12.3,
            provenance=records.Provenance(
                versions={"vsf-drake": "0"},
                inputs_sha256={"low_2.yaml": "00ff"},
                seed=0,
                options={
                    "level": 1,
                    "pareto": None,
                    "design": ["fulcrum"],
                    "weights": {"joint_load": 1.0},
                    "quick": False,
                },
            ),
        ),
        **changes,
    )


def made_arrays() -> dict[str, np.ndarray]:
    """Arrays of a tuning of level 1 of three trials."""
    time = np.linspace(0.0, 0.7, 90)
    force = np.column_stack(
        [-100.0 * np.cos(np.pi * time / 0.7), 10.0 * time, 800.0 * np.sin(np.pi * time / 0.7)]
    )
    own = np.stack(
        [cost_of(POSITIONS + shift) + 0.1 * k for k, shift in enumerate((-8.0, 0.0, 8.0))], axis=1
    )
    arrays = {"sweep_mm": POSITIONS, "sweep_cost_trials": own}
    for i in range(3):
        arrays[f"trial_{i}_time"] = time
        for name, factor in (
            ("softest", 0.95),
            ("optimum", 1.0),
            ("stiffest", 1.08),
            ("recorded", 1.01),
        ):
            arrays[f"trial_{i}_{name}"] = factor * (1.0 - 0.1 * i) * force
    return arrays


def made_stride_table(**changes: Any) -> records.TuningTable:
    """A tuning of level 2: no single trials."""
    return made_table(**{"level": 2, "trials": ("medium_2",), "recorded_mm": (108.0,)} | changes)


def made_stride_arrays() -> dict[str, np.ndarray]:
    """Arrays of a tuning of level 2."""
    phase = np.linspace(0.0, 1.0, 41)
    wave = np.column_stack([np.sin(2.0 * np.pi * phase + k) for k in range(8)])
    q = 0.3 * wave
    q[:, 1], q[:, 2] = 1.4 * phase + 0.01 * wave[:, 1], 0.95 + 0.02 * wave[:, 2]
    torque = 60.0 * wave[:, 3:]
    force = np.column_stack(
        [120.0 * np.sin(2.0 * np.pi * phase), 800.0 * np.clip(np.sin(np.pi * phase / 0.6), 0, 1)]
    )
    arrays = {
        "phase": phase,
        "names": np.array(NAMES),
        "q": q,
        "q_recorded": q + 0.02,
        "torque": torque,
        "torque_recorded": 1.1 * torque,
    }
    for foot, shift in (("prosthetic", 0), ("intact", 20)):
        own = np.roll(force, shift, axis=0)
        arrays |= {
            f"grf_{foot}": own,
            f"grf_{foot}_recorded": 1.03 * own,
            f"grf_{foot}_resimulated_prescribed": 0.98 * own,
            f"grf_{foot}_resimulated_feedback": 0.96 * own,
        }
    return arrays


def small_table(**changes: Any) -> records.TuningTable:
    """A tuning of level 1 with a setting and its cost, and one figure, that of the cost: quick to
    write."""
    return failed_table(
        **{"optimal": True, "status": "solved", "sweep": made_table().sweep} | changes
    )


def failed_table(**changes: Any) -> records.TuningTable:
    """A tuning that stopped at its first iterate, with nothing but a position."""
    bare = dict.fromkeys(
        (
            "sweep",
            "outcomes",
            "terms",
            "design",
            "pareto",
            "pareto_names",
            "robustness",
            "checks",
            "confirmed_by",
            "starts",
        ),
        (),
    )
    return made_table(
        **bare
        | {
            "optimal": False,
            "status": "the iteration limit was reached",
            "fulcrum_interval_mm": None,
            "interval_meaning": "",
        }
        | changes
    )
