"""`vsf-drake check`: what it says of walks without simulating them."""

from __future__ import annotations

from command_line import read_json

from vsf_drake.files import resource


def test_check_of_a_synthetic_trial_calls_it_synthetic(run, tmp_path):
    out = tmp_path / "checked"
    code, shown, _ = run("check", resource("data/reference_subject/exact/medium_1.yaml"), "--out", out)
    assert code == 0
    assert "SYNTHETIC" in shown
    page = (out / "check.html").read_text(encoding="utf-8")
    assert "(SYNTHETIC)</title>" in page
    assert "SYNTHETIC, not recorded" in page


def test_check_goes_on_past_a_bad_manifest(run, tmp_path, trial_files):
    code, _, err = run("check", tmp_path / "none.yaml", trial_files.write(), "--out", tmp_path / "checked")
    assert code == 2
    assert "none.yaml" in err
    assert len(read_json(tmp_path / "checked" / "check.json")["trials"]) == 1
