"""`vsf-drake bench --protocol`: what it leaves, says and refuses."""

from __future__ import annotations

from dataclasses import replace

import pytest
from command_line import read_json

from vsf_drake.base.schema import dump_yaml
from vsf_drake.model.parameters import ModelParameters

NOMINAL = ModelParameters()


@pytest.fixture
def passive(tmp_path):
    fixed = replace(NOMINAL.foot.fulcrum, rearmost_m=0.1, foremost_m=0.1)
    model = tmp_path / "passive.yaml"
    model.write_text(
        dump_yaml(replace(NOMINAL, foot=replace(NOMINAL.foot, fulcrum=fixed))), encoding="utf-8"
    )
    return model


def test_it_writes_page_csv_and_json_and_says_what_is_not_computed(run, tmp_path):
    out = tmp_path / "out"
    code, said, _ = run(
        "bench", "--protocol", "iso16955", "--fulcrum-mm", 108, "--max-load-n", 800, "--out", out
    )
    assert code == 0
    table = read_json(out / "protocol.json")
    assert [at["fulcrum_mm"] for at in table["settings"]] == [108.0] and table["load_n"] == 800.0
    assert "not computed: 7.3, torsion" in said and "Load 800 N" in said
    assert {path.name for path in out.iterdir()} >= {"report.html", "protocol.csv"}
    code, _, _ = run("report", out)
    assert code == 0


def test_a_passive_foot_is_tested_without_asking_for_a_place_and_its_file_is_in_the_record(
    run, tmp_path, passive
):
    out = tmp_path / "out"
    code, said, _ = run("bench", "--protocol", "aopa", "--model", passive, "--out", out)
    assert code == 0 and "passive" in said and "fulcrum" not in said
    assert list(read_json(out / "protocol.json")["provenance"]["inputs_sha256"]) == [
        "model: passive.yaml"
    ]


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("--protocol", "iso"), "--protocol: 'iso' is not known"),
        (("--protocol", "aopa", "--no-heel"), "--no-heel: a protocol tests the heel"),
        (("--protocol", "aopa", "--max-load-n", 100), "--max-load-n: 100 N is no useful load"),
        (("--protocol", "aopa", "--fulcrum-mm", 10), "--fulcrum-mm: the fulcrum at 10 mm"),
        (("--protocol", "aopa", "--speed-mm-per-min", 0), "--speed-mm-per-min: 0 m/s"),
    ],
)
def test_it_refuses_in_one_line_by_the_option_and_writes_nothing(run, tmp_path, words, why):
    code, _, error = run("bench", *words, "--out", tmp_path / "out")
    said = " ".join(error.split())
    assert code == 2 and why in said and "Traceback" not in said
    assert not (tmp_path / "out").exists()


def test_a_place_for_the_fulcrum_of_a_passive_foot_is_refused(run, tmp_path, passive):
    code, _, error = run(
        *("bench", "--protocol", "aopa", "--model", passive),
        *("--fulcrum-mm", 100, "--out", tmp_path / "out"),
    )
    assert code == 2 and "this foot has no fulcrum" in " ".join(error.split())
    assert not (tmp_path / "out").exists()
