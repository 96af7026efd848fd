"""Force plates: the world frame, which column is which foot, and the same load however it is written."""

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import os_to_world, world_to_os
from vsf_drake.motion.formats.tables import read_storage, write_storage
from vsf_drake.motion.opensim import assign_prefixes, find_prefixes, read_plate

MASS = 80.0
TIME = np.arange(0.0, 0.1, 0.01)


def storage_of(tmp_path, columns, time=TIME):
    """A force file in OpenSim's frame; scalars are held constant."""
    path = tmp_path / "grf.mot"
    values = np.column_stack([np.broadcast_to(np.asarray(v, dtype=float), time.shape) for v in columns.values()])
    write_storage(path, time_s=time, names=tuple(columns), values=values)
    return read_storage(path)


def columns(prefix="ground_force_r", torque="ground_torque_r", force=(40.0, 800.0, 10.0), point=(0.5, 0.0, -0.1),
            moment=(0.0, 3.0, 0.0)):
    out = {f"{prefix}_v{a}": f for a, f in zip("xyz", force, strict=True)}
    out |= {f"{prefix}_p{a}": p for a, p in zip("xyz", point, strict=True)}
    return out | {f"{torque}_{a}": m for a, m in zip("xyz", moment, strict=True)}


def message(call):
    with pytest.raises(InputError) as caught:
        call()
    return str(caught.value)


def test_axes_of_the_two_frames():
    """Forward stays forward, OpenSim's up is W's up, OpenSim's right is W's minus left."""
    np.testing.assert_array_equal(os_to_world([[1, 0, 0], [0, 1, 0], [0, 0, 1]]), [[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    vectors = np.random.default_rng(0).normal(size=(4, 3))
    np.testing.assert_array_equal(world_to_os(os_to_world(vectors)), vectors)
    np.testing.assert_allclose(np.cross(os_to_world(vectors[0]), os_to_world(vectors[1])),
                               os_to_world(np.cross(vectors[0], vectors[1])))


def test_constructed_force_in_the_world_frame(tmp_path):
    plate, notes = read_plate(storage_of(tmp_path, columns()), "ground_force_r", mass_kg=MASS)
    np.testing.assert_allclose(plate.force_W, np.tile([40.0, -10.0, 800.0], (10, 1)))
    np.testing.assert_allclose(plate.cop_W, np.tile([0.5, 0.1, 0.0], (10, 1)))
    np.testing.assert_allclose(plate.free_moment_nm, 3.0)
    assert plate.has_cop and notes == []


def test_load_is_the_same_wherever_its_moment_is_taken(tmp_path):
    """The moment about the laboratory's origin, by the cross product in OpenSim's frame and in W."""
    force, point, moment = np.array([60.0, 700.0, -30.0]), np.array([0.3, -0.04, 0.2]), np.array([25.0, 4.0, -60.0])
    storage = storage_of(tmp_path, columns(force=force, point=point, moment=moment))
    plate, _ = read_plate(storage, "ground_force_r", mass_kg=MASS)
    about_origin = os_to_world(np.cross(point, force) + moment)
    again = np.cross(plate.cop_W[0], plate.force_W[0]) + np.array([0.0, 0.0, plate.free_moment_nm[0]])
    np.testing.assert_allclose(again, about_origin, atol=1e-9)
    assert plate.cop_W[0, 2] == 0.0


def test_plate_below_the_ground_is_noted(tmp_path):
    _, notes = read_plate(storage_of(tmp_path, columns(point=(0.5, -0.0075, 0.1))), "ground_force_r", mass_kg=MASS)
    assert any("y = -7.5 mm" in n for n in notes)


def test_centre_of_pressure_is_nan_where_unloaded(tmp_path):
    force = np.array([0, 10, 20, 30, 500, 800, 500, 30, 0, 0.0])
    place = np.where(force > 20, 0.5, 400.0)
    storage = storage_of(tmp_path, columns(force=(0.1 * force, force, 0.0), point=(place, 0, 0)))
    plate, _ = read_plate(storage, "ground_force_r", mass_kg=MASS)
    np.testing.assert_array_equal(np.isnan(plate.cop_W).all(axis=1), force <= 20.0)
    np.testing.assert_array_equal(plate.free_moment_nm == 0.0, force <= 20.0)


def test_nan_position_is_allowed_only_where_unloaded(tmp_path):
    force = np.array([0, 0, 100, 500, 800, 500, 100, 30, 0, 0.0])
    place = np.where(force > 0, 0.5, np.nan)
    storage = storage_of(tmp_path, columns(force=(0, force, 0), point=(place, 0, 0)))
    read_plate(storage, "ground_force_r", mass_kg=MASS)
    place[4] = np.nan
    storage = storage_of(tmp_path, columns(force=(0, force, 0), point=(place, 0, 0)))
    assert "time 0.04 s, column ground_force_r_px: 'nan'" in message(
        lambda: read_plate(storage, "ground_force_r", mass_kg=MASS))


def test_nan_force_is_refused(tmp_path):
    force = np.full(10, 500.0)
    force[3] = np.nan
    storage = storage_of(tmp_path, columns(force=(0, force, 0)))
    assert "line 11, time 0.03 s, column ground_force_r_vy: 'nan' is not a finite number" in message(
        lambda: read_plate(storage, "ground_force_r", mass_kg=MASS))


def test_force_without_position_or_torque(tmp_path):
    only = {n: v for n, v in columns().items() if n[-3:-1] == "_v"}
    plate, notes = read_plate(storage_of(tmp_path, only), "ground_force_r", mass_kg=MASS)
    assert not plate.has_cop and np.isnan(plate.cop_W).all() and not plate.free_moment_nm.any()
    assert len(notes) == 2


def test_a_component_that_is_not_there_is_named_with_what_may_stand_for_it(tmp_path):
    storage = storage_of(tmp_path, {name: value for name, value in columns("a").items() if name != "a_vz"})
    text = message(lambda: assign_prefixes(storage, {"right": "a"}))
    assert "forces.right: has no force columns a_vz. " in text
    assert "A component that was not measured may be a column of zeros" in text


@pytest.mark.parametrize(
    ("prefix", "torque"),
    [("ground_force_r", "ground_torque_r"), ("ground_force", "ground_torque"), ("1_ground_force", "1_ground_torque"),
     ("ground_force_1", "ground_moment_1_m")],
)
def test_spellings_of_torque(tmp_path, prefix, torque):
    named = columns(prefix, torque)
    if torque.endswith("_m"):
        named = {n.replace("_m_", "_m"): v for n, v in named.items()}
    plate, _ = read_plate(storage_of(tmp_path, named), prefix, mass_kg=MASS)
    np.testing.assert_allclose(plate.free_moment_nm, 3.0)


@pytest.mark.parametrize(
    ("force", "wanted"),
    [((0, -800, 0), "column ground_force_r_vy: the vertical force is negative (-800 N)"),
     ((30, 40, 800), "column ground_force_r_vz: the largest part of the force is along z, not upward along y"),
     ((800, 40, 20), "column ground_force_r_vx: the largest part of the force is along x"),
     ((0, 4000, 0), "is 5.1 times the body weight of 80 kg"),
     ((0, 1e300, 0), "column ground_force_r_vy: 1e+300 N is no force of a person")],
)
def test_force_that_no_foot_feels_is_refused(tmp_path, force, wanted):
    storage = storage_of(tmp_path, columns(force=force))
    text = message(lambda: read_plate(storage, "ground_force_r", mass_kg=MASS))
    assert wanted in text and "grf.mot" in text and "time" in text


def test_time_of_forces_must_increase(tmp_path):
    time = TIME.copy()
    time[5] = time[4]
    storage = storage_of(tmp_path, columns(), time)
    assert "time 0.04 s: time does not increase" in message(
        lambda: read_plate(storage, "ground_force_r", mass_kg=MASS))


def both(tmp_path, right, left):
    return storage_of(tmp_path, columns(right, f"{right}_t") | columns(left, f"{left}_t"))


@pytest.mark.parametrize(("right", "left"), [("ground_force_r", "ground_force_l"), ("R_grf", "L_grf"),
                                             ("force_right", "force_left")])
def test_names_that_tell_the_side(tmp_path, right, left):
    assert assign_prefixes(both(tmp_path, right, left), None) == {"right": right, "left": left}


def test_names_that_do_not_tell_the_side_list_what_to_write(tmp_path):
    storage = both(tmp_path, "ground_force", "1_ground_force")
    assert find_prefixes(storage) == ("ground_force", "1_ground_force")
    text = message(lambda: assign_prefixes(storage, None))
    assert "prefixes found: ground_force, 1_ground_force" in text
    assert "`forces: {file: grf.mot, right: PREFIX, left: PREFIX}`" in text
    stated = {"right": "ground_force", "left": "1_ground_force"}
    assert assign_prefixes(storage, stated) == stated
    assert assign_prefixes(storage, {"right": "1_ground_force", "left": None}) == {"right": "1_ground_force"}


def test_two_plates_of_the_same_side_need_the_mapping(tmp_path):
    storage = both(tmp_path, "force1_r", "force2_r")
    assert "prefixes found: force1_r, force2_r" in message(lambda: assign_prefixes(storage, None))


def test_wrong_mapping_is_refused(tmp_path):
    storage = both(tmp_path, "a", "b")
    assert "forces.left: has no force columns c_vx, c_vy, c_vz. Prefixes found: a, b" in message(
        lambda: assign_prefixes(storage, {"right": "a", "left": "c"}))
    assert "the same columns stand for both feet" in message(
        lambda: assign_prefixes(storage, {"right": "a", "left": "a"}))


def test_centre_of_pressure_hundreds_of_metres_away_is_dropped(shared_data):
    """example3DWalking writes positions up to 496 m while the plates are unloaded."""
    storage = read_storage(shared_data / "opensim_core" / "example3DWalking" / "grf_walk.mot")
    for prefix in ("ground_force_r", "ground_force_l"):
        plate, _ = read_plate(storage, prefix, mass_kg=85.27)
        assert np.nanmax(np.abs(plate.cop_W)) < 2.0
        np.testing.assert_array_equal(np.isnan(plate.cop_W[:, 0]), plate.force_W[:, 2] <= 20.0)
    assert np.nanmax(plate.cop_W[:, 1]) == pytest.approx(0.3244, abs=1e-3)
