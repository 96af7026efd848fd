"""Force files of OpenSim, spreadsheets and Cortex: one load comes back from each way to write
it."""

import dataclasses

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.tables import write_storage

COUNT = 50
TIME = np.arange(COUNT) / 100.0
PHASE = np.linspace(0.0, 1.0, COUNT)
FORCE = np.column_stack([50 * np.sin(6 * PHASE), 700 + 50 * PHASE, 20 * np.cos(3 * PHASE)])
COP = np.column_stack([0.5 + 0.1 * PHASE, np.zeros(COUNT), -0.2 + 0.02 * PHASE])
TWIST = 4.0 * np.sin(5 * PHASE)
UP = np.array([0.0, 1.0, 0.0])


def in_world(vectors):
    return np.column_stack([vectors[:, 0], -vectors[:, 2], vectors[:, 1]])


def check(read, scale=1.0):
    (plate,) = read.plates
    np.testing.assert_allclose(plate.force_n, in_world(FORCE), atol=1e-9)
    np.testing.assert_allclose(plate.cop_m, in_world(COP), atol=1e-9)
    np.testing.assert_allclose(plate.free_moment_nm, TWIST, atol=1e-9)
    assert read.force_rate_hz == 100.0 and read.marker_rate_hz is None and not read.markers


def message(call):
    with pytest.raises(InputError) as caught:
        call()
    return str(caught.value)


def mot(path, names, *blocks):
    write_storage(path, time_s=TIME, names=names, values=np.column_stack(blocks))
    return path


def opensim_names(prefix="ground_force_r", torque="ground_torque_r_"):
    return [f"{prefix}_{k}{a}" for k in "vp" for a in "xyz"] + [f"{torque}{a}" for a in "xyz"]


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_tables_of_opensims_c3d_adapter(tmp_path, unit):
    """z up, in the C3D file's unit; the moment is that about the stated point, here a plate's
    corner."""
    factor = {"m": 1.0, "mm": 1e3}[unit]
    corner = np.tile([0.3, 0.1, 0.0], (COUNT, 1))
    force, cop = in_world(FORCE), in_world(COP)
    about = np.cross(cop - corner, force) + TWIST[:, None] * [0, 0, 1]
    names = [f"{k}1_{i}" for k in "fpm" for i in (1, 2, 3)]
    path = mot(tmp_path / "grf.sto", names, force, factor * corner, factor * about)
    assert "Give laboratory.up (--up)" in message(lambda: read_trial(path, length_unit=unit))
    check(read_trial(path, up="z", length_unit=unit))
    if unit == "mm":
        assert "Give laboratory.length_unit (--length-unit), perhaps mm" in message(
            lambda: read_trial(path, up="z")
        )


def csv(path, labels, blocks, separator=",", units=None, lead="", comma=False):
    rows = np.column_stack([TIME, *blocks])
    lines = [lead + separator.join(["Time", *labels])] + ([separator.join(units)] if units else [])
    lines += [separator.join(repr(float(x)) for x in row) for row in rows]
    text = "\n".join(lines) + "\n"
    path.write_text(text.replace(".", ",") if comma else text)
    return path


SPELLINGS = (
    "Fx1 Fy1 Fz1 COPx1 COPy1 COPz1 Mx1 My1 Mz1",
    "FX1 FY1 FZ1 X1 Y1 Z1 Tx1 Ty1 Tz1",
    "F1X F1Y F1Z COP1X COP1Y COP1Z M1X M1Y M1Z",
    "Fx Fy Fz COPx COPy COPz Mx My Mz",
)


def test_csv_with_opensims_labels_and_others(tmp_path):
    blocks = [FORCE, COP, TWIST[:, None] * UP]
    for separator in ",;\t":
        check(read_trial(csv(tmp_path / "grf.csv", opensim_names(), blocks, separator)))
    for style in SPELLINGS:
        path = csv(tmp_path / "grf.csv", style.split(), blocks)
        assert "Give laboratory.up (--up)" in message(lambda path=path: read_trial(path))
        check(read_trial(path, up="y"))


def test_csv_states_its_units_in_a_row_of_their_own_or_behind_the_labels(tmp_path):
    blocks = [FORCE, 1e3 * COP, 1e3 * TWIST[:, None] * UP]
    units = ["s", *["N"] * 3, *["mm"] * 3, *["Nmm"] * 3]
    check(read_trial(csv(tmp_path / "a.csv", opensim_names(), blocks, units=units)))
    labels = [f"{n} [{u}]" for n, u in zip(opensim_names(), units[1:], strict=True)]
    check(read_trial(csv(tmp_path / "b.csv", labels, blocks, lead="exported by hand\n\n")))


def test_decimal_commas_are_read_between_semicolons_and_refused_between_commas(tmp_path):
    blocks = [FORCE, COP, TWIST[:, None] * UP]
    check(read_trial(csv(tmp_path / "grf.csv", opensim_names(), blocks, ";", comma=True)))
    path = csv(tmp_path / "grf.csv", opensim_names(), blocks, ",", comma=True)
    assert "decimal point, not a comma" in message(lambda: read_trial(path))


@pytest.mark.parametrize(
    ("prefix", "suffix", "other"),
    [("FP1_", "", "FP2_"), ("Plate 1.", "", "Plate 2."), ("", "_R", "_L"), ("", "_1", "_2")],
)
def test_csv_with_plates_by_name(tmp_path, prefix, suffix, other):
    words = [
        f"{kind}{'_' * (kind[0] != kind)}{a}" for kind in ("Force", "COP", "Moment") for a in "XYZ"
    ]
    words = (
        words
        if prefix.startswith("Plate") or suffix == "_1"
        else [f"{kind}{a}" for kind in ("F", "COP", "M") for a in "xyz"]
    )
    style = [prefix + word + suffix for word in words]
    other = [(other if prefix else "") + word + ("" if prefix else other) for word in words]
    blocks = [FORCE, COP, TWIST[:, None] * UP]
    path = csv(
        tmp_path / "grf.csv", [*style, *other, "EMG"], [*blocks, *(0 * b for b in blocks), TIME]
    )
    recording = read_trial(path, up="y")
    assert len(recording.plates) == 2
    check(dataclasses.replace(recording, plates=recording.plates[:1]))
    assert not recording.plates[1].force_n.any()
    assert any("EMG" in note and "left out" in note for note in recording.notes), (
        "nothing is dropped without a word"
    )


def test_millimetres_said_to_be_metres_are_refused_with_the_remedy(tmp_path):
    path = mot(tmp_path / "grf.mot", opensim_names(), FORCE, 1e3 * COP, 1e3 * TWIST[:, None] * UP)
    assert "plate ground_force_r: a centre of pressure" in message(lambda: read_trial(path))
    check(read_trial(path, length_unit="mm"))


def forces_text(count=COUNT, stated=None):
    lines = [
        "[Force Data]",
        "NumberOfForcePlates=1",
        "SampleRate=100.000000",
        f"NumberOfSamples={stated or count}",
        "#Sample\tFX1\tFY1\tFZ1\tX1\tY1\tZ1\tMZ1",
    ]
    rows = np.column_stack([FORCE, 1e3 * COP, 1e3 * TWIST])[:count]
    return "\n".join(
        lines + ["\t".join([str(i + 1), *map(repr, map(float, row))]) for i, row in enumerate(rows)]
    )


def test_cortex_forces(tmp_path):
    path = tmp_path / "walk.forces"
    path.write_text(forces_text())
    check(read_trial(path))
    path.write_text(forces_text(stated=60))
    assert any("says 60 samples, the file has 50" in note for note in read_trial(path).notes)
    path.write_text("\n".join(line for i, line in enumerate(forces_text().splitlines()) if i != 20))
    assert "line 21: samples are missing" in message(lambda: read_trial(path))


def trc(path, start=0.0, frames=30):
    at = {"a": (0.5, 0.9, -0.2), "b": (0.6, 0.1, -0.1), "c": (0.4, 1.5, -0.2)}
    head = (
        f"PathFileType\t4\nDataRate\tNumFrames\tUnits\n50\t{frames}\tm\nFrame#\tTime\t"
        + "\t\t\t".join(at)
    )
    rows = [
        "\t".join([str(i + 1), f"{start + i / 50:.2f}", *(repr(c) for p in at.values() for c in p)])
        for i in range(frames)
    ]
    path.write_text(head + "\n\n" + "\n".join(rows) + "\n")
    return path


def test_forces_beside_markers(tmp_path):
    """Half a second of forces and 0.6 s of markers: what both cover is said; none in common is
    refused."""
    force = mot(tmp_path / "grf.mot", opensim_names(), FORCE, COP, TWIST[:, None] * UP)
    read = read_trial(trc(tmp_path / "walk.trc"), forces=force)
    np.testing.assert_allclose(read.plates[0].cop_m, in_world(COP), atol=1e-9)
    assert read.force_path == force and any("from 0 to 0.49 s" in note for note in read.notes)
    late = trc(tmp_path / "late.trc", start=3.0)
    assert "must overlap in time" in message(lambda: read_trial(late, forces=force))
