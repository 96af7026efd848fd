"""What a tuning says: numbers against those of the made-up parabola, and nothing that it may not say."""

from __future__ import annotations

import numpy as np
import pytest
from made_tuning import BEST_MM, cost_of, failed_table, made_arrays, made_stride_arrays, made_stride_table, made_table

from vsf_drake.report.page import chapter_page
from vsf_drake.report.tuning.chapters import answer, first_line, tasks_words, tuning_page
from vsf_drake.report.tuning.figures import cost_curve_figure, outcomes_figure
from vsf_drake.report.tuning.reading import cost_at, excess, root_mean_squares

HARDLY = "THE SETTING HARDLY MATTERS"


def matters(value):
    """The outcomes of the made-up table, all of which matter or not."""
    return [row | {"matters": value} for row in made_table()["outcomes"]]


def said(**changes):
    return " ".join(answer(made_table(**changes)))


def test_savings_are_those_of_the_parabola():
    """2e-4 (66 - 104.2)² = 0.292 on 2: 12.7 % less than at the softest; 18.0 % less than at the stiffest."""
    soft, stiff = (100.0 * (1.0 - 2.0 / cost_of(mm)) for mm in (66.0, 151.0))
    words = said()
    assert f"{soft:.1f} % less than at the softest setting (66 mm, also recorded)" in words
    assert f"{stiff:.1f} % less than at the stiffest (151 mm, also recorded)" in words
    assert "another recorded one (108 mm)" in words


def test_what_only_holds_to_the_recording_is_told_apart_from_the_gain():
    """The whole parabola is such a term but for 1e-3 (mm - 66) BW: without it the softest setting is the best."""
    sweep = [row | {"terms": {"knee": 1.0 + 1e-3 * (row["fulcrum_mm"] - 66.0),
                              "consistency": row["cost"] - 1.0 - 1e-3 * (row["fulcrum_mm"] - 66.0)}}
             for row in made_table()["sweep"]]
    terms = [{"name": "knee", "label": "intact knee", "value": 1.0382, "share": 0.5},
             {"name": "consistency", "label": "change of the force", "value": 2.0 - 1.0382, "share": 0.5}]
    words = said(sweep=sweep, terms=terms, recorded_mm=[])
    assert "12.7 % less than at the softest setting" in words
    assert ('Without "change of the force", the part of the cost that only holds to the recording, it is 3.8 % MORE '
            "than at the softest setting (66 mm) and 4.3 % less than at the stiffest (151 mm).") in words
    assert "Without" not in said()


def test_setting_interval_and_cost_are_named():
    words = said()
    assert f"the fulcrum at {BEST_MM:.1f} mm has the least cost: 2 BW (load of the intact knee)." in words
    assert "Its interval is 98 to 111 mm: cost within its uncertainty." in words
    assert words.startswith("Of all settings between 66 and 151 mm, the")


def test_a_setting_that_hardly_matters_is_called_so_before_anything_else():
    first = answer(made_table(outcomes=matters(False)))[0]
    assert first.startswith(HARDLY)
    assert "± 0.05 BW" in first
    assert HARDLY not in said()


def test_without_an_uncertainty_of_the_cost_the_outcomes_decide():
    rest = matters(False)[1:]
    told = made_table()["outcomes"][0]
    assert "changes by 0.4374 BW, more than its uncertainty (± 0.05 BW)." in said(outcomes=[told | {"sentence": ""}])
    assert told["sentence"] in said()
    assert f"{HARDLY}: none of the outcomes" in said(outcomes=rest)
    assert HARDLY not in said(outcomes=[rest[0] | {"matters": True}, rest[1]])
    assert "not known" in said(outcomes=[]), "nothing was compared with an uncertainty"
    assert HARDLY not in said(outcomes=matters(None)), "not known is not no"


def test_outcomes_are_told_by_whether_they_matter():
    words = said()
    assert "Other outcomes that change by more than their uncertainty: push-off work." in words
    assert "Outcomes that change by no more than their uncertainty: first peak of the force." in words
    assert "All other outcomes change by more" in said(outcomes=matters(True))


def test_an_optimum_that_is_worse_than_what_was_recorded_is_not_called_better():
    assert "% MORE than at the recorded setting (108 mm)" in said(recorded_mm=[108.0], cost=2.5, at_bound=[])


def test_costs_below_zero_are_compared_as_they_are():
    sweep = [row | {"cost": row["cost"] - 5.0} for row in made_table()["sweep"]]
    words = said(sweep=sweep, cost=-3.0, recorded_mm=[])
    assert "0.2918 BW less than at the softest" in words
    assert "%" not in words.partition("Over the whole")[0]


def test_an_optimum_on_an_end_says_so():
    words = said(fulcrum_mm=66.0, cost=float(cost_of(66.0)), at_bound=["fulcrum"])
    assert "It is the softest setting itself." in words
    assert "On a bound of its range: fulcrum." in words


def test_what_did_not_end_well_recommends_nothing():
    for table in (failed_table(), failed_table(fulcrum_mm=None, cost=None), made_table(optimal=False)):
        words = " ".join(answer(table))
        assert "least" not in words and "less than" not in words
        page = tuning_page(table, {}, lenient=False)
        assert page["alarm"].startswith("NOT OPTIMAL") and page["title"].startswith("NOT OPTIMAL")
    assert tuning_page(made_table(), {}, lenient=False)["alarm"] == ""


def test_first_line_says_what_is_synthetic_and_what_the_model_leaves_out():
    assert first_line(made_table()).startswith("Data are SYNTHETIC, not recorded: low_2, medium_2 and high_2.")
    assert "would adapt the gait is not in these figures" in first_line(made_table())
    real = first_line(made_stride_table(synthetic=False))
    assert real.startswith("Recorded trials: medium_2.") and "SYNTHETIC" not in real
    assert "no muscles" in real


def test_what_one_setting_for_all_costs_is_the_parabola_s():
    """2e-4 · 14² and 2e-4 · 16² on 2: 1.96 and 2.56 %; the third lies on the common setting."""
    lost = [excess(row) for row in made_table()["tasks"]]
    assert lost == pytest.approx([1.96, 0.0, 2.56])
    assert "1.507 % more on average and 2.56 % at most" in tasks_words(made_table())


def test_cost_between_points_is_on_the_straight_line_and_nowhere_outside():
    table = made_table()
    x = np.array([71.0, 76.0])
    assert cost_at(table, 73.5) == pytest.approx(float(np.mean(cost_of(x))))
    assert cost_at(table, 60.0) is None
    assert cost_at(failed_table(), 73.5) is None


def test_cost_figure_draws_the_sweep_the_trials_and_the_optimum():
    figure = cost_curve_figure(made_table(), made_arrays())
    left, right = figure.axes
    named = {line.get_label(): line for line in left.get_lines()}
    np.testing.assert_allclose(named["cost"].get_ydata(), cost_of(named["cost"].get_xdata()))
    assert named["optimum, 104.2 mm"].get_xdata() == [BEST_MM]
    assert len([line for line in left.get_lines() if line.get_color() == "0.75"]) == 3
    parts = [line for line in right.get_lines() if len(line.get_xdata()) == 18]
    total = sum(line.get_ydata() for line in parts)
    np.testing.assert_allclose(total, cost_of(parts[0].get_xdata()) - 2.0, atol=1e-12, err_msg="terms add up")


def test_cost_figure_of_no_optimum_has_no_star():
    figure = cost_curve_figure(made_table(optimal=False), {})
    labels = [line.get_label() for line in figure.axes[0].get_lines()]
    assert "last iterate, NOT OPTIMAL" in labels
    assert not any(str(name).startswith("optimum") for name in labels)
    assert figure._suptitle.get_text().startswith("NOT OPTIMAL")


def test_outcomes_that_hardly_change_are_called_so():
    titles = [axes.get_title(loc="left").replace("\n", " ") for axes in outcomes_figure(made_table()).axes]
    assert titles == ["load of the intact knee", "push-off work", "first peak of the force: hardly changes"]


def test_alternative_text_has_the_numbers():
    page, _ = chapter_page(**tuning_page(made_table(), {}, lenient=False))
    assert "least 2.001 BW near 106 mm, most 2.438 BW at 151 mm. The optimum is at 104.2 mm." in page


def test_root_mean_square_of_a_constant_shift_is_that_shift():
    np.testing.assert_allclose(root_mean_squares(made_stride_arrays(), "q"), 0.02)
    assert root_mean_squares({}, "q") is None
