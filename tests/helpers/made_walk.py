"""A made person who walks over made plates: markers from known angles, loads under the true soles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from made_person import Person, markers, poses, recording_of, walking_angles

from vsf_drake.motion.events import kinematic_stances
from vsf_drake.motion.formats.recording import Plate, Recording
from vsf_drake.motion.markers.segments import FootTrack
from vsf_drake.parameters import GRAVITY

TIME = np.arange(0.0, 3.0, 0.01)
FORCE_TIME = np.arange(0.0, 2.9901, 0.001)
MASS = 78.0
ANGLES = walking_angles(TIME)


def feet(person: Person) -> dict[str, FootTrack]:
    """The true soles and ankles."""
    where = poses(ANGLES | {"pelvis_ty": np.full(len(TIME), 0.93)}, person)
    found = {}
    for side in ("right", "left"):
        R, p = where[f"foot_{side}"]
        heel, toe = (p + R @ point for point in person.sole(side))
        found[side] = FootTrack(heel, toe, p)
    return found


def stances(person: Person) -> dict[str, list]:
    pelvis = np.column_stack([ANGLES["pelvis_tx"], 0 * TIME, 0 * TIME])
    return {side: kinematic_stances(TIME, track, pelvis) for side, track in feet(person).items()}


def plates(person: Person, *, missed: Sequence[tuple[str, int]] = ()) -> tuple[Plate, ...]:
    """Two plates, one under each foot, that share the weight; `missed` steps (side, index) are beside them."""
    load = {}
    for side, found in stances(person).items():
        load[side] = np.zeros(len(FORCE_TIME))
        for i, s in enumerate(found):
            if (side, i) in missed:
                continue
            start = s.start_s if s.start_seen else s.start_s - 0.2
            end = s.end_s if s.end_seen else s.end_s + 0.2
            load[side] += np.clip(np.minimum(FORCE_TIME - start, end - FORCE_TIME) / 0.1, 0.0, 1.0)
    total = np.maximum(sum(load.values()), 1e-9)
    made = []
    for side, track in feet(person).items():
        share = load[side] / np.maximum(total, 1.0)
        force = np.column_stack([0.05 * share, -0.02 * share, share]) * MASS * GRAVITY
        middle = 0.5 * (track.heel_W + track.toe_W)
        cop = np.column_stack([np.interp(FORCE_TIME, TIME, middle[:, i]) for i in range(2)] + [0 * FORCE_TIME])
        on = force[:, 2] > 20.0
        made.append(Plate(f"plate_{side[0]}", force, np.where(on[:, None], cop, np.nan), np.where(on, 2.0, 0.0)))
    return tuple(made)


def walk(person: Person | None = None, *, missed: Sequence[tuple[str, int]] = (), label_set: str = "rajagopal"
         ) -> Recording:
    """Markers and plates."""
    person = person or Person()
    angles = ANGLES | {"pelvis_ty": np.full(len(TIME), 0.93)}
    return recording_of(markers(angles, person, label_set=label_set), plates=plates(person, missed=missed),
                        force_rate_hz=1000.0, path="walk.c3d")


def standing(person: Person | None = None, *, label_set: str = "rajagopal") -> Recording:
    """A second and a half of standing."""
    return recording_of(markers({}, person or Person(), label_set=label_set, frames=150), path="static.c3d")
