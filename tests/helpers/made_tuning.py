"""Tables and arrays of tunings, MADE UP from formulas for the tests: no foot and no person is behind any number."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.common import FORMAT
from vsf_drake.analysis.tuning.schedule import DESCRIPTORS, make_schedule, policy_table

NAMES = ("pelvis_tilt", "pelvis_tx", "pelvis_ty", "hip_flexion_r", "knee_angle_r", "hip_flexion_l", "knee_angle_l",
         "ankle_angle_l")
BEST_MM = 104.2
POSITIONS = np.linspace(66.0, 151.0, 18)


def cost_of(mm: Any) -> Any:
    """A parabola with its least value, 2, at BEST_MM."""
    return 2.0 + 2e-4 * (np.asarray(mm) - BEST_MM) ** 2


def made_table(**changes: Any) -> dict[str, Any]:
    """A tuning of level 1 that ended well; `changes` replace keys."""
    def load(mm: Any) -> Any:
        return 0.6 * cost_of(mm) + 2e-3 * (mm - BEST_MM)

    sweep = [{"fulcrum_mm": mm, "cost": cost_of(mm), "terms": {"knee": load(mm), "socket": cost_of(mm) - load(mm)},
              "outcomes": {"cost": cost_of(mm), "push_off": 20.0 - 0.05 * mm, "peak": 800.0 + 0.01 * mm}}
             for mm in POSITIONS.tolist()]

    def outcome(name: str, label: str, unit: str, at: Any, uncertainty: float, matters: bool | None) -> dict[str, Any]:
        return {"name": name, "label": label, "unit": unit, "softest": at(66.0), "optimum": at(BEST_MM),
                "stiffest": at(151.0), "recorded": at(66.0), "uncertainty": uncertainty, "matters": matters,
                "sentence": f"{label} is made up."}

    return {
        "format": FORMAT, "level": 1, "cost_name": "joint_load", "cost_label": "load of the intact knee",
        "cost_unit": "BW", "optimal": True, "status": "first-order optimality to 1e-6", "fulcrum_mm": BEST_MM,
        "cost": float(cost_of(BEST_MM)), "at_bound": [], "fulcrum_interval_mm": [98.0, 111.0],
        "interval_meaning": "cost within its uncertainty",
        "design": [{"name": "fulcrum", "unit": "mm", "value": BEST_MM, "low": 66.0, "high": 151.0, "default": 66.0}],
        "terms": [{"name": "knee", "label": "intact knee", "value": float(load(BEST_MM)), "share": 0.6},
                  {"name": "socket", "label": "socket", "value": float(cost_of(BEST_MM) - load(BEST_MM)),
                   "share": 0.4}],
        "sweep": sweep, "outcomes": [
            outcome("cost", "load of the intact knee", "BW", lambda mm: float(cost_of(mm)), 0.05, True),
            outcome("push_off", "push-off work", "J", lambda mm: 20.0 - 0.05 * mm, 0.5, True),
            outcome("peak", "first peak of the force", "N", lambda mm: 800.0 + 0.01 * mm, 5.0, False)],
        "solver": {"name": "SNOPT", "message": "optimal", "iterations": 12, "evaluations": 30, "violation": 1e-9,
                   "optimality": 2e-7},
        "confirmed_by": [{"solver": "IPOPT", "fulcrum_mm": 104.3, "cost": 2.0001, "success": True, "start": "warm",
                          "message": "solved"}],
        "starts": [{"fulcrum_mm": x, "end_mm": BEST_MM + 1e-3 * x, "cost": 2.0, "success": True}
                   for x in (66.0, 108.0, 151.0)],
        "checks": [{"name": "brute", "label": "fine sweep", "value": 0.3, "unit": "mm", "target": 1.0, "met": True,
                    "sentence": "The sweep's least is as near as that."}],
        "tasks": [{"label": label, "fulcrum_mm": mm, "cost": 2.0, "cost_common": 2.0 + 2e-4 * (mm - 104.0) ** 2}
                  for label, mm in (("slow", 90.0), ("medium", 104.0), ("fast", 120.0))],
        "common_fulcrum_mm": 104.0,
        "pareto": [{"weight": w, "fulcrum_mm": 80.0 + 50.0 * w, "first": 2.0 + w**2, "second": 2.0 + (1.0 - w) ** 2}
                   for w in (0.0, 0.25, 0.5, 0.75, 1.0)],
        "pareto_names": ["joint_load", "push_off"],
        "robustness": [{"what": "contact stiffness + 1 SD", "fulcrum_mm": 107.0, "cost": 2.1},
                       {"what": "contact stiffness - 1 SD", "fulcrum_mm": 101.5, "cost": 1.9},
                       {"what": "friction + 1 SD: not solved", "fulcrum_mm": None, "cost": None}],
        "trials": ["low_2", "medium_2", "high_2"], "recorded_mm": [66.0, 108.0, 151.0], "synthetic": True,
        "notes": ["MADE UP FOR A TEST."], "wall_s": 12.3,
        "provenance": {"versions": {"vsf-drake": "0"}, "inputs_sha256": {"low_2.yaml": "00ff"}, "seed": 0,
                       "options": {"level": 1, "pareto": None, "design": ["fulcrum"], "weights": {"joint_load": 1.0},
                                   "quick": False}},
    } | changes


def made_arrays() -> dict[str, np.ndarray]:
    """Arrays of a tuning of level 1 of three trials."""
    time = np.linspace(0.0, 0.7, 90)
    force = np.column_stack([-100.0 * np.cos(np.pi * time / 0.7), 10.0 * time, 800.0 * np.sin(np.pi * time / 0.7)])
    own = np.stack([cost_of(POSITIONS + shift) + 0.1 * k for k, shift in enumerate((-8.0, 0.0, 8.0))], axis=1)
    found = {"sweep_mm": POSITIONS, "sweep_cost_trials": own}
    for i in range(3):
        found[f"trial_{i}_time"] = time
        for name, factor in (("softest", 0.95), ("optimum", 1.0), ("stiffest", 1.08), ("recorded", 1.01)):
            found[f"trial_{i}_{name}"] = factor * (1.0 - 0.1 * i) * force
    return found


def made_stride_table(**changes: Any) -> dict[str, Any]:
    """A tuning of level 2: no tasks, no single trials."""
    return made_table(level=2, trials=["medium_2"], recorded_mm=[108.0], tasks=[], common_fulcrum_mm=None) | changes


def made_stride_arrays() -> dict[str, np.ndarray]:
    """Arrays of a tuning of level 2."""
    phase = np.linspace(0.0, 1.0, 41)
    wave = np.column_stack([np.sin(2.0 * np.pi * phase + k) for k in range(8)])
    q = 0.3 * wave
    q[:, 1], q[:, 2] = 1.4 * phase + 0.01 * wave[:, 1], 0.95 + 0.02 * wave[:, 2]
    torque = 60.0 * wave[:, 3:]
    force = np.column_stack([120.0 * np.sin(2.0 * np.pi * phase), 800.0 * np.clip(np.sin(np.pi * phase / 0.6), 0, 1)])
    found = {"phase": phase, "names": np.array(NAMES), "q": q, "q_recorded": q + 0.02, "torque": torque,
             "torque_recorded": 1.1 * torque}
    for foot, shift in (("prosthetic", 0), ("intact", 20)):
        own = np.roll(force, shift, axis=0)
        found |= {f"grf_{foot}": own, f"grf_{foot}_recorded": 1.03 * own,
                  f"grf_{foot}_resimulated_prescribed": 0.98 * own, f"grf_{foot}_resimulated_feedback": 0.96 * own}
    return found


def small_table(**changes: Any) -> dict[str, Any]:
    """A tuning of level 1 with a setting and its cost, and one figure, that of the cost: quick to write."""
    return failed_table(optimal=True, status="solved", sweep=made_table()["sweep"]) | changes


def failed_table(**changes: Any) -> dict[str, Any]:
    """A tuning that stopped at its first iterate, with nothing but a position."""
    bare = {key: [] for key in ("sweep", "outcomes", "terms", "design", "tasks", "pareto", "pareto_names", "robustness",
                                "checks", "confirmed_by", "starts")}
    return made_table(optimal=False, status="the iteration limit was reached", fulcrum_interval_mm=None,
                      interval_meaning="", common_fulcrum_mm=None, **bare) | changes


SPEEDS, BEST, REACH = (0.8, 1.2, 1.6), (75.0, 105.0, 125.0), (66.0, 151.0)


def made_schedule(
    *, optimal: bool = True, matters: bool = True, described: bool = True, **changes: Any
) -> dict[str, Any]:
    """MADE UP: three parabolas, 2 + 1e-4 (mm - best)² BW, as the tunings of three speeds."""
    x = np.linspace(*REACH, 86)
    known = dict.fromkeys(DESCRIPTORS)
    tuned = [(f"speed {speed}", known | ({"speed_m_per_s": speed} if described else {}), {
        "fulcrum_mm": best, "cost": 2.0, "cost_name": "joint_load", "optimal": optimal or best != BEST[1],
        "status": "solved" if optimal or best != BEST[1] else "the iteration limit was reached",
        "sweep": [{"fulcrum_mm": mm, "cost": 2.0 + 1e-4 * (mm - best) ** 2} for mm in x.tolist()],
        "outcomes": [{"name": "cost", "matters": matters}], "fulcrum_interval_mm": [best - 4.0, best + 4.0]})
             for speed, best in zip(SPEEDS, BEST, strict=True)]
    table = policy_table(make_schedule(tuned, reach_mm=REACH, resolution_mm=0.5))
    for row, best in zip(table["tasks"], BEST, strict=True):
        row |= {"trials": [f"{row['label']}/walk"], "recorded_mm": [66.0],
                "sweep": {"fulcrum_mm": x.tolist(), "cost": (2.0 + 1e-4 * (x - best) ** 2).tolist()}}
    return {**table, "cost_name": "joint_load", "cost_label": "load of the intact knee", "cost_unit": "BW", "level": 1,
            "synthetic": True, "notes": ["MADE UP FOR A TEST."], "wall_s": 3.0,
            "provenance": {"versions": {"vsf-drake": "0"}, "options": {"quick": True}}} | changes
