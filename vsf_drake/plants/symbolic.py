"""Diagrams in symbolic expressions, or the reason why not."""

from __future__ import annotations

from pydrake.systems.framework import Diagram, System

from vsf_drake.errors import InputError

OTHERS = "its type has no symbolic form"


def to_symbolic(diagram: Diagram) -> Diagram:
    """Converts `diagram` to symbolic expressions (`pydrake.symbolic.Expression`), as its `ToSymbolic` does.

    The keel's springs, servos and commands, which are linear, have a symbolic form, as Drake's MultibodyPlant has; what
    stands on the ground has none. For derivatives of a whole diagram take `ToAutoDiffXd`.

    Raises:
        InputError: a system in it has no symbolic form; the message names each and says why.
    """
    converted = diagram.ToSymbolicMaybe()
    if converted is not None:
        return converted
    reasons = [f"{system.GetSystemPathname()} ({type(system).__name__.split('_')[0]}): "
               f"{getattr(system, 'why_not_symbolic', OTHERS)}"
               for system in _leaves(diagram) if system.ToSymbolicMaybe() is None]
    raise InputError("has no symbolic form, for " + "; ".join(reasons), where=diagram.get_name() or "diagram",
                     right="Take diagram.ToAutoDiffXd() for derivatives, or convert the part without these systems")


def _leaves(system: System) -> list[System]:
    """All systems in `system` that are no diagrams."""
    return [leaf for part in system.GetSystems() for leaf in _leaves(part)] if isinstance(system, Diagram) else [system]
