"""Which plate is which foot: every contact on every plate goes to the foot under whose sole its load acts.

A contact is a stretch of load on one plate (hysteresis: it is one where the force passes 20 N and reaches 100 N for
at least 0.15 s; a scuff in swing is none). It belongs to the foot whose sole, the line from heel to toe, lies
nearest to the centre of pressure over the contact. Nothing is asked of the plates' names or order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.contact_search import FAR_M, FeetOnFloor, Found, attribute, find_loads
from vsf_drake.motion.events import Stance
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.kinematic_events import kinematic_stances, walking_direction
from vsf_drake.motion.markers.schema import FootTrack
from vsf_drake.motion.measured import unmeasured_spans
from vsf_drake.motion.plate_checks import check_upward, without_doubles
from vsf_drake.motion.plate_sum import on_one_foot
from vsf_drake.motion.plates import SIDES, PlateRecording

Span = tuple[float, float]


@dataclass(frozen=True)
class Contact:
    """One stretch of load on one plate.

    Attributes:
        plate: its name.
        side: the foot it was given to; None where it is neither's, or both feet's at once.
        start_s, end_s: when the load passes 20 N. start_seen, end_seen: whether that lies inside the record.
        distance_m: median distance of the centre of pressure from the nearest foot's heel-toe line; NaN where unknown.
        doubt: why it should not be trusted, or None.
    """

    plate: str
    side: str | None
    start_s: float
    end_s: float
    start_seen: bool
    end_seen: bool
    distance_m: float
    doubt: str | None = None


@dataclass(frozen=True, eq=False)
class Assignment:
    """The forces on each foot.

    Attributes:
        plates: by side, over the whole force record; a side without any contact is missing.
        contacts: in order of time.
        stances: by side, when the foot stands as its *motion* tells, measured or not.
        unmeasured: by side, when the foot stands on ground that no plate measures (or shares a plate with the other
            foot), 0.05 s wider: the force is not known there, though `plates` says zero.
        notes: sentences on what was assumed or looks doubtful.
    """

    plates: dict[str, PlateRecording]
    contacts: tuple[Contact, ...]
    stances: dict[str, tuple[Stance, ...]]
    unmeasured: dict[str, tuple[Span, ...]]
    notes: tuple[str, ...] = ()


def assign_plates(recording: Recording, time_s: np.ndarray, feet: dict[str, FootTrack], pelvis_W: np.ndarray, *,
                  stated: dict[str, str | None] | None = None) -> Assignment:
    """Gives the load on each plate to the foot that stands on it.

    Args:
        recording: the plates, on the clock of `time_s`.
        time_s: (n,) s of the feet. feet: by side. pelvis_W: (n, 3) m.
        stated: plate names by side as the user says; they win over the centre of pressure, and a contradiction is
            noted. None where only the centre of pressure tells.

    Raises:
        InputError: there is no plate, or none is loaded while the feet are seen; a plate's force points down
            or sideways; most loads are far from both feet; a stated plate is not there.
    """
    file = recording.force_path or recording.path
    if not recording.plates:
        raise InputError("has no force plates", file=file, where="forces (--forces)",
                         right="Name the file that has the forces")
    for plate in recording.plates:
        check_upward(plate, file=file)
    names = _stated_names(recording, stated)
    forward = walking_direction(feet, pelvis_W)
    stances = {side: tuple(kinematic_stances(time_s, feet[side], pelvis_W, forward_W=forward)) for side in SIDES}
    floor = FeetOnFloor(time_s, feet, stances)
    plates, double_notes = without_doubles(recording, floor)
    loads = find_loads(plates, recording.force_time_s)
    found = attribute(loads, floor, names)
    _check_near(found, recording, time_s)
    owners = {side: [(item.load, item.scuff) for item in found if item.side == side] for side in SIDES}
    sums = {side: on_one_foot(recording.force_time_s, plates, [load for load, _ in owned])
            for side, owned in owners.items() if any(not scuff for _, scuff in owned)}
    record = _common(recording.force_time_s, time_s)
    missing, doubts = unmeasured_spans(found, stances, record)
    contacts = tuple(Contact(item.load.plate.name, item.side, item.load.start_s, item.load.end_s,
                             item.load.start_seen, item.load.end_seen, item.distance_m,
                             "; ".join(filter(None, (item.doubt, doubts.get(i)))) or None)
                     for i, item in enumerate(found) if not item.scuff)
    notes = (*double_notes, *_describe(contacts), *_describe_missing(missing))
    return Assignment(sums, contacts, stances, missing, notes)


def _stated_names(recording: Recording, stated: dict[str, str | None] | None) -> dict[str, str]:
    """Side by the plate's name."""
    names = {name: side for side, name in (stated or {}).items() if name is not None}
    known = [plate.name for plate in recording.plates]
    for name, side in names.items():
        if name not in known:
            raise InputError(f"there is no plate {name}", file=recording.force_path or recording.path,
                             where=f"forces.{side} (--{side}-plate)", right=f"Plates are: {', '.join(known)}")
    return names


def _common(force_time_s: np.ndarray, time_s: np.ndarray) -> Span:
    return max(float(force_time_s[0]), float(time_s[0])), min(float(force_time_s[-1]), float(time_s[-1]))


def _check_near(found: Sequence[Found], recording: Recording, time_s: np.ndarray) -> None:
    """Refuses plates of which most loads are under no foot."""
    file = recording.force_path or recording.path
    seen = [item for item in found if not item.scuff and item.in_view]
    if not seen:
        peak = max(float(plate.force_n[:, 2].max()) for plate in recording.plates)
        raise InputError(f"no plate carries a person between {time_s[0]:.3f} and {time_s[-1]:.3f} s, where the markers "
                         f"are; the largest vertical force of the record is {peak:.3g} N", file=file, where="forces",
                         right="Do both recordings count time from the same instant? Is the unit of the forces N?")
    far = [item for item in seen if item.side is None and item.distance_m > FAR_M]
    if 2 * len(far) > len(seen):
        near = min(far, key=lambda item: item.distance_m)
        raise InputError(
            f"the centre of pressure is {near.distance_m:.2f} m from the nearest foot while the plate carries a person "
            f"({near.load.start_s:.3f} to {near.load.end_s:.3f} s)", file=file, where=f"plate {near.load.plate.name}",
            right="Plates and markers must share frame, unit and clock: check the plate's corners, the unit of the "
                  "centre of pressure, laboratory.up (--up) and laboratory.forward (--forward)")


def _describe(contacts: Sequence[Contact]) -> list[str]:
    notes = []
    for contact in contacts:
        span = f"{contact.start_s:.3f} to {contact.end_s:.3f} s"
        whose = f"the {contact.side} foot" if contact.side else "neither foot"
        doubt = f": {contact.doubt}" if contact.doubt else ""
        notes.append(f"Plate {contact.plate} from {span} carries {whose}{doubt}.")
    return notes


def _describe_missing(missing: dict[str, tuple[Span, ...]]) -> list[str]:
    return [f"The {side} foot stands on ground that no plate measures for it alone from "
            f"{', '.join(f'{a:.3f} to {b:.3f} s' for a, b in spans)}."
            for side, spans in missing.items() if spans]


