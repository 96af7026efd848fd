"""C3D: markers, units, frames and labels as the file states them; damaged files are refused."""

import ezc3d
import numpy as np
import pytest
from made_c3d import write_c3d

from vsf_drake.errors import InputError
from vsf_drake.motion import read_trial
from vsf_drake.motion.formats.read import list_labels
from vsf_drake.motion.formats.tables import read_storage, read_trc

FRAMES, RATE = 100, 100.0


def body(speed=(1.2, 0.0, 0.0), count=14):
    """Markers of a body 1.7 m tall that walks, label -> (frames, 3) m."""
    at = np.random.default_rng(1).uniform([0, -0.3, 0.05], [0.3, 0.3, 1.6], (count, 3))
    at[0, 2], at[1, 2] = 0.02, 1.72
    time = np.arange(FRAMES) / RATE
    return {f"M{k}": place + np.outer(time, speed) for k, place in enumerate(at)}


def message(call):
    with pytest.raises(InputError) as caught:
        call()
    return str(caught.value)


@pytest.fixture(scope="module")
def walking2(shared_data):
    return read_trial(shared_data / "opensim_core" / "c3d" / "walking2.c3d")


def test_real_markers_agree_with_the_reference_beside_them(walking2, shared_data):
    """The reference has every tenth frame, in mm to one decimal; its rate stands wrong in its header."""
    path = shared_data / "opensim_core" / "c3d" / "std_walking2_markers.trc"
    rows = [line.split("\t") for line in path.read_text().splitlines()[5:] if line.strip()]
    labels = [label for label in path.read_text().splitlines()[3].split("\t")[2:] if label]
    worst = 0.0
    for row in rows:
        values = np.array([float(cell) for cell in row[2:]]).reshape(-1, 3)
        frame = round(float(row[1]) * walking2.marker_rate_hz)
        ours = 1e3 * np.array([walking2.markers[label][frame] for label in labels])
        np.testing.assert_array_equal(np.isnan(ours), np.isnan(values))
        worst = max(worst, np.nanmax(np.abs(ours - values), initial=0.0))
    assert len(rows) == 126 and worst <= 0.05 + 1e-9


def test_real_forces_agree_with_the_reference_beside_them(walking2, shared_data):
    table = read_storage(shared_data / "opensim_core" / "c3d" / "std_cop_walking2_grfs.sto")
    sample = np.round(table.time_s * walking2.force_rate_hz).astype(int)
    for k, plate in enumerate(walking2.plates):
        force, cop, moment = (table.values[:, 9 * k + 3 * i:9 * k + 3 * i + 3] for i in range(3))
        np.testing.assert_allclose(plate.force_n[sample], force, atol=0.01)
        loaded = force[:, 2] > 50.0
        assert loaded.sum() >= 8
        np.testing.assert_allclose(1e3 * plate.cop_m[sample][loaded], cop[loaded], atol=0.1)
        np.testing.assert_allclose(plate.free_moment_nm[sample][loaded], 1e-3 * moment[loaded, 2], atol=1e-3)


def test_a_second_reader_finds_the_same(walking2, shared_data):
    """ezc3d on the same file: every marker, force, centre of pressure and free moment."""
    other = ezc3d.c3d(str(walking2.path), extract_forceplat_data=True)
    points = other["data"]["points"][:3].transpose(2, 1, 0)
    np.testing.assert_allclose(np.stack(list(walking2.markers.values()), axis=1), 1e-3 * points, atol=1e-12)
    for plate, theirs in zip(walking2.plates, other["data"]["platform"], strict=True):
        loaded = plate.force_n[:, 2] > 20.0
        np.testing.assert_allclose(plate.force_n, theirs["force"].T, atol=1e-9)
        np.testing.assert_allclose(plate.cop_m[loaded], 1e-3 * theirs["center_of_pressure"].T[loaded], atol=1e-9)
        np.testing.assert_allclose(plate.free_moment_nm[loaded], 1e-3 * theirs["Tz"][2][loaded], atol=1e-9)
        assert np.isnan(plate.cop_m[~loaded]).all() and not plate.free_moment_nm[~loaded].any()


def test_what_an_unloaded_plate_shows_is_said_and_not_subtracted(walking2):
    assert any("Plate 1 shows" in note and "nothing was subtracted" in note for note in walking2.notes)


@pytest.mark.parametrize(("unit", "length"), [("mm", 1e-3), ("m", 1.0), ("cm", 1e-2), ("Meters", 1.0)])
def test_markers_come_in_metres_whatever_the_unit(tmp_path, unit, length):
    markers = body()
    path = write_c3d(tmp_path / "walk.c3d", markers, unit=unit, length=length)
    read = read_trial(path.rename(tmp_path / "Walk.C3D"))
    assert list(read.markers) == list(markers)
    for label, place in markers.items():
        np.testing.assert_allclose(read.markers[label], place, atol=1e-6)


def test_a_missing_unit_is_asked_for(tmp_path):
    path = write_c3d(tmp_path / "walk.c3d", body(), unit=None)
    assert "Give laboratory.length_unit (--length-unit)" in message(lambda: read_trial(path))
    assert read_trial(path, length_unit="mm").markers["M1"][0, 2] == pytest.approx(1.72)


@pytest.mark.parametrize(("unit", "length"), [("m", 1e-3), ("mm", 1.0)])
def test_a_body_of_1700_m_or_of_2_mm_is_in_another_unit(tmp_path, unit, length):
    path = write_c3d(tmp_path / "walk.c3d", body(), unit=unit, length=length)
    assert "which no person does" in message(lambda: read_trial(path)) and "length_unit" in message(
        lambda: read_trial(path))
    read_trial(path, length_unit={1e-3: "mm", 1.0: "m"}[length])


def test_a_marker_that_was_not_seen_is_a_gap(tmp_path):
    markers = body()
    markers["M3"][10:20] = np.nan
    read = read_trial(write_c3d(tmp_path / "walk.c3d", markers))
    assert np.isnan(read.markers["M3"][10:20]).all() and np.isfinite(read.markers["M3"][20:]).all()


def test_time_runs_from_the_first_frame_of_the_trial(tmp_path):
    read = read_trial(write_c3d(tmp_path / "walk.c3d", body(), first_frame=51))
    assert read.marker_start_s == pytest.approx(0.5) and read.marker_time_s[-1] == pytest.approx(1.49)


def test_a_subjects_prefix_is_taken_away(tmp_path):
    path = write_c3d(tmp_path / "walk.c3d", {f"Jürgen:{k}": v for k, v in body().items()})
    assert list_labels(path)[:2] == ["M0", "M1"]
    assert any("Jürgen" in note for note in read_trial(path).notes)


def test_a_file_of_unlabelled_points_is_refused(tmp_path):
    path = write_c3d(tmp_path / "walk.c3d", {f"*{k}": place for k, place in enumerate(body().values())})
    assert "neither labelled markers nor force plates" in message(lambda: read_trial(path))


def test_labels_in_any_alphabet_stay_as_they_are(tmp_path):
    names = ["Ferse_für_links", "膝", "колено"]
    markers = dict(zip(names, body().values(), strict=False))
    assert list_labels(write_c3d(tmp_path / "walk.c3d", markers)) == names


@pytest.mark.parametrize("hidden", [False, True])
def test_of_a_label_that_stands_twice_the_first_that_is_seen_is_read_and_said(tmp_path, hidden):
    markers = body()
    second, first = markers["M4"].copy(), markers["M2"].copy()
    if hidden:
        markers["M2"] = np.full_like(first, np.nan)
    path = write_c3d(tmp_path / "walk.c3d", markers)
    relabelled(path, "M4", "M2")
    read = read_trial(path)
    assert list(read.markers).count("M2") == 1 and "M4" not in read.markers
    np.testing.assert_allclose(read.markers["M2"], second if hidden else first, atol=1e-6)
    assert any("M2 stands twice: the first" in note for note in read.notes)


def relabelled(path, old, new):
    c3d = ezc3d.c3d(str(path))
    labels = c3d["parameters"]["POINT"]["LABELS"]["value"]
    data = path.read_bytes()
    width = max(map(len, labels))
    assert data.count(old.encode().ljust(width)) == 1
    path.write_bytes(data.replace(old.encode().ljust(width), new.encode().ljust(width)))


@pytest.mark.parametrize(("unit", "length"), [("mete", 1.0), ("mill", 1e-3), ("cent", 1e-2), ("millim", 1e-3)])
def test_a_unit_that_was_cut_to_the_fields_width_is_read(tmp_path, unit, length):
    read = read_trial(write_c3d(tmp_path / "walk.c3d", body(), unit=unit, length=length))
    assert read.markers["M1"][0, 2] == pytest.approx(1.72)


@pytest.mark.parametrize("unit", ["me", "met", "mi", "metric", "cents", "inc", "x"])
def test_a_unit_that_could_be_anything_is_refused(tmp_path, unit):
    path = write_c3d(tmp_path / "walk.c3d", body(), unit=unit)
    assert f"POINT:UNITS: the unit '{unit}' is unknown" in message(lambda: read_trial(path))


@pytest.mark.parametrize(("mass", "height", "stated"), [
    (71.5, 1760.0, {"mass_kg": 71.5, "stature_m": 1.76}), (71.5, 176.0, {"mass_kg": 71.5, "stature_m": 1.76}),
    (71.5, 1.76, {"mass_kg": 71.5, "stature_m": 1.76}), (0.0, 0.0, {}), (7150.0, 17.0, {})])
def test_mass_and_stature_that_the_file_states_are_read_where_somebody_has_them(tmp_path, mass, height, stated):
    path = write_c3d(tmp_path / "walk.c3d", body())
    c3d = ezc3d.c3d(str(path))
    c3d.add_parameter("PROCESSING", "Bodymass", [mass])
    c3d.add_parameter("PROCESSING", "Height", [height])
    c3d.write(str(path))
    read = read_trial(path)
    assert dict(read.person) == pytest.approx(stated, rel=1e-6)
    assert sum("nobody's" in note for note in read.notes) == (2 if mass == 7150.0 else 0)


@pytest.mark.parametrize("kept", [0, 100, 511, 600, 3000, -2000])
def test_a_truncated_file_is_refused(tmp_path, kept):
    path = write_c3d(tmp_path / "walk.c3d", body())
    data = path.read_bytes()
    path.write_bytes(data[:kept])
    assert str(path) in message(lambda: read_trial(path))


def test_an_absurd_number_of_frames_reserves_nothing(tmp_path):
    path = write_c3d(tmp_path / "walk.c3d", body())
    data = bytearray(path.read_bytes())
    data[8:10] = b"\xfe\xff"
    path.write_bytes(bytes(data))
    assert "the header says 65534 frames, the file holds 100" in message(lambda: read_trial(path))


def test_recording_of_more_frames_than_16_bits_count(tmp_path):
    frames = 70_000
    markers = {"a": np.tile([0.1, 0.2, 0.3], (frames, 1)), "b": np.tile([0.4, 0.2, 0.9], (frames, 1))}
    assert read_trial(write_c3d(tmp_path / "long.c3d", markers, rate=1000.0)).frames == frames


def test_reference_trc_whose_last_row_is_out_of_step_is_refused(shared_data):
    path = shared_data / "opensim_core" / "c3d" / "std_walking2_markers.trc"
    assert "line 132: time 4.992 s follows 4.96 s" in message(lambda: read_trc(path))
