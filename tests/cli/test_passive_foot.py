"""Commands that move the fulcrum, given a foot whose support does not move."""

from __future__ import annotations

from dataclasses import replace

import pytest

from vsf_drake.base.schema import dump_yaml
from vsf_drake.model.parameters import ModelParameters

NOMINAL = ModelParameters()


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("map",), "A map is over the fulcrum"),
        (("export", "--form", "condensed", "--fulcrum-mm", 100), "Export the full foot"),
        (("certify",), "a fulcrum that moves"),
    ],
)
def test_they_refuse_it_in_one_line(run, tmp_path, words, why):
    fixed = replace(NOMINAL.foot.fulcrum, rearmost_m=0.1, foremost_m=0.1)
    passive = replace(NOMINAL, foot=replace(NOMINAL.foot, fulcrum=fixed))
    model = tmp_path / "passive.yaml"
    model.write_text(dump_yaml(passive), encoding="utf-8")
    code, _, error = run(*words, "--model", model, "--out", tmp_path / "out")
    said = " ".join(error.split())
    assert code == 2 and why in said and "Traceback" not in said
    assert "foot.fulcrum: this foot's support does not move: it stands at 100 mm" in said
    assert not (tmp_path / "out").exists()
