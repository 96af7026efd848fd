"""C3D: markers, units, frames and plates as the file states them; damaged files are refused."""

import ezc3d
import numpy as np
import pytest
from made_c3d import KISTLER_9281E, MadePlate, rectangle, with_parameters, write_c3d

from vsf_drake.base.errors import InputError
from vsf_drake.motion.formats.read import read_trial

FRAMES, RATE, SAMPLES = 100, 100.0, 1000


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


def test_a_second_reader_finds_the_same(walking2, shared_data):
    """ezc3d on the same file: every marker, force, centre of pressure and free moment."""
    other = ezc3d.c3d(str(walking2.path), extract_forceplat_data=True)
    points = other["data"]["points"][:3].transpose(2, 1, 0)
    np.testing.assert_allclose(
        np.stack(list(walking2.markers.values()), axis=1), 1e-3 * points, atol=1e-12
    )
    for plate, theirs in zip(walking2.plates, other["data"]["platform"], strict=True):
        loaded = plate.force_n[:, 2] > 20.0
        np.testing.assert_allclose(plate.force_n, theirs["force"].T, atol=1e-9)
        np.testing.assert_allclose(
            plate.cop_m[loaded], 1e-3 * theirs["center_of_pressure"].T[loaded], atol=1e-9
        )
        np.testing.assert_allclose(
            plate.free_moment_nm[loaded], 1e-3 * theirs["Tz"][2][loaded], atol=1e-9
        )
        assert np.isnan(plate.cop_m[~loaded]).all() and not plate.free_moment_nm[~loaded].any()


@pytest.mark.parametrize(
    ("unit", "length"),
    [
        ("mm", 1e-3),
        ("m", 1.0),
        ("cm", 1e-2),
        ("Meters", 1.0),
        ("mete", 1.0),
        ("mill", 1e-3),
        ("cent", 1e-2),
    ],
)
def test_markers_come_in_metres_whatever_the_unit_and_cut_to_the_fields_width(
    tmp_path, unit, length
):
    markers = body()
    path = write_c3d(tmp_path / "walk.c3d", markers, unit=unit, length=length)
    read = read_trial(path.rename(tmp_path / "Walk.C3D"))
    assert list(read.markers) == list(markers)
    for label, place in markers.items():
        np.testing.assert_allclose(read.markers[label], place, atol=1e-6)


def test_a_missing_or_ambiguous_unit_is_asked_for(tmp_path):
    path = write_c3d(tmp_path / "walk.c3d", body(), unit=None)
    assert "Give laboratory.length_unit (--length-unit)" in message(lambda: read_trial(path))
    assert read_trial(path, length_unit="mm").markers["M1"][0, 2] == pytest.approx(1.72)
    for unit in ("me", "mi", "metric", "cents", "inc", "x"):
        other = write_c3d(tmp_path / "other.c3d", body(), unit=unit)
        assert f"POINT:UNITS: the unit '{unit}' is unknown" in message(
            lambda other=other: read_trial(other)
        )


def test_a_marker_that_was_not_seen_is_a_gap_and_time_runs_from_the_trials_first_frame(tmp_path):
    markers = body()
    markers["M3"][10:20] = np.nan
    read = read_trial(write_c3d(tmp_path / "walk.c3d", markers, first_frame=51))
    assert np.isnan(read.markers["M3"][10:20]).all() and np.isfinite(read.markers["M3"][20:]).all()
    assert read.marker_start_s == pytest.approx(0.5) and read.marker_time_s[-1] == pytest.approx(
        1.49
    )


def test_points_without_a_label_are_no_markers(tmp_path):
    nameless = write_c3d(
        tmp_path / "b.c3d", {f"*{k}": place for k, place in enumerate(body().values())}
    )
    assert "neither labelled markers nor force plates" in message(lambda: read_trial(nameless))


@pytest.mark.parametrize("hidden", [False, True])
def test_of_a_label_that_stands_twice_the_first_that_is_seen_is_read_and_said(tmp_path, hidden):
    markers = body()
    second, first = markers["M4"].copy(), markers["M2"].copy()
    if hidden:
        markers["M2"] = np.full_like(first, np.nan)
    path = write_c3d(tmp_path / "walk.c3d", markers)
    width = max(map(len, ezc3d.c3d(str(path))["parameters"]["POINT"]["LABELS"]["value"]))
    path.write_bytes(path.read_bytes().replace(b"M4".ljust(width), b"M2".ljust(width)))
    read = read_trial(path)
    assert list(read.markers).count("M2") == 1 and "M4" not in read.markers
    np.testing.assert_allclose(read.markers["M2"], second if hidden else first, atol=1e-6)
    assert any("M2 stands twice: the first" in note for note in read.notes)


def test_a_truncated_file_is_refused(tmp_path):
    path = write_c3d(tmp_path / "walk.c3d", body())
    data = path.read_bytes()
    for end in (0, 100, 511, 600, 3000, -2000):
        path.write_bytes(data[:end])
        assert str(path) in message(lambda: read_trial(path))
    path.write_bytes(data[:8] + b"\xfe\xff" + data[10:])
    assert "the header says 65534 frames, the file holds 100" in message(lambda: read_trial(path))


def test_recording_of_more_frames_than_16_bits_count(tmp_path):
    frames = 70_000
    markers = {
        "a": np.tile([0.1, 0.2, 0.3], (frames, 1)),
        "b": np.tile([0.4, 0.2, 0.9], (frames, 1)),
    }
    assert read_trial(write_c3d(tmp_path / "long.c3d", markers, rate=1000.0)).frames == frames


# Force plates: a stated load on a plate of each type comes back, wherever the plate lies and turns.


PHASE = np.linspace(0.0, 1.0, SAMPLES)
FORCE = np.column_stack(
    [60 * np.sin(6 * PHASE), 20 * np.cos(3 * PHASE), 700 + 100 * np.cos(9 * PHASE)]
)
TWIST = 5.0 * np.sin(4 * PHASE)
PLATE_AT = (0.45, 0.25)


def load(centre=PLATE_AT, turn_deg=0.0, kind=2, height=0.0, **options):
    path = np.column_stack([0.1 * PHASE - 0.05, 0.05 * PHASE, np.full(SAMPLES, height)]) + np.array(
        [*centre, 0.0]
    )
    return MadePlate(
        kind, FORCE, path, TWIST, rectangle(centre, turn_deg=turn_deg, height=height), **options
    )


def written(tmp_path, *plates, way=(1.2, 0.0, 0.0), **options):
    return write_c3d(tmp_path / "a.c3d", body(way), plates=plates, **options)


def check(read, made, rotation=np.eye(3)):  # noqa: B008 (it is not changed)
    np.testing.assert_allclose(read.rotation_W, rotation, atol=0)
    for plate, given in zip(read.plates, made, strict=True):
        np.testing.assert_allclose(plate.force_n, given.force @ rotation.T, atol=1e-3)
        np.testing.assert_allclose(plate.cop_m, given.cop @ rotation.T, atol=1e-6)
        np.testing.assert_allclose(plate.free_moment_nm, given.twist, atol=1e-4)
        np.testing.assert_allclose(plate.corners_m, given.corners @ rotation.T, atol=1e-6)


@pytest.mark.parametrize("origin_sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("kind", "turn_deg"), [*((kind, 30.0) for kind in (1, 2, 3, 4, 6, 7)), (2, 90.0), (2, 180.0)]
)
def test_load_comes_back_from_each_type_of_plate(tmp_path, kind, turn_deg, origin_sign):
    """The channels follow from the load by cross products over the sensors, not from the reader's
    formulas."""
    plate = load(turn_deg=turn_deg, kind=kind, origin_sign=origin_sign)
    read = read_trial(written(tmp_path, plate))
    check(read, [plate])
    told = [note for note in read.notes if "read as Visual3D documents it" in note]
    assert len(told) == (kind in (6, 7))


@pytest.mark.parametrize(
    ("of_plate", "of_file", "words"),
    [({"on_plate": True}, {}, "points down"), ({}, {"moment_unit": "Nm"}, "far off the plate")],
)
def test_forces_on_the_plate_and_moments_in_another_unit_than_stated_are_put_right(
    tmp_path, of_plate, of_file, words
):
    plate = load(**of_plate)
    read = read_trial(written(tmp_path, plate, **of_file))
    check(read, [plate])
    assert any(words in note for note in read.notes)


ON = (PHASE > 0.35) & (PHASE < 0.8)
"""When a foot stands on the plate: the first 350 samples, or 35 frames, are unloaded."""


def stepped_on(load_n=0.0, **options):
    """A plate with a step of less than the recording on it, and `load_n`, a number or (samples,),
    before and after it."""
    plate = load(**options)
    plate.force = np.where(ON[:, None], plate.force, np.multiply.outer(load_n, [0.0, 0.0, 1.0]))
    plate.twist = np.where(ON, plate.twist, 0.0)
    return plate


@pytest.mark.parametrize("kind", [2, 3, 4, 6, 7])
@pytest.mark.parametrize(
    ("zero", "first_frame", "words"),
    [
        ((1, 30), 1, "frames 1 to 30"),
        ((0, 10), 1, "frames 1 to 10"),
        ((61, 70), 51, "frames 61 to 70"),  # numbered as the file's frames are
        ((1, 30), 51, "frames 1 to 30"),  # or from its first, where frames before were cut off
        ((1, 300), 1, "samples 1 to 300"),  # more than its 100 frames
    ],
)
def test_what_an_unloaded_plate_shows_is_subtracted_from_its_channels(
    tmp_path, kind, zero, first_frame, words
):
    plate = stepped_on(kind=kind, offset=2.5)
    read = read_trial(written(tmp_path, plate, zero=zero, first_frame=first_frame)).plates[0]
    np.testing.assert_allclose(read.force_n, plate.force, atol=1e-3)
    np.testing.assert_allclose(read.cop_m[ON], plate.cop[ON], atol=1e-6)
    np.testing.assert_allclose(read.free_moment_nm[ON], plate.twist[ON], atol=1e-4)
    notes = read_trial(tmp_path / "a.c3d").notes
    assert any(words in note and "FORCE_PLATFORM:ZERO" in note for note in notes)


@pytest.mark.parametrize(
    ("zero", "load_n"),
    [
        ((0, 0), 0.0),  # says that nothing is to be subtracted
        ((1, 0), 0.0),  # what programs write that never set it
        ((1, 50), 0.0),  # the foot comes within these frames
        ((1, 10), 300.0),  # somebody stands on the plate
        ((1, 10), np.linspace(0.0, 600.0, SAMPLES)),  # or steps on it
        ((200, 1200), 0.0),  # neither frames nor samples of the file
    ],
)
def test_nothing_is_subtracted_where_the_plate_is_loaded_or_zero_names_no_frames(
    tmp_path, zero, load_n
):
    plate = stepped_on(load_n)
    plate.force[:, 2] += 8.0
    read = read_trial(written(tmp_path, plate, zero=zero))
    np.testing.assert_allclose(read.plates[0].force_n, plate.force, atol=1e-3)
    assert not any("ZERO" in note for note in read.notes)


@pytest.mark.parametrize("by_turns", [False, True])
def test_kistlers_correction_of_the_centre_of_pressure_is_applied(tmp_path, by_turns):
    """ezc3d on the same file, which reads the six coefficients of x before those of y. The force
    and the moment about the plate's vertical through its centre stay."""
    plate, plain = load(kind=3), load((1.2, 0.25), kind=3)
    path = written(tmp_path, plate, plain)
    values = np.zeros((6, 2, 2))
    values[:, :, 0] = np.transpose(KISTLER_9281E)
    with_parameters(path, "FORCE_PLATFORM", FPCOPPOLY=values)
    theirs = ezc3d.c3d(str(path), extract_forceplat_data=True)["data"]["platform"][0]
    if by_turns:
        with_parameters(path, "FORCE_PLATFORM", FPCOPPOLY=values.transpose(1, 0, 2))
    read = read_trial(path)
    moved = read.plates[0].cop_m - plate.cop
    np.testing.assert_allclose(
        read.plates[0].cop_m[:, :2], 1e-3 * theirs["center_of_pressure"][:2].T, atol=1e-7
    )
    np.testing.assert_allclose(read.plates[0].free_moment_nm, 1e-3 * theirs["Tz"][2], atol=1e-4)
    assert 1e-3 < np.abs(moved).max() < 1e-2, "millimetres, as Kistler's manual says"
    np.testing.assert_allclose(read.plates[0].force_n, plate.force, atol=1e-3)
    np.testing.assert_allclose(read.plates[1].cop_m, plain.cop, atol=1e-6)
    assert [note for note in read.notes if "FPCOPPOLY" in note] == [
        "Kistler's correction of the centre of pressure (FPCOPPOLY) was applied to force plate 1."
    ]


def test_a_centre_of_pressure_off_the_plate_is_not_corrected(tmp_path):
    """A polynomial of the seventh order says nothing out there."""
    plate = load(kind=3)
    plate.cop[:, 1] += 0.4
    values = np.transpose(KISTLER_9281E)[:, :, None]
    path = with_parameters(written(tmp_path, plate), "FORCE_PLATFORM", FPCOPPOLY=values)
    np.testing.assert_allclose(read_trial(path).plates[0].cop_m, plate.cop, atol=1e-6)


@pytest.mark.parametrize("what", ["not millimetres", "other coefficients", "too few"])
def test_a_correction_that_cannot_be_kistlers_is_left_and_said(tmp_path, what):
    plate = load(kind=3)
    unit = {"unit": "m", "length": 1.0} if what == "not millimetres" else {}
    values = np.transpose(KISTLER_9281E)[:, :, None]
    values = {"too few": values[:5], "other coefficients": 10.0 * values}.get(what, values)
    read = read_trial(
        with_parameters(written(tmp_path, plate, **unit), "FORCE_PLATFORM", FPCOPPOLY=values)
    )
    np.testing.assert_allclose(read.plates[0].cop_m, plate.cop, atol=1e-6)
    assert any("FPCOPPOLY was not applied to force plate 1" in note for note in read.notes)


def test_a_plate_whose_type_needs_a_matrix_is_left_out_without_it(tmp_path):
    path = written(tmp_path, load(kind=7), load((1.2, 0.25), kind=3))
    with_parameters(path, "FORCE_PLATFORM", CAL_MATRIX=np.zeros((6, 6, 2)))
    read = read_trial(path)
    assert [plate.name for plate in read.plates] == ["2"]
    assert any("CAL_MATRIX has no 8 x 8 matrix" in note for note in read.notes)


def test_a_plate_that_has_fewer_channels_than_its_type_is_left_out(tmp_path):
    """Of six rows for each plate the next two numbers are the next plate's."""
    path = written(tmp_path, load(kind=3), load((1.2, 0.25)))
    channels = np.column_stack([np.arange(1, 7), np.arange(9, 15)])
    read = read_trial(with_parameters(path, "FORCE_PLATFORM", CHANNEL=channels))
    assert [plate.name for plate in read.plates] == ["2"]
    assert any("CHANNEL says nothing usable of force plate 1" in note for note in read.notes)


@pytest.mark.parametrize(
    ("mass", "height", "facts", "said"),
    [
        (1.0, 1.0, {}, ["BODYMASS", "HEIGHT"]),
        (72.5, 1745.0, {"mass_kg": 72.5, "stature_m": 1.745}, []),
        (72.5, 1.0, {"mass_kg": 72.5}, ["HEIGHT"]),
        (500.0, 17.0, {}, ["BODYMASS", "HEIGHT"]),
        (0.0, 174.5, {"stature_m": 1.745}, []),
    ],
)
def test_mass_and_height_that_are_placeholders_or_nobodys_are_left_out_and_said(
    tmp_path, mass, height, facts, said
):
    path = with_parameters(written(tmp_path), "PROCESSING", Bodymass=[mass], Height=[height])
    read = read_trial(path)
    assert read.person == pytest.approx(facts)
    told = [note for note in read.notes if "PROCESSING" in note]
    assert len(told) == len(said)
    for name, note in zip(said, told, strict=True):
        assert name in note and ("placeholder" in note) == (
            {"BODYMASS": mass, "HEIGHT": height}[name] == 1.0
        )


def test_floor_is_where_the_plates_lie(tmp_path):
    plates = (load((0.4, 0.2), height=0.35), load((1.1, 0.2), height=0.35))
    markers = {label: place + np.array([0, 0, 0.35]) for label, place in body().items()}
    read = read_trial(write_c3d(tmp_path / "a.c3d", markers, plates=plates))
    np.testing.assert_allclose(
        read.plates[0].cop_m, plates[0].cop - np.array([0, 0, 0.35]), atol=1e-6
    )
    assert read.markers["M0"][0, 2] == pytest.approx(0.02, abs=1e-6)
    assert any("350 mm" in note for note in read.notes)


def test_stairs_and_ramps_are_refused(tmp_path):
    stairs = written(tmp_path, load((0.4, 0.2)), load((1.1, 0.2), height=0.18))
    assert "plate 2 lies 180 mm above plate 1" in message(lambda: read_trial(stairs))
    plate, tilt = load(), np.radians(7.0)
    middle = plate.corners.mean(axis=0)
    turn = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    plate.corners = (plate.corners - middle) @ turn.T + middle
    ramp = written(tmp_path, plate)
    assert "plate 1 is tilted by 7.0 degrees" in message(lambda: read_trial(ramp))


def test_a_plate_of_an_unknown_type_or_without_its_channels_is_left_out_and_said(tmp_path):
    read = read_trial(
        with_parameters(
            written(tmp_path, load((0.4, 0)), load((0.81, 0))), "FORCE_PLATFORM", TYPE=[2, 21]
        )
    )
    assert [plate.name for plate in read.plates] == ["1"] and any(
        "type 21 (AMTI stairs), which is not read" in note and "export it as type 2" in note
        for note in read.notes
    )
    plates = (load(), load((1.2, 0.25)))
    path = written(tmp_path, *plates)
    absent, there = np.arange(13, 19), np.arange(1, 7)
    read = read_trial(
        with_parameters(path, "FORCE_PLATFORM", CHANNEL=np.column_stack([there, absent]))
    )
    check(read, plates[:1])
    assert any(
        "Force plate 2 of a.c3d was left out" in note and "channels 13 to 18" in note
        for note in read.notes
    )
    with_parameters(path, "FORCE_PLATFORM", CHANNEL=np.column_stack([absent, absent]))
    assert "FORCE_PLATFORM:CHANNEL: force plate 1 uses analog channels 13 to 18" in message(
        lambda: read_trial(path)
    )


@pytest.mark.parametrize("header", [7, 12, 0])
def test_samples_a_frame_are_those_on_which_channels_and_rates_agree(tmp_path, header):
    """Six channels at 1000 Hz in frames of 100 Hz make 10 samples a frame, whatever the header
    says."""
    plate = load()
    path = written(tmp_path, plate)
    data = bytearray(path.read_bytes())
    assert data[18:20] == (10).to_bytes(2, "little")
    data[18:20] = header.to_bytes(2, "little")
    path.write_bytes(bytes(data))
    read = read_trial(path)
    check(read, [plate])
    assert read.force_rate_hz == 1000.0 and any(
        f"says {header} analog samples a frame" in n for n in read.notes
    )
