"""Studies of the foot: calibrated to the bench, in more pieces, and what finer modelling costs."""

from __future__ import annotations

import dataclasses
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from calibrate_device import calibrate_device, with_compliances
from cost_against_work import measure_costs
from pydrake.multibody.plant import MultibodyPlant
from refined_spheres import fill, with_spheres
from scipy.spatial import ConvexHull

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.device.bench_metrics import (
    TUNED_JOINTS_N_PER_M,
    bench_table,
    displacement,
    stiffness,
)
from vsf_drake.laws.beam import combined_stiffness, lumped_stiffness, section_inertia
from vsf_drake.model.model_file import check_model, foam_under_load, load_model
from vsf_drake.model.parameters import FootParameters, ModelParameters
from vsf_drake.motion.trial import load_trial
from vsf_drake.plants.foot import add_foot, with_elements
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S, Bench, run_bench
from vsf_drake.walks.embedded import embedded_trials


@pytest.fixture(scope="module")
def nominal():
    return load_model(resource("models/nominal.yaml"))


def test_shipped_model_is_the_default_and_its_forefoot_has_the_bench_foams_stiffness(nominal):
    assert nominal == ModelParameters()
    foot = nominal.foot
    low, high = (
        foot.load_point_m - 0.5 * foot.series_patch_m,
        foot.load_point_m + 0.5 * foot.series_patch_m,
    )
    total = sum(zone.stiffness for zone in foot.zones for x in zone.x_mm if low <= 1e-3 * x <= high)
    assert total == pytest.approx(foot.series_stiffness_n_per_m, rel=1e-12)
    assert foam_under_load(foot) == pytest.approx((total, 1.0))


@pytest.mark.parametrize(
    ("soft", "modulus_pa", "support_n_per_m"), [("keel", 9e9, 2e6), ("support", 18.6e9, 250e3)]
)
def test_calibration_recovers_compliances_that_made_the_data(soft, modulus_pa, support_n_per_m):
    guess = {"modulus_pa": 18.6e9, "support_n_per_m": 2e6, "series_n_per_m": 60e3}
    truth = guess | {
        "modulus_pa": modulus_pa,
        "support_n_per_m": support_n_per_m,
        "series_n_per_m": 50e3,
    }
    guess |= {"modulus_pa": 7e9} if soft == "keel" else {"support_n_per_m": 200e3}
    bench, measured = Bench(with_compliances(FootParameters(), **truth)), {}
    for fulcrum_m in (0.066, 0.151):
        run = bench.press(
            fulcrum_m=fulcrum_m, max_load_n=600.0, speed_m_per_s=PUBLISHED_SPEED_M_PER_S
        )
        measured[fulcrum_m] = stiffness(displacement(run), run.load_n)
    found = calibrate_device(
        with_compliances(FootParameters(), **guess), soft=soft, measured=measured
    )
    assert found.keel.flexural_modulus_pa == pytest.approx(modulus_pa, rel=1e-3)
    assert found.fulcrum.stiffness_n_per_m == pytest.approx(support_n_per_m, rel=1e-3)
    assert found.series_stiffness_n_per_m == pytest.approx(50e3, rel=1e-3)
    with pytest.raises(InputError, match="two or more"):
        calibrate_device(FootParameters(), soft=soft, measured={0.066: 10e3})


def test_nominal_bench_meets_the_published_ends_and_between_them_the_tuned_joints(nominal):
    """Bands: 3 % at the soft end, 0.5 N/mm at the stiff one, 0.8 N/mm in between; at the heel 2 of
    65 N/mm."""
    table = bench_table(run_bench(nominal))
    found = {row.fulcrum_mm: row.stiffness_n_per_mm for row in table.settings}
    assert found[66] == pytest.approx(10.0, abs=0.3) and found[151] == pytest.approx(32.0, abs=0.5)
    for fulcrum_mm in (87, 108, 129):
        assert found[fulcrum_mm] == pytest.approx(
            1e-3 * TUNED_JOINTS_N_PER_M[fulcrum_mm / 1000], abs=0.8
        )
    assert table.heel_stiffness_n_per_mm == pytest.approx(65.0, abs=2.0)


def test_support_of_the_nominal_foot_sinks_less_than_a_millimetre_and_that_of_the_other_ten(
    nominal,
):
    """Moments about A: the support bears F x_load / x_fulcrum, 1.81 kN of 600 N."""
    reaction = 600.0 * 0.199 / 0.066
    assert reaction / nominal.foot.fulcrum.stiffness_n_per_m < 1e-3
    other = load_model(resource("models/soft_support.yaml")).foot
    assert reaction / other.fulcrum.stiffness_n_per_m == pytest.approx(10e-3, abs=0.5e-3)
    assert other.keel.flexural_modulus_pa == 18.6e9


@pytest.mark.slow
def test_study_writes_the_shipped_models_again(tmp_path, monkeypatch):
    study = Path(__file__).resolve().parents[2] / "studies" / "calibrate_device.py"
    monkeypatch.setattr(sys, "argv", [str(study), "--quick", "--out", str(tmp_path)])
    runpy.run_path(str(study), run_name="__main__")
    for name in ("nominal.yaml", "soft_support.yaml"):
        assert (tmp_path / name).read_text() == resource(f"models/{name}").read_text()


# The same foot in more pieces.


FOOT = FootParameters()
SUPPORT_M = 0.108


def beam(foot):
    """What the closed forms need to know of a foot on the bench."""
    keel = foot.keel
    return {
        "bending_stiffness": keel.flexural_modulus_pa
        * section_inertia(keel.width_m, keel.thickness_m),
        "support": SUPPORT_M,
        "load_point": foot.load_point_m,
        "fulcrum_stiffness": foot.fulcrum.stiffness_n_per_m,
        "series_stiffness": foot.series_stiffness_n_per_m,
    }


def moving_mass(foot):
    plant = MultibodyPlant(0.0)
    handles = add_foot(plant, plant.world_frame(), foot)
    plant.Finalize()
    return plant.CalcTotalMass(plant.CreateDefaultContext()), sum(
        body.default_mass() for body in handles.keel
    )


def hull_area(zone):
    return ConvexHull(np.column_stack([zone.x_mm, zone.y_mm])).volume


def test_more_elements_are_the_same_keel():
    assert with_elements(FOOT, 8) == FOOT
    finer = with_elements(FOOT, 64)
    check_model(ModelParameters(foot=finer))
    assert len(finer.keel.element_lengths_m) == 64
    assert sum(finer.keel.element_lengths_m) == pytest.approx(
        sum(FOOT.keel.element_lengths_m), abs=1e-15
    )
    assert moving_mass(finer) == pytest.approx(moving_mass(FOOT), rel=1e-12)
    assert dataclasses.replace(finer, keel=FOOT.keel) == FOOT


def midpoint_bound(lengths):
    """Largest error (1/N m times E I) of the midpoint rule for the integral of M², with M per unit
    load.

    M² has the second derivative 2 M'², which costs at most 2 M'² L³ / 24 an element; its slope
    jumps at B by 2 a (a / l + 1), which costs at most a jump times L² / 8 in the element that holds
    B.
    """
    lengths = np.array(lengths)
    overhang = FOOT.load_point_m - SUPPORT_M
    ends = np.cumsum(lengths)
    slope = np.where(ends - 0.5 * lengths < SUPPORT_M, overhang / SUPPORT_M, 1.0)
    kinked = lengths[np.searchsorted(ends, SUPPORT_M)]
    at_load = lengths[np.searchsorted(ends, FOOT.load_point_m)]
    smooth = np.sum(2.0 * np.maximum(slope, 1.0) ** 2 * lengths**3) / 24.0
    return (
        smooth + 2.0 * overhang * (overhang / SUPPORT_M + 1.0) * kinked**2 / 8.0 + at_load**3 / 3.0
    )


def test_more_elements_converge_to_the_beam_as_the_midpoint_rule_does():
    exact, bounds = combined_stiffness(**beam(FOOT)), []
    for elements in (8, 16, 32, 64, 128):
        lengths = with_elements(FOOT, elements).keel.element_lengths_m
        error = 1.0 / lumped_stiffness(**beam(FOOT), element_lengths=lengths) - 1.0 / exact
        bounds.append(midpoint_bound(lengths))
        assert abs(error) * beam(FOOT)["bending_stiffness"] <= bounds[-1]
    assert np.all(np.array(bounds[:-1]) > 3.9 * np.array(bounds[1:]))


def test_more_spheres_are_the_same_sole():
    assert with_spheres(FOOT, 24) == FOOT
    finer = with_spheres(FOOT, 50)
    check_model(ModelParameters(foot=finer))
    assert sum(len(zone.x_mm) for zone in finer.zones) == 50
    assert moving_mass(finer) == moving_mass(FOOT)
    for zone, before in zip(finer.zones, FOOT.zones, strict=True):
        for name in ("stiffness", "damping_n_s_per_m"):
            total = getattr(zone, name) * len(zone.x_mm)
            assert total == pytest.approx(getattr(before, name) * len(before.x_mm), rel=1e-12)
        for name in ("exponent", "full_damping_depth_m", "radius_m", "name"):
            assert getattr(zone, name) == getattr(before, name)
        old, new = (set(zip(z.x_mm, z.y_mm, strict=True)) for z in (before, zone))
        assert np.ptp(zone.y_mm) == np.ptp(before.y_mm)
        assert {(min(zone.x_mm), max(zone.x_mm))} == {(min(before.x_mm), max(before.x_mm))}
        assert len(new) == len(zone.x_mm), "two spheres at one place"
        if len(old) > 2:
            assert hull_area(zone) == pytest.approx(hull_area(before), rel=1e-12)
        assert {(round(x, 9), round(-y, 9)) for x, y in new} == {
            (round(x, 9), round(y, 9)) for x, y in new
        }


def test_filled_outline_bears_in_its_middle():
    """Many spheres of equal stiffness have their centre where the outline's area has it."""
    for zone in (FOOT.zones[2], FOOT.zones[3], FOOT.zones[4]):
        corners = np.column_stack([zone.x_mm, zone.y_mm])
        fine = ConvexHull(corners).points[ConvexHull(corners).vertices]
        x, y = fine.T
        cross = x * np.roll(y, -1) - np.roll(x, -1) * y
        centroid = np.sum((x + np.roll(x, -1)) * cross) / (3.0 * np.sum(cross))
        assert fill(corners, 2000)[:, 0].mean() == pytest.approx(centroid, abs=0.02 * np.ptp(x))


def test_what_cannot_be_had_by_refining_is_refused():
    for refine, count, message in (
        (with_elements, 12, "multiple of 8"),
        (with_elements, 0, "multiple of 8"),
        (with_spheres, 23, "at least what the foot has"),
    ):
        with pytest.raises(InputError, match=message):
            refine(FOOT, count)
    zone = dataclasses.replace(FOOT.zones[0], rise_mm=(0.0, 1.0))
    with pytest.raises(InputError, match="do not have one height"):
        with_spheres(dataclasses.replace(FOOT, zones=(zone, *FOOT.zones[1:])), 50)


# What a walk costs against how finely it is modelled.


@pytest.mark.slow
def test_each_family_comes_closer_to_its_finest_and_every_walk_converges():
    costs = measure_costs(load_trial(embedded_trials("exact")[0]), quick=True, repeats=1)
    families = {
        each.family: [cost for cost in costs if cost.family == each.family] for each in costs
    }
    for name in ("step", "spheres", "elements"):
        differences = [cost.difference_bw for cost in families[name]]
        assert differences == sorted(differences, reverse=True) and differences[-1] == 0.0
        assert [bool(cost.against) for cost in families[name]] == [True] * (
            len(differences) - 1
        ) + [False]
    for cost in costs:
        assert (
            cost.unconverged == 0
            and 0.0 < cost.settling_s < cost.wall_s
            and cost.stepping_per_second > 0.0
        )
    # Socket 6 and keel 9 are always free; the person's 21 come on top, and the carriage stays where
    # it is put.
    counts = [cost.size for cost in families["free"]]
    assert counts == sorted(counts) and (counts[0], counts[-1]) == (15, 36)
    # The pelvis is prescribed: whatever hangs limp on its other side, the prosthetic foot sees the
    # same motion.
    held, *_, limp = [cost for cost in families["free"] if cost.size <= 24]
    assert limp.difference_bw == pytest.approx(held.difference_bw, rel=1e-3)
