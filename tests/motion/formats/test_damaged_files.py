"""Damaged files: whatever stands in them, a reader gives a consistent recording or an InputError, nothing else."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from made_c3d import MadePlate, rectangle, write_c3d
from mutations import mutated

from vsf_drake.errors import InputError
from vsf_drake.motion import read_trial
from vsf_drake.motion.formats.read import list_labels
from vsf_drake.motion.formats.recording import Plate
from vsf_drake.motion.formats.writers import write_forces_mot, write_trc
from vsf_drake.motion.storage import read_storage

FRAMES, SAMPLES = 20, 40
HEADS = {".c3d": 3000, ".trc": 250, ".mot": 300, ".sto": 300, ".csv": 200, ".forces": 150}
EXAMPLES = 100


def markers():
    at = np.random.default_rng(1).uniform([0, -0.3, 0.05], [0.3, 0.3, 1.6], (6, 3))
    return {f"M{k}": p + np.outer(np.linspace(0, 1, FRAMES), [1, 0, 0]) for k, p in enumerate(at)}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """An undamaged file of each kind, by suffix."""
    folder = tmp_path_factory.mktemp("whole")
    phase = np.linspace(0, 1, SAMPLES)
    force = np.column_stack([50 * np.sin(6 * phase), 20 * phase, 700 + 50 * phase])
    cop = np.column_stack([0.4 + 0.1 * phase, 0.1 * phase, 0 * phase])
    made = MadePlate(2, force, cop, 3 * phase, rectangle((0.45, 0.05)))
    kinds = (made, *(MadePlate(k, force, cop, 3 * phase, rectangle((1.0 + k, 0.0))) for k in (1, 3, 4)))
    files = {".c3d": write_c3d(folder / "a.c3d", markers(), plates=kinds, subframes=2)}
    plate = Plate("r", force, cop, 3 * phase)
    write_trc(folder / "a.trc", markers(), rate_hz=20.0)
    for suffix in (".mot", ".sto"):
        write_forces_mot(folder / f"a{suffix}", time_s=np.arange(SAMPLES) / 100, plates={"r": plate, "l": plate})
    rows = np.column_stack([np.arange(SAMPLES) / 100, force[:, [0, 2, 1]], cop[:, [0, 2, 1]], phase])
    text = "\n".join(",".join(repr(float(x)) for x in row) for row in rows)
    (folder / "a.csv").write_text(f"time,Fx1,Fy1,Fz1,COPx1,COPy1,COPz1,Mz1\ns,N,N,N,m,m,m,Nm\n{text}\n")
    rows[:, 4:] *= 1e3
    text = "\n".join("\t".join([str(i + 1), *(f"{x:.2f}" for x in row[1:])]) for i, row in enumerate(rows))
    (folder / "a.forces").write_text("[Force Data]\nNumberOfForcePlates=1\nSampleRate=100.0\nNumberOfSamples=40\n"
                                     f"#Sample\tFX1\tFY1\tFZ1\tX1\tY1\tZ1\tMZ1\n{text}\n")
    return files | {s: folder / f"a{s}" for s in (".trc", ".mot", ".sto", ".csv", ".forces")}


def consistent(read):
    """Shapes, finite numbers and gaps are as `Recording` says."""
    assert (read.marker_rate_hz is None) == (not read.markers) or read.marker_rate_hz > 0.0
    for place in read.markers.values():
        assert place.shape == (read.frames, 3)
        assert (np.isnan(place).all(axis=1) == np.isnan(place).any(axis=1)).all() and not np.isinf(place).any()
    samples = len(read.force_time_s)
    for plate in read.plates:
        assert plate.force_n.shape == plate.cop_m.shape == (samples, 3) and plate.free_moment_nm.shape == (samples,)
        assert np.isfinite(plate.force_n).all() and np.isfinite(plate.free_moment_nm).all()
        loaded = plate.force_n[:, 2] > 20.0
        assert np.isnan(plate.cop_m[~loaded]).all() and not np.isinf(plate.cop_m).any()
        assert (plate.cop_m[loaded, 2] == 0.0).all() or np.isnan(plate.cop_m[loaded]).all()
        assert plate.corners_m is None or np.isfinite(plate.corners_m).all()
    assert np.isfinite(read.marker_time_s).all() and np.isfinite(read.force_time_s).all()
    assert read.frames or read.plates
    np.testing.assert_allclose(read.rotation_W @ read.rotation_W.T, np.eye(3), atol=0)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("suffix", HEADS)
def test_undamaged_files_read(whole, suffix):
    consistent(read_trial(whole[suffix], up="y" if suffix == ".csv" else None))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("suffix", HEADS)
@settings(max_examples=EXAMPLES, deadline=None, derandomize=True, database=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_damaged_files_read_or_are_refused(whole, tmp_path, suffix, seed):
    path = tmp_path / f"damaged{suffix}"
    path.write_bytes(mutated(whole[suffix].read_bytes(), seed, head=HEADS[suffix]))
    for up in (None, "y"):
        try:
            consistent(read_trial(path, up=up))
        except InputError as error:
            assert str(path) in str(error)
    for other in [list_labels] * (suffix in (".c3d", ".trc")) + [read_storage] * (suffix in (".mot", ".sto")):
        try:
            other(path)
        except InputError as error:
            assert str(path) in str(error)
