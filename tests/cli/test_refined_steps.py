"""Steps that were cut into smaller ones are shown where there are any, and not otherwise."""

from __future__ import annotations

import dataclasses

import pytest
from made_results import make_bench, make_plate, make_walk

from vsf_drake.analysis.bench_metrics import bench_table
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.cli.app import print_text

REPORTED = {"offsets": {"height_m": 0.0, "fore_aft_m": 0.0, "alignment_rad": 0.0}, "offset_fit": None, "doubts": [],
            "notes": []}


@pytest.mark.parametrize("refined", [0, 5])
def test_walk_shows_cut_steps_only_if_there_are_any(capsys, refined):
    metrics = walk_metrics(make_walk(refined_steps=refined), make_plate())
    assert metrics.refined_steps == refined
    print_text("walk", **vars(metrics) | REPORTED, offsets_are="not fitted", alignment_deg=0.0)
    shown = [line.split() for line in capsys.readouterr().out.splitlines() if "cut into smaller ones" in line]
    assert [str(refined) in words for words in shown] == [True] * bool(refined)


@pytest.mark.parametrize("refined", [0, 2])
def test_bench_shows_cut_steps_of_all_passes_only_if_there_are_any(capsys, refined):
    bench = make_bench()
    settings = tuple(dataclasses.replace(setting, refined_steps=refined) for setting in bench.settings)
    table = bench_table(dataclasses.replace(bench, settings=settings))
    assert table["refined_steps"] == refined * len(settings)
    print_text("bench", **table)
    said = " ".join(capsys.readouterr().out.split())
    assert (f"{table['refined_steps']} cut into smaller ones" in said) == bool(refined)
