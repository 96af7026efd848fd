"""Files of a foot's force-displacement curves: what is read, and what is refused."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.model.foot_curves import load_foot_curves

HEADER = "part,displacement_mm,load_n,angle_deg,branch"
K_N_PER_MM = {"forefoot": 30.0, "heel": 60.0}
LOSS = 0.2
"""Share of the load that the way back lacks."""


def rows(part, angle, *, loss=LOSS, touch_mm=0.0):
    x = np.linspace(0.0, 900.0 / K_N_PER_MM[part], 20)
    there = [f"{part},{mm + touch_mm},{K_N_PER_MM[part] * mm},{angle},loading" for mm in x]
    back = [
        f"{part},{mm + touch_mm},{(1.0 - loss) * K_N_PER_MM[part] * mm},{angle},unloading"
        for mm in x[::-1]
    ]
    return [*there, *back]


GOOD = [HEADER, *rows("heel", -15), *rows("forefoot", 20, touch_mm=1.5)]


def written(tmp_path, lines):
    path = tmp_path / "curves.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_curves_are_read_by_part_and_angle_from_touch_down_on(tmp_path):
    forefoot, heel = load_foot_curves(written(tmp_path, GOOD))
    assert (forefoot.part, heel.part) == ("forefoot", "heel")
    assert forefoot.tilt_rad == pytest.approx(math.radians(20.0))
    assert heel.tilt_rad == pytest.approx(math.radians(-15.0))
    assert forefoot.touch_m == pytest.approx(1.5e-3)
    for curve in (forefoot, heel):
        assert curve.displacement_m[0] == 0.0 and curve.load_n[0] == 0.0
        stiffness = curve.load_n[1:] / curve.displacement_m[1:]
        np.testing.assert_allclose(stiffness, 1e3 * K_N_PER_MM[curve.part], rtol=1e-9)


def test_energy_lost_is_the_area_between_the_branches_over_that_under_loading(tmp_path):
    for curve in load_foot_curves(written(tmp_path, GOOD)):
        assert curve.lost_share == pytest.approx(LOSS, abs=1e-9)


@pytest.mark.parametrize("loss", [0.0, LOSS])
def test_an_unloading_that_stops_halfway_counts_only_as_far_as_it_goes(tmp_path, loss):
    """A straight line that lacks a share of its load lacks that share of its area over any part."""
    [curve] = load_foot_curves(written(tmp_path, [HEADER, *rows("forefoot", 0, loss=loss)[:32]]))
    assert curve.unloading[1][0] > 0.3 * curve.load_n[-1]
    assert curve.lost_share == pytest.approx(loss, abs=1e-9)


def test_an_unloading_that_ends_without_load_has_none_over_the_rest(tmp_path):
    """30 N/mm to 30 mm, and back along 40 N/mm to none at 7.5 mm: (30² - 22.5 * 30) / 30²."""
    there = [f"forefoot,{mm},{30 * mm},0,loading" for mm in np.linspace(0.0, 30.0, 20)]
    back = [f"forefoot,{mm},{40 * (mm - 7.5)},0,unloading" for mm in np.linspace(30.0, 7.5, 20)]
    [curve] = load_foot_curves(written(tmp_path, [HEADER, *there, *back]))
    assert curve.lost_share == pytest.approx(0.25, abs=1e-4)


def test_semicolons_decimal_commas_kilonewtons_and_no_optional_column_read_the_same(tmp_path):
    lines = ["displacement_mm;load_kn;part"]
    lines += [f"{mm};{0.030 * mm};forefoot".replace(".", ",") for mm in range(31)]
    [curve] = load_foot_curves(written(tmp_path, lines))
    assert curve.tilt_rad == 0.0 and curve.unloading is None and curve.lost_share is None
    assert curve.load_n[-1] == pytest.approx(900.0)


def scaled(column, factor):
    """The forefoot with one column's numbers in another unit."""
    lines = [HEADER]
    for line in rows("forefoot", 0):
        cells = line.split(",")
        cells[column] = str(float(cells[column]) * factor)
        lines.append(",".join(cells))
    return lines


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([], "is empty"),
        ([HEADER], "holds no curve of the forefoot"),
        ([HEADER, *rows("heel", 0)], "holds no curve of the forefoot"),
        (["part,displacement_mm,load_lbf", "forefoot,0,0"], "the column 'load_lbf' is unknown"),
        (["part,load_n", "forefoot,0"], "there are 0 columns of displacement"),
        ([HEADER, "toe,0,0,0,loading"], "line 2, column part: 'toe' is neither forefoot nor heel"),
        ([HEADER, "heel,0,0,0,up"], "column branch: 'up' is neither loading nor unloading"),
        ([HEADER, "loading,0,0,0,loading"], "column part: 'loading' is neither forefoot nor heel"),
        ([HEADER, "heel,0,0,0,forefoot"], "column branch: 'forefoot' is neither loading nor"),
        ([HEADER, "heel,0,x,0,loading"], "column load: 'x' is not a finite number"),
        ([HEADER, "heel,0,0,0"], "the row has 4 cells"),
        ([HEADER, *rows("forefoot", 0)[:4]], "has 4 rows of loading. At least 5 are needed"),
        (
            [HEADER, *rows("forefoot", 0)[:20], "forefoot,0,0,0,unloading"],
            "has 1 rows of unloading. At least 5",
        ),
        (
            [HEADER, *rows("forefoot", 0)[:20], *rows("forefoot", 0)[34:]],
            "unloading goes from 7.89 to 0 mm, loading ended at 30 mm",
        ),
        (
            [HEADER, *rows("forefoot", 0)[:27]],
            "unloading goes from 30 to 20.5 mm, loading ended at 30 mm",
        ),
        (scaled(2, 1e-3), "the largest load is 0.9 N. A foot bears 100 to 10000 N. Is it in kilo"),
        (
            scaled(2, 1.0 / 9.80665),
            "the largest load is 91.7745 N.*kilograms-force or pounds-force",
        ),
        (scaled(1, 1e-3), "the platen travels 0.03 mm.*Is it in metres"),
        (scaled(1, 1e3), "the platen travels 30000 mm.*Is it in micrometres"),
        (scaled(2, -1.0), "the load goes to -900 N. Compression is positive"),
        (scaled(1, 1.0 / 25.4), "900 N over 1.18 mm are 762 N/mm"),
        ([HEADER, *rows("forefoot", 0, loss=-0.3)], "unloading lies 270 N above loading at 30 mm"),
        (
            [HEADER, *[row.replace("unloading", "loading") for row in rows("forefoot", 0)]],
            "line 23: .*the displacement falls.*say unloading in a column branch",
        ),
        (
            [HEADER, *rows("forefoot", -20)],
            "the platen is not tilted so. angle_deg is from 0 to 45",
        ),
        ([HEADER, *rows("heel", 15)], "angle_deg is from -45 to 0 under the heel"),
    ],
)
def test_what_is_no_curve_of_a_foot_is_refused_by_file_and_place(tmp_path, lines, message):
    path = written(tmp_path, lines)
    if not lines:
        path.write_text("", encoding="utf-8")
    with pytest.raises(InputError, match=message.replace("(", r"\(")) as refused:
        load_foot_curves(path)
    assert re.match(re.escape(str(path)), str(refused.value))


def test_a_load_that_falls_while_the_foot_is_loaded_is_refused(tmp_path):
    lines = [HEADER, *rows("forefoot", 0)[:20]]
    lines[15] = "forefoot,22.2,300,0,loading"
    with pytest.raises(InputError, match=r"line 16: .*the load falls by"):
        load_foot_curves(written(tmp_path, lines))
