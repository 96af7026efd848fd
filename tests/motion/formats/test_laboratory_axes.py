"""Which way is up and which way is forward, for any laboratory's axes."""

import numpy as np
import pytest
from made_c3d import MadePlate, rectangle, write_c3d
from virtual_laboratory.trc import write_trc

from vsf_drake.errors import InputError
from vsf_drake.motion import read_trial

FRAMES = 50
AT = np.random.default_rng(2).uniform([0, -0.25, 0.05], [0.3, 0.25, 1.6], (14, 3))
AT[0, 2], AT[1, 2] = 0.02, 1.72


def walk(way=(1.0, 0.0, 0.0)):
    """Markers in W of a body 1.7 m tall that goes `way` in the recording."""
    return {f"M{k}": p + np.outer(np.linspace(0, 1, FRAMES), way) for k, p in enumerate(AT)}


def seen_in(rotation, markers):
    """The same markers in a laboratory whose vectors `rotation` takes to W."""
    return {label: place @ rotation for label, place in markers.items()}


def message(call):
    with pytest.raises(InputError) as caught:
        call()
    return str(caught.value)


def rotation_of(ahead, up):
    axes = {s + n: sign * np.eye(3)[i] for i, n in enumerate("xyz") for s, sign in (("+", 1.0), ("-", -1.0))}
    return np.array([axes[ahead], np.cross(axes[up], axes[ahead]), axes[up]])


PAIRS = [(a, u) for u in ("+x", "-x", "+y", "-y", "+z", "-z") for a in ("+x", "-x", "+y", "-y", "+z", "-z")
         if a[1] != u[1]]


@pytest.mark.parametrize(("ahead", "up"), PAIRS)
def test_any_laboratory_comes_into_the_world_frame(tmp_path, ahead, up):
    rotation = rotation_of(ahead, up)
    path = write_c3d(tmp_path / "a.c3d", seen_in(rotation, walk()), screen=("+X", up.upper()))
    read = read_trial(path)
    np.testing.assert_array_equal(read.rotation_W, rotation)
    for label, place in walk().items():
        np.testing.assert_allclose(read.markers[label], place, atol=1e-6)


def test_forward_as_stated(tmp_path):
    path = write_c3d(tmp_path / "a.c3d", walk())
    np.testing.assert_array_equal(read_trial(path, forward="-y").rotation_W, rotation_of("-y", "+z"))
    assert "lies along the vertical" in message(lambda: read_trial(path, forward="z"))
    assert "'w' is no axis" in message(lambda: read_trial(path, forward="w"))


def test_walking_obliquely_keeps_the_laboratorys_axis(tmp_path):
    angle = np.radians(20.0)
    path = write_c3d(tmp_path / "a.c3d", walk((-np.cos(angle), np.sin(angle), 0)))
    np.testing.assert_array_equal(read_trial(path).rotation_W, rotation_of("-x", "+z"))


def test_standing_or_on_a_treadmill_forward_is_the_laboratorys_x(tmp_path):
    read = read_trial(write_c3d(tmp_path / "a.c3d", walk((0.0, -0.3, 0.0))))
    np.testing.assert_array_equal(read.rotation_W, np.eye(3))
    assert any("do not travel" in note for note in read.notes)


def test_markers_that_come_and_go_do_not_make_a_direction(tmp_path):
    """One marker seen only at the start and another far ahead only at the end: the person still stands."""
    markers = walk((0.0, 0.0, 0.0))
    markers["M5"][5:] = np.nan
    markers["M6"] += [3.0, 0.0, 0.0]
    markers["M6"][:-5] = np.nan
    assert any("do not travel" in n for n in read_trial(write_c3d(tmp_path / "a.c3d", markers)).notes)


def test_without_screen_and_plates_up_is_asked_for(tmp_path):
    path = write_c3d(tmp_path / "a.c3d", walk(), screen=None)
    assert "Give laboratory.up (--up): x, y or z" in message(lambda: read_trial(path))
    np.testing.assert_array_equal(read_trial(path, up="z").rotation_W, np.eye(3))


@pytest.mark.parametrize("screen", [None, ("+X", "+Y")])
def test_plates_tell_the_vertical_where_the_screen_does_not_or_is_wrong(tmp_path, screen):
    count = 10 * FRAMES
    plate = MadePlate(2, np.tile([0.0, 0.0, 700.0], (count, 1)), np.tile([0.4, 0.1, 0.0], (count, 1)), np.zeros(count),
                      rectangle((0.4, 0.1)))
    read = read_trial(write_c3d(tmp_path / "a.c3d", walk(), screen=screen, plates=(plate,)))
    np.testing.assert_array_equal(read.rotation_W, np.eye(3))
    assert any("force plates lie across +z" in note for note in read.notes)


def test_a_person_who_lies_or_stands_on_the_head_is_refused_with_the_remedy(tmp_path):
    lying = write_c3d(tmp_path / "a.c3d", walk(), screen=("+X", "+Y"))
    assert "Give laboratory.up (--up), probably z" in message(lambda: read_trial(lying))
    upside = write_c3d(tmp_path / "b.c3d", walk(), screen=("+X", "-Z"))
    assert "below the floor" in message(lambda: read_trial(upside))


def test_trc_is_y_up_unless_its_markers_say_otherwise(tmp_path):
    write_trc(tmp_path / "a.trc", walk(), rate_hz=50.0)
    np.testing.assert_array_equal(read_trial(tmp_path / "a.trc").rotation_W, rotation_of("+x", "+y"))
    write_trc(tmp_path / "b.trc", seen_in(rotation_of("+x", "+y").T, walk()), rate_hz=50.0)
    assert "Give laboratory.up (--up), probably z" in message(lambda: read_trial(tmp_path / "b.trc"))
    read = read_trial(tmp_path / "b.trc", up="z")
    np.testing.assert_allclose(read.markers["M3"], walk()["M3"], atol=1e-12)
