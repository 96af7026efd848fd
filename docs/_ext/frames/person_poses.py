"""What each coordinate of the person does where it is positive, asked of the plant: poses, and how
one point moves.

The clinical word for a positive value (flexion, adduction ...) is written here; what moves where is
computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint, RigidBody

from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.plants.person import add_person

STEP = 1e-3
"""Of a coordinate (rad or m) whose effect is looked at: small, so that directions are those of the
joint's axis."""
SUBJECT = {"mass_kg": 75.0, "stature_m": 1.75, "sex": "male"}
"""A person of common size; signs do not depend on it."""
_TRUNK_M = 0.55
_DIRECTIONS = (("forward", "backward"), ("to the left", "to the right"), ("up", "down"))

# kind of coordinate: what a positive value is called, the point that shows it, the view that shows
# it, a value to draw
KINDS: dict[str, tuple[str, str, str, float]] = {
    "pelvis_tx": ("forward", "pelvis", "right", 0.15),
    "pelvis_ty": ("up", "pelvis", "right", 0.15),
    "pelvis_tz": ("to the right", "pelvis", "front", 0.15),
    "pelvis_tilt": ("backward (posterior) tilt", "trunk", "right", 20.0),
    "pelvis_list": ("right side down", "hip_r", "front", 15.0),
    "pelvis_rotation": ("turn to the left", "hip_r", "above", 25.0),
    "hip_flexion": ("flexion", "knee", "right", 30.0),
    "hip_adduction": ("adduction", "knee", "front", 15.0),
    "hip_rotation": ("internal rotation", "toe", "above", 30.0),
    "knee_angle": ("flexion", "ankle", "right", 50.0),
    "knee_adduction": ("adduction (varus)", "ankle", "front", 15.0),
    "knee_rotation": ("internal rotation", "toe", "above", 30.0),
    "ankle_angle": ("dorsiflexion", "toe", "right", 20.0),
    "ankle_adduction": ("inversion", "inner edge", "front", 20.0),
    "ankle_rotation": ("internal rotation", "toe", "above", 30.0),
    "socket_tx": ("socket forward", "pylon", "right", 0.05),
    "socket_ty": ("socket to the left", "pylon", "front", 0.05),
    "socket_tz": ("socket onto the limb", "pylon", "right", 0.05),
    "socket_flexion": ("toes up, foot forward", "ankle", "right", 12.0),
    "socket_adduction": ("adduction", "ankle", "front", 12.0),
    "socket_rotation": ("internal rotation", "toe", "above", 20.0),
}
"""Angles to draw in degrees, slides in m."""


def kind_of(name: str) -> str:
    """`name` without its side."""
    return name[:-2] if name.endswith(("_r", "_l")) else name


@dataclass(frozen=True)
class Effect:
    """A coordinate and what it does.

    Attributes:
        unit: "rad" or "m", in the plant.
        positive: the field's word for a positive value.
        point: what was looked at. direction: where it goes, in words.
    """

    name: str
    unit: str
    positive: str
    point: str
    direction: str


class DrawnPerson:
    """A person standing with the prosthesis on `side`, and a context of its own."""

    def __init__(self, side: str) -> None:
        self.side, self.plant = side, MultibodyPlant(0.0)
        subject = Subject(prosthetic_side=side, **SUBJECT)
        self.person = add_person(self.plant, subject, ModelParameters())
        self.plant.Finalize()
        self._points = self._places()

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Anatomical ones, then the socket's."""
        return (*self.person.coordinate_names, *self.person.socket.coordinate_names)

    def points(self, **values: float) -> dict[str, np.ndarray]:
        """(3,) m in W of every named point, with `values` (rad or m) of coordinates, all others
        zero."""
        q = np.zeros(self.plant.num_positions())
        for name, value in values.items():
            q[self.plant.GetJointByName(name).position_start()] = value
        context = self.plant.CreateDefaultContext()
        self.plant.SetPositions(context, q)
        return {name: body.EvalPoseInWorld(context) @ p for name, (body, p) in self._points.items()}

    def is_angle(self, name: str) -> bool:
        """Whether the coordinate turns."""
        return isinstance(self.plant.GetJointByName(name), RevoluteJoint)

    def effect(self, name: str) -> Effect:
        """What a small positive value of the coordinate does."""
        positive, point, _, _ = KINDS[kind_of(name)]
        own = self._own_point(name, point)
        moved = self.points(**{name: STEP})[own] - self.points()[own]
        axis = int(np.argmax(np.abs(moved)))
        word = _DIRECTIONS[axis][0 if moved[axis] > 0 else 1]
        side = own[-1] if own.endswith(("_r", "_l")) else ""
        if axis == 1 and side and self.is_angle(name):
            word = "inward" if (moved[1] > 0) == (side == "r") else "outward"
        prosthetic = (
            point == "ankle" and f"pylon_{own[-1]}" in self._points and name.startswith("socket")
        )
        said = "pylon's lower end" if prosthetic else {"hip_r": "right hip"}.get(point, point)
        return Effect(name, "rad" if self.is_angle(name) else "m", positive, said, word)

    def moving_point(self, name: str) -> str:
        """Which of `points` shows the coordinate."""
        return self._own_point(name, KINDS[kind_of(name)][1])

    def _own_point(self, name: str, point: str) -> str:
        if point in self._points:
            return point
        return f"{point}_{name[-1] if name.endswith(('_r', '_l')) else self.side[0]}"

    def _places(self) -> dict[str, tuple[RigidBody, np.ndarray]]:
        person, body = self.person, self.person.body
        origin = np.zeros(3)
        hips = np.array([body.hip_forward, 0.0, body.hip_up])
        places = {
            "pelvis": (person.pelvis, hips),
            "trunk": (person.pelvis, hips + np.array([0.0, 0.0, _TRUNK_M])),
        }
        for side in ("right", "left"):
            s = side[0]
            places[f"hip_{s}"] = (person.segments[f"thigh_{side}"], origin)
            places[f"knee_{s}"] = (person.segments[f"shank_{side}"], origin)
            inner = 1.0 if side == "right" else -1.0
            if side == self.side:
                places |= self._prosthesis(s, inner)
            else:
                foot, low = person.segments[f"foot_{side}"], -body.ankle_height
                rear, front, half = (
                    -0.25 * body.foot_length,
                    0.75 * body.foot_length,
                    0.16 * body.foot_length,
                )
                corners = {
                    "heel": (rear, 0.0),
                    "toe": (front, 0.0),
                    "rear inner": (rear, half),
                    "rear outer": (rear, -half),
                    "front inner": (front, half),
                    "front outer": (front, -half),
                }
                places |= {
                    f"ankle_{s}": (foot, origin),
                    f"inner edge_{s}": (foot, np.array([0.0, inner * half, 0.0])),
                }
                places |= {
                    f"{name}_{s}": (foot, np.array([x, inner * y, low]))
                    for name, (x, y) in corners.items()
                }
        return places

    def _prosthesis(self, s: str, inner: float) -> dict[str, tuple[RigidBody, np.ndarray]]:
        """Points of the prosthesis and of the limb's end in it; its ankle is the pylon's lower
        end."""
        foot, socket, shank = (
            self.person.foot,
            self.person.socket,
            self.person.segments[f"shank_{self.side}"],
        )
        X_mount = foot.mount.GetFixedPoseInBodyFrame().translation()
        tip = (
            foot.keel[-1],
            np.array(
                [sum(foot.parameters.keel.element_lengths_m) - foot.keel_starts[-1], 0.0, 0.0]
            ),
        )
        half = np.array([0.0, 0.5 * inner * foot.parameters.keel.width_m, 0.0])
        return {
            f"limb_{s}": (shank, np.array([0.0, 0.0, -self.person.body.residual_length])),
            f"ankle_{s}": (foot.frame, X_mount),
            f"pylon_{s}": (socket.pylon, np.zeros(3)),
            f"heel_{s}": (foot.frame, np.zeros(3)),
            f"toe_{s}": tip,
            f"rear inner_{s}": (foot.frame, half),
            f"rear outer_{s}": (foot.frame, -half),
            f"front inner_{s}": (tip[0], tip[1] + half),
            f"front outer_{s}": (tip[0], tip[1] - half),
        }


def effects() -> tuple[Effect, ...]:
    """Every coordinate of both persons, with the prosthesis on the left and on the right, once
    each."""
    found: dict[str, Effect] = {}
    for side in ("left", "right"):
        person = DrawnPerson(side)
        for name in person.coordinates:
            effect = person.effect(name)
            if found.setdefault(name, effect) != effect:
                raise ValueError(
                    f"{name} does one thing on the right and another on the left: {effect}, "
                    f"{found[name]}"
                )
    kinds = list(KINDS)
    return tuple(
        sorted(found.values(), key=lambda e: (kinds.index(kind_of(e.name)), e.name[-1] != "r"))
    )
