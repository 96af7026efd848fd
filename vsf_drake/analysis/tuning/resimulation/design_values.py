"""The design variables of the sagittal model as variables of a walk."""

from __future__ import annotations

from vsf_drake.errors import InputError
from vsf_drake.simulation.walk import Walker


def design_values(
    walker: Walker, *, heel_stiffness: float = 1.0, alignment_rad: float = 0.0, keel_thickness: float = 1.0
) -> dict[str, float]:
    """Values for `Walker.walk` with which the full model has the device of `simulation.sagittal.model.DESIGN`.

    Args:
        walker: whose numbers are multiplied.
        heel_stiffness: of the heel's zones over the walker's.
        alignment_rad: turn of the foot, toes up, beyond the offsets.
        keel_thickness: over the walker's: bending stiffness goes with its third power (a rectangle's second moment of
            area), mass stays.

    Raises:
        InputError: a ratio is not above zero.
    """
    for name, value in (("heel_stiffness", heel_stiffness), ("keel_thickness", keel_thickness)):
        if not value > 0.0:
            raise InputError(f"{value!r} is not usable", where=name, right="It must be above 0")
    values: dict[str, float] = {}
    if heel_stiffness != 1.0:
        values |= {name: heel_stiffness * variable.default for name, variable in walker.variables.items()
                   if name.startswith("contact.heel") and name.endswith(".stiffness")}
    if alignment_rad:
        values["offset.alignment"] = alignment_rad
    if keel_thickness != 1.0:
        modulus = walker.variables["keel.flexural_modulus"]
        values[modulus.name] = keel_thickness**3 * modulus.default
    return values
