"""A solution's motion, prescribed to the full model, gives the ground reaction of that walk and of no other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_sagittal import embedded_trial, embedded_walker, loaded_motion, walked

from vsf_drake.analysis.tuning.resimulation.resimulate import resimulate_prescribed, walk_prescribed
from vsf_drake.analysis.tuning.resimulation.trajectory import design_values
from vsf_drake.errors import InputError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.parameters import GRAVITY

FEET = ("prosthetic", "intact")


@pytest.fixture(scope="module")
def solution():
    return loaded_motion(40)


@pytest.fixture(scope="module")
def resimulation(solution):
    return resimulate_prescribed(embedded_walker(), solution)


def weight():
    return embedded_trial().subject.mass_kg * GRAVITY


def turned(solution, count):
    """The same periodic motion cut at another phase."""
    shift = solution.time_s[count] - solution.time_s[0]
    order = np.r_[count : len(solution.time_s) - 1, : count + 1]
    q = solution.q[order] - np.outer(order < count, -solution.advance)
    q[-1] = q[0] + solution.advance
    rows = {name: getattr(solution, name)[order] for name in ("v", "a", "torque", "pelvis_load")}
    return dataclasses.replace(solution, time_s=solution.time_s + shift, q=q, **rows,
                               grf={foot: force[order] for foot, force in solution.grf.items()})


def test_resimulated_force_is_that_of_the_same_walk(solution, resimulation):
    """The other way: a longer walk of two strides, read at the instants of the second."""
    walk = walked(solution, solution.start_s - solution.period_s, solution.end_s)
    for foot, reaction in zip(FEET, (walk.prosthetic, walk.intact), strict=True):
        expected = np.column_stack([np.interp(solution.time_s, walk.record.time_s, reaction.grf_W[:, i])
                                    for i in (0, 2)])
        assert np.abs(resimulation.grf[foot] - expected).max() < 2e-3 * weight()
    for foot in FEET:
        for over in ("stride", "stance"):
            assert resimulation.difference(foot, over=over, filtered=False).resultant < 0.1
    assert resimulation.met and not resimulation.fell


def test_where_the_period_is_cut_does_not_matter(solution):
    walk, other = (walk_prescribed(embedded_walker(), cut) for cut in (solution, turned(solution, 13)))
    both = (walk.record.time_s >= turned(solution, 13).start_s) & (walk.record.time_s <= solution.end_s)
    for ours, theirs in ((walk.prosthetic, other.prosthetic), (walk.intact, other.intact)):
        again = np.interp(walk.record.time_s, other.record.time_s, theirs.grf_W[:, 2])
        assert np.sqrt(np.mean((ours.grf_W[:, 2] - again)[both] ** 2)) < 2e-3 * weight()


def test_difference_is_the_error_that_was_put_in(solution):
    wrong = {"prosthetic": solution.grf["prosthetic"] + [0.0, 0.02 * weight()], "intact": solution.grf["intact"]}
    found = resimulate_prescribed(embedded_walker(), dataclasses.replace(solution, grf=wrong))
    vertical = found.difference("prosthetic", filtered=False).vertical
    assert vertical == pytest.approx(2.0, abs=0.02)
    assert found.difference("prosthetic", filtered=False).fore_aft < 0.02
    assert found.difference("intact", filtered=False).resultant < 0.02
    assert f"{found.percent_bw:.1f} %" in found.sentences()[0]


def test_filtered_series_is_the_low_passed_walk(solution, resimulation):
    walk = walked(solution, solution.start_s - solution.period_s, solution.end_s + 0.2)
    smooth = low_pass(walk.prosthetic.grf_W[:, 2], rate_hz=1e3, cutoff_hz=40.0)
    expected = np.interp(solution.time_s, walk.record.time_s, smooth)
    assert np.abs(resimulation.filtered_grf["prosthetic"][:, 1] - expected).max() < 3e-3 * weight()


def part(solution, rows):
    """Some instants, as a motion that is not periodic."""
    arrays = {name: getattr(solution, name)[rows] for name in ("time_s", "q", "v", "a", "torque")}
    grf = {foot: force[rows] for foot, force in solution.grf.items()}
    return dataclasses.replace(solution, **arrays, grf=grf, period_s=None, advance=None, pelvis_load=None)


def test_single_stance_leaves_out_the_transient_of_its_start(solution):
    single = part(solution, slice(5, 36))
    assert single.grf["prosthetic"][0, 1] == 0.0
    found = resimulate_prescribed(embedded_walker(), single)
    assert np.isnan(found.grf["prosthetic"][~found.counted]).all()
    assert found.counted.sum() == np.sum(single.time_s >= single.time_s[0] + 0.03)
    assert found.difference("prosthetic", filtered=False).resultant < 0.1


def test_foot_that_stands_at_the_start_is_told_of(solution):
    """Friction there depends on the past: what a creep law forgets slowly, a run that starts late does not have."""
    found = resimulate_prescribed(embedded_walker(), part(solution, slice(13, 31)))
    late = found.difference("prosthetic", filtered=False)
    assert late.fore_aft > 5.0 * late.vertical
    assert any("prosthetic foot stood on the ground" in sentence for sentence in found.sentences())
    assert not any("intact foot stood" in sentence for sentence in found.sentences())


def test_values_reach_the_walk(solution):
    stiffer = dataclasses.replace(solution, values={"fulcrum.shift": 0.03})
    assert resimulate_prescribed(embedded_walker(), stiffer).difference("prosthetic").resultant > 1.0


def test_other_side_is_refused(solution):
    swapped = {"_r": "_l", "_l": "_r"}
    names = tuple(n if n.startswith("pelvis") else n[:-2] + swapped[n[-2:]] for n in solution.names)
    with pytest.raises(InputError, match="prosthesis on the right"):
        resimulate_prescribed(embedded_walker(), dataclasses.replace(solution, names=names))


def test_design_of_the_device_reaches_springs_and_contact():
    """A leaf twice as thick bends an eighth as much; the heel's zones and no others change with the heel."""
    walker = embedded_walker()
    values = design_values(walker, heel_stiffness=1.5, alignment_rad=0.02, keel_thickness=2.0)
    for name, value in values.items():
        default = walker.variables[name].default
        assert value == {"keel.flexural_modulus": 8.0 * default, "offset.alignment": 0.02}.get(name, 1.5 * default)
    heel = {name for name in values if name.startswith("contact")}
    assert heel and all(name.startswith("contact.heel") and name.endswith("stiffness") for name in heel)
    assert design_values(walker) == {}


def test_offsets_reach_the_walk(solution, resimulation):
    """By the two ways that a walk takes them."""
    lower = dataclasses.replace(solution, offsets=GeometricOffsets(height_m=-0.005))
    by_value = dataclasses.replace(solution, values={"offset.height": -0.005})
    first, second = (resimulate_prescribed(embedded_walker(), t) for t in (lower, by_value))
    np.testing.assert_allclose(first.grf["prosthetic"], second.grf["prosthetic"], atol=1e-6)
    assert np.abs(first.grf["prosthetic"] - resimulation.grf["prosthetic"]).max() > 0.05 * weight()


def test_solution_whose_torques_alternate_is_told_of(solution):
    ringing = dataclasses.replace(solution, torque=solution.torque + 80.0 * (-1.0) ** np.arange(41)[:, None])
    found = resimulate_prescribed(embedded_walker(), ringing)
    assert any("from instant to instant" in sentence for sentence in found.sentences())
    assert not any("from instant to instant" in s
                   for s in resimulate_prescribed(embedded_walker(), loaded_motion(80)).sentences())
