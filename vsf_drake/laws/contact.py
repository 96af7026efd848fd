"""What compiled code and Python call of the contact laws: the law is a whole number, its place in
the table `laws.contact_laws`, that all walks and sites of a call have in common."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from vsf_drake.laws._elementwise import Values
from vsf_drake.laws.compiled import generic
from vsf_drake.laws.contact_law import ContactLaw, LawConstants
from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.laws.lanes import negated, some

LAWS: tuple[ContactLaw, ...] = tuple(
    import_module(f"vsf_drake.laws.{file}").LAW for file in CONTACT_LAWS.values()
)
FIRST_COLUMN = 4
"""Of a site's row, after its centre and radius: where `contact_law.LAW_COLUMNS` begin."""


def _by_number(functions: Sequence[Any], first: int = 0) -> Any:
    """A function of a law's number and what the law's own function takes."""
    own = functions[first]

    @generic
    def last(law: int, *given: Any) -> Any:
        return own(*given)

    if first == len(functions) - 1:
        return last
    others = _by_number(functions, first + 1)

    @generic
    def one_of(law: int, *given: Any) -> Any:
        if law == first:
            return own(*given)
        return others(law, *given)

    return one_of


penetration = _by_number([law.penetration for law in LAWS])
"""law, signed depth, constants -> `ContactLaw.penetration`."""
force = _by_number([law.force for law in LAWS])
"""law, depth, depth rate, constants -> `ContactLaw.force`."""
per_speed = _by_number([law.friction.per_speed for law in LAWS])
"""law, slip speed, constants -> `Friction.per_speed`."""
force_by = _by_number([law.by_constant for law in LAWS])
"""law, place of a constant, signed depth, depth rate, constants -> `ContactLaw.by_constant`."""
_friction_by = _by_number([law.friction.by_constant for law in LAWS])


@generic
def law_constants(sites: Any, s: int) -> LawConstants:
    """Of row s of the stepper's sites (S, columns)."""
    return LawConstants(
        sites[s, 4],
        sites[s, 5],
        sites[s, 6],
        sites[s, 7],
        sites[s, 8],
        sites[s, 9],
        sites[s, 10],
        sites[s, 11],
        sites[s, 12],
        sites[s, 13],
    )


@generic
def normal_force(
    law: int, depth: Values, rate: Values, sites: Any, s: int
) -> tuple[Values, Values, Values]:
    """Normal force (N) on site s whose lowest point is `depth` (m) below the ground, negative above
    it, and its derivatives by depth (N/m) and by depth rate (N s/m)."""
    site = law_constants(sites, s)
    pressed, slope = penetration(law, depth, site)
    if not some(negated(pressed <= 0.0)):
        return 0.0 * pressed, 0.0 * pressed, 0.0 * pressed
    normal, by_depth, by_rate = force(law, pressed, rate, site)
    return normal, slope * by_depth, by_rate


@generic
def friction_per_speed(law: int, speed: Values, sites: Any, s: int) -> tuple[Values, Values]:
    """mu(V) / V (s/m) of site s at the slip speed V (m/s), and the slope d mu / dV (s/m)."""
    ratio, slope = per_speed(law, speed, law_constants(sites, s))
    return ratio, slope


@generic
def normal_by_constant(
    law: int, column: int, depth: Values, rate: Values, sites: Any, s: int
) -> Values:
    """Derivative of the normal force by a column of the site."""
    return force_by(law, column - FIRST_COLUMN, depth, rate, law_constants(sites, s))


@generic
def friction_by_constant(law: int, column: int, speed: Values, sites: Any, s: int) -> Values:
    """Derivative of mu(V) / V by a column of the site."""
    return _friction_by(law, column - FIRST_COLUMN, speed, law_constants(sites, s))
