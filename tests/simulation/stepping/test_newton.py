"""A step solves Drake's equations of motion, its tangent is their derivative, and nothing makes energy."""

from __future__ import annotations

import dataclasses

import numba
import numpy as np
import pytest
from cut_walks import inputs_of
from pydrake.multibody.tree import BodyIndex, JacobianWrtVariable, MultibodyForces

from vsf_drake.laws.bushing import axis_force
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.reactions import follow
from vsf_drake.simulation.stepping.assembly import (
    SPRING_COLUMNS,
    TOLERANCE,
    find_sites,
    find_support,
    split_coordinates,
    step_room,
)
from vsf_drake.simulation.stepping.newton import EXACT, FLAT, _residual, _velocities, copy, tangent_matrix
from vsf_drake.simulation.stepping.stepper import Inputs, Stepper
from vsf_drake.simulation.stepping.tree import inverse_dynamics, mass_matrix, place, tree_arrays

STEP_S = 1e-3
"""Functions of the package that only compiled code may call are called from compiled functions here."""


@numba.njit
def begin(tree, forces, split, room, ground, fulcrum, q, v0, sites):
    """What a step does before its first residual; returns the deflection of the support (m)."""
    place(tree, q, room.motion)
    find_sites(STEP_S, forces, room.motion, ground, room.contact, sites)
    _, _, _, deflection = find_support(forces, room.motion, fulcrum, room.contact)
    copy(v0, room.v0)
    inverse_dynamics(tree, v0, np.zeros(v0.shape[0]), room.motion, room.bias)
    mass_matrix(tree, room.motion, split.free, split.above, split.counts, room.M)
    _velocities(tree.links, room.motion.S, v0, room.contact.V)
    return deflection


@numba.njit
def residual(tree, forces, split, room, deflection, q, trial, sites, support):
    """Leaves r (f,) at the end velocity `trial` in the room."""
    copy(trial, room.trial)
    _residual(STEP_S, tree.links, forces, split, room, deflection, 0.0, q, sites, support)


@numba.njit
def tangent(tree, forces, split, room, least_slope, sites):
    """Leaves A (f, f) at the last residual in the room."""
    tangent_matrix(STEP_S, tree, forces, split, room, least_slope, sites)


@numba.njit
def poses(tree, q, motion):
    """Leaves the bodies' poses in `motion`."""
    place(tree, q, motion)


class Standing:
    """A person about upright with the feet up to 15 mm in the ground: all but the fulcrum free, residual by hand.

    `trial` (n,) is an end velocity of a step that begins with `v0`.
    """

    def __init__(self, walker, seed, *, speed):
        rng = np.random.default_rng(seed)
        self.mechanism = gait_mechanism(walker.gait, walker.context)
        tree = self.mechanism.tree
        self.forces, self.tree = self.mechanism.forces, tree_arrays(tree)
        self.split = split_coordinates(tree, self.forces, np.array([tree.index("fulcrum")]))
        self.room = step_room(tree, self.forces, self.split)
        self.sites, self.support = np.zeros((len(self.mechanism.sites), 9)), np.zeros(3)
        n = tree.num_coordinates
        self.q = rng.uniform(-0.02, 0.02, n) * np.where(np.char.startswith(tree.coordinate_names, "socket_t"), 0.02, 1)
        self.q[tree.index("fulcrum")] = 0.1
        self.v0 = rng.uniform(-speed, speed, n)
        self.v0[tree.index("fulcrum")] = 0.0
        self.trial = self.v0 + rng.uniform(-0.1 * speed, 0.1 * speed, n) * (self.v0 != 0.0)
        poses(self.tree, self.q, self.room.motion)
        R, p = self.room.motion.R, self.room.motion.p
        b, rows = self.mechanism.site_bodies, self.mechanism.sites
        self.ground = ((p[b] + np.einsum("sij,sj->si", R[b], rows[:, :3]))[:, 2] - rows[:, 3]).min() + 0.015
        self.deflection = begin(self.tree, self.forces, self.split, self.room, self.ground, 0.1, self.q, self.v0,
                                self.sites)

    def residual(self, trial):
        residual(self.tree, self.forces, self.split, self.room, self.deflection, self.q, trial, self.sites,
                 self.support)
        return self.room.r.copy()

    def tangent(self, *, exact):
        self.residual(self.trial)
        tangent(self.tree, self.forces, self.split, self.room, EXACT if exact else FLAT, self.sites)
        return self.room.A.copy()

    def speeds(self):
        """Slip speeds of the loaded sites over the threshold velocity, after a residual."""
        loaded = self.sites[:, 1] > 0.0
        return np.hypot(self.sites[loaded, 5], self.sites[loaded, 6]) / self.mechanism.sites[loaded, 10]

    def smooth(self):
        """Whether no site and no spring is so near a kink of its law that a difference would reach over it."""
        self.residual(self.trial)
        near = self.sites[self.sites[:, 0] > -1e-3]
        rates = self.trial[self.mechanism.spring_index]
        x = self.q[self.mechanism.spring_index] + STEP_S * rates
        springs = self.mechanism.springs
        kinks = [near[:, 0] * 1e2, near[:, 4], self.speeds() - 1.0, self.speeds() - 1.5, x * 1e2,
                 1e2 * (np.abs(x) - springs[:, 3]), np.abs(rates) - springs[:, 4]]
        return min(np.abs(kink).min() for kink in kinks) > 1e-4


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("speed", [0.02, 0.3, 1.0])
def test_tangent_is_the_derivative_of_the_residual(walker, side, speed):
    """Stuck, on the falling branch and sliding; central differences, whose error is some (1e-5)^2 of the scale."""
    checked = 0
    for seed in range(60):
        state = Standing(walker(side), seed, speed=speed)
        if not state.smooth():
            continue
        A = state.tangent(exact=True)
        assert len(state.speeds()) > 4
        differences = np.zeros_like(A)
        for i, c in enumerate(state.split.free):
            up, down = state.trial.copy(), state.trial.copy()
            up[c] += 1e-5
            down[c] -= 1e-5
            differences[:, i] = (state.residual(up) - state.residual(down)) / 2e-5
        np.testing.assert_allclose(A, differences, rtol=0.0, atol=1e-6 * np.abs(A).max())
        checked += 1
    assert checked >= 5


@pytest.mark.parametrize("speed", [0.02, 0.3, 1.0])
def test_flattened_tangent_differs_from_the_exact_one_only_on_the_falling_branch(walker, speed):
    falling = 0
    for seed in range(20):
        state = Standing(walker("right"), seed, speed=speed)
        flat, exact = state.tangent(exact=False), state.tangent(exact=True)
        on_branch = bool(np.any((state.speeds() > 1.0) & (state.speeds() < 1.5)))
        assert np.array_equal(flat, exact) != on_branch
        more = np.linalg.eigvalsh(flat - exact + (flat - exact).T)
        assert more.min() >= -1e-9 * max(more.max(), 1e-9)
        falling += on_branch
    assert falling > 0 or speed < 0.1


@pytest.mark.parametrize("side", ["right", "left"])
def test_wrench_on_every_body_is_the_sum_over_the_sites_that_it_carries(walker, side):
    for seed in range(5):
        state = Standing(walker(side), seed, speed=0.3)
        state.residual(state.trial)
        m, contact = state.mechanism, state.room.contact
        force = np.column_stack([state.sites[:, 2], state.sites[:, 3], state.sites[:, 1]])
        point = contact.center - m.sites[:, 3:4] * [0.0, 0.0, 1.0]
        wrench = np.hstack([np.cross(point, force), force])
        carried = np.eye(len(contact.F), dtype=bool)
        for _, parent, child, _ in m.tree.links[::-1]:
            carried[parent] |= carried[child]
        wanted = np.array([wrench[carried[b][m.site_bodies]].sum(axis=0) for b in range(len(contact.F))])
        assert np.abs(wanted[0]).max() > 100.0
        np.testing.assert_allclose(contact.F, wanted, rtol=0.0, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("side", ["right", "left"])
def test_steps_solve_drakes_equations_of_motion_with_the_forces_they_record(walker, motion, side):
    """M a + C - tau_g - sum J^T f = load, which is 0 for what is free: all but f and load from Drake and the laws."""
    person = walker(side)
    walk = person.walk(motion(side), fulcrum_m=0.108, start_s=0.0, end_s=0.94, step_s=2e-3)
    plant, context, record, mechanism = person.gait.plant, walk.mechanism.context, walk.record, walk.mechanism
    free = np.setdiff1d(np.arange(record.q.shape[1]), inputs_of(walk, person).prescribed)
    for k in range(60, 440, 20):
        q0, v0, q, v = record.q[k - 1], record.v[k - 1], record.q[k], record.v[k]
        plant.SetPositionsAndVelocities(context, np.concatenate([q0, v0]))
        own = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, own)
        need = plant.CalcInverseDynamics(context, (v - v0) / 2e-3, own)
        need -= ground_on_coordinates(plant, context, mechanism, record.sites[k])
        law = dict(zip(SPRING_COLUMNS, mechanism.springs.T, strict=True))
        springs = mechanism.spring_index
        need[springs] -= axis_force(q[springs], v[springs], **law)
        need -= record.fulcrum[k, 0] * support_row(plant, context, person.gait.person.foot, 0.108)
        r = 2e-3 * (need - record.load[k])[free]
        M = plant.CalcMassMatrix(context)[np.ix_(free, free)]
        assert np.sqrt(r @ np.linalg.solve(M, r)) < 2.0 * TOLERANCE
        held = np.setdiff1d(np.arange(len(q)), free)
        np.testing.assert_allclose(record.load[k, held], need[held], rtol=0.0, atol=1e-9 * np.abs(need).max())


def ground_on_coordinates(plant, context, mechanism, sites):
    """(n,) J^T f of the ground, at the lowest points of the spheres."""
    total, world = np.zeros(plant.num_velocities()), plant.world_frame()
    for site, b, row in zip(sites, mechanism.site_bodies, mechanism.sites, strict=True):
        if site[1] > 0.0:
            body = plant.get_body(BodyIndex(int(b)))
            X = body.EvalPoseInWorld(context)
            p_B = X.inverse() @ (X @ row[:3] - [0.0, 0.0, row[3]])
            J = plant.CalcJacobianTranslationalVelocity(
                context, JacobianWrtVariable.kV, body.body_frame(), p_B, world, world)
            total += J.T @ [site[2], site[3], site[1]]
    return total


def support_row(plant, context, foot, position):
    """(n,) rate of the keel's point at `position` in the foot's frame along its z, by each coordinate."""
    j = foot.keel_body_at(position)
    J = plant.CalcJacobianTranslationalVelocity(
        context, JacobianWrtVariable.kV, foot.keel[j].body_frame(), [position - foot.keel_starts[j], 0.0, 0.0],
        foot.frame.body_frame(), foot.frame.body_frame())
    return J[2]


def loose(walker, names):
    """The person in the air without springs and support, `names` held: a chain of hinges under its weight."""
    mechanism = gait_mechanism(walker.gait, walker.context)
    springs = np.zeros_like(mechanism.springs)
    springs[:, 3:5] = 1e30
    held = np.array([mechanism.tree.index(name) for name in names], dtype=np.int64)
    return held, dataclasses.replace(mechanism, springs=springs, fulcrum=np.zeros(2),
                                     limits=np.full(mechanism.tree.num_coordinates, 1e30))


@pytest.mark.parametrize("names", [(), ("pelvis_tx", "pelvis_ty", "pelvis_tz", "pelvis_tilt", "fulcrum")])
def test_chain_without_losses_keeps_its_energy_to_first_order_in_the_step(walker, names):
    """Flying freely, and hanging from its pelvis: the error halves with the step."""
    held, mechanism = loose(walker("right"), names)
    n = mechanism.tree.num_coordinates
    rng = np.random.default_rng(8)
    q0, v0 = rng.uniform(-0.3, 0.3, n), rng.uniform(-0.5, 0.5, n)
    v0[held] = 0.0
    q0[held] = 0.1
    losses, tree = [], mechanism.tree
    for step_s in (4e-4, 2e-4, 1e-4):
        time = step_s * np.arange(round(0.2 / step_s) + 1)
        inputs = Inputs(time_s=time, prescribed=held, prescribed_q=np.tile(q0[held], (len(time), 1)),
                        fulcrum=np.full(len(time), 0.1), ground=np.full(len(time), -1e3))
        record = Stepper(mechanism).run(inputs, q0, v0)
        assert record.converged.all()
        q, v = np.vstack([q0, record.q]), np.vstack([v0, record.v])
        motion = follow(tree, q, v, bodies=(0,), coordinates=(), inside=np.ones(len(tree.body_names), dtype=bool))
        potential, kinetic = -motion.mass_moment @ tree.gravity, motion.kinetic_j
        losses.append(potential + kinetic - potential[0] - kinetic[0])
        moved = np.ptp(kinetic)
    ends = np.array([loss[-1] for loss in losses])
    np.testing.assert_allclose(ends[:-1] / ends[1:], 2.0, rtol=0.1)
    assert abs(ends[-1]) < 0.01 * moved


def test_body_in_free_fall_is_where_galileo_has_it(walker):
    """All coordinates free and at rest: the step is exact for a constant acceleration but for h g t / 2."""
    held, mechanism = loose(walker("right"), ())
    n, step_s, steps = mechanism.tree.num_coordinates, 1e-3, 300
    time = step_s * np.arange(steps + 1)
    inputs = Inputs(time_s=time, prescribed=held, prescribed_q=np.zeros((steps + 1, 0)),
                    fulcrum=np.zeros(steps + 1), ground=np.full(steps + 1, -1e3))
    record = Stepper(mechanism).run(inputs, np.zeros(n), np.zeros(n))
    c = mechanism.tree.index("pelvis_ty")
    t = time[1:]
    np.testing.assert_allclose(record.v[:, c], -9.81 * t, rtol=1e-9)
    np.testing.assert_allclose(record.q[:, c], -0.5 * 9.81 * t * (t + step_s), rtol=1e-9)
    others = np.delete(record.v, c, axis=1)
    assert np.abs(others).max() < 1e-6
    assert np.abs(record.load).max() < 1e-3


