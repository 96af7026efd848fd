"""The part of a recording to simulate, where kinematics, forces and manifest overlap; a treadmill's belt."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.events import MINIMUM_S, Span, Stance, common, find_scuffs, find_stances, words
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.manifest import Window
from vsf_drake.motion.opensim import LIGHTEST_BW
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import GRAVITY, Subject
from vsf_drake.sentences import say

DEFAULT_STANCE_S = 0.5
MINIMUM_LOAD_N = 200.0
BACKWARD_M_PER_S = -0.3


def trial_window(path: Path, wish: Window | None, trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording],
                 subject: Subject, unmeasured: Mapping[str, Sequence[Span]] | None = None) -> tuple[Span, list[str]]:
    """The window of a trial (s), and notes on it and on the stances in it; `path` is the manifest, for messages.

    `unmeasured` is when, by side, a foot stands on ground that no plate measures: a model's force there would be
    compared with zero. Without a wish, the stretch between those of the prosthetic foot that holds most of its stances
    is taken; a wish is kept. Refused where window, kinematics and forces do not overlap, or the prosthetic foot has
    hardly any load or less than 0.15 s of a stance, or the window is shorter than the shortest complete stance.
    """
    side = subject.prosthetic_side
    plate, stances = plates[side], {s: find_stances(one.time_s, one.force_W[:, 2]) for s, one in plates.items()}
    record = float(plate.time_s[0]), float(plate.time_s[-1])
    window, notes = _choose_window(wish, (trajectory.start_s, trajectory.end_s), record, path,
                                   (unmeasured or {}).get(side, ()), stances[side])
    _check_stances(window, plate, stances[side], side, subject.mass_kg, path)
    for s in sorted(plates, key=lambda s: s != side):
        found = [((c.start_s, c.end_s), [end for end, seen in (
            ("start", c.start_seen and c.start_s >= window[0]), ("end", c.end_seen and c.end_s <= window[1]))
            if not seen]) for c in stances[s] if common((c.start_s, c.end_s), window)]
        scuffs = [(c.start_s, c.end_s) for c in find_scuffs(plates[s].time_s, plates[s].force_W[:, 2])]
        notes += say("trial", "foot", side=s, prosthetic=s == side, stances=found,
                     scuffs=[scuff for scuff in scuffs if common(scuff, window)])
    at = (plate.time_s >= window[0]) & (plate.time_s <= window[1]) & (plate.force_W[:, 2] > MINIMUM_LOAD_N)
    at[1:] &= at[:-1]
    if plate.has_cop and at.sum() >= 3:  # runs backward under the foot as on a moving belt?
        speed = float(np.median(np.gradient(plate.cop_W[at, 0], plate.time_s[at])))
        notes += say("trial", "treadmill", speed=speed) if speed <= BACKWARD_M_PER_S else []
    return window, notes


def _choose_window(wish: Window | None, kinematics: Span, forces: Span, file: Path, unmeasured: Sequence[Span],
                   stances: Sequence[Stance]) -> tuple[Span, list[str]]:
    """The common part of kinematics, forces and the wish, in s, and notes on what was cut."""
    wished = (kinematics[0] if wish is None or wish.start_s is None else wish.start_s,
              kinematics[1] if wish is None or wish.end_s is None else wish.end_s)
    part = common(wished, kinematics)
    if part is None:
        raise InputError(f"the window of {words(wished)} and the kinematics of {words(kinematics)} do not overlap",
                         file=file, where="window")
    both = common(part, forces)
    if both is None:
        raise InputError(f"the forces of {words(forces)} and the window of {words(part)} do not overlap",
                         file=file, where="window" if wish else "forces",
                         right="Do both recordings count time from the same instant?")
    notes = []
    for cut, whole, to in ((part, wished, "kinematics"), (both, part, "force record")):
        if max(abs(cut[0] - whole[0]), abs(cut[1] - whole[1])) > 1e-3 and (wish or to != "kinematics"):
            notes += say("trial", "cut", whole=whole, part=cut, to=to)
    missed = sorted(span for span in unmeasured if common(span, both))
    if not missed:
        return both, notes

    def held(span: Span) -> float:
        return sum(max(0.0, min(s.end_s, span[1]) - max(s.start_s, span[0])) for s in stances)

    ends = [both[0], *(end for span in missed for end in span), both[1]]
    between = [(start, end) for start, end in zip(ends[::2], ends[1::2], strict=True) if end > start]
    best = max(between, key=lambda span: (held(span), span[1] - span[0]), default=None)
    if wish is not None or best is None or held(best) < MINIMUM_S:
        best = None
    return best or both, notes + say("trial", "unmeasured", window=both, best=best, missed=missed)


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
    listed = f"The stances of the {side} foot are {', '.join(words((s.start_s, s.end_s)) for s in stances)}"
    shortest = min((s.duration_s for s in stances if s.complete), default=DEFAULT_STANCE_S)
    if window[1] - window[0] < shortest:
        raise InputError(f"the trial of {words(window)} is shorter than one stance ({shortest:.3f} s)",
                         file=file, where="window", right=listed)
    if max(min(s.end_s, window[1]) - max(s.start_s, window[0]) for s in stances) < MINIMUM_S:
        raise InputError(f"the {side} (prosthetic) foot carries no load from {words(window)}",
                         file=file, where="window", right=listed)


def on_the_belt(
    trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording], *, speed_m_per_s: float
) -> tuple[CoordinateTrajectory, dict[str, PlateRecording], list[str]]:
    """A treadmill recording seen from its belt, where the ground stands still, and a note that says so.

    Only the pelvis's forward position and the centres of pressure change, by speed (+ when the belt runs backward,
    against W's x) times time. Forces are the same in both frames, since neither accelerates.
    """
    if speed_m_per_s == 0.0:
        return trajectory, plates, []
    values = np.array(trajectory.values)
    values[:, trajectory.names.index("pelvis_tx")] += speed_m_per_s * trajectory.time_s
    moved = CoordinateTrajectory(trajectory.time_s, values, trajectory.names, source=trajectory.source)
    carried = {side: dataclasses.replace(plate, cop_W=plate.cop_W + np.outer(speed_m_per_s * plate.time_s, [1, 0, 0]))
               for side, plate in plates.items()}
    return moved, carried, say("trial", "belt", speed=speed_m_per_s)
