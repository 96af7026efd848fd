"""Tables of contact fits, made up: with everything in them, and with names and numbers that are hard to show."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.contact_fit.assessment import PUBLISHED

ODD = "<b>odd</b> $x_$ ü"
"""A label that is neither HTML nor a formula."""


def made_trial(label: str = "soft", role: str = "fitted", fulcrum_mm: float = 66.0, **changes: Any) -> dict[str, Any]:
    """A row of a judged fit."""
    metrics = {"grf_rmse_bw": 0.02, "grf_r2": 0.99, "fore_aft_rmse_bw": 0.01, "vertical_rmse_bw": 0.02,
               "cop_rmse_fl": 0.03, "impulse_rmse_bws": 0.004, "scored_window_s": [[0.1, 1.1]]}
    positions = np.linspace(66.0, 151.0, 18)
    errors = [*(0.02 + 0.002 * np.abs(positions[:-1] - fulcrum_mm)), None]
    return {"label": label, "name": f"trial {label}", "file": f"{label}.yaml", "role": role, "synthetic": False,
            "fulcrum_mm": fulcrum_mm, "metrics": metrics, "null_model_grf_rmse_bw": 0.05, "floor_grf_rmse_bw": 0.01,
            "stance_error_s": -0.01, "notes": [], "window_s": [0.0, 1.2],
            "sweep": {"fulcrum_mm": [*positions], "grf_rmse_bw": errors, "true_mm": fulcrum_mm, "best_mm": fulcrum_mm,
                      "right": True}} | changes


def made_parameter(name: str, value: float = 0.5, **changes: Any) -> dict[str, Any]:
    """A row of a free parameter whose prior is 0 within 1."""
    return {"name": name, "unit": "m", "value": value, "start": 0.0, "frozen": False, "at_bound": False,
            "standard_error": 0.3, "interval_95": [value - 0.6, value + 0.6], "share_of_prior": 0.3,
            "spread_over_starts": 0.01, "value_in_prior_sd": value, "interval_in_prior_sd": [value - 0.6, value + 0.6],
            "low": -4.0, "high": 4.0, "prior_mean": 0.0, "prior_scale": 1.0, "prior": True, "logarithmic": False,
            "why": ""} | changes


def made_fit(**changes: Any) -> dict[str, Any]:
    """The table of a joint fit of two trials with a bench, judged by a third."""
    parameters = [made_parameter("offset.height"),
                  made_parameter("socket.tz.stiffness", 3.9, at_bound=True, unit="N/m"),
                  made_parameter("contact.heel.force", -0.2, share_of_prior=0.9, unit="N"),
                  made_parameter("curve.knee_angle_r.0", 0.1, unit="rad"), made_parameter("trial.soft.height", 0.0),
                  made_parameter("friction.mu_static", frozen=True, interval_95=None, standard_error=None, unit="1",
                                 share_of_prior=None, value_in_prior_sd=None, interval_in_prior_sd=None)]
    names = [row["name"] for row in parameters if not row["frozen"]]
    matrix = np.eye(len(names))
    matrix[0, 1] = matrix[1, 0] = -0.95
    return {
        "kind": "fit", "strategy": "joint", "success": True, "message": "converged", "synthetic": False,
        "subject": {"name": "Somebody", "mass_kg": 80.0, "stature_m": 1.8, "prosthetic_side": "right"},
        "trials": [made_trial(), made_trial("stiff", fulcrum_mm=151.0),
                   made_trial(ODD, "held out", 108.0, floor_grf_rmse_bw=None)],
        "verdict": ["The fitted trials are left with 2.0 % body weight.", "Not <so> sure & so on."],
        "bench": {"name": "a foot", "synthetic": False, "max_load_n": 600.0, "uncertainty_n_per_mm": 0.5,
                  "fulcrum_mm": [66.0, 151.0], "measured_n_per_mm": [10.0, 32.0], "model_n_per_mm": [10.4, 31.0],
                  "heel_measured_n_per_mm": 65.0, "heel_model_n_per_mm": 64.0, "rmse_n_per_mm": 0.762},
        "left_out": [{"kind": "trial", "left_out": ["soft"], "grf_rmse_bw": 0.04, "cop_rmse_fl": None, "failed": ""},
                     {"kind": "trial", "left_out": ["stiff"], "grf_rmse_bw": None, "cop_rmse_fl": None,
                      "failed": "the fit failed"}],
        "parameters": parameters, "curves": [{"coordinate": "knee_angle_r", "largest_deg": 0.4,
                                              "at_percent_of_cycle": 30.0}],
        "correlations": {"names": names, "matrix": matrix.tolist()}, "singular_values": [30.0, 4.0, 1.0, 0.2, 0.0],
        "weakest": [{"singular_value": 0.2, "made_of": [{"name": "offset.height", "share": 0.9}]}],
        "unidentified": ["contact.heel.force"], "unidentified_above_share": 0.5, "at_bound": ["socket.tz.stiffness"],
        "together": [{"names": names[:2], "correlation": -0.95}], "together_above": 0.9,
        "noise": {"assumed": {"vertical": 0.025},
                  "ratios": [{"trial": "soft", "series": "vertical", "ratio": 0.4}]},
        "searches": [{"start_cost": 900.0, "cost": 20.0, "success": True, "message": "ftol", "evaluations": 12,
                      "failed": 0},
                     {"start_cost": None, "cost": None, "success": False, "message": "the walk fails where it starts",
                      "evaluations": 1, "failed": 1},
                     {"start_cost": 2000.0, "cost": 19.0, "success": False, "message": "too many", "evaluations": 60,
                      "failed": 0}],
        "best_search": 0, "history": [], "published": PUBLISHED, "options": {"starts": 3, "series": ["vertical"]},
        "seed": 0, "wall_s": 12.0, "versions": {"drake": "1.51"}, "inputs_sha256": {"soft: soft.yaml": "0" * 64},
        "series": ["vertical"]} | changes


def made_curves(trials: int = 3) -> dict[str, np.ndarray]:
    """Arrays of so many trials; the last has no centre of pressure."""
    time = np.linspace(0.0, 1.2, 200)
    force = np.column_stack([0.1 * np.sin(5 * time), 0.0 * time, np.maximum(0.0, np.sin(3 * time))])
    cop = np.linspace(0.0, 0.9, 101)
    found: dict[str, np.ndarray] = {}
    for i in range(trials):
        found |= {f"trial_{i}_time_s": time, f"trial_{i}_measured_bw": force, f"trial_{i}_model_bw": 1.05 * force,
                  f"trial_{i}_cop_measured_fl": cop + 3.0,
                  f"trial_{i}_cop_model_fl": np.full(101, np.nan) if i == trials - 1 else cop + 3.02}
    return found


def failed_fit(**changes: Any) -> dict[str, Any]:
    """What is left of it where the fit failed."""
    whole = made_fit()
    unknown = {"metrics": None, "sweep": None, "null_model_grf_rmse_bw": None, "floor_grf_rmse_bw": None,
               "stance_error_s": None}
    kept = {key: whole[key] for key in ("kind", "strategy", "subject", "synthetic", "bench", "published", "options",
                                        "seed", "versions", "inputs_sha256", "history", "series")}
    kept["bench"] = whole["bench"] | {"model_n_per_mm": None, "heel_model_n_per_mm": None, "rmse_n_per_mm": None}
    return kept | {"success": False, "message": "no <search> converged", "verdict": [], "left_out": [],
                   "parameters": [], "searches": whole["searches"][1:], "best_search": 1, "wall_s": None,
                   "trials": [row | unknown for row in whole["trials"]]} | changes


def paper_fit(**changes: Any) -> dict[str, Any]:
    """A fit by the paper's procedure."""
    history = [{"iteration": i, "rms_n": 100.0 / i, "largest_change": 0.1} for i in (1, 2, 3)]
    parameters = [made_parameter("contact.heel.stiffness", 5e3, unit="N/m^exponent", interval_95=None, start=4e3,
                                 standard_error=None, share_of_prior=None, value_in_prior_sd=None, prior=False,
                                 interval_in_prior_sd=None)]
    whole = made_fit(strategy="paper", message="converged in iteration 3", history=history, initial_rms_n=120.0,
                     rms_n=33.3, simulations=304, failed_simulations=2, searches=[], best_search=None,
                     parameters=parameters, left_out=[])
    for key in ("correlations", "singular_values", "weakest", "unidentified", "together", "noise", "curves",
                "at_bound"):
        del whole[key]
    return whole | changes
