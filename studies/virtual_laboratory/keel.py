"""The tapered keel as a chain of rigid bars with sprung hinges at the nodes between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_laboratory.design import KeelDesign


@dataclass(frozen=True)
class Keel:
    """N bars from A to the tip; hinge i is at the rear end of bar i, hinge 0 the pin at A.

    Attributes:
        lengths: (N,) m.
        stiffness: (N,) N m/rad of the hinges, EI there / bar length; zero for the pin.
        node_masses: (N + 1,) kg lumped at A, the hinges and the tip.
    """

    lengths: np.ndarray
    stiffness: np.ndarray
    node_masses: np.ndarray


def thickness(design: KeelDesign, x: np.ndarray, length: float) -> np.ndarray:
    """Thickness (m) at `x` (m from A) of a keel of `length` (m)."""
    return np.interp(x, [design.thickness_from_m, length], [design.thickness_rear_m, design.thickness_tip_m])


def width(design: KeelDesign, x: np.ndarray, length: float) -> np.ndarray:
    """Width (m) at `x` (m from A) of a keel of `length` (m)."""
    return np.interp(x, [design.width_from_m, length], [design.width_rear_m, design.width_tip_m])


def bending_stiffness(design: KeelDesign, x: np.ndarray, length: float) -> np.ndarray:
    """E b h^3 / 12 (N m^2) at `x`."""
    return design.modulus_pa * width(design, x, length) * thickness(design, x, length) ** 3 / 12.0


def make_keel(design: KeelDesign, length: float) -> Keel:
    """A keel of `length` (m): trapezoidal rule on the curvature, hence second order in the bar's length."""
    nodes = np.linspace(0.0, length, design.elements + 1)
    lengths = np.diff(nodes)
    stiffness = bending_stiffness(design, nodes[:-1], length) / lengths
    stiffness[0] = 0.0
    middle = 0.5 * (nodes[1:] + nodes[:-1])
    bars = design.density_kg_m3 * width(design, middle, length) * thickness(design, middle, length) * lengths
    masses = np.zeros(design.elements + 1)
    masses[:-1] += 0.5 * bars
    masses[1:] += 0.5 * bars
    return Keel(lengths=lengths, stiffness=stiffness, node_masses=masses)
