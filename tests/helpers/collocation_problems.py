"""Small trajectory problems whose optimum is known in closed form, and a synthetic one of a gait
problem's size."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm
from scipy.special import j1

from vsf_drake.collocation.problem import Design, Grid, Layout, Limits, Residuals, TrajectoryProblem
from vsf_drake.collocation.solution import Start


class Outputs:
    """An instant's function from one that returns y, dy/dz, dy/dp."""

    def __init__(self, function):
        self.linearise = function

    def evaluate(self, z, p):
        return self.linearise(z, p)[0]


def constant_outputs(rows):
    """y = rows z, no parameters."""
    rows = np.asarray(rows, dtype=float)
    return Outputs(
        lambda z, p: (
            z @ rows.T,
            np.tile(rows, (len(z), 1, 1)),
            np.zeros((len(z), len(rows), len(p))),
        )
    )


def ends(grid, first=(), last=()):
    """Bounds of z = [x, v, a] that fix (column, value) at the two ends."""
    low, high = np.full((grid.instants, 3), -np.inf), np.full((grid.instants, 3), np.inf)
    for row, fixed in ((0, first), (-1, last)):
        for column, value in fixed:
            low[row, column] = high[row, column] = value
    return low, high


def regulator(method, intervals, duration_s=3.0):
    """min 1/2 int x^2 + a^2 from x = 1 at rest, free end; exact x(t) and cost by the Hamiltonian's
    exponential."""
    grid = Grid(method, intervals, duration_s, periodic=False)
    low, high = ends(grid, first=((0, 1.0), (1, 0.0)))
    problem = TrajectoryProblem(
        constant_outputs([[1, 0, 0], [0, 0, 1]]),
        Layout(("x",)),
        grid,
        outputs=2,
        residuals=[Residuals(outputs=[0, 1])],
        low=low,
        high=high,
    )
    plant, force = np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([0.0, 1.0])
    flow = np.block([[plant, -force], [-np.diag([1.0, 0.0]), -plant.T]])
    whole, begin = expm(flow * duration_s), np.array([1.0, 0.0])
    costate = -np.linalg.solve(whole[2:, 2:], whole[2:, :2] @ begin)
    exact = np.array([(expm(flow * t) @ [*begin, *costate])[0] for t in grid.times_s])
    return problem, exact, 0.5 * costate[0]


def oscillator(method, intervals, duration_s=3.0):
    """x'' + x = 0 from x = 1 at rest: nothing to optimise, x(t) = cos t."""
    grid = Grid(method, intervals, duration_s, periodic=False)
    low, high = ends(grid, first=((0, 1.0), (1, 0.0)))
    problem = TrajectoryProblem(
        constant_outputs([[1, 0, 1]]),
        Layout(("x",)),
        grid,
        outputs=1,
        equations=[0],
        low=low,
        high=high,
    )
    return problem, np.cos(grid.times_s)


def rest_to_rest(most, *, as_limit, intervals=60):
    """min 1/2 int a^2 from 0 to 1 at rest within 1 s, |a| <= most; and the exact cost for 4 <= most
    <= 6.

    By Pontryagin a is linear in time where it is not on a bound: a = -most tau / s for |tau| <= s
    about mid-time. Its moment about mid-time, the way, is most (1/4 - s^2/3) = 1, and the cost is
    most^2 (1/2 - 2 s/3).
    """
    grid = Grid("hermite_simpson", intervals, 1.0, periodic=False)
    low, high = ends(grid, first=((0, 0.0), (1, 0.0)), last=((0, 1.0), (1, 0.0)))
    limits = [Limits(outputs=[0], low=-most, high=most)] if as_limit else []
    if not as_limit:
        low[:, 2], high[:, 2] = -most, most
    problem = TrajectoryProblem(
        constant_outputs([[0, 0, 1]]),
        Layout(("x",)),
        grid,
        outputs=1,
        limits=limits,
        y_scale=3.0,
        residuals=[Residuals(outputs=[0])],
        low=low,
        high=high,
    )
    s = np.sqrt(max(3.0 * (0.25 - 1.0 / most), 0.0))
    return problem, most**2 * (0.5 - 2.0 * s / 3.0)


def spring_mass(*, high=200.0, intervals=20, mass=2.0, damper=0.5, rate=5.0, amplitude=0.1):
    """A driven mass on a spring that is to move as A cos(w t) at the least squared force; optimal
    k = m w^2."""
    grid = Grid("hermite_simpson", intervals, 2.0 * np.pi / rate, periodic=True)

    def outputs(z, p):
        force = mass * z[:, 2] + damper * z[:, 1] + p[0] * z[:, 0]
        by_z, by_p = np.zeros((len(z), 2, 3)), np.zeros((len(z), 2, 1))
        by_z[:, 0], by_z[:, 1, 0], by_p[:, 0, 0] = [p[0], damper, mass], 1.0, z[:, 0]
        return np.stack([force, z[:, 0]], axis=1), by_z, by_p

    motion = amplitude * np.cos(rate * grid.times_s)
    problem = TrajectoryProblem(
        Outputs(outputs),
        Layout(("x",)),
        grid,
        outputs=2,
        z_scale=[0.1, 0.5, 2.5],
        residuals=[
            Residuals(outputs=[0], name="force"),
            Residuals(outputs=[1], target=motion[:, None], weight=1e7, name="motion"),
        ],
        design=Design(names=["stiffness"], low=1.0, high=high),
    )
    return problem, Start(np.zeros((grid.instants, 3)), np.array([10.0])), mass * rate**2


def pendulum(*, intervals=30, mass=1.5, length=0.8, rate=6.0, amplitude=1.2):
    """A pendulum with a torsion spring that is to swing as A cos(w t) at the least squared torque.

    torque = m l^2 theta'' + m g l sin(theta) + k theta is least for k = m l^2 w^2 - 2 m g l J1(A) /
    A, its projection on theta (the mean of sin(A cos) cos over a turn is J1(A)).
    """
    grid = Grid("hermite_simpson", intervals, 2.0 * np.pi / rate, periodic=True)
    inertia, weight = mass * length**2, mass * 9.81 * length

    def outputs(z, p):
        q, a = z[:, 0], z[:, 2]
        by_z, by_p = np.zeros((len(z), 3, 4)), np.zeros((len(z), 3, 1))
        by_z[:, 0, 0], by_z[:, 0, 2], by_z[:, 0, 3] = weight * np.cos(q) + p[0], inertia, -1.0
        by_z[:, 1, 0], by_z[:, 2, 3], by_p[:, 0, 0] = 1.0, 1.0, q
        return (
            np.stack([inertia * a + weight * np.sin(q) + p[0] * q - z[:, 3], q, z[:, 3]], axis=1),
            by_z,
            by_p,
        )

    motion = amplitude * np.cos(rate * grid.times_s)
    problem = TrajectoryProblem(
        Outputs(outputs),
        Layout(("angle",), (), ("torque",)),
        grid,
        outputs=3,
        equations=[0],
        residuals=[
            Residuals(outputs=[1], target=motion[:, None], weight=1e7, name="motion"),
            Residuals(outputs=[2], name="torque"),
        ],
        design=Design(names=["stiffness"], low=0.0, high=100.0),
        z_scale=[1.0, 5.0, 40.0, 20.0],
        y_scale=[20.0, 1.0, 1.0],
        cost_scale=100.0,
    )
    return (
        problem,
        Start(np.zeros((grid.instants, 4)), np.array([5.0])),
        (inertia * rate**2 - 2.0 * weight * j1(amplitude) / amplitude),
    )


def chain(method="hermite_simpson", intervals=40, *, most=2.0, n=8, k=11, parameters=5):
    """A synthetic nonlinear problem of a gait problem's size: n coordinates, k quasi-static
    variables, 5 parameters.

    k statics and 3 rootless equations of motion are 0, the other n - 3 torques are limited and
    squared, q is tracked.
    """
    grid, draw = Grid(method, intervals, 1.2, periodic=True), np.random.default_rng(0)
    inertia = np.eye(n) + 0.1 * draw.standard_normal((n, n))
    inertia = inertia @ inertia.T
    pull, push = 0.3 * draw.standard_normal((k, n)), 0.5 * draw.standard_normal((n, k))
    spring, soft = (
        np.diag(draw.uniform(2.0, 5.0, k)) + 0.1,
        0.3 * draw.standard_normal((k, parameters)),
    )
    layout = Layout(tuple(f"q{i}" for i in range(n)), tuple(f"w{i}" for i in range(k)))
    outputs, some = k + 2 * n, np.arange

    def function(z, p):
        q, v, a, w, u = (z[:, part] for part in (layout.q, layout.v, layout.a, layout.w, layout.u))
        gain, bare = np.tanh(soft @ p), w @ spring
        by_z, by_p = (
            np.zeros((len(z), outputs, layout.size)),
            np.zeros((len(z), outputs, parameters)),
        )
        statics = (1.0 + 0.3 * gain) * bare + w**3 + 0.05 * u - (np.sin(q) + 0.2 * v) @ pull.T
        by_z[:, :k, layout.q], by_z[:, :k, layout.v] = -pull * np.cos(q)[:, None, :], -0.2 * pull
        by_z[:, :k, layout.w] = (1.0 + 0.3 * gain)[:, None] * spring.T
        by_z[:, some(k), layout.w.start + some(k)] += 3.0 * w**2
        by_z[:, some(k), layout.u.start + some(k)] = 0.05
        by_p[:, :k] = 0.3 * bare[:, :, None] * (1.0 - gain**2)[:, None] * soft
        mass = 1.0 + 0.2 * np.cos(q)
        motion = (a * mass) @ inertia.T + 3.0 * np.sin(q) - w @ push.T
        by_z[:, k : k + n, layout.a] = inertia * mass[:, None, :]
        by_z[:, k : k + n, layout.q] = inertia * (-0.2 * np.sin(q) * a)[:, None, :]
        by_z[:, k + some(n), some(n)] += 3.0 * np.cos(q)
        by_z[:, k : k + n, layout.w] = -push
        by_z[:, k + n + some(n), some(n)] = 1.0
        return np.concatenate([statics, motion, q], axis=1), by_z, by_p

    draw, times = np.random.default_rng(1), grid.times_s
    aim = sum(
        0.3
        / j**2
        * draw.standard_normal(n)
        * np.cos(2.0 * np.pi * j * times[:, None] / 1.2 + draw.uniform(0.0, 6.0, n))
        for j in (1, 2, 3)
    )
    scale, high = np.ones(layout.size), np.full(layout.size, np.inf)
    scale[layout.v], scale[layout.a], scale[layout.u], high[layout.q] = 5.0, 50.0, 5.0, 0.35
    problem = TrajectoryProblem(
        Outputs(function),
        layout,
        grid,
        outputs=outputs,
        equations=range(k + 3),
        low=-high,
        high=high,
        z_scale=scale,
        limits=[Limits(outputs=range(k + 3, k + n), low=-most, high=most)],
        residuals=[
            Residuals(outputs=range(k + n, k + 2 * n), target=aim, weight=20.0, name="motion"),
            Residuals(outputs=range(k + 3, k + n), weight=0.05, name="torque"),
        ],
        design=Design(names=[f"p{i}" for i in range(parameters)], low=-1.0, high=1.0),
    )
    z = np.zeros((grid.instants, layout.size))
    z[:, layout.q] = 0.8 * aim
    return problem, Start(z, np.zeros(parameters))
