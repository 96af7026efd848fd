"""What a testing machine tells of a foot: curves as laboratories write them, stiffness by position,
what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.model.bench_curves import (
    BenchMeasurement,
    bench_doubts,
    load_bench_curves,
    load_bench_file,
)

HEAD = "fulcrum_mm,displacement_mm,load_n\n"
LOADS = (0, 100, 200, 300, 400, 500, 600)


def read(folder: Path, text: str, *, encoding: str = "utf-8"):
    path = folder / "bench.csv"
    path.write_bytes(text.encode(encoding))
    return load_bench_curves(path)


def spring(
    fulcrum: str, n_per_mm: float, *, loads=LOADS, start_mm: float = 0.0, more: str = ""
) -> str:
    """Rows of a linear spring whose platen touches at `start_mm`."""
    return "".join(f"{fulcrum},{start_mm + load / n_per_mm:.9f},{load}{more}\n" for load in loads)


def test_units_order_separators_and_line_ends_do_not_change_the_curve(tmp_path):
    plain = read(tmp_path, HEAD + spring("66", 10.0)).curves[0]
    metres = "".join(f"{load / 1e3},0.066,{load / 10.0 / 1e3:.6f}\n" for load in LOADS)
    rows = "".join(f"66\t{load / 10.0}\t{load}\n" for load in LOADS)
    decimal = "".join(f"66;{load / 10.0};{load},0\n" for load in LOADS).replace(".", ",")
    windows = "\ufeff# name: x\r\n" + (HEAD + spring("66", 10.0)).replace("\n", "\r\n")
    for text in (
        "load_kn,fulcrum_m,displacement_m\n" + metres,
        HEAD.replace(",", "\t") + rows,
        HEAD.replace(",", ";") + decimal,
        windows,
        HEAD.upper().replace("_MM", "_mm") + "\n" + spring("66", 10.0) + ",,\n# the end\n",
    ):
        curve = read(tmp_path, text).curves[0]
        assert curve.fulcrum_m == pytest.approx(0.066)
        np.testing.assert_allclose(curve.displacement_m, plain.displacement_m, atol=1e-12)
        np.testing.assert_allclose(curve.load_n, plain.load_n, atol=1e-9)


def test_settings_and_repeats_are_sorted_with_the_heel_last(tmp_path):
    text = (
        "fulcrum_mm,displacement_mm,load_n,repeat\n"
        + spring("", 65.0, more=",1")
        + spring("151", 32.0, more=",2")
    )
    text += spring("151", 31.0, more=",1") + spring("66", 10.0, more=",1")
    found = read(tmp_path, "# name: foot 3\n# synthetic: true,,\n" + text)
    assert (found.name, found.synthetic) == ("foot 3", True)
    settings = [(curve.fulcrum_m, curve.repeat) for curve in found.curves]
    assert settings == [(0.066, 1), (0.151, 1), (0.151, 2), (None, 1)]
    assert found.curves[1].displacement_m[-1] == pytest.approx(0.6 / 31.0)
    assert read(tmp_path, HEAD + spring("66", 10.0)).name == "bench"


def test_displacement_counts_from_touch_down_wherever_the_machine_stood(tmp_path):
    """The machine's own zero, a way through air and a preload leave the same linear spring."""
    air = "".join(f"66,{x},{load}\n" for x, load in ((3.0, -0.4), (3.5, 0.3), (3.95, -0.5)))
    approached = read(
        tmp_path, HEAD + air + spring("66", 10.0, loads=LOADS[1:], start_mm=4.0)
    ).curves[0]
    preloaded = read(
        tmp_path, HEAD + spring("66", 10.0, loads=(10, 20, *LOADS[1:]), start_mm=-1.0)
    ).curves[0]
    for curve in (approached, preloaded):
        assert curve.displacement_m[0] == curve.load_n[0] == 0.0
        assert (np.diff(curve.displacement_m) > 0.0).all()
        np.testing.assert_allclose(curve.load_n, 1e4 * curve.displacement_m, atol=1e-5)
    assert approached.first_load_n == 0.0 and preloaded.first_load_n == 10.0


def test_noise_moves_touch_down_by_no_more_than_itself(tmp_path):
    draw = np.random.default_rng(5)
    x = np.arange(-2.0, 60.0, 0.02)
    load = np.maximum(10.0 * x, 0.0) + draw.normal(0.0, 0.5, len(x))
    rows = "".join(f"66,{a:.4f},{b:.4f}\n" for a, b in zip(x, load, strict=True))
    curve = read(tmp_path, HEAD + rows).curves[0]
    assert curve.first_load_n == 0.0
    # N: 4 deviations
    assert np.polyfit(curve.displacement_m, curve.load_n, 1)[1] == pytest.approx(0.0, abs=2.0)


def test_samples_at_one_displacement_become_one(tmp_path):
    rows = "".join(f"66,{load / 10.0},{load + d}\n" for load in LOADS[1:] for d in (-1, 1))
    curve = read(tmp_path, HEAD + "66,0,0\n" + rows).curves[0]
    np.testing.assert_allclose(curve.load_n, LOADS)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ("is empty", "fulcrum_mm, displacement_mm and load_n")),
        (HEAD, ("no rows",)),
        (spring("66", 10.0), ("no line of column names", "fulcrum_mm")),
        ("fulcrum_mm,load_n\n66,0\n", ("line 1", "no column of displacement")),
        (
            "fulcrum_mm,displacement_in,load_n\n66,0,0\n",
            ("displacement_in", "unit 'in' is unknown", "mm or m"),
        ),
        (
            "fulcrum_mm,displacement,load_n\n66,0,0\n",
            ("column displacement", "unit is missing", "displacement_mm"),
        ),
        ("fulcrum_mm,displacement_mm,load_n,time_s\n66,0,0,0\n", ("'time_s' is unknown",)),
        (
            "fulcrum_mm,displacement_mm,displacement_m,load_n\n66,0,0,0\n",
            ("2 columns of displacement",),
        ),
        (HEAD + "66,0,0\n66,1,ten\n", ("line 3", "column load", "'ten' is not a finite number")),
        (
            HEAD + "66,0,0\n66,–,1\n",
            ("line 3", "column displacement", "'–' is not a finite number"),
        ),
        (
            HEAD + "66,0,0\n66,1–2,1\n",
            ("line 3", "column displacement", "'1–2' is not a finite number"),
        ),
        (
            HEAD + "66,0,0\n66,1\u202f000,1\n",
            ("line 3", "column displacement", "is not a finite number"),
        ),
        (HEAD + '66,0,0\n66,"0,5",1\n', ("line 3", "4 cells", "decimal point")),
        (HEAD + "66,0,0\n66,1,5\n66,−1,10\n", ("line 4", "displacement falls from 1 to -1 mm")),
        (
            "# displacement_uncertainty_mm: 0,5,5\n" + HEAD + spring("66", 10.0),
            ("'0.5.5' is not usable",),
        ),
        (HEAD + "nan,0,0\n", ("line 2", "column fulcrum", "not a finite number")),
        (HEAD + "66,0,5,1\n", ("4 cells", "decimal point")),
        (HEAD + "66,0\n", ("2 cells", "truncated")),
        (HEAD + spring("0.066", 10.0), ("no fulcrum position", "unit of its column")),
        (
            HEAD + spring("66", 10.0) + spring("66", 10.0),
            ("line 9", "displacement falls", "repeat"),
        ),
        (HEAD + spring("66", 10.0) + "66,61,300\n", ("line 9", "load falls by 300 N")),
        (
            HEAD + spring("66", -10.0, loads=[-x for x in LOADS]),
            ("never loaded", "compression are positive"),
        ),
        (
            HEAD + spring("66", 10.0, loads=[x / 1e3 for x in LOADS]),
            ("largest load is 0.6 N", "unit"),
        ),
        (HEAD.replace("_mm,l", "_m,l") + spring("66", 10.0), ("travels 60000 mm", "unit")),
        (
            HEAD + spring("66", 10.0, loads=LOADS[2:]),
            ("begins at 200 N of 600 N", "before the platen touches"),
        ),
        (
            HEAD + "66,0,20\n66,10,20.1\n66,20,20.2\n66,30,20.3\n66,40,300\n66,50,600\n",
            ("touch-down cannot be told", "Tare"),
        ),
        (HEAD + spring("66", 10.0, loads=(0, 300, 600)), ("has 3 samples", "At least 5")),
        (HEAD + "66,5,-20\n66,5,5\n66,5,6\n", ("never loaded as the platen moves",)),
        (
            "fulcrum_mm,displacement_mm,load_n,repeat\n" + spring("66", 10.0, more=",0.5"),
            ("no number of a pass",),
        ),
        (
            "# synthetic: maybe\n" + HEAD + spring("66", 10.0),
            ("# synthetic", "neither true nor false"),
        ),
    ],
)
def test_what_cannot_be_used_is_refused_with_file_place_and_what_would_be_right(
    tmp_path, text, words
):
    with pytest.raises(InputError) as refused:
        read(tmp_path, text)
    for word in ("bench.csv", *words):
        assert word in str(refused.value), str(refused.value)


@pytest.mark.parametrize(
    "spelled",
    [
        lambda text: text.replace("-", "\u2212"),
        lambda text: text.replace("-", "–"),
        lambda text: text.replace("-", "\uff0d").replace("1", "\uff11"),
        lambda text: text.replace(",", "\u00a0,\u202f"),
        lambda text: text.replace("66", "\ufeff66"),
    ],
    ids=["minus", "en dash", "full width", "no-break space", "BOM"],
)
def test_numbers_that_an_office_program_or_a_web_page_spelled_are_the_same_numbers(
    tmp_path, spelled
):
    """The machine stands 1 mm above the foot and reads -0.5 N there; touch-down is 0.05 mm before
    0 mm, on a line."""
    rows = "66,-1.0,-0.5\n" + spring("66", 10.0)
    plain, same = (
        read(tmp_path, HEAD + rows).curves[0],
        read(tmp_path, HEAD + spelled(rows)).curves[0],
    )
    np.testing.assert_array_equal(same.displacement_m, plain.displacement_m)
    np.testing.assert_array_equal(same.load_n, plain.load_n)


def test_an_uncertainty_may_have_a_decimal_comma(tmp_path):
    text = "# stiffness_uncertainty_n_per_mm: 0,25\n" + HEAD + spring("66", 10.0)
    assert read(tmp_path, text).stiffness_sd_n_per_m == 250.0


PUBLISHED = {66: 10.0, 108: 17.9, 151: 32.0}
"""N/mm at both ends of the carriage (McGeehan 2021), and their geometric mean, which the middle
nearly has."""


def bench_in(
    folder: Path, *, load: float = 1.0, travel: float = 1.0, at=lambda mm: mm
) -> list[str]:
    """What is doubted of the published foot where a newton stands as `load`, a millimetre as
    `travel`."""
    rows = [
        f"{at(mm)},{newton / k * travel:.9f},{newton * load:.9f}\n"
        for mm, k in PUBLISHED.items()
        for newton in LOADS
    ]
    return bench_doubts(read(folder, HEAD + "".join(rows)))


def test_the_published_foot_is_not_doubted_nor_one_twice_as_stiff_or_soft(tmp_path):
    for load in (1.0, 2.0, 0.5):
        assert bench_in(tmp_path, load=load) == []


@pytest.mark.parametrize(
    ("units", "named"),
    [
        ({"load": 1 / 9.80665}, "the loads may be in kgf"),
        ({"load": 1 / 4.4482216}, "the loads may be in lbf"),
        ({"travel": 0.1}, "the displacements may be in cm"),
        ({"travel": 1 / 25.4}, "the displacements may be in inches"),
        ({"load": 1 / 4.4482216, "travel": 1 / 25.4}, "it may be lbf over inches"),
    ],
)
def test_a_bench_in_another_unit_is_doubted_with_the_unit_that_makes_it_fit(tmp_path, units, named):
    [doubt] = bench_in(tmp_path, **units)
    assert named in doubt and "1 times the published stiffness" in doubt


def test_stiffness_that_falls_as_the_fulcrum_moves_forward_is_doubted(tmp_path):
    """A cantilever beyond its support is the stiffer the shorter it is: F = 3 E I d / (L - l)^3."""
    [doubt] = bench_in(tmp_path, at=lambda mm: 217 - mm)
    assert "falls from 32 N/mm at 66 mm to 10 at 151 mm" in doubt and "posterior" in doubt


def test_the_bench_file_of_a_fit_is_doubted_likewise(tmp_path):
    softer = WHOLE.replace("stiffness_n_per_mm: 10.0", "stiffness_n_per_mm: 1.0").replace(
        "stiffness_n_per_mm: 32,", "stiffness_n_per_mm: 3.2,"
    )
    assert bench_doubts(stated(tmp_path, WHOLE)) == []
    assert "kgf" in bench_doubts(stated(tmp_path, softer))[0]


WHOLE = """\
# a comment
name: a foot
synthetic: true
forefoot:
  - {fulcrum_mm: 66, stiffness_n_per_mm: 10.0, mid_range_displacement_mm: 31.5}
  - {fulcrum_mm: 151, stiffness_n_per_mm: 32, mid_range_displacement_mm: 9.25}
heel_stiffness_n_per_mm: 65.0
heel_mid_range_displacement_mm: 4.5
displacement_uncertainty_mm: 0.25
stiffness_uncertainty_n_per_mm: 0.5
max_load_n: 600
"""
SECOND = ", mid_range_displacement_mm: 9.25"


def stated(folder: Path, text: str) -> BenchMeasurement:
    path = folder / "bench.yaml"
    path.write_text(text, encoding="utf-8")
    return load_bench_file(path)


def without(*keys: str) -> str:
    return "".join(line for line in WHOLE.splitlines(keepends=True) if not line.startswith(keys))


BARE = (
    without("heel_mid", "displacement")
    .replace(", mid_range_displacement_mm: 31.5", "")
    .replace(SECOND, "")
)


def test_a_bench_file_is_read_into_si_with_and_without_what_may_be_left_out(tmp_path):
    bare = BenchMeasurement(
        name="a foot",
        synthetic=True,
        fulcrum_m=(0.066, 0.151),
        stiffness_n_per_m=(10e3, 32e3),
        heel_stiffness_n_per_m=65e3,
        uncertainty_n_per_m=500.0,
        max_load_n=600.0,
    )
    assert stated(tmp_path, BARE) == bare
    whole = stated(tmp_path, WHOLE)
    assert whole.mid_range_m == pytest.approx((0.0315, 0.00925))
    assert whole.heel_mid_range_m == pytest.approx(
        4.5e-3
    ) and whole.mid_range_uncertainty_m == pytest.approx(2.5e-4)
    headless = stated(tmp_path, without("heel", "synthetic"))
    assert (
        headless.heel_stiffness_n_per_m is headless.heel_mid_range_m is None
        and len(headless.mid_range_m) == 2
    )
    assert headless.synthetic is False


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            WHOLE.replace("600", "200"),
            ["max_load_n", "200 N", "mean slope above 200 N", "largest load"],
        ),
        (WHOLE.replace("151", "66"), ["forefoot[1].fulcrum_mm", "66 mm stands twice"]),
        (
            WHOLE.replace("66", "152"),
            ["forefoot[1].fulcrum_mm", "151 mm follows 152 mm", "must increase"],
        ),
        (without("forefoot", "  -") + "forefoot: []\n", ["forefoot", "holds no setting"]),
        (WHOLE.replace(SECOND, ""), ["forefoot[1].mid_range_displacement_mm", "missing"]),
        (
            without("displacement_uncertainty"),
            ["displacement_uncertainty_mm", "missing", "every setting"],
        ),
        (without("heel_mid"), ["heel_mid_range_displacement_mm", "missing"]),
        (
            without("heel_stiffness"),
            ["heel_mid_range_displacement_mm", "no heel_stiffness_n_per_mm"],
        ),
        (
            WHOLE.replace("31.5", "3150"),
            ["line 5", "forefoot[0].mid_range_displacement_mm", "between 0.01 and 300 mm"],
        ),
    ],
)
def test_what_is_wrong_in_a_bench_file_is_named(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        stated(tmp_path, text)
    for word in (f"{tmp_path / 'bench.yaml'}: ", *words):
        assert word in str(caught.value)


def test_a_spreadsheet_is_refused(tmp_path):
    with pytest.raises(InputError, match="not a text file"):
        read(tmp_path, HEAD, encoding="utf-16")
