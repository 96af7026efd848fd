"""One step of the SQP: the convex quadratic program of a linearisation.

Without inequalities it is one KKT solve. Bounds and limits that the step would break join, as many
as needed, through their multipliers l: the step is then d0 + W l with W = KKT^-1 B, and 0 <= l,
slack + B'(d0 + W l) >= 0, complementary, is a small quadratic program with bounds (below: projected
Newton steps). Their multipliers are held below a given weight, which makes limits elastic: a step
always exists.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.sparse.linalg import splu

from vsf_drake.collocation.scaled import Linearised, Scaled

REFINEMENTS, POOR = 5, 1e-10
"""Most rounds of refinement, and the relative residual above which diagonal pivots have failed."""
ROUNDS = 40
AT_ONCE = 200
VIOLATED = 1e-10
MOST_DUAL = 1e6  # of the l1 penalty at which inequalities may be broken within a step


class Kkt:
    """The KKT system of a step, eliminated along the chain of instants.

        [ H + D   A' ] [ step        ]   [ a ]
        [ A      -e  ] [ multipliers ] = [ b ]    A: linear equations, then the instants' equations

    The unknowns are eliminated instant by instant (`pattern`). As H + D is positive and -e negative
    (quasi-definite, Vanderbei 1995), pivots may stay on the diagonal, and their signs are the
    matrix's inertia; iterative refinement with e = 0 makes up for what that costs in accuracy.
    Where it does not (hardly any cost or damping, equations without derivatives), rows are
    exchanged after all.

    Args:
        at: the linearisation. damping: D (N Z + P,) of the scaled variables.
    """

    def __init__(self, scaled: Scaled, at: Linearised, damping: np.ndarray) -> None:
        self.scaled = scaled
        self.at = at
        pattern = scaled.pattern
        self.size = pattern.size
        self.order = pattern.order
        self.variables = len(at.x)

        # Fixed variables keep their place, with a row of the identity: their step is what the right
        # side says, 0.
        self.free = np.where(scaled.fixed, 0.0, 1.0)
        free_z, free_p = scaled.split(self.free)
        damping_z, damping_p = scaled.split(np.where(scaled.fixed, 1.0, damping))
        own, mixed, shared = at.hessian
        own = own * free_z[:, :, None] * free_z[:, None, :]
        shared = shared * free_p[:, None] * free_p
        z = np.arange(scaled.shape[1])
        p = np.arange(scaled.parameters)
        own[:, z, z] += damping_z
        shared[p, p] += damping_p
        self.matrix, self._whole = pattern.assembled(
            (own, mixed * free_z[:, :, None] * free_p, shared),
            scaled.matrix.data * self.free[scaled.matrix.indices],
            at.by_z[:, : scaled.equations] * free_z[:, None, :],
            at.by_p[:, : scaled.equations] * free_p,
        )
        self._largest = max(1.0, np.abs(self.matrix.data).max(initial=0.0))
        self._is_exchanged = False
        try:
            self._factors = splu(self._whole, permc_spec="NATURAL", diag_pivot_thresh=0.0)
        except RuntimeError:  # a pivot is exactly zero
            self._exchange()

    def _exchange(self) -> None:
        self._factors = splu(self._whole, permc_spec="NATURAL")
        self._is_exchanged = True

    @property
    def convex(self) -> bool:
        """Whether H + D is positive where the linearised equations hold: as many pivots are
        negative as equations."""
        negative = np.count_nonzero(self._factors.U.diagonal() < 0.0)
        return not self._is_exchanged and bool(negative == self.size - self.variables)

    def roughly(self, rights: np.ndarray) -> np.ndarray:
        """(size, ...) unknowns for right sides of that shape, as the factors give them."""
        unknowns = np.empty_like(rights)
        unknowns[self.order] = self._factors.solve(rights[self.order])
        return unknowns

    def solve(self, right: np.ndarray) -> np.ndarray:
        """(size,) unknowns for a right side, refined until rounding is all that is left."""
        unknowns = self.roughly(right)
        off = right - self.matrix @ unknowns

        # Iterative refinement against the matrix with e = 0: x += (factors)^-1 (b - A x), while
        # that halves the rest.
        for _ in range(REFINEMENTS):
            better = unknowns + self.roughly(off)
            left = right - self.matrix @ better
            if not np.abs(left).max() < 0.5 * np.abs(off).max():
                break
            unknowns = better
            off = left

        # Backward error: a residual that is small beside |b| + |A| |x| is rounding.
        usual = np.abs(right).max() + self._largest * np.abs(unknowns).max()
        if self._is_exchanged or np.abs(off).max() <= POOR * usual:
            return unknowns
        self._exchange()
        return self.solve(right)


@dataclass(frozen=True, eq=False)
class Step:
    """A step, scaled, with the multipliers that belong to it."""

    change: np.ndarray  # (N Z + P,) of x
    multipliers: np.ndarray  # (L + N E,) of the equations
    active: np.ndarray  # indices of inequalities (see `Scaled.slacks`) with a multiplier
    duals: np.ndarray  # those, > 0
    pull: np.ndarray  # (N Z + P,) what the inequalities add to the gradient of the Lagrangian
    predicted: float  # decrease of the cost in the quadratic model, without damping


def slack_changes(scaled: Scaled, at: Linearised, change: np.ndarray) -> np.ndarray:
    """By how much the linearised slacks grow with a change (N Z + P,) of x."""
    z, p = scaled.split(change)
    limits = (
        np.einsum("ncz,nz->nc", at.by_z[:, scaled.equations :], z)
        + at.by_p[:, scaled.equations :] @ p
    )
    return np.concatenate([change, -change, limits.ravel(), -limits.ravel()])


def normals(scaled: Scaled, at: Linearised, which: np.ndarray) -> np.ndarray:
    """B (N Z + P, r): derivatives of the slacks of some inequalities by x."""
    n = len(at.x)
    cells = at.limited.size
    slopes = np.zeros((n, len(which)))

    # Bounds, low ones first: x - low and high - x.
    bound = np.flatnonzero(which < 2 * n)
    slopes[which[bound] % n, bound] = np.where(which[bound] < n, 1.0, -1.0)

    # Limits of an output at an instant, which depends on that instant's variables and on the
    # parameters.
    limit = np.flatnonzero(which >= 2 * n)
    side, cell = np.divmod(which[limit] - 2 * n, max(cells, 1))
    instant, output = np.divmod(cell, max(at.limited.shape[1], 1))
    sign = (1.0 - 2.0 * side)[:, None]
    rows = instant[:, None] * scaled.shape[1] + np.arange(scaled.shape[1])
    slopes[rows, limit[:, None]] = sign * at.by_z[instant, scaled.equations + output]
    slopes[scaled.count :, limit] = (sign * at.by_p[instant, scaled.equations + output]).T
    slopes[scaled.fixed] = 0.0
    return slopes


def find_step(kkt: Kkt, *, equations: np.ndarray, slacks: np.ndarray, likely: np.ndarray) -> Step:
    """The step at the linearisation of `kkt`: equations (N, E) are what it is to bring to 0,
    `slacks` those of the inequalities, there or after a first step, and `likely` the inequalities
    (indices) to begin with."""
    scaled = kkt.scaled
    at = kkt.at
    n = kkt.variables

    # d0, which no inequality holds, and the slacks that it would leave.
    right_side = np.concatenate([-at.gradient * kkt.free, -at.linear, -equations.ravel()])
    base = kkt.solve(right_side)
    still = slack_changes(scaled, at, base[:n])

    # Inequalities join until none is violated. Those of the set have slacks s + B'd0 + B'W l, s the
    # given ones, so that l solves
    #     minimise  1/2 l' (B'W) l + (s + B'd0)' l      subject to  0 <= l <= MOST_DUAL
    which = likely[np.isfinite(slacks[likely])]
    duals = np.zeros(0)
    # the last d0 + W l
    W = np.zeros((kkt.size, 0))
    B = np.zeros((n, 0))
    unknowns = base
    new = which
    after = slacks + still
    for _ in range(ROUNDS):
        if len(new):
            added = normals(scaled, at, new)
            right = np.zeros((kkt.size, len(new)))
            right[:n] = added
            # W unrefined: these may be many columns, and `_sharpened` mends what is held in the
            # end.
            W = np.hstack([W, kkt.roughly(right)])
            B = np.hstack([B, added])
            matrix = B.T @ W[:n]
            start = np.concatenate([duals, np.zeros(len(which) - len(duals))])
            duals = box_minimum(
                0.5 * (matrix + matrix.T), slacks[which] + still[which], MOST_DUAL, start
            )
            unknowns = base + W @ duals
            after = slacks + slack_changes(scaled, at, unknowns[:n])
        violated = np.setdiff1d(np.flatnonzero(np.isfinite(slacks) & (after < -VIOLATED)), which)
        if not len(violated):
            break
        # The set only grows: what need not press is given the duals 0.
        new = violated[np.argsort(after[violated])[:AT_ONCE]]
        which = np.concatenate([which, new])
    held = duals > 0.0
    if held.any():
        unknowns, duals = _sharpened(kkt, right_side, B, W, duals, slacks[which])

    # What the model promises: -(g'd + 1/2 d'H d), by blocks.
    change = unknowns[:n]
    own, mixed, shared = at.hessian
    z, p = scaled.split(change)
    curved = (
        np.einsum("nz,nzy,ny->", z, own, z, optimize=True)
        + 2.0 * np.einsum("nz,nzp,p->", z, mixed, p)
        + p @ shared @ p
    )
    return Step(
        change=change,
        multipliers=unknowns[n:],
        active=which[held],
        duals=duals[held],
        pull=-B[:, held] @ duals[held],
        predicted=float(-at.gradient @ change - 0.5 * curved),
    )


def _sharpened(
    kkt: Kkt,
    right_side: np.ndarray,
    B: np.ndarray,
    W: np.ndarray,
    duals: np.ndarray,
    slacks: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The unknowns with the refined solve, and duals with which what presses is held to
    rounding."""
    n = len(B)
    tight = (duals > 0.0) & (duals < MOST_DUAL)
    matrix = B[:, tight].T @ W[:n, tight]
    for last in (False, True):
        right = right_side.copy()
        right[:n] += B @ duals
        unknowns = kkt.solve(right)
        off = (slacks + B.T @ unknowns[:n])[tight]
        if last or np.abs(off).max(initial=0.0) <= VIOLATED:
            break
        # Slacks that are left grow by (B'W) dl: one Newton step brings them to 0, unless a duals
        # would turn.
        better = duals[tight] - np.linalg.lstsq(matrix, off, rcond=1e-12)[0]
        if not (better > 0.0).all():
            break
        duals = duals.copy()
        duals[tight] = better
    return unknowns, duals


def optimality(scaled: Scaled, at: Linearised, step: Step) -> float:
    """First-order residual with a step's multipliers, relative to 1 + the largest of them: the
    largest of |gradient of the Lagrangian|, |multiplier * slack| over the inequalities that
    press."""
    lines = len(at.linear)
    of_instants = step.multipliers[lines:].reshape(at.equations.shape)

    # g + A'm - B l
    slope = at.gradient + step.pull
    slope[: scaled.count] += scaled.matrix.T @ step.multipliers[:lines]
    slope[: scaled.count] += np.einsum(
        "nez,ne->nz", at.by_z[:, : scaled.equations], of_instants
    ).ravel()
    slope[scaled.count :] += np.einsum("nep,ne->p", at.by_p[:, : scaled.equations], of_instants)
    slope[scaled.fixed] = 0.0
    apart = step.duals * scaled.slacks(at)[step.active]
    largest = max(np.abs(step.multipliers).max(initial=0.0), step.duals.max(initial=0.0))
    return float(
        max(np.abs(slope).max(initial=0.0), np.abs(apart).max(initial=0.0)) / (1.0 + largest)
    )


BOX_ROUNDS = 200
HALVINGS = 30


def box_minimum(
    matrix: np.ndarray, linear: np.ndarray, high: float, start: np.ndarray
) -> np.ndarray:
    """x (n,) from `start` on that minimises 1/2 x' matrix x + linear' x with 0 <= x <= high, the
    matrix symmetric and positive semidefinite: projected Newton steps (Bertsekas 1982)."""
    if not len(start):
        return start

    # In units in which the matrix has a diagonal of ones.
    unit = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * unit * unit[:, None]
    pull = linear * unit
    top = high / unit
    x: np.ndarray = np.clip(start, 0.0, high) / unit
    tolerance = 1e-13 * max(np.abs(pull).max(), 1e-300)
    for _ in range(BOX_ROUNDS):
        # Held is what lies on a bound and is pushed onto it; Newton's step is for the others alone.
        slope = scaled @ x + pull
        held = ((x <= 0.0) & (slope >= 0.0)) | ((x >= top) & (slope <= 0.0))
        free = ~held
        if not free.any() or np.abs(slope[free]).max() <= tolerance:
            break
        step = np.zeros_like(x)
        step[free] = -_solved(scaled[np.ix_(free, free)], slope[free])

        # Its projection onto the box is shortened until the cost falls by a part of what its slope
        # promises (Armijo).
        length = 1.0
        for _ in range(HALVINGS):
            moved = np.clip(x + length * step, 0.0, top) - x
            if slope @ moved + 0.5 * moved @ scaled @ moved <= 1e-4 * min(slope @ moved, 0.0):
                break
            length *= 0.5
        else:
            break
        x = x + moved
        if np.abs(moved).max() <= 1e-15 * max(np.abs(x).max(), 1e-300):
            break
    return x * unit


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    for soft in (1e-14, 1e-12, 1e-10, 1e-8):
        try:
            return np.asarray(cho_solve(cho_factor(matrix + soft * np.eye(len(matrix))), right))
        except LinAlgError:
            continue
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=1e-8)[0])
