"""What can be moved by hand: the sliders of a shown model, with names, units and reach.

Anatomical coordinates have their OpenSim names. The reach of a slider is a choice: enough to see what a coordinate
does, and no limit of the model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from vsf_drake.parameters import FootParameters

LOAD, FULCRUM = "load at the toe", "fulcrum"
"""Names of the two controls that bend the keel."""
LARGEST_LOAD_N = 800.0
_DEGREE, _MILLIMETRE = math.pi / 180.0, 1e-3
_REACH_DEG = {
    "pelvis_tilt": (-45, 45), "pelvis_list": (-30, 30), "pelvis_rotation": (-90, 90), "hip_flexion": (-30, 120),
    "hip_adduction": (-45, 45), "hip_rotation": (-45, 45), "knee_angle": (-10, 140), "knee_adduction": (-20, 20),
    "knee_rotation": (-30, 30), "ankle_angle": (-50, 30), "ankle_adduction": (-30, 30), "ankle_rotation": (-30, 30),
    "socket_flexion": (-15, 15), "socket_adduction": (-15, 15), "socket_rotation": (-15, 15),
}
_REACH_M = {"pelvis_tx": (-1.0, 1.0), "pelvis_ty": (0.0, 1.5), "pelvis_tz": (-0.5, 0.5)}
_SOCKET_REACH_MM = 30.0
_KEEL_REACH_DEG = 20.0


@dataclass(frozen=True)
class Control:
    """A slider.

    Attributes:
        name: a joint's, or LOAD.
        unit: of the slider; `scale` times its value is SI.
        low, high, rest, step: in that unit.
    """

    name: str
    unit: str
    low: float
    high: float
    rest: float
    step: float
    scale: float

    @property
    def label(self) -> str:
        """What stands beside the slider."""
        return f"{self.name} ({self.unit})"


def foot_controls(foot: FootParameters) -> tuple[Control, ...]:
    """The fulcrum's position, at rest in the middle of its range, and the load on the load point."""
    low, high = (1e3 * x for x in (foot.fulcrum.rearmost_m, foot.fulcrum.foremost_m))
    return (Control(FULCRUM, "mm", low, high, round(0.5 * (low + high), 1), 0.5, _MILLIMETRE),
            Control(LOAD, "N", 0.0, LARGEST_LOAD_N, 0.0, 5.0, 1.0))


def keel_controls(joint_names: Sequence[str]) -> tuple[Control, ...]:
    """One slider a joint of the keel, whose angle is added to that of the loaded keel."""
    return tuple(Control(name, "° added", -_KEEL_REACH_DEG, _KEEL_REACH_DEG, 0.0, 0.1, _DEGREE)
                 for name in joint_names)


def joint_controls(names: Sequence[str], *, pelvis_height_m: float) -> tuple[Control, ...]:
    """One slider a coordinate of the person, anatomical or of the socket.

    Args:
        pelvis_height_m: `pelvis_ty` at rest.

    Raises:
        ValueError: a coordinate has no reach here.
    """
    return tuple(_joint_control(name, pelvis_height_m if name == "pelvis_ty" else 0.0) for name in names)


def _joint_control(name: str, rest: float) -> Control:
    if name in _REACH_M:
        return Control(name, "m", *_REACH_M[name], round(rest, 4), 0.0001, 1.0)
    if name.startswith("socket_t"):
        return Control(name, "mm", -_SOCKET_REACH_MM, _SOCKET_REACH_MM, rest, 0.1, _MILLIMETRE)
    kind = name[:-2] if name.endswith(("_r", "_l")) else name
    if kind not in _REACH_DEG:
        raise ValueError(f"no reach is given for the coordinate {name}")
    return Control(name, "°", *_REACH_DEG[kind], rest, 0.5, _DEGREE)
