"""OpenSim tables and TRC files: what is read is what stands there, and what is broken is named."""

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion import read_trial
from vsf_drake.motion.formats.read import list_labels
from vsf_drake.motion.formats.tables import read_storage, write_storage

TABLE = "walk\nversion=1\nnRows=2\nnColumns=3\ninDegrees=no\nendheader\ntime\ta\tb\n0\t1\t2\n0.1\t3\t4\n"
SIMM = """first trial\t\t
nRows=2\t\t
nColumns=3\t\t
\t\t
# SIMM Motion File Header:\t\t
name first trial\t\t
datacolumns 3\t\t
datarows 2\t\t
otherdata 1\t\t
range 0.400000 0.417000\t\t
endheader\t\t
time\ta\tb
0.4\t1\t2
0.417\t3\t4

"""


@pytest.fixture
def table(tmp_path):
    def write(text):
        path = tmp_path / "walk.mot"
        path.write_text(text)
        return path

    return write


def storage_message(path):
    with pytest.raises(InputError) as caught:
        read_storage(path)
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_opensim_header(table):
    storage = read_storage(table(TABLE))
    assert storage.names == ("a", "b")
    assert storage.in_degrees is False
    np.testing.assert_array_equal(storage.time_s, [0.0, 0.1])
    np.testing.assert_array_equal(storage.values, [[1, 2], [3, 4]])
    np.testing.assert_array_equal(storage.lines, [8, 9])


def test_simm_header_says_nothing_about_degrees(table):
    storage = read_storage(table(SIMM))
    assert storage.names == ("a", "b")
    assert storage.in_degrees is None
    np.testing.assert_array_equal(storage.time_s, [0.4, 0.417])


def test_blanks_can_separate_columns_and_keys_may_be_spaced(table):
    text = TABLE.replace("\t", "   ").replace("nRows=2", "nRows = 2").replace("inDegrees=no", "inDegrees = Yes")
    storage = read_storage(table(text))
    assert storage.in_degrees is True
    np.testing.assert_array_equal(storage.values, [[1, 2], [3, 4]])


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        ("nRows=2", "nRows=3", "line 3: the header says 3 rows, the file has 2. Is the file truncated?"),
        ("nRows=2", "nRows=1", "line 3: the header says 1 rows, the file has 2"),
        ("endheader\n", "", "header: there is no line `endheader`"),
        ("time\ta\tb\n0\t1\t2\n0.1\t3\t4\n", "", "line 6: there are no column labels"),
        ("0\t1\t2\n0.1\t3\t4\n", "", "the header says 2 rows, the file has 0"),
        ("\t3\t4", "\t3", "line 9: the row has 2 cells, there are 3 labels. Is the file truncated?"),
        ("\t3\t4", "\t3\t4\t5", "line 9: the row has 4 cells, there are 3 labels"),
        ("time\ta\tb", "time\t\tb", "line 7: column 2 has no label"),
        ("time\ta\tb", "t\ta\tb", "line 7: the first column is 't'. It must be time"),
        ("0.1\t3", "x\t3", "line 9, column time: the time 'x' is not a number"),
        ("0.1\t3", "nan\t3", "line 9, column time: the time 'nan' is not a number"),
    ],
)
def test_broken_table_is_named(table, old, new, wanted):
    assert old in TABLE
    assert wanted in storage_message(table(TABLE.replace(old, new)))


@pytest.mark.parametrize(("cells", "kept", "where"), [("1\t2\t3", [1, 3], 2), ("nan\t2\t3", [2, 3], 3)])
def test_of_a_column_that_stands_twice_the_first_with_numbers_is_read_and_said(table, cells, kept, where):
    """The number in another column that is none is still told as it stands there."""
    text = f"walk\nendheader\ntime\ta\ta\tb\n0\t{cells}\n0.1\t{cells[:-1]}x\n"
    storage = read_storage(table(text))
    assert storage.names == ("a", "b")
    np.testing.assert_array_equal(storage.values[0], kept)
    assert storage.notes == (
        f"The column a stands twice: the first that holds anything was used (column {where} of 4).",)
    with pytest.raises(InputError, match=r"line 5, time 0\.1 s, column b: 'x' is not"):
        storage.column("b")


def test_wrong_number_of_columns_in_the_header_is_noted_where_labels_and_rows_agree(table):
    storage = read_storage(table(TABLE.replace("nColumns=3", "nColumns=5")))
    assert storage.notes == ("Line 4 of walk.mot says 5 columns; labels and all rows have 3.",)


@pytest.mark.parametrize(
    ("cell", "wanted"),
    [("nan", "'nan' is not a finite number"), ("", "the cell is empty"), ("abc", "'abc' is not a finite number"),
     ("3,5", "'3,5' is not a finite number. Numbers need a decimal point"), ("-1.#IND", "'-1.#IND'"), ("inf", "'inf'")],
)
def test_bad_cell_is_named_only_where_it_is_needed(table, cell, wanted):
    path = table(TABLE.replace("0.1\t3", f"0.1\t{cell}"))
    storage = read_storage(path)
    np.testing.assert_array_equal(storage.column("b"), [2, 4])
    np.testing.assert_array_equal(storage.column("a", rows=np.array([True, False]))[:1], [1])
    with pytest.raises(InputError) as caught:
        storage.column("a")
    assert f"{path}: line 9, time 0.1 s, column a: {wanted}" in str(caught.value)


def test_absent_column_is_named_with_the_nearest(table):
    storage = read_storage(table(TABLE.replace("\ta\t", "\tknee_angle_r\t")))
    with pytest.raises(InputError, match=r"column knee_angel_r: there is no such column\. Did you mean knee_angle_r\?"):
        storage.column("knee_angel_r")


def test_write_then_read_keeps_every_bit(tmp_path):
    rng = np.random.default_rng(1)
    time, values = np.cumsum(rng.random(20)) / 3.0, rng.normal(size=(20, 3)) * 10.0 ** rng.integers(-12, 12, (20, 3))
    values[4, 1] = np.nan
    path = tmp_path / "out.sto"
    write_storage(path, time_s=time, names=("x", "/jointset/knee/value", "z"), values=values, in_degrees=True)
    storage = read_storage(path)
    assert storage.names == ("x", "/jointset/knee/value", "z")
    assert storage.in_degrees is True
    np.testing.assert_array_equal(storage.time_s, time)
    np.testing.assert_array_equal(storage.values, values)
    assert path.read_text().splitlines()[1:6] == ["version=1", "nRows=20", "nColumns=4", "inDegrees=yes", "endheader"]


TIMES = [f"{i / 50:.3f}" for i in range(6)]


def trc_text(labels=("heel", "toe", "knee"), times=None, units="mm", rate="50.00", markers=None, frames=None, gap="",
             tabs="\t\t\t", cells=None, tail=""):
    """A TRC file in which marker k stands at (100 k, 200 k, 300 k) in frame 0 and goes 1 along x a frame."""
    times = TIMES if times is None else times
    frames = len(times) if frames is None else frames
    count = len(labels) if markers is None else markers
    lines = ["PathFileType\t4\t(X/Y/Z)\twalk.trc",
             "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
             f"{rate}\t{rate}\t{frames}\t{count}\t{units}\t{rate}\t1\t{frames}",
             "Frame#\tTime\t" + tabs.join(labels) + "\t\t" + tail,
             "\t\t" + "\t".join(f"{a}{k + 1}" for k in range(len(labels)) for a in "XYZ"), gap]
    for i, time in enumerate(times):
        row = [f"{100 * k + i * (a == 0) + 100 * k * a}" for k in range(len(labels)) for a in range(3)]
        row = (cells or {}).get(i, row)
        lines.append("\t".join([str(i + 1), time, *row]) + tail)
    return "\n".join(lines) + "\n"


@pytest.fixture
def trc(tmp_path):
    def write(text=None, encoding="utf-8", **options):
        path = tmp_path / "walk.trc"
        path.write_bytes((trc_text(**options) if text is None else text).encode(encoding))
        return path
    return write


def message(path, **options):
    with pytest.raises(InputError) as caught:
        read_trial(path, **options)
    assert str(path) in str(caught.value)
    return str(caught.value)


def expected(k, frames=6):
    """Marker k of `trc_text` in W: y up in the file, so W is (x, -z, y), in metres."""
    return 1e-3 * np.array([[100 * k + i, -300 * k, 200 * k] for i in range(frames)], dtype=float)


def check(read, labels=("heel", "toe", "knee")):
    assert tuple(read.markers) == labels and read.marker_rate_hz == 50.0
    for k, label in enumerate(labels):
        np.testing.assert_allclose(read.markers[label], expected(k), atol=1e-12)


def test_plain_file(trc):
    check(read_trial(trc()))


@pytest.mark.parametrize("options", [
    {"tabs": "\t"}, {"gap": "\t"}, {"tail": "\t"}, {"tail": "\t\t\t"}, {"rate": "  50.0"}, {"units": " mm"}])
def test_layouts_that_programs_write(trc, options):
    check(read_trial(trc(**options)))


def test_without_the_blank_line_below_the_labels_and_with_carriage_returns(trc):
    text = trc_text().replace("Z3\n\n", "Z3\n")
    check(read_trial(trc(text)))
    check(read_trial(trc(text.replace("\n", "\r\n"))))
    check(read_trial(trc(text.replace("\n", "\r"))))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_labels_with_umlauts(trc, encoding):
    labels = ("Ferse_für", "Größe", "Knöchel")
    path = trc(labels=labels, encoding=encoding)
    check(read_trial(path), labels)
    assert tuple(list_labels(path)) == labels


@pytest.mark.parametrize("cell", ["", "NaN", "nan", "NAN", "-nan", "1.#QNAN", "-1.#IND", " "])
def test_spellings_of_a_gap(trc, cell):
    read = read_trial(trc(cells={2: ["0", "0", "0", cell, cell, cell, "200", "400", "600"]}))
    assert np.isnan(read.markers["toe"][2]).all() and np.isfinite(read.markers["toe"][3]).all()
    assert np.isfinite(read.markers["knee"]).all()


def test_row_that_ends_before_the_last_marker(trc):
    read = read_trial(trc(cells={2: ["0", "0", "0", "101", "200", "300"]}))
    assert np.isnan(read.markers["knee"][2]).all() and any("end before the last marker" in n for n in read.notes)


def test_truncated_files(trc):
    text = trc_text()
    assert "the header says 6 frames, the file has 4" in message(trc("\n".join(text.splitlines()[:-2]) + "\n"))
    assert "line 12" in message(trc(text[:-18]))
    assert "labels" in message(trc("\n".join(text.splitlines()[:3])))
    assert "labels" in message(trc(""))


def test_absurd_counts_in_the_header_reserve_nothing(trc):
    assert any("1e+09" in n or "1000000000" in n for n in read_trial(trc(markers=10**9)).notes)
    assert "truncated" in message(trc(frames=10**12))


def test_columns_without_a_label_are_refused(trc):
    assert "Is there a label for every marker?" in message(trc(cells={0: ["1"] * 12}))


def test_times_that_disagree_with_the_rate_are_used_and_noted(trc):
    read = read_trial(trc(rate="500"))
    assert read.marker_rate_hz == 50.0 and any("says 500 frames a second" in note for note in read.notes)


def test_a_missing_row_is_named(trc):
    times = [t for i, t in enumerate([f"{i / 50:.3f}" for i in range(30)]) if i != 12]
    assert "line 19: time 0.26 s follows 0.22 s" in message(trc(times=times))


@pytest.mark.parametrize("times", [["0"] * 6, ["5", "4", "3", "2", "1", "0"]])
def test_times_must_increase(trc, times):
    assert "They must increase" in message(trc(times=times))


@pytest.mark.parametrize(("name", "markers", "gaps"), [
    ("dataWithEformat", 14, 0), ("exampleFormat", 3, 2), ("dataWithNaNsOfDifferentCases", 14, None)])
def test_edge_cases_of_opensim(shared_data, name, markers, gaps):
    read = read_trial(shared_data / "opensim_core" / "trc_edge_cases" / f"{name}.trc")
    assert (len(read.markers), read.frames) == (markers, 5)
    found = sum(np.isnan(place).any(axis=1).sum() for place in read.markers.values())
    assert found == gaps if gaps is not None else found > 0


def test_real_files(shared_data):
    bmc = read_trial(shared_data / "bmc_gait" / "walk1.trc")
    assert (len(bmc.markers), bmc.frames, bmc.marker_rate_hz) == (28, 364, 150.0)
    np.testing.assert_allclose(bmc.markers["R.ASIS"][0], [-0.14801762, 0.47970297, 1.03982568], atol=1e-12)
    made = read_trial(shared_data / "opensim_core" / "ik_reference" / "subject01_synthetic_marker_data.trc")
    assert made.marker_start_s == 0.4 and made.marker_rate_hz == 60.0 and "Sternum" in made.markers
