"""Kinematics and inverse dynamics of a planar tree for many instants at once, in arrays of any shape, real or complex.

Recursive Newton-Euler method (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 5), in the plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.simulation.sagittal.planar_tree import PlanarTree, turned


@dataclass
class PlanarMotion:
    """Frames of all links: lists over the links of arrays (...).

    phi, omega, alpha: angle about +y (rad), its rates. x, z, vx, vz, ax, az: of the frame's origin in W.
    ways: unit direction (x, z) of a prismatic joint, None for a revolute one.
    """

    phi: list[np.ndarray]
    omega: list[np.ndarray]
    alpha: list[np.ndarray]
    x: list[np.ndarray]
    z: list[np.ndarray]
    vx: list[np.ndarray]
    vz: list[np.ndarray]
    ax: list[np.ndarray]
    az: list[np.ndarray]
    ways: list[tuple[np.ndarray, np.ndarray] | None]

    def point(self, link: int, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, ...]:
        """Position and velocity (x, z, vx, vz) in W of the point (x, z) of a link's frame."""
        rx, rz = turned(x, z, self.phi[link])
        w = self.omega[link]
        return self.x[link] + rx, self.z[link] + rz, self.vx[link] + w * rz, self.vz[link] - w * rx


def move(tree: PlanarTree, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> PlanarMotion:
    """Motion of all links at coordinates, rates and accelerations (C, ...)."""
    m = PlanarMotion(*([] for _ in range(10)))
    nil = np.zeros_like(q[0])
    for link in tree.links:
        p, c = link.parent, link.coordinate
        if p < 0:
            phi = omega = alpha = x0 = z0 = vx0 = vz0 = ax0 = az0 = nil
        else:
            phi, omega, alpha = m.phi[p], m.omega[p], m.alpha[p]
            x0, z0, vx0, vz0, ax0, az0 = m.x[p], m.z[p], m.vx[p], m.vz[p], m.ax[p], m.az[p]
        rx, rz = turned(link.offset[0], link.offset[1], phi)
        extra_vx = extra_vz = extra_ax = extra_az = 0.0
        way = None
        if not link.turns:
            dx, dz = way = turned(link.direction[0], link.direction[1], phi + link.angle)
            rx, rz = rx + dx * q[c], rz + dz * q[c]
            extra_vx, extra_vz = dx * v[c], dz * v[c]
            extra_ax = dx * a[c] + 2.0 * omega * extra_vz
            extra_az = dz * a[c] - 2.0 * omega * extra_vx
        square = omega * omega
        m.x.append(x0 + rx)
        m.z.append(z0 + rz)
        m.vx.append(vx0 + omega * rz + extra_vx)
        m.vz.append(vz0 - omega * rx + extra_vz)
        m.ax.append(ax0 + alpha * rz - square * rx + extra_ax)
        m.az.append(az0 - alpha * rx - square * rz + extra_az)
        m.ways.append(way)
        turn = link.sign if link.turns else 0.0
        m.phi.append(phi + link.angle + turn * q[c] if turn else phi + link.angle)
        m.omega.append(omega + turn * v[c] if turn else omega)
        m.alpha.append(alpha + turn * a[c] if turn else alpha)
    return m


class Wrenches:
    """Sums of forces on the links, about their origins."""

    def __init__(self, tree: PlanarTree, motion: PlanarMotion) -> None:
        """Begins with what inertia and gravity take."""
        self.tree, self.motion = tree, motion
        self.fx, self.fz, self.my = [], [], []
        for i, link in enumerate(tree.links):
            ax, az = motion.ax[i], motion.az[i] + tree.gravity
            hx, hz = turned(link.moment[0], link.moment[1], motion.phi[i])
            alpha, square = motion.alpha[i], motion.omega[i] * motion.omega[i]
            self.fx.append(link.mass * ax + alpha * hz - square * hx)
            self.fz.append(link.mass * az - alpha * hx - square * hz)
            self.my.append(link.inertia * alpha + hz * ax - hx * az)

    def apply(self, link: int, x: np.ndarray, z: np.ndarray, fx: np.ndarray, fz: np.ndarray) -> None:
        """A force on a link at the point (x, z) of W: the joints have so much less to give."""
        rx, rz = x - self.motion.x[link], z - self.motion.z[link]
        self.fx[link] = self.fx[link] - fx
        self.fz[link] = self.fz[link] - fz
        self.my[link] = self.my[link] - (rz * fx - rx * fz)

    def gather(self, count: int) -> np.ndarray:
        """(count, ...) generalized forces that the joints must give."""
        motion = self.motion
        out: list[np.ndarray] = [np.zeros_like(motion.x[0])] * count
        for i in range(len(self.tree.links) - 1, -1, -1):
            link, way = self.tree.links[i], motion.ways[i]
            fx, fz, my, p = self.fx[i], self.fz[i], self.my[i], link.parent
            out[link.coordinate] = link.sign * my if way is None else way[0] * fx + way[1] * fz
            if p >= 0:
                rx, rz = motion.x[i] - motion.x[p], motion.z[i] - motion.z[p]
                self.fx[p] = self.fx[p] + fx
                self.fz[p] = self.fz[p] + fz
                self.my[p] = self.my[p] + my + rz * fx - rx * fz
        return np.array(out)
