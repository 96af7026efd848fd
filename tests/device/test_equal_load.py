"""The foot under an equal load with nobody on it: what a spring does whoever stands on it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.base.errors import SimulationError
from vsf_drake.device import equal_load as module
from vsf_drake.device.equal_load import at_equal_load, missed
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trial import default_model
from vsf_drake.optimal_control.outcomes import MEASURES, beyond_the_load, published_signs

SETTINGS_M = (0.066, 0.108, 0.151)


@pytest.fixture(scope="module")
def subject():
    return dataclasses.replace(embedded_study().walks[0].trial.subject, mass_kg=78.0)


@pytest.fixture(scope="module")
def rolled(subject):
    return at_equal_load(subject, default_model(), SETTINGS_M, steps=300)


def test_a_spring_under_one_load_has_six_of_the_seven_published_signs_at_every_step(rolled):
    """A softer one turns farther, stores and so returns more and faster; its centre of pressure
    stays behind, which is less moment about ankle and knee. Nobody extends a knee."""
    rows = [one.outcomes for one in rolled]
    found = published_signs(rows, every_step=True)
    assert {measure for measure, has in found.items() if has} == set(MEASURES) - {"knee extension"}
    assert found["knee extension"] is None


def test_a_load_that_is_not_quite_equal_is_told_and_steps_that_fail_make_no_null(
    subject, rolled, monkeypatch
):
    assert missed(rolled) == ""
    off = dataclasses.replace(
        rolled[2], row=dataclasses.replace(rolled[2].row, follows=False, residual_n=9.2)
    )
    told = missed([*rolled[:2], off])
    assert told.startswith(
        "the force misses the equal load by up to 9 N (fulcrum at 151 mm), more than the 1 %"
    )
    rowed = module.rolled_row

    def stuck(*arguments):
        found, curves = rowed(*arguments)
        return dataclasses.replace(found, unconverged_steps=3), curves

    monkeypatch.setattr(module, "rolled_row", stuck)
    with pytest.raises(
        SimulationError,
        match="3 steps of the foot alone with the fulcrum at 66 mm did not converge",
    ):
        at_equal_load(subject, default_model(), SETTINGS_M[:1], steps=300)


def test_moments_are_of_the_ground_s_force_by_its_arms(subject, rolled):
    """A force of a body weight, at most a foot's length from the pylon's end; about the knee, which
    is farther along a line that leans over the toe, less than about the ankle."""
    most = GRAVITY * default_model().foot.length_m
    for one in rolled:
        assert 0.0 < one.outcomes["knee_flexor_moment"] < one.outcomes["ankle_moment"] < most
        assert one.stiffness == pytest.approx(
            one.outcomes["ankle_moment"] / one.outcomes["dorsiflexion"]
        )
    stiffer = [one.stiffness for one in rolled]
    assert stiffer == sorted(stiffer)


def test_power_and_returned_energy_are_of_the_same_giving_back(subject, rolled):
    """Given back within the last 0.3 s at a rate of at most the largest one; less than was
    stored."""
    for one in rolled:
        returned = one.outcomes["returned_energy"]
        assert returned < one.outcomes["stored_energy"]
        assert returned / 0.3 < subject.mass_kg * one.outcomes["push_off_power"] < returned / 0.02


def test_what_counts_beyond_the_load_is_what_it_lacks_and_strides_have_at_every_step(rolled):
    load = [one.outcomes for one in rolled]
    strides = [
        dict(row, knee_extension=extension)
        for row, extension in zip(load, (1.0, 2.0, 3.0), strict=True)
    ]
    assert beyond_the_load(strides, load) == {"knee extension": True}
    bent = [strides[0], dict(strides[1], knee_extension=0.5), strides[2]]
    assert published_signs(bent)["knee extension"] and beyond_the_load(bent, load) == {
        "knee extension": False
    }
    back = [load[0], dict(load[1], ankle_moment=load[2]["ankle_moment"] + 1.0), load[2]]
    assert beyond_the_load(strides, back) == {"knee extension": True, "plantarflexor moment": True}
    flat = [dict.fromkeys(load[0], np.nan)] * 3
    assert set(beyond_the_load(strides, flat)) == set(MEASURES)
