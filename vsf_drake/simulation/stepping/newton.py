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

from vsf_drake.laws.compiled import compiled, internal
from vsf_drake.simulation.stepping import assembly
from vsf_drake.simulation.stepping import tree as rb
from vsf_drake.simulation.stepping.assembly import Forces, FreePrescribed, Workspace
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


@compiled
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
    M: np.ndarray,
    C: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    load: np.ndarray,
    sites: np.ndarray,
    support: np.ndarray,
) -> tuple[int, bool]:
    """Advances q, v (n,) in place by h; returns (Newton iterations, converged).

    Height (m) of the ground, its rate, the fulcrum (m from A) and the prescribed coordinates q_next
    are those at the end. The mass matrix M (n, n) and C(q0, v0) v0 - tau_g(q0) (n,) are worked out
    here where M is (0, 0). Writes sites (S, 9) and support (3,), see `assembly`, and to load (n,)
    the forces that drive the coordinates: those that hold the prescribed ones, and in the others
    what `workspace` applies, but for the residual.
    """
    free = dofs.free
    prescribed = dofs.prescribed
    motion = workspace.motion
    contact = workspace.contact
    nf = free.shape[0]
    bias = workspace.bias
    r = workspace.r
    dv = workspace.dv
    trial = workspace.trial

    # The pose q0, frozen over the step: motions S of the joints, centres and depths d0 of the
    # spheres, and the support with its deflection w0 and the power `row` of its force on each
    # coordinate.
    rb.place(tree, q, motion)
    assembly.find_sites(h, forces, motion, ground, contact, sites)
    deflection, workspace.fulcrum[0] = 0.0, fulcrum
    if forces.fulcrum[0] > 0.0:
        workspace.keel[0], workspace.fulcrum[1], workspace.fulcrum[2], deflection = (
            assembly.find_support(forces, motion, fulcrum, contact)
        )

    # Prescribed coordinates c are known: v_c = (q_next - q0)_c / h and a_c = (v - v0)_c / h; a = 0
    # in all others.
    copy(v, workspace.v0)
    workspace.acceleration[:] = 0.0
    for k in range(prescribed.shape[0]):
        c = prescribed[k]
        v[c] = (q_next[k] - q[c]) / h
        workspace.acceleration[c] = (v[c] - workspace.v0[c]) / h

    # bias = C(q0, v0) v0 - tau_g + M a with that a, by inverse dynamics if M and C are not given,
    # and M = L L^T over
    # the free coordinates. Their equations are then   r(v) = M (v - v0) + h (bias - tau(v)) = 0.
    given = M.shape[0] > 0
    if given:
        for i in range(q.shape[0]):
            bias[i] = C[i]
            for k in range(prescribed.shape[0]):
                bias[i] += M[i, prescribed[k]] * workspace.acceleration[prescribed[k]]
        for i in range(nf):
            for k in range(nf):
                workspace.M[i, k] = M[free[i], free[k]]
    else:
        rb.inverse_dynamics(tree, workspace.v0, workspace.acceleration, motion, bias)
        rb.mass_matrix(tree, motion, free, dofs.above, dofs.counts, workspace.M)
    cholesky(workspace.M, workspace.L)

    # Newton's method from v = v0: solve A dv = -r with A = dr/dv, go to v + length dv, until r^T
    # M^-1 r, twice the kinetic energy of what is left, is small. In the first round dv is 0: it
    # works out r at v0 alone.
    dv[:, :] = 0.0
    copy(v, trial)
    _velocities(tree.links, motion.S, trial, contact.V)
    slope0 = 0.0
    converged = False
    iterations = 0
    while iterations < MAX_ITERATIONS:
        iterations += 1

        # Line search on the slope dv . r(v + length dv), which is slope0 < 0 at length 0. Still
        # steeper there: further. Uphill by more than OVERSHOOT: back to where the chord between
        # both slopes vanishes, by 0.1 to 0.9.
        length = 1.0
        for _ in range(MAX_TRIALS):
            for i in range(nf):
                trial[free[i]] = v[free[i]] + length * dv[i, 0]
            _residual(
                h, tree.links, forces, dofs, workspace, deflection, ground_rate, q, sites, support
            )
            converged = scaled_norm(workspace.L, r, workspace.y) <= workspace.tolerance
            slope = 0.0
            for i in range(nf):
                slope += dv[i, 0] * r[i]
            if slope < slope0 and length >= 1.0 and not converged:
                length *= LENGTHEN
            elif converged or slope0 >= 0.0 or slope <= OVERSHOOT * -slope0:
                break
            else:
                length *= min(max(slope0 / (slope0 - slope), 0.1), 0.9)
        copy(trial, v)
        if converged:
            break

        # The next direction: from EXACT_FROM on with the friction curve as it is if that descends,
        # dv . r < 0, else with its falling branch flat. If neither descends (slope0 >= 0) the next
        # step is taken whole.
        slope0 = 0.0
        for least_slope in (EXACT, FLAT):
            if least_slope == EXACT and iterations < EXACT_FROM:
                continue
            tangent_matrix(h, tree, forces, dofs, workspace, least_slope, sites)
            for i in range(nf):
                dv[i, 0] = -r[i]
            solve_columns(workspace.A, dv)
            slope0 = 0.0
            for i in range(nf):
                slope0 += dv[i, 0] * r[i]
            if slope0 < 0.0:
                break

    # Forces on what only prescribed coordinates move, which had no part in r; the loads that hold
    # these; then q = q0 + h v, with prescribed coordinates where they were to go without rounding.
    assembly.add_sites(h, forces, contact, ground_rate, dofs.site_rests, sites)
    _loads(h, tree, dofs, workspace, given, M, v, load)
    for c in range(q.shape[0]):
        q[c] += h * v[c]
    for k in range(prescribed.shape[0]):
        q[prescribed[k]] = q_next[k]

    # The contact point stays under the sphere's centre, which rolls ahead of the slipping point:
    # p_xy + h (v + w x c).
    for a in range(contact.near[-1]):
        s = contact.near[a]
        b = forces.site_bodies[s]
        V = contact.V
        center = contact.center
        sites[s, 7] += h * (V[b, 3] + V[b, 1] * center[s, 2] - V[b, 2] * center[s, 1])
        sites[s, 8] += h * (V[b, 4] + V[b, 2] * center[s, 0] - V[b, 0] * center[s, 2])
    return iterations, converged


@internal
def _velocities(links: np.ndarray, S: np.ndarray, v: np.ndarray, V: np.ndarray) -> None:
    """V_b = V_parent + S_c v_c of all bodies."""
    rb.put(V, 0, rb.REST)
    for m in range(links.shape[0]):
        parent = links[m, 1]
        b = links[m, 2]
        c = links[m, 3]
        rb.put(V, b, rb.six(V, parent) if c < 0 else rb.plus(rb.six(V, parent), rb.six(S, c), v[c]))


@internal
def _residual(
    h: float,
    links: np.ndarray,
    forces: Forces,
    dofs: FreePrescribed,
    workspace: Workspace,
    deflection: float,
    ground_rate: float,
    q: np.ndarray,
    sites: np.ndarray,
    support: np.ndarray,
) -> None:
    """r (f,) = M (v - v0) + h (bias - tau) at the trial velocity, over the free coordinates."""
    motion = workspace.motion
    contact = workspace.contact
    tau = workspace.tau
    trial = workspace.trial
    V = contact.V
    F = contact.F
    S = motion.S
    free = dofs.free
    moving = dofs.moving

    # End velocities of the bodies that move with it, and the ground's wrenches F on them.
    for k in range(moving.shape[0]):
        parent = links[moving[k], 1]
        b = links[moving[k], 2]
        c = links[moving[k], 3]
        rb.put(
            V, b, rb.six(V, parent) if c < 0 else rb.plus(rb.six(V, parent), rb.six(S, c), trial[c])
        )
    F[:] = 0.0
    assembly.add_sites(h, forces, contact, ground_rate, dofs.site_moves, sites)

    # tau_c = applied + springs + support + S_c . (sum of F over all that c carries)
    copy(workspace.applied, tau)
    assembly.add_springs(h, trial, q, forces, tau, workspace.springs)
    if forces.fulcrum[0] > 0.0:
        assembly.add_support(h, trial, forces, deflection, contact.support_jacobian, tau, support)
    for k in range(moving.shape[0] - 1, -1, -1):
        parent = links[moving[k], 1]
        b = links[moving[k], 2]
        c = links[moving[k], 3]
        if c >= 0 and dofs.place[c] >= 0:
            tau[c] += rb.dot(rb.six(S, c), rb.six(F, b))
        rb.add(F, parent, rb.six(F, b))

    for i in range(free.shape[0]):
        workspace.r[i] = h * (workspace.bias[free[i]] - tau[free[i]])
        for k in range(free.shape[0]):
            workspace.r[i] += workspace.M[i, k] * (trial[free[k]] - workspace.v0[free[k]])


@compiled
def tangent_matrix(
    h: float,
    tree: TreeArrays,
    forces: Forces,
    dofs: FreePrescribed,
    workspace: Workspace,
    least_slope: float,
    sites: np.ndarray,
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
    assembly.tangents(forces, contact, tree.links, dofs, least_slope, sites)
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
    if forces.fulcrum[0] > 0.0:
        gain = h * (h * forces.fulcrum[0] + forces.fulcrum[1])
        row = contact.support_jacobian
        keel = forces.keel_coordinates
        for a in range(keel.shape[0]):
            i = dofs.place[keel[a]]
            if i >= 0 and row[keel[a]] != 0.0:
                for k in range(keel.shape[0]):
                    j = dofs.place[keel[k]]
                    if j >= 0:
                        A[i, j] += gain * row[keel[a]] * row[keel[k]]


@internal
def _loads(
    h: float,
    tree: TreeArrays,
    dofs: FreePrescribed,
    workspace: Workspace,
    given: bool,
    M: np.ndarray,
    v: np.ndarray,
    load: np.ndarray,
) -> None:
    """Loads of all coordinates, and A and f of `workspace.motion` at the accelerations of the step,
    unless `given`.

    load = C v0 - tau_g + M (v - v0) / h - (tau - applied) - S_c . F: what the equations of motion
    leave to the drive.
    """
    motion = workspace.motion
    F = workspace.contact.F
    dA = workspace.dA
    S = workspace.motion.S

    # F of all that each body carries, also where nothing free moves it.
    for k in range(dofs.still.shape[0] - 1, -1, -1):
        rb.add(F, tree.links[dofs.still[k], 1], rb.six(F, tree.links[dofs.still[k], 2]))

    # Inverse dynamics so far has a = 0 in the free coordinates. Their (v - v0) / h add to it: M a
    # if M is given, else dA_b = dA_parent + S_c a_c to the accelerations and I_b dA_b, summed
    # inwards, to the forces.
    if given:
        for c in range(v.shape[0]):
            load[c] = workspace.bias[c]
            for k in range(dofs.free.shape[0]):
                load[c] += M[c, dofs.free[k]] * (v[dofs.free[k]] - workspace.v0[dofs.free[k]]) / h
    else:
        dA[:] = 0.0
        for k in range(dofs.moving.shape[0]):
            m = dofs.moving[k]
            parent = tree.links[m, 1]
            b = tree.links[m, 2]
            c = tree.links[m, 3]
            change = rb.six(dA, parent) if dofs.body_moves[parent] else rb.REST
            if c >= 0 and dofs.place[c] >= 0:
                change = rb.plus(change, rb.six(S, c), (v[c] - workspace.v0[c]) / h)
            rb.put(dA, b, change)
            rb.add(motion.A, b, change)
        for k in range(dofs.moving.shape[0]):
            b = tree.links[dofs.moving[k], 2]
            rb.put(dA, b, rb.inertia_times(motion.own, b, rb.six(dA, b)))
        for m in range(tree.links.shape[0] - 1, -1, -1):
            parent = tree.links[m, 1]
            b = tree.links[m, 2]
            c = tree.links[m, 3]
            rb.add(motion.f, b, rb.six(dA, b))
            rb.add(dA, parent, rb.six(dA, b))
            if c >= 0:
                load[c] = rb.dot(rb.six(S, c), rb.six(motion.f, b))

    # Less what the stiff forces give. The tau of free coordinates has S_c . F already; `applied` is
    # the drive's own.
    for c in range(v.shape[0]):
        load[c] -= workspace.tau[c] - workspace.applied[c]
        if dofs.place[c] < 0:
            load[c] -= rb.dot(rb.six(S, c), rb.six(F, tree.bodies[c]))


# Small dense linear algebra without calls out of compiled code: a dozen unknowns, thousands of
# times.


@compiled
def copy(source: np.ndarray, target: np.ndarray) -> None:
    """Copies a vector; the assignment of slices does the same but takes seconds to compile."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@internal
def cholesky(A: np.ndarray, L: np.ndarray) -> None:
    """Writes the lower factor L with A = L L^T of a symmetric positive definite A; what is above
    L's diagonal stays."""
    n = A.shape[0]
    for j in range(n):
        d = A[j, j]
        for k in range(j):
            d -= L[j, k] * L[j, k]
        L[j, j] = math.sqrt(d)
        for i in range(j + 1, n):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = s / L[j, j]


@internal
def scaled_norm(L: np.ndarray, r: np.ndarray, y: np.ndarray) -> float:
    """Norm sqrt(r^T A^-1 r) = |y| of r for A = L L^T, where L y = r; y (n,) is work space."""
    n = r.shape[0]
    total = 0.0
    for i in range(n):
        s = r[i]
        for k in range(i):
            s -= L[i, k] * y[k]
        y[i] = s / L[i, i]
        total += y[i] * y[i]
    return math.sqrt(total)


@internal
def solve_columns(A: np.ndarray, B: np.ndarray) -> None:
    """Overwrites B (n, m) with A^-1 B by Gaussian elimination with partial pivoting; A is
    destroyed."""
    n, m = B.shape

    # Downwards: bring the largest entry of column k to the diagonal, and clear what is under it.
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
            for j in range(m):
                B[k, j], B[pivot, j] = B[pivot, j], B[k, j]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
                for j in range(m):
                    B[i, j] -= factor * B[k, j]

    # Upwards: back substitution.
    for k in range(n - 1, -1, -1):
        for j in range(m):
            B[k, j] /= A[k, k]
        for i in range(k):
            factor = A[i, k]
            if factor != 0.0:
                for j in range(m):
                    B[i, j] -= factor * B[k, j]
