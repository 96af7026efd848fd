"""Any laboratory's axes come into the world frame; what is written reads back."""

from __future__ import annotations

import numpy as np
import pytest
from made_c3d import MadePlate, rectangle, write_c3d
from virtual_laboratory.trc import write_trc

from vsf_drake.base.errors import InputError
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import Plate, Recording
from vsf_drake.motion.formats.tables import write_forces_mot

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
    axes = {
        s + n: sign * np.eye(3)[i]
        for i, n in enumerate("xyz")
        for s, sign in (("+", 1.0), ("-", -1.0))
    }
    return np.array([axes[ahead], np.cross(axes[up], axes[ahead]), axes[up]])


@pytest.mark.parametrize("up", ["+x", "-x", "+y", "-y", "+z", "-z"])
def test_any_laboratory_comes_into_the_world_frame(tmp_path, up):
    for ahead in (sign + axis for sign in "+-" for axis in "xyz" if axis != up[1]):
        rotation = rotation_of(ahead, up)
        read = read_trial(
            write_c3d(tmp_path / "a.c3d", seen_in(rotation, walk()), screen=("+X", up.upper()))
        )
        np.testing.assert_array_equal(read.rotation_W, rotation)
        for label, place in walk().items():
            np.testing.assert_allclose(read.markers[label], place, atol=1e-6)


def test_forward_is_as_stated_or_the_laboratorys_axis_nearest_to_the_way(tmp_path):
    path = write_c3d(tmp_path / "a.c3d", walk())
    np.testing.assert_array_equal(
        read_trial(path, forward="-y").rotation_W, rotation_of("-y", "+z")
    )
    assert "lies along the vertical" in message(lambda: read_trial(path, forward="z"))
    assert "'w' is no axis" in message(lambda: read_trial(path, forward="w"))
    angle = np.radians(20.0)
    oblique = read_trial(write_c3d(tmp_path / "b.c3d", walk((-np.cos(angle), np.sin(angle), 0))))
    np.testing.assert_array_equal(oblique.rotation_W, rotation_of("-x", "+z"))


def test_up_is_the_screens_or_across_the_plates_or_asked_for(tmp_path):
    few = {label: walk()[label] for label in ("M0", "M1", "M2")}
    path = write_c3d(tmp_path / "a.c3d", few, screen=None)
    assert "Give laboratory.up (--up): x, y or z" in message(lambda: read_trial(path))
    np.testing.assert_array_equal(read_trial(path, up="z").rotation_W, np.eye(3))
    for screen in (None, ("+X", "+Y")):
        read = read_trial(write_c3d(tmp_path / "a.c3d", walk(), screen=screen, plates=(plate(),)))
        np.testing.assert_array_equal(read.rotation_W, np.eye(3))
        assert any("force plates lie across +z" in note for note in read.notes)


def plate(turned=False):
    """A plate on which 700 N press, in W or in W turned upside down."""
    count = 10 * FRAMES
    corners = rectangle((0.4, 0.1))
    made = MadePlate(
        2,
        np.tile([0.0, 0.0, 700.0], (count, 1)),
        np.tile([0.4, 0.1, 0.0], (count, 1)),
        np.zeros(count),
        corners,
    )
    if turned:
        turn = rotation_of("+x", "-z").T
        made.force, made.cop, made.corners = (
            vectors @ turn.T for vectors in (made.force, made.cop, made.corners)
        )
        made.up = turn @ made.up
    return made


@pytest.mark.parametrize("screen", [("+X", "-Z"), ("+X", "+Z")])
def test_markers_on_the_plates_other_side_than_the_screens_up_turn_it(tmp_path, screen):
    """The person stands on the plates, whatever the screen says: up is where the markers are."""
    down = screen[1] == "+Z"
    up = "-z" if down else "+z"
    seen = seen_in(rotation_of("+x", up), walk())
    path = write_c3d(tmp_path / "a.c3d", seen, screen=screen, plates=(plate(turned=down),))
    read = read_trial(path)
    np.testing.assert_array_equal(read.rotation_W, rotation_of("+x", up))
    np.testing.assert_allclose(read.markers["M3"], walk()["M3"], atol=1e-6)
    np.testing.assert_allclose(read.plates[0].force_n[:, 2], 700.0)
    assert any(f"stands the other way: {up} was taken" in note for note in read.notes)


SQUAT = {"HEE": 0.05, "TOE": 0.04, "ANK": 0.1, "KNE": 0.45, "ASI": 0.55, "PSI": 0.6, "SHO": 0.95}
"""Heights (m) of markers of somebody who squats."""


def squat(raised_m=0.0):
    """Markers in W of somebody who squats, `raised_m` above the origin."""
    forward = np.random.default_rng(4).uniform(-0.2, 0.25, 2 * len(SQUAT))
    places = [
        (side + label, (x, y, height + raised_m))
        for (side, y, label, height), x in zip(
            ((s, y, *pair) for s, y in (("R", -0.15), ("L", 0.15)) for pair in SQUAT.items()),
            forward,
            strict=True,
        )
    ]
    return {label: np.tile(place, (FRAMES, 1)) for label, place in places}


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("raised_m", [0.0, 0.5])
@pytest.mark.parametrize("up", ["+x", "-y", "+z", "-z"])
def test_a_squat_with_a_full_marker_set_shows_which_way_is_up(tmp_path, up, raised_m, named):
    """No screen, no plates: pelvis and shoulders are above the feet, or all above the origin."""
    ahead = "+y" if up[1] != "y" else "+x"
    rotation = rotation_of(ahead, up)
    markers = seen_in(rotation, squat(raised_m))
    if not named:
        markers = {f"M{k}": place for k, place in enumerate(markers.values())}
    path = write_c3d(tmp_path / "a.c3d", markers, screen=None)
    if raised_m and not named:
        assert "Give laboratory.up (--up): x, y or z" in message(lambda: read_trial(path))
        return
    read = read_trial(path)
    np.testing.assert_array_equal(read.rotation_W[2], rotation[2])
    assert any(f"extend most along {up[1]}: {up} was taken" in note for note in read.notes)


def test_markers_that_reach_farther_than_a_person_do_not_show_which_way_is_up(tmp_path):
    """Of the laboratory, along the way; the person between them stands along z."""
    along = {"start": 0.1, "end": 4.0}
    markers = walk() | {name: np.tile([x, 0.0, 0.0], (FRAMES, 1)) for name, x in along.items()}
    path = write_c3d(tmp_path / "a.c3d", markers, screen=None)
    assert "Give laboratory.up (--up): x, y or z" in message(lambda: read_trial(path))


def test_a_person_who_lies_or_stands_on_the_head_is_refused_with_the_remedy(tmp_path):
    lying = write_c3d(tmp_path / "a.c3d", walk(), screen=("+X", "+Y"))
    assert "Give laboratory.up (--up), probably z" in message(lambda: read_trial(lying))
    upside = write_c3d(tmp_path / "b.c3d", walk(), screen=("+X", "-Z"))
    assert "below the floor" in message(lambda: read_trial(upside))
    # which is y up unless its markers say otherwise
    write_trc(tmp_path / "a.trc", walk(), rate_hz=50.0)
    np.testing.assert_array_equal(
        read_trial(tmp_path / "a.trc").rotation_W, rotation_of("+x", "+y")
    )
    write_trc(tmp_path / "b.trc", seen_in(rotation_of("+x", "+y").T, walk()), rate_hz=50.0)
    read = read_trial(tmp_path / "b.trc")
    np.testing.assert_allclose(read.markers["M3"], walk()["M3"], atol=1e-12)
    assert any("extend most along z: +z was taken as up" in note for note in read.notes)
    assert "Give laboratory.up (--up), probably z" in message(
        lambda: read_trial(tmp_path / "b.trc", up="y")
    )


def test_what_is_written_reads_back_bit_for_bit(tmp_path):
    rng, count = np.random.default_rng(5), 300
    markers = {
        name: rng.uniform([0, -0.3, 0.05], [0.3, 0.3, 1.7], (40, 3))
        for name in ("Ferse_für", "R.ASIS", "c")
    }
    markers["c"][3:9] = np.nan
    write_trc(
        tmp_path / "a.trc", Recording(tmp_path / "x.c3d", markers, 119.88012, marker_start_s=0.4)
    )
    read = read_trial(tmp_path / "a.trc")
    assert list(read.markers) == list(markers) and (read.marker_rate_hz, read.marker_start_s) == (
        119.88012,
        0.4,
    )
    for label, place in markers.items():
        np.testing.assert_array_equal(read.markers[label], place)
    plates = {}
    for key in ("r", "l"):
        force = np.column_stack(
            [rng.normal(0, 40, count), rng.normal(0, 20, count), rng.uniform(400, 900, count)]
        )
        cop, moment = (
            np.column_stack([rng.uniform(0, 1, (count, 2)), np.zeros(count)]),
            rng.normal(0, 3, count),
        )
        force[:50] *= 0.001
        cop[:50], moment[:50] = np.nan, 0.0
        plates[key] = Plate(key, force, cop, moment)
    for suffix in ("mot", "sto"):
        path = tmp_path / f"grf.{suffix}"
        write_forces_mot(path, time_s=0.25 + np.arange(count) / 1000.0, plates=plates)
        read = read_trial(path)
        assert (read.force_rate_hz, read.force_start_s) == (1000.0, 0.25)
        assert [p.name for p in read.plates] == ["ground_force_r", "ground_force_l"]
        for back, made in zip(read.plates, plates.values(), strict=True):
            np.testing.assert_array_equal(back.force_n, made.force_n)
            np.testing.assert_array_equal(back.cop_m, made.cop_m)
            np.testing.assert_array_equal(back.free_moment_nm, made.free_moment_nm)
