"""`vsf-drake certify`: its exit code and what it refuses."""

from __future__ import annotations

import pytest
from command_line import exit_code
from made_certificate import made_certificate

from vsf_drake.engines.certificate import run


@pytest.mark.parametrize(("apart", "code"), [(0.0, 0), (1e-3, 1)])
def test_the_exit_code_says_whether_all_that_ran_agree(tmp_path, monkeypatch, capsys, apart, code):
    monkeypatch.setattr(run, "certify", lambda foot, **how: made_certificate(apart=apart))
    assert exit_code("certify", "--out", tmp_path / "new") == code
    told = capsys.readouterr().out
    assert ("They do not agree" in told) == bool(code)
    assert (tmp_path / "new" / "report.html").is_file()


def test_an_engine_that_is_not_installed_is_said(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(run, "certify", lambda foot, **how: made_certificate(not_run="opensim"))
    assert exit_code("certify", "--out", tmp_path / "new") == 0
    assert "! OpenSim was not run: nobody installed it" in capsys.readouterr().out


def test_a_folder_of_other_things_is_refused_before_anything_runs(tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("mine")
    assert exit_code("certify", "--out", tmp_path) == 2
    assert "holds other things than an earlier certificate" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["simbody", "stepper"])
def test_an_unknown_engine_is_refused_and_so_is_this_package_alone(tmp_path, capsys, name):
    assert exit_code("certify", "--out", tmp_path / "new", "--engine", name) == 2
    assert f"'{name}' is no engine" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
