"""Where the fulcrum stands, as people say it: millimetres, or the stiffness that a bench finds."""

from __future__ import annotations

from dataclasses import replace

import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.device.bench_metrics import bench_table
from vsf_drake.model.parameters import FootParameters, ModelParameters
from vsf_drake.simulation.bench import run_bench
from vsf_drake.simulation.fulcrum_place import fulcrum_place

FOOT = FootParameters()
PASSIVE = replace(FOOT, fulcrum=replace(FOOT.fulcrum, rearmost_m=0.1, foremost_m=0.1))


@pytest.mark.parametrize("said", [108, 108.0, "108", "108 mm", " 108MM ", "108."])
def test_millimetres_are_from_the_keels_end(said):
    assert fulcrum_place(said, FOOT) == pytest.approx(0.108, abs=1e-12)


@pytest.mark.parametrize(("said", "printed"), [("16 N/mm", "16.00"), ("24.5n/mm", "24.50")])
def test_at_the_position_of_a_stiffness_the_bench_prints_that_stiffness(said, printed):
    """The bench moves its platen and its foot in time; the position is found at rest."""
    at_m = fulcrum_place(said, FOOT)
    table = bench_table(run_bench(ModelParameters(), fulcrums_m=[at_m], heel=False))
    assert f"{table.settings[0].stiffness_n_per_mm:.2f}" == printed


def test_a_stiffer_forefoot_is_a_fulcrum_farther_forward():
    places = [fulcrum_place(f"{k} N/mm", FOOT) for k in (11, 14, 20, 32)]
    assert FOOT.fulcrum.rearmost_m < places[0] and places == sorted(places)
    assert places[-1] < FOOT.fulcrum.foremost_m


def test_what_the_bench_prints_at_the_ends_of_the_reach_is_the_ends():
    ends = [fulcrum_place(said, FOOT) for said in ("10.23 N/mm", "32.40 N/mm")]
    assert ends == pytest.approx([FOOT.fulcrum.rearmost_m, FOOT.fulcrum.foremost_m], abs=1e-5)


@pytest.mark.parametrize(
    ("said", "what"),
    [
        ("9 N/mm", "reaches 10.23 N/mm (fulcrum at 66 mm) to 32.40 N/mm (151 mm)"),
        ("40N/mm", "no position of the fulcrum gives the forefoot 40 N/mm"),
        ("16", "Is it a stiffness? Then write 16N/mm"),
        ("300", "It must be between 66 and 151 mm"),
        ("0.108", "Is it in metres?"),
        ("10.8 cm", "'10.8 cm' is no position of the fulcrum"),
        ("16 kN/m", "as the forefoot's stiffness, such as 16N/mm"),
        ("66,151", "'66,151' is no position of the fulcrum"),  # two, not 66.151 mm
        ("soft", "Write it in mm from the keel's posterior end"),
        ("nan", "is no position"),
        ("", "is no position"),
        (None, "is missing"),
    ],
)
def test_a_position_that_cannot_be_is_refused_with_what_would_be_right(said, what):
    with pytest.raises(InputError) as refused:
        fulcrum_place(said, FOOT, file="walks.csv", where="row 3")
    assert what in str(refused.value) and "walks.csv: row 3" in str(refused.value)


def test_a_passive_foot_has_its_clamp_and_can_be_given_no_position():
    assert fulcrum_place(None, PASSIVE) == 0.1
    for said in ("100", "16 N/mm", 100.0):
        with pytest.raises(InputError, match="this foot has no fulcrum: it is passive"):
            fulcrum_place(said, PASSIVE)
