"""One walk with the fulcrum elsewhere: its keel, its forces, and what they are held against."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.validation.moved_section import BETWEEN, SHOWN_POSITIONS, moved_section, moved_walks
from vsf_drake.validation.study import FITTED
from vsf_drake.validation.walking_curves import walk_curves
from vsf_drake.walks.comparison import resample


@pytest.fixture(scope="module")
def section():
    return moved_section(embedded_study())


def test_the_shown_walk_s_keel_rests_on_its_fulcrum_and_a_stiffer_setting_bears_more(section):
    """Moved over the carriage, motion kept: the keel's pieces keep their lengths, the support holds
    it there."""
    shown, moved = section.table, section.arrays
    assert (shown.label, shown.fulcrum_mm) == ("medium_2", 108.0) and shown.null_label == BETWEEN
    assert len(moved["fulcrum_mm"]) == SHOWN_POSITIONS
    assert moved["fulcrum_mm"][[0, -1]].tolist() == [66.0, 151.0]
    pieces = np.linalg.norm(np.diff(moved["keel_mm"], axis=1), axis=2)
    np.testing.assert_allclose(
        pieces, [[33.0, 44.644, *[23.286] * 6, 11.643]] * len(pieces), atol=2e-3
    )
    for x, keel in zip(moved["fulcrum_mm"], moved["keel_mm"], strict=True):
        assert abs(np.interp(x, *keel.T)) < 2.0 < keel[-1, 1]
    assert (np.diff(moved["load"][:, 0]) > 0.0).all()


def test_where_the_fulcrum_stood_the_curves_are_those_of_the_walk_beside_its_null(section):
    moved = section.arrays
    curves = {walk.label: walk_curves(walk) for walk in embedded_study().walks}
    own = moved["fulcrum_mm"].tolist().index(108.0)
    for name in ("resultant", "cop"):
        np.testing.assert_array_equal(
            [moved[f"{name}_measured"], moved[f"{name}_model"][own]], curves["medium_2"][name]
        )
    soft, stiff = (curves[label]["resultant"][0] for label in ("low_2", "high_2"))
    between = (42.0 * stiff + 43.0 * soft) / 85.0  # 108 mm between 66 and 151
    np.testing.assert_allclose(moved["resultant_null"], between, rtol=1e-9)


def test_the_moment_of_the_load_on_the_keel_is_that_of_all_its_spheres(section):
    walk = embedded_study().shown
    foot = walk.trial.model.foot
    spheres_mm = np.concatenate([zone.x_mm for zone in foot.zones])
    ahead = spheres_mm > 1e3 * foot.fulcrum.foremost_m
    loads = walk.result.sphere_normal_n[:, ahead]
    most = np.argmax(loads.sum(axis=1))
    load_n, at_mm = section.arrays["load"][section.arrays["fulcrum_mm"].tolist().index(108.0)]
    assert load_n * at_mm == pytest.approx(loads[most] @ spheres_mm[ahead], rel=1e-9)


def test_the_null_is_of_fitted_walks_where_there_are_any_and_at_one_setting_of_the_nearest():
    soft, shown, stiff = embedded_study().walks
    curve = {walk.label: walk_curves(walk)["resultant"][0] for walk in (soft, shown, stiff)}
    fitted = moved_section(
        dataclasses.replace(
            embedded_study(), walks=(dataclasses.replace(soft, role=FITTED), shown, stiff)
        )
    )
    assert (fitted.table.label, fitted.table.null_label) == (shown.label, soft.label)
    np.testing.assert_array_equal(fitted.arrays["resultant_null"], curve[soft.label])
    there = dataclasses.replace(stiff.trial, fulcrum_m=soft.trial.fulcrum_m)
    moved = moved_section(
        dataclasses.replace(
            embedded_study(), walks=(soft, dataclasses.replace(stiff, trial=there), shown)
        )
    )
    off = {
        walk.label: np.linalg.norm(curve[walk.label] - curve[shown.label]) for walk in (soft, stiff)
    }
    nearest = min(off, key=off.__getitem__)
    assert moved.table.null_label == nearest
    np.testing.assert_array_equal(moved.arrays["resultant_null"], curve[nearest])


def test_the_motion_is_the_same_at_every_setting():
    """What is prescribed, the legs and the pelvis, does not know where the fulcrum stands."""
    walk = embedded_study().shown
    walks = moved_walks(walk)
    knee = resample(walks[0.066].time_s, walk.result.time_s, walk.result.q)[
        :, walk.result.coordinate_names.index("knee_angle_r")
    ]
    for result in walks.values():
        own = resample(walks[0.066].time_s, result.time_s, result.q)
        np.testing.assert_allclose(
            own[:, result.coordinate_names.index("knee_angle_r")], knee, atol=1e-4
        )
