"""Joint angles and plates out of OpenSim tables: names, units, signs, frames, and what is
refused."""

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import person_coordinates
from vsf_drake.motion.formats.recording import os_to_world
from vsf_drake.motion.formats.tables import read_storage, write_storage
from vsf_drake.motion.opensim import assign_prefixes, read_kinematics, read_plate

SIMM = (
    "walk\nnRows={rows}\nnColumns={columns}\n\n# SIMM Motion File Header:\nname walk\n"
    "datacolumns {columns}\ndatarows {rows}\notherdata 1\nrange 0 1.8\nendheader"
)
MASS = 80.0
TIME = np.arange(0.0, 0.1, 0.01)


def read(files, side="right", unit=None):
    files.write()
    return read_kinematics(
        read_storage(files.folder / "walk_ik.mot"), prosthetic_side=side, unit=unit
    )


def message(call):
    with pytest.raises(InputError) as caught:
        call()
    return str(caught.value)


def to_radians(files):
    files.header = files.header.replace("inDegrees=yes", "inDegrees=no")
    for name in files.columns:
        if name not in ("pelvis_tx", "pelvis_ty", "pelvis_tz"):
            files.columns[name] = np.radians(files.columns[name])


def test_degrees_become_radians_and_metres_stay(trial_files):
    degrees, _ = read(trial_files)
    q, _, _ = degrees.sample(trial_files.time)
    assert degrees.names == person_coordinates("right") and len(degrees.names) == 21
    for name in ("knee_angle_r", "hip_flexion_l", "pelvis_list", "ankle_angle_l"):
        np.testing.assert_allclose(
            q[:, degrees.names.index(name)], np.radians(trial_files.columns[name]), atol=1e-9
        )
    np.testing.assert_allclose(q[:, 1], trial_files.columns["pelvis_ty"], atol=1e-9)
    to_radians(trial_files)
    np.testing.assert_allclose(degrees.values, read(trial_files)[0].values, atol=1e-9)


def test_only_the_intact_ankle_is_needed_and_the_wrong_side_is_told(trial_files):
    del trial_files.columns["ankle_angle_l"]
    trajectory, _ = read(trial_files, side="left")
    assert "ankle_angle_r" in trajectory.names and "ankle_angle_l" not in trajectory.names
    text = message(lambda: read(trial_files, side="right"))
    assert (
        "walk_ik.mot" in text and "ankle_angle_r for an ankle that the prosthesis replaces" in text
    )
    assert "The subject's prosthetic_side is right: is it the other one?" in text
    del trial_files.columns["ankle_angle_r"]
    text = message(lambda: read(trial_files))
    assert "column ankle_angle_l: there is no column for this coordinate" in text
    assert "Both legs' joints are needed, but for the prosthetic ankle" in text


def test_opensim_paths_are_coordinates_and_speeds_are_not(trial_files):
    plain, _ = read(trial_files)
    trial_files.columns = {
        f"/jointset/joint/{n}/value": v for n, v in trial_files.columns.items()
    } | {
        "/jointset/joint/hip_flexion_r/speed": np.full(181, 1e6),
        "/forceset/soleus_r/activation": np.full(181, np.nan),
    }
    np.testing.assert_array_equal(plain.values, read(trial_files)[0].values)
    trial_files.columns["hip_flexion_r"] = trial_files.columns[
        "/jointset/joint/hip_flexion_r/value"
    ]
    assert "column hip_flexion_r: the coordinate stands twice" in message(lambda: read(trial_files))


def test_negative_knee_flexion_is_turned_and_noted_and_knees_of_opposite_sign_are_refused(
    trial_files,
):
    knees = ("knee_angle_r", "knee_angle_l")
    positive, quiet = read(trial_files)
    for knee in knees:
        trial_files.columns[knee] = -trial_files.columns[knee]
    turned, notes = read(trial_files)
    np.testing.assert_allclose(turned.values, positive.values, atol=1e-9)
    assert any("turned round" in n for n in notes) and not any("turned" in n for n in quiet)
    trial_files.columns["knee_angle_l"] = -trial_files.columns["knee_angle_l"]
    assert "the knees bend both ways, from -60° to 60°" in message(lambda: read(trial_files))
    for knee in knees:
        trial_files.columns[knee] = 0.2 * np.abs(trial_files.columns[knee])
    assert any("No knee" in n and "taken as positive" in n for n in read(trial_files)[1])


def test_header_without_unit_needs_the_manifest_and_one_with_it_wins(trial_files):
    stated, _ = read(trial_files)
    assert "the header says inDegrees=yes, the manifest says kinematics_unit: radians" in message(
        lambda: read(trial_files, unit="radians")
    )
    trial_files.header = SIMM
    assert "Add `kinematics_unit: degrees`" in message(lambda: read(trial_files))
    np.testing.assert_array_equal(read(trial_files, unit="degrees")[0].values, stated.values)


def test_degrees_declared_as_radians_and_the_other_way_round(trial_files):
    trial_files.header = trial_files.header.replace("inDegrees=yes", "inDegrees=no")
    text = message(lambda: read(trial_files))
    assert "is not believable" in text and "line " in text and "is it in degrees?" in text
    to_radians(trial_files)
    trial_files.header = trial_files.header.replace("inDegrees=no", "inDegrees=yes")
    text = message(lambda: read(trial_files))
    assert (
        "column knee_angle" in text and "which is no walk" in text and "is it in radians?" in text
    )


@pytest.mark.parametrize(
    ("spoil", "wanted"),
    [
        (lambda c: c.update(pelvis_ty=1e3 * c["pelvis_ty"]), "column pelvis_ty: the pelvis at"),
        (lambda c: c.update(pelvis_tx=1e3 * c["pelvis_tx"]), "is it in millimetres?"),
        (
            lambda c: c["hip_flexion_r"].__iadd__(90.0 * (np.arange(181) >= 50)),
            "hip_flexion_r: the angle jumps by 89°",
        ),
        (
            lambda c: c["knee_angle_l"].__setitem__(20, np.nan),
            "line 28, time 0.2 s, column knee_angle_l: 'nan' is not a",
        ),
    ],
)
def test_what_no_person_does_is_refused_with_its_place(trial_files, spoil, wanted):
    trial_files.columns["lumbar_extension"] = np.full(181, np.nan)  # nobody needs it
    trial_files.columns = {name: np.array(values) for name, values in trial_files.columns.items()}
    read(trial_files)
    spoil(trial_files.columns)
    assert wanted in message(lambda: read(trial_files))


def test_time_that_stands_still_or_leaps_is_refused(trial_files):
    time, columns = trial_files.time.copy(), trial_files.columns
    trial_files.time[50] = trial_files.time[49]
    assert "line 58, time 0.49 s: time does not increase: 0.49 s follows 0.49 s" in message(
        lambda: read(trial_files)
    )
    for missing in (6, 20):
        rows = np.r_[0:50, 50 + missing : 181]
        trial_files.time, trial_files.columns = time[rows], {n: v[rows] for n, v in columns.items()}
        text = message(lambda: read(trial_files))
        assert (
            f"there is a gap of {0.01 * (missing + 1):g} s after 0.49 s" in text
            and "line 58" in text
        )


# Force plates: the world frame, which column is which foot, and the same load however it is
# written.


def storage_of(tmp_path, columns, time=TIME):
    """A force file in OpenSim's frame; scalars are held constant."""
    path = tmp_path / "grf.mot"
    values = np.column_stack(
        [np.broadcast_to(np.asarray(v, dtype=float), time.shape) for v in columns.values()]
    )
    write_storage(path, time_s=time, names=tuple(columns), values=values)
    return read_storage(path)


def columns(
    prefix="ground_force_r",
    torque="ground_torque_r",
    force=(40.0, 800.0, 10.0),
    point=(0.5, 0.0, -0.1),
    moment=(0.0, 3.0, 0.0),
):
    out = {f"{prefix}_v{a}": f for a, f in zip("xyz", force, strict=True)}
    out |= {f"{prefix}_p{a}": p for a, p in zip("xyz", point, strict=True)}
    return out | {f"{torque}_{a}": m for a, m in zip("xyz", moment, strict=True)}


def plate_of(tmp_path, prefix="ground_force_r", **loads):
    return read_plate(storage_of(tmp_path, columns(**loads)), prefix, mass_kg=MASS)


def test_constructed_force_in_the_world_frame(tmp_path):
    plate, notes = plate_of(tmp_path)
    np.testing.assert_allclose(plate.force_W, np.tile([40.0, -10.0, 800.0], (10, 1)))
    np.testing.assert_allclose(plate.cop_W, np.tile([0.5, 0.1, 0.0], (10, 1)))
    np.testing.assert_allclose(plate.free_moment_nm, 3.0)
    assert plate.has_cop and notes == []
    assert any("y = -7.5 mm" in n for n in plate_of(tmp_path, point=(0.5, -0.0075, 0.1))[1])


def test_load_is_the_same_wherever_its_moment_is_taken(tmp_path):
    """The moment about the laboratory's origin, by the cross product in OpenSim's frame and in
    W."""
    force, point, moment = (
        np.array([60.0, 700.0, -30.0]),
        np.array([0.3, -0.04, 0.2]),
        np.array([25.0, 4.0, -60.0]),
    )
    plate, _ = plate_of(tmp_path, force=force, point=point, moment=moment)
    about_origin = os_to_world(np.cross(point, force) + moment)
    again = np.cross(plate.cop_W[0], plate.force_W[0]) + np.array(
        [0.0, 0.0, plate.free_moment_nm[0]]
    )
    np.testing.assert_allclose(again, about_origin, atol=1e-9)
    assert plate.cop_W[0, 2] == 0.0


@pytest.mark.parametrize(
    ("force", "wanted"),
    [
        ((0, -800, 0), "column ground_force_r_vy: the vertical force is negative (-800 N)"),
        (
            (30, 40, 800),
            (
                "column ground_force_r_vz: the largest part of the force is along z, not upward "
                "along y"
            ),
        ),
        ((0, 4000, 0), "is 5.1 times the body weight of 80 kg"),
        ((0, 1e300, 0), "column ground_force_r_vy: 1e+300 N is no force of a person"),
        (
            (0, np.r_[500.0, np.nan, np.full(8, 500.0)], 0),
            "time 0.01 s, column ground_force_r_vy: 'nan' is not a finite",
        ),
    ],
)
def test_force_that_no_foot_feels_is_refused(tmp_path, force, wanted):
    text = message(lambda: plate_of(tmp_path, force=force))
    assert wanted in text and "grf.mot" in text and "time" in text


def both(tmp_path, right, left):
    return storage_of(tmp_path, columns(right, f"{right}_t") | columns(left, f"{left}_t"))


def test_names_that_do_not_tell_the_side_list_what_to_write(tmp_path):
    storage = both(tmp_path, "ground_force", "1_ground_force")
    text = message(lambda: assign_prefixes(storage, None))
    assert "prefixes found: ground_force, 1_ground_force" in text
    assert "`forces: {file: grf.mot, right: PREFIX, left: PREFIX}`" in text
    assert "prefixes found: force1_r, force2_r" in message(
        lambda: assign_prefixes(both(tmp_path, "force1_r", "force2_r"), None)
    )
    stated = {"right": "ground_force", "left": "1_ground_force"}
    assert assign_prefixes(storage, stated) == stated
    assert assign_prefixes(storage, {"right": "1_ground_force", "left": None}) == {
        "right": "1_ground_force"
    }


def test_wrong_mapping_is_refused(tmp_path):
    storage = both(tmp_path, "a", "b")
    for stated, wanted in (
        ({"right": "a", "left": "c"}, "forces.left: has no force columns c_vx, c_vy, c_vz."),
        ({"right": "a", "left": "a"}, "the same columns stand for both feet"),
    ):
        assert wanted in message(lambda stated=stated: assign_prefixes(storage, stated))
    partial = storage_of(
        tmp_path, {name: value for name, value in columns("a").items() if name != "a_vz"}
    )
    assert "A component that was not measured may be a column of zeros" in message(
        lambda: assign_prefixes(partial, {"right": "a"})
    )
