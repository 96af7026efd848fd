"""The foot as a model in SDFormat, whose text is in `engines/templates`."""

from __future__ import annotations

from vsf_drake.engines.written import written
from vsf_drake.laws.contact_laws import FITTED_LAW
from vsf_drake.model.parameters import FootParameters

REACH_M = 1000.0
"""Length of the spring that is Drake's support: its upper end strays x (m) along the keel as the
keel bends, which lengthens it by x^2 / 2 / REACH_M, some nanometres at most. Rounding of such
a length, 1e-13 m, is 2e-7 N on the nominal support."""


def foot_sdf(
    parameters: FootParameters,
    *,
    fulcrum_m: float | None = None,
    springs: bool = True,
    collision: bool = True,
    discrete: bool = True,
    law: str = FITTED_LAW,
) -> str:
    """The rigid foot with the springs in its keel as an SDFormat model's text, named vsf; names are
    as of `add_foot`.

    Args:
        fulcrum_m: where the support stands (m from A), as a spring, with the carriage fixed there;
            None leaves the support to `wire_foot` and the carriage on its slide.
        springs: whether the keel's springs and dampers are in its joints; if not, `find_foot` and
            `wire_foot` bring them, implicit ones in a plant with a time step.
        collision: whether the contact spheres are written as collision shapes.
        discrete: whether the support at `fulcrum_m` is for a plant with a time step and a contact
            approximation of the SAP solver, as Drake's default is. Such a file has a constraint,
            which a plant without a time step, or with kTamsi, refuses.
        law: the contact law of the parameters: the file's head tells what Drake's has instead.

    A plant takes springs at the start of a step h, dampers at its end if they are in joints or
    constraints. The support's damping is therefore c + h k, as in `foot_mjcf`, and in a constraint:
    a tendon of the keel's joints, which has the height of the keel's point at the fulcrum for small
    angles.
    """
    return written(
        "foot.sdf.j2",
        parameters,
        fulcrum_m,
        springs=springs,
        collision=collision,
        discrete=discrete,
        law=law,
        reach_m=REACH_M,
    )
