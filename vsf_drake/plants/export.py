"""The foot as files for other programs: `foot_sdf` and `foot_mjcf`, whose texts are in
`plants/templates`."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import numpy.typing as npt
from jinja2 import Environment, PackageLoader, StrictUndefined
from pydrake.geometry import GeometryId, Mesh, Role, SceneGraph, Sphere
from pydrake.math import RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from vsf_drake.base.errors import InputError
from vsf_drake.model.model_file import check_fulcrum
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.contact_geometry import add_contact_geometry
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.solids import RIGHTWARD

NAME = "vsf"
"""Of the exported model, and what the names of its frame, mount and carriage begin with."""
REACH_M = 1.0
"""Length (m) of the tendon that is MuJoCo's support: its upper end strays x (m) along the keel as
the keel bends, which lengthens it by x^2 / 2, some micrometres."""
STEP_S = 1e-3
"""The longest for which a file is written."""
CARRIAGE_SERVO_HZ = 30.0
"""Of MuJoCo's actuator that holds the carriage, critically damped (a choice)."""

ET.register_namespace("drake", "http://drake.mit.edu")


def foot_sdf(
    parameters: FootParameters,
    *,
    fulcrum_m: float | None = None,
    springs: bool = True,
    collision: bool = True,
) -> str:
    """The rigid foot with the springs in its keel as an SDFormat model's text, named vsf; names are
    as of `add_foot`.

    Args:
        fulcrum_m: where the support stands (m from A), as a bushing, with the carriage fixed there;
            None leaves the support to `wire_foot` and the carriage on its slide.
        springs: whether the keel's springs and dampers are in its joints; if not, `find_foot` and
            `wire_foot` bring them, implicit ones in a plant with a time step.
        collision: whether the contact spheres are written as collision shapes.
    """
    return _written("foot.sdf.j2", parameters, fulcrum_m, springs=springs, collision=collision)


def foot_mjcf(parameters: FootParameters, *, fulcrum_m: float) -> str:
    """The rigid foot with the springs in its keel and its support at `fulcrum_m` (m from A) as an
    MJCF model's text, named vsf. Names are as `add_foot` gives them; the mount M is a site.

    MuJoCo takes springs at the start of a step h and dampers at its end. The support's damping is
    therefore c + h k, which makes of it the spring at the end of the step, -k (r + h v) - c v.
    """
    return _written(
        "foot.mjcf.j2",
        parameters,
        fulcrum_m,
        reach_m=REACH_M,
        servo=2.0 * math.pi * CARRIAGE_SERVO_HZ,
    )


def _written(
    template: str, parameters: FootParameters, fulcrum_m: float | None, **more: Any
) -> str:
    (handles, links), fulcrum = rigid_foot(parameters), parameters.fulcrum
    if fulcrum_m is not None:
        check_fulcrum(fulcrum_m, parameters, where="fulcrum_m")
        step_s = _step(handles, fulcrum_m, mjcf=template == "foot.mjcf.j2")
        more |= {
            "over": links[1 + handles.keel_body_at(fulcrum_m)],
            "point": np.array([fulcrum_m, 0.0, 0.0]),
            "step_s": step_s,
            "support": {
                "stiffness": fulcrum.stiffness_n_per_m,
                "damping": fulcrum.stiffness_n_per_m * fulcrum.damping_time_s,
            },
        }
    environment = Environment(
        loader=PackageLoader("vsf_drake.plants"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )
    environment.filters |= {
        "text": _text,
        "kind": lambda shape: type(shape).__name__,
        "six": lambda X: [*X.translation(), *RollPitchYaw(X.rotation()).vector()],
        "turned": lambda X: not np.array_equal(X.rotation().matrix(), np.eye(3)),
    }
    text = environment.get_template(template).render(
        links=links,
        name=NAME,
        fulcrum_m=fulcrum_m,
        parameters=parameters,
        sites=handles.sites,
        axis=RIGHTWARD,
        hinges=list(
            zip(
                handles.keel_joint_names,
                handles.joint_stiffness,
                handles.joint_damping,
                strict=True,
            )
        ),
        slide=handles.carriage_joint_name,
        reach=[fulcrum.rearmost_m, fulcrum.foremost_m],
        mount=handles.mount.name(),
        X_KM=handles.mount.GetFixedPoseInBodyFrame(),
        **more,
    )
    head, end, tree = text.partition("-->\n")
    root = ET.fromstring(tree)
    ET.indent(root)
    return f"{head}{end}{ET.tostring(root, encoding='unicode')}\n"


def _text(values: npt.ArrayLike) -> str:
    """12 digits, for the thirteenth may differ from one machine to another; below 1e-15 is what
    rounding left of 0."""
    return " ".join(
        "0" if abs(value) < 1e-15 else f"{float(value):.12g}" for value in np.atleast_1d(values)
    )


def _step(foot: FootHandles, fulcrum_m: float, *, mjcf: bool) -> float:
    """Half of the longest step (s) that is steady in theory, rounded down to one digit, `STEP_S` at
    most.

    For small angles q of the keel on a frame that stands still, with springs K and dampers C taken
    at the start of a step h and dampers D at its end,

        M (v+ - v) = -h (K q + C v + D v+),   q+ = q + h v+.

    All matrices are symmetric, so a mode can grow only where 4 M + 2 h (D - C) - h^2 K is not
    positive: the largest 1 / h with which it is singular is an eigenvalue. Drake takes the bushing
    at the start, spring and damper. The support of `foot_mjcf`, written for h, takes nothing from
    that matrix up to 2 h, so there it is left out.
    """
    # the stub has no types
    plant: MultibodyPlant = foot.frame.GetParentPlant()  # type: ignore[no-untyped-call]
    at = [
        plant.GetJointByName(name, foot.instance).velocity_start() for name in foot.keel_joint_names
    ]
    M = plant.CalcMassMatrix(plant.CreateDefaultContext())[np.ix_(at, at)]
    K = np.diag(foot.joint_stiffness)
    damping = np.diag(foot.joint_damping)
    if not mjcf:
        fulcrum = foot.parameters.fulcrum
        arm = np.maximum(fulcrum_m - foot.keel_starts, 0.0)
        support = fulcrum.stiffness_n_per_m * np.outer(arm, arm)
        K = K + support
        damping = damping - fulcrum.damping_time_s * support
    inverse = np.linalg.inv(4.0 * M)
    rates = np.linalg.eigvals(
        np.block([[np.zeros_like(M), np.eye(len(M))], [inverse @ K, -2.0 * inverse @ damping]])
    )
    step_s = min(STEP_S, 0.5 / float(rates.real.max()))
    digit = 10.0 ** math.floor(math.log10(step_s) + 1e-9)
    return round(math.floor(step_s / digit + 1e-9) * digit, 15)


# All of it is read from a plant of the foot that `add_foot` builds, so that an exported file says
# what the plant says. With all coordinates zero every link's frame is parallel to the keel frame K,
# which is the frame of the first link.


def rigid_foot(parameters: FootParameters) -> tuple[FootHandles, list[dict[str, Any]]]:
    """The foot of `parameters` in a plant of its own, and its links as the templates take them:
    frame, keel from A to the toe, carriage."""
    plant = MultibodyPlant(0.0)
    scene_graph = SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    foot = add_foot(plant, plant.world_frame(), parameters, name=NAME)
    add_contact_geometry(plant, foot, "drake_point")
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    carriage = foot.carriage_joint(plant).child_body()
    bodies = (foot.frame, *foot.keel, carriage)
    starts = (0.0, *foot.keel_starts, 0.0)
    return foot, [
        _link(plant, inspector, body, start) for body, start in zip(bodies, starts, strict=True)
    ]


def _link(plant: MultibodyPlant, inspector: Any, body: RigidBody, start: float) -> dict[str, Any]:
    inertia = body.default_spatial_inertia()
    centre = inertia.get_com()
    drawings = [
        {
            "name": inspector.GetName(i).split("::")[-1],
            "shape": inspector.GetShape(i),
            "X_BG": inspector.GetPoseInFrame(i),
            "colour": inspector.GetIllustrationProperties(i).GetProperty("phong", "diffuse").rgba,
        }
        for i in inspector.GetGeometries(
            plant.GetBodyFrameIdOrThrow(body.index()), Role.kIllustration
        )
        # the sole would be a file of its own
        if not isinstance(inspector.GetShape(i), Mesh)
    ]
    return {
        "name": body.name(),
        "mass": inertia.get_mass(),
        "p_BBcm": centre,
        "p_KB": np.array([start, 0.0, 0.0]),
        "moments": inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3(),
        "drawings": drawings,
        "pads": dict(
            pad_of(inspector, shape) for shape in plant.GetCollisionGeometriesForBody(body)
        ),
    }


def pad_of(inspector: Any, shape: GeometryId) -> tuple[str, dict[str, float]]:
    """Name of a collision sphere, and its place in its body's frame, size and point contact."""
    properties = inspector.GetProximityProperties(shape)
    sphere = inspector.GetShape(shape)
    if not isinstance(sphere, Sphere):
        raise InputError(
            f"is a {type(sphere).__name__}, but must be a sphere",
            where=inspector.GetName(shape),
            right="Export the foot again",
        )
    x, y, z = inspector.GetPoseInFrame(shape).translation()
    friction = properties.GetProperty("material", "coulomb_friction")
    return inspector.GetName(shape).split("::")[-1], {
        "x (m)": x,
        "y (m)": y,
        "z (m)": z,
        "radius (m)": sphere.radius(),
        "stiffness (N/m)": properties.GetProperty("material", "point_contact_stiffness"),
        "dissipation (s/m)": properties.GetProperty("material", "hunt_crossley_dissipation"),
        "static friction": friction.static_friction(),
        "kinetic friction": friction.dynamic_friction(),
    }
