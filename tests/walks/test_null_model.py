"""The null model: what it is of one setting and of two, and that it is not known where no stance is
whole."""

from __future__ import annotations

import numpy as np
import pytest
from made_results import STRIKE_S, WEIGHT_N, make_plate, make_walk

from vsf_drake.walks.comparison import PERCENT, compare
from vsf_drake.walks.null_model import ALONE, CUT, KnownCurve, null_errors

SINE = np.sin(np.pi * PERCENT / 100.0)


def errors(*curves, fulcrum_m=0.108, comparison=None, **options):
    return null_errors(
        comparison or compare(make_walk(), make_plate()),
        WEIGHT_N,
        [KnownCurve(*curve) for curve in curves],
        fulcrum_m,
        **options,
    )


def test_of_two_settings_the_harder_null_lies_between_them():
    """Curves of 0 and 2 body weights, half way: that of one body weight, wherever its own setting
    is."""
    one = errors((0.1, SINE)).null_bw
    found = errors((0.066, 0.0 * SINE), (0.150, 2.0 * SINE))
    assert found.null_bw == pytest.approx(one, rel=1e-12) and found.null_model_unknown == ""
    assert found.nearest_bw == min(
        errors((0.066, 0.0 * SINE)).nearest_bw,
        errors((0.066, 2.0 * SINE)).nearest_bw,
    )
    beyond = errors((0.066, 0.0 * SINE), (0.100, SINE))
    assert beyond.null_bw == pytest.approx(one, rel=1e-12), "beyond the settings the nearest one's"


def test_curves_of_one_setting_count_as_one_beside_another_and_alone_the_nearest_is_taken():
    """Means by setting, then between: (0.5 + 1.5) / 2 at one, 1 at the other, so 1 everywhere."""
    soft = ((0.066, 0.5 * SINE), (0.067, 1.5 * SINE))
    assert errors(*soft, (0.151, SINE)).null_bw == pytest.approx(
        errors((0.1, SINE)).null_bw, rel=1e-12
    )
    alone = errors(*soft)
    assert alone.null_bw == alone.nearest_bw == min(errors(curve).nearest_bw for curve in soft)


def test_without_a_curve_or_a_whole_stance_nothing_is_known_and_nothing_is_zero():
    """A foot that is loaded in its first frame: outside of that stance null and plate are zero,
    which is no score."""
    alone = errors()
    assert (alone.null_bw, alone.nearest_bw, alone.null_model_unknown) == (None, None, ALONE)
    cut = errors((0.1, SINE), comparison=compare(make_walk(), make_plate(start_s=STRIKE_S + 0.1)))
    assert (cut.null_bw, cut.nearest_bw, cut.null_model_unknown) == (
        None,
        None,
        CUT,
    )
    comparison = compare(make_walk(start_s=STRIKE_S + 0.1), make_plate())
    assert not comparison.stances[0].model.complete and comparison.stances[0].measured.complete
    late = errors((0.1, SINE), (0.2, SINE), comparison=comparison, predicted=True)
    assert (
        late.null_bw,
        late.nearest_bw,
        late.null_model_unknown,
    ) == (None, None, CUT)
    assert errors((0.1, SINE), comparison=comparison).null_bw > 0.0, (
        "the plate saw the stance as a whole"
    )
