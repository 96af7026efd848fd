"""The linearised step is the derivative of the step's equations: Drake's own by AutoDiffXd,
differences of the rest."""

from __future__ import annotations

import dataclasses
from functools import partial

import numba
import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.math import RigidTransform_, RotationMatrix_
from pydrake.multibody.tree import MultibodyForces_

from vsf_drake.laws.compiled import compiled
from vsf_drake.plants.foot import mount_pose, set_mount
from vsf_drake.simulation.mechanism import edited, gait_mechanism
from vsf_drake.simulation.stepping.assembly import (
    TOLERANCE,
    find_sites,
    find_support,
    step_workspace,
)
from vsf_drake.simulation.stepping.directions import ParameterTangent
from vsf_drake.simulation.stepping.newton import FLAT, _residual, velocities
from vsf_drake.simulation.stepping.sensitivity import OneStep
from vsf_drake.simulation.stepping.tree import (
    inverse_dynamics,
    mass_matrix,
    place,
    tree_arrays,
    work_space,
)
from vsf_drake.simulation.variables import added

STEP_S, FULCRUM_M = 1e-3, 0.11
HELD = ("pelvis_tx", "pelvis_ty", "pelvis_tilt", "pelvis_rotation", "knee_angle_r", "fulcrum")
OFFSETS = ("height", "fore_aft", "alignment", "inversion", "toe_out")
MOUNT = (2e-3, 5e-3, 0.03, -0.05, 0.04)
"""Height, fore-aft (m), alignment (rad) about which things are varied."""


@numba.njit
def _residual_at(tree, forces, dofs, workspace, ground, fulcrum, q, v0, a, v):
    """The residual of a step from q, v0 to v, held coordinates accelerated by a: parts have no
    Python wrapper."""
    motion = workspace.motion
    contact = workspace.contact
    place(tree, tree.all, q, motion)
    find_sites(STEP_S, forces, motion, ground, contact)
    deflection = 0.0
    if forces.fulcrum[0] > 0.0:
        deflection = find_support(forces, motion, fulcrum, contact, workspace.fulcrum)
    workspace.v0[:] = v0
    workspace.trial[:] = v
    inverse_dynamics(tree, v0, a, motion, workspace.bias)
    mass_matrix(tree, motion, dofs.free, dofs.above, dofs.counts, workspace.M)
    velocities(tree.links, tree.all, motion.S, v, contact.V)
    _residual(STEP_S, tree.links, forces, dofs, workspace, deflection, 0.0, q)


class Instant:
    """One step of a person at random q0, v0, and its linearisation; every held coordinate of the
    person has a perturbation.

    Args:
        depth: how far (m) the lowest sphere is in the ground at the start; negative: above it.
        names: variables. fulcrum, width: where the support is (m from A), and over which it passes
            a joint.
    """

    def __init__(
        self, walker, seed, names, *, depth, speed, forces=True, fulcrum=FULCRUM_M, width=0.0
    ):
        self.walker, self.names, rng = walker, names, np.random.default_rng(seed)
        self.fulcrum, self.width = fulcrum, width
        mechanism = self._mechanism(np.zeros(len(MOUNT)))
        if not forces:
            mechanism = dataclasses.replace(
                mechanism, springs=np.zeros_like(mechanism.springs), fulcrum=np.zeros(2)
            )
        self.mechanism, tree = mechanism, mechanism.tree
        n = tree.num_coordinates
        self.held = np.array([tree.index(name) for name in HELD])
        self.q = rng.uniform(-0.05, 0.05, n) * np.where(
            np.char.startswith(tree.coordinate_names, "socket_t"), 0.05, 1
        )
        self.q[tree.index("fulcrum")] = fulcrum
        self.v0 = rng.uniform(-speed, speed, n)
        tangents = [walker.variables[name].by_unit for name in names]
        tangents += [
            ParameterTangent(coordinate=name, perturbation=np.ones(2)) for name in HELD[:-1]
        ]
        one = OneStep(tree, mechanism.forces, self.held, tangents)
        self.dofs, self.workspace, self.tangent = one.dofs, one.workspace, one.tangent
        arrays, placed = tree_arrays(tree), work_space(tree)
        compiled(place.py_func)(arrays, arrays.all, self.q, placed)
        b = mechanism.site_bodies
        bottoms = (placed.p[b] + np.einsum("sij,sj->si", placed.R[b], mechanism.sites[:, :3]))[
            :, 2
        ] - mechanism.sites[:, 3]
        self.ground = bottoms.min() + depth
        held_v = self.v0[self.held] + STEP_S * rng.uniform(-3.0, 3.0, len(self.held))
        step = partial(
            one.take,
            STEP_S,
            self.q,
            self.v0,
            self.q[self.held] + STEP_S * held_v,
            ground=self.ground,
            fulcrum=fulcrum,
        )
        step(least_slope=FLAT)
        self.flat = self.workspace.A.copy()
        self.v = step()
        self.A, self.sites = self.workspace.A.copy(), self.workspace.contact.now.copy()
        r = self.workspace.r
        self.converged = r @ np.linalg.solve(self.workspace.M, r) <= TOLERANCE**2
        count, directions = len(self.dofs.free), one.directions
        self.by_variable = (
            self.tangent.Gq[:, count:] @ directions.unit[count:]
            + self.tangent.E[:, : directions.unit.shape[1]]
        )[:, : len(names)]
        self.by_q, self.by_v = self.tangent.Gq[:, :count].copy(), self.tangent.Gv[:, :count].copy()
        way = [directions.coordinate.tolist().index(c) for c in self.held[:-1]]
        self.by_held_q, self.by_held_v, self.by_held_end = (
            matrix[:, way].copy() for matrix in (self.tangent.Gq, self.tangent.Gv, self.tangent.B)
        )

    def _mechanism(self, change):
        """With the foot at MOUNT and `change` (5,); the Context is as it was afterwards."""
        gait, context = self.walker.gait, self.walker.context
        plant_context, foot = gait.plant_context(context), gait.person.foot
        set_mount(
            plant_context, foot, **dict(zip(OFFSETS, MOUNT + np.asarray(change), strict=True))
        )
        mechanism = gait_mechanism(gait, context)
        set_mount(plant_context, foot)
        return dataclasses.replace(mechanism, support_width=self.width)

    def residual(self, *, dq=0.0, dv0=0.0, dv=0.0, values=None):
        """r / h, free end velocities unchanged, and which branch of its law each site is on."""
        values = values or {}
        geometry, slide, shift, *_ = added(
            self.walker.variables, values, self.walker.gait.prescribed
        )
        mechanism = self.mechanism
        if geometry.any():
            mechanism = dataclasses.replace(mechanism, tree=self._mechanism(geometry).tree)
        mechanism = edited(mechanism, self.walker.variables, values)
        tree, forces, workspace = (
            mechanism.tree,
            mechanism.forces,
            step_workspace(mechanism.tree, mechanism.forces, self.dofs),
        )
        q, v0, v, a = self.q + dq, self.v0 + dv0, self.v + dv, np.zeros(len(self.q))
        for name, change in zip(self.walker.gait.prescribed, shift, strict=True):
            q[tree.index(name)] += change
        q[tree.index("fulcrum")] += slide
        a[self.held] = (v - v0)[self.held] / STEP_S
        _residual_at(
            tree_arrays(tree),
            forces,
            self.dofs,
            workspace,
            self.ground,
            self.fulcrum + slide,
            q,
            v0,
            a,
            v,
        )
        sites, law = workspace.contact.now, mechanism.sites
        loaded = sites[:, 1] > 0.0
        speed = np.hypot(sites[:, 5], sites[:, 6]) / law[:, 10]
        kinds = [
            loaded,
            loaded & (sites[:, 4] > 0.0),
            loaded & (sites[:, 0] > law[:, 7]),
            loaded & (speed > 1.0),
            loaded & (speed > 1.5),
        ]
        return workspace.r / STEP_S, np.array(kinds)

    def difference(self, change, **unit):
        """Central difference of the residual along `unit`, and whether nothing changes its branch
        on the way."""
        ends = [
            self.residual(
                **{
                    key: {n: sign * change * x for n, x in value.items()}
                    if key == "values"
                    else sign * change * value
                    for key, value in unit.items()
                }
            )
            for sign in (1.0, -1.0)
        ]
        return (ends[0][0] - ends[1][0]) / (2.0 * change), np.array_equal(ends[0][1], ends[1][1])


@pytest.mark.parametrize(("side", "seed"), [("right", 0), ("left", 1)])
def test_inverse_dynamics_is_differentiated_as_drake_does_it(walker, side, seed):
    """In the air, without springs: rows of free coordinates, by all of these, by held ones and by
    the mount."""
    person = walker(side)
    variables = [
        f"coordinate.{name}" for name in HELD[:-1] if f"coordinate.{name}" in person.variables
    ]
    variables += [*(f"offset.{name}" for name in OFFSETS), "fulcrum.shift"]
    at = Instant(person, seed, variables, depth=-1.0, speed=2.0, forces=False)
    tree, free, n = at.mechanism.tree, at.dofs.free, len(at.q)
    x = InitializeAutoDiff(np.concatenate([at.q, at.v0, MOUNT])[:, None])[:, 0]
    q, v0, (height, fore_aft, alignment, inversion, toe_out) = x[:n], x[n : 2 * n], x[2 * n :]
    plant = person.gait.plant.ToAutoDiffXd()
    context = plant.CreateDefaultContext()
    level = mount_pose(person.gait.person.foot.parameters).translation()
    turn, right = RotationMatrix_[AutoDiffXd], -1.0 if side == "left" else 1.0
    R_KM = (
        turn.MakeZRotation(right * toe_out)
        @ turn.MakeXRotation(-right * inversion)
        @ turn.MakeYRotation(alignment)
    )
    plant.GetFrameByName("vsf_mount").SetPoseInParentFrame(
        context,
        RigidTransform_[AutoDiffXd](R_KM, level - np.array([fore_aft, AutoDiffXd(0.0), height])),
    )
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v0)
    gravity = MultibodyForces_[AutoDiffXd](plant)
    plant.CalcForceElementsContribution(context, gravity)
    acceleration = (at.v - v0) / STEP_S
    wanted = ExtractGradient(plant.CalcInverseDynamics(context, acceleration, gravity))[free]
    assert at.converged
    scale = np.abs(wanted[:, :n]).max()
    np.testing.assert_allclose(at.by_q, wanted[:, free], rtol=0.0, atol=1e-10 * scale)
    np.testing.assert_allclose(
        at.by_v, wanted[:, n + free], rtol=0.0, atol=1e-10 * np.abs(wanted[:, n + free]).max()
    )
    held = at.held[:-1]
    np.testing.assert_allclose(at.by_held_q, wanted[:, held], rtol=0.0, atol=1e-10 * scale)
    np.testing.assert_allclose(
        at.by_held_v, wanted[:, n + held], rtol=0.0, atol=1e-10 * np.abs(wanted[:, n + held]).max()
    )
    mass = plant.CalcMassMatrix(context)
    mass = np.vectorize(lambda entry: entry.value())(mass)[np.ix_(free, held)]
    np.testing.assert_allclose(at.by_held_end, mass, rtol=0.0, atol=1e-10 * np.abs(mass).max())
    columns = [*(2 * n + i for i in range(len(MOUNT))), tree.index("fulcrum")]
    columns = [*(tree.index(name[11:]) for name in variables[: -len(columns)]), *columns]
    assert np.abs(wanted[:, columns]).max() > 1.0
    np.testing.assert_allclose(
        at.by_variable, wanted[:, columns], rtol=0.0, atol=1e-10 * np.abs(wanted[:, columns]).max()
    )


@pytest.mark.parametrize(("side", "speed"), [("right", 0.02), ("left", 0.3), ("right", 1.0)])
def test_contact_springs_and_support_are_differentiated_too(walker, side, speed):
    """Stuck, on friction's falling branch, sliding: by coordinates, velocities at the start, those
    at the end, which is the tangent of Newton's method, and every variable."""
    person, checked, total = walker(side), 0, 0
    variables = [
        name
        for name in person.variables
        if name[11:] not in np.setdiff1d(person.gait.prescribed, HELD)
    ]
    variables = [name for name in variables if not name.endswith("exponent")]
    for seed in range(2):
        at = Instant(person, seed, variables, depth=0.012, speed=speed)
        assert at.converged and at.residual()[1][0].sum() > 3
        free, held = np.eye(len(at.q))[at.dofs.free], np.eye(len(at.q))[at.held[:-1]]
        for matrix, key, along in (
            (at.by_q, "dq", free),
            (at.by_v, "dv0", free),
            (at.by_held_q, "dq", held),
            (at.by_held_v, "dv0", held),
            (at.by_held_end / STEP_S, "dv", held),
            (at.A / STEP_S, "dv", free),
        ):
            for exact, unit in zip(matrix.T, along, strict=True):
                found, smooth = at.difference(1e-6, **{key: unit})
                total, checked = total + 1, checked + smooth
                if smooth:
                    np.testing.assert_allclose(
                        exact, found, rtol=0.0, atol=1e-5 * np.abs(matrix).max(), err_msg=key
                    )
        for p, name in enumerate(variables):
            variable = person.variables[name]
            if variable.added:
                found, smooth = at.difference(1e-6, values={name: 1.0})
            else:
                default, change = variable.default, 1e-5 * variable.default
                ends = [at.residual(values={name: default + sign * change}) for sign in (1.0, -1.0)]
                found, smooth = (
                    (ends[0][0] - ends[1][0]) / (2.0 * change),
                    np.array_equal(ends[0][1], ends[1][1]),
                )
            total, checked = total + 1, checked + smooth
            if smooth:
                scale = max(
                    np.abs(at.by_variable[:, p]).max(), 1.0 / (abs(variable.default) or 0.01)
                )
                np.testing.assert_allclose(
                    at.by_variable[:, p], found, rtol=0.0, atol=1e-5 * scale, err_msg=name
                )
    assert checked > 0.9 * total


@pytest.mark.parametrize("place", [-0.7, 0.0, 0.3])
@pytest.mark.parametrize("joint", [0.07764, 0.1475])
def test_support_on_two_pieces_is_differentiated_too(walker, joint, place):
    """Within a width of a joint, by keel and socket coordinates, by the support's place and by its
    stiffness."""
    names = ("fulcrum.shift", "fulcrum.stiffness")
    at = Instant(
        walker("right"), 5, names, depth=-1.0, speed=0.5, fulcrum=joint + place * 0.006, width=0.006
    )
    assert at.converged and 0.0 < at.workspace.fulcrum[1] < 1.0
    for exact, unit in zip(at.by_q.T, np.eye(len(at.q))[at.dofs.free], strict=True):
        found, _ = at.difference(1e-6, dq=unit)
        np.testing.assert_allclose(exact, found, rtol=0.0, atol=1e-6 * np.abs(at.by_q).max())
    stiffness = at.mechanism.fulcrum[0]
    ends = [
        at.residual(values={"fulcrum.stiffness": (1.0 + sign * 1e-5) * stiffness})[0]
        for sign in (1.0, -1.0)
    ]
    by_stiffness = (ends[0] - ends[1]) / (2e-5 * stiffness)
    for exact, found in zip(
        at.by_variable.T,
        (at.difference(1e-6, values={"fulcrum.shift": 1.0})[0], by_stiffness),
        strict=True,
    ):
        assert np.abs(exact).max() > 0.0
        np.testing.assert_allclose(exact, found, rtol=0.0, atol=1e-6 * np.abs(exact).max())


@pytest.mark.parametrize("speed", [0.02, 0.3, 1.0])
def test_flattened_tangent_differs_from_the_exact_one_only_on_the_falling_branch(walker, speed):
    falling = 0
    for seed in range(20):
        at = Instant(walker("right"), seed, (), depth=0.012, speed=speed)
        loaded = at.sites[:, 1] > 0.0
        slip = np.hypot(at.sites[loaded, 5], at.sites[loaded, 6]) / at.mechanism.sites[loaded, 10]
        on_branch = bool(np.any((slip > 1.0) & (slip < 1.5)))
        assert np.array_equal(at.flat, at.A) != on_branch
        more = np.linalg.eigvalsh(at.flat - at.A + (at.flat - at.A).T)
        assert more.min() >= -1e-9 * max(more.max(), 1e-9)
        falling += on_branch
    assert falling > 0 or speed < 0.1


def test_without_parameters_a_step_is_linearised_about_its_state_alone(walker):
    at = Instant(walker("right"), 0, (), depth=0.012, speed=1.0)
    one = OneStep(at.mechanism.tree, at.mechanism.forces, at.held)
    v = one.take(
        STEP_S,
        at.q,
        at.v0,
        at.q[at.held] + STEP_S * at.v[at.held],
        ground=at.ground,
        fulcrum=FULCRUM_M,
    )
    count = len(one.dofs.free)
    assert one.directions.unit.shape == (count, 0)
    np.testing.assert_allclose(v, at.v, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(one.tangent.Gq, at.by_q, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(one.tangent.Gv, at.by_v, rtol=1e-6, atol=1e-6)
