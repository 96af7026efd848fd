"""The chapter "Can two settings be told apart?": a function of its saved section."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from vsf_drake.report.page import Bullets, Chapter, Column, Grid, Heading, Missing, Picture, Piece, Text
from vsf_drake.report.style import MARKERS, NEUTRAL, condition_colour, label, new_figure, style

TITLE = "Can two settings be told apart?"


def settings_chapter(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Chapter:
    """The answer, what the model predicts against what is detectable, and how that was found."""
    pieces: list[Piece] = [Text(table["answer"])]
    if not table["outcomes"]:
        return Chapter(name="settings", title=TITLE, pieces=(*pieces, Missing("There is nothing to show.")))
    pieces += [
        Text(paper_words(table)), Heading("With the motion held"),
        Text("Each recorded motion is walked at every position of the fulcrum, everything else equal. This is what the "
             "model predicts of turning the fulcrum without changing the gait: the foot is bent by the same motion, "
             "and its force follows its stiffness. It asks whether model and recording are good enough to tell which "
             "setting was in the foot."),
        Picture(name="settings_effects", figure=settings_effect_figure(table, arrays), alt=effect_alt(table),
                caption="Six outcomes as differences from the middle position. Coloured: each trial; black: their "
                        "mean. A difference inside a grey band is not detectable at 95 % with one walk at each "
                        "position; the bands are nested, the darkest is of the same recording."),
        outcome_grid(table),
        Picture(name="settings_travel", figure=settings_travel_figure(table), alt=travel_alt(table),
                caption="The travel of the fulcrum, half of it to each side of the middle of its range, from which on "
                        "the predicted difference exceeds what is detectable."),
        travel_grid(table),
        Picture(name="settings_pairs", figure=settings_pairs_figure(table), alt=pairs_alt(table),
                caption="The predicted difference of each pair of positions over the smallest detectable one; dark "
                        "cells (above 1) are told apart. Neighbouring positions stand on the left of each panel."),
        pair_grid(table), *([Text(words)] if (words := energy_words(table)) else [])]
    if table["as_walked"]:
        pieces += [
            Heading("As the settings were walked"),
            Text("At another setting a person also moves otherwise, which can make up for much of the difference. Here "
                 "each setting is walked with the motion that was recorded at it. The error's half width is what the "
                 "model may err by in such a difference, which the plates tell: t times the standard error of "
                 "(simulated less measured), within settings. That of the strides is the same of the simulated strides "
                 "themselves, which differ at one setting too. Energy has no plate; it is held against the strides "
                 "alone."
                 + (" The trials are synthetic: how motion and force change with the setting was chosen by who made "
                    "them." if table["synthetic"] else "")),
            walked_grid(table)]
    pieces += [Heading("The fulcrum from the force alone"), Text(inverse_words(table)), inverse_grid(table),
               Heading("How this was found"), Bullets(method_lines(table))]
    return Chapter(name="settings", title=TITLE, pieces=tuple(pieces))


# What the model predicts when the fulcrum is moved under the same motion, against what is detectable.


SHOWN = ("resultant_first_bw", "resultant_second_bw", "vertical_trough_bw", "propulsion_bw", "cop_mid_stance_fl",
         "energy_stored_j")
DESIGNS = {"same_recording": "same recording", "same_session": "two recordings, one session",
           "two_sessions": "two sessions"}
_SHADES = {"two_sessions": "0.93", "same_session": "0.84", "same_recording": "0.70"}
_ROUND = 0.25


def settings_effect_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """Six outcomes over the fulcrum's position, each as a difference from the middle position."""
    positions = np.array(table["positions_mm"], dtype=float)
    middle = int(np.argmin(np.abs(positions - 0.5 * (positions[0] + positions[-1]))))
    effects = np.array(arrays["effects"], dtype=float)
    recorded = [trial["fulcrum_mm"] for trial in table["trials"]]
    with style():
        figure = new_figure(10.6, 6.4)
        for axes, name in zip(figure.subplots(2, 3, sharex=True).ravel(), SHOWN, strict=True):
            row = next(row for row in table["outcomes"] if row["name"] == name)
            column = table["names"].index(name)
            known = row["sdd_same_recording"] is not None
            _bands(axes, table["pairs"], name, positions, middle, "" if known else "noise_")
            change = effects[:, :, column] - effects[:, middle:middle + 1, column]
            for values, at in zip(change, recorded, strict=True):
                axes.plot(positions, values, color=condition_colour(1e-3 * at), linewidth=1.0)
            axes.plot(positions, np.nanmean(change, axis=0), color="black", linewidth=2.2, marker="o", markersize=4.5)
            axes.axhline(0.0, color="0.4", linewidth=0.8)
            axes.set_xticks(positions)
            label(axes, x="fulcrum from the keel's end (mm)",
                  y=f"difference from {positions[middle]:g} mm ({row['unit']})",
                  title=row["title"] + ("" if known else ": noise alone"))
        settings = sorted(set(recorded))
        handles = [Patch(facecolor=_SHADES[d], edgecolor="0.6", label=f"not detectable: {DESIGNS[d]}")
                   for d in reversed(_SHADES)]
        handles += [Line2D([], [], color="black", linewidth=2.2, marker=MARKERS[0], markersize=4.5,
                           label="mean of the trials"),
                    *(Line2D([], [], color=condition_colour(1e-3 * x), label=f"trials recorded at {x:g} mm")
                      for x in settings)]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        figure.suptitle(("SYNTHETIC trials. " if table["synthetic"] else "")
                        + "The same motion walked at every position of the fulcrum", x=0.01, ha="left", fontsize=10.5)
        figure.draw_without_rendering()
    return figure


def _bands(axes: Axes, pairs: Sequence[Mapping[str, Any]], name: str, positions: np.ndarray, middle: int,
           prefix: str) -> None:
    own = [row for row in pairs if row["outcome"] == name]
    here = positions[middle]
    for design, shade in _SHADES.items():
        found = {row["to_mm"] if row["from_mm"] == here else row["from_mm"]: row[f"{prefix}sdd_{design}"]
                 for row in own if here in (row["from_mm"], row["to_mm"])}
        known = [(x, limit) for x, limit in sorted(found.items()) if limit is not None]
        if len(known) < len(found):
            continue
        for side in ([item for item in known if item[0] < here], [item for item in known if item[0] > here]):
            x = np.array([at for at, _ in side])
            limit = np.array([value for _, value in side])
            near = np.argmin(np.abs(x - here))
            at = np.append(x, here)
            wide = np.append(limit, limit[near])
            order = np.argsort(at)
            axes.fill_between(at[order], -wide[order], wide[order], color=shade, linewidth=0.0, zorder=0)


# Which pairs of positions are told apart, outcome by outcome; and the smallest travel that is.


_TOLD, _LESS, _UNKNOWN = "0.25", "0.93", "white"
_DARK = ("black", "0.35", "0.6")


def pairs_of(table: Mapping[str, Any]) -> list[tuple[float, float]]:
    """Pairs of positions, near ones first."""
    found = dict.fromkeys((row["from_mm"], row["to_mm"]) for row in table["pairs"])
    rank = {x: i for i, x in enumerate(table["positions_mm"])}
    return sorted(found, key=lambda pair: (rank[pair[1]] - rank[pair[0]], pair))


def settings_pairs_figure(table: Mapping[str, Any]) -> Figure:
    """One panel a design; dark cells are told apart, with the effect over the limit in each."""
    pairs, rows = pairs_of(table), table["outcomes"]
    found = {(row["outcome"], row["from_mm"], row["to_mm"]): row for row in table["pairs"]}
    with style():
        figure = new_figure(11.0, 1.7 + 0.27 * len(rows))
        for axes, (design, title) in zip(figure.subplots(1, 3, sharey=True), DESIGNS.items(), strict=True):
            for i, outcome in enumerate(rows):
                prefix = "" if outcome["sdd_same_recording"] is not None else "noise_"
                for j, pair in enumerate(pairs):
                    row = found[(outcome["name"], *pair)]
                    apart, limit = row[f"{prefix}told_apart_{design}"], row[f"{prefix}sdd_{design}"]
                    face = _UNKNOWN if apart is None else _TOLD if apart else _LESS
                    axes.add_patch(Rectangle((j - 0.47, i - 0.45), 0.94, 0.9, facecolor=face, edgecolor="0.7",
                                             linewidth=0.5))
                    text = "–" if apart is None else _ratio(abs(row["effect"]) / limit)
                    axes.text(j, i, text, ha="center", va="center", fontsize=6.5, color="white" if apart else "black")
            axes.set_xlim(-0.6, len(pairs) - 0.4)
            axes.set_ylim(len(rows) - 0.4, -0.6)
            axes.set_xticks(range(len(pairs)), [f"{a:g}–{b:g}" for a, b in pairs], rotation=90, fontsize=7.5)
            axes.set_yticks(range(len(rows)), [
                row["title"] + ("" if row["sdd_same_recording"] is not None else " (noise alone)") for row in rows])
            axes.grid(False)
            axes.tick_params(length=0)
            label(axes, x="pair of positions (mm)", y="", title=title[0].upper() + title[1:])
        figure.axes[0].set_ylabel("outcome; in the cells: effect over limit (1)")
        handles = [Patch(facecolor=_TOLD, edgecolor="0.7", label="told apart"),
                   Patch(facecolor=_LESS, edgecolor="0.7", label="not told apart")]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        figure.draw_without_rendering()
    return figure


def settings_travel_figure(table: Mapping[str, Any]) -> Figure:
    """The smallest detectable travel of the fulcrum by outcome and design."""
    rows, reach = table["outcomes"], table["positions_mm"][-1] - table["positions_mm"][0]
    known = any(row["sdd_same_recording"] is not None for row in rows)
    designs = {d: title for d, title in DESIGNS.items() if known or d != "same_recording"}
    beyond = 1.08 * reach
    with style():
        figure = new_figure(9.6, 1.5 + 0.27 * len(rows))
        axes = figure.subplots()
        axes.axvspan(reach, 1.16 * reach, color="0.93", zorder=0)
        handles = []
        for design, title in designs.items():
            k = list(DESIGNS).index(design)
            style_of: dict[str, Any] = {"marker": MARKERS[k], "color": _DARK[k], "linestyle": "", "markersize": 6.5}
            for i, row in enumerate(rows):
                limited = row["sdd_same_recording"] is not None
                if not limited and design == "same_recording":
                    continue
                travel = row[f"{'smallest' if limited else 'noise'}_travel_mm_{design}"]
                axes.plot(beyond if travel is None else travel, i + 0.22 * (k - 1), clip_on=False,
                          markerfacecolor=_DARK[k] if travel is not None else "white", **style_of)
            handles.append(Line2D([], [], label=title, **style_of))
        handles.append(Line2D([], [], color=NEUTRAL, markerfacecolor="white", marker="o", linestyle="",
                              label="more than the range"))
        axes.set_yticks(range(len(rows)), [
            row["title"] + ("" if row["sdd_same_recording"] is not None else " (noise alone)") for row in rows])
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.set_xlim(0.0, 1.16 * reach)
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
        label(axes, x="smallest detectable travel of the fulcrum, around the middle of its range (mm)", y="")
        figure.draw_without_rendering()
    return figure


def _ratio(value: float) -> str:
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


# Sentences of the chapter "Can two settings be told apart?", made of its table.


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


# The tables of the chapter "Can two settings be told apart?".


SHORT_DESIGNS = {"same_recording": "same recording", "same_session": "one session", "two_sessions": "two sessions"}


def outcome_grid(table: Mapping[str, Any]) -> Grid:
    """What is detectable, by outcome; where the model's error is unknown, by the noise alone."""
    columns = [Column(key="title", heading="outcome"), Column(key="unit", heading="unit"),
               Column(key="effect", heading="effect of 42 mm", form="{:+.3f}"),
               Column(key="model_error_sd", heading="model error, SD", form="{:.3f}"),
               Column(key="model_error_n", heading="walks", form="{:.0f}")]
    for design, title in SHORT_DESIGNS.items():
        columns += [Column(key=f"noise_sdd_{design}", heading=f"{title}: noise alone", form="{:.3f}"),
                    Column(key=f"sdd_{design}", heading=f"{title}: with model error", form="{:.3f}"),
                    Column(key=f"noise_sdd_error_{design}", heading=f"{title}: MC error", form="{:.3f}")]
    return Grid(name="settings_outcomes", columns=columns, rows=table["outcomes"], caption=(
        "Smallest detectable difference (95 %, one walk at each position) for positions 42 mm apart around the middle: "
        "by the noise of kinematics alone, and with the model's error; MC error: Monte Carlo standard error of the "
        "former. Model error: over held-out walks."))


def travel_grid(table: Mapping[str, Any]) -> Grid:
    """The smallest detectable travel, in mm and in N/mm."""
    columns = [Column(key="title", heading="outcome")]
    for design, title in SHORT_DESIGNS.items():
        columns += [Column(key=f"smallest_travel_mm_{design}", heading=f"{title} (mm)", form="{:.0f}"),
                    Column(key=f"smallest_change_n_per_mm_{design}", heading=f"{title} (N/mm)", form="{:.1f}")]
        if design != "same_recording":
            columns.append(Column(key=f"noise_travel_mm_{design}", heading=f"{title}, noise alone (mm)", form="{:.0f}"))
    return Grid(name="settings_travel", columns=columns, rows=table["outcomes"], caption=(
        "Smallest detectable travel of the fulcrum around the middle of its range, and what it changes the foot's "
        "stiffness by; with the model's error unless noise alone is said. An en dash: more than the range, or not "
        "known. By the noise alone the same recording has no smallest travel: effect and noise vanish together."))


def pair_grid(table: Mapping[str, Any]) -> Grid:
    """Whole curves: how far two positions are apart over the stance."""
    columns = [Column(key="from_mm", heading="from (mm)", form="{:g}"),
               Column(key="to_mm", heading="to (mm)", form="{:g}"),
               Column(key="curve", heading="curve"),
               Column(key="unit", heading="unit"),
               Column(key="rms_difference", heading="difference, RMS", form="{:.3f}")]
    for design, title in SHORT_DESIGNS.items():
        columns += [Column(key=f"rms_noise_{design}", heading=f"{title}: noise", form="{:.3f}"),
                    Column(key=f"share_{design}", heading=f"{title}: stance (%)", form="{:.0f}", scale=100.0)]
    return Grid(name="settings_curves", columns=columns, rows=table["curves"], caption=(
        "Whole curves with the motion held: root mean square over stance of the mean difference between two positions, "
        "the noise of kinematics in it, and the share of stance in which the difference exceeds its 95 % limit (each "
        "percent of stance for itself, noise alone)."))


def walked_grid(table: Mapping[str, Any]) -> Grid:
    """Settings as they were walked, each with its own motion."""
    titles = {row["name"]: f"{row['title']} ({row['unit']})" for row in table["outcomes"]}
    said = {True: "yes", False: "no", None: None}
    rows = [row | {"title": titles[row["outcome"]], "told": said[row["told_apart"]],
                   "strides": said[row["beyond_strides"]]} for row in table["as_walked"]]
    return Grid(name="settings_as_walked", rows=rows, columns=[
        Column(key="title", heading="outcome"), Column(key="from_mm", heading="from (mm)", form="{:g}"),
        Column(key="to_mm", heading="to (mm)", form="{:g}"),
        Column(key="trials_from", heading="trials from", form="{:.0f}"),
        Column(key="trials_to", heading="trials to", form="{:.0f}"),
        Column(key="measured", heading="measured", form="{:+.3f}"),
        Column(key="simulated", heading="simulated", form="{:+.3f}"),
        Column(key="error", heading="error", form="{:+.3f}"),
        Column(key="error_half_width", heading="error, half width", form="{:.3f}"),
        Column(key="told", heading="told apart"),
        Column(key="stride_half_width", heading="strides, half width", form="{:.3f}"),
        Column(key="strides", heading="beyond strides")],
        caption="Difference of the settings' means over trials (to less from), on the plates and in the model, each "
                "setting with its own motion. Told apart: both exceed both half widths, of the model's error and of "
                "the strides, with the same sign; by chance at most one of twenty such comparisons would. Trials that "
                "the fit has seen are left out where there are others.")


def inverse_grid(table: Mapping[str, Any]) -> Grid:
    """Estimates of the fulcrum's position, trial by trial."""
    return Grid(name="settings_fulcrum", rows=table["inverse"]["rows"], columns=[
        Column(key="label", heading="trial"), Column(key="role", heading="role"),
        Column(key="fulcrum_mm", heading="true (mm)", form="{:g}"),
        Column(key="estimate_mm", heading="estimate (mm)", form="{:.1f}"),
        Column(key="mean_mm", heading="with noise: mean (mm)", form="{:.1f}"),
        Column(key="sd_mm", heading="SD, sessions (mm)", form="{:.1f}"),
        Column(key="sd_recording_mm", heading="SD, recordings (mm)", form="{:.1f}"),
        Column(key="edge_share", heading="at an end (%)", form="{:.0f}", scale=100.0),
        Column(key="model_sd_mm", heading="model's own walk: SD, sessions (mm)", form="{:.1f}"),
        Column(key="model_sd_recording_mm", heading="model's own walk: SD, recordings (mm)", form="{:.1f}")],
        caption="Position of the fulcrum with the least RMS error of the resultant against the measured plate, without "
                "and with noise of kinematics; and against the model's own walk at "
                f"{table['inverse']['middle_mm']:g} mm. At an end of the range an estimate can err to one side only.")
