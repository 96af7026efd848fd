"""Sentences of the chapter "Can two settings be told apart?", made of its table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsf_drake.report.validation.settings.effect_figure import DESIGNS, SHOWN

PAPER_RMSE = "10, 13 and 14 % BW"
_LIMIT = 1.96 * 2.0**0.5
"""A standard deviation of one estimate to the 95 % limit of the difference of two."""


def paper_words(table: Mapping[str, Any]) -> str:
    """The paper's question, with the figures on both sides."""
    curves = [row for row in table["curves"] if row["curve"] == "resultant" and row["rms_difference"] is not None]
    words = f"The paper suspects that its error (resultant, RMS, {PAPER_RMSE} on trials that were not fitted) may be " \
            "too large for this. "
    if curves:
        ends = max(curves, key=lambda row: row["to_mm"] - row["from_mm"])
        near = [row["rms_difference"] for row in curves if _neighbours(table, row)]
        words += f"With the motion held, the resultants of {ends['from_mm']:g} and {ends['to_mm']:g} mm are " \
                 f"{_percent(ends['rms_difference'])} BW apart (RMS over stance) and those of neighbouring positions " \
                 f"{_span(near)}: an error of the paper's size is as large as a step between neighbours. "
        if not 0.08 <= max(near, default=0.0) <= 0.2:
            words = words.rpartition(": an error")[0] + ". "
    walked = [row["measured_bw"] for row in table["as_walked_curves"] if row["measured_bw"] is not None]
    if walked:
        words += f"As recorded, each setting with its own motion, the mean measured resultants of two settings are " \
                 f"only {_span(walked)} apart" + (", less than the paper's error. " if max(walked) < 0.1 else ". ")
    if table["held_out_rmse_bw"] is not None:
        words += f"Here the error of {table['held_out_trials']} held-out trials is " \
                 f"{_percent(table['held_out_rmse_bw'])} BW"  + (" (synthetic data). " if table["synthetic"] else ". ")
    return words + "An RMS error alone decides nothing, though: what of it is the same at both settings cancels in " \
                   "their difference, and what is not the same is what counts below."


def energy_words(table: Mapping[str, Any]) -> str:
    """Why the motion held makes energy a poor judge of the ends; nothing if it does not."""
    rows = [row for row in table["pairs"] if row["outcome"] == "energy_stored_j" and row["effect"] is not None]
    if not rows:
        return ""
    ends = max(rows, key=lambda row: row["to_mm"] - row["from_mm"])
    largest = max(rows, key=lambda row: abs(row["effect"]))
    to = {row["to_mm"]: row["effect"] for row in rows if row["from_mm"] == ends["from_mm"]}
    between = max(to.values()) > max(0.0, ends["effect"])
    if abs(ends["effect"]) > 0.5 * abs(largest["effect"]) or ends["noise_told_apart_same_recording"] or not between:
        return ""
    return (f"Stored energy cannot tell the ends apart with the motion held ({ends['effect']:+.2f} J from "
            f"{ends['from_mm']:g} to {ends['to_mm']:g} mm): the same motion bends a stiff keel with more force and "
            "less far than a soft one, because foam, fulcrum and socket give way instead; the product is largest in "
            "between. That a softer setting stores more needs "
            "the force to stay alike, as when the gait adapts to the setting.")


def inverse_words(table: Mapping[str, Any]) -> str:
    """The independent route, and whether it agrees."""
    found = table["inverse"]
    words = "As an independent route the fulcrum is estimated from the resultant alone: the position with the least " \
            "error against the plate. "
    if found["sd_mm"] is not None:
        words += f"Between the ends of the range ({found['trials_interior']} of {len(found['rows'])} trials) " \
                 f"the estimate without added " \
                 f"noise is {found['bias_rms_mm']:.1f} mm off (RMS), and scatters by {found['sd_mm']:.1f} mm (SD) " \
                 f"over sessions and by {found['sd_recording_mm']:.1f} mm over recordings of one session. "
    for design, key in (("same_session", "model_sd_recording_mm"), ("two_sessions", "model_sd_mm")):
        travels = [row[f"noise_travel_mm_{design}"] for row in table["outcomes"]
                   if row[f"noise_travel_mm_{design}"] is not None]
        if found[key] is None:
            continue
        limit = _LIMIT * found[key]
        words += f"Two such estimates ({DESIGNS[design]}, against the model's own walk) differ detectably from " \
                 f"{limit:.0f} mm on; the sharpest single outcome needs " \
                 + (f"{min(travels):.0f} mm by the noise alone. " if travels else "more than the range. ")
        if travels and not 0.6 < min(travels) / limit < 1.7:
            words += "The two routes disagree here: one weighs the whole curve, the other a single peak. "
    return words + "No offset is fitted again after noise is added: a fit to the same plate would take up part of " \
                   "the noise, and part of what tells the fulcrum."


def method_lines(table: Mapping[str, Any]) -> list[str]:
    """Sizes, designs and limits of the method."""
    size = table["noise"]
    return [
        f"Noise of kinematics, SD (chosen: the sizes of the embedded laboratory tier): of a session "
        f"{size['session_deg']:g}° constant and {size['session_smooth_deg']:g}° smooth over the gait cycle in each hip "
        f"and knee angle of the prosthetic side; of a recording {size['recording_deg']:g}° in these angles and the "
        f"pelvis's and {size['recording_mm']:g} mm in the pelvis's place.",
        "Same recording: the fulcrum is moved in the model alone, noise is the same at both positions. One session: "
        "two recordings of the same stride with the session's error in common. Two sessions: nothing in common, and "
        "nothing calibrated away: refitting offsets in each session leaves less.",
        "Model error: standard deviation of (simulated less measured) over held-out walks, twice its square in a "
        "difference, with t for n - 1. Its mean cancels. For the same recording this is an upper bound: what the model "
        "gets wrong of one motion at both positions cancels too, but no trial was recorded at two positions.",
        "A difference beyond the limit arises by chance once in twenty, in each outcome and pair by itself; a true "
        "difference of just its size is found half of the time, one 1.4 times as large in four cases of five. "
        "Averaging recordings narrows what differs between them, never the session's part.",
        f"{table['walks']} walks: {len(table['trials'])} trials at {len(table['positions_mm'])} positions, "
        f"{table['draws']} sessions of {table['recordings_a_draw']} recordings each, seed {table['seed']}, steps of 2 "
        f"ms; {table['failed_walks']} failed.",
        "Stiffness: mean slope from 200 to 600 N of the model's foot on the bench, "
        + ", ".join(f"{k:.1f} N/mm at {x:g} mm" for x, k in
                    zip(table["positions_mm"], table["stiffness_n_per_mm"], strict=True)) + "."]


def effect_alt(table: Mapping[str, Any]) -> str:
    """The finding of the effect figure."""
    low, high = table["positions_mm"][0], table["positions_mm"][-1]
    parts = []
    for name in SHOWN:
        row = next(row for row in table["outcomes"] if row["name"] == name)
        limit = row["sdd_same_recording"]
        limit = row["noise_sdd_same_recording"] if limit is None else limit
        if row["effect_ends"] is not None and limit is not None:
            parts.append(f"{row['title']} {row['effect_ends']:+.2f} {row['unit']} (limit in the same recording about "
                         f"{limit:.2f})")
    return f"Change of six outcomes from {low:g} to {high:g} mm with the motion held: " + "; ".join(parts) + "."


def travel_alt(table: Mapping[str, Any]) -> str:
    """The finding of the travel figure."""
    prefix = "smallest" if any(row["sdd_same_recording"] is not None for row in table["outcomes"]) else "noise"
    parts = []
    for design, title in DESIGNS.items():
        known = [(row[f"{prefix}_travel_mm_{design}"], row["title"]) for row in table["outcomes"]
                 if row[f"{prefix}_travel_mm_{design}"] is not None]
        if known:
            travel, name = min(known)
            parts.append(f"{title}: {travel:.0f} mm at best ({name}), {len(known)} of {len(table['outcomes'])} "
                         "outcomes within the range")
    return "Smallest detectable travel of the fulcrum. " + ("; ".join(parts) or "None within the range") + "."


def pairs_alt(table: Mapping[str, Any]) -> str:
    """The finding of the pairs figure."""
    parts = []
    for design, title in DESIGNS.items():
        said = [row[f"told_apart_{design}"] if row[f"told_apart_{design}"] is not None
                else row[f"noise_told_apart_{design}"] for row in table["pairs"]]
        known = [one for one in said if one is not None]
        parts.append(f"{title}: {sum(known)} of {len(known)} pairs and outcomes told apart")
    return "; ".join(parts) + "."


def _neighbours(table: Mapping[str, Any], row: Mapping[str, Any]) -> bool:
    at = table["positions_mm"]
    return at.index(row["to_mm"]) - at.index(row["from_mm"]) == 1


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _span(shares: list[float]) -> str:
    low, high = (f"{100.0 * share:.1f}" for share in (min(shares), max(shares)))
    return f"{low} % BW" if low == high else f"{low} to {high} % BW"
