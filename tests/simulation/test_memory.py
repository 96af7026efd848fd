"""A walk takes no more memory than it was reckoned to, and is refused if that is too much."""

from __future__ import annotations

import re
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation import walk as module
from vsf_drake.simulation.walk import Walker, bytes_a_step


@pytest.fixture(scope="module")
def walker():
    return Walker(Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right"), ModelParameters())


def hanging(walker, end_s):
    """A person high above the ground who moves no joint, sampled ten times a second."""
    names = walker.gait.prescribed
    time = np.arange(0.0, end_s + 1.0, 0.1)
    values = np.tile([3.0 if name == "pelvis_ty" else 0.0 for name in names], (len(time), 1))
    return CoordinateTrajectory(time, values, names)


def walked(walker, end_s):
    return walker.walk(hanging(walker, end_s), fulcrum_m=0.108, start_s=0.0, end_s=end_s)


def test_ten_minutes_are_refused_before_they_start_with_what_would_do(walker, monkeypatch):
    monkeypatch.setattr(module, "Stepper", None)
    with pytest.raises(InputError, match="GB of memory") as refused:
        walked(walker, 600.0)
    assert 60.0 < float(re.search(r"at most (\d+) s", str(refused.value))[1]) < 120.0


def test_a_step_takes_what_was_reckoned_at_most_and_half_of_it_at_least(walker):
    trial = SimpleNamespace(name="", notes=(), synthetic=False, inputs={})
    walk = walked(walker, 0.1)
    peaks = []
    for end_s in (1.2, 2.4):
        tracemalloc.start()
        walker.result(walked(walker, end_s), trial, GeometricOffsets())
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert 0.5 < (peaks[1] - peaks[0]) / 1200 / bytes_a_step(walk.mechanism) <= 1.0
