"""The virtual foot on the testing machine, and how its compliances were tuned to the published
bench.

The mount is held still. Forefoot: a stiff load shoe as long as the bench's patch lies flush under
the load point; the machine presses it vertically towards that point of the keel's centreline, so
the shoe's foam is in series with the keel on its fulcrum. Heel: a flat platen presses the level
heel block. Static: the machine is far slower than any damping here.

    cd studies && python -m virtual_laboratory.bench            # the table
    cd studies && python -m virtual_laboratory.bench --tune  # the moduli and stiffness for
                                                             design.py
"""

from __future__ import annotations

import argparse
import dataclasses

import numpy as np
from scipy.optimize import brentq, root

from virtual_laboratory.assembly import add_fulcrum
from virtual_laboratory.design import Design
from virtual_laboratory.device import Device, make_device, new_state
from virtual_laboratory.dynamics import chain
from virtual_laboratory.laws import foam

LOADS_N = (200.0, 600.0)
"""Stiffness is the mean slope between these, as McGeehan 2021 (doi 10.1115/1.4050456) above
200 N."""
PUBLISHED_N_PER_M = {0.066: 10e3, 0.151: 32e3}
PUBLISHED_HEEL_N_PER_M = 65e3
_ITERATIONS = 60


def bench_device(design: Design, fulcrum: float | None) -> Device:
    """The foot with its fulcrum at `fulcrum` (m from A); the lengths above it do not matter on the
    bench."""
    return make_device(design, fulcrum=fulcrum, residual_length=0.3, pylon_length=0.1)


def keel_under_load(device: Device, load_point: float, loads: np.ndarray) -> np.ndarray:
    """Static hinge angles (len(loads), N) under vertical loads (N) at a point of the keel (m from
    A)."""
    q, states = np.zeros(len(device.hinge_stiffness)), []
    for load in loads:
        q = _equilibrium(device, load_point, float(load), q)
        states.append(q)
    return np.array(states)


def point_height(device: Device, angles: np.ndarray, x: float) -> float:
    """Height (m) above the unloaded keel of the point `x` (m from A along the keel) for absolute
    bar angles."""
    starts = np.concatenate(([0.0], np.cumsum(device.lengths)[:-1]))
    within = np.clip(x - starts, 0.0, device.lengths)
    return float(np.sum(within * np.sin(angles)))


def _equilibrium(device: Device, load_point: float, load: float, q: np.ndarray) -> np.ndarray:
    """Newton with the exact Jacobian of load and hinges, Gauss-Newton of the fulcrum."""
    count = len(device.lengths)
    starts = np.concatenate(([0.0], np.cumsum(device.lengths)[:-1]))
    within = np.clip(load_point - starts, 0.0, device.lengths)
    loaded = starts < load_point
    later = np.maximum.outer(np.arange(count), np.arange(count))
    hinges, bars, axes = np.empty((count + 1, 3)), np.empty((count, 3, 3)), np.empty((count, 3))
    # nothing twists in the plane of symmetry
    flat = device._replace(twist_bars=device.twist_bars[:0])
    state = new_state(flat)
    q = q.copy()
    for _ in range(_ITERATIONS):
        chain(flat, q, hinges, bars, axes)
        x, _, z = (hinges - device.anchor).T
        drop = np.where(loaded, np.sum(within * bars[:, 2, 0]) - z[:-1], 0.0)
        lever = np.where(loaded, np.sum(within * bars[:, 0, 0]) - x[:-1], 0.0)
        rhs, H = np.zeros(6 + count), np.zeros((6 + count, 6 + count))
        add_fulcrum(flat, state, hinges, bars, axes, np.inf, rhs, H, np.empty(2))
        lower = H[6:, 6:]
        tangent = (
            lower + np.tril(lower, -1).T + np.diag(device.hinge_stiffness) + load * drop[later]
        )
        change = np.linalg.solve(tangent, rhs[6:] + load * lever - device.hinge_stiffness * q)
        size = float(np.max(np.abs(change)))
        q += change * min(1.0, 0.1 / max(size, 0.1))
        if size < 1e-12:
            return q
    raise RuntimeError(f"no equilibrium under {load:g} N with the fulcrum at {device.fulcrum:g} m")


def shoe_compression(design: Design, load: float) -> float:
    """Compression (m) of the foam between keel and the load shoe."""
    device, frame = bench_device(design, design.support and design.support.rearmost_m), design.frame
    starts = np.concatenate(([0.0], np.cumsum(device.lengths)[:-1]))
    x = np.where(
        device.bodies > 0, starts[np.maximum(device.bodies, 1) - 1] + device.points[:, 0], -1.0
    )
    cells = np.abs(x - frame.load_point_m) <= 0.5 * frame.patch_m
    # the shoe lies flush: it follows the sole's line, so only the rounding of the edges leaves a
    # gap
    lowest = np.array(
        [np.min(device.points[cells & (np.abs(x - at) < 1e-9), 2]) for at in x[cells]]
    )
    return _compression(device, cells, device.points[cells, 2] - lowest, load)


def _compression(device: Device, cells: np.ndarray, gaps: np.ndarray, load: float) -> float:
    stiffness, dense = device.foam_stiffness[cells], device.dense_depth[cells]

    def excess(depth: float) -> float:
        pressed = zip(gaps, stiffness, dense, strict=True)
        return sum(foam(depth - gap, k, limit)[0] for gap, k, limit in pressed) - load

    return float(brentq(excess, 0.0, 0.04, xtol=1e-12)) if load > 0.0 else 0.0


def forefoot_curve(design: Design, fulcrum: float | None, loads: np.ndarray) -> np.ndarray:
    """Travel (m) of the machine at `loads` (N, increasing) with the fulcrum at `fulcrum` (m from
    A)."""
    device, point = bench_device(design, fulcrum), design.frame.load_point_m
    keel = [
        point_height(device, np.cumsum(q), point) for q in keel_under_load(device, point, loads)
    ]
    return np.array(keel) + np.array([shoe_compression(design, float(load)) for load in loads])


def heel_curve(design: Design, loads: np.ndarray) -> np.ndarray:
    """Travel (m) of a flat platen at `loads` (N) since it touched the level heel block."""
    device = bench_device(design, design.support and design.support.rearmost_m)
    cells = device.bodies == 0
    gaps = device.points[cells, 2] - np.min(device.points[cells, 2])
    return np.array([_compression(device, cells, gaps, float(load)) for load in loads])


def forefoot_stiffness(design: Design, fulcrum: float | None) -> float:
    """Mean slope (N/m) between 200 and 600 N."""
    travel = forefoot_curve(design, fulcrum, np.linspace(0.0, LOADS_N[1], 7))
    return float((LOADS_N[1] - LOADS_N[0]) / (travel[-1] - travel[2]))


def heel_stiffness(design: Design) -> float:
    """Mean slope (N/m) between 200 and 600 N."""
    low, high = heel_curve(design, np.array(LOADS_N))
    return float((LOADS_N[1] - LOADS_N[0]) / (high - low))


def tuned(design: Design) -> Design:
    """`design` with the keel's modulus and the forefoot foam solved for the two published forefoot
    stiffnesses, heel foam for the heel's; the support stays as stiff as it is."""

    def with_(keel: float, fore: float, heel: float) -> Design:
        return dataclasses.replace(
            design,
            keel=dataclasses.replace(design.keel, modulus_pa=keel),
            sole=dataclasses.replace(design.sole, foam_modulus_pa=fore, heel_modulus_pa=heel),
        )

    heel = brentq(lambda e: heel_stiffness(with_(1e10, 5e5, e)) - PUBLISHED_HEEL_N_PER_M, 2e5, 4e6)

    def errors(logs: np.ndarray) -> list[float]:
        trial = with_(float(np.exp(logs[0])), float(np.exp(logs[1])), heel)
        return [forefoot_stiffness(trial, x) / k - 1.0 for x, k in PUBLISHED_N_PER_M.items()]

    found = root(errors, np.log([9e9, 5e5]), tol=1e-10)
    if not found.success:
        raise RuntimeError(f"the bench cannot be met: {found.message}")
    keel, fore = np.exp(found.x)
    return with_(float(keel), float(fore), float(heel))


def main() -> None:
    """Prints the bench table, tuned anew if asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--tune", action="store_true", help="solve for the moduli instead of taking design.py's"
    )
    design = tuned(Design()) if parser.parse_args().tune else Design()
    print(f"modulus_pa {design.keel.modulus_pa:.5g}")
    print(
        f"foam_modulus_pa {design.sole.foam_modulus_pa:.5g}, heel_modulus_pa "
        f"{design.sole.heel_modulus_pa:.5g}"
    )
    for fulcrum in (0.066, 0.087, 0.108, 0.129, 0.150, 0.151):
        print(f"{1e3 * fulcrum:5.0f} mm {1e-3 * forefoot_stiffness(design, fulcrum):7.3f} N/mm")
    print(f"heel     {1e-3 * heel_stiffness(design):7.3f} N/mm")


if __name__ == "__main__":
    main()
