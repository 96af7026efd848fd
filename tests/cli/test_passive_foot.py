"""Commands given a passive foot: they ask for no fulcrum, and refuse one; those that move it refuse
the foot."""

from __future__ import annotations

import pytest
from command_line import read_json
from sweep_files import copied

from vsf_drake.base.files import resource

PASSIVE = "package://vsf_drake/passive.yaml"
WALK = resource("data/reference_subject/exact/low_1.yaml")
SUBJECT = WALK.parents[1] / "subject.yaml"
CONTACT = resource("data/reference_subject/laboratory/contact.yaml")
NO_FULCRUM = "this foot has no fulcrum: it is passive"


@pytest.fixture
def walk(tmp_path):
    """A recorded walk of which somebody says that it was walked on the passive foot."""
    return copied(WALK, tmp_path / "passive", model=PASSIVE, prosthesis={})


@pytest.mark.parametrize(
    ("words", "right"),
    [
        (("map",), "A map is over the fulcrum"),
        (("export", "--form", "condensed"), "Export the full foot"),
        (("certify",), "a fulcrum that moves"),
        (("bench", "--fulcrum-mm", 108), "--fulcrum-mm"),
        (("bench", "--fulcrum-mm", "16N/mm"), "Leave it out"),
        (("export", "--fulcrum-mm", 108), "Leave it out"),
        (("stand", SUBJECT, "--fulcrum-mm", 108), "Leave it out"),
    ],
)
def test_what_moves_a_fulcrum_refuses_the_foot_without_one(run, tmp_path, words, right):
    code, _, error = run(*words, "--model", PASSIVE, "--out", tmp_path / "out")
    said = " ".join(error.split())
    assert code == 2 and NO_FULCRUM in said and right in said and "Traceback" not in said
    assert " mm" not in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "right"),
    [
        (("simulate", "WALK", "--fulcrum-mm", 66), "Leave it out"),
        (("sweep", "WALK", "--fulcrum-mm", "66,108"), "Leave it out"),
        (("sweep", "WALK", "--vary", "fulcrum.shift=0.01"), "Leave --vary fulcrum.shift out"),
        (("predict", "WALK", "--contact", CONTACT, "--fulcrum-mm", 80), "nothing is predicted"),
        (("tune", "WALK"), "There is nothing to tune on a passive foot"),
    ],
)
def test_walks_on_it_can_be_given_no_setting(run, tmp_path, walk, words, right):
    words = [str(word).replace("WALK", str(walk)) for word in words]
    code, _, error = run(*words, "--out", tmp_path / "out")
    said = " ".join(error.split())
    assert code == 2 and NO_FULCRUM in said and right in said and "Traceback" not in said
    assert not (tmp_path / "out").exists()


def test_a_comparison_at_a_place_that_it_has_not_names_the_foot(run, tmp_path, walk):
    code, _, error = run("compare", f"{walk}@66", walk, "--out", tmp_path / "out")
    said = " ".join(error.split())
    assert code == 2 and "holds no walk at 66. There are walks with foot passive" in said


def test_the_bench_presses_it_as_it_is(run, tmp_path):
    """As the nominal device, whose forefoot and heel it has, at 108 mm."""
    assert run("bench", "--model", PASSIVE, "--out", tmp_path / "out")[0] == 0
    found = read_json(tmp_path / "out" / "bench.json")["settings"]
    assert run("bench", "--fulcrum-mm", "108", "--out", tmp_path / "nominal")[0] == 0
    nominal = read_json(tmp_path / "nominal" / "bench.json")["settings"]
    assert [row["stiffness_n_per_mm"] for row in found] == pytest.approx(
        [row["stiffness_n_per_mm"] for row in nominal], rel=1e-3
    )


def test_a_walk_on_it_is_simulated_without_a_setting(run, tmp_path, walk):
    words = ("--contact", "none", "--no-replay", "--step-ms", 4)
    code, _, error = run("simulate", walk, "--out", tmp_path / "out", *words)
    assert code == 0, error
    assert 0.0 < read_json(tmp_path / "out" / "metrics.json")["grf_rmse_bw"] < 0.5
    assert run("sweep", walk, "--list")[1].count("fulcrum.shift") == 0


def test_somebody_stands_on_it_and_it_is_exported_and_shown(run, tmp_path):
    short = ("--duration-s", 0.1, "--upright")
    assert run("stand", SUBJECT, "--model", PASSIVE, "--out", tmp_path / "stand", *short)[0] == 0
    code, _, error = run("export", "--model", PASSIVE, "--out", tmp_path / "files")
    assert code == 0, error
    written = {path.name for path in (tmp_path / "files").iterdir()}
    assert {"vsf_foot_passive.osim", "vsf_foot_passive.xml", "vsf_foot_passive.sdf"} <= written
    assert run("show", "--model", PASSIVE, "--html", tmp_path / "foot.html")[0] == 0


@pytest.mark.parametrize("said", ["16 N/mm", "16N/mm"])
def test_a_fulcrum_may_be_asked_for_by_its_stiffness(run, tmp_path, said):
    """On the nominal device, in three commands."""
    assert run("bench", "--fulcrum-mm", said, "--no-heel", "--out", tmp_path / "bench")[0] == 0
    [row] = read_json(tmp_path / "bench" / "bench.json")["settings"]
    assert row["stiffness_n_per_mm"] == pytest.approx(16.0, abs=0.005)
    words = ("--contact", "none", "--no-replay", "--step-ms", 4, "--fulcrum-mm", said)
    code, told, error = run("simulate", WALK, "--out", tmp_path / "walk", *words)
    assert code == 0, error
    assert f"fulcrum {row['fulcrum_mm']:g} mm" in told
    code, _, error = run(
        "export", "--format", "sdf", "--fulcrum-mm", said, "--out", tmp_path / "files"
    )
    assert code == 0, error
    assert (tmp_path / "files" / f"vsf_foot_at_{row['fulcrum_mm']:g}mm.sdf").is_file()
