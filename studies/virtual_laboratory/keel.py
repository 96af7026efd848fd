"""The tapered keel as a chain of rigid bars with sprung hinges at the nodes between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_laboratory.design import KeelDesign


@dataclass(frozen=True)
class Keel:
    """N bars from A to the tip; hinge i is at the rear end of bar i, hinge 0 the anchor at A.

    Attributes:
        lengths: (N,) m.
        stiffness: (N,) N m/rad of the hinges, EI there / bar length; at the anchor the clamp's.
        twist_bars: (T,) bars at whose rear ends the keel twists.
        twist_stiffness: (T,) N m/rad there.
        node_masses: (N + 1,) kg lumped at A, the hinges and the tip.
    """

    lengths: np.ndarray
    stiffness: np.ndarray
    twist_bars: np.ndarray
    twist_stiffness: np.ndarray
    node_masses: np.ndarray


def thickness(design: KeelDesign, x: np.ndarray) -> np.ndarray:
    """Thickness (m) at `x` (m from A)."""
    return np.interp(
        x,
        [design.thickness_from_m, design.length_m],
        [design.thickness_rear_m, design.thickness_tip_m],
    )


def width(design: KeelDesign, x: np.ndarray) -> np.ndarray:
    """Width (m) at `x` (m from A)."""
    return np.interp(
        x, [design.width_from_m, design.length_m], [design.width_rear_m, design.width_tip_m]
    )


def bending_stiffness(design: KeelDesign, x: np.ndarray) -> np.ndarray:
    """E b h^3 / 12 (N m^2) at `x`."""
    return design.modulus_pa * width(design, x) * thickness(design, x) ** 3 / 12.0


def torsional_stiffness(design: KeelDesign, x: np.ndarray) -> np.ndarray:
    """G b h^3 (1 - 0.63 h / b) / 3 (N m^2) at `x`: Saint-Venant's for a flat rectangle (Timoshenko
    & Goodier)."""
    b, h = width(design, x), thickness(design, x)
    return np.asarray(design.shear_modulus_pa * b * h**3 * (1.0 - 0.63 * h / b) / 3.0)


def make_keel(design: KeelDesign) -> Keel:
    """Trapezoidal rule on the curvature, hence second order in the bar's length; twist lumped in
    the middle of `twists` equal lengths."""
    nodes = np.linspace(0.0, design.length_m, design.elements + 1)
    lengths = np.diff(nodes)
    stiffness = bending_stiffness(design, nodes[:-1]) / lengths
    clamp = design.clamp_nm_per_rad
    # the anchor's hinge has the curvature of half a bar
    stiffness[0] = 1.0 / (1.0 / clamp + 0.5 / stiffness[0]) if clamp > 0.0 else 0.0
    middle = 0.5 * (nodes[1:] + nodes[:-1])
    bars = design.density_kg_m3 * width(design, middle) * thickness(design, middle) * lengths
    masses = np.zeros(design.elements + 1)
    masses[:-1] += 0.5 * bars
    masses[1:] += 0.5 * bars
    parts = np.array_split(np.arange(design.elements), design.twists) if design.twists else []
    compliance = lengths / torsional_stiffness(design, middle)
    return Keel(
        lengths=lengths,
        stiffness=stiffness,
        node_masses=masses,
        twist_bars=np.array([part[len(part) // 2] for part in parts], dtype=np.int64),
        twist_stiffness=np.array([1.0 / np.sum(compliance[part]) for part in parts]),
    )
