"""Feet of other sizes."""

from __future__ import annotations

import pytest

from vsf_drake.analysis.bench_metrics import displacement, stiffness
from vsf_drake.analysis.intake import scale_foot
from vsf_drake.laws.beam import combined_stiffness, section_inertia
from vsf_drake.model_file import check_model
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.simulation.bench import Bench


def test_unit_ratios_change_nothing():
    assert scale_foot(FootParameters()) == FootParameters()


@pytest.mark.parametrize("ratio", [0.8, 1.2])
def test_longer_foot_is_softer_as_the_beam_says(ratio):
    """Compared at small loads with the closed form of the scaled beam, both relative to the unscaled foot."""

    def simulated(foot):
        run = Bench(foot).press(fulcrum_m=0.108 * foot.length_m / 0.245, max_load_n=210.0, speed_m_per_s=1e-3)
        return stiffness(displacement(run), run.load_n, above_n=20.0)

    def closed_form(foot):
        keel = foot.keel
        return combined_stiffness(
            bending_stiffness=keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m),
            support=0.108 * foot.length_m / 0.245, load_point=foot.load_point_m,
            fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m, series_stiffness=foot.series_stiffness_n_per_m)

    foot, scaled = FootParameters(), scale_foot(FootParameters(), length=ratio)
    assert simulated(scaled) / simulated(foot) == pytest.approx(closed_form(scaled) / closed_form(foot), rel=0.02)


def test_scaled_foot_is_still_a_foot():
    check_model(ModelParameters(foot=scale_foot(FootParameters(), length=0.9, thickness=0.9)))
