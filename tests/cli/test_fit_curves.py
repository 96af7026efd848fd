"""`vsf-drake fit --bench curves.csv`: the curves' stiffness and displacement are fitted, shown and kept."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vsf_drake.files import resource

DATA = resource("data/reference_subject")
LOW = DATA / "exact/low_1.yaml"
HEAD = "fulcrum_mm,displacement_mm,load_n\n"


def spring(fulcrum, n_per_mm, to=600):
    return "".join(f"{fulcrum},{load / n_per_mm:.6f},{load}\n" for load in range(0, to + 1, 20))


def fitted(run, out, bench):
    words = ("--quick", "--freeze", "*", "--free", "contact.forefoot.force", "--free", "contact.forefoot.exponent")
    code, said, error = run("fit", LOW, "--bench", bench, "--out", out, *words)
    assert code == 0, error
    return json.loads((out / "fit.json").read_text(encoding="utf-8")), said


def test_curves_bring_the_displacement_into_fit_page_figure_and_screen(run, tmp_path):
    """Two parameters of the foam of the forefoot are enough to tell it."""
    both, said = fitted(run, tmp_path / "curves", DATA / "bench_curves.csv")
    alone, before = fitted(run, tmp_path / "stiffness", DATA / "bench.yaml")
    found = both["bench"]["mid_range"]
    apart = np.subtract(found["model_mm"], found["measured_mm"])
    assert found["rmse_mm"] == pytest.approx(np.sqrt(np.mean(apart**2))) and len(apart) == 5
    assert found["heel_model_mm"] > 0.0 and found["published_rmse_mm"] == 0.45
    assert "mid_range" not in alone["bench"] and "Mid-range" not in before and "Mid-range displacement, mm" in said
    assert "bench: bench_curves.csv" in both["inputs_sha256"] and both["options"]["bench"] == "bench_curves.csv"
    assert "Mid-range displacement" in (tmp_path / "curves/report.html").read_text(encoding="utf-8")
    assert any("displacement is" in text for text in both["verdict"])
    assert {row["series"] for row in both["noise"]["ratios"]} >= {"bench", "mid-range displacement"}


@pytest.mark.parametrize(("text", "words"), [
    (HEAD + spring("", 65.0), ["column fulcrum", "holds the heel only"]),
    (HEAD + spring(66, 10.0, to=200), ["fulcrum at 66 mm, column load", "200 N"]),
    (HEAD + spring(200, 10.0), ["column fulcrum", "200 mm"]),
    (HEAD.replace("load_n", "force") + spring(66, 10.0), ["line 1", "force", "unknown"]),
    ("# displacement_uncertainty_mm: -1\n" + HEAD + spring(66, 10.0), ["line 1", "'-1' is not usable"]),
])
@pytest.mark.parametrize("strategy", ["joint", "paper"])
def test_curves_that_cannot_be_used_are_refused_before_the_fit(run, tmp_path, strategy, text, words):
    bench = tmp_path / "curves.csv"
    bench.write_text(text, encoding="utf-8")
    code, _, error = run("fit", LOW, "--bench", bench, "--strategy", strategy, "--out", tmp_path / "fit")
    assert code == 2 and error.count("error:") == 1 and not (tmp_path / "fit").exists()
    for word in (str(bench), *words):
        assert word in error
