"""What is written reads back as it was: every number, gap, label and time."""

import dataclasses

import numpy as np
import pytest
from virtual_laboratory.trc import write_trc

from vsf_drake.motion import Recording, read_trial
from vsf_drake.motion.formats.recording import Plate
from vsf_drake.motion.formats.tables import write_forces_mot

RNG = np.random.default_rng(5)
FRAMES = 40


def recording(tmp_path, rate=119.88012, start=0.4):
    low, high = [0, -0.3, 0.05], [0.3, 0.3, 1.7]
    markers = {name: RNG.uniform(low, high, (FRAMES, 3)) for name in ("Ferse_für", "R.ASIS", "c")}
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


def test_trc_in_millimetres_differs_by_rounding_only(tmp_path):
    made = recording(tmp_path)
    write_trc(tmp_path / "a.trc", made, unit="mm")
    assert "\tmm\t" in (tmp_path / "a.trc").read_text()
    for label, place in read_trial(tmp_path / "a.trc").markers.items():
        np.testing.assert_allclose(place, made.markers[label], rtol=4e-16)


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


def test_real_recording_goes_out_and_comes_back(tmp_path, shared_data):
    walk = read_trial(shared_data / "opensim_core" / "c3d" / "walking2.c3d")
    write_trc(tmp_path / "a.trc", walk)
    write_forces_mot(tmp_path / "a.mot", time_s=walk.force_time_s, plates={p.name: p for p in walk.plates})
    again = read_trial(tmp_path / "a.trc", forces=tmp_path / "a.mot")
    for label, place in walk.markers.items():
        np.testing.assert_array_equal(again.markers[label], place)
    for found, made in zip(again.plates, walk.plates, strict=True):
        np.testing.assert_array_equal(found.force_n, made.force_n)
        np.testing.assert_array_equal(found.cop_m, made.cop_m)


def test_what_cannot_be_written_leaves_nothing_behind(tmp_path):
    made = recording(tmp_path)
    bad = dataclasses.replace(made, markers={**made.markers, "d": np.zeros((3, 3))})
    for wrong, options in ((bad, {}), (made, {"unit": "furlong"}), ({"a\tb": np.zeros((2, 3))}, {"rate_hz": 1.0})):
        with pytest.raises(ValueError, match=r"must be|label"):
            write_trc(tmp_path / "a.trc", wrong, **options)
    assert list(tmp_path.iterdir()) == []
