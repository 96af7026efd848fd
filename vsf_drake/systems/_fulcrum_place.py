"""The fulcrum's position as it comes from a port or a parameter, checked where it is used."""

from __future__ import annotations

from typing import Any

from vsf_drake.errors import InputError

FARTHEST_M = 10.0
"""Beyond it a fulcrum position is in mm (a choice, wide because a trial step of an integrator may overshoot)."""


def fulcrum_place(position: Any, system: Any) -> Any:
    """`position` (m from A), a float or AutoDiffXd, that `system` was given.

    Raises:
        InputError: it is not a number within FARTHEST_M.
    """
    if not -FARTHEST_M <= position <= FARTHEST_M:
        raise InputError(f"the fulcrum at {position} m from A is under no foot",
                         where=f"fulcrum_position of {system.get_name()!r}",
                         right="It is in metres: 0.066 to 0.151 for the nominal foot")
    return position
