"""OpenSim tables: what is read is what stands there, and what is broken is named."""

import numpy as np
import pytest

from vsf_drake.errors import InputError
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


def message(path):
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


def test_windows_line_ends_and_byte_order_mark(tmp_path):
    path = tmp_path / "walk.mot"
    path.write_bytes(b"\xef\xbb\xbf" + TABLE.replace("\n", "\r\n").encode())
    np.testing.assert_array_equal(read_storage(path).values, [[1, 2], [3, 4]])


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
    assert wanted in message(table(TABLE.replace(old, new)))


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


def test_missing_or_binary_file_is_named(tmp_path):
    assert "there is no such file" in message(tmp_path / "absent.mot")
    binary = tmp_path / "walk.c3d"
    binary.write_bytes(b"\x02P\0\0endheader")
    assert "is not a text file" in message(binary)


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


@pytest.mark.parametrize("names", [("a",), ("a", "a"), ("a", "time"), ("a", ""), ("a", "b\tc")])
def test_names_that_do_not_fit_are_refused(tmp_path, names):
    with pytest.raises(ValueError):
        write_storage(tmp_path / "x.sto", time_s=np.arange(3), names=names, values=np.zeros((3, 2)))
    assert not list(tmp_path.iterdir())
