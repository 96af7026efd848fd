"""What files for all engines share: texts out of templates, and the step that is steady."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import numpy.typing as npt
from jinja2 import Environment, PackageLoader, StrictUndefined
from pydrake.math import RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.base.errors import require
from vsf_drake.engines.limits import cannot_hold
from vsf_drake.laws.contact_laws import CONTACT_LAWS, FITTED_LAW
from vsf_drake.model.model_file import check_fulcrum
from vsf_drake.model.parameters import FootParameters
from vsf_drake.model.setting import moves
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.rigid_foot import NAME, rigid_foot
from vsf_drake.plants.solids import RIGHTWARD

STEP_S = 1e-3
"""The longest for which a file is written."""
SOFTENING = 0.1
"""Of the constraints of Drake's SAP solver, there called beta."""

ET.register_namespace("drake", "http://drake.mit.edu")


def written(
    template: str,
    parameters: FootParameters,
    fulcrum_m: float | None,
    *,
    law: str = FITTED_LAW,
    **more: Any,
) -> str:
    """The text of `template`, named by its format, for the foot of `parameters`; `law` is the
    contact law of its zones, one of CONTACT_LAWS; InputError for another."""
    require(
        law in CONTACT_LAWS,
        f"{law!r} is not known",
        "law",
        f"Known are {', '.join(CONTACT_LAWS)}",
    )
    handles, links = rigid_foot(parameters)
    fulcrum = parameters.fulcrum
    carriers = {body.index(): links[i] for i, body in enumerate((handles.frame, *handles.keel))}
    if fulcrum_m is not None:
        check_fulcrum(fulcrum_m, parameters, where="fulcrum_m")
        more |= {
            "over": links[1 + handles.keel_body_at(fulcrum_m)],
            "point": np.array([fulcrum_m, 0.0, 0.0]),
            "step_s": _step(handles, fulcrum_m, mjcf=template == "foot.mjcf.j2"),
            "support": {
                "stiffness": fulcrum.stiffness_n_per_m,
                "damping": fulcrum.stiffness_n_per_m * fulcrum.damping_time_s,
            },
        }
    return rendered(
        template,
        links=links,
        name=NAME,
        fulcrum_m=fulcrum_m,
        parameters=parameters,
        law=law,
        limits=cannot_hold(parameters, template.split(".")[1], law=law),
        sites=handles.sites,
        carriers=[carriers[index] for index in handles.sites.body_indices],
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
        passive=not moves(parameters),
        mount=handles.mount.name(),
        X_KM=handles.mount.GetFixedPoseInBodyFrame(),
        **more,
    )


def rendered(template: str, **context: Any) -> str:
    """The text of `template` in `engines/templates`: a comment, then indented XML."""
    head, end, tree = filled(template, **context).partition("-->\n")
    root = ET.fromstring(tree)
    ET.indent(root)
    return f"{head}{end}{ET.tostring(root, encoding='unicode')}\n"


def filled(template: str, **context: Any) -> str:
    """The text of `template` in `engines/templates` as it stands there."""
    environment = Environment(
        loader=PackageLoader("vsf_drake.engines"),
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
    return environment.get_template(template).render(context)


def _text(values: npt.ArrayLike) -> str:
    """12 digits, for the thirteenth may differ from one machine to another; below 1e-15 is what
    rounding left of 0."""
    return " ".join(
        "0" if abs(value) < 1e-15 else f"{float(value):.12g}" for value in np.atleast_1d(values)
    )


def _step(foot: FootHandles, fulcrum_m: float, *, mjcf: bool) -> float:
    """Half of the longest step (s) that is steady in theory, rounded down to one digit, `STEP_S` at
    most.

    For small angles q of the keel on a frame that stands still, with springs K taken at the start
    of a step h and dampers D at its end,

        M (v+ - v) = -h (K q + D v+),   q+ = q + h v+.

    All matrices are symmetric, so a mode can grow only where 4 M + 2 h D - h^2 K is not positive:
    the largest 1 / h with which it is singular is an eigenvalue. The support of the files, written
    for h, takes nothing from that matrix up to 2 h, so there it is left out. But Drake's
    constraints are softened ("near-rigid", Castro et al., arXiv 2110.10107): with w the keel's
    compliance to an impulse at the fulcrum (1/kg) they damp with 4 pi^2 / (SOFTENING^2 h w) at
    most, of which the support's spring k needs h k / 2.
    """
    # the stub has no types
    plant: MultibodyPlant = foot.frame.GetParentPlant()  # type: ignore[no-untyped-call]
    at = [
        plant.GetJointByName(name, foot.instance).velocity_start() for name in foot.keel_joint_names
    ]
    M = plant.CalcMassMatrix(plant.CreateDefaultContext())[np.ix_(at, at)]
    K = np.diag(foot.joint_stiffness)
    damping = np.diag(foot.joint_damping)
    inverse = np.linalg.inv(4.0 * M)
    rates = np.linalg.eigvals(
        np.block([[np.zeros_like(M), np.eye(len(M))], [inverse @ K, -2.0 * inverse @ damping]])
    )
    longest_s = 1.0 / float(rates.real.max())
    if not mjcf:
        arm = np.maximum(fulcrum_m - foot.keel_starts, 0.0)
        compliance = arm @ np.linalg.solve(M, arm)
        softened = foot.parameters.fulcrum.stiffness_n_per_m * compliance * SOFTENING**2
        longest_s = min(longest_s, math.sqrt(8.0 * math.pi**2 / softened))
    step_s = min(STEP_S, 0.5 * longest_s)
    digit = 10.0 ** math.floor(math.log10(step_s) + 1e-9)
    return round(math.floor(step_s / digit + 1e-9) * digit, 15)
