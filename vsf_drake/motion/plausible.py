"""Is this how a person moves? Guards against recordings in another unit than they state."""

from __future__ import annotations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.storage import Storage

LARGEST_ANGLE_RAD = 3.5
SMALLEST_RANGE_DEG = 3.0
JUMP_RAD, JUMP_RAD_PER_S = 0.5, 20.0
FARTHEST_M = 100.0
PELVIS_HEIGHT_M = (0.3, 2.0)


def check_angles(storage: Storage, angles: dict[str, np.ndarray], labels: dict[str, str], *, degrees: bool) -> None:
    """Refuses angles that no joint has in the unit they are said to be in.

    Args:
        storage: where they come from, for the message.
        angles: (n,) each by coordinate, in the file's unit.
        labels: the file's column label of each coordinate.
        degrees: whether the unit is degrees (radians otherwise).

    Raises:
        InputError: an angle exceeds 3.5 rad; or all angles vary by less than 3 "degrees" and stay
            below 3.5 "degrees", which is a walk in radians; or an angle jumps by more than 0.5 rad,
            faster than 20 rad/s, from one instant to the next.
    """
    unit = np.radians(1.0) if degrees else 1.0
    for name, values in angles.items():
        row = int(np.argmax(np.abs(values)))
        if abs(values[row]) * unit > LARGEST_ANGLE_RAD:
            shown = f"{values[row]:.4g} {'degrees' if degrees else 'rad'}"
            raise InputError(f"an angle of {shown} is not believable", file=storage.path,
                             where=storage.place(row, labels[name]),
                             right=None if degrees else "The recording is said to be in radians: is it in degrees?")
    if degrees:
        widest = max(angles, key=lambda name: np.ptp(angles[name]))
        largest = max(np.abs(values).max() for values in angles.values())
        if np.ptp(angles[widest]) < SMALLEST_RANGE_DEG and largest < LARGEST_ANGLE_RAD:
            raise InputError(
                f"no angle varies by more than {np.ptp(angles[widest]):.3g} degrees (time {storage.time_s[0]:g} to "
                f"{storage.time_s[-1]:g} s), which is no walk", file=storage.path, where=f"column {labels[widest]}",
                right="The recording is said to be in degrees: is it in radians?")
    for name, values in angles.items():
        jump = np.abs(np.diff(values)) * unit
        wild = (jump > JUMP_RAD) & (jump > JUMP_RAD_PER_S * np.diff(storage.time_s))
        if wild.any():
            row = int(np.argmax(wild)) + 1
            raise InputError(f"the angle jumps by {np.degrees(jump[row - 1]):.0f}° from the instant before",
                             file=storage.path, where=storage.place(row, labels[name]))


def check_pelvis(storage: Storage, translations: dict[str, np.ndarray], labels: dict[str, str]) -> None:
    """Refuses pelvis translations that are not metres in a laboratory.

    Raises:
        InputError: one exceeds 100 m, or the height is outside 0.3 to 2 m.
    """
    low, high = PELVIS_HEIGHT_M
    for name, values in translations.items():
        if name == "pelvis_ty":
            wrong = (values < low) | (values > high)
            right = f"Its height must be between {low:g} and {high:g} m: is it in another unit, or another axis?"
        else:
            wrong = np.abs(values) > FARTHEST_M
            right = f"It must be within {FARTHEST_M:g} m of the origin: is it in millimetres?"
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InputError(f"the pelvis at {values[row]:.4g} m is not believable", file=storage.path,
                             where=storage.place(row, labels[name]), right=right)
