"""Parameters of the paper's contact fit: units, initial guess, Latin hypercube."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from vsf_drake.analysis.contact_fit.options import PaperOptions
from vsf_drake.analysis.contact_fit.paper import FRICTION, PaperSpace, paper_space
from vsf_drake.analysis.contact_fit.parameters import zones_of
from vsf_drake.errors import InputError
from vsf_drake.laws.kelvin_voigt import normal_force
from vsf_drake.motion.trial_record import default_model
from vsf_drake.parameters import Subject
from vsf_drake.simulation.walk import Walker

LAW = ("stiffness", "exponent", "damping", "full_damping_depth")


@pytest.fixture(scope="module")
def variables():
    return Walker(Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right"), default_model()).variables


def test_initial_guess_is_the_papers(variables):
    """n = 1, full damping at 1 mm, b in N s/mm half of k in N/mm, one stiffness for all five zones."""
    space = paper_space(variables, 3.0, PaperOptions())
    assert len(zones_of(variables)) == 5
    assert space.names == tuple(f"contact.{zone}.{name}" for zone in zones_of(variables) for name in LAW)
    values = space.values(space.start)
    for zone in zones_of(variables):
        assert [values[f"contact.{zone}.{name}"] for name in LAW] == pytest.approx([3e3, 1.0, 1.5e3, 1e-3])


def test_sphere_a_millimetre_deep_carries_its_stiffness_whatever_the_exponent(variables):
    """Stiffness in N/mm^n; damping in N s/mm, in full at the full-damping depth."""
    space = paper_space(variables, 3.0, PaperOptions())
    for exponent in (1.0, 1.5, 2.0):
        x = np.tile([4.0, exponent, 2.5, 0.8], 5)
        values = space.values(x)
        own = {name: values[f"contact.midfoot.{name}"] for name in LAW}
        assert normal_force(1e-3, 0.0, **own) == pytest.approx(4.0)
        assert normal_force(1e-3, 1e-3, **own) == pytest.approx(4.0 + 2.5)
        assert normal_force(0.8e-3, 1e-3, **own) == pytest.approx(4.0 * 0.8**exponent + 2.5)


def test_friction_is_varied_only_if_asked_for(variables):
    assert not set(FRICTION) & set(paper_space(variables, 3.0, PaperOptions()).names)
    space = paper_space(variables, 3.0, PaperOptions(friction=True))
    values = space.values(space.start)
    assert [values[name] for name in FRICTION] == [0.5, 0.3, 0.1]


@pytest.mark.parametrize("wrong", [{"exponents": (1.1, 2.0)}, {"full_damping_mm": (2.0, 5.0)},
                                   {"full_damping_mm": (0.0, 5.0)}, {"exponents": (0.5, 2.0)},
                                   {"full_damping_mm": (0.2, 500.0)}, {"fold": 1e30}])
def test_bounds_that_leave_out_the_initial_guess_or_the_models_range_are_refused(variables, wrong):
    with pytest.raises(InputError):
        paper_space(variables, 3.0, PaperOptions(**wrong))


def two_parameters(start, low, high):
    return PaperSpace(names=("friction.mu_static", "friction.mu_kinetic"), start=np.array(start), low=np.array(low),
                      high=np.array(high))


@given(st.integers(1, 60), st.floats(0.01, 5.0), st.integers(0, 1000), st.floats(0.0, 1.0))
@settings(deadline=None, max_examples=60)
def test_each_slice_of_equal_probability_is_met_once(count, spread, seed, place):
    """The probability of what is drawn, from the definition of the normal distribution cut off at the bounds."""
    low, high = np.array([1.0, 0.2]), np.array([2.0, 30.0])
    space = two_parameters(low, low, high)
    centre = low + place * (high - low)
    drawn = space.sample(centre, count=count, spread=spread, random=np.random.default_rng(seed))
    assert drawn.shape == (count, 2)
    assert np.all((drawn >= low) & (drawn <= high))
    below, above, at = (norm.cdf((end - centre) / (spread * centre)) for end in (low, high, drawn))
    share = (at - below) / (above - below)
    if np.all(above - below > 1e-6):
        slices = np.clip(np.floor(share * count), 0, count - 1)
        edge = np.abs(share * count - np.round(share * count)) < 1e-6
        if not edge.any():
            assert np.array_equal(np.sort(slices, axis=0), np.tile(np.arange(count)[:, None], 2))


def test_columns_are_drawn_independently():
    """The correlation of 4000 independent pairs is below 4 / sqrt(4000)."""
    space = two_parameters([1.0, 1.0], [0.5, 0.5], [1.5, 1.5])
    drawn = space.sample(space.start, count=4000, spread=0.2, random=np.random.default_rng(3))
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 4 / np.sqrt(4000)
    assert drawn.mean(axis=0) == pytest.approx([1.0, 1.0], abs=1e-3)


def test_change_is_the_largest_over_the_distance_of_bounds():
    space = two_parameters([1.0, 1.0], [0.0, 0.0], [2.0, 10.0])
    assert space.change(np.array([1.0, 1.0]), np.array([1.2, 3.0])) == pytest.approx(0.2)
    assert space.change(np.array([1.0, 1.0]), np.array([0.8, 0.9])) == pytest.approx(0.1)
