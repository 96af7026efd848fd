"""Plates of a C3D file: a stated load on a plate of each type comes back, wherever the plate lies and turns."""

import ezc3d
import numpy as np
import pytest
from made_c3d import MadePlate, rectangle, write_c3d

from vsf_drake.errors import InputError
from vsf_drake.motion import read_trial

FRAMES, SAMPLES = 100, 1000
PHASE = np.linspace(0.0, 1.0, SAMPLES)
FORCE = np.column_stack([60 * np.sin(6 * PHASE), 20 * np.cos(3 * PHASE), 700 + 100 * np.cos(9 * PHASE)])
TWIST = 5.0 * np.sin(4 * PHASE)


def walker(way):
    """Markers of a body 1.7 m tall that walks a metre along `way`."""
    at = np.random.default_rng(1).uniform([0, -0.3, 0.05], [0.3, 0.3, 1.6], (14, 3))
    at[0, 2], at[1, 2] = 0.02, 1.72
    return {f"M{k}": p + np.outer(np.arange(FRAMES) / FRAMES, way) for k, p in enumerate(at)}


def load(centre, turn_deg=0.0, kind=2, height=0.0, **options):
    path = np.column_stack([0.1 * PHASE - 0.05, 0.05 * PHASE, np.full(SAMPLES, height)]) + np.array([*centre, 0.0])
    return MadePlate(kind, FORCE, path, TWIST, rectangle(centre, turn_deg=turn_deg, height=height), **options)


def check(read, made, rotation):
    np.testing.assert_allclose(read.rotation_W, rotation, atol=0)
    for plate, given in zip(read.plates, made, strict=True):
        np.testing.assert_allclose(plate.force_n, given.force @ rotation.T, atol=1e-3)
        np.testing.assert_allclose(plate.cop_m, given.cop @ rotation.T, atol=1e-6)
        np.testing.assert_allclose(plate.free_moment_nm, given.twist, atol=1e-4)
        np.testing.assert_allclose(plate.corners_m, given.corners @ rotation.T, atol=1e-6)


def message(call):
    with pytest.raises(InputError) as caught:
        call()
    return str(caught.value)


@pytest.mark.parametrize("origin_sign", [-1.0, 1.0])
@pytest.mark.parametrize("kind", [1, 2, 3, 4])
def test_load_comes_back_from_each_type_of_plate(tmp_path, kind, origin_sign):
    """The channels follow from the load by cross products over the sensors, not from the reader's formulas."""
    plate = load((0.45, 0.25), turn_deg=30.0, kind=kind, origin_sign=origin_sign)
    check(read_trial(write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=(plate,))), [plate], np.eye(3))


@pytest.mark.parametrize("turn_deg", [0.0, 90.0, 180.0, -90.0, 17.0])
def test_plate_may_lie_turned(tmp_path, turn_deg):
    plate = load((0.45, 0.25), turn_deg=turn_deg)
    check(read_trial(write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=(plate,))), [plate], np.eye(3))


def test_walking_along_minus_y_is_walking_forward(tmp_path):
    """Forward is -y of the laboratory, so left is its +x."""
    plates = (load((0.1, -0.4)), load((0.1, -1.2), kind=1))
    read = read_trial(write_c3d(tmp_path / "a.c3d", walker([0, -1.2, 0]), plates=plates))
    check(read, plates, np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]))
    assert read.markers["M0"][-1, 0] > read.markers["M0"][0, 0] + 1.0


def test_force_on_the_plate_is_turned_into_that_on_the_person(tmp_path):
    plate = load((0.45, 0.25), on_plate=True)
    read = read_trial(write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=(plate,)))
    check(read, [plate], np.eye(3))
    assert any("points down" in note for note in read.notes)


def test_moments_in_another_unit_than_stated_show_by_where_they_put_the_centre_of_pressure(tmp_path):
    plate = load((0.45, 0.25))
    read = read_trial(write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=(plate,), moment_unit="Nm"))
    check(read, [plate], np.eye(3))
    assert any("far off the plate" in note for note in read.notes)


def test_floor_is_where_the_plates_lie(tmp_path):
    plates = (load((0.4, 0.2), height=0.35), load((1.1, 0.2), height=0.35))
    markers = {label: place + np.array([0, 0, 0.35]) for label, place in walker([1.2, 0, 0]).items()}
    read = read_trial(write_c3d(tmp_path / "a.c3d", markers, plates=plates))
    np.testing.assert_allclose(read.plates[0].cop_m, plates[0].cop - np.array([0, 0, 0.35]), atol=1e-6)
    assert read.markers["M0"][0, 2] == pytest.approx(0.02, abs=1e-6)
    assert any("350 mm" in note for note in read.notes)


def test_stairs_are_refused(tmp_path):
    plates = (load((0.4, 0.2)), load((1.1, 0.2), height=0.18))
    path = write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=plates)
    assert "plate 2 lies 180 mm above plate 1" in message(lambda: read_trial(path))


def test_a_ramp_is_refused(tmp_path):
    plate = load((0.45, 0.25))
    tilt = np.radians(7.0)
    middle = plate.corners.mean(axis=0)
    turn = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    plate.corners = (plate.corners - middle) @ turn.T + middle
    path = write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=(plate,))
    assert "plate 1 is tilted by 7.0 degrees" in message(lambda: read_trial(path))


def test_plates_that_overlap_are_noted(tmp_path):
    apart = read_trial(write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=(load((0.4, 0)), load((0.81, 0)))))
    over = read_trial(write_c3d(tmp_path / "b.c3d", walker([1.2, 0, 0]), plates=(load((0.4, 0)), load((0.6, 0)))))
    assert not any("overlap" in note for note in apart.notes)
    assert any("Plates 1 and 2 overlap" in note for note in over.notes)


def test_plate_of_an_unknown_type_is_left_out_and_said(tmp_path):
    path = write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=(load((0.4, 0)), load((0.81, 0))))
    c3d = ezc3d.c3d(str(path))
    c3d.add_parameter("FORCE_PLATFORM", "TYPE", [2, 21])
    c3d.write(str(path))
    read = read_trial(path)
    assert [plate.name for plate in read.plates] == ["1"]
    assert any("type 21" in note for note in read.notes)


def changed(path, group, name, value):
    c3d = ezc3d.c3d(str(path))
    c3d["parameters"][group][name]["value"] = value
    c3d.write(str(path))


def test_a_plate_whose_channels_are_absent_is_left_out_beside_a_whole_one_and_said(tmp_path):
    plates = (load((0.45, 0.25)), load((1.2, 0.25)))
    path = write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=plates)
    changed(path, "FORCE_PLATFORM", "CHANNEL", np.column_stack([np.arange(1, 7), np.arange(13, 19)]))
    read = read_trial(path)
    check(read, plates[:1], np.eye(3))
    assert any("Force plate 2 of a.c3d was left out" in note and "channels 13 to 18" in note for note in read.notes)
    changed(path, "FORCE_PLATFORM", "CHANNEL", np.column_stack([np.arange(13, 19), np.arange(13, 19)]))
    assert "FORCE_PLATFORM:CHANNEL: force plate 1 uses analog channels 13 to 18" in message(lambda: read_trial(path))


@pytest.mark.parametrize("header", [7, 12, 0])
def test_samples_a_frame_are_those_on_which_channels_and_rates_agree(tmp_path, header):
    """Six channels at 1000 Hz in frames of 100 Hz make 10 samples a frame, whatever the header says."""
    plates = (load((0.45, 0.25)),)
    path = write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=plates)
    data = bytearray(path.read_bytes())
    assert data[18:20] == (10).to_bytes(2, "little")
    data[18:20] = header.to_bytes(2, "little")
    path.write_bytes(bytes(data))
    read = read_trial(path)
    check(read, plates, np.eye(3))
    assert read.force_rate_hz == 1000.0 and any(f"says {header} analog samples a frame" in n for n in read.notes)


@pytest.mark.parametrize(("used", "rate"), [(16, 1000.0), (16, 1200.0), (6, 1200.0), (7, 960.0)])
def test_the_headers_samples_a_frame_stand_where_the_parameters_disagree(tmp_path, used, rate):
    """60 numbers a frame in 10 samples: 16 channels do not divide them, 12 samples do but no parameter agrees."""
    plates = (load((0.45, 0.25)),)
    path = write_c3d(tmp_path / "a.c3d", walker([1.2, 0, 0]), plates=plates)
    data = path.read_bytes()
    at = data.index(b"USED", data.index(b"ANALOG"))
    assert data[at + 6] == 2 and data[at + 8:at + 10] == (6).to_bytes(2, "little")
    data = data[:at + 8] + used.to_bytes(2, "little") + data[at + 10:]
    old, new = (np.float32(value).tobytes() for value in (1000.0, rate))
    path.write_bytes(data.replace(old, new, 1))
    read = read_trial(path)
    check(read, plates, np.eye(3))
    assert read.force_rate_hz == 1000.0
    assert any("ANALOG:RATE" in note for note in read.notes) == (rate != 1000.0)
