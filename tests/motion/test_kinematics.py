"""Joint angles from OpenSim tables: names, units, signs, and what is refused."""

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.tables import read_storage
from vsf_drake.motion.opensim import read_kinematics
from vsf_drake.parameters import person_coordinates

SIMM = "walk\nnRows={rows}\nnColumns={columns}\n\n# SIMM Motion File Header:\nname walk\ndatacolumns {columns}\n" \
       "datarows {rows}\notherdata 1\nrange 0 1.8\nendheader"


def read(files, side="right", unit=None):
    files.write()
    return read_kinematics(read_storage(files.folder / "walk_ik.mot"), prosthetic_side=side, unit=unit)


def message(files, **options):
    with pytest.raises(InputError) as caught:
        read(files, **options)
    assert "walk_ik.mot" in str(caught.value)
    return str(caught.value)


def to_radians(files):
    files.header = files.header.replace("inDegrees=yes", "inDegrees=no")
    for name in files.columns:
        if name not in ("pelvis_tx", "pelvis_ty", "pelvis_tz"):
            files.columns[name] = np.radians(files.columns[name])


def test_person_without_right_ankle_has_21_recorded_coordinates():
    names = person_coordinates("right")
    assert len(names) == len(set(names)) == 21
    assert "ankle_angle_l" in names and "ankle_angle_r" not in names
    assert names[:6] == ("pelvis_tx", "pelvis_ty", "pelvis_tz", "pelvis_tilt", "pelvis_list", "pelvis_rotation")


def test_degrees_become_radians_and_metres_stay(trial_files):
    trajectory, _ = read(trial_files)
    q, _, _ = trajectory.sample(trial_files.time)
    assert trajectory.names == person_coordinates("right")
    for name in ("knee_angle_r", "hip_flexion_l", "pelvis_list", "ankle_angle_l"):
        np.testing.assert_allclose(q[:, trajectory.names.index(name)], np.radians(trial_files.columns[name]), atol=1e-9)
    np.testing.assert_allclose(q[:, 1], trial_files.columns["pelvis_ty"], atol=1e-9)


def test_degrees_and_radians_give_the_same_motion(trial_files):
    degrees, _ = read(trial_files)
    to_radians(trial_files)
    radians, _ = read(trial_files)
    np.testing.assert_allclose(degrees.values, radians.values, atol=1e-9)


def test_left_prosthesis_needs_the_right_ankle_only(trial_files):
    del trial_files.columns["ankle_angle_l"]
    trajectory, _ = read(trial_files, side="left")
    assert "ankle_angle_r" in trajectory.names and "ankle_angle_l" not in trajectory.names
    del trial_files.columns["ankle_angle_r"]
    assert "column ankle_angle_l: there is no column for this coordinate" in message(trial_files, side="right")


@pytest.mark.parametrize(("side", "other"), [("right", "l"), ("left", "r")])
def test_subject_with_the_prosthesis_on_the_wrong_side_is_told_so(trial_files, side, other):
    del trial_files.columns[f"ankle_angle_{other}"]
    text = message(trial_files, side=side)
    assert f"ankle_angle_{side[0]} for an ankle that the prosthesis replaces" in text
    assert f"The subject's prosthetic_side is {side}: is it the other one?" in text


def test_opensim_paths_are_coordinates_and_speeds_are_not(trial_files):
    plain, _ = read(trial_files)
    trial_files.columns = {f"/jointset/joint/{n}/value": v for n, v in trial_files.columns.items()} | {
        "/jointset/joint/hip_flexion_r/speed": np.full(181, 1e6), "/forceset/soleus_r/activation": np.full(181, np.nan)}
    paths, _ = read(trial_files)
    np.testing.assert_array_equal(plain.values, paths.values)


def test_missing_optional_coordinates_are_zero_and_noted(trial_files):
    trial_files.columns["hip_adduction_r"] = 5 * np.sin(trial_files.time)
    trajectory, notes = read(trial_files)
    assert not trajectory.values[:, trajectory.names.index("hip_rotation_r")].any()
    (note,) = [n for n in notes if "taken as zero" in n]
    assert "hip_rotation_r" in note and "hip_adduction_l" in note and "hip_adduction_r" not in note


def test_subtalar_angle_is_ankle_adduction(trial_files):
    trial_files.columns["subtalar_angle_l"] = 5 * np.sin(trial_files.time)
    trajectory, notes = read(trial_files)
    values = trajectory.values[:, trajectory.names.index("ankle_adduction_l")]
    np.testing.assert_allclose(values, np.radians(trial_files.columns["subtalar_angle_l"]), atol=1e-9)
    assert not any("ankle_adduction_l" in n for n in notes)


def test_negative_knee_flexion_is_turned_and_noted(trial_files):
    positive, quiet = read(trial_files)
    for knee in ("knee_angle_r", "knee_angle_l"):
        trial_files.columns[knee] = -trial_files.columns[knee]
    turned, notes = read(trial_files)
    np.testing.assert_allclose(turned.values, positive.values, atol=1e-9)
    assert any("turned round" in n for n in notes) and not any("turned" in n for n in quiet)


def test_knees_of_opposite_sign_are_refused(trial_files):
    trial_files.columns["knee_angle_l"] = -trial_files.columns["knee_angle_l"]
    assert "knee_angle_r and knee_angle_l: the knees bend both ways, from -60° to 60°" in message(trial_files)


def test_stiff_knees_leave_their_sign_to_a_note(trial_files):
    for knee in ("knee_angle_r", "knee_angle_l"):
        trial_files.columns[knee] = 0.2 * trial_files.columns[knee]
    assert any("No knee" in n and "taken as positive" in n for n in read(trial_files)[1])


@pytest.mark.parametrize("name", ["pelvis_tilt", "pelvis_tx", "hip_flexion_l", "knee_angle_r"])
def test_missing_required_column_is_named(trial_files, name):
    del trial_files.columns[name]
    text = message(trial_files)
    assert f"column {name}: there is no column for this coordinate" in text and "Coordinates found: " in text


def test_header_without_unit_needs_the_manifest(trial_files):
    stated, _ = read(trial_files)
    trial_files.header = SIMM
    text = message(trial_files)
    assert "the header does not say whether angles are in degrees" in text
    assert "Add `kinematics_unit: degrees`" in text
    np.testing.assert_array_equal(read(trial_files, unit="degrees")[0].values, stated.values)


def test_manifest_against_header_is_refused(trial_files):
    assert "the header says inDegrees=yes, the manifest says kinematics_unit: radians" in message(
        trial_files, unit="radians")


def test_degrees_declared_as_radians(trial_files):
    trial_files.header = trial_files.header.replace("inDegrees=yes", "inDegrees=no")
    text = message(trial_files)
    assert "is not believable" in text and "line " in text and "time " in text and "column " in text
    assert "is it in degrees?" in text


def test_radians_declared_as_degrees(trial_files):
    to_radians(trial_files)
    trial_files.header = trial_files.header.replace("inDegrees=no", "inDegrees=yes")
    text = message(trial_files)
    assert "which is no walk" in text and "is it in radians?" in text
    assert "column knee_angle" in text and "time 0 to 1.8 s" in text


@pytest.mark.parametrize(("name", "scale", "hint"), [("pelvis_ty", 1000.0, "between 0.3 and 2 m"),
                                                     ("pelvis_tx", 1000.0, "is it in millimetres?")])
def test_pelvis_in_millimetres(trial_files, name, scale, hint):
    trial_files.columns[name] = scale * trial_files.columns[name]
    text = message(trial_files)
    assert f"column {name}: the pelvis at" in text and hint in text and "line" in text


def test_jump_of_an_angle_is_refused(trial_files):
    trial_files.columns["hip_flexion_r"][50:] += 90.0
    assert "time 0.5 s, column hip_flexion_r: the angle jumps by 89°" in message(trial_files)


def test_nan_is_refused_only_where_it_is_needed(trial_files):
    trial_files.columns["lumbar_extension"] = np.full(181, np.nan)
    read(trial_files)
    trial_files.columns["knee_angle_l"][20] = np.nan
    assert "line 28, time 0.2 s, column knee_angle_l: 'nan' is not a finite number" in message(trial_files)


def test_time_that_stands_still_or_runs_back_is_refused(trial_files):
    trial_files.time[50] = trial_files.time[49]
    assert "line 58, time 0.49 s: time does not increase: 0.49 s follows 0.49 s" in message(trial_files)
    trial_files.time[50] = 0.3
    assert "line 58, time 0.3 s: time does not increase" in message(trial_files)


@pytest.mark.parametrize("missing", [6, 20])
def test_gap_is_refused(trial_files, missing):
    keep = np.r_[0:50, 50 + missing:181]
    trial_files.time = trial_files.time[keep]
    trial_files.columns = {n: v[keep] for n, v in trial_files.columns.items()}
    text = message(trial_files)
    assert f"there is a gap of {0.01 * (missing + 1):g} s after 0.49 s" in text and "line 58" in text


def test_too_few_rows_are_refused(trial_files):
    trial_files.time = trial_files.time[:5]
    trial_files.columns = {n: v[:5] for n, v in trial_files.columns.items()}
    assert "has 5 rows. At least 6 are needed" in message(trial_files)


def test_same_coordinate_in_two_spellings_is_refused(trial_files):
    trial_files.columns["/jointset/hip_r/hip_flexion_r/value"] = trial_files.columns["hip_flexion_r"]
    assert "column hip_flexion_r: the coordinate stands twice" in message(trial_files)


def test_opensim_inverse_kinematics_with_simm_header(shared_data):
    """subject01_walk1 of gait2354: 60 Hz, no unit, knees negative, times rounded to the millisecond."""
    storage = read_storage(shared_data / "opensim_core" / "ik_reference" / "std_subject01_walk1_ik.mot")
    trajectory, notes = read_kinematics(storage, prosthetic_side="right", unit="degrees")
    assert len(trajectory.time_s) == 73
    np.testing.assert_allclose(np.diff(trajectory.time_s), 1 / 60, rtol=1e-9)
    knee = trajectory.values[:, trajectory.names.index("knee_angle_r")]
    assert np.degrees(knee.max()) == pytest.approx(69.67720048)
    assert any("turned round" in n for n in notes)
    accelerations = trajectory.sample(np.linspace(0.4, 1.6, 1001))[2]
    assert np.abs(accelerations[:, 6:]).max() < 200.0


def test_opensim_states_in_radians(shared_data):
    """example3DWalking: OpenSim paths, 1 kHz, radians, knees positive, a wrong nColumns."""
    storage = read_storage(shared_data / "opensim_core" / "example3DWalking" / "coordinates.sto")
    trajectory, notes = read_kinematics(storage, prosthetic_side="right")
    assert (trajectory.start_s, trajectory.end_s) == (0.45, 1.799)
    assert trajectory.values[0, trajectory.names.index("hip_flexion_r")] == 0.3965801380677928
    assert any("says 40 columns" in n for n in notes) and not any("turned" in n for n in notes)
    assert np.abs(trajectory.sample(np.linspace(0.45, 1.799, 3001))[2]).max() < 150.0
