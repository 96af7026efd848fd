"""The energy ledger closes, term by term, and what is missing shrinks with the step."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.energy import INPUTS, LOST, STORED, energy_ledger, total


def ledger_of(walk, walker):
    keel = [walk.mechanism.tree.index(name) for name in walker.gait.person.foot.keel_joint_names]
    return energy_ledger(walk.mechanism, walk.record, np.array(keel), walk.fulcrum_m)


def gap(ledger):
    """Largest imbalance, as a fraction of all the energy that was lost: the smallest sum there is to compare with."""
    return float(np.abs(ledger["remainder"]).max() / total(ledger, LOST)[-1])


@pytest.fixture(scope="module")
def ledger(stance, walker):
    """ledger(step_s) of a stance of the right foot."""
    return lambda step_s: ledger_of(stance("right", step_s), walker("right"))


def test_work_of_driver_and_gravity_is_stored_or_lost(ledger):
    terms = ledger(2.5e-4)
    assert gap(terms) < 0.02
    assert total(terms, LOST)[-1] > 5.0, "the stance must lose something for the comparison to mean anything"
    assert np.ptp(terms["driver_work"]) > 20.0


def test_imbalance_is_the_steppers_own_loss_and_in_proportion_to_the_step(ledger):
    gaps = [gap(ledger(h)) for h in (1e-3, 5e-4, 2.5e-4, 1.25e-4)]
    np.testing.assert_allclose(np.array(gaps[:-1]) / gaps[1:], 2.0, atol=0.25)
    assert np.diff(ledger(2.5e-4)["remainder"]).min() > -1e-3, "an implicit step loses energy, it does not make any"


@pytest.mark.parametrize("name", LOST)
def test_no_loss_ever_returns(ledger, name):
    assert np.diff(ledger(1e-3)[name], prepend=0.0).min() > -1e-12


def test_every_loss_takes_part(ledger):
    assert all(ledger(1e-3)[name][-1] > 0.01 for name in LOST)


@pytest.mark.parametrize("name", [name for name in STORED if name.endswith("strain")])
def test_springs_store_energy_in_stance_and_give_it_back(ledger, name):
    strain = ledger(1e-3)[name]
    assert strain.max() > 0.1
    assert strain.min() > -0.02, "the socket alone is strained at the start, by the weight that hangs in it"
    assert abs(strain[-1]) < 0.02


def test_kinetic_energy_is_never_negative(stance, walker):
    walk, plant = stance("right", 1e-3), walker("right").gait.plant
    context = plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, np.concatenate((walk.record.q0, walk.record.v0)))
    start = plant.CalcKineticEnergy(context)
    assert (ledger_of(walk, walker("right"))["kinetic"] + start).min() >= 0.0


def test_gravity_works_by_the_height_of_the_centre_of_mass(ledger, stance, walker, body_weight):
    walk, plant = stance("right", 1e-3), walker("right").gait.plant
    context = plant.CreateDefaultContext()

    def height(q):
        plant.SetPositions(context, q)
        return plant.CalcCenterOfMassPositionInWorld(context)[2]

    fallen = height(walk.record.q0) - height(walk.record.q[-1])
    assert ledger(1e-3)["gravity_work"][-1] == pytest.approx(body_weight * fallen, rel=1e-9)


def test_a_person_driven_up_and_down_in_the_air_for_a_whole_period_takes_what_is_lost(walker, motion, body_weight):
    """With z_dd = A w^2 cos(w t): a load that accelerates and is paired with the rate of its step's end would be off by
    half a step of the integral of m z_dd^2, A^2 w^4 / 2 on the mean."""
    period, amplitude, step_s = 0.6, 0.1, 1e-3
    time = np.arange(0.0, 0.85, 0.01)
    values = np.tile(motion("right").values[0], (len(time), 1))
    w = 2.0 * np.pi / period
    values[:, motion("right").names.index("pelvis_ty")] = 2.0 + amplitude * np.cos(w * time)
    walk = walker("right").walk(CoordinateTrajectory(time, values, motion("right").names), fulcrum_m=0.108, start_s=0.1,
                                end_s=0.1 + period, step_s=step_s)
    terms = ledger_of(walk, walker("right"))
    assert np.ptp(terms["driver_work"]) == pytest.approx(2.0 * amplitude * body_weight, rel=0.05)
    off = 0.5 * step_s * period * body_weight / 9.81 * amplitude**2 * w**4 / 2.0
    assert abs(terms["remainder"][-1]) < 0.05 * off


def test_carriage_works_when_the_fulcrum_moves_under_load(walker, motion):
    """Its work is counted apart and the ledger closes as well as with a resting fulcrum."""
    def path(t):
        return 0.108 + 0.03 * np.sin(2 * np.pi * (t - 0.1) / 0.6) * (t > 0.1)

    gaps = []
    for step_s in (5e-4, 2.5e-4):
        walk = walker("right").walk(motion("right"), fulcrum_m=path, start_s=0.0, end_s=0.94, step_s=step_s)
        terms = ledger_of(walk, walker("right"))
        assert np.abs(terms["carriage_work"]).max() > 0.2
        gaps.append(gap(terms))
    assert gaps[1] < 0.02
    assert gaps[0] / gaps[1] == pytest.approx(2.0, abs=0.25)


def test_carriage_at_rest_does_no_work(ledger):
    assert np.all(ledger(1e-3)["carriage_work"] == 0.0)


def test_ledger_holds_the_terms_it_names(ledger):
    assert set(ledger(1e-3)) == {*INPUTS, *STORED, *LOST, "remainder"}
