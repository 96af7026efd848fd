"""A long recording needs little more memory than what is read from it."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from made_c3d import MadePlate, rectangle, write_c3d

from vsf_drake.motion import read_trial

MOST = 4.0
"""Times the file's size; 32-bit numbers become 64-bit ones, which is twice."""
FRAMES = 5000


def paths(count: int, labels: str = "M{}") -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    middle = rng.uniform([-0.3, -0.3, 0.0], [0.3, 0.3, 1.8], (count, 3))
    travelled = np.linspace(0.0, 3.0, FRAMES)[:, None] * [1.0, 0.0, 0.0]
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
    samples = FRAMES * subframes
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
