"""Walks that do not look like one person over one plate are warned of, with the cause named."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_results import WEIGHT_N, make_plate, make_walk

from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.walks.comparison import compare
from vsf_drake.walks.metrics import walk_metrics, warnings
from vsf_drake.walks.offsets import OffsetFit


def warned(result, plate, fit=None):
    comparison = compare(result, plate)
    return warnings(result, comparison, walk_metrics(result, plate, comparison=comparison), fit)


@pytest.mark.parametrize("factor", [0.45, 2.2])
def test_mass_in_pounds_is_suspected(factor):
    walk = make_walk()
    wrong = dataclasses.replace(walk, subject_mass_kg=walk.subject_mass_kg * factor)
    assert any("mass_kg" in sentence for sentence in warned(wrong, make_plate()))


def test_plate_of_the_other_foot_is_suspected():
    plate = make_plate()
    elsewhere = dataclasses.replace(plate, cop_W=plate.cop_W + np.array([0.6, 0.0, 0.0]))
    assert any("assigned" in sentence for sentence in warned(make_walk(), elsewhere))


def test_walking_backward_is_suspected():
    walk = make_walk()
    q = np.array(walk.q)
    q[:, walk.coordinate_names.index("pelvis_tx")] *= -1.0
    assert any(
        "wrong way round" in sentence
        for sentence in warned(dataclasses.replace(walk, q=q), make_plate())
    )


def test_foot_that_brushes_the_ground_in_swing_is_told_with_time_and_load_but_for_a_touch():
    """A contact of 30 ms ahead of the stance, of 8 % or 4 % of the body's weight."""
    walk = make_walk()
    brushed = (walk.time_s > 0.3505) & (walk.time_s < 0.3805)
    for share, told in ((0.08, True), (0.04, False)):
        grf = walk.grf_W + np.outer(share * WEIGHT_N * brushed, [0.0, 0.0, 1.0])
        words = " ".join(warned(dataclasses.replace(walk, grf_W=grf), make_plate()))
        assert (
            "brushes the ground outside a stance at 0.350 s (0.08 body weights)." in words
        ) == told, words


@pytest.mark.parametrize(
    ("offsets", "named"),
    [
        ({"height_m": -0.055}, "the fitted height is -55 mm, beyond 20 mm"),
        ({"height_m": 0.019, "fore_aft_m": -0.019}, ""),
        ({"alignment_rad": np.radians(5.5)}, "the fitted alignment is +5.5°, beyond 5°"),
        ({"fore_aft_m": 0.03}, "the fitted fore-aft is +30 mm, beyond 20 mm"),
    ],
)
def test_an_offset_larger_than_how_a_foot_sits_is_named(offsets, named):
    fit = OffsetFit(
        offsets=GeometricOffsets(**offsets),
        standard_error=GeometricOffsets(),
        cost=1.0,
        success=True,
        message="",
        at_bound=(),
    )
    found = [
        sentence for sentence in warned(make_walk(), make_plate(), fit) if "FAR OFFSET" in sentence
    ]
    assert len(found) == bool(named) and all(named in sentence for sentence in found)


def test_fit_that_ends_on_a_bound_is_doubted():
    fit = OffsetFit(
        offsets=GeometricOffsets(),
        standard_error=GeometricOffsets(),
        cost=1.0,
        success=False,
        message="ran out of evaluations",
        at_bound=("fore_aft_m",),
    )
    found = warned(make_walk(), make_plate(), fit)
    assert any("fore_aft_m" in sentence for sentence in found)
    assert any("ran out of evaluations" in sentence for sentence in found)
