"""The foot as a model in SDFormat, whose text is in `engines/templates`."""

from __future__ import annotations

from vsf_drake.engines.written import written
from vsf_drake.model.parameters import FootParameters


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
    return written("foot.sdf.j2", parameters, fulcrum_m, springs=springs, collision=collision)
