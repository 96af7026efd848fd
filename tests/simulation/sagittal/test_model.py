"""The sagittal model against the plant it is read from, smooth laws, derivatives; its balance walks
as the stepper."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
import scipy.sparse as sp
from pydrake.multibody.tree import BodyIndex, MultibodyForces
from pydrake.systems.framework import Context

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.laws import bushing, kelvin_voigt, stick_slip
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.optimal_control.balance import BALANCED, quasi_static_motion
from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import (
    DESIGN,
    IMAGINARY_STEP,
    STOP_WIDTH,
    SUPPORT_WIDTH,
    TENSION_WIDTH,
    SagittalModel,
    Smoothing,
    friction,
    spring_forces,
)
from vsf_drake.simulation.sagittal.planar_dynamics import planar_tree
from vsf_drake.simulation.walk import Walker

OFFSETS = GeometricOffsets(height_m=0.004, fore_aft_m=-0.006, alignment_rad=0.03)
FULCRUMS = (0.066, 0.151)


class Instants(NamedTuple):
    """q, v, a (8, N), w, u (12, N), p (4, N)."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    w: np.ndarray
    u: np.ndarray
    p: np.ndarray


def drawn(
    model: SagittalModel, count: int, *, seed: int, speed: float = 1.0, depth: float = 0.015
) -> Instants:
    """Instants in which the lower foot is up to `depth` (m) in the ground; every second one has the
    other lower."""
    rng = np.random.default_rng(seed)
    q = 0.15 * rng.standard_normal((8, count))
    v, a = speed * rng.standard_normal((8, count)), 5.0 * speed * rng.standard_normal((8, count))
    w, u = 0.03 * rng.standard_normal((12, count)), 0.2 * speed * rng.standard_normal((12, count))
    w[:2] *= 0.1
    p = np.stack(
        [
            rng.uniform(*FULCRUMS, count),
            rng.uniform(0.5, 2.0, count),
            0.03 * rng.standard_normal(count),
            rng.uniform(0.8, 1.2, count),
        ]
    )
    q[4, ::2] -= 1.0
    q[6, 1::2] -= 1.0
    q[2] = 1.2
    soles = model.evaluate(q, v, a, w, u, p, Smoothing())[-2:]
    q[2] -= soles.min(axis=0) + rng.uniform(0.2, 1.0, count) * depth
    return Instants(q, v, a, w, u, p)


@cache
def _model(walker: Walker, offsets: GeometricOffsets) -> SagittalModel:
    return SagittalModel(walker, offsets=offsets)


@pytest.fixture(params=["right", "left"])
def person(request, walker) -> tuple[Walker, SagittalModel]:
    """The walker with the prosthesis on that side and its sagittal model with OFFSETS. Change
    neither."""
    return walker(request.param), _model(walker(request.param), OFFSETS)


def plant_state(
    walker: Walker, model: SagittalModel, at: Instants, i: int
) -> tuple[Context, list[int]]:
    """The plant's context at instant i, prosthesis with OFFSETS and the instant's turn; velocity
    indices of q, w."""
    plant = walker.gait.plant
    context = plant.CreateDefaultContext()
    set_mount(
        context,
        walker.gait.person.foot,
        height=OFFSETS.height_m,
        fore_aft=OFFSETS.fore_aft_m,
        alignment=OFFSETS.alignment_rad + at.p[2, i],
    )
    joints = {
        plant.get_joint(index).name(): plant.get_joint(index) for index in plant.GetJointIndices()
    }
    positions, velocities = plant.GetPositions(context), plant.GetVelocities(context)
    indices = []
    for name, x, rate in zip(
        (*model.coordinates, *model.quasi_static),
        (*at.q[:, i], *at.w[:, i]),
        (*at.v[:, i], *at.u[:, i]),
        strict=True,
    ):
        positions[joints[name].position_start()], velocities[joints[name].velocity_start()] = (
            x,
            rate,
        )
        indices.append(joints[name].velocity_start())
    positions[joints["fulcrum"].position_start()] = at.p[0, i]
    plant.SetPositions(context, positions)
    plant.SetVelocities(context, velocities)
    return context, indices


SHARP = Smoothing(
    depth_m=1e-6, rate_m_per_s=1e-6, friction_velocity_m_per_s=1e-6, friction_rise=0.0
)


def spheres_of(walker, foot):
    return (
        walker.gait.person.foot.sites if foot == "prosthetic" else walker.gait.person.intact_sites
    )


def test_inverse_dynamics_are_the_plants(person):
    """Gravity included; nothing else acts."""
    walker, model = person
    at = drawn(model, 12, seed=1)
    motion = model.motion(*at)
    found = model.dynamics.joint_forces(
        motion, model.dynamics.of_carried(model.dynamics.inertial(motion))
    )
    plant = walker.gait.plant
    for i in range(12):
        context, indices = plant_state(walker, model, at, i)
        forces, acceleration = MultibodyForces(plant), np.zeros(plant.num_velocities())
        plant.CalcForceElementsContribution(context, forces)
        acceleration[indices[:8]] = at.a[:, i]
        known = plant.CalcInverseDynamics(context, acceleration, forces)
        np.testing.assert_allclose(found[:20, i], known[indices], atol=1e-12 * np.abs(known).max())


def test_ground_acts_as_the_laws_say_on_the_plants_spheres(person):
    """Slow enough that friction sticks: its fall beyond the threshold is not in the smooth law."""
    walker, model = person
    at = drawn(model, 12, seed=2, speed=0.01)
    at.p[1] = 1.0
    y = dict(zip(model.outputs, model.evaluate(*at, SHARP), strict=True))
    plant, loaded = walker.gait.plant, 0
    for i in range(12):
        context, _ = plant_state(walker, model, at, i)
        for foot in ("prosthetic", "intact"):
            sites = spheres_of(walker, foot)
            wrench = np.zeros(3)
            for index, p, radius, k, n, b, full in zip(
                sites.body_indices,
                sites.p_BS,
                sites.radius,
                sites.stiffness,
                sites.exponent,
                sites.damping,
                sites.full_damping_depth,
                strict=True,
            ):
                body = plant.get_body(BodyIndex(int(index)))
                X_WB, V_WB = body.EvalPoseInWorld(context), body.EvalSpatialVelocityInWorld(context)
                x, _, z = X_WB @ p
                velocity = V_WB.translational() + np.cross(V_WB.rotational(), X_WB.rotation() @ p)
                slip = velocity[0] - V_WB.rotational()[1] * radius
                site = LawConstants(k, n, b, full, **FRICTION)
                fz, _, _ = kelvin_voigt.normal_force(max(radius - z, 0.0), -velocity[2], site)
                assert abs(slip) < 0.08 or fz == 0.0
                fx = -stick_slip.per_speed(abs(slip), site)[0] * fz * slip
                wrench += [fx, fz, (z - radius) * fx - x * fz]
            found = np.array([y[f"{foot}_{part}"][i] for part in ("fx", "fz", "my")])
            # A micrometre at some 1e6 N/m in all.
            np.testing.assert_allclose(found, wrench, atol=1.0)
            loaded += wrench[1] > 100.0
    assert loaded >= 8


def test_power_below_the_shank_is_that_of_the_ground_at_the_shanks_point_over_it(person):
    """At the centre of pressure the ground has a force and no moment."""
    walker, model = person
    at = drawn(model, 12, seed=3)
    y = dict(zip(model.outputs, model.evaluate(*at, Smoothing()), strict=True))
    shank = walker.gait.plant.GetBodyByName(f"shank_{walker.subject.prosthetic_side}")
    tested = 0
    for i in range(12):
        fx, fz, my = (y[f"prosthetic_{part}"][i] for part in ("fx", "fz", "my"))
        if fz < 50.0:
            continue
        context, _ = plant_state(walker, model, at, i)
        X_WS, V_WS = shank.EvalPoseInWorld(context), shank.EvalSpatialVelocityInWorld(context)
        cop = np.array([-my / fz, 0.0, 0.0])
        v = V_WS.translational() + np.cross(V_WS.rotational(), cop - X_WS.translation())
        assert y["prosthesis_power"][i] == pytest.approx(fx * v[0] + fz * v[2], rel=1e-9, abs=1e-9)
        tested += 1
    assert tested >= 5


def test_prosthesis_turned_out_of_the_plane_is_refused(walker):
    subject = replace(walker("right").subject, prosthesis_toe_out_rad=0.1)
    with pytest.raises(InputError, match=r"turned out of the sagittal plane by 5\.7 deg"):
        SagittalModel(Walker(subject, ModelParameters()))
    mechanism = gait_mechanism(walker("right").gait, walker("right").context)
    with pytest.raises(InputError, match="no coordinate third_knee"):
        planar_tree(mechanism.tree, ("pelvis_tx", "third_knee"))
    for sideways in ("hip_adduction_r", "hip_rotation_r", "pelvis_tz"):
        with pytest.raises(InputError, match=f"{sideways} does not move in the sagittal plane"):
            planar_tree(mechanism.tree, ("pelvis_tx", sideways))


def test_what_a_person_at_rest_lacks_is_weight_less_ground(person):
    """Action equals reaction: forces, and moments about the pelvis with the plant's centre of
    mass."""
    walker, model = person
    at = drawn(model, 10, seed=20, speed=0.0)
    y = dict(zip(model.outputs, model.evaluate(*at, Smoothing()), strict=True))
    plant = walker.gait.plant
    for i in range(10):
        context, _ = plant_state(walker, model, at, i)
        weight = plant.CalcTotalMass(context) * 9.81
        fx, fz, my = (
            sum(y[f"{foot}_{part}"][i] for foot in ("prosthetic", "intact"))
            for part in ("fx", "fz", "my")
        )
        com = plant.CalcCenterOfMassPositionInWorld(context)
        assert y["balance_pelvis_ty"][i] == pytest.approx(weight - fz, abs=1e-9)
        assert y["balance_pelvis_tx"][i] == pytest.approx(-fx, abs=1e-9)
        px, pz = at.q[1, i], at.q[2, i]
        need = -((com[0] - px) * weight + my - (pz * fx - px * fz))
        axis = plant.GetJointByName("pelvis_tilt").revolute_axis()[1]
        assert y["balance_pelvis_tilt"][i] == pytest.approx(axis * need, abs=1e-9)


@pytest.mark.parametrize(
    ("design", "values"),
    [
        (
            ("heel_stiffness", 1.7),
            lambda own: {
                name: 1.7 * value
                for name, value in own.items()
                if name.startswith("contact.heel") and name.endswith(".stiffness")
            },
        ),
        (("alignment_rad", -0.05), lambda own: {"offset.alignment": -0.05}),
        (
            ("keel_thickness", 1.25),
            lambda own: {"keel.flexural_modulus": 1.25**3 * own["keel.flexural_modulus"]},
        ),
        (("fulcrum_m", 0.118), lambda own: {"fulcrum.shift": 0.01}),
    ],
)
def test_design_is_that_of_the_walks_variables(person, design, values):
    """Stiffness of all zones at the heel, a turn of the mount, bending by the cube of a thickness,
    a place."""
    walker, model = person
    at = drawn(model, 10, seed=30)
    at.p[:] = np.array([0.108, 1.0, 0.0, 1.0])[:, None]
    changed = at.p.copy()
    changed[DESIGN.index(design[0])] = design[1]
    values = values({name: variable.default for name, variable in walker.variables.items()})
    other = SagittalModel(walker, offsets=OFFSETS, values=values)
    found = model.evaluate(*at[:5], changed, Smoothing())
    np.testing.assert_allclose(found, other.evaluate(*at, Smoothing()), rtol=1e-12, atol=1e-9)
    assert np.abs(found - model.evaluate(*at, Smoothing())).max() > 1.0


SMOOTHINGS = [
    Smoothing(depth_m=0.002),
    Smoothing(depth_m=0.01, friction_velocity_m_per_s=0.5, damping=0.0),
]
SIZES = (8, 8, 8, 12, 12, 4)


def stepped(at, steps):
    """The arguments (n, 52, N), each changed by its own of `steps` (52,)."""
    wide = np.repeat(np.concatenate(at)[:, None], sum(SIZES), 1).astype(np.result_type(steps))
    every = np.arange(sum(SIZES))
    wide[every, every] += steps[:, None]
    return np.split(wide, np.cumsum(SIZES)[:-1])


@pytest.mark.parametrize("smoothing", SMOOTHINGS)
def test_closed_form_is_that_of_complex_steps(person, smoothing):
    assert_closed_form(person[1], smoothing)


@pytest.mark.parametrize("law", ["smooth", "hunt_crossley"])
def test_closed_form_of_other_laws_too(walker, law):
    own = walker("right")
    other = Walker(own.subject, replace(own.model, contact_law=law))
    assert_closed_form(SagittalModel(other), Smoothing())


def assert_closed_form(model, smoothing):
    at = drawn(model, 40, seed=4)
    values, by = linearise(model, *at, smoothing)
    known = (
        model.evaluate(*stepped(at, np.full(sum(SIZES), 1j * IMAGINARY_STEP)), smoothing).imag
        / IMAGINARY_STEP
    )
    plain = model.evaluate(*at, smoothing)
    np.testing.assert_allclose(values, plain, atol=1e-12 * np.abs(plain).max())
    largest = np.abs(known).max(axis=(1, 2), keepdims=True)
    assert (np.abs(by - known) / largest).max() < 1e-12


def turns(model, count, seed):
    return 0.08 * np.random.default_rng(seed).standard_normal((len(model.support.starts), count))


def test_deflection_is_the_height_of_the_plants_keel_at_the_fulcrum(person):
    walker, model = person
    at, starts, foot, plant = (
        drawn(model, 30, seed=7),
        model.support.starts,
        walker.gait.person.foot,
        walker.gait.plant,
    )
    for i in range(30):
        context, _ = plant_state(walker, model, at, i)
        position = at.p[0, i]
        keel = foot.keel_body_at(position)
        point = plant.CalcPointsPositions(
            context,
            foot.keel[keel].body_frame(),
            [position - starts[keel], 0.0, 0.0],
            foot.frame.body_frame(),
        )
        found = model.support.deflection(at.w[3:, i], position)[0]
        far = np.abs(position - starts[1:]).min() > SUPPORT_WIDTH
        near = 0.09 * SUPPORT_WIDTH * np.abs(at.w[3:, i]).max()
        assert found == pytest.approx(point[2, 0], abs=1e-15 if far else near)


def test_everything_has_one_derivative_by_the_fulcrum_at_and_around_a_joint(person):
    """Two instants d = 2e-9 m apart see the same derivatives, but for d / width of the largest of
    the keel's joints."""
    _, model = person
    at = drawn(model, 10, seed=9)
    keel = [name.startswith("balance_keel") for name in model.outputs]
    by_fulcrum = 3 * 8 + 2 * 12
    for start in model.support.starts[3:6]:
        for edge in (-SUPPORT_WIDTH, 0.0, SUPPORT_WIDTH):
            by = []
            for side in (-1e-9, 1e-9):
                at.p[0] = start + edge + side
                by.append(linearise(model, *at, Smoothing())[1][:, by_fulcrum])
            largest = np.abs(by[0]).max(axis=1) + 1e-9
            largest[keel] = largest[keel].max()
            assert (np.abs(by[1] - by[0]).max(axis=1) / largest).max() < 10.0 * 2e-9 / SUPPORT_WIDTH


def test_support_gives_back_what_is_stored_in_it(person):
    """Its load on the keel's joints is the slope of its energy; its damping takes rate squared."""
    _, model = person
    w = turns(model, 20, seed=11)
    u, position = turns(model, 20, seed=12), np.linspace(0.066, 0.151, 20)
    support = model.support
    elastic = support.load(w, 0.0 * u, position)[0]
    for i in range(len(w)):
        step = np.zeros_like(w, dtype=complex)
        step[i] = 1j * IMAGINARY_STEP
        slope = support.load(w + step, u, position)[1].imag / IMAGINARY_STEP
        np.testing.assert_allclose(elastic[i], slope, atol=1e-12 * np.abs(elastic).max())
    rate = (
        support.deflection(w + 1e-7 * u, position)[0]
        - support.deflection(w - 1e-7 * u, position)[0]
    ) / 2e-7
    lost = ((support.load(w, u, position)[0] - elastic) * u).sum(axis=0)
    np.testing.assert_allclose(lost, support.damping * rate**2, rtol=1e-6, atol=1e-9)


FRICTION = {"mu_static": 0.5, "mu_kinetic": 0.3, "threshold_velocity": 0.1}


def test_friction_is_the_law_up_to_four_fifths_of_the_threshold_and_rounded_rising_above():
    slip = np.linspace(0.0, 0.1, 1001)
    spheres = SimpleNamespace(columns={name: np.array([value]) for name, value in FRICTION.items()})
    level = Smoothing(friction_velocity_m_per_s=0.01, friction_rise=0.0)
    law = stick_slip.per_speed(slip, LawConstants(**FRICTION))[0] * slip
    error = law - friction(spheres, slip[None], level)[0][0]
    np.testing.assert_allclose(error[slip <= 0.08], 0.0, atol=1e-15)
    assert error.min() >= -1e-15
    assert error.max() == pytest.approx(3.0 / 16.0 * 0.2 * 0.5, rel=1e-12)
    fast, rising = (
        np.array([[-0.3, 0.2, 0.3]]),
        Smoothing(friction_velocity_m_per_s=0.01, friction_rise=0.1),
    )
    np.testing.assert_allclose(friction(spheres, fast, level)[0], [[-0.5, 0.5, 0.5]])
    np.testing.assert_allclose(friction(spheres, fast, rising)[0], [[-0.6, 0.55, 0.6]])


def test_socket_is_the_bushing_up_to_its_corners():
    """Off by 3/16 of each corner: of tension and compression, of the stops, of the rate stops."""
    stiff, negative, damping, limit, rate_limit, stop = 1.2e5, 2e4, 1e3, 0.015, 0.5, 10.0
    row = np.array([[stiff, negative, damping, limit, rate_limit, stop]])
    x, rate = (
        grid.ravel()
        for grid in np.meshgrid(np.linspace(-0.03, 0.03, 301), np.linspace(-1.0, 1.0, 101))
    )
    found, energy = spring_forces(row, x[None], rate[None], np.ones((1, len(x))))
    known = bushing.axis_force(
        x,
        rate,
        stiffness=stiff,
        stiffness_negative=negative,
        damping=damping,
        limit=limit,
        rate_limit=rate_limit,
        stop_ratio=stop,
    )
    error, part = np.abs(found[0] - known[0]), 3.0 / 16.0
    bound = (
        part * (stiff - negative) * TENSION_WIDTH * (np.abs(x) < TENSION_WIDTH)
        + part
        * stop
        * stiff
        * STOP_WIDTH
        * limit
        * (np.abs(np.abs(x) - limit) < STOP_WIDTH * limit)
        + part
        * stop
        * damping
        * STOP_WIDTH
        * rate_limit
        * (np.abs(np.abs(rate) - rate_limit) < STOP_WIDTH * rate_limit)
    )
    assert np.all(error <= bound + 1e-9)
    still = spring_forces(row, x[None], 0.0 * x[None], np.ones((1, len(x))))[0][0]
    by = spring_forces(row, x[None] + 1j * IMAGINARY_STEP, rate[None], np.ones((1, len(x))))[1][
        0
    ].imag
    np.testing.assert_allclose(by / IMAGINARY_STEP, -still, atol=1e-9)
    assert energy.min() >= 0.0


def test_smoothing_without_meaning_is_refused():
    for bad in ({"depth_m": 0.0}, {"damping": 1.5}):
        with pytest.raises(InputError, match=r"smoothing\."):
            Smoothing(**bad)


STEP_S = 0.005
OWN = np.array([0.108, 1.0, 0.0, 1.0])
SHARPER = Smoothing(depth_m=1e-4, rate_m_per_s=0.002, friction_rise=0.0)


def backward_rates(count):
    """Rates by the second-order backward difference, from rest."""
    rates = sp.lil_matrix((count, count))
    rates[1, 0], rates[1, 1] = -1.0, 1.0
    for i in range(2, count):
        rates[i, i - 2 : i + 1] = [0.5, -2.0, 1.5]
    return rates.tocsr() / STEP_S


def planar(motion, names):
    """The motion without what leaves the sagittal plane."""
    values = [
        motion.values[:, i] if name in names else 0.0 * motion.time_s
        for i, name in enumerate(motion.names)
    ]
    return CoordinateTrajectory(motion.time_s, np.column_stack(values), motion.names)


@pytest.fixture(scope="module")
def rolling(walker, motion):
    """A walker whose friction does not fall beyond its threshold, where the smooth law is not the
    stepper's; its sagittal model, a planar roll-over and the instants at which it is looked at."""
    parameters, subject = ModelParameters(), walker("right").subject
    level = replace(parameters.foot.friction, mu_kinetic=parameters.foot.friction.mu_static)
    parameters = replace(
        parameters,
        foot=replace(parameters.foot, friction=level),
        intact_foot=replace(parameters.intact_foot, friction=level),
    )
    person = Walker(subject, parameters)
    model = SagittalModel(person)
    path, time = planar(motion("right"), model.coordinates), np.arange(0.02, 0.9, STEP_S)
    return person, model, path, time, [x.T for x in path.ordered(model.coordinates).sample(time)]


@pytest.fixture(scope="module")
def balanced(rolling):
    _, model, _, time, state = rolling
    rates = backward_rates(len(time))
    first, _ = quasi_static_motion(model, *state, OWN, rates, Smoothing())
    return quasi_static_motion(model, *state, OWN, rates, SHARPER, start=first)


def test_every_joint_is_in_balance_at_every_instant(rolling, balanced):
    _, model, _, time, state = rolling
    y = model.evaluate(*state, *balanced, np.repeat(OWN[:, None], len(time), 1), SHARPER)
    assert np.abs(y[3:15]).max() <= BALANCED * model.weight


def test_ground_reaction_is_the_steppers_but_for_the_inertia_of_what_yields(rolling, balanced):
    """What is left out is the acceleration of keel and socket in themselves: its force, in the mean
    square, and twice what the stepper changes by in half its step bound the difference. That is
    less than 0.5 % of body weight."""
    person, model, path, time, state = rolling
    w, u = balanced
    p = np.repeat(OWN[:, None], len(time), 1)
    y = dict(zip(model.outputs, model.evaluate(*state, w, u, p, SHARPER), strict=True))
    coarse, fine = (
        person.walk(path, fulcrum_m=OWN[0], start_s=0.0, end_s=0.9, step_s=h) for h in (1e-3, 5e-4)
    )
    own = (backward_rates(len(time)) @ u.T).T
    nil = np.zeros((2, len(time)))
    dynamics, still = model.dynamics, model.motion(*state, w, u, p)
    moved = dynamics.move(
        np.concatenate([state[0], w, p[:1], p[2:3]]),
        np.concatenate([state[1], u, nil]),
        np.concatenate([state[2], own, nil]),
    )
    left_out = (dynamics.inertial(moved) - dynamics.inertial(still)).sum(axis=1)

    def size(x):
        return np.sqrt((x * x).mean())

    for name, column, missing in (
        ("prosthetic_fx", 0, left_out[1]),
        ("prosthetic_fz", 2, left_out[2]),
    ):
        known, other = (
            np.interp(time, walk.record.time_s, walk.prosthetic.grf_W[:, column])
            for walk in (fine, coarse)
        )
        assert size(y[name] - known) <= size(missing) + 2.0 * size(other - known)
        assert size(y[name] - known) < 0.005 * model.weight
    assert y["prosthetic_fz"].max() > 0.9 * model.weight


def test_motion_without_balance_says_where(rolling):
    _, model, _, time, state = rolling
    q = state[0].copy()
    q[2, 40] = np.nan
    place = f"at instant 41 of {len(time)} socket_tx is off by nan"
    with pytest.raises(SimulationError, match=f"find no balance .* {place}"):
        quasi_static_motion(model, q, *state[1:], OWN, backward_rates(len(time)), Smoothing())
