"""TRC files as laboratories write them: each reads, or is refused with its reason."""

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion import read_trial
from vsf_drake.motion.formats.read import list_labels

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


def test_utf_16_is_refused(trc):
    assert "is not a text file" in message(trc(encoding="utf-16"))


@pytest.mark.parametrize("cell", ["", "NaN", "nan", "NAN", "-nan", "1.#QNAN", "-1.#IND", " "])
def test_spellings_of_a_gap(trc, cell):
    read = read_trial(trc(cells={2: ["0", "0", "0", cell, cell, cell, "200", "400", "600"]}))
    assert np.isnan(read.markers["toe"][2]).all() and np.isfinite(read.markers["toe"][3]).all()
    assert np.isfinite(read.markers["knee"]).all()


def test_half_a_marker_is_a_gap(trc):
    read = read_trial(trc(cells={2: ["0", "0", "0", "1", "", "3", "200", "400", "600"]}))
    assert np.isnan(read.markers["toe"][2]).all()


def test_row_that_ends_before_the_last_marker(trc):
    read = read_trial(trc(cells={2: ["0", "0", "0", "101", "200", "300"]}))
    assert np.isnan(read.markers["knee"][2]).all() and any("end before the last marker" in n for n in read.notes)


def test_exponents(trc):
    read = read_trial(trc(cells={0: ["1.5E+02", "-2.5e-01", "1e0", *["1"] * 6]}))
    np.testing.assert_allclose(read.markers["heel"][0], [0.15, -0.001, -0.00025])


@pytest.mark.parametrize(("unit", "factor"), [("m", 1e3), ("cm", 10.0), ("mm", 1.0), ("meters", 1e3)])
def test_units_are_the_files(trc, unit, factor):
    small = {i: [f"{float(c) / factor:.9f}" for c in row.split("\t")[2:]]
             for i, row in enumerate(trc_text().splitlines()[6:])}
    check(read_trial(trc(units=unit, cells=small)))


@pytest.mark.parametrize("unit", ["furlongs", "N"])
def test_unknown_unit_is_asked_for(trc, unit):
    assert "--length-unit" in message(trc(units=unit)).lower()
    check(read_trial(trc(units=unit), length_unit="mm"))


def test_of_a_doubled_label_the_first_is_read_and_said(trc):
    once, twice = read_trial(trc()), read_trial(trc(labels=("heel", "toe", "heel")))
    assert list(twice.markers) == ["heel", "toe"]
    np.testing.assert_array_equal(twice.markers["heel"], next(iter(once.markers.values())))
    assert any("heel stands twice: the first that holds anything was used (column 1 of 3)" in n for n in twice.notes)


def test_truncated_files(trc):
    text = trc_text()
    assert "the header says 6 frames, the file has 4" in message(trc("\n".join(text.splitlines()[:-2]) + "\n"))
    assert "line 12" in message(trc(text[:-18]))
    assert "labels" in message(trc("\n".join(text.splitlines()[:3])))
    assert "labels" in message(trc(""))


def test_more_frames_than_the_header_says_are_read_and_noted(trc):
    read = read_trial(trc(frames=4))
    assert read.frames == 6 and any("says 4 frames" in note for note in read.notes)


def test_absurd_counts_in_the_header_reserve_nothing(trc):
    assert any("1e+09" in n or "1000000000" in n for n in read_trial(trc(markers=10**9)).notes)
    assert "truncated" in message(trc(frames=10**12))


def test_columns_without_a_label_are_refused(trc):
    assert "Is there a label for every marker?" in message(trc(cells={0: ["1"] * 12}))


def test_decimal_commas_are_refused(trc):
    assert "decimal point" in message(trc(cells={0: ["1,5"] * 9}))


def test_rounded_times_are_those_of_the_rate(trc):
    read = read_trial(trc(rate="150", times=["0.00", "0.01", "0.01", "0.02", "0.03", "0.03"]))
    assert read.marker_rate_hz == 150.0


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
