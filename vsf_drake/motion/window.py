"""The part of a recording to simulate, where kinematics, forces and manifest overlap; a treadmill's belt."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.events import MINIMUM_S, Span, Stance, find_scuffs, find_stances
from vsf_drake.motion.manifest import Window
from vsf_drake.motion.plates import LIGHTEST_BW, PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import GRAVITY, Subject

DEFAULT_STANCE_S = 0.5
MINIMUM_LOAD_N = 200.0
BACKWARD_M_PER_S = -0.3


def trial_window(path: Path, wish: Window | None, trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording],
                 subject: Subject, unmeasured: Mapping[str, Sequence[Span]] | None = None
                 ) -> tuple[Span, tuple[str, ...]]:
    """The window of a trial (s), and notes on it and on the stances in it.

    Args:
        path: the manifest, for messages.
        unmeasured: by side, when a foot stands on ground that no plate measures: a model's force there would be
            compared with zero. Without a wish, the stretch between those of the prosthetic foot that holds most of its
            stances is taken; a wish is kept.

    Raises:
        InputError: window, kinematics and forces do not overlap; the prosthetic foot is hardly or not loaded, or has
            less than 0.15 s of any stance in the window; the window is shorter than the shortest complete stance.
    """
    side = subject.prosthetic_side
    time = plates[side].time_s
    stances = {s: find_stances(plate.time_s, plate.force_W[:, 2]) for s, plate in plates.items()}
    window, notes = _choose_window(wish, (trajectory.start_s, trajectory.end_s), (float(time[0]), float(time[-1])),
                                   path, (unmeasured or {}).get(side, ()), stances[side])
    _check_stances(window, plates[side], stances[side], side, subject.mass_kg, path)
    for s in (side, *(other for other in plates if other != side)):
        notes += _describe_stances(window, stances[s], f"{s} (prosthetic)" if s == side else s)
        scuffs = [(c.start_s, c.end_s) for c in find_scuffs(plates[s].time_s, plates[s].force_W[:, 2])]
        touched = [_words(scuff) for scuff in scuffs if _common(scuff, window)]
        if touched:
            notes.append(f"The {s} foot loads its plate above 20 N outside a stance: {', '.join(touched)}.")
    return window, (*notes, *_describe_treadmill(window, plates[side]))


def _choose_window(wish: Window | None, kinematics: Span, forces: Span, file: Path, unmeasured: Sequence[Span],
                   stances: Sequence[Stance]) -> tuple[Span, list[str]]:
    """The common part of kinematics, forces and the wish, in s, and notes on what was cut."""
    wished = (kinematics[0] if wish is None or wish.start_s is None else wish.start_s,
              kinematics[1] if wish is None or wish.end_s is None else wish.end_s)
    part = _common(wished, kinematics)
    if part is None:
        raise InputError(f"the window of {_words(wished)} and the kinematics of {_words(kinematics)} do not overlap",
                         file=file, where="window")
    both = _common(part, forces)
    if both is None:
        raise InputError(f"the forces of {_words(forces)} and the window of {_words(part)} do not overlap",
                         file=file, where="window" if wish else "forces",
                         right="Do both recordings count time from the same instant?")
    notes = []
    for cut, whole, to in ((part, wished, "kinematics"), (both, part, "force record")):
        if max(abs(cut[0] - whole[0]), abs(cut[1] - whole[1])) > 1e-3 and (wish or to != "kinematics"):
            notes.append(f"The window of {_words(whole)} was cut to the {to}, {_words(cut)}.")
    missed = sorted(span for span in unmeasured if _common(span, both))
    if not missed:
        return both, notes

    def held(span: Span) -> float:
        return sum(max(0.0, min(s.end_s, span[1]) - max(s.start_s, span[0])) for s in stances)

    listed = f"from {', '.join(map(_words, missed))} the prosthetic foot stands on ground that no plate measures"
    ends = [both[0], *(end for span in missed for end in span), both[1]]
    between = [(start, end) for start, end in zip(ends[::2], ends[1::2], strict=True) if end > start]
    best = max(between, key=lambda span: (held(span), span[1] - span[0]), default=None)
    if wish is not None or best is None or held(best) < MINIMUM_S:
        notes.append(f"In the window of {_words(both)}, {listed}: zero is compared with the model's force there.")
        return both, notes
    notes.append(f"The window of {_words(both)} was cut to {_words(best)}: {listed}.")
    return best, notes


def _check_stances(window: Span, plate: PlateRecording, stances: Sequence[Stance], side: str, mass_kg: float,
                   file: Path) -> None:
    """Refuses a window that is too short or in which the prosthetic foot carries nothing; tells when it does."""
    peak, weight = float(plate.force_W[:, 2].max()), mass_kg * GRAVITY
    if not stances:
        raise InputError(f"the {side} (prosthetic) foot has no stance: its largest vertical force is {peak:.3g} N",
                         file=file, where="forces")
    if peak < LIGHTEST_BW * weight:
        raise InputError(f"the {side} (prosthetic) foot is never loaded by more than {peak:.3g} N, {peak / weight:.2f} "
                         f"times the body weight", file=file, where="forces",
                         right="Check the unit of the forces and the subject's mass_kg")
    listed = f"The stances of the {side} foot are {', '.join(_words((s.start_s, s.end_s)) for s in stances)}"
    shortest = min((s.duration_s for s in stances if s.complete), default=DEFAULT_STANCE_S)
    if window[1] - window[0] < shortest:
        raise InputError(f"the trial of {_words(window)} is shorter than one stance ({shortest:.3f} s)",
                         file=file, where="window", right=listed)
    if max(min(s.end_s, window[1]) - max(s.start_s, window[0]) for s in stances) < MINIMUM_S:
        raise InputError(f"the {side} (prosthetic) foot carries no load from {_words(window)}",
                         file=file, where="window", right=listed)


def _describe_stances(window: Span, stances: Sequence[Stance], foot: str) -> list[str]:
    """One sentence for each stance that overlaps the window: whether it is complete or cut, and where."""
    notes = []
    for s in stances:
        if _common((s.start_s, s.end_s), window):
            ends = [] if s.start_seen and s.start_s >= window[0] else ["start"]
            ends += [] if s.end_seen and s.end_s <= window[1] else ["end"]
            how = f"cut at its {' and '.join(ends)}" if ends else "complete"
            notes.append(f"Stance of the {foot} foot from {_words((s.start_s, s.end_s))} is {how}.")
    return notes


def _describe_treadmill(window: Span, plate: PlateRecording) -> list[str]:
    """One sentence if the centre of pressure runs backward under the foot, as it does on a moving belt."""
    at = (plate.time_s >= window[0]) & (plate.time_s <= window[1]) & (plate.force_W[:, 2] > MINIMUM_LOAD_N)
    at[1:] &= at[:-1]
    time, x = plate.time_s[at], plate.cop_W[at, 0]
    if not plate.has_cop or len(time) < 3:
        return []
    speed = float(np.median(np.gradient(x, time)))
    return [] if speed > BACKWARD_M_PER_S else [
        f"The centre of pressure moves at {speed:.2f} m/s through stance: a treadmill? The model's ground stands "
        "still: give the manifest its belt_speed_m_per_s."]


def _common(a: Span, b: Span) -> Span | None:
    start, end = max(a[0], b[0]), min(a[1], b[1])
    return (start, end) if end > start else None


def _words(span: Span) -> str:
    return f"{span[0]:.3f} to {span[1]:.3f} s"


def on_the_belt(
    trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording], *, speed_m_per_s: float
) -> tuple[CoordinateTrajectory, dict[str, PlateRecording], tuple[str, ...]]:
    """A treadmill recording seen from its belt, where the ground stands still, and a note that says so.

    Only the pelvis's forward position and the centres of pressure change: by speed times time. Forces
    are the same in both frames, since neither accelerates.

    Args:
        speed_m_per_s: + when the belt runs backward (against W's x).
    """
    if speed_m_per_s == 0.0:
        return trajectory, plates, ()
    values = np.array(trajectory.values)
    values[:, trajectory.names.index("pelvis_tx")] += speed_m_per_s * trajectory.time_s
    moved = CoordinateTrajectory(trajectory.time_s, values, trajectory.names, source=trajectory.source)
    carried = {side: dataclasses.replace(plate, cop_W=plate.cop_W + np.outer(speed_m_per_s * plate.time_s, [1, 0, 0]))
               for side, plate in plates.items()}
    note = f"Recorded on a treadmill: seen from its belt, which runs backward at {speed_m_per_s:g} m/s."
    return moved, carried, (note,)
