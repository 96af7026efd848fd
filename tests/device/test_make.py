"""Making a map: inverse then forward, other executors, bands on feet that were not drawn for them,
refusals."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.device.stiffness_map import StiffnessMap, iso_22675, make, make_map, standard_axes
from vsf_drake.device.stiffness_map.cells import ROLLED, Cell, roll_cells
from vsf_drake.model.parameters import ModelParameters

MODEL, LOAD = ModelParameters(), iso_22675(2e-3)
HELD = dict.fromkeys(("mass_kg", "slope_deg", "alignment_deg"), (0.0,)) | {
    "mass_kg": (90.0,),
    "heel_ratio": (1.0,),
}
SMALL = {**HELD, "fulcrum_mm": (66.0, 80.0, 94.0, 108.0, 122.0, 136.0, 151.0)}


@pytest.fixture(scope="module")
def small():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(make, "HELD_OUT", 6)
        return make_map(
            MODEL, axes=SMALL, load=LOAD, draws=0, workers=1, inputs={"--load mine.csv": "0" * 64}
        )


@pytest.mark.parametrize(
    ("name", "target"),
    [
        ("radius", 0.25),
        ("eflr", 0.75),
        ("moment_arm", 30.0),
        ("stored", 15.0),
        ("returned", 12.0),
        ("stiffness", 20.0),
    ],
)
def test_the_foot_rolled_where_the_inverse_says_has_the_target_within_2_percent(
    small, name, target
):
    mapped = StiffnessMap(*small)
    (place,) = mapped.inverse(name, target, mass_kg=90.0).positions_mm
    assert mapped.rolled(name, fulcrum_mm=place) == pytest.approx(target, rel=0.02)


def test_the_table_tells_cells_errors_and_what_it_was_made_of(small):
    table, arrays = small
    assert table.cells == 7 and table.draws == 0 and table.held_out == 6
    assert table.inputs["--load mine.csv"] == "0" * 64
    assert {item.name for item in table.quantities} == {"stiffness", *ROLLED}
    assert all(
        item.within and 0.0 <= item.median_error <= item.largest_error for item in table.quantities
    )
    reply = roll_cells(
        MODEL.foot,
        LOAD,
        [Cell(mass_kg=90.0, slope_deg=0.0, fulcrum_mm=94.0, alignment_deg=0.0, heel_ratio=1.0)],
    )[0]
    assert {name: float(arrays[f"cells/{name}"][0, 0, 2, 0, 0]) for name in ROLLED} == reply.values


@pytest.mark.parametrize("at_once", [1, 3])
def test_threads_of_a_callers_executor_give_the_same_numbers(small, monkeypatch, at_once):
    monkeypatch.setattr(make, "HELD_OUT", 6)
    monkeypatch.setattr(make, "_AT_ONCE", at_once)
    with ThreadPoolExecutor(2) as pool:
        table, arrays = make_map(MODEL, axes=SMALL, load=LOAD, draws=0, executor=pool, workers=2)
    assert table.quantities == small[0].quantities
    for name, values in small[1].items():
        np.testing.assert_array_equal(arrays[name], values)


def test_two_workers_make_the_same_map_to_the_bit(small, monkeypatch):
    monkeypatch.setattr(make, "HELD_OUT", 6)
    _, arrays = make_map(MODEL, axes=SMALL, load=LOAD, draws=0, workers=2)
    for name, values in small[1].items():
        np.testing.assert_array_equal(arrays[name], values, err_msg=name)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"mass_kg": (50.0, 70.0, 90.0)}, "mass_kg: has 3 values"),
        ({"slope_deg": (20.0,)}, "slope_deg: 20 is out"),
        ({"fulcrum_mm": (20.0, 80.0, 100.0, 120.0)}, "fulcrum_mm: the fulcrum at 20 mm"),
        ({"fulcrum_mm": (80.0,)}, "A map is over the fulcrum"),
        ({"mass_kg": (90.0, 80.0, 70.0, 60.0)}, "do not rise"),
    ],
)
def test_axes_that_make_no_surface_are_refused_by_name(change, said):
    with pytest.raises(InputError, match=said):
        make_map(MODEL, axes={**SMALL, **change}, load=LOAD)


def test_too_few_draws_for_a_band_are_refused():
    with pytest.raises(InputError, match="draws: 5 are too few"):
        make_map(MODEL, axes=SMALL, load=LOAD, draws=5)


def test_the_standard_map_has_225_cells_over_the_carriages_reach():
    axes = standard_axes(MODEL.foot)
    assert np.prod([len(values) for values in axes.values()]) == 225
    assert (axes["fulcrum_mm"][0], axes["fulcrum_mm"][-1]) == (66.0, 151.0)


def test_heels_of_a_grid_are_rolled_each_on_its_own_foot(monkeypatch):
    """A softer heel sinks in more in early stance and changes the shape; order and feet must not be
    mixed."""
    monkeypatch.setattr(make, "HELD_OUT", 2)
    heels = (0.5, 1.0, 1.5, 2.0)
    axes = {**SMALL, "heel_ratio": heels, "fulcrum_mm": (66.0, 90.0, 120.0, 151.0)}
    _, arrays = make_map(MODEL, axes=axes, load=LOAD, draws=0, workers=1)
    for k in (0, 3):
        alone = roll_cells(
            make.with_heel(MODEL.foot, heels[k]),
            LOAD,
            [
                Cell(
                    mass_kg=90.0,
                    slope_deg=0.0,
                    fulcrum_mm=120.0,
                    alignment_deg=0.0,
                    heel_ratio=heels[k],
                )
            ],
        )[0]
        assert float(arrays["cells/radius"][0, 0, 2, 0, k]) == alone.values["radius"]


@pytest.mark.slow
def test_bands_hold_85_percent_of_synthetic_feet_that_were_not_drawn_for_them(monkeypatch):
    monkeypatch.setattr(make, "HELD_OUT", 2)
    axes = {**SMALL, "fulcrum_mm": (66.0, 94.0, 122.0, 151.0)}
    mapped = StiffnessMap(*make_map(MODEL, axes=axes, load=LOAD, draws=40, seed=1))
    held, of = 0, 0
    for foot in make._drawn_feet(MODEL, 40, 2):
        places = (75.0, 105.0, 140.0)
        for mm, reply in zip(
            places,
            roll_cells(
                foot,
                LOAD,
                [
                    Cell(
                        mass_kg=90.0,
                        slope_deg=0.0,
                        fulcrum_mm=mm,
                        alignment_deg=0.0,
                        heel_ratio=1.0,
                    )
                    for mm in places
                ],
            ),
            strict=True,
        ):
            for name in ("radius", "eflr", "moment_arm", "stored", "returned"):
                band = mapped.at(name, fulcrum_mm=mm)
                held, of = held + (band.low <= reply.values[name] <= band.high), of + 1
    assert held / of >= 0.85


@pytest.mark.slow
def test_the_standard_map_misses_held_out_cells_and_targets_between_cells_by_2_percent_at_most():
    mapped = StiffnessMap(
        *make_map(MODEL, axes=standard_axes(MODEL.foot), load=LOAD, draws=0, workers=2)
    )
    assert mapped.table.held_out == 40 and mapped.table.unknown == {}
    assert {
        item.name: item.largest_error
        for item in mapped.table.quantities
        if item.largest_error > 0.02
    } == {}
    for name, target in (
        ("radius", 0.3),
        ("eflr", 0.75),
        ("moment_arm", 30.0),
        ("stored", 12.0),
        ("returned", 10.0),
        ("stiffness", 20.0),
    ):
        (place,) = mapped.inverse(name, target, mass_kg=72.0, slope_deg=1.5).positions_mm
        there = mapped.rolled(name, mass_kg=72.0, slope_deg=1.5, fulcrum_mm=place)
        assert there == pytest.approx(target, rel=0.02), name


@pytest.mark.slow
def test_a_dask_cluster_of_two_processes_gives_the_same_map(small, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="pip install 'vsf-drake[cluster]'")
    monkeypatch.setattr(make, "HELD_OUT", 6)
    monkeypatch.setattr(make, "_AT_ONCE", 3)
    options = {
        "n_workers": 2,
        "threads_per_worker": 1,
        "processes": True,
        "dashboard_address": None,
    }
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        table, arrays = make_map(
            MODEL, axes=SMALL, load=LOAD, draws=0, executor=client.get_executor()
        )
        pids = client.run(os.getpid)
    assert len(set(pids.values()) - {os.getpid()}) == 2
    assert table.quantities == small[0].quantities and arrays.keys() == small[1].keys()
    for name, values in small[1].items():
        np.testing.assert_array_equal(arrays[name], values, err_msg=name)
