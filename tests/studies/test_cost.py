"""What a walk costs against how finely it is modelled: the walks are the right ones and the errors mean something."""

from __future__ import annotations

import pytest
from cost_against_work import measure_costs

from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.trial import load_trial

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def costs():
    trial = load_trial(embedded_trials("exact")[0])
    return measure_costs(trial, quick=True, repeats=1)


def family(costs, name):
    return [cost for cost in costs if cost.family == name]


@pytest.mark.parametrize("name", ["step", "spheres", "elements"])
def test_each_family_is_measured_against_its_finest_and_comes_closer_to_it(costs, name):
    members = family(costs, name)
    differences = [cost.difference_bw for cost in members]
    assert members[-1].against == ""
    assert differences[-1] == 0.0
    assert all(cost.against for cost in members[:-1])
    assert differences == sorted(differences, reverse=True)


def test_free_coordinates_run_from_socket_and_keel_to_everything(costs):
    """Socket 6 and keel 9 are always free; the person's 21 come on top, and the carriage stays where it is put."""
    counts = [cost.size for cost in family(costs, "free")]
    assert counts == sorted(counts)
    assert (counts[0], counts[-1]) == (15, 36)


def test_leaving_the_swinging_leg_limp_does_not_change_what_the_prosthesis_feels(costs):
    """The pelvis is prescribed: whatever hangs on its other side, the prosthetic foot sees the same motion."""
    held, *_, limp = [cost for cost in family(costs, "free") if cost.size <= 24]
    assert limp.difference_bw == pytest.approx(held.difference_bw, rel=1e-3)


def test_every_walk_converges_and_settling_is_a_part_of_it(costs):
    for cost in costs:
        assert cost.unconverged == 0
        assert 0.0 < cost.settling_s < cost.wall_s
        assert cost.stepping_per_second > 0.0
