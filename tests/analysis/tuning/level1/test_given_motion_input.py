"""What cannot be tuned is refused with what to change."""

import dataclasses

import numpy as np
import pytest

from vsf_drake.analysis.tuning.level1 import StiffnessTuning, TuningOptions
from vsf_drake.errors import InputError
from vsf_drake.motion.trajectory import CoordinateTrajectory


def with_plate(trial, **changes):
    side = trial.subject.prosthetic_side
    return dataclasses.replace(trial, plates={side: dataclasses.replace(trial.plates[side], **changes)})


def planar(trial):
    values = np.array(trial.trajectory.values)
    for name in ("hip_adduction_r", "hip_rotation_r", "knee_adduction_r", "knee_rotation_r"):
        values[:, trial.trajectory.names.index(name)] = 0.0
    motion = CoordinateTrajectory(trial.trajectory.time_s, values, trial.trajectory.names)
    return dataclasses.replace(trial, trajectory=motion)


@pytest.fixture
def trial(tuned_trials):
    return tuned_trials["medium_2"]


def test_an_unknown_cost_names_those_that_exist(trial):
    with pytest.raises(InputError, match=r"no 'comfort'.*joint_load, metabolic, push_off, tracking, weighted"):
        StiffnessTuning([trial], cost="comfort")


@pytest.mark.parametrize(("given", "message"), [([], "no trial to tune to"), ("low_1.yaml", "no list of trials")])
def test_what_is_no_list_of_trials_is_refused(given, message):
    with pytest.raises(InputError, match=message):
        StiffnessTuning(given)


def test_prostheses_on_both_sides_are_refused(trial):
    other = dataclasses.replace(trial, subject=dataclasses.replace(trial.subject, prosthetic_side="left"))
    with pytest.raises(InputError, match="on the left"):
        StiffnessTuning([trial, other])


def test_tracking_without_a_plate_is_refused(trial):
    with pytest.raises(InputError, match="no plate measured the force on the right"):
        StiffnessTuning([dataclasses.replace(trial, plates={})], cost="tracking")


def test_tracking_a_force_without_its_lateral_part_is_refused(trial):
    force = np.array(trial.prosthetic_plate.force_W)
    force[:, 1] = 0.0
    with pytest.raises(InputError, match="no lateral force"):
        StiffnessTuning([with_plate(trial, force_W=force)], cost="weighted",
                        options=TuningOptions(weights={"tracking": 1.0}))


def test_moments_out_of_the_plane_of_a_planar_recording_are_refused(trial):
    with pytest.raises(InputError, match=r"no hip_adduction_r.*joints=\('hip_flexion', 'knee_angle'\)"):
        StiffnessTuning([planar(trial)])


def test_a_planar_recording_can_be_tuned_by_its_sagittal_moments(trial, made_tuning):
    tuning = made_tuning(planar(trial), joints=("hip_flexion", "knee_angle"))
    assert tuning.evaluate(np.array([100.0])).cost > 0.0


def test_the_knee_adduction_moment_needs_a_recording_in_three_dimensions(trial):
    noted = dataclasses.replace(trial, notes=("Not in walk.mot, taken as zero: knee_adduction_r, knee_rotation_r.",))
    with pytest.raises(InputError, match="no knee_adduction_r"):
        StiffnessTuning([noted], options=TuningOptions(joints=("knee_angle", "knee_adduction")))


@pytest.mark.parametrize("end_s", [0.35, 0.9])
def test_a_motion_without_a_whole_prosthetic_stance_is_refused(made_tuning, trial, end_s):
    with pytest.raises(InputError, match="no whole stance"):
        made_tuning(dataclasses.replace(trial, end_s=end_s))


def test_bounds_out_of_the_carriages_reach_are_refused(trial):
    with pytest.raises(InputError, match="must lie within 66 to 151 mm"):
        StiffnessTuning([trial], options=TuningOptions(bounds_mm=(50.0, 100.0)))


def test_bounds_of_the_design_out_of_range_are_refused(trial):
    with pytest.raises(InputError, match="out of range"):
        StiffnessTuning([trial], options=TuningOptions(design=("alignment",), design_bounds={"alignment": (-2.0, 0.1)}))


@pytest.mark.parametrize(("options", "message"), [
    ({"bounds_mm": (120.0, 90.0)}, "lower bound 120 is not below its upper one 90"),
    ({"bounds_mm": (90.0,)}, "no pair of numbers"),
    ({"design": ("toe_shape",)}, "heel_stiffness, alignment, keel_thickness"),
    ({"design": ("alignment", "alignment")}, "names alignment twice"),
    ({"design": "alignment"}, "no tuple"),
    ({"joints": ()}, "is empty"),
    ({"weights": {"joint_load": -1.0}}, "weights.joint_load: -1 is outside"),
    ({"weights": {"joint_load": True}}, r"weights\['joint_load'\]: True is no weight"),
    ({"weights": {"joint_load": None}}, r"weights\['joint_load'\]: None is no weight"),
    ({"weights": {1: 1.0}}, "weights: there is no 1"),
    ({"bounds_mm": (False, True)}, "bounds_mm: .* is no pair of numbers"),
    ({"weights": {"joint_load": 0.0}}, "all zero"),
    ({"weights": {"comfort": 1.0}}, "there is no 'comfort'"),
    ({"consistency_weight": -0.1}, "between 0 and 100"),
    ({"step_s": 0.0}, "step_s"), ({"step_s": float("nan")}, "step_s"), ({"draws": 1.5}, "whole number"),
    ({"cutoff_hz": 150.0, "search_step_s": 4e-3}, "below 125 Hz"),
    ({"pareto": ("joint_load",)}, "Give two costs"), ({"same_load": 1}, "not a true or false"),
    ({"confirm": ("gurobi",)}, "ipopt, nlopt")])
def test_an_option_that_makes_no_sense_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        TuningOptions(**options)


def test_names_must_fit_the_trials(trial, shared_walker):
    with pytest.raises(InputError, match="does not name 1 trials"):
        StiffnessTuning([trial], tasks=["slow", "fast"], walkers=[shared_walker])
