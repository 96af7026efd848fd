"""Any laboratory's axes come into the world frame; what is written reads back; long files need little memory."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from made_c3d import MadePlate, rectangle, write_c3d
from virtual_laboratory.trc import write_trc

from vsf_drake.errors import InputError
from vsf_drake.motion import Recording, read_trial
from vsf_drake.motion.formats.recording import Plate
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


def test_standing_or_on_a_treadmill_forward_is_the_laboratorys_x(tmp_path):
    read = read_trial(write_c3d(tmp_path / "a.c3d", walk((0.0, -0.3, 0.0))))
    np.testing.assert_array_equal(read.rotation_W, np.eye(3))
    assert any("do not travel" in note for note in read.notes)


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


RNG = np.random.default_rng(5)
TRC_FRAMES = 40


def recording(tmp_path, rate=119.88012, start=0.4):
    low, high = [0, -0.3, 0.05], [0.3, 0.3, 1.7]
    markers = {name: RNG.uniform(low, high, (TRC_FRAMES, 3)) for name in ("Ferse_für", "R.ASIS", "c")}
    markers["c"][3:9] = np.nan
    return Recording(tmp_path / "x.c3d", markers, rate, marker_start_s=start)


def test_trc_round_trip_is_exact(tmp_path):
    made = recording(tmp_path)
    write_trc(tmp_path / "a.trc", made)
    read = read_trial(tmp_path / "a.trc")
    assert list(read.markers) == list(made.markers)
    assert (read.marker_rate_hz, read.marker_start_s) == (made.marker_rate_hz, made.marker_start_s)
    for label, place in made.markers.items():
        np.testing.assert_array_equal(read.markers[label], place)


def plate(name, count=300):
    force = np.column_stack([RNG.normal(0, 40, count), RNG.normal(0, 20, count), RNG.uniform(400, 900, count)])
    cop = np.column_stack([RNG.uniform(0, 1, (count, 2)), np.zeros(count)])
    moment = RNG.normal(0, 3, count)
    force[:50] *= 0.001
    cop[:50], moment[:50] = np.nan, 0.0
    return Plate(name, force, cop, moment)


@pytest.mark.parametrize("suffix", ["mot", "sto"])
def test_forces_round_trip_is_exact(tmp_path, suffix):
    plates = {key: plate(key) for key in ("r", "l")}
    path = tmp_path / f"grf.{suffix}"
    write_forces_mot(path, time_s=0.25 + np.arange(300) / 1000.0, plates=plates)
    read = read_trial(path)
    assert (read.force_rate_hz, read.force_start_s) == (1000.0, 0.25)
    assert [p.name for p in read.plates] == ["ground_force_r", "ground_force_l"]
    for found, made in zip(read.plates, plates.values(), strict=True):
        np.testing.assert_array_equal(found.force_n, made.force_n)
        np.testing.assert_array_equal(found.cop_m, made.cop_m)
        np.testing.assert_array_equal(found.free_moment_nm, made.free_moment_nm)


MOST = 4.0
"""Times the file's size; 32-bit numbers become 64-bit ones, which is twice."""
LONG = 5000


def paths(count: int, labels: str = "M{}") -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    middle = rng.uniform([-0.3, -0.3, 0.0], [0.3, 0.3, 1.8], (count, 3))
    travelled = np.linspace(0.0, 3.0, LONG)[:, None] * [1.0, 0.0, 0.0]
    return {labels.format(k): p + travelled for k, p in enumerate(middle)}


def times_its_size(path: Path) -> float:
    tracemalloc.start()
    try:
        read_trial(path)
        return tracemalloc.get_traced_memory()[1] / path.stat().st_size
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("named, nameless", [(250, 0), (200, 50)], ids=["all named", "some without a name"])
def test_c3d_of_many_markers(tmp_path, named, nameless):
    path = write_c3d(tmp_path / "markers.c3d", paths(named) | paths(nameless, "*{}"))
    assert path.stat().st_size > 19e6
    assert times_its_size(path) < MOST


def test_c3d_of_many_force_samples(tmp_path):
    subframes = 40
    samples = LONG * subframes
    force, cop = np.tile([10.0, 5.0, 700.0], (samples, 1)), np.tile([0.05, 0.02, 0.0], (samples, 1))
    plates = tuple(MadePlate(kind, force, cop + np.array([x, 0.0, 0.0]), np.ones(samples), rectangle((x, 0.0)))
                   for kind, x in ((2, 0.0), (1, 0.5), (2, 1.0), (4, 1.5)))
    path = write_c3d(tmp_path / "plates.c3d", paths(5), plates=plates, subframes=subframes)
    assert path.stat().st_size > 19e6
    assert times_its_size(path) < MOST


def test_trc_of_many_markers(tmp_path):
    """Six digits a number, as programs write millimetres."""
    path = tmp_path / "markers.trc"
    count, rows = 100, 8000
    labels = "\t".join(f"M{k}\t\t" for k in range(count))
    cells = "\t".join(f"{100 + k:.1f}\t{6 * k:.1f}\t{200 - k:.1f}" for k in range(count))
    with open(path, "w", encoding="utf-8") as stream:
        stream.write("PathFileType\t4\t(X/Y/Z)\tmarkers.trc\nDataRate\tNumFrames\tNumMarkers\tUnits\n"
                     f"100\t{rows}\t{count}\tmm\nFrame#\tTime\t{labels}\n\n")
        stream.writelines(f"{n + 1}\t{n / 100:.2f}\t{cells}\n" for n in range(rows))
    assert path.stat().st_size > 12e6
    assert times_its_size(path) < MOST
