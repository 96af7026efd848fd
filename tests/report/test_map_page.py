"""The page of a stiffness map: what stands first, what is drawn in, what is told of the surface."""

from __future__ import annotations

import re

import numpy as np
import pytest
from made_map import AXES, made_map

from vsf_drake.base.errors import InputError
from vsf_drake.report.map_page import MAP, curves_figure, map_rows, read_map, write_map
from vsf_drake.walks.published import published_effects


def radius(m, s, x):
    return 0.1 + 0.003 * (x - 66.0) + 0 * m


def page(tmp_path, **more):
    mapped = made_map(radius, tuple(np.linspace(0.9, 1.1, 19)), **more)
    write_map(tmp_path, mapped.table, mapped.arrays)
    return " ".join((tmp_path / "report.html").read_text(encoding="utf-8").split())


def test_the_first_words_are_that_it_does_not_prescribe_and_prost_is_named(tmp_path):
    text = page(tmp_path)
    body = re.sub("<[^>]*>", " ", text[text.index("<body>") :])
    first = body.index("answers mechanical targets; it does not prescribe")
    assert first < body.index("Stiffness map") and "Clites 2021" in body
    assert "10.1038/s41598-022-09114-y" in body and "0.33" in body


def test_a_saved_map_is_read_back_with_every_digit(tmp_path):
    page(tmp_path)
    again, made = read_map(tmp_path), made_map(radius, tuple(np.linspace(0.9, 1.1, 19)))
    assert again.table.quantities == made.table.quantities
    assert again.at("radius", mass_kg=71.0, fulcrum_mm=99.0) == made.at(
        "radius", mass_kg=71.0, fulcrum_mm=99.0
    )


def test_a_table_of_another_format_is_refused(tmp_path):
    page(tmp_path)
    path = tmp_path / MAP.table
    path.write_text(path.read_text().replace("stiffness map 1", "stiffness map 9"))
    with pytest.raises(InputError, match="format"):
        read_map(tmp_path)


def test_published_means_are_bands_in_the_panels_that_have_them():
    """Three feet, each a band and its mean, in radius, EFLR and returned energy; nothing in the
    others."""
    figure = curves_figure(made_map(radius), "mass_kg", published=True)
    lines = {
        axes.get_title(loc="left"): [line for line in axes.lines if line.get_linestyle() == ":"]
        for axes in figure.axes
    }
    assert {title: len(own) for title, own in lines.items() if own} == dict.fromkeys(
        ("radius (m)", "EFLR (1)", "returned (J/kg)"), 3
    )
    means = {
        row.mean
        for row in published_effects()
        if row.measure == "effective foot length ratio" and row.mean
    }
    assert {line.get_ydata()[0] for line in lines["EFLR (1)"]} == means == {0.78, 0.72, 0.76}


def test_a_radius_that_is_not_known_everywhere_is_said_and_the_rest_stands(tmp_path):
    text = page(tmp_path, unknown=True)
    assert "radius is unknown in 3 of 96 cells" in text and "EFLR" in text


def test_a_map_of_one_mass_and_one_slope_has_its_figure_too(tmp_path, monkeypatch):
    for name, value in (("mass_kg", 80.0), ("slope_deg", 0.0)):
        monkeypatch.setitem(AXES, name, (value,))
    page(tmp_path)
    assert [path.name for path in (tmp_path / "figures").iterdir()] == ["by_mass.png"]


def test_rows_hold_the_ends_of_the_reach_and_their_bands():
    first, *_, last = map_rows(made_map(radius, tuple(np.linspace(0.9, 1.1, 19))))
    assert (first["fulcrum_mm"], last["fulcrum_mm"]) == (66.0, 151.0)
    assert first["radius_low"] == pytest.approx(0.09) and last["radius_high"] == pytest.approx(
        0.355 * 1.1
    )
