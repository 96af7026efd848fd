"""Sentences of the walking chapter; every number is from the saved section."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vsf_drake.report.validation.walking.difference_figure import main_group
from vsf_drake.report.validation.walking.ensemble_figure import NAMES

ROLES = {
    "held_out": ("held out", "What the fit has not seen"), "fitted": ("fitted", "What it was fitted to"),
    "offsets_fitted": ("offsets fitted", "With offsets fitted to each walk's own plate, which is no prediction")}
POINTWISE = "pointwise bootstrap"
"""The method of a section that was made without spm1d, as it is saved."""
DEFINITIONS = (
    "Forces: both low-passed at 40 Hz, time-locked, over each measured stance ± 0.25 s; along and across the direction "
    "of walking. The resultant is the length of the filtered force.",
    "Impulse: running integral of the resultant from the plate's heel strike.",
    "Centre of pressure (CoP): both low-passed at 6 Hz, at 101 points of the measured stance, where model and plate "
    "both carry more than 20 N. Free moment: about the vertical (up +) through each one's own centre of pressure, "
    "filtered and taken at the same points.",
    "Times: the vertical force passes 20 N; model less plate, late is positive.",
    "R² is 1 - SSE/SST, not a squared correlation.",
    "Null model: the measured resultant of another walk, one that the fit has seen if any is here, stretched to this "
    "walk's measured stance; of several the best. It knows the measured times, which the model does not.")


def findings(table: Mapping[str, Any]) -> list[str]:
    """A sentence a role, the softest claims last."""
    return [f"{opening} ({own['n']} walk{'s' * (own['n'] != 1)}): {_errors(own)}"
            for key, (_, opening) in ROLES.items() if (own := table[key])]


def times(table: Mapping[str, Any]) -> str:
    """Stance times, strikes and lifts over all walks; "" where none is known."""
    rows = table["rows"]
    parts = [f"{name} {_mean(rows, key, 1e3):+.1f} ms" for name, key in (
        ("heel strike", "heel_strike_error_s"), ("toe-off", "toe_off_error_s"), ("stance", "stance_error_s"))
        if any(row[key] is not None for row in rows)]
    if not parts:
        return ""
    r = "" if table["stance_r"] is None else (
        f" Stance times of model and plate correlate with r = {table['stance_r']:.4f} over {table['stance_n']} walks; "
        "a correlation does not see a constant error.")
    return f"Model less plate, mean over walks: {', '.join(parts)}.{r}"


def angles(table: Mapping[str, Any]) -> str:
    """How the joints follow, and what the fit changed."""
    paper = table["paper"]
    if table["angle_rmse_deg"] is None:
        return "No rotation was prescribed."
    lag = "not known" if table["angle_lag_ms"] is None else f"{abs(table['angle_lag_ms']):.3f} ms at most"
    r2 = "not known" if table["angle_r2"] is None else f"{table['angle_r2']:.4f}"
    changed = table["angle_recording_rmse_deg"]
    fit = "" if not changed else (
        f" Against the recording itself the difference is {changed:.2f}° RMS: that is what the fit corrected of the "
        "recorded angles, not a tracking error.")
    return (f"Joint angles follow what they are told with an RMS error of {table['angle_rmse_deg']:.2g}° (paper "
            f"{paper['angle_rmse_deg']:g}°), R² {r2} (paper {paper['angle_r2']:g}) and a lag of {lag}. This is so by "
            f"construction: the joints are prescribed, nothing filters them on the way.{fit}")


def sweep(table: Mapping[str, Any]) -> str:
    """What the fulcrum sweep says."""
    swept = [row for row in table["rows"] if row["sweep"] and row["sweep"]["right"] is not None]
    unknown = [row["label"] for row in table["rows"] if row["sweep"] and row["sweep"]["right"] is None]
    ends = sum(row["sweep"]["at_end"] for row in swept)
    inner = [abs(row["sweep"]["off_mm"]) for row in swept
             if not row["sweep"]["at_end"] and row["sweep"]["off_mm"] is not None]
    end = f" In {ends} of them it stood at an end of the carriage, where an error outwards cannot show." if ends else ""
    far = f" {'Elsewhere it' if ends else 'It'} is at most {max(inner):.1f} mm off." if inner else ""
    tuned = " Offsets were fitted with the fulcrum where it stood, which favours that place." if table[
        "offsets_fitted"] else ""
    open_ = f" Where it is least is not known of {', '.join(unknown)}: walks of the sweep failed." if unknown else ""
    made = "The fulcrum is moved over its carriage and each walk made again, all else as fitted."
    if not swept:
        return f"{made}{open_}"
    return (f"{made} The error is least within half a setting (10.5 mm) of where the fulcrum stood in "
            f"{table['sweeps_right']} of {table['sweeps']} walk{'s' * (table['sweeps'] != 1)}.{end}{far}{tuned}{open_}")


def differences(table: Mapping[str, Any]) -> list[str]:
    """How it was tested where the curves differ, and what came out over all walks."""
    method, own = table["difference_method"], [d for d in table["differences"] if d["group"] == main_group(table)]
    if method is None:
        return []
    tests = sum(d["method"] is not None for d in table["differences"])
    if method == POINTWISE:
        how = ("Method: pointwise bootstrap bands (95 %, percentile, over walks, seeded); they are pointwise and not "
               "corrected for how many points there are, and with three walks they are no more than the range of the "
               "three, which leaves out the true mean in one case of four. spm1d, which would do better, is not "
               "installed.")
    else:
        how = (f"Method: statistical parametric mapping (spm1d {table['spm1d']}), paired t-test, two-tailed, alpha "
               "0.05 for a whole curve.")
    limits = [(d["n"], d["threshold"]) for d in table["differences"] if d["threshold"] is not None]
    few = f" With {min(limits)[0]} walks |t| must exceed {max(limits, key=lambda p: p[1])[1]:.0f}." if limits else ""
    found = [f"{how} {tests} curves were tested, without correction for their number.{few} That no region is marked is "
             "not agreement: the walks are few."]
    fitted = sum(row["role"] != "held out" for row in table["rows"])
    if fitted:
        found.append(f"{fitted} of the {len(table['rows'])} walks, or their offsets, were fitted; they pull the mean "
                     "difference to zero.")
    for d in own:
        if d["method"] is None:
            continue
        spans = ", ".join(f"{r['start_percent']:.0f}-{r['end_percent']:.0f} % ({r['mean_difference']:+.3g})"
                          for r in d["regions"])
        found.append(f"{NAMES[d['quantity']][0].capitalize()} ({d['n']} walks, {d['unit']}): "
                     f"{spans if spans else 'no region'}; largest mean difference {d['largest_difference']:+.3g}.")
    return found


def _errors(own: Mapping[str, Any]) -> str:
    several = own["n"] > 1
    parts = []
    for key, name, scale, unit, form in (("grf_rmse_bw", "resultant force", 100.0, "% BW", ".1f"),
                                         ("cop_rmse_fl", "centre of pressure", 100.0, "% foot length", ".1f"),
                                         ("impulse_rmse_bws", "impulse", 1.0, "BW s", ".3f")):
        if own[key] is not None:
            worst = own[f"{key}_worst"]
            at = f" (worst {scale * worst:{form}}, {own[f'{key}_worst_trial']})" if several else ""
            parts.append(f"{name} {scale * own[key]:{form}} {unit}{at}")
    text = "RMS error " + ", ".join(parts) + "." if parts else "no error is known."
    if own["beats_null_of"]:
        text += (f" {own['beats_null']} of {own['beats_null_of']} beat the null model"
                 + (f", whose mean is {100.0 * own['null_model_grf_rmse_bw']:.1f} % BW."))
    return text


def _mean(rows: Sequence[Mapping[str, Any]], key: str, scale: float) -> float:
    values = [row[key] for row in rows if row[key] is not None]
    return scale * float(sum(values)) / len(values)
