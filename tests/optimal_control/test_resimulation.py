"""Solutions carried out by the full model: the motion between their instants, prescribed, and under
torques."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from made_sagittal import embedded_trial, embedded_walker, loaded_motion, walked
from scipy.linalg import solve_discrete_are

from vsf_drake.base.errors import FitError, InputError, SimulationError
from vsf_drake.collocation.problem import Grid, Layout
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.optimal_control import resimulate as module
from vsf_drake.optimal_control.resimulate import (
    drive,
    linear_steps,
    multiplier,
    regulator,
    resimulate_prescribed,
    resimulate_with_feedback,
    walk_prescribed,
)
from vsf_drake.optimal_control.trajectory import (
    SagittalTrajectory,
    SolutionMotion,
    solved_trajectory,
    whole_motion,
)
from vsf_drake.simulation.reactions import PROSTHETIC, foot_reaction
from vsf_drake.simulation.sagittal.model import DESIGN, sagittal_coordinates

FEET = ("prosthetic", "intact")


@pytest.fixture(scope="module")
def solution():
    return loaded_motion(40)


@pytest.fixture(scope="module")
def fine():
    """A stride whose pelvis is helped by the load that the recording leaves there, as a known
    force. At 160 instants, 8 ms apart: the strike on the stiff support is too quick for 16 ms, at
    which the feedback has to mend torques that were read too seldom (by 6 % of their size, against
    2 % at 160)."""
    return loaded_motion(160)


@pytest.fixture(scope="module")
def resimulation(solution):
    return resimulate_prescribed(embedded_walker(), solution)


@pytest.fixture(scope="module")
def driven(fine):
    return resimulate_with_feedback(embedded_walker(), fine)


@pytest.fixture(scope="module")
def walk(solution):
    return walk_prescribed(embedded_walker(), solution)


def weight():
    return embedded_trial().subject.mass_kg * GRAVITY


# Between the instants of a solution its motion is what position, velocity and acceleration say.


def trajectory(time, states, **changes):
    n = len(time)
    given = dict(
        time_s=time,
        names=sagittal_coordinates("left"),
        q=states[0],
        v=states[1],
        a=states[2],
        fulcrum_m=0.1,
        advance=states[0][-1] - states[0][0],
        torque=np.zeros((n, 5)),
        grf={foot: np.zeros((n, 2)) for foot in FEET},
    )
    return SagittalTrajectory(**(given | changes))


def test_polynomials_of_degree_five_are_reproduced():
    def quintic(t):
        c = np.random.default_rng(3).normal(size=(6, 8))
        powers = [
            np.array(
                [
                    np.prod(np.arange(k - d + 1, k + 1)) * t ** max(k - d, 0) if k >= d else 0 * t
                    for k in range(6)
                ]
            )
            for d in range(3)
        ]
        return tuple(p.T @ c for p in powers)

    time, t = np.array([0.0, 0.4, 0.55, 1.0]), np.linspace(0.0, 0.999, 37)
    for ours, exact in zip(
        SolutionMotion(trajectory(time, quintic(time))).sample(t), quintic(t), strict=True
    ):
        np.testing.assert_allclose(ours, exact, atol=1e-10)


def test_a_period_further_on_the_person_is_a_stride_ahead_and_out_of_the_plane_nothing_moves():
    time, ahead = np.linspace(0.0, 1.2, 41), 1.4 * np.eye(8)[1]
    turn, w = 2 * np.pi * time[:, None] / 1.2 + np.arange(8), 2 * np.pi / 1.2
    states = (
        np.sin(turn) + np.outer(time / 1.2, ahead),
        w * np.cos(turn) + ahead / 1.2,
        -(w**2) * np.sin(turn),
    )
    motion, t = SolutionMotion(trajectory(time, states)), np.linspace(-0.5, 2.0, 23)
    now, later = motion.sample(t), motion.sample(t + 2.4)
    np.testing.assert_allclose(later[0] - now[0], np.tile(2 * ahead, (len(t), 1)), atol=1e-9)
    np.testing.assert_allclose(later[1], now[1], atol=1e-8)
    np.testing.assert_allclose(later[2], now[2], atol=1e-6)
    whole = whole_motion(
        motion, ("pelvis_tz", "pelvis_list", *motion.trajectory.names, "ankle_rotation_l"), 0.2, 0.9
    )
    t = np.linspace(0.2, 0.9, 20)
    for ours, exact, tolerance in zip(
        whole.sample(t), motion.sample(t), (1e-9, 1e-7, 1e-3), strict=True
    ):
        np.testing.assert_allclose(ours[:, 2:10], exact, atol=tolerance)
        assert not ours[:, [0, 1, 10]].any()


def test_torques_between_instants_follow_a_smooth_curve_to_fourth_order():
    def error(count):
        t, dense = np.linspace(0.0, 1.0, count + 1), np.linspace(-1.0, 2.0, 301)
        loads = SolutionMotion(
            trajectory(
                t,
                [np.zeros((count + 1, 8))] * 3,
                torque=np.outer(np.sin(2 * np.pi * t), np.ones(5)),
            )
        ).loads(dense)
        assert not loads[:, :3].any()
        return np.abs(loads[:, 3:] - np.sin(2 * np.pi * dense)[:, None]).max()

    assert error(20) / error(40) == pytest.approx(16.0, rel=0.2)


def test_torques_that_alternate_are_told_from_smooth_ones():
    """Of a pure alternation all counts; of a sine with n instants a period, (1 - cos(2 pi / n)) /
    2."""
    t = np.linspace(0.0, 1.0, 41)

    def of(series):
        return trajectory(
            t, [np.zeros((41, 8))] * 3, torque=np.outer(series, np.ones(5))
        ).alternation

    assert of((-1.0) ** np.arange(41)) == pytest.approx(1.0)
    assert of(np.sin(2 * np.pi * 4 * t)) == pytest.approx(
        0.5 * (1.0 - np.cos(2 * np.pi / 10)), rel=0.05
    )
    assert of(0.0 * t) == 0.0


# A solved problem is handed over column by column, with the device that it found.


def test_outputs_variables_and_device_are_the_solution_s(solution):
    """A solution that says of every output which it is, with the motion of a known stride."""
    grid = Grid(method="trapezoidal", intervals=40, duration_s=solution.period_s)
    layout = Layout(coordinates=solution.names, quasi_static=("socket_tx",))
    names = [
        "balance_pelvis_tx",
        *(f"power_{n}" for n in solution.names[3:]),
        *(f"torque_{n}" for n in reversed(solution.names[3:])),
        "intact_fx",
        "intact_fz",
        "intact_my",
        "prosthetic_fz",
        "prosthetic_fx",
    ]
    z = np.zeros((grid.instants, layout.size))
    for kind in ("q", "v", "a"):
        z[:, getattr(layout, kind)] = getattr(solution, kind)[:-1]
    y = np.arange(len(names)) + 100.0 * np.arange(grid.instants)[:, None]
    problem = SimpleNamespace(
        layout=layout, grid=grid, advance=solution.advance, design=SimpleNamespace(names=DESIGN)
    )
    end = SimpleNamespace(problem=problem, z=z, p=np.array([0.12, 1.2, 0.01, 0.9]), y=lambda: y)
    given = solved_trajectory(end, embedded_walker(), outputs=names)
    for name in ("time_s", "q", "v", "a"):
        np.testing.assert_allclose(
            getattr(given, name) - getattr(given, name)[0],
            getattr(solution, name) - getattr(solution, name)[0],
            atol=1e-9,
        )
    np.testing.assert_array_equal(
        given.torque[7], [names.index(f"torque_{n}") + 700.0 for n in solution.names[3:]]
    )
    np.testing.assert_array_equal(given.torque[-1], given.torque[0])
    for foot in FEET:
        np.testing.assert_array_equal(
            given.grf[foot][[0, -1]], [[names.index(f"{foot}_fx"), names.index(f"{foot}_fz")]] * 2
        )
    modulus = embedded_walker().variables["keel.flexural_modulus"].default
    assert given.fulcrum_m == 0.12 and given.values["offset.alignment"] == 0.01
    assert given.values["keel.flexural_modulus"] == pytest.approx(0.9**3 * modulus)
    heel = {name: value for name, value in given.values.items() if name.startswith("contact")}
    assert len(heel) == 3 and all(
        name.startswith("contact.heel")
        and value == pytest.approx(1.2 * embedded_walker().variables[name].default)
        for name, value in heel.items()
    )


# Its motion, prescribed to the full model, gives the ground reaction of that walk and of no other.


def test_resimulated_force_is_that_of_the_same_walk_low_passed(solution, resimulation):
    """The other way: a longer walk of two strides, read at the instants of the second."""
    walk = walked(solution, solution.start_s - solution.period_s, solution.end_s + 0.2)
    for foot, reaction in zip(FEET, (walk.prosthetic, walk.intact), strict=True):
        smooth = low_pass(reaction.grf_W, rate_hz=1e3, cutoff_hz=40.0)
        expected = np.column_stack(
            [np.interp(solution.time_s, walk.record.time_s, smooth[:, i]) for i in (0, 2)]
        )
        assert np.abs(resimulation.grf[foot] - expected).max() < 3e-3 * weight()
    assert resimulation.met and not resimulation.fell


def test_difference_is_the_error_that_was_put_in(solution, resimulation):
    """A foot's force longer by 2 % of body weight at every instant."""

    def longer(force):
        size = np.linalg.norm(force, axis=1, keepdims=True)
        return force + 0.02 * weight() * np.where(
            size > 1e-6, force / np.maximum(size, 1e-6), [0.0, 1.0]
        )

    wrong = {
        "prosthetic": longer(resimulation.grf["prosthetic"]),
        "intact": resimulation.grf["intact"],
    }
    run = dataclasses.replace(resimulation, trajectory=dataclasses.replace(solution, grf=wrong))
    assert run.difference("prosthetic") == pytest.approx(2.0, rel=1e-7) == run.percent_bw
    assert run.difference("intact") == 0.0
    assert run.met and not dataclasses.replace(run, body_weight_n=0.6 * weight()).met, (
        "3 % are allowed"
    )


def test_values_and_offsets_reach_the_walk_and_another_side_is_refused(solution, resimulation):
    walker = embedded_walker()
    stiffer = dataclasses.replace(solution, values={"fulcrum.shift": 0.03})
    assert resimulate_prescribed(walker, stiffer).difference("prosthetic") > 1.0
    own = solution.offsets
    lower = dataclasses.replace(
        solution, offsets=dataclasses.replace(own, height_m=own.height_m - 0.005)
    )
    by_value = dataclasses.replace(solution, values={"offset.height": -0.005})
    first, second = (resimulate_prescribed(walker, given) for given in (lower, by_value))
    np.testing.assert_allclose(first.grf["prosthetic"], second.grf["prosthetic"], atol=1e-6)
    assert np.abs(first.grf["prosthetic"] - resimulation.grf["prosthetic"]).max() > 0.05 * weight()
    with pytest.raises(InputError, match="prosthesis on the right"):
        resimulate_prescribed(
            walker, dataclasses.replace(solution, names=sagittal_coordinates("left"))
        )


# Under its torques the model follows it, feedback keeps it up, and who falls is said to fall.


def pushed(coordinate, speed):
    return speed * np.eye(8)[coordinate]


def test_loads_of_a_prescribed_walk_reproduce_it_without_feedback(fine):
    """The same equations with other unknowns: forces given, motion found. Over the middle of
    stance, before the intact foot strikes, where what grows from the iteration's tolerance has no
    time to."""
    walk = walk_prescribed(embedded_walker(), fine)
    record, steps = walk.record, 150
    first = int(np.argmin(np.abs(record.time_s - (fine.start_s + 0.35 * fine.period_s))))
    columns, rows = (
        [walk.mechanism.tree.index(name) for name in fine.names],
        slice(first, first + steps),
    )
    states = np.hstack([record.q[:, columns], record.v[:, columns]])[first - 1 : first + steps - 1]
    run = drive(
        walk,
        fine.names,
        time_s=walk.step_s * np.arange(steps + 1),
        feedforward=record.load[rows, columns],
        gains=np.zeros((steps, 8, 16)),
        states=states,
        q0=record.q[first - 1],
        v0=record.v[first - 1],
    )
    assert run.fell_s is None
    np.testing.assert_allclose(run.record.q[:, columns], record.q[rows, columns], atol=1e-5)
    ours = foot_reaction(run.record, PROSTHETIC, walk.mechanism.ground_height).grf_W
    assert np.abs(ours - walk.prosthetic.grf_W[rows]).max() < 1.0


def test_torques_and_feedback_stay_on_the_solution_s_stride(driven, fine):
    """Within what is asked of the prescribed walk, and nearer than laboratories tell a motion
    (1 mm, 0.5°: choices)."""
    assert not driven.fell and driven.percent_bw < module.TARGET_PERCENT_BW
    assert driven.motion_rms["pelvis_ty"] < 1.0
    assert (
        max(rms for name, rms in driven.motion_rms.items() if not name.startswith("pelvis_t")) < 0.5
    )
    assert driven.feedback.share < 0.03
    assert driven.feedback.multiplier < 1.0 < driven.feedback.open_multiplier


def test_wrong_torques_need_more_feedback(fine, driven):
    weak = resimulate_with_feedback(
        embedded_walker(), dataclasses.replace(fine, torque=0.9 * fine.torque)
    )
    assert not weak.fell and weak.feedback.share > 0.05 > driven.feedback.share
    more = dataclasses.replace(driven.feedback, share=1.01 * module.MOST_FEEDBACK)
    assert driven.met and not dataclasses.replace(driven, feedback=more).met, (
        "a stride that feedback makes is not met"
    )
    assert max(weak.motion_rms.values()) > max(driven.motion_rms.values())


@pytest.mark.parametrize(
    "push", [pushed(1, 0.02), pytest.param(pushed(2, 0.05), marks=pytest.mark.slow)]
)
def test_small_push_is_forgotten(fine, driven, push):
    """Stride by stride the linearised walk multiplies what is left of a push by the largest of its
    multipliers: against the same strides without it, since they too differ from one another in
    their strikes. Of four multiplications two are asked: at first a push is large enough to move
    the strikes, which no linear walk knows.
    """

    def left(strides):
        runs = [
            resimulate_with_feedback(embedded_walker(), fine, strides=strides, push=given)
            for given in (push, None)
        ]
        assert not any(run.fell for run in runs)
        return (
            max(np.sqrt(np.nanmean((runs[0].grf[foot] - runs[1].grf[foot]) ** 2)) for foot in FEET)
            / weight()
        )

    assert left(5) < driven.feedback.multiplier**2 * left(1)


def test_torques_alone_fall_and_that_cannot_be_read_as_success(fine):
    run = resimulate_with_feedback(embedded_walker(), fine, feedback=False)
    assert run.fell and not run.met
    assert 0.0 < run.fell_after_s < 2 * fine.period_s and "fell after" in run.sentences()[0]
    with pytest.raises(SimulationError, match="fell"):
        _ = run.percent_bw
    row = run.as_check()
    assert row.value is None and row.met is False
    later = fine.time_s > fine.start_s + run.fell_after_s
    assert (
        np.isnan(run.grf["prosthetic"][later]).all()
        and not np.isnan(run.grf["prosthetic"][1]).any()
    )


def test_a_run_that_diverges_is_a_fall_and_a_first_step_that_fails_no_run(fine):
    """A throw that no model survives."""
    run = resimulate_with_feedback(embedded_walker(), fine, push=pushed(4, 300.0))
    assert run.fell and "diverged" in run.why and "fell after" in run.sentences()[0]
    with pytest.raises(SimulationError, match="diverged"):
        resimulate_with_feedback(embedded_walker(), fine, push=pushed(0, 2000.0))


def test_a_run_that_ends_after_one_step_is_none(solution, walk, monkeypatch):
    """Its force cannot be low-passed; a tuning tells it as any other run that fails."""
    whole = module.Stepper.run

    def second_step_fails(self, inputs, *state, **how):
        if how:
            raise SimulationError("diverged", time_s=inputs.time_s[2])
        return whole(self, inputs, *state)

    monkeypatch.setattr(module.Stepper, "run", second_step_fails)
    record, columns = walk.record, [walk.mechanism.tree.index(name) for name in solution.names]
    with pytest.raises(SimulationError, match="ended after its first step: diverged"):
        drive(
            walk,
            solution.names,
            time_s=walk.step_s * np.arange(4),
            feedforward=record.load[:3, columns],
            gains=np.zeros((3, 8, 16)),
            states=np.zeros((3, 16)) + np.r_[record.q0[columns], record.v0[columns]],
            q0=record.q0,
            v0=record.v0,
        )


# The linear model of a walk answers small changes as the stepper does, where no sphere slides off
# or lands.


STEPS, SMALL_Q, SMALL_V, SMALL_TORQUE = 12, 1e-6, 1e-4, 1e-2


@pytest.mark.parametrize("phase", [0.4, 0.75])  # the prosthetic, the intact foot alone on the floor
def test_linear_answer_is_the_limit_of_the_stepper_s(solution, walk, phase):
    """End of STEPS steps under the loads that prescribed the walk, from another start or with more
    torque."""
    record, tree, names = walk.record, walk.mechanism.tree, solution.names
    first = int(np.argmin(np.abs(record.time_s - (solution.start_s + phase * solution.period_s))))
    columns = [tree.index(name) for name in names]
    free = [
        i
        for i, name in enumerate(tree.coordinate_names)
        if name in names or name.startswith(("socket", "keel"))
    ]
    f, q0, v0 = len(free), record.q[first - 1].copy(), record.v[first - 1].copy()

    def end(dq=0.0, dv=0.0, more=0.0):
        run = drive(
            walk,
            names,
            time_s=walk.step_s * np.arange(STEPS + 1),
            gains=np.zeros((STEPS, 8, 16)),
            feedforward=record.load[first : first + STEPS, columns] + more,
            states=np.zeros((STEPS, 16)) + np.r_[q0[columns], v0[columns]],
            q0=q0 + dq,
            v0=v0 + dv,
        ).record
        return np.concatenate([run.q[-1, free], run.v[-1, free]])

    np.testing.assert_allclose(end()[:f], record.q[first + STEPS - 1, free], atol=1e-8)
    transition, by_torque = np.eye(2 * f), np.zeros((2 * f, 8))
    steps = linear_steps(walk, names, first, first + STEPS)
    np.testing.assert_allclose(steps.whole[:, steps.person], np.tile(np.eye(16), (STEPS, 1, 1)))
    for A, B in zip(steps.A, steps.B, strict=True):
        transition, by_torque = A @ transition, A @ by_torque + B
    rng = np.random.default_rng(2)
    dx = np.concatenate([SMALL_Q * rng.normal(size=f), SMALL_V * rng.normal(size=f)])
    dq, dv, more = np.zeros_like(q0), np.zeros_like(v0), SMALL_TORQUE * rng.normal(size=8)
    dq[free], dv[free] = dx[:f], dx[f:]
    for expected, change in (
        (transition @ dx, {"dq": dq, "dv": dv}),
        (by_torque @ more, {"more": more}),
    ):
        ahead, behind = (
            end(**{name: sign * value for name, value in change.items()}) for sign in (1, -1)
        )
        assert np.linalg.norm((ahead - behind) / 2 - expected) < 0.01 * np.linalg.norm(expected)


# The regulator is the one of closed forms and of an independent Riccati solver.


def repeated(matrix, count):
    return np.repeat(np.asarray(matrix, dtype=float)[None], count, axis=0)


def test_inverted_pendulum_has_the_gains_of_the_continuous_problem():
    """theta'' = w^2 theta + u with cost theta^2 q + u^2: k1 = w^2 + sqrt(w^4 + q), k2 = sqrt(2
    k1)."""
    w2, q, h = 9.81, 400.0, 1e-4
    A, B = np.eye(2) + h * np.array([[0.0, 1.0], [w2, 0.0]]), h * np.array([[0.0], [1.0]])
    K, _ = regulator(repeated(A, 20000), repeated(B, 20000), h * np.diag([q, 0.0]), h * np.eye(1))
    k1 = w2 + np.sqrt(w2**2 + q)
    np.testing.assert_allclose(K[0, 0], [k1, np.sqrt(2 * k1)], rtol=2e-3)
    assert multiplier(repeated(A - B @ K[0], 10)) < 1.0 < multiplier(repeated(A, 10))


def test_constant_system_has_the_algebraic_gain_and_where_a_period_begins_does_not_matter():
    rng = np.random.default_rng(8)
    A, B, Q, R = rng.normal(size=(4, 4)), rng.normal(size=(4, 2)), np.eye(4), np.diag([1.0, 3.0])
    P = solve_discrete_are(A, B, Q, R)
    K, cost = regulator(repeated(A, 5), repeated(B, 5), Q, R)
    np.testing.assert_allclose(cost, P, rtol=1e-5)
    np.testing.assert_allclose(
        K[3], np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A), rtol=1e-4, atol=1e-6
    )
    A, B = 1.3 * rng.normal(size=(6, 3, 3)), rng.normal(size=(6, 3, 1))
    K, _ = regulator(A, B, np.eye(3), np.eye(1))
    later, _ = regulator(np.roll(A, 2, axis=0), np.roll(B, 2, axis=0), np.eye(3), np.eye(1))
    np.testing.assert_allclose(np.roll(K, 2, axis=0), later, rtol=1e-4, atol=1e-6)
    assert multiplier(A - B @ K) < 1.0 < multiplier(A)


def test_what_cannot_be_stabilised_is_told_and_multipliers_are_of_the_steps_in_their_order():
    A, B = np.diag([1.5, 0.5]), np.array([[0.0], [1.0]])
    with pytest.raises(FitError, match=r"hardly controllable|no feedback"):
        regulator(repeated(A, 10), repeated(B, 10), np.eye(2), np.eye(1))
    first, then = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0, 0.0], [3.0, 0.0]])
    assert multiplier(np.stack([first, then])) == pytest.approx(3.0)
    assert multiplier(np.stack([first, first])) == 0.0
