"""OpenSim tables and TRC files: what is read is what stands there, and what is broken is named."""

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.tables import read_storage, write_storage

TABLE = (
    "walk\nversion=1\nnRows=2\nnColumns=3\ninDegrees=no\nendheader\ntime\ta\tb\n0\t1\t2\n"
    "0.1\t3\t4\n"
)
SIMM = (
    "first trial\t\t\nnRows=2\t\t\nnColumns=3\t\t\n\t\t\n# SIMM Motion File Header:\t\t\nname "
    "first trial\t\t\ndatacolumns 3\t\t\ndatarows 2\t\t\notherdata 1\t\t\nrange 0.400000 "
    "0.417000\t\t\nendheader\t\t\ntime\ta\tb\n0.4\t1\t2\n0.417\t3\t4\n\n"
)


@pytest.fixture
def table(tmp_path):
    def write(text):
        path = tmp_path / "walk.mot"
        path.write_text(text)
        return path

    return write


def message(call):
    with pytest.raises(InputError) as caught:
        call()
    return str(caught.value)


def test_opensim_and_simm_headers(table):
    storage = read_storage(table(TABLE))
    assert storage.names == ("a", "b") and storage.in_degrees is False
    np.testing.assert_array_equal(storage.time_s, [0.0, 0.1])
    np.testing.assert_array_equal(storage.values, [[1, 2], [3, 4]])
    np.testing.assert_array_equal(storage.lines, [8, 9])
    simm = read_storage(table(SIMM))
    assert simm.names == ("a", "b") and simm.in_degrees is None
    np.testing.assert_array_equal(simm.time_s, [0.4, 0.417])
    text = (
        TABLE.replace("\t", "   ")
        .replace("nRows=2", "nRows = 2")
        .replace("inDegrees=no", "inDegrees = Yes")
    )
    spaced = read_storage(table(text))
    assert spaced.in_degrees is True
    np.testing.assert_array_equal(spaced.values, [[1, 2], [3, 4]])


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        ("endheader\n", "", "header: there is no line `endheader`"),
        ("time\ta\tb\n0\t1\t2\n0.1\t3\t4\n", "", "line 6: there are no column labels"),
        (
            "\t3\t4",
            "\t3",
            "line 9: the row has 2 cells, there are 3 labels. Is the file truncated?",
        ),
        ("\t3\t4", "\t3\t4\t5", "line 9: the row has 4 cells, there are 3 labels"),
        ("time\ta\tb", "time\t\tb", "line 7: column 2 has no label"),
        ("time\ta\tb", "t\ta\tb", "line 7: the first column is 't'. It must be time"),
        ("0.1\t3", "x\t3", "line 9, column time: the time 'x' is not a number"),
    ],
)
def test_broken_table_is_named(table, old, new, wanted):
    assert old in TABLE
    path = table(TABLE.replace(old, new))
    refusal = message(lambda: read_storage(path))
    assert wanted in refusal and str(path) in refusal


def test_a_header_that_does_not_count_the_rows_does_no_harm_and_is_said(table):
    """Programs that crop a recording leave the header as it was; the times are what counts."""
    for stated, cropped in ((3, True), (1, False)):
        storage = read_storage(table(TABLE.replace("nRows=2", f"nRows={stated}")))
        np.testing.assert_array_equal(storage.values, [[1, 2], [3, 4]])
        [note] = storage.notes
        assert f"says {stated} rows, the file has 2, which were read" in note
        assert ("cropped" in note) == cropped


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("separator", ["\t", ";", ",", " "])
def test_a_table_that_a_spreadsheet_saved_is_read(table, separator, decimal):
    """Its header lines are padded with separators, and its numbers have the country's comma."""
    rows = [["Times", "a", "b"], ["0", "1.5", "2"], ["0.1", "3", "4.25"]]
    head = ["walk", "nRows=2", "inDegrees=yes", "endheader"]
    text = "\n".join(
        [line + 2 * separator for line in head]
        + [separator.join(rows[0])]
        + [separator.join(row).replace(".", decimal) for row in rows[1:]]
    )
    if separator == decimal:
        assert "Numbers need a decimal point, not a comma" in message(
            lambda: read_storage(table(text))
        )
        return
    storage = read_storage(table(text))
    assert storage.names == ("a", "b") and storage.in_degrees and not storage.notes
    np.testing.assert_array_equal(storage.time_s, [0.0, 0.1])
    np.testing.assert_array_equal(storage.values, [[1.5, 2], [3, 4.25]])


def test_decimal_commas_and_points_in_one_table_are_refused(table):
    """1,5 may be one and a half or fifteen: the file must say which."""
    text = "walk\nendheader\ntime\ta\n0\t1,5\n1\t2.5\n"
    assert "line 5: numbers have commas and points" in message(lambda: read_storage(table(text)))


@pytest.mark.parametrize(
    ("cells", "kept", "where"), [("1\t2\t3", [1, 3], 2), ("nan\t2\t3", [2, 3], 3)]
)
def test_of_a_column_that_stands_twice_the_first_with_numbers_is_read_and_said(
    table, cells, kept, where
):
    """The number in another column that is none is still named as it stands there."""
    storage = read_storage(
        table(f"walk\nendheader\ntime\ta\ta\tb\n0\t{cells}\n0.1\t{cells[:-1]}x\n")
    )
    assert storage.names == ("a", "b")
    np.testing.assert_array_equal(storage.values[0], kept)
    assert storage.notes == (
        f"The column a stands twice: the first that holds anything was used (column {where} of 4).",
    )
    assert "line 5, time 0.1 s, column b: 'x' is not" in message(lambda: storage.column("b"))


@pytest.mark.parametrize(
    ("cell", "wanted"),
    [
        ("nan", "'nan' is not a finite number"),
        ("", "the cell is empty"),
        ("-1.#IND", "'-1.#IND'"),
        ("inf", "'inf'"),
        ("3,5", "'3,5' is not a finite number. Numbers need a decimal point"),
        ("1e10", "'1e+10' is not a believable"),
    ],
)
def test_bad_cell_is_named_only_where_it_is_needed(table, cell, wanted):
    path = table(
        TABLE.replace("0.1\t3", f"0.1\t{cell}")
        .replace("nColumns=3", "nColumns=5")
        .replace("\tb", "\tknee_r")
    )
    storage = read_storage(path)
    np.testing.assert_array_equal(storage.column("knee_r"), [2, 4])
    np.testing.assert_array_equal(storage.column("a", rows=np.array([True, False]))[:1], [1])
    assert f"{path}: line 9, time 0.1 s, column a: {wanted}" in message(lambda: storage.column("a"))
    assert "column kne_r: there is no such column. Did you mean knee_r?" in message(
        lambda: storage.column("kne_r")
    )


def test_write_then_read_keeps_every_bit(tmp_path):
    rng = np.random.default_rng(1)
    time, values = (
        np.cumsum(rng.random(20)) / 3.0,
        rng.normal(size=(20, 3)) * 10.0 ** rng.integers(-12, 12, (20, 3)),
    )
    values[4, 1] = np.nan
    path, names = tmp_path / "out.sto", ("x", "/jointset/knee/value", "z")
    write_storage(path, time_s=time, names=names, values=values, in_degrees=True)
    storage = read_storage(path)
    assert storage.names == names and storage.in_degrees is True
    np.testing.assert_array_equal(storage.time_s, time)
    np.testing.assert_array_equal(storage.values, values)
    assert path.read_text().splitlines()[1:6] == [
        "version=1",
        "nRows=20",
        "nColumns=4",
        "inDegrees=yes",
        "endheader",
    ]


# TRC as laboratories write it.


TIMES = [f"{i / 50:.3f}" for i in range(6)]


def trc_text(
    labels=("heel", "toe", "knee"),
    times=None,
    units="mm",
    rate="50.00",
    markers=None,
    frames=None,
    gap="",
    tabs="\t\t\t",
    cells=None,
    tail="",
):
    """A TRC file in which marker k stands at (100 k, 200 k, 300 k) in frame 0 and goes 1 along x a
    frame."""
    times = TIMES if times is None else times
    frames = len(times) if frames is None else frames
    count = len(labels) if markers is None else markers
    lines = [
        "PathFileType\t4\t(X/Y/Z)\twalk.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{frames}\t{count}\t{units}\t{rate}\t1\t{frames}",
        "Frame#\tTime\t" + tabs.join(labels) + "\t\t" + tail,
        "\t\t" + "\t".join(f"{a}{k + 1}" for k in range(len(labels)) for a in "XYZ"),
        gap,
    ]
    for i, time in enumerate(times):
        row = [
            f"{100 * k + i * (a == 0) + 100 * k * a}" for k in range(len(labels)) for a in range(3)
        ]
        lines.append("\t".join([str(i + 1), time, *(cells or {}).get(i, row)]) + tail)
    return "\n".join(lines) + "\n"


@pytest.fixture
def trc(tmp_path):
    def write(text=None, encoding="utf-8", **options):
        path = tmp_path / "walk.trc"
        path.write_bytes((trc_text(**options) if text is None else text).encode(encoding))
        return path

    return write


def check(read, labels=("heel", "toe", "knee")):
    """Marker k of `trc_text` in W: y up in the file, so W is (x, -z, y), in metres."""
    assert tuple(read.markers) == labels and read.marker_rate_hz == 50.0
    for k, label in enumerate(labels):
        np.testing.assert_allclose(
            read.markers[label],
            1e-3 * np.array([[100 * k + i, -300 * k, 200 * k] for i in range(6)], dtype=float),
            atol=1e-12,
        )


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"tabs": "\t"},
        {"gap": "\t"},
        {"tail": "\t"},
        {"tail": "\t\t\t"},
        {"rate": "  50.0"},
        {"units": " mm"},
    ],
)
def test_layouts_that_programs_write(trc, options):
    check(read_trial(trc(**options)))


@pytest.mark.parametrize("label", ["Times", "time", "TIME (s)", "Time[sec]"])
def test_spellings_of_the_time(trc, label):
    check(read_trial(trc(trc_text().replace("Time", label))))
    assert "the second column is not Time" in message(
        lambda: read_trial(trc(trc_text().replace("Time", label + "r")))
    )


def test_what_a_spreadsheet_makes_of_a_file(trc, tmp_path):
    """Commas for tabs, padded header lines; or semicolons, or tabs, with decimal commas."""
    text = trc_text().replace("\t100\t", "\t100.0\t")
    padded = "\n".join(line + "\t" * (10 - line.count("\t")) for line in text.splitlines())
    check(read_trial(trc(padded.replace("\t", ","))))
    for separator in "\t;":
        check(read_trial(trc(padded.replace(".", ",").replace("\t", separator))))
        other = padded.replace("50.00", "62.50").replace(".", ",").replace("\t", separator)
        assert any("says 62.5 frames a second" in note for note in read_trial(trc(other)).notes)
    quoted = "\n".join(
        ",".join(f'"{cell}"' for cell in line.split("\t")) for line in padded.splitlines()
    )
    check(read_trial(trc(quoted)))
    as_csv = trc(padded.replace("\t", ",")).rename(tmp_path / "walk.csv")
    assert "line 4: holds markers, not forces. Let its name end in .trc" in message(
        lambda: read_trial(as_csv)
    )
    assert "Numbers need a decimal point, not a comma" in message(
        lambda: read_trial(trc(padded.replace(".", ",").replace("\t", ",")))
    )


def test_spellings_of_a_gap_and_rows_that_end_early(trc):
    for cells in (
        *((cell,) * 3 for cell in ("", "NaN", "-nan", "1.#QNAN", "-1.#IND", " ")),
        ("1", "", "3"),
    ):
        read = read_trial(trc(cells={2: ["0", "0", "0", *cells, "200", "400", "600"]}))
        assert np.isnan(read.markers["toe"][2]).all() and np.isfinite(read.markers["toe"][3]).all()
        assert np.isfinite(read.markers["knee"]).all()
    read = read_trial(trc(cells={2: ["0", "0", "0", "101", "200", "300"]}))
    assert np.isnan(read.markers["knee"][2]).all() and any(
        "end before the last marker" in n for n in read.notes
    )


def test_what_header_and_rows_say_differently_is_noted_or_refused(trc):
    text = trc_text()
    for broken, wanted in (
        (text[:-18], "line 12"),
        ("\n".join(text.splitlines()[:3]), "labels"),
        ("", "labels"),
        (trc_text(cells={0: ["1"] * 12}), "Is there a label for every marker?"),
        (trc_text(times=["0"] * 6), "They must increase"),
        (trc_text(times=["5", "4", "3", "2", "1", "0"]), "They must increase"),
    ):
        path = trc(broken)
        assert wanted in message(lambda path=path: read_trial(path))
    check(read_trial(trc(frames=4, markers=10**9)))
    check(read_trial(trc(frames=10**12)))
    read = read_trial(trc("\n".join(text.splitlines()[:-2]) + "\n"))
    assert read.frames == 4
    assert any("says 6 frames, the file has 4, which were read" in note for note in read.notes)
    read = read_trial(trc(rate="500"))
    check(read)
    assert any("says 500 frames a second" in note for note in read.notes)


def test_a_missing_row_is_named(trc):
    path = trc(times=[f"{i / 50:.3f}" for i in range(30) if i != 12])
    assert "line 19: time 0.26 s follows 0.22 s" in message(lambda: read_trial(path))


def test_real_files(shared_data):
    for name, markers, gaps in (
        ("dataWithEformat", 14, 0),
        ("exampleFormat", 3, 2),
        ("dataWithNaNsOfDifferentCases", 14, None),
    ):
        read = read_trial(shared_data / "opensim_core" / "trc_edge_cases" / f"{name}.trc")
        assert (len(read.markers), read.frames) == (markers, 5)
        missing = sum(np.isnan(place).any(axis=1).sum() for place in read.markers.values())
        assert missing == gaps if gaps is not None else missing > 0
    bmc = read_trial(shared_data / "bmc_gait" / "walk1.trc")
    assert (len(bmc.markers), bmc.frames, bmc.marker_rate_hz) == (28, 364, 150.0)
    np.testing.assert_allclose(
        bmc.markers["R.ASIS"][0], [-0.14801762, 0.47970297, 1.03982568], atol=1e-12
    )
    made = read_trial(
        shared_data / "opensim_core" / "ik_reference" / "subject01_synthetic_marker_data.trc"
    )
    assert made.marker_start_s == 0.4 and made.marker_rate_hz == 60.0 and "Sternum" in made.markers
