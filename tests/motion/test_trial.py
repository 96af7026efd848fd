"""A whole trial: from the manifest to trajectories and forces, and every way in which it cannot be used."""

import hashlib

import numpy as np
import pytest
import yaml

from vsf_drake.errors import InputError
from vsf_drake.motion.trial import default_model, load_trial
from vsf_drake.schema import dump_yaml

MASS = 80.0
WEIGHT = MASS * 9.80665


def message(files):
    with pytest.raises(InputError) as caught:
        load_trial(files.write())
    assert str(files.folder) in str(caught.value)
    assert caught.value.exit_code == 2
    return str(caught.value)


def test_constructed_walk(trial_files):
    trial = load_trial(trial_files.write())
    assert (trial.name, trial.synthetic, trial.fulcrum_m) == ("trial", False, pytest.approx(0.066))
    assert (trial.start_s, trial.end_s) == (0.0, pytest.approx(1.8))
    assert trial.subject.mass_kg == 80.0 and set(trial.plates) == {"left", "right"}
    assert trial.model == default_model()
    assert trial.prosthetic_plate is trial.plates["right"]
    impulse = np.trapezoid(trial.prosthetic_plate.force_W[:, 2], trial.prosthetic_plate.time_s)
    assert impulse == pytest.approx(1.1 * WEIGHT * 0.7 * 2 / np.pi, rel=1e-4)
    assert any("right (prosthetic) foot" in n and "complete" in n for n in trial.notes)


def test_inputs_are_fingerprinted_by_the_names_in_the_manifest(trial_files):
    path = trial_files.write()
    trial = load_trial(path)
    assert set(trial.inputs) == {"trial.yaml", "subject.yaml", "walk_ik.mot", "walk_grf.mot"}
    for name, digest in trial.inputs.items():
        assert digest == hashlib.sha256((trial_files.folder / name).read_bytes()).hexdigest()


def test_left_prosthesis(trial_files):
    trial_files.subject["prosthetic_side"] = "left"
    trial = load_trial(trial_files.write())
    assert trial.prosthetic_plate is trial.plates["left"]
    assert "ankle_angle_r" in trial.trajectory.names and "ankle_angle_l" not in trial.trajectory.names


def test_model_name_offsets_and_synthetic_come_from_the_manifest(trial_files):
    (trial_files.folder / "foot.yaml").write_text("foot: {mass_kg: 0.7}\n")
    trial_files.manifest |= {"model": "foot.yaml", "name": "W 7", "synthetic": True, "offsets": {"height_mm": 3}}
    trial = load_trial(trial_files.write())
    assert (trial.model.foot.mass_kg, trial.name, trial.synthetic) == (0.7, "W 7", True)
    assert trial.offsets.height_m == pytest.approx(0.003)
    assert "foot.yaml" in trial.inputs


def test_only_the_prosthetic_foot_needs_a_plate(trial_files):
    trial_files.forces = {n: v for n, v in trial_files.forces.items() if "_r_" in n}
    trial = load_trial(trial_files.write())
    assert set(trial.plates) == {"right"} and any("no force plate for the left foot" in n for n in trial.notes)
    trial_files.subject["prosthetic_side"] = "left"
    assert "forces.left: there is no force for the left (prosthetic) foot" in message(trial_files)


def test_window_of_the_manifest_is_cut_to_kinematics_and_forces(trial_files):
    trial_files.manifest["window"] = {"start_s": 0.2, "end_s": 5.0}
    keep = trial_files.force_time <= 1.5
    trial_files.force_time = trial_files.force_time[keep]
    trial_files.forces = {n: v[keep] for n, v in trial_files.forces.items()}
    trial = load_trial(trial_files.write())
    assert (trial.start_s, trial.end_s) == (pytest.approx(0.2), pytest.approx(1.5))
    assert any("cut to the kinematics" in n for n in trial.notes)
    assert any("cut to the force record" in n for n in trial.notes)


def test_window_that_cuts_a_stance_says_so(trial_files):
    trial_files.manifest["window"] = {"start_s": 0.5, "end_s": 1.8}
    trial = load_trial(trial_files.write())
    assert any("right (prosthetic) foot" in n and n.endswith("cut at its start.") for n in trial.notes)


@pytest.mark.parametrize(
    ("window", "wanted"),
    [({"start_s": 3.0}, "window: the window of 3.000 to 1.800 s and the kinematics of 0.000 to 1.800 s do not overlap"),
     ({"start_s": 0.4, "end_s": 0.9}, "the trial of 0.400 to 0.900 s is shorter than one stance (0.69"),
     ({"start_s": 1.0, "end_s": 1.8}, "the right (prosthetic) foot carries no load from 1.000 to 1.800 s. "
                                      "The stances of the right foot are 0.305 to 0.995 s")],
)
def test_window_without_a_stance_is_refused(trial_files, window, wanted):
    trial_files.manifest["window"] = window
    assert wanted in message(trial_files)


def test_forces_of_another_time_are_refused(trial_files):
    trial_files.force_time = trial_files.force_time + 10.0
    text = message(trial_files)
    assert "forces: the forces of 10.000 to 11.800 s and the window of 0.000 to 1.800 s do not overlap" in text


def test_foot_that_never_steps_on_the_plate_is_refused(trial_files):
    trial_files.forces["ground_force_r_vy"][:] *= 0.01
    trial_files.forces["ground_force_r_vx"][:] = 0.0
    assert "the right (prosthetic) foot has no stance: its largest vertical force is 8.63 N" in message(trial_files)


def test_force_far_below_body_weight_is_refused(trial_files):
    for axis in "xyz":
        trial_files.forces[f"ground_force_r_v{axis}"] *= 0.2
    assert "0.22 times the body weight. Check the unit of the forces" in message(trial_files)


def test_scuff_is_noted(trial_files):
    swing = (trial_files.force_time > 1.4055) & (trial_files.force_time < 1.4655)
    trial_files.forces["ground_force_r_vy"][swing] = 50.0
    assert any("outside a stance: 1.405 to 1.466 s" in n for n in load_trial(trial_files.write()).notes)


def test_treadmill_is_noted(trial_files):
    assert not any("treadmill" in n for n in load_trial(trial_files.write()).notes)
    trial_files.forces["ground_force_r_px"] -= 1.1 * trial_files.force_time
    assert any("-0.81 m/s through stance: a treadmill?" in n for n in load_trial(trial_files.write()).notes)


@pytest.mark.parametrize("key", ["subject", "kinematics", "forces", "model"])
def test_missing_file_is_named_with_its_key(trial_files, key):
    trial_files.manifest[key] = "absent.x"
    assert f"trial.yaml: {key}: there is no file absent.x" in message(trial_files)


def test_negative_mass_is_refused(trial_files):
    trial_files.subject["mass_kg"] = -80.0
    assert "subject.yaml: line 1, mass_kg: -80 kg is outside its physical range" in message(trial_files)


def on_two_plates(trial_files):
    """The weight on the left foot, then on the right one, then on the left, shared evenly for 0.1 s in between."""
    right = np.interp(trial_files.force_time, [0.3, 0.4, 0.9, 1.0], [0.0, 1.0, 1.0, 0.0])
    trial_files.forces["ground_force_r_vy"][:] = WEIGHT * right
    trial_files.forces["ground_force_l_vy"][:] = WEIGHT * (1.0 - right)
    for side in "rl":
        trial_files.forces[f"ground_force_{side}_px"][:] = 0.5


@pytest.mark.parametrize(("mass_kg", "words"), [
    (MASS / 0.45359237, f"Is it in pounds? 176.37 lb are {MASS:.1f} kg"), (3.0 * MASS, "prosthesis included"),
    (0.7 * MASS, "prosthesis included")])
def test_mass_that_the_plates_contradict_is_refused(trial_files, mass_kg, words):
    """The stance of one foot between two of the other carries the weight throughout, and momentum returns."""
    on_two_plates(trial_files)
    trial_files.subject["mass_kg"] = mass_kg
    text = message(trial_files)
    assert "subject.yaml: mass_kg: the plates contradict" in text and f"the weight of {MASS:.1f} kg" in text
    assert words in text


@pytest.mark.parametrize("mass_kg", [0.85 * MASS, MASS, 1.2 * MASS, MASS / 0.6])
def test_mass_within_what_plates_clothes_and_a_harness_explain_is_taken(trial_files, mass_kg):
    on_two_plates(trial_files)
    trial_files.subject["mass_kg"] = mass_kg
    assert load_trial(trial_files.write()).subject.mass_kg == mass_kg


@pytest.mark.parametrize("side", "rl")
def test_mass_that_one_plate_cannot_tell_is_not_refused(trial_files, side):
    """A foot that is seen alone may share the weight with anything."""
    on_two_plates(trial_files)
    trial_files.forces[f"ground_force_{side}_vy"][trial_files.force_time < 0.6] = 0.0
    trial_files.subject["mass_kg"] = 2.0 * MASS
    load_trial(trial_files.write())


def test_fulcrum_in_metres_is_asked_about(trial_files):
    trial_files.manifest["prosthesis"] = {"fulcrum_mm": 0.108}
    assert "It must be between 66 and 151 mm. Is it in metres?" in message(trial_files)


def test_fulcrum_out_of_reach_is_refused(trial_files):
    trial_files.manifest["prosthesis"] = {"fulcrum_mm": 250}
    text = message(trial_files)
    assert "prosthesis.fulcrum_mm: the fulcrum at 250 mm is out of the carriage's reach" in text
    assert "between 66 and 151 mm" in text


def test_truncated_kinematics_are_refused(trial_files):
    path = trial_files.write()
    ik = trial_files.folder / "walk_ik.mot"
    ik.write_text(ik.read_text()[:-2000])
    with pytest.raises(InputError, match=r"walk_ik\.mot: line \d+: .*Is the file truncated\?"):
        load_trial(path)


def write_real(tmp_path, shared_data, side, **manifest):
    core = shared_data / "opensim_core"
    (tmp_path / "subject.yaml").write_text(
        yaml.safe_dump({"mass_kg": 85.27, "stature_m": 1.8, "sex": "male", "prosthetic_side": side}
                       | manifest.pop("subject", {})))
    keys = {"subject": "subject.yaml", "kinematics": str(core / "example3DWalking" / "coordinates.sto"),
            "forces": str(core / "example3DWalking" / "grf_walk.mot"), "prosthesis": {"fulcrum_mm": 66}}
    path = tmp_path / f"{side}.yaml"
    path.write_text(yaml.safe_dump(keys | manifest))
    return path


def test_real_walk_right(tmp_path, shared_data):
    trial = load_trial(write_real(tmp_path, shared_data, "right"))
    assert (trial.start_s, trial.end_s) == (0.45, 1.799)
    assert "Stance of the right (prosthetic) foot from 0.267 to 1.024 s is cut at its start." in trial.notes
    assert "Stance of the right (prosthetic) foot from 1.411 to 2.168 s is cut at its end." in trial.notes
    assert "Stance of the left foot from 0.836 to 1.590 s is complete." in trial.notes
    plate = trial.prosthetic_plate
    assert plate.has_cop and 0.9 < plate.force_W[:, 2].max() / (85.27 * 9.80665) < 1.3
    loaded = ~np.isnan(plate.cop_W[:, 0])
    assert (plate.cop_W[loaded, 1] < trial.plates["left"].cop_W[:, 1][~np.isnan(trial.plates["left"].cop_W[:, 1])].min()
            ).all()


def test_real_walk_left(tmp_path, shared_data):
    trial = load_trial(write_real(tmp_path, shared_data, "left"))
    assert "Stance of the left (prosthetic) foot from 0.836 to 1.590 s is complete." in trial.notes
    assert "ankle_angle_r" in trial.trajectory.names


def test_real_walk_on_a_treadmill_with_simm_header(tmp_path, shared_data):
    """gait2354 subject01: angles without a unit, plates without sides, knees negative."""
    core = shared_data / "opensim_core"
    forces = {"file": str(core / "gait2354" / "subject01_walk1_grf.mot"), "right": "ground_force",
              "left": "1_ground_force"}
    kinematics = str(core / "ik_reference" / "std_subject01_walk1_ik.mot")
    subject = {"mass_kg": 72.6, "stature_m": 1.803}
    path = write_real(tmp_path, shared_data, "right", subject=subject, kinematics=kinematics, forces=forces,
                      kinematics_unit="degrees")
    trial = load_trial(path)
    assert (trial.start_s, trial.end_s) == (0.4, pytest.approx(1.6))
    assert any("0.618 to 1.409 s is complete" in n for n in trial.notes)
    assert any("treadmill" in n for n in trial.notes)
    with pytest.raises(InputError, match=r"prefixes found: ground_force, 1_ground_force\. Say it in the manifest"):
        load_trial(write_real(tmp_path, shared_data, "right", subject=subject, kinematics=kinematics,
                              forces=forces["file"], kinematics_unit="degrees"))


def test_offsets_can_be_written_back(trial_files):
    trial_files.manifest["offsets"] = {"alignment_deg": 2}
    trial = load_trial(trial_files.write())
    assert yaml.safe_load(dump_yaml(trial.offsets))["alignment_rad"] == pytest.approx(np.radians(2))
