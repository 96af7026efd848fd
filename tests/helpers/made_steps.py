"""Two feet that walk along x, and force plates under them: what is on which plate is known by
construction."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from vsf_drake.motion.contacts import Assignment, assign_plates
from vsf_drake.motion.formats.recording import Plate, Recording, world_to_os
from vsf_drake.motion.markers.segments import FootTrack, TrackedMotion

RATE_HZ, FORCE_HZ = 100.0, 1000.0
STEP_S, STANCE_S, STEP_M, FOOT_M, HALF_WIDTH_M = 0.55, 0.7, 0.65, 0.25, 0.08
SPEED = STEP_M / STEP_S
WEIGHT_N = 800.0
TIME = np.arange(0.0, 3.2, 1.0 / RATE_HZ)
FORCE_TIME = np.arange(0.0, 3.2, 1.0 / FORCE_HZ)


def steps(side: str) -> list[tuple[float, float]]:
    """(touch-down s, heel's x m) of every step of a foot, also before and after the record."""
    first = 0 if side == "right" else 1
    return [(0.3 + n * STEP_S, STEP_M * n) for n in range(first - 4, 10, 2)]


def feet(turn: float = 1.0) -> tuple[dict[str, FootTrack], np.ndarray]:
    """Both feet and the pelvis: a foot rests from touch-down for 0.7 s, heel rising at the end, and
    then swings."""
    tracks = {}
    for side in ("right", "left"):
        y = -HALF_WIDTH_M if side == "right" else HALF_WIDTH_M
        known = steps(side)
        x, lift, pitch = (np.zeros(len(TIME)) for _ in range(3))
        for (start, at), (after, to) in pairwise(known):
            phase = np.clip((TIME - start - STANCE_S) / (after - start - STANCE_S), 0.0, 1.0)
            here = (TIME >= start) & (TIME < after)
            smooth = phase - np.sin(2 * np.pi * phase) / (2 * np.pi)
            x[here] = (at + (to - at) * smooth)[here]
            lift[here] = (0.03 * np.sin(np.pi * phase) ** 2)[here]
            rise = np.clip((TIME - start - 0.45) / (STANCE_S - 0.45), 0.0, 1.0)
            pitch[here] = (0.8 * np.where(phase > 0, np.cos(0.5 * np.pi * phase) ** 2, rise**2))[
                here
            ]
        toe = np.column_stack([x + FOOT_M, np.full_like(x, y), lift])
        heel = toe - FOOT_M * np.column_stack([np.cos(pitch), 0 * pitch, -np.sin(pitch)])
        tracks[side] = FootTrack(heel, toe, heel + np.array([0.05, 0.0, 0.08]))
    pelvis = np.column_stack([SPEED * (TIME - 0.3) - 0.1, 0 * TIME, np.full_like(TIME, 0.95)])
    return tracks, pelvis


def load(
    start_s: float,
    heel: Sequence[float],
    *,
    newton: float = WEIGHT_N,
    end_s: float | None = None,
    time_s: np.ndarray = FORCE_TIME,
) -> tuple[np.ndarray, np.ndarray]:
    """Force (n, 3) and centre of pressure (n, 3) of one stance of a foot: heel to toe, braking,
    then driving."""
    phase = (time_s - start_s) / ((start_s + STANCE_S if end_s is None else end_s) - start_s)
    on = (phase > 0) & (phase < 1)
    force, cop = np.zeros((len(time_s), 3)), np.full((len(time_s), 3), np.nan)
    force[on, 2] = newton * np.minimum(1.0, 8.0 * np.minimum(phase, 1 - phase))[on]
    force[on, 0] = -0.15 * newton * np.sin(2 * np.pi * phase[on])
    cop[on] = np.column_stack(
        [heel[0] + FOOT_M * phase[on], np.full(on.sum(), heel[1]), np.zeros(on.sum())]
    )
    return force, cop


def plate(
    name: str, *loads: tuple[np.ndarray, np.ndarray], corners: np.ndarray | None = None
) -> Plate:
    """A plate under the sum of loads."""
    force = np.sum([f for f, _ in loads], axis=0) if loads else np.zeros((len(FORCE_TIME), 3))
    cop = np.full((len(force), 3), np.nan)
    on = force[:, 2] > 20.0
    moment = sum(np.nan_to_num(c) * f[:, 2:] for f, c in loads) if loads else cop
    cop[on] = moment[on] / force[on, 2:]
    return Plate(name, force, cop, np.zeros(len(force)), corners)


def step_load(side: str, n: int, **options) -> tuple[np.ndarray, np.ndarray]:
    """The load of the n-th step (from 0) that lies in the record as a whole."""
    start, x = [(s, x) for s, x in steps(side) if s > 0.0][n]
    return load(start, (x, -HALF_WIDTH_M if side == "right" else HALF_WIDTH_M), **options)


def rectangle(x: tuple[float, float], y: tuple[float, float]) -> np.ndarray:
    """(4, 3) corners."""
    return np.array(
        [[x[1], y[1], 0], [x[1], y[0], 0], [x[0], y[0], 0], [x[0], y[1], 0]], dtype=float
    )


def recording(*plates: Plate) -> Recording:
    return Recording(Path("made.c3d"), {}, RATE_HZ, plates, FORCE_HZ)


def assign(*plates: Plate, stated: dict[str, str | None] | None = None) -> Assignment:
    """Which of `feet` loads which plate."""
    tracks, pelvis = feet()
    motion = TrackedMotion(TIME, (), world_to_os(pelvis), tracks, {}, {}, {})
    return assign_plates(recording(*plates), motion, stated=stated)


def sides(result: Assignment) -> list[tuple[str, str | None]]:
    """Plate and foot of each contact."""
    return [(c.plate, c.side) for c in result.contacts]


def everywhere(**changed: Plate | None) -> list[Plate]:
    """A plate for each step, one of them changed or, if None, taken away."""
    steps_ = {"R0": ("right", 0), "L0": ("left", 0), "R1": ("right", 1), "L1": ("left", 1)}
    made = {name: plate(name, step_load(*step)) for name, step in steps_.items()} | changed
    return [p for p in made.values() if p is not None]


def moved(p: Plate, rotate: float = 0.0, shift: Sequence[float] = (0.0, 0.0)) -> Plate:
    """The plate turned about the vertical axis of W (rad), then shifted (m)."""
    turn = np.array(
        [[np.cos(rotate), -np.sin(rotate), 0], [np.sin(rotate), np.cos(rotate), 0], [0, 0, 1]]
    )
    return dataclasses.replace(
        p, force_n=p.force_n @ turn.T, cop_m=p.cop_m @ turn.T + [*shift, 0.0]
    )
