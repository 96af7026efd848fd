"""A person who rolls over the prosthetic foot once, and what it takes to run it: made up, planar at
heart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pydrake.multibody.tree import BodyIndex

from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.walk import Walk, Walker

TOUCH_S, STANCE_S, END_S = 0.12, 0.70, 0.94
SPEED = 0.96
FULCRUM_M = 0.108

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")


@cache
def _walker(side: str) -> Walker:
    return Walker(replace(SUBJECT, prosthetic_side=side), ModelParameters())


def _angles(s: np.ndarray) -> dict[str, np.ndarray]:
    """Joint angles (rad) of a right prosthesis at phase `s` of its stance (0 touch-down, 1
    lift-off)."""
    degrees = {
        "pelvis_tilt": 4 + np.sin(2 * np.pi * s),
        "pelvis_list": 2 * np.sin(np.pi * s),
        "pelvis_rotation": 4 * np.cos(np.pi * s),
        "hip_flexion_r": 22 - 42 * s,
        "hip_adduction_r": 1 + 2 * np.sin(np.pi * s),
        "hip_rotation_r": 2 * np.sin(2 * np.pi * s),
        "knee_angle_r": 8 + 5 * np.sin(np.pi * s),
        "knee_adduction_r": 0.5 * s,
        "knee_rotation_r": 1 - s,
        "hip_flexion_l": 30 + 10 * np.cos(np.pi * s),
        "hip_adduction_l": 2.0 * s,
        "hip_rotation_l": 1 + s,
        "knee_angle_l": 80 + 15 * np.sin(np.pi * s),
        "knee_adduction_l": 0.3 * s,
        "knee_rotation_l": 0.2 * s,
        "ankle_angle_l": 5 * np.sin(np.pi * s),
        "ankle_adduction_l": s,
        "ankle_rotation_l": 0.5 * s,
    }
    return {name: np.radians(values) * np.ones_like(s) for name, values in degrees.items()}


def _sole_height(walker: Walker, columns: dict[str, float]) -> float:
    """Height (m) of the lowest contact sphere's bottom over the ground, smoothed over some 3 mm."""
    plant, sites = walker.gait.plant, walker.gait.person.foot.sites
    context = plant.CreateDefaultContext()
    for name, value in columns.items():
        joint = plant.GetJointByName(name)
        (joint.set_angle if hasattr(joint, "set_angle") else joint.set_translation)(context, value)
    bottoms = np.array(
        [
            (plant.get_body(BodyIndex(int(body))).EvalPoseInWorld(context) @ p)[2] - r
            for body, p, r in zip(sites.body_indices, sites.p_BS, sites.radius, strict=True)
        ]
    )
    scale = 3e-3
    return float(bottoms.min() - scale * np.log(np.sum(np.exp((bottoms.min() - bottoms) / scale))))


@cache
def _motion(side: str) -> CoordinateTrajectory:
    """The sole sinks some centimetres below where it would just touch: heel, roll over, toe, and
    off.

    The left one is the same seen in a mirror: sides change names, lateral coordinates of the pelvis
    their sign.
    """
    if side == "left":
        right, other = _motion("right"), {"_r": "_l", "_l": "_r"}
        flipped = ("pelvis_tz", "pelvis_list", "pelvis_rotation")
        values = right.values * np.array([-1.0 if name in flipped else 1.0 for name in right.names])
        return CoordinateTrajectory(
            right.time_s,
            values,
            [
                name if name.startswith("pelvis") else name[:-2] + other[name[-2:]]
                for name in right.names
            ],
        )
    walker = _walker("right")
    time = np.arange(0.0, END_S + 0.005, 0.01)
    s = (time - TOUCH_S) / STANCE_S
    columns = _angles(s)
    columns["pelvis_tx"], columns["pelvis_tz"] = SPEED * time, 0.01 * np.sin(np.pi * s)
    rows = [{name: float(values[i]) for name, values in columns.items()} for i in range(len(time))]
    sinking = (0.013 + 0.035 * s) * (np.sin(np.pi * s) + 0.25 * np.sin(3 * np.pi * s))
    columns["pelvis_ty"] = -np.array([_sole_height(walker, row) for row in rows]) - sinking
    names = walker.gait.person.coordinate_names
    return CoordinateTrajectory(time, np.column_stack([columns[name] for name in names]), names)


@cache
def _stance(side: str, step_s: float) -> Walk:
    return _walker(side).walk(
        _motion(side), fulcrum_m=FULCRUM_M, start_s=0.0, end_s=END_S, step_s=step_s
    )


@pytest.fixture(scope="session")
def walker() -> Callable[[str], Walker]:
    """walker(side): the person with a prosthesis there, built once. Leave its Context as you found
    it."""
    return _walker


@pytest.fixture(scope="session")
def motion() -> Callable[[str], CoordinateTrajectory]:
    """motion(side): one roll-over of the prosthetic foot, END_S long; the left one mirrors the
    right one."""
    return _motion


@pytest.fixture(scope="session")
def stance() -> Callable[[str, float], Walk]:
    """stance(side, step_s): that motion by the stepper, fulcrum at 108 mm, run once per step."""
    return _stance


@pytest.fixture(scope="session")
def body_weight() -> float:
    """N."""
    return SUBJECT.mass_kg * 9.81
