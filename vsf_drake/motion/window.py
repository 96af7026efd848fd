"""The part of a recording to simulate, where kinematics, forces and manifest overlap; a treadmill's belt."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.events import MINIMUM_S, Stance, find_scuffs, find_stances
from vsf_drake.motion.manifest import Window
from vsf_drake.motion.plates import GRAVITY, LIGHTEST_BW, PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import Subject

DEFAULT_STANCE_S = 0.5
MINIMUM_LOAD_N = 200.0
BACKWARD_M_PER_S = -0.3
Span = tuple[float, float]


def trial_window(path: Path, wish: Window | None, trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording],
                 subject: Subject, unmeasured: Mapping[str, Sequence[Span]] | None = None
                 ) -> tuple[Span, tuple[str, ...]]:
    """The window of a trial, and notes on it and on the stances in it.

    Raises:
        InputError: see `choose_window` and `check_stances`.
    """
    side = subject.prosthetic_side
    time = plates[side].time_s
    found = {s: find_stances(plate.time_s, plate.force_W[:, 2]) for s, plate in plates.items()}
    window, notes = choose_window(wish, (trajectory.start_s, trajectory.end_s), (float(time[0]), float(time[-1])),
                                  file=path, unmeasured=(unmeasured or {}).get(side, ()), stances=found[side])
    notes += check_stances(window, plates[side], side, mass_kg=subject.mass_kg, file=path)
    for other, plate in plates.items():
        if other != side:
            notes += describe_stances(window, found[other], other) + describe_scuffs(window, plate, other)
    return window, notes + describe_treadmill(window, plates[side])


def choose_window(wish: Window | None, kinematics: Span, forces: Span, *, file: str | Path,
                  unmeasured: Sequence[Span] = (), stances: Sequence[Stance] = ()) -> tuple[Span, tuple[str, ...]]:
    """The common part of kinematics, forces and the wish, in s, and notes on what was cut.

    Args:
        unmeasured: when the prosthetic foot stands on ground that no plate measures: a model's force there would be
            compared with zero. Without a wish, the stretch between them that holds most of `stances` is taken; a
            wish is kept.
        stances: of the prosthetic foot, measured.

    Raises:
        InputError: two of them do not overlap.
    """
    wished = (kinematics[0] if wish is None or wish.start_s is None else wish.start_s,
              kinematics[1] if wish is None or wish.end_s is None else wish.end_s)
    part = _common(wished, kinematics)
    if part is None:
        raise InputError(f"the window of {_span(wished)} and the kinematics of {_span(kinematics)} do not overlap",
                         file=file, where="window")
    both = _common(part, forces)
    if both is None:
        raise InputError(f"the forces of {_span(forces)} and the window of {_span(part)} do not overlap",
                         file=file, where="window" if wish else "forces",
                         right="Do both recordings count time from the same instant?")
    notes = []
    if wish and _differ(part, wished):
        notes.append(f"The window of {_span(wished)} was cut to the kinematics, {_span(part)}.")
    if _differ(both, part):
        notes.append(f"The window of {_span(part)} was cut to the force record, {_span(both)}.")
    missed = [span for span in unmeasured if _common(span, both)]
    if not missed:
        return both, tuple(notes)
    listed = f"from {', '.join(map(_span, missed))} the prosthetic foot stands on ground that no plate measures"
    best = max(_between(both, missed), key=lambda span: (_held(span, stances), span[1] - span[0]), default=None)
    if wish is not None or best is None or _held(best, stances) < MINIMUM_S:
        notes.append(f"In the window of {_span(both)}, {listed}: zero is compared with the model's force there.")
        return both, tuple(notes)
    notes.append(f"The window of {_span(both)} was cut to {_span(best)}: {listed}.")
    return best, tuple(notes)


def check_stances(window: Span, plate: PlateRecording, side: str, *, mass_kg: float,
                  file: str | Path) -> tuple[str, ...]:
    """Notes on the stances of the prosthetic foot in the window, which must be long enough and hold load.

    Raises:
        InputError: the force record has no stance; its peak is below 0.3 body weights; the window is shorter
            than the shortest complete stance in the record (0.5 s if none is complete) or
            holds less than 0.15 s of any stance. The message tells the times of the stances.
    """
    vertical = plate.force_W[:, 2]
    stances = find_stances(plate.time_s, vertical)
    peak, weight = float(vertical.max()), mass_kg * GRAVITY
    if not stances:
        raise InputError(f"the {side} (prosthetic) foot has no stance: its largest vertical force is {peak:.3g} N",
                         file=file, where="forces")
    if peak < LIGHTEST_BW * weight:
        raise InputError(f"the {side} (prosthetic) foot is never loaded by more than {peak:.3g} N, {peak / weight:.2f} "
                         f"times the body weight", file=file, where="forces",
                         right="Check the unit of the forces and the subject's mass_kg")
    listed = f"The stances of the {side} foot are {', '.join(_span((s.start_s, s.end_s)) for s in stances)}"
    shortest = min((s.duration_s for s in stances if s.complete), default=DEFAULT_STANCE_S)
    if window[1] - window[0] < shortest:
        raise InputError(f"the trial of {_span(window)} is shorter than one stance ({shortest:.3f} s)",
                         file=file, where="window", right=listed)
    held = max(min(s.end_s, window[1]) - max(s.start_s, window[0]) for s in stances)
    if held < MINIMUM_S:
        raise InputError(f"the {side} (prosthetic) foot carries no load from {_span(window)}",
                         file=file, where="window", right=listed)
    return describe_stances(window, stances, f"{side} (prosthetic)") + describe_scuffs(window, plate, side)


def describe_stances(window: Span, stances: Sequence[Stance], foot: str) -> tuple[str, ...]:
    """One sentence for each stance that overlaps the window: whether it is complete or cut, and where."""
    notes = []
    for s in stances:
        if _common((s.start_s, s.end_s), window) is None:
            continue
        ends = [] if s.start_seen and s.start_s >= window[0] else ["start"]
        ends += [] if s.end_seen and s.end_s <= window[1] else ["end"]
        how = f"cut at its {' and '.join(ends)}" if ends else "complete"
        notes.append(f"Stance of the {foot} foot from {_span((s.start_s, s.end_s))} is {how}.")
    return tuple(notes)


def describe_scuffs(window: Span, plate: PlateRecording, side: str) -> tuple[str, ...]:
    """One sentence if the foot touched the plate in the window without standing on it."""
    spans = [(s.start_s, s.end_s) for s in find_scuffs(plate.time_s, plate.force_W[:, 2])]
    spans = [span for span in spans if _common(span, window)]
    if not spans:
        return ()
    return (f"The {side} foot loads its plate above 20 N outside a stance: {', '.join(map(_span, spans))}.",)


def describe_treadmill(window: Span, plate: PlateRecording) -> tuple[str, ...]:
    """One sentence if the centre of pressure runs backward under the foot, as it does on a moving belt."""
    at = (plate.time_s >= window[0]) & (plate.time_s <= window[1]) & (plate.force_W[:, 2] > MINIMUM_LOAD_N)
    at[1:] &= at[:-1]
    time, x = plate.time_s[at], plate.cop_W[at, 0]
    if not plate.has_cop or len(time) < 3:
        return ()
    speed = float(np.median(np.gradient(x, time)))
    if speed > BACKWARD_M_PER_S:
        return ()
    return (f"The centre of pressure moves at {speed:.2f} m/s through stance: a treadmill? The "
            "model's ground stands still: give the manifest its belt_speed_m_per_s.",)


def _between(whole: Span, taken: Sequence[Span]) -> list[Span]:
    """The parts of `whole` outside `taken`."""
    ends = [whole[0], *(end for span in sorted(taken) for end in span), whole[1]]
    return [(start, end) for start, end in zip(ends[::2], ends[1::2], strict=True) if end > start]


def _held(span: Span, stances: Sequence[Stance]) -> float:
    """Time (s) of stances in a span."""
    return sum(max(0.0, min(s.end_s, span[1]) - max(s.start_s, span[0])) for s in stances)


def _common(a: Span, b: Span) -> Span | None:
    start, end = max(a[0], b[0]), min(a[1], b[1])
    return (start, end) if end > start else None


def _differ(a: Span, b: Span) -> bool:
    return max(abs(a[0] - b[0]), abs(a[1] - b[1])) > 1e-3


def _span(span: Span) -> str:
    return f"{span[0]:.3f} to {span[1]:.3f} s"


# A treadmill recording seen from its belt, where the ground stands still.


def on_the_belt(
    trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording], *, speed_m_per_s: float
) -> tuple[CoordinateTrajectory, dict[str, PlateRecording], tuple[str, ...]]:
    """The same recording in a frame that moves with a belt of constant speed, and a note that says so.

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

    def carried(plate: PlateRecording) -> PlateRecording:
        cop = np.array(plate.cop_W)
        cop[:, 0] += speed_m_per_s * plate.time_s
        return dataclasses.replace(plate, cop_W=cop)

    note = f"Recorded on a treadmill: seen from its belt, which runs backward at {speed_m_per_s:g} m/s."
    return moved, {side: carried(plate) for side, plate in plates.items()}, (note,)
