"""The full model under a solution's torques: it follows them, feedback keeps it up, and who falls is said to fall."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_sagittal import embedded_walker, loaded_motion

from vsf_drake.analysis.tuning.resimulation.resimulate import drive, resimulate_with_feedback, walk_prescribed
from vsf_drake.errors import SimulationError
from vsf_drake.simulation.reactions import foot_reaction


@pytest.fixture(scope="module")
def solution():
    """A stride whose pelvis is helped by the load that the recording leaves there, as a known force."""
    return loaded_motion(80)


@pytest.fixture(scope="module")
def driven(solution):
    return resimulate_with_feedback(embedded_walker(), solution)


def pushed(coordinate, speed):
    push = np.zeros(8)
    push[coordinate] = speed
    return push


def test_loads_of_a_prescribed_walk_reproduce_it_without_feedback(solution):
    """The same equations with other unknowns: forces given, motion found. Over the middle of stance, where what grows
    from the iteration's tolerance has no time to."""
    walk = walk_prescribed(embedded_walker(), solution)
    first, steps = int(np.argmin(np.abs(walk.record.time_s - (solution.start_s + 0.4 * solution.period_s)))), 150
    columns = [walk.mechanism.tree.index(name) for name in solution.names]
    q0, v0 = walk.record.q[first - 1], walk.record.v[first - 1]
    found = drive(walk, solution.names, time_s=walk.step_s * np.arange(steps + 1),
                  feedforward=walk.record.load[first : first + steps, columns], gains=np.zeros((steps, 8, 16)),
                  states=np.hstack([walk.record.q, walk.record.v])[first - 1 : first + steps - 1][
                      :, [*columns, *(np.array(columns) + walk.record.q.shape[1])]],
                  q0=q0, v0=v0)
    assert found.fell_s is None
    np.testing.assert_allclose(found.record.q[:, columns], walk.record.q[first : first + steps, columns], atol=1e-5)
    prosthetic = slice(0, len(embedded_walker().gait.person.foot.sites.radius))
    ours = foot_reaction(found.record, prosthetic, walk.mechanism.ground_height).grf_W
    theirs = walk.prosthetic.grf_W[first : first + steps]
    assert np.abs(ours - theirs).max() < 1.0


def test_torques_and_feedback_stay_on_the_solution_s_stride(driven):
    assert not driven.fell and driven.met
    assert driven.percent_bw < 1.0
    assert max(rms for name, rms in driven.motion_rms.items() if not name.startswith("pelvis_t")) < 0.5
    assert driven.feedback.share < 0.02
    assert driven.feedback.multiplier < 1.0 < driven.feedback.open_multiplier
    assert "A HAND" not in " ".join(driven.sentences())


def test_without_a_hand_nothing_acts_on_the_pelvis(driven):
    assert driven.feedback.hand_percent_bw == driven.feedback.hand_moment_nm == 0.0


def test_finer_instants_need_less_feedback(driven):
    coarse = resimulate_with_feedback(embedded_walker(), loaded_motion(30))
    assert driven.feedback.share < 0.7 * coarse.feedback.share
    assert driven.percent_bw < coarse.percent_bw


@pytest.mark.parametrize("push", [pushed(1, 0.1), pushed(1, -0.1), pushed(0, 0.3), pushed(2, 0.05)])
def test_small_push_is_forgotten(solution, driven, push):
    """Stride by stride the linearised walk multiplies what is left of a push by a tenth."""
    found = resimulate_with_feedback(embedded_walker(), solution, strides=3, push=push)
    assert not found.fell
    assert found.percent_bw == pytest.approx(driven.percent_bw, abs=0.3)
    first = resimulate_with_feedback(embedded_walker(), solution, strides=1, push=push)
    assert first.percent_bw > found.percent_bw


def test_torques_alone_fall_and_that_cannot_be_read_as_success(solution):
    found = resimulate_with_feedback(embedded_walker(), solution, feedback=False)
    assert found.fell and not found.met
    assert 0.0 < found.fell_after_s < 2 * solution.period_s
    assert "fell after" in found.sentences()[0]
    for read in (lambda: found.percent_bw, lambda: found.difference("intact"), found.check):
        with pytest.raises(SimulationError, match="fell"):
            read()
    row = found.as_check()
    assert row.value is None and row.met is False
    later = solution.time_s > solution.start_s + found.fell_after_s
    assert np.isnan(found.grf["prosthetic"][later]).all() and not np.isnan(found.grf["prosthetic"][1]).any()


def test_run_that_diverges_is_a_fall(solution):
    """A throw that no model survives."""
    found = resimulate_with_feedback(embedded_walker(), solution, push=pushed(3, 500.0) + pushed(4, 200.0))
    assert found.fell and "diverged" in found.why
    assert "fell after" in found.sentences()[0]


def test_first_step_that_fails_is_no_run(solution):
    with pytest.raises(SimulationError, match="diverged"):
        resimulate_with_feedback(embedded_walker(), solution, push=pushed(0, 2000.0))


def test_hand_is_told_of_and_is_not_walking(solution):
    found = resimulate_with_feedback(embedded_walker(), solution, hand=True, push=pushed(1, 0.1))
    assert not found.fell
    assert found.feedback.hand_percent_bw > 0.0
    assert "A HAND HELD THE PELVIS" in " ".join(found.sentences())
    assert not found.met and found.as_check().met is False


def test_wrong_torques_show_in_motion_and_feedback(solution, driven):
    weak = dataclasses.replace(solution, torque=0.9 * solution.torque)
    found = resimulate_with_feedback(embedded_walker(), weak)
    assert not found.fell
    assert found.feedback.share > 0.05 > driven.feedback.share
    assert max(found.motion_rms.values()) > max(driven.motion_rms.values())


def test_same_run_twice_is_the_same(solution, driven):
    again = resimulate_with_feedback(embedded_walker(), solution)
    assert again.motion_rms == driven.motion_rms
    for foot, force in driven.grf.items():
        np.testing.assert_array_equal(again.grf[foot], force)


def test_single_stance_runs_once_and_has_no_multiplier(solution):
    rows = slice(10, 71)
    arrays = {name: getattr(solution, name)[rows] for name in ("time_s", "q", "v", "a", "torque", "pelvis_load")}
    single = dataclasses.replace(solution, **arrays, period_s=None, advance=None,
                                 grf={foot: force[rows] for foot, force in solution.grf.items()})
    found = resimulate_with_feedback(embedded_walker(), single)
    assert not found.fell
    assert found.feedback.multiplier is None
    assert found.difference("prosthetic").resultant < 2.0
