"""The cost's derivatives by every design variable against differences of walks."""

import numpy as np
import pytest

from vsf_drake.analysis.tuning.level1 import COSTS, DESIGN, WEIGHTED

SETTING = (97.3, 1.1, 0.01, 6.2)
STEPS = (1e-2, 1e-3, 1e-5, 1e-3)


@pytest.mark.parametrize("cost", [*COSTS, WEIGHTED])
def test_gradient_of_each_cost_by_each_variable_is_that_of_differences(made_tuning, cost):
    tuning = made_tuning(cost=cost, design=DESIGN)
    x = np.array(SETTING)
    exact = tuning.evaluate(x).gradient
    for p, step in enumerate(STEPS):
        ends = [tuning.evaluate(x + sign * step * np.eye(4)[p], derivatives=False).cost for sign in (1.0, -1.0)]
        central = (ends[0] - ends[1]) / (2.0 * step)
        assert exact[p] == pytest.approx(central, rel=0.01), tuning.design[p].name


def test_gradient_is_continuous_where_the_fulcrum_passes_a_joint_of_the_keel(made_tuning):
    """At 100.93 mm (facts of the nominal keel: 66 + 23.29 * 1.5 mm) the smoothed cost's slope does not jump."""
    tuning, joint = made_tuning(), 66.0 + 1.5 * 163.0 / 7.0
    slopes = [tuning.evaluate(np.array([joint + side])).gradient[0] for side in (-0.01, 0.01)]
    sharp = [tuning.without_smoothing().evaluate(np.array([joint + side])).gradient[0] for side in (-0.01, 0.01)]
    assert abs(slopes[1] - slopes[0]) < 0.05 * abs(slopes[0])
    assert abs(slopes[1] - slopes[0]) < 0.2 * abs(sharp[1] - sharp[0])


def test_the_program_gives_drake_the_cost_over_its_size_and_its_gradient(made_tuning):
    tuning = made_tuning(design=("alignment",))
    program = tuning.program()
    u = tuning.to_u(np.array([90.0, 0.01]))
    assert program.EvalBindings(program.GetAllCosts(), u)[0] == pytest.approx(tuning.scaled(u)[0], rel=1e-12)
    assert tuning.from_u(u) == pytest.approx([90.0, 0.01])
    assert tuning.scaled(u)[1] == pytest.approx(
        tuning.evaluate(tuning.from_u(u)).gradient * (tuning.high - tuning.low) / tuning.combination.size)


def test_several_trials_cost_their_mean(made_tuning):
    x = np.array([100.0])
    both = made_tuning("medium_1", "medium_2", cost="tracking").evaluate(x)
    alone = [made_tuning(name, cost="tracking").evaluate(x) for name in ("medium_1", "medium_2")]
    assert both.cost == pytest.approx(np.mean([one.cost for one in alone]), rel=1e-12)
    assert both.gradient == pytest.approx(np.mean([one.gradient for one in alone], axis=0), rel=1e-9)
