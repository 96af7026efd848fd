"""What files of a folder are taken for, by what is in them."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from made_c3d import write_c3d
from made_laboratory import Laboratory

from vsf_drake.base.files import resource
from vsf_drake.sessions.found import BENCH, MAP, OTHER, STANDING, WALK, find_files


def roles(folder):
    return {file.path.name: file for file in find_files(folder, {}, lambda what, share: None)}


def test_a_folder_of_trc_files_forces_bench_and_map_is_told_apart(tmp_path):
    laboratory = Laboratory(tmp_path)
    laboratory.standing("quiet.trc")
    laboratory.walk("66mm a.trc")
    laboratory.walk("66mm b.trc", forces=False)
    shutil.copy(tmp_path / "66mm a.mot", tmp_path / "alone.mot")
    shutil.copy(resource("data/reference_subject/bench.yaml"), tmp_path)
    shutil.copy(resource("data/reference_subject/bench_curves.csv"), tmp_path)
    shutil.copy(resource("models/marker_maps/plug_in_gait.yaml"), tmp_path / "ours.yaml")
    (tmp_path / "notes.csv").write_text("what,when\nlunch,12\n")
    (tmp_path / "protocol.pdf").write_bytes(b"%PDF")
    (tmp_path / "older").mkdir()
    found = roles(tmp_path)
    assert {name: file.role for name, file in found.items()} == {
        "quiet.trc": STANDING,
        "66mm a.trc": WALK,
        "66mm b.trc": WALK,
        "alone.mot": OTHER,
        "bench.yaml": BENCH,
        "bench_curves.csv": BENCH,
        "ours.yaml": MAP,
    }
    assert found["66mm a.trc"].usable and found["66mm a.trc"].setting == "66"
    assert not found["66mm b.trc"].usable and "no force plates" in found["66mm b.trc"].remark
    assert "forces without" in found["alone.mot"].remark


@pytest.mark.parametrize(
    ("name", "reach_m", "role"),
    [
        ("a", 0.05, STANDING),
        ("walking", 0.05, STANDING),
        ("a", 2.0, WALK),
        ("static", 2.0, WALK),
        ("a", 0.35, OTHER),
        ("static reach", 0.35, STANDING),
        ("treadmill walk", 0.35, WALK),
    ],
)
def test_how_far_markers_go_tells_what_it_is_and_in_between_the_name(tmp_path, name, reach_m, role):
    """Of a person 1.7 m tall whose markers all go along x and come back or not."""
    way = np.linspace(0.0, reach_m, 50)
    markers = {
        f"M{k}": np.column_stack([way, np.full(50, 0.1 * (k % 3)), np.full(50, 0.1 * k)])
        for k in range(18)
    }
    write_c3d(tmp_path / f"{name}.c3d", markers)
    assert roles(tmp_path)[f"{name}.c3d"].role == role


def test_a_date_in_the_name_tells_when(tmp_path):
    markers = {f"M{k}": np.full((20, 3), 0.1 * k) for k in range(18)}
    for name in ("static 2026-11-02", "static_20261104"):
        write_c3d(tmp_path / f"{name}.c3d", markers)
    when = sorted(file.when_s for file in roles(tmp_path).values())
    assert (when[1] - when[0]) / 86_400 == pytest.approx(2.0, abs=0.05)
