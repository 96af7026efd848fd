"""One implicit step of a tree of joints under stiff forces, compiled.

With h the step and everything that depends on the pose frozen at its beginning, the end velocity v
solves

    M (v - v0) = h ( -C(q0, v0) v0 + tau_g(q0) + tau_applied + sum J^T f(v) ),        q = q0 + h v

where every stiff force is written at the end of the step: contact depth d0 - h v_z and depth rate
-v_z, coordinate springs at q0 + h v, the fulcrum's deflection w0 + h w', a moving ground's height
at t + h. Rows of prescribed coordinates are known; their equations give the loads that hold them.
The others are solved by Newton's method. But for the dependence of friction on the normal force the
residual r is the gradient of a potential, which is convex except where the friction curve falls;
the norm of r is not a merit there, since a foot that begins to slide has to pass a hump of it. So
the tangent takes friction's falling branch as flat, for which every step dv descends (dv . r < 0).
The line search shortens a step where dv . r has changed sign by more than OVERSHOOT and lengthens
it where the slope has become steeper. From iteration EXACT_FROM on the falling branch enters the
tangent too, wherever the step still descends, because a flattened one converges linearly only.
"""

from __future__ import annotations

import math

import numpy as np

from vsf_drake.laws.compiled import internal, part
from vsf_drake.laws.lanes import every, negated, select, some
from vsf_drake.simulation.stepping import assembly
from vsf_drake.simulation.stepping import tree as rb
from vsf_drake.simulation.stepping.assembly import (
    Forces,
    FreePrescribed,
    Workspace,
    find_sites,
    find_support,
)
from vsf_drake.simulation.stepping.tree import TreeArrays

MAX_ITERATIONS = 30
MAX_TRIALS = 12  # lengths of one Newton step that are tried
# uphill slope after a step, relative to the downhill one before it, that is accepted
OVERSHOOT = 0.5
EXACT_FROM = 4  # iteration from which the falling branch of the friction curve is in the tangent
# least slope of the friction curve in a tangent: any, or none that falls
EXACT = -math.inf
FLAT = 0.0
LENGTHEN = 4.0  # of a step along which the slope becomes steeper


@part
def step(
    h: float,
    tree: TreeArrays,
    forces: Forces,
    dofs: FreePrescribed,
    workspace: Workspace,
    ground: float,
    ground_rate: float,
    fulcrum: float,
    q_next: np.ndarray,
    active: bool,
    ready: bool,
    q: np.ndarray,
    v: np.ndarray,
    load: np.ndarray,
    sites: np.ndarray,
    wrench: np.ndarray,
    support: np.ndarray,
) -> tuple[float, bool]:
    """Advances q, v (n,) in place by h; returns (Newton iterations, converged).

    Height (m) of the ground, its rate, the fulcrum (m from A) and the prescribed coordinates q_next
    are those at the end. Poses and velocities of `dofs.base` and the bias of the coordinates that
    are `dofs.still` are in `workspace` already where it is `ready`. Only a walk that is `active`
    goes on; nothing of another is written. Writes sites (S, 9), wrench (feet, 7) and support (3,),
    see `assembly`, and to load (n,) the forces that drive the coordinates: those that hold the
    prescribed ones, and in the others what `workspace` applies, but for the residual.
    """
    prescribed = dofs.prescribed
    motion = workspace.motion
    contact = workspace.contact
    acceleration = workspace.acceleration
    bias = workspace.bias

    # Prescribed coordinates c are known: v_c = (q_next - q0)_c / h and a_c = (v - v0)_c / h; a = 0
    # in all others.
    copy(v, workspace.v0)
    copy(v, workspace.v)
    for c in range(v.shape[0]):
        acceleration[c] = 0.0
    for k in range(prescribed.shape[0]):
        c = prescribed[k]
        workspace.v[c] = (q_next[k] - q[c]) / h
        acceleration[c] = (workspace.v[c] - workspace.v0[c]) / h

    # The pose q0, frozen over the step: motions S of the joints, centres and depths d0 of the
    # spheres, and the support with its deflection w0 and the power `row` of its force on each
    # coordinate. bias = C(q0, v0) v0 - tau_g + M a with that a, by inverse dynamics, and M = L L^T
    # over the free coordinates. Their equations are then
    # r(v) = M (v - v0) + h (bias - tau(v)) = 0.
    if not ready:
        rb.stop_world(tree, motion)
        rb.place(tree, dofs.still, q, motion)
        rb.outwards(tree, dofs.still, workspace.v0, acceleration, motion)
        velocities(tree.links, dofs.still, motion.S, workspace.v, contact.V)
    rb.place(tree, dofs.moving, q, motion)
    rb.outwards(tree, dofs.moving, workspace.v0, acceleration, motion)
    rb.inwards(tree, dofs.moving, motion, bias)
    if ready:
        for c in range(v.shape[0]):
            for k in range(dofs.base.shape[0]):
                if dofs.carried[c, k]:
                    bias[c] += rb.dot(rb.six(motion.S, c), rb.six(motion.f, dofs.base[k]))
    else:
        rb.inwards(tree, dofs.still, motion, bias)
    rb.mass_matrix(tree, motion, dofs.free, dofs.above, dofs.counts, workspace.M)
    cholesky(workspace.M, workspace.L)
    find_sites(h, forces, motion, ground, contact)
    deflection = 0.0 * fulcrum
    if some(forces.fulcrum[0] > 0.0):
        deflection = find_support(forces, motion, fulcrum, contact, workspace.fulcrum)
    copy(workspace.v, workspace.trial)
    iterations, converged = _newton(
        h, tree, forces, dofs, workspace, deflection, ground_rate, q, active
    )

    # Forces on what only prescribed coordinates move, which had no part in r; the loads that hold
    # these; then q = q0 + h v, with prescribed coordinates where they were to go without rounding.
    assembly.add_sites(h, forces, contact, ground_rate, dofs.site_rests)
    _loads(h, tree, dofs, workspace, active, load)
    assembly.record_sites(h, forces, contact, ground_rate, active, sites, wrench)
    for i in range(3):
        support[i] = select(active, workspace.support[i], support[i])
    for c in range(q.shape[0]):
        v[c] = select(active, workspace.v[c], v[c])
        q[c] = select(active, q[c] + h * v[c], q[c])
    for k in range(prescribed.shape[0]):
        q[prescribed[k]] = select(active, q_next[k], q[prescribed[k]])
    return iterations, converged


@internal
def _newton(
    h: float,
    tree: TreeArrays,
    forces: Forces,
    dofs: FreePrescribed,
    workspace: Workspace,
    deflection: float,
    ground_rate: float,
    q: np.ndarray,
    active: bool,
) -> tuple[float, bool]:
    """Newton's method from `workspace.v`, to which it writes; returns (iterations, converged).

    Solves A dv = -r with A = dr/dv, goes to v + length dv, until r^T M^-1 r, twice the kinetic
    energy of what is left, is small. In the first round dv is 0: it works out r at the start alone.
    A walk that has `stopped`, since it has converged, is not active or is no longer finite, stays
    where it is while others go on. What is no longer finite ends as NaN.
    """
    free = dofs.free
    nf = free.shape[0]
    v = workspace.v
    trial = workspace.trial
    r = workspace.r
    dv = workspace.dv
    for i in range(nf):
        dv[i, 0] = 0.0
    slope0 = 0.0 * h
    count = 0.0 * h
    converged = h < 0.0
    lost = converged
    stopped = negated(active)
    most = workspace.tolerance * workspace.tolerance
    for iteration in range(1, MAX_ITERATIONS + 1):
        count = select(stopped, count, count + 1.0)

        # Line search on the slope dv . r(v + length dv), which is slope0 < 0 at length 0. Still
        # steeper there: further. Uphill by more than OVERSHOOT: back to where the chord between
        # both slopes vanishes, by 0.1 to 0.9.
        length = 0.0 * h + 1.0
        done = stopped
        for _ in range(MAX_TRIALS):
            for i in range(nf):
                trial[free[i]] = v[free[i]] + length * dv[i, 0]
            _residual(h, tree.links, forces, dofs, workspace, deflection, ground_rate, q)
            size = _energy(workspace.L, r, workspace.y)
            converged = size <= most
            lost = negated(size < math.inf)
            stopped = converged | lost | negated(active)
            slope = 0.0 * h
            for i in range(nf):
                slope += dv[i, 0] * r[i]
            longer = (slope < slope0) & (length >= 1.0) & negated(stopped)
            flat = (slope0 >= 0.0) | (slope <= OVERSHOOT * -slope0)
            done = done | (negated(longer) & (stopped | flat))
            if every(done):
                break
            chord = slope0 / (slope0 - slope)
            chord = select(chord > 0.1, chord, 0.1)
            chord = select(chord < 0.9, chord, 0.9)
            length = select(done, length, select(longer, LENGTHEN * length, length * chord))
        for i in range(nf):
            v[free[i]] = trial[free[i]]
        if every(stopped):
            break

        # The next direction: from EXACT_FROM on with the friction curve as it is if that descends,
        # dv . r < 0, else with its falling branch flat. If neither descends (slope0 >= 0) the next
        # step is taken whole.
        exact = iteration >= EXACT_FROM
        slope0 = _direction(h, tree, forces, dofs, workspace, EXACT if exact else FLAT, stopped)
        climbs = (slope0 >= 0.0) & negated(stopped)
        if exact and some(climbs):
            for i in range(nf):
                workspace.kept[i] = dv[i, 0]
            flat_slope = _direction(h, tree, forces, dofs, workspace, FLAT, stopped)
            slope0 = select(climbs, flat_slope, slope0)
            for i in range(nf):
                dv[i, 0] = select(climbs, dv[i, 0], workspace.kept[i])
    for i in range(nf):
        v[free[i]] = select(lost, math.nan, v[free[i]])
    return count, converged


@internal
def _direction(
    h: float,
    tree: TreeArrays,
    forces: Forces,
    dofs: FreePrescribed,
    workspace: Workspace,
    least_slope: float,
    stopped: bool,
) -> float:
    """Writes dv = -A^-1 r, 0 of a walk that has `stopped`; returns dv . r."""
    dv = workspace.dv
    r = workspace.r
    tangent_matrix(h, tree, forces, dofs, workspace, least_slope)
    for i in range(r.shape[0]):
        dv[i, 0] = select(stopped, 0.0, -r[i])
    solve_columns(workspace.A, dv)
    slope = 0.0 * h
    for i in range(r.shape[0]):
        dv[i, 0] = select(stopped, 0.0, dv[i, 0])
        slope += dv[i, 0] * r[i]
    descent: float = select(stopped, 0.0, slope)
    return descent


@internal
def velocities(
    links: np.ndarray, rows: np.ndarray, S: np.ndarray, v: np.ndarray, V: np.ndarray
) -> None:
    """V_b = V_parent + S_c v_c of the bodies of the links `rows`; the world is at rest."""
    for k in range(rows.shape[0]):
        parent = links[rows[k], 1]
        b = links[rows[k], 2]
        c = links[rows[k], 3]
        if c < 0:
            rb.put(V, b, rb.six(V, parent))
        else:
            rb.put(V, b, rb.plus(rb.six(V, parent), rb.six(S, c), v[c]))


@part
def _residual(
    h: float,
    links: np.ndarray,
    forces: Forces,
    dofs: FreePrescribed,
    workspace: Workspace,
    deflection: float,
    ground_rate: float,
    q: np.ndarray,
) -> None:
    """r (f,) = M (v - v0) + h (bias - tau) at the trial velocity, over the free coordinates."""
    contact = workspace.contact
    tau = workspace.tau
    trial = workspace.trial
    F = contact.F
    S = workspace.motion.S
    free = dofs.free
    moving = dofs.moving

    # End velocities of the bodies that move with it, and the ground's wrenches F on them.
    velocities(links, moving, S, trial, contact.V)
    for k in range(dofs.base.shape[0]):
        rb.put(F, dofs.base[k], rb.REST)
    for k in range(moving.shape[0]):
        rb.put(F, links[moving[k], 2], rb.REST)
    assembly.add_sites(h, forces, contact, ground_rate, dofs.site_moves)

    # tau_c = applied + springs + support + S_c . (sum of F over all that c carries)
    copy(workspace.applied, tau)
    assembly.add_springs(h, trial, q, forces, tau, workspace.springs)
    if some(forces.fulcrum[0] > 0.0):
        assembly.add_support(
            h, trial, forces, deflection, contact.support_jacobian, tau, workspace.support
        )
    for k in range(moving.shape[0] - 1, -1, -1):
        parent = links[moving[k], 1]
        b = links[moving[k], 2]
        c = links[moving[k], 3]
        if c >= 0 and dofs.place[c] >= 0:
            tau[c] += rb.dot(rb.six(S, c), rb.six(F, b))
        rb.add(F, parent, rb.six(F, b))

    change = workspace.y
    for i in range(free.shape[0]):
        change[i] = trial[free[i]] - workspace.v0[free[i]]
    for i in range(free.shape[0]):
        left = h * (workspace.bias[free[i]] - tau[free[i]])
        for k in range(free.shape[0]):
            left += workspace.M[i, k] * change[k]
        workspace.r[i] = left


@part
def tangent_matrix(
    h: float,
    tree: TreeArrays,
    forces: Forces,
    dofs: FreePrescribed,
    workspace: Workspace,
    least_slope: float,
) -> None:
    """Writes A (f, f) = dr/dv at the last residual; a friction curve that falls more counts as
    `least_slope` (s/m).

    A = M - h dtau/dv: to M contact adds h S_i . K S_j, a spring h (h k + d) on the diagonal, and
    the support h (h k + d) row row^T. A is not symmetric, as friction depends on the normal force.
    """
    contact = workspace.contact
    S = workspace.motion.S
    A = workspace.A
    free = dofs.free
    assembly.tangents(forces, contact, tree.links, dofs, least_slope)
    for i in range(free.shape[0]):
        copy(workspace.M[i], A[i])

    # Of two joints of which j carries i (or is it) both move all that i carries: K is that of i's
    # body.
    for i in range(free.shape[0]):
        c = free[i]
        b = tree.bodies[c]
        if contact.loaded[b]:
            right = rb.times(contact.K, b, rb.six(S, c))
            left = rb.transposed_times(contact.K, b, rb.six(S, c))
            for k in range(dofs.counts[i]):
                j = dofs.above[i, k]
                A[j, i] += h * rb.dot(rb.six(S, free[j]), right)
                if j != i:
                    A[i, j] += h * rb.dot(rb.six(S, free[j]), left)

    for k in range(forces.spring_index.shape[0]):
        i = dofs.place[forces.spring_index[k]]
        if i >= 0:
            A[i, i] += h * workspace.springs[k]
    if some(forces.fulcrum[0] > 0.0):
        gain = h * (h * forces.fulcrum[0] + forces.fulcrum[1])
        row = contact.support_jacobian
        keel = forces.keel_coordinates
        for a in range(keel.shape[0]):
            i = dofs.place[keel[a]]
            if i >= 0:
                power = gain * row[keel[a]]
                for k in range(keel.shape[0]):
                    j = dofs.place[keel[k]]
                    if j >= 0:
                        A[i, j] += power * row[keel[k]]


@internal
def _loads(
    h: float,
    tree: TreeArrays,
    dofs: FreePrescribed,
    workspace: Workspace,
    active: bool,
    load: np.ndarray,
) -> None:
    """Loads of all coordinates, and A and f of the moving bodies of `workspace.motion` at the
    accelerations of the step.

    load = C v0 - tau_g + M (v - v0) / h - (tau - applied) - S_c . F: what the equations of motion
    leave to the drive.
    """
    motion = workspace.motion
    links = tree.links
    F = workspace.contact.F
    dA = workspace.dA
    S = motion.S
    v = workspace.v

    # Inverse dynamics so far has a = 0 in the free coordinates. Their (v - v0) / h add to it:
    # dA_b = dA_parent + S_c a_c to the accelerations and I_b dA_b, summed inwards, to the forces.
    # What is summed has F less.
    for k in range(dofs.base.shape[0]):
        rb.put(dA, dofs.base[k], rb.REST)
    for k in range(dofs.moving.shape[0]):
        m = dofs.moving[k]
        b = links[m, 2]
        c = links[m, 3]
        change = rb.six(dA, links[m, 1])
        if c >= 0 and dofs.place[c] >= 0:
            change = rb.plus(change, rb.six(S, c), (v[c] - workspace.v0[c]) / h)
        rb.put(dA, b, change)
        rb.add(motion.A, b, change)
    for k in range(dofs.moving.shape[0]):
        b = links[dofs.moving[k], 2]
        rb.put(dA, b, rb.inertia_times(motion.own, b, rb.six(dA, b)))
    for k in range(dofs.moving.shape[0] - 1, -1, -1):
        parent = links[dofs.moving[k], 1]
        b = links[dofs.moving[k], 2]
        c = links[dofs.moving[k], 3]
        rb.add(motion.f, b, rb.six(dA, b))
        rb.add(dA, parent, rb.six(dA, b))
        if c >= 0:
            own = rb.dot(rb.six(S, c), rb.six(motion.f, b))
            own -= workspace.tau[c] - workspace.applied[c]
            # the tau of free coordinates has S_c . F already; `applied` is the drive's own
            if dofs.place[c] < 0:
                own -= rb.dot(rb.six(S, c), rb.six(F, b))
            load[c] = select(active, own, load[c])
    for k in range(dofs.base.shape[0]):
        b = dofs.base[k]
        rb.put(dA, b, rb.plus(rb.six(dA, b), rb.six(F, b), -1.0))
    for c in range(v.shape[0]):
        if dofs.place[c] < 0 and not dofs.body_moves[tree.bodies[c]]:
            own = workspace.bias[c] - (workspace.tau[c] - workspace.applied[c])
            for k in range(dofs.base.shape[0]):
                if dofs.carried[c, k]:
                    own += rb.dot(rb.six(S, c), rb.six(dA, dofs.base[k]))
            load[c] = select(active, own, load[c])


# Small dense linear algebra without calls out of compiled code: a dozen unknowns, thousands of
# times.


@internal
def copy(source: np.ndarray, target: np.ndarray) -> None:
    """Copies a vector; the assignment of slices does the same but takes seconds to compile."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@internal
def clear(target: np.ndarray) -> None:
    """Makes a vector 0."""
    for i in range(target.shape[0]):
        target[i] = 0.0


@part
def cholesky(A: np.ndarray, L: np.ndarray) -> None:
    """Writes the lower factor L with A = L L^T of a symmetric positive definite A, with 1 / L_jj on
    its diagonal; what is above that stays."""
    n = A.shape[0]
    for j in range(n):
        d = A[j, j]
        for k in range(j):
            d -= L[j, k] * L[j, k]
        inverse = 1.0 / math.sqrt(d)
        L[j, j] = inverse
        for i in range(j + 1, n):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = s * inverse


@internal
def _energy(L: np.ndarray, r: np.ndarray, y: np.ndarray) -> float:
    """r^T A^-1 r = |y|^2 of r with L of `cholesky`, where L y = r; y (n,) is work space."""
    total = 0.0
    for i in range(r.shape[0]):
        s = r[i]
        for k in range(i):
            s -= L[i, k] * y[k]
        y[i] = s * L[i, i]
        total += y[i] * y[i]
    return total


@part
def solve_columns(A: np.ndarray, B: np.ndarray) -> None:
    """Overwrites B (n, m) with A^-1 B by Gaussian elimination with partial pivoting; A is
    destroyed."""
    n = B.shape[0]
    m = B.shape[1]  # of lanes in Python it has another axis

    # Downwards: bring the largest entry of column k to the diagonal, by exchanging rows of the
    # walks in which one is larger, and clear what is under it.
    for k in range(n):
        for i in range(k + 1, n):
            larger = math.fabs(A[i, k]) > math.fabs(A[k, k])
            if some(larger):
                for j in range(k, n):
                    above = A[k, j]
                    A[k, j] = select(larger, A[i, j], above)
                    A[i, j] = select(larger, above, A[i, j])
                for j in range(m):
                    above = select(larger, B[i, j], B[k, j])
                    B[i, j] = select(larger, B[k, j], B[i, j])
                    B[k, j] = above
        inverse = 1.0 / A[k, k]
        for i in range(k + 1, n):
            factor = A[i, k] * inverse
            for j in range(k + 1, n):
                A[i, j] -= factor * A[k, j]
            for j in range(m):
                B[i, j] -= factor * B[k, j]
        A[k, k] = inverse

    # Upwards: back substitution.
    for k in range(n - 1, -1, -1):
        for j in range(m):
            B[k, j] *= A[k, k]
        for i in range(k):
            factor = A[i, k]
            for j in range(m):
                B[i, j] -= factor * B[k, j]
