"""Derivatives of the sagittal model's outputs: closed form for bodies and contact, complex steps in
springs and support.

With S_k a joint, i a link that it carries, V and A twists and their rates, parent(k) what carries
the joint itself,

    D_k = V_parent(k) x S_k         is how V_i changes with the coordinate of k, seen from link i
    E_k = A_parent(k) x S_k + V_parent(k) x D_k

and the wrench f_i that inertia takes changes

    with the coordinate     by S_k x f_i + I_i E_k
    with its rate           by 2 I_i D_k + B_i S_k,  B_i S = 2 (H_i . V_i, p_z, -p_x) S_omega, p the
                                                     momentum of i
    with its acceleration   by I_i S_k

(Carpentier & Mansard, Robotics: Science and Systems 2018, doi 10.15607/RSS.2018.XIV.038; in the
plane B_i D_k is 0). Sums over what a link carries and products with the joints do the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.simulation.sagittal.model import (
    IMAGINARY_STEP,
    SOCKET,
    SagittalModel,
    Smoothing,
    Spheres,
    State,
    sole,
    spring_forces,
    tall,
    wrenches,
)
from vsf_drake.simulation.sagittal.planar_dynamics import (
    PlanarDynamics,
    PlanarMotion,
    cross,
    inertia_times,
)


class _Columns:
    """Places of q, v, a, w, u and p among the derivatives; `link`: of q, w and, if there is a
    prosthesis, fulcrum and alignment, in this order."""

    def __init__(self, n: int, k: int, link: np.ndarray) -> None:
        self.n = n
        self.k = k
        self.of_q = link[:n]
        self.of_w = link[n : n + k]
        self.of_placed = link[n + k :]
        self.v = n
        self.a = 2 * n
        self.w = 3 * n
        self.u = 3 * n + k
        self.fulcrum, self.heel, alignment, self.thickness = 3 * n + 2 * k + np.arange(4)
        self.placed = np.array([self.fulcrum, alignment])[: len(self.of_placed)]

    def fill(self, by: np.ndarray, place: np.ndarray, rate: np.ndarray | None = None) -> None:
        """Into `by` (r, P, N) the derivatives (r, L, N) by the links' coordinates and by their
        rates."""
        by[:, : self.n], by[:, self.w : self.u] = place[:, self.of_q], place[:, self.of_w]
        by[:, self.placed] = place[:, self.of_placed]
        if rate is not None:
            by[:, self.v : self.a], by[:, self.u : self.fulcrum] = (
                rate[:, self.of_q],
                rate[:, self.of_w],
            )


def linearise(
    model: SagittalModel,
    q: np.ndarray,
    v: np.ndarray,
    a: np.ndarray,
    w: np.ndarray,
    u: np.ndarray,
    p: np.ndarray,
    smoothing: Smoothing,
) -> tuple[np.ndarray, np.ndarray]:
    """Values (m, N) of `SagittalModel.evaluate` at real arrays (n, N), and (m, P, N) derivatives by
    what is given, in order: P = 3 n + 2 k + 4."""
    n = len(q)
    k = len(w)
    dynamics = model.dynamics
    at = _Columns(len(q), len(w), model.dynamics.link)
    state = model.state(q, v, a, w, u, p, smoothing)
    y = model.outputs_of(state, v, w, u, p)
    by = np.zeros((len(y), at.thickness + 1, q.shape[1]))

    # The state that all share: twists, D and E of the joints, wrenches f that inertia takes less
    # those of the ground.
    motion = state.motion
    joints = _joints(dynamics, motion)
    feet = ground_changes(model.spheres, model.feet, dynamics.carries, state)
    taken = dynamics.of_carried(state.taken) - feet[0].wrench - feet[1].wrench

    # Forces S . f in the joints: balance of pelvis, socket and keel, then torques; links in the
    # order of these rows.
    links = dynamics.link[np.concatenate([np.arange(3), np.arange(n, n + k), np.arange(3, n)])]
    load = by[: n + k]
    place, rate, acceleration = _load_change(
        dynamics, motion, joints, taken, feet[0] + feet[1], links
    )
    at.fill(load, place, rate)
    load[:, at.a : at.w] = acceleration[:, at.of_q]
    load[:, at.heel] = -np.einsum("cln,cln->ln", motion.S[:, links], feet[0].by_heel[:, links])

    # Socket and keel have springs, the keel the support too: their balance is the joint's force
    # less the spring's.
    torque = slice(3 + k, n + k)
    powers = n + k + np.arange(n - 3)
    ground = 2 * n + k - 3
    power = model.outputs.index("prosthesis_power")
    stored = power + 1
    soles = power + 2
    by[stored] = _add_support(model, w, u, p, by[3 : 3 + k], at)
    by_spring = _add_springs(model, w, u, p, by[stored], at)
    by[3 : 3 + k] -= by_spring

    # Power of a joint: torque v, so that d = d torque v + torque dv.
    by[powers] = by[torque] * v[3:, None]
    by[powers, at.v + np.arange(3, n)] += y[torque]

    # The ground's wrench on a foot by all that moves it: place and twist of each link, S dq and
    # (V_p x S) dq + S dv.
    for i, foot in enumerate(feet):
        change = np.zeros((3, *by.shape[1:]))
        at.fill(
            change,
            _of(foot.by_place, motion.S) + _of(foot.by_twist, joints[0]),
            _of(foot.by_twist, motion.S),
        )
        change[:, at.heel] = foot.by_heel[:, 0]
        by[ground + 3 * i : ground + 3 * i + 3] = change[[1, 2, 0]]
    by[ground + 6 : power] = by_spring[:3]
    by[power] = _power_below(
        model, motion, joints, feet[0].wrench[:, 0], by[ground : ground + 3], at
    )

    # Height of a sole, sum of part_s z_s: sphere s rises by z - x omega as a link that carries it
    # moves.
    for i, rows in enumerate(model.feet):
        part = sole(state.touch.depth[rows])[1]
        onto = dynamics.carries[:, model.spheres.link[rows]]
        lift = np.stack(
            [onto @ (-part * state.touch.x[rows]), np.zeros_like(motion.x), onto @ part]
        )
        at.fill(by[soles + i : soles + i + 1], np.einsum("cln,cln->ln", lift, motion.S)[None])
    return y, by


def _joints(dynamics: PlanarDynamics, motion: PlanarMotion) -> tuple[np.ndarray, np.ndarray]:
    """D = V_parent x S and E = A_parent x S + V_parent x D (3, L, N) of the joints."""
    carried = np.where(dynamics.parent[:, None] < 0, 0.0, motion.V[:, dynamics.parent])
    world = np.array([0.0, 0.0, dynamics.gravity])[:, None, None]
    D = cross(carried, motion.S)
    A = np.where(dynamics.parent[:, None] < 0, world, motion.A[:, dynamics.parent])
    return D, cross(A, motion.S) + cross(carried, D)


def _load_change(
    dynamics: PlanarDynamics,
    motion: PlanarMotion,
    joints: tuple[np.ndarray, np.ndarray],
    taken: np.ndarray,
    ground: GroundChange,
    rows: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(r, L, N) derivatives of the forces in the joints of links `rows` by all coordinates, rates,
    accelerations.

    With composites I, B of what a link carries, f = `taken` and the ground's derivatives P by
    place, T by twist, joint k changes the wrench that a joint below it must give by

        coordinate    S_k x f + I E_k - P S_k - T D_k
        rate          2 I D_k + B S_k - T S_k
        acceleration  I S_k

    A joint i that k carries is turned along, so that the same matrices of what i carries meet E_k,
    D_k and S_k from the left, by S_i. Joints on different branches do not feel each other.
    """
    S, (D, E), L = motion.S, joints, len(motion.x)

    # Composites about W's origin: I as J, H and the mass, and B S = turning S_omega.
    momentum = dynamics.momentum(motion, motion.V)
    turning = 2.0 * np.stack([(motion.H * motion.V[1:]).sum(0), momentum[2], -momentum[1]])
    J, Hx, Hz, b0, b1, b2 = dynamics.of_carried(np.stack([motion.J, *motion.H, *turning]))
    mass = (dynamics.carries @ dynamics.mass)[:, None]

    def inertia(m: np.ndarray) -> np.ndarray:
        return inertia_times(J, np.stack([Hx, Hz]), mass, m)

    # P relative to a link that moves: its ground's wrench changes by so much less as it would by
    # being taken along.
    unit = np.broadcast_to(np.eye(3)[:, :, None, None], ground.by_place.shape)
    place = ground.by_place - _cross_force(unit, ground.wrench[:, None])
    B = np.stack([b0, b1, b2])

    # Of joint k: what a joint below it feels of its motion (right of S_i).
    below = _cross_force(S, taken) + inertia(E) - _of(place, S) - _of(ground.by_twist, D)
    below_rate = 2.0 * inertia(D) + B * S[0] - _of(ground.by_twist, S)

    # Of joint i: what its own composites make of S_i, I S_i and -S_i P, -S_i T (left of the motions
    # of a joint k).
    carried_momentum = inertia(S)
    here = S[:, rows]
    onto_place, onto_twist = (
        np.einsum("cln,cdln->dln", S, matrix) for matrix in (place, ground.by_twist)
    )
    left = np.concatenate([carried_momentum, -onto_place, -onto_twist])[:, rows]

    # Which of both carries the other; `turns` is S_i . B S_k where k carries i.
    through = dynamics.carries[rows].astype(bool)
    above = (through & (rows[:, None] != np.arange(L)))[:, :, None]
    under = dynamics.carries.T[rows].astype(bool)[:, :, None]
    turns = (here * B[:, rows]).sum(0)[:, None] * S[0]

    def chosen(
        mine: np.ndarray, theirs: np.ndarray, more: np.ndarray | float, right: np.ndarray
    ) -> np.ndarray:
        """Of a joint on a carrier of the other, from what that one feels; else from `mine`; 0 on
        different branches."""
        return np.where(
            above, _times(here, theirs), np.where(under, _times(mine, right) + more, 0.0)
        )

    by_q = chosen(left, below, 0.0, np.concatenate([E, S, D]))
    by_v = chosen(left[[0, 1, 2, 6, 7, 8]], below_rate, turns, np.concatenate([2.0 * D, S]))
    return by_q, by_v, chosen(left[:3], carried_momentum, 0.0, S)


def _add_support(
    model: SagittalModel,
    w: np.ndarray,
    u: np.ndarray,
    p: np.ndarray,
    by_load: np.ndarray,
    at: _Columns,
) -> np.ndarray:
    """Adds to (k, P, N) what joints give against the support, by complex steps and, for rates,
    damping dw/dq_i dw/dq_k; (P, N) derivatives of its energy."""
    count = len(model.support.starts)
    first = len(w) - count
    each = np.arange(count)
    turned, rates = (np.repeat(x[first:, None], count + 1, 1).astype(complex) for x in (w, u))
    positions = np.repeat((p[0] + model.shift)[None], count + 1, 0).astype(complex)
    turned[each, each] += 1j * IMAGINARY_STEP
    positions[count] += 1j * IMAGINARY_STEP
    load, energy, slope = model.support.load(turned, rates, positions)
    bent = load.imag / IMAGINARY_STEP
    stored = energy.imag / IMAGINARY_STEP
    slope = slope[:, 0].real
    rows = by_load[first:]
    rows[:, at.w + first : at.u] += bent[:, :count]
    rows[:, at.u + first : at.fulcrum] += model.support.damping * slope[:, None] * slope[None]
    rows[:, at.fulcrum] += bent[:, count]
    by = np.zeros(by_load.shape[1:])
    by[at.w + first : at.u], by[at.fulcrum] = stored[:count], stored[count]
    return by


def _add_springs(
    model: SagittalModel,
    w: np.ndarray,
    u: np.ndarray,
    p: np.ndarray,
    by_energy: np.ndarray,
    at: _Columns,
) -> np.ndarray:
    """(k, P, N) derivatives of the springs' forces; adds those of the keel's energy: complex
    steps."""
    h = IMAGINARY_STEP
    each = np.arange(len(w))
    steps = 1j * h * np.eye(3)[:, None, :, None]
    force, stored = spring_forces(
        model.springs,
        w[:, None] + steps[0],
        u[:, None] + steps[1],
        model.spring_scale(p[3] + steps[2, 0]),
    )
    by = np.zeros((len(w), *by_energy.shape))
    by[each, at.w + each], by[each, at.u + each], by[:, at.thickness] = np.moveaxis(
        force.imag / h, 1, 0
    )
    by_energy[at.w + len(SOCKET) : at.u] += stored[len(SOCKET) :, 0].imag / h
    by_energy[at.thickness] += stored[:, 2].imag.sum(0) / h
    return by


def _power_below(
    model: SagittalModel,
    motion: PlanarMotion,
    joints: tuple[np.ndarray, np.ndarray],
    wrench: np.ndarray,
    by_wrench: np.ndarray,
    at: _Columns,
) -> np.ndarray:
    """(P, N) of the ground's `wrench` (3, N) at the shank's twist; `by_wrench`: derivatives of fx,
    fz, my.

    P = F . V:  F . dV + V . dF, with dV = (S x V + D) dq + S dv of the joints that carry the shank.
    """
    V = motion.V[:, model.shank]
    S = motion.S
    carries = model.dynamics.carries[:, model.shank, None]
    by = np.zeros((1, *by_wrench.shape[1:]))
    at.fill(
        by,
        *(
            np.einsum("cn,cln->ln", wrench, m * carries)[None]
            for m in (cross(S, V[:, None]) + joints[0], S)
        ),
    )
    return np.asarray(by[0] + np.einsum("cn,cdn->dn", V[[1, 2, 0]], by_wrench))


def _cross_force(m: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Change of a wrench f that is taken along by a displacement m; (3, ...)."""
    return np.stack([m[2] * f[1] - m[1] * f[2], m[0] * f[2], -m[0] * f[1]])


def _of(matrix: np.ndarray, m: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("cdln,dln->cln", matrix, m))


def _times(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("cjn,ckn->jkn", left, right))


@dataclass(frozen=True, eq=False)
class GroundChange:
    """Of the spheres that each of L links carries; wrenches about W's origin at N instants."""

    wrench: np.ndarray  # (3, L, N), what the ground does
    by_place: np.ndarray
    """(3, 3, L, N) its derivatives by a displacement of the link that turns the velocities along,
    as a twist (turn, shifts)."""
    by_twist: np.ndarray  # (3, 3, L, N) by the link's twist
    by_heel: np.ndarray  # (3, L, N) by the heel's scale

    def __add__(self, other: GroundChange) -> GroundChange:
        return GroundChange(
            self.wrench + other.wrench,
            self.by_place + other.by_place,
            self.by_twist + other.by_twist,
            self.by_heel + other.by_heel,
        )


def ground_changes(
    spheres: Spheres,
    feet: tuple[slice, slice],
    carries: np.ndarray,
    state: State,
) -> list[GroundChange]:
    """Of each of the feet; `carries` (L, L) says which link carries which.

    Of a sphere: fz(depth, rate), fx = -mu(slip) fz, my = z fx - x fz at the lowest point (x, z), so
    that

        dfz = -fz_depth dz + fz_rate drate,   dfx = -fz mu_slip dslip - mu dfz,   dmy = z dfx + fx
                                                                                  dz - x dfz - fz dx

    A turn of the link shifts that point by (z of the centre, -x): it stays straight under the
    centre.
    """
    at = state.touch
    x = at.x
    z = at.z
    fz, by_depth, by_rate, fz_by_heel = state.pressed
    mu = state.friction
    by_slip = -fz * state.friction_slope
    wrench = state.wrench
    fx, nil, one = wrench[1], np.zeros_like(fz), np.ones_like(fz)
    centre_z = z + tall(spheres.columns["radius"], z)

    def change(dx: np.ndarray, dz: np.ndarray, drate: np.ndarray, dslip: np.ndarray) -> np.ndarray:
        dfz = -by_depth * dz + by_rate * drate
        dfx = by_slip * dslip - mu * dfz
        return np.stack([z * dfx + fx * dz - x * dfz - fz * dx, dfx, dfz])

    # By a unit turn and shifts along x, z of the link: of its place, which turns its velocity
    # along; of its twist.
    by_place = np.stack(
        [
            change(centre_z, -x, at.vx, at.vz),
            change(one, nil, nil, nil),
            change(nil, one, nil, nil),
        ],
        1,
    )
    by_twist = np.stack(
        [change(nil, nil, x, z), change(nil, nil, nil, one), change(nil, nil, -one, nil)], 1
    )
    by_heel = wrenches(at, fz_by_heel, mu)

    changes = []
    for foot in feet:  # sums over the spheres that each link carries
        onto = carries[:, spheres.link[foot]]
        changes.append(
            GroundChange(*(onto @ y[..., foot, :] for y in (wrench, by_place, by_twist, by_heel)))
        )
    return changes
