"""The page of a stiffness map: what stands first, what is drawn in, what is told of the surface."""

from __future__ import annotations

import re

import numpy as np
import pytest
from browser import chromium, look
from made_map import AXES, made_map
from page_layers import both_layers

from vsf_drake.base.errors import InputError
from vsf_drake.report.map_page import MAP, _what_if, curves_figure, map_rows, read_map, write_map
from vsf_drake.walks.published import published_effects


def radius(m, s, x):
    return 0.1 + 0.003 * (x - 66.0) + 0 * m


def page(tmp_path, **more):
    mapped = made_map(radius, tuple(np.linspace(0.9, 1.1, 19)), **more)
    write_map(tmp_path, mapped.table, mapped.arrays)
    return " ".join(both_layers(tmp_path).split())


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


def test_published_means_are_marks_in_the_panels_that_have_them():
    """Three feet, each a mark with a bar, in radius, EFLR and returned energy, beyond the
    model's fulcrum; nothing in the others."""
    figure = curves_figure(made_map(radius), "mass_kg", published=True)
    marks = {
        axes.get_title(loc="left"): [bar.lines[0] for bar in axes.containers]
        for axes in figure.axes
    }
    eflr = "rolls forward to (EFLR, 1)"
    assert {title: len(own) for title, own in marks.items() if own} == dict.fromkeys(
        ("roll-over radius (m)", eflr, "given back (J/kg)"), 3
    )
    assert len({mark.get_marker() for mark in marks[eflr]}) == 3, "told apart without colour"
    assert min(mark.get_xdata()[0] for mark in marks[eflr]) > 151.0
    means = {
        row.mean
        for row in published_effects()
        if row.measure == "effective foot length ratio" and row.mean
    }
    assert {mark.get_ydata()[0] for mark in marks[eflr]} == means == {0.78, 0.72, 0.76}


def test_a_radius_that_is_not_known_everywhere_is_said_and_the_rest_stands(tmp_path):
    text = page(tmp_path, unknown=True)
    assert "radius is unknown in 3 of 96 cells" in text and "EFLR" in text


def test_a_map_without_draws_speaks_of_no_band(tmp_path):
    mapped = made_map(radius)
    write_map(tmp_path, mapped.table, mapped.arrays)
    body = re.sub("<script.*?</script>|<[^>]*>", " ", both_layers(tmp_path), flags=re.DOTALL)
    assert "nan" not in body.split() and "shaded" not in body and "from and to" not in body


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


def test_sliders_are_given_the_surface_at_every_mass_and_slope_a_millimetre_apart():
    """The made foot returns 0.8 m / x joules of m kg with the fulcrum at x mm, on any slope."""
    told = _what_if(made_map(radius))
    mass, slope, fulcrum = (np.array(axis["at"]) for axis in told["axes"])
    assert [axis["name"] for axis in told["axes"]] == ["mass_kg", "slope_deg", "fulcrum_mm"]
    assert 0.0 < np.diff(fulcrum).min() and np.diff(fulcrum).max() <= 1.0 + 1e-9
    m, _, x = np.meshgrid(mass, slope, fulcrum, indexing="ij")
    returned = np.reshape(told["values"]["returned"], m.shape)
    np.testing.assert_allclose(returned, 0.8 * m / x, rtol=0.01)


CELLS = """
const put = (name, value) => {
  const slider = document.getElementById(`what-${name}`);
  slider.value = value;
  slider.dispatchEvent(new Event("input"));
};
const seen = [];
for (const mass of [50, 70, 90, 110]) for (const slope of [-6, -2, 2, 6]) for (const mm of [66, 83, 100, 117, 134, 151]) {
  put("mass_kg", mass); put("slope_deg", slope); put("fulcrum_mm", mm);
  seen.push(["eflr", "returned", "stiffness"].map(name => +document.getElementById(`what-${name}`).dataset.value));
}
put("mass_kg", 60); put("slope_deg", 0); put("fulcrum_mm", 91.5);
return {seen, between: +document.getElementById("what-returned").dataset.value};
"""  # noqa: E501


@pytest.mark.slow
@pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)
def test_sliders_give_the_computed_cells_and_the_surface_between_them_without_a_network(tmp_path):
    """The made foot returns 0.8 m / x joules of m kg with the fulcrum at x mm."""
    text = page(tmp_path)
    (tmp_path / "work").mkdir()
    seen = look(tmp_path / "report.html", tmp_path / "work", width=390, act=CELLS)
    assert (seen.console, seen.requests, seen.out) == ([], [], []) and len(text) < 2e6
    cells = [
        (0.6 + 0.002 * (x - 66.0), 0.8 * m / x, 10.0 + 0.2 * (x - 66.0))
        for m in (50.0, 70.0, 90.0, 110.0)
        for _ in range(4)
        for x in (66.0, 83.0, 100.0, 117.0, 134.0, 151.0)
    ]
    np.testing.assert_allclose(seen.acted["seen"], cells, rtol=0.01)
    assert seen.acted["between"] == pytest.approx(0.8 * 60.0 / 92.0, rel=0.02), "rounded to 1 mm"
