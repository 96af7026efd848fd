"""Cost against work in one figure, from made-up costs."""

from __future__ import annotations

from cost_against_work import Cost, cost_figure

from vsf_drake.report.style import save_figure


def cost(family, size, wall_s, difference_bw, against="the finest"):
    return Cost(family=family, size=size, label=f"{size:g}", simulated_s=1.2, wall_s=wall_s, settling_s=0.01,
                iterations=2.5, unconverged=0, difference_bw=difference_bw, against=against)


COSTS = [
    cost("step", 4e-3, 0.03, 0.0027), cost("step", 1e-3, 0.09, 0.00056), cost("step", 1.25e-4, 0.6, 0.0, ""),
    cost("spheres", 24, 0.09, 0.0055), cost("spheres", 200, 0.2, 0.0, ""),
    cost("elements", 8, 0.09, 0.0065), cost("elements", 64, 1.9, 0.0, ""),
    cost("free", 15, 0.03, 1e-7), cost("free", 36, 0.04, 0.0054)]


def texts(axes):
    return [text.get_text() for text in axes.texts]


def test_every_walk_has_its_error_beside_it(tmp_path):
    figure = cost_figure(COSTS, title="Somebody's walk")
    step, spheres, elements, free = figure.axes
    assert texts(step) == ["real time", "finest", "0.056 %", "0.27 %"]
    assert texts(spheres)[1:] == ["0.55 %", "finest"]
    assert texts(elements)[1:] == ["0.65 %", "finest"]
    assert texts(free)[1:] == ["< 0.005 %", "0.54 %"]
    assert figure.get_suptitle().startswith("Somebody's walk")
    assert all(path.stat().st_size > 0 for path in save_figure(figure, tmp_path / "cost"))


def test_axes_have_names_and_real_time_is_in_sight_even_if_all_are_faster():
    figure = cost_figure([each for each in COSTS if each.wall_s < 1.0], title="Fast")
    for axes in figure.axes:
        assert axes.get_xlabel()
        assert axes.get_title(loc="left")
        assert axes.get_ylim()[0] < 0.03 / 1.2
        assert axes.get_ylim()[1] > 1.0
    assert "(ms)" in figure.axes[0].get_xlabel()
    assert "(s)" in figure.axes[0].get_ylabel()


def test_walks_stand_where_their_cost_without_settling_is():
    figure = cost_figure(COSTS, title="Somebody's walk")
    line = next(line for line in figure.axes[0].lines if len(line.get_xdata()) == 3)
    assert line.get_xdata().tolist() == [0.125, 1.0, 4.0]
    assert line.get_ydata().tolist() == [(wall - 0.01) / 1.2 for wall in (0.6, 0.09, 0.03)]
