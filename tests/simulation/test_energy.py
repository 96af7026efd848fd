"""The energy ledger closes: closed forms, the stepper's own loss, and works that are known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import quad

from vsf_drake.model.parameters import ContactZone, FootParameters
from vsf_drake.simulation.reactions import LOST, energy_ledger, total
from vsf_drake.simulation.roll_over import RollOver, roll_over_mechanism
from vsf_drake.simulation.stepping.runs import Inputs
from vsf_drake.simulation.stepping.stepper import Stepper


def gap(ledger):
    """Largest imbalance, as a fraction of all the energy that was lost: the smallest sum there is
    to compare with."""
    return float(np.abs(ledger["remainder"]).max() / total(ledger, LOST)[-1])


@pytest.fixture(scope="module")
def ledger(stance, walker):
    """ledger(step_s) of a stance of the right foot."""
    return lambda step_s: walker("right").energies(stance("right", step_s))


def test_imbalance_is_the_steppers_own_loss_and_in_proportion_to_the_step(ledger):
    terms, gaps = ledger(2.5e-4), [gap(ledger(h)) for h in (5e-4, 2.5e-4, 1.25e-4)]
    assert gaps[1] < 0.02
    assert total(terms, LOST)[-1] > 5.0, (
        "the stance must lose something for the comparison to mean anything"
    )
    assert np.ptp(terms["driver_work"]) > 20.0
    np.testing.assert_allclose(np.array(gaps[:-1]) / gaps[1:], 2.0, atol=0.25)
    assert np.diff(terms["remainder"]).min() > -1e-3, (
        "an implicit step loses energy, it does not make any"
    )


@pytest.fixture(scope="module")
def ball():
    """A foot with one sphere, on its rigid block, without friction; and its mechanism."""
    zone = ContactZone(
        name="ball",
        x_mm=(50.0,),
        y_mm=(0.0,),
        rise_mm=(0.0,),
        radius_m=0.05,
        stiffness=2e5,
        damping_n_s_per_m=500.0,
        full_damping_depth_m=1e-3,
    )
    keel = dataclasses.replace(FootParameters().keel, damping_time_s=0.0)
    machine = RollOver(
        dataclasses.replace(FootParameters(), zones=(zone,), keel=keel), friction=False
    )
    return machine, roll_over_mechanism(machine.machine, machine.context)


def run_of(ball, time_s, q, v0, free=()):
    """Record and ledger of the ball's foot with all coordinates but `free` along q (n + 1,
    coordinates)."""
    mechanism = ball[1]
    driven = np.setdiff1d(np.arange(q.shape[1]), free)
    fulcrum = np.full(len(time_s), 0.108)
    inputs = Inputs(
        time_s=time_s,
        prescribed=driven,
        prescribed_q=q[:, driven],
        fulcrum=fulcrum,
        ground=np.zeros(len(time_s)),
    )
    record = Stepper(mechanism, tolerance=1e-12).run(inputs, q[0], v0)
    return record, energy_ledger(mechanism, record, driven=driven, fulcrum_m=fulcrum)


def test_work_on_a_pressed_foam_is_its_strain_and_loss_in_closed_form_to_second_order(ball):
    """A sphere pressed by d(t) = D (1 - cos 2 pi t / T) / 2: k D^2 / 2 is stored at T / 2, and
    until then the damping has taken the integral of b y(d / d_full) d'^2. Every coordinate is
    prescribed: the stepper solves for none."""
    k, b, full, deepest, duration = 2e5, 500.0, 1e-3, 4e-3, 0.1
    machine, mechanism = ball
    z = mechanism.tree.index("mount_up")

    def depth(t):
        return 0.5 * deepest * (1.0 - np.cos(2.0 * np.pi * t / duration))

    def taken(t):
        u = min(depth(t) / full, 1.0)
        return (
            b
            * u
            * u
            * (3.0 - 2.0 * u)
            * (np.pi * deepest / duration * np.sin(2.0 * np.pi * t / duration)) ** 2
        )

    lost = quad(taken, 0.0, 0.5 * duration, epsabs=1e-12, limit=200)[0]
    assert lost > 0.1 * 0.5 * k * deepest**2, "the damping must matter"
    off = []
    for steps in (200, 400, 800):
        time = duration / steps * np.arange(steps + 1)
        q = np.zeros((steps + 1, mechanism.tree.num_coordinates))
        q[:, mechanism.tree.index(machine.machine.foot.carriage_joint_name)] = 0.108
        q[:, z] = machine.touch_height(0.0)[0] - depth(time)
        _, terms = run_of(ball, time, q, np.zeros(q.shape[1]))
        into_foam = terms["driver_work"] + terms["gravity_work"] - terms["kinetic"]
        off.append(np.abs(terms["remainder"]).max())
    assert into_foam[steps // 2 - 1] == pytest.approx(0.5 * k * deepest**2 + lost, abs=1e-3 * lost)
    assert into_foam[-1] == pytest.approx(lost, abs=1e-3 * lost)
    np.testing.assert_allclose(np.array(off[:-1]) / off[1:], 4.0, atol=0.1)


def test_the_support_under_a_keel_that_turns_above_it_stores_and_loses_in_closed_form(ball):
    """Turned about its pin by A (1 - cos 2 pi t / T) / 2 it moves the support, a distance l ahead,
    by l times that: k (l A)^2 / 2 is stored at T / 2, and until T the damping has taken c (l A)^2
    pi^2 / (2 T)."""
    turned, duration, steps, fulcrum_m = 1e-4, 0.1, 400, 0.108
    machine, mechanism = ball
    foot, tree = machine.machine.foot, mechanism.tree
    stiffness, damping = mechanism.fulcrum
    travel = turned * fulcrum_m
    time = duration / steps * np.arange(steps + 1)
    q = np.zeros((steps + 1, tree.num_coordinates))
    q[:, tree.index(foot.carriage_joint_name)], q[:, tree.index("mount_up")] = fulcrum_m, 0.5
    q[:, tree.index(foot.keel_joint_names[0])] = (
        0.5 * turned * (1.0 - np.cos(2.0 * np.pi * time / duration))
    )
    _, terms = run_of(ball, time, q, np.zeros(q.shape[1]))
    assert terms["fulcrum_strain"][steps // 2 - 1] == pytest.approx(
        0.5 * stiffness * travel**2, rel=1e-3
    )
    assert terms["fulcrum_loss"][-1] == pytest.approx(
        damping * travel**2 * np.pi**2 / (2.0 * duration), rel=1e-3
    )


def test_an_undamped_joint_in_the_air_loses_what_implicit_euler_takes_and_the_remainder_shows_it(
    ball,
):
    """Amplitudes shrink by 1 / sqrt(1 + h^2 w^2) a step, energies by its square; within a period
    the loss, h w^2 times twice the kinetic energy a second, runs ahead of its mean by up to h w /
    2 of the energy. Nothing else remains."""
    machine, mechanism = ball
    tree, plant = mechanism.tree, mechanism.plant
    joint = int(mechanism.spring_index[-1])  # ahead of the fulcrum: the support does not feel it
    q0 = np.zeros(tree.num_coordinates)
    q0[tree.index(machine.machine.foot.carriage_joint_name)], q0[tree.index("mount_up")] = (
        0.108,
        0.5,
    )
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q0)
    inertia, stiffness = plant.CalcMassMatrix(context)[joint, joint], mechanism.springs[-1, 0]
    omega, n = np.sqrt(stiffness / inertia), 2000
    for phase in (0.02, 0.01):
        v0 = np.zeros_like(q0)
        v0[joint] = 1e-4 * omega
        time = phase / omega * np.arange(n + 1)
        _, terms = run_of(ball, time, np.repeat(q0[None], n + 1, axis=0), v0, free=(joint,))
        energy = 0.5 * inertia * v0[joint] ** 2
        left = (1.0 + phase**2) ** -np.arange(1.0, n + 1.0)
        np.testing.assert_allclose(terms["remainder"] / energy, 1.0 - left, atol=0.51 * phase)
        assert np.abs(terms["driver_work"]).max() < 1e-12 * energy


def test_no_loss_ever_returns(ledger):
    """But at reversals, where a step's rate and the mean of two differ in sign; second order in the
    step."""
    terms = ledger(1e-3)
    for name in LOST:
        assert np.diff(terms[name], prepend=0.0).min() > -1e-4 * terms[name][-1], name


def test_carriage_works_when_the_fulcrum_moves_under_load(walker, motion):
    """Its work is counted apart and the ledger closes as well as with a resting fulcrum."""

    def path(t):
        return 0.108 + 0.03 * np.sin(2 * np.pi * (t - 0.1) / 0.6) * (t > 0.1)

    gaps = []
    for step_s in (5e-4, 2.5e-4):
        walk = walker("right").walk(
            motion("right"), fulcrum_m=path, start_s=0.0, end_s=0.94, step_s=step_s
        )
        terms = walker("right").energies(walk)
        assert np.abs(terms["carriage_work"]).max() > 0.2
        gaps.append(gap(terms))
    assert gaps[1] < 0.02
    assert gaps[0] / gaps[1] == pytest.approx(2.0, abs=0.25)
