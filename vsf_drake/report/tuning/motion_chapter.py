"""The chapter on motion and forces at the optimum; a level 1 tuning has forces only."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vsf_drake.report.pieces import Chapter, Missing, Picture, Piece, Text
from vsf_drake.report.tuning.force_figure import FEET, SETTINGS, drawn_trials, stance_force_figure, stride_force_figure
from vsf_drake.report.tuning.motion_figure import motion_figure, root_mean_squares, torque_figure
from vsf_drake.report.tuning.words_of_figures import spans

TITLE = "Motion and forces"
_AGAIN = {"_recorded": "the recorded ones", "_resimulated_prescribed": "those simulated again with the motion "
          "prescribed", "_resimulated_feedback": "those simulated again with torques and feedback"}


def motion_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """What there is of it: forces, motion, torques."""
    pieces: list[Piece] = []
    if table["level"] == 1:
        pieces.append(Text("The motion is the recorded one at every setting, so that only forces are shown."))
    if drawn_trials(table, arrays):
        pieces.append(Picture(
            name="force", figure=stance_force_figure(table, arrays), alt=_stance_alt(table, arrays),
            caption="Ground reaction force of the prosthetic foot by setting, in three trials at most; in grey, as "
                    "recorded, at the setting of the recording (the plate's; the model's where there is no plate)."))
    if "phase" in arrays and any(f"grf_{foot}" in arrays for foot in FEET):
        pieces.append(Picture(
            name="stride_force", figure=stride_force_figure(table, arrays), alt=_stride_alt(arrays),
            caption="Ground reaction forces over the gait cycle: of the optimisation, of the plates (grey), and "
                    "simulated again by the stepper with the whole keel, once with the optimised motion prescribed "
                    "and once driven by the optimised torques with stabilising feedback."))
    if {"phase", "q", "names"} <= set(arrays):
        pieces.append(Picture(
            name="motion", figure=motion_figure(table, arrays), alt=_motion_alt(arrays),
            caption="Coordinates over the gait cycle, optimised and recorded. The pelvis's forward way is shown "
                    "without its steady progress."))
    if {"phase", "torque"} <= set(arrays):
        pieces.append(Picture(
            name="torque", figure=torque_figure(table, arrays), alt=_torque_alt(arrays),
            caption="Joint torques over the gait cycle; recorded are those of inverse dynamics of the recorded "
                    "motion with its plates."))
    if not any(isinstance(piece, Picture) for piece in pieces):
        pieces.append(Missing("These results hold no motion and no forces."))
    return Chapter(name="motion", title=TITLE, pieces=tuple(pieces))


def _stance_alt(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> str:
    said = []
    for trial, prefix in drawn_trials(table, arrays).items():
        peaks = [f"{name} {np.nanmax(np.asarray(arrays[prefix + name])[:, 2]):.0f} N"
                 for name in ("recorded", *SETTINGS) if prefix + name in arrays]
        said.append(f"{trial}: {', '.join(peaks)}" if trial else ", ".join(peaks))
    return f"Force of the prosthetic foot by setting. Largest vertical force, {'; '.join(said)}."


def _stride_alt(arrays: Mapping[str, np.ndarray]) -> str:
    said = []
    for foot, name in FEET.items():
        own = arrays.get(f"grf_{foot}")
        for suffix, other in _AGAIN.items():
            known = arrays.get(f"grf_{foot}{suffix}")
            if own is not None and known is not None and np.shape(own) == np.shape(known):
                off = float(np.sqrt(np.mean(np.sum((np.asarray(own) - np.asarray(known)) ** 2, axis=1))))
                said.append(f"{name}: {off:.0f} N from {other}")
    return "Ground reaction forces of both feet over the gait cycle; root mean square differences of the optimised " \
           f"ones. {'; '.join(said) or 'There is nothing to compare them with'}."


def _motion_alt(arrays: Mapping[str, np.ndarray]) -> str:
    off = root_mean_squares(arrays, "q")
    names = [str(name) for name in arrays["names"]]
    if off is None:
        return f"The optimised motion over the gait cycle: {spans(arrays['q'], names)}."
    parts = [f"{name.replace('_', ' ')} {1e3 * value:.1f} mm" if name in ("pelvis_tx", "pelvis_ty") else
             f"{name.replace('_', ' ')} {np.degrees(value):.1f}°" for name, value in zip(names, off, strict=True)]
    return f"Optimised against recorded motion; root mean square differences: {', '.join(parts)}."


def _torque_alt(arrays: Mapping[str, np.ndarray]) -> str:
    torque = np.asarray(arrays["torque"])
    names = [str(name) for name in arrays.get("names", ())][-torque.shape[1]:] or ["torque"] * torque.shape[1]
    parts = [f"{name.replace('_', ' ')} {values.min():.0f} to {values.max():.0f} N m"
             for name, values in zip(names, torque.T, strict=True)]
    return f"Joint torques over the gait cycle: {', '.join(parts)}."
