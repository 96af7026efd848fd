"""The factors of the sensitivity study: their ranges and how they enter the walk's variables."""

from __future__ import annotations

import math

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.analysis.validation.sensitivity_section import (
    GROUPS,
    REFERENCE_DEPTH_M,
    Factor,
    sensitivity_factors,
    values_at,
)
from vsf_drake.simulation.variables import Variable
from vsf_drake.simulation.walk import Walker


@pytest.fixture(scope="module")
def variables() -> dict[str, Variable]:
    trial = embedded_study().walks[0].trial
    return Walker(trial.subject, trial.model).variables


@pytest.fixture(scope="module")
def factors(variables) -> tuple[Factor, ...]:
    return sensitivity_factors(variables, "right")


def test_every_group_of_the_model_has_factors_with_a_reason(factors):
    assert {factor.group for factor in factors} == set(GROUPS)
    assert all(factor.why and factor.low < factor.high for factor in factors)
    assert len({factor.name for factor in factors}) == len(factors) >= 30


def test_in_the_middle_of_all_ranges_the_model_is_the_studys_own(factors, variables):
    values = values_at(factors, np.full(len(factors), 0.5), variables)
    for name, value in values.items():
        assert value == pytest.approx(variables[name].default, rel=1e-12, abs=1e-15), name


def test_the_ends_of_all_ranges_are_values_that_the_model_takes(factors, variables):
    for share in (0.0, 1.0):
        for name, value in values_at(factors, np.full(len(factors), share), variables).items():
            assert variables[name].minimum <= value <= variables[name].maximum, name


def test_shifts_are_in_si_units_and_ratios_even_in_the_logarithm(variables):
    alignment = Factor(name="alignment", group="geometry", unit="deg", low=-1.0, high=1.0, why="",
                       variables=("offset.alignment",))
    ratio = Factor(name="modulus", group="keel", unit="×", low=0.5, high=2.0, why="", kind="ratio",
                   variables=("keel.flexural_modulus",))
    values = values_at((alignment, ratio), np.array([1.0, 0.75]), variables)
    assert values["offset.alignment"] == pytest.approx(math.radians(1.0))
    assert values["keel.flexural_modulus"] == pytest.approx(variables["keel.flexural_modulus"].default * math.sqrt(2.0))


def test_a_change_of_the_exponent_keeps_the_force_at_the_reference_depth(factors, variables):
    exponent = next(factor for factor in factors if factor.kind == "exponent")
    for share in (0.0, 0.3, 1.0):
        values = values_at((exponent,), np.array([share]), variables)
        for name in exponent.variables:
            stiffness = name.replace(".exponent", ".stiffness")
            before = variables[stiffness].default * REFERENCE_DEPTH_M ** variables[name].default
            assert values[stiffness] * REFERENCE_DEPTH_M ** values[name] == pytest.approx(before)
            assert values[name] >= 1.0


def test_stiffness_and_exponent_of_a_zone_change_together(factors, variables):
    chosen = [factor for factor in factors if factor.kind == "exponent" or factor.name == "heel foam stiffness"]
    values = values_at(chosen, np.ones(2), variables)
    n, k = values["contact.heel.exponent"], values["contact.heel.stiffness"]
    stiffness, exponent = (variables[f"contact.heel.{name}"].default for name in ("stiffness", "exponent"))
    before = stiffness * REFERENCE_DEPTH_M**exponent
    assert k * REFERENCE_DEPTH_M**n == pytest.approx(1.5 * before)


def test_a_fulcrum_at_the_end_of_its_reach_moves_only_inward(factors, variables):
    fulcrum = next(factor for factor in factors if factor.name == "fulcrum position")
    found = [values_at((fulcrum,), np.array([share]), variables, {"fulcrum.shift": (0.0, 0.085)})["fulcrum.shift"]
             for share in (0.0, 0.5, 1.0)]
    np.testing.assert_allclose(found, [0.0, 2.5e-3, 5e-3])


def test_the_joint_angles_are_those_of_the_prosthetic_side(variables):
    names = {name for factor in sensitivity_factors(variables, "left") for name in factor.variables}
    assert "coordinate.hip_flexion_l" in names
    assert not any(name.endswith("_r") for name in names)
