"""The fulcrum in swing: still in stance, as far as the motor goes, energy in balance, stiffness as of the beam."""

from __future__ import annotations

import fulcrum_in_swing
import pytest

from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.parameters import FootParameters


def keel_stiffness(support, load_point):
    """N/m of keel and fulcrum, without the foam, under a load `load_point` (m) from A."""
    foot = FootParameters()
    keel = foot.keel
    bending = keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m)
    return lumped_stiffness(bending_stiffness=bending, element_lengths=keel.element_lengths_m, support=support,
                            load_point=load_point, fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m)


@pytest.fixture(scope="module")
def stride(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fulcrum_in_swing")
    return {**fulcrum_in_swing.main(folder, quick=True), "folder": folder}


def test_fulcrum_rests_in_stance_and_moves_unloaded(stride):
    assert stride["moved_in_stance"] < 1e-9
    assert stride["load_while_enabled"] == 0.0
    assert stride["swings"] == 1


def test_one_swing_moves_it_by_a_third_of_its_range(stride):
    """What three such swings need: the whole range of 85 mm."""
    assert 0.085 / 3 < stride["last"] - fulcrum_in_swing.START_M < 0.085 / 2


def test_energy_is_work_and_losses_to_the_integrator_s_accuracy(stride):
    assert stride["energy"] > 0.3
    assert stride["balance"] == pytest.approx(0.0, abs=0.02 * stride["energy"])


def test_push_off_meets_the_stiffness_of_the_overhung_keel(stride):
    """Under the forefoot's centre of pressure, which is between the load point and 10 mm behind the keel's tip."""
    at = stride["position_1"]
    assert keel_stiffness(at, 0.219) < stride["stiffness_1"] < keel_stiffness(at, 0.199)


def test_picture_is_drawn(stride):
    assert (stride["folder"] / "fulcrum_in_swing.png").stat().st_size > 2e4


@pytest.mark.slow
def test_whole_range_takes_three_strides_at_most_and_the_ground_meets_each_position(tmp_path):
    """Glanzer & Adamczyk 2018 (PMC6289620): full-scale adjustment within three strides, a moderate one within one."""
    walk = fulcrum_in_swing.main(tmp_path)
    assert walk["adjustments"] == 2
    assert walk["adjustment_1_swings"] <= 3
    assert walk["adjustment_2_swings"] == 1
    assert walk["furthest"] == pytest.approx(0.151, abs=1e-3)
    assert walk["last"] == pytest.approx(fulcrum_in_swing.BACK_M, abs=1e-3)
    assert walk["moved_in_stance"] < 1e-9
    assert 0.0 < walk["adjustment_2_energy"] < walk["adjustment_1_energy"] < 5.0
    for k in range(1, 6):
        at = walk[f"position_{k}"]
        assert keel_stiffness(at, 0.219) < walk[f"stiffness_{k}"] < keel_stiffness(at, 0.199)
