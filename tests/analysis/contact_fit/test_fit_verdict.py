"""A fit's worth in words: each sentence appears where its numbers are so, and nowhere else."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from vsf_drake.analysis.contact_fit.assessment import Assessment, FulcrumSweep, LeftOut, verdict
from vsf_drake.analysis.contact_fit.paper import PaperEnd
from vsf_drake.analysis.contact_fit.solution import JointEnd


def score(label="soft", role="fitted", error=0.02, null=None, floor=None, sweep=None):
    metrics = {"grf_rmse_bw": error, "null_model_grf_rmse_bw": null}
    return SimpleNamespace(label=label, role=role, metrics=metrics, floor_grf_rmse_bw=floor, sweep=sweep)


def swept(right=True, best_mm=100.0, true_mm=100.0, at_end=False):
    return FulcrumSweep(fulcrum_mm=(70.0, 100.0), grf_rmse_bw=(0.03, 0.02), true_mm=true_mm, best_mm=best_mm,
                        right=right, at_end=at_end)


def searched(cost=10.0, success=True):
    return SimpleNamespace(cost=cost, success=success)


def told(names=("offset.height", "contact.heel.force", "curve.knee_angle_r.0", "trial.soft.height"), **changes):
    return SimpleNamespace(**{"names": names, "unidentified": (), "singular_values": [3.0, 2.0, 1.5, 0.4],
                              "at_bound": (), "together": ()} | changes)


def solution(*, fulcrums=(0.066, 0.151), ratios=(0.8,), searches=None, best=0, uncertainty=None):
    terms = [SimpleNamespace(trial=f"soft{i}", name="vertical", residual=np.array([r])) for i, r in enumerate(ratios)]
    end = JointEnd(u=np.zeros(1), evaluation=SimpleNamespace(terms=terms), uncertainty=uncertainty or told(),
                   searches=tuple(searches or [searched()]), best=best)
    return SimpleNamespace(fit=SimpleNamespace(trials=[SimpleNamespace(fulcrum_m=x) for x in fulcrums]), end=end,
                           message="done")


def bench(off=0.5, heel=(65.0, 67.25)):
    return {"rmse_n_per_mm": off, "heel_measured_n_per_mm": heel[0], "heel_model_n_per_mm": heel[1]}


def words(found=None, *, scores=(), left_out=(), measured=None):
    return verdict(found or solution(), Assessment(scores=(score(), *scores), left_out=left_out, bench=measured))


def says(sentences, part):
    return any(part in sentence for sentence in sentences)


def test_what_is_left_on_the_fitted_trials_comes_first_beside_the_papers():
    first = words(scores=[score(error=0.04)])[0]
    assert "left with 3.0 % body weight" in first and "the paper's fitted trial with 5.3 %" in first


def test_one_stiffness_is_warned_of_and_two_are_not():
    warning = "one stiffness does not identify the model"
    assert says(words(solution(fulcrums=(0.1, 0.1))), warning)
    assert not says(words(), warning)


def test_without_held_out_trials_nothing_is_known_of_others():
    assert says(words(), "No trial was held out")
    assert not says(words(scores=[score(role="held out")]), "No trial was held out")


def test_held_out_trials_are_told_by_mean_and_worst():
    found = words(scores=[score("a", "held out", 0.02), score("b", "held out", 0.05)])
    assert says(found, "2 held-out trials: 3.5 % body weight on average, at worst 5.0 % (b)")
    assert says(words(scores=[score("a", "held out", 0.02)]), "1 held-out trial: 2.0 %")


def test_trials_that_the_null_model_beats_are_named():
    scores = [score("good", "held out", 0.02, null=0.03), score("bad", "held out", 0.04, null=0.03),
              score("even", "held out", 0.03, null=0.03)]
    assert says(words(scores=scores), "No better than a stretched measured curve without any model: bad, even.")
    assert says(words(scores=scores), "is 3.0 % off on average")
    assert not says(words(scores=scores[:1]), "No better than")
    unknown = [score("a", "held out", 0.02)]
    assert not says(words(scores=unknown), "stretched")


def test_trials_below_their_floor_are_named_fitted_ones_too():
    scores = [score("low", "fitted", 0.01, floor=0.02), score("a", "held out", 0.02, floor=0.03),
              score("b", "held out", 0.04, floor=0.03), score("c", "held out", 0.01)]
    below = [s for s in words(scores=scores) if "Below what the true foot itself" in s]
    assert len(below) == 1 and below[0].endswith(": low, a.")
    assert not says(words(scores=scores[2:]), "Below what the true foot")


def test_what_is_left_out_is_told_by_its_range_and_by_what_failed():
    rows = (LeftOut(kind="trial", left_out=("a",), grf_rmse_bw=0.03, cop_rmse_fl=0.1),
            LeftOut(kind="trial", left_out=("b",), grf_rmse_bw=0.05, cop_rmse_fl=None),
            LeftOut(kind="trial", left_out=("c",), grf_rmse_bw=None, cop_rmse_fl=None, failed="fell over"),
            LeftOut(kind="stiffness", left_out=("a", "b"), grf_rmse_bw=0.08, cop_rmse_fl=0.1))
    found = words(left_out=rows)
    assert says(found, "without each trial in turn, the one left out is predicted within 3.0 % to 5.0 % body weight")
    assert says(found, "without each stiffness in turn, the one left out is predicted within 8.0 % to 8.0 %")
    assert says(found, "The fit without c failed.")
    assert not says(words(), "left out") and not says(words(left_out=rows[:2]), "failed")


def test_leaving_out_stiffnesses_that_are_the_trials_is_told_once():
    rows = tuple(LeftOut(kind=kind, left_out=(name,), grf_rmse_bw=0.03, cop_rmse_fl=0.1)
                 for kind in ("trial", "stiffness") for name in "ab")
    assert sum("left out is predicted" in sentence for sentence in words(left_out=rows)) == 1


def test_sweeps_are_counted_and_wrong_ones_are_named():
    scores = [score("a", "held out", sweep=swept()), score("b", "held out", sweep=swept(at_end=True)),
              score("c", "held out", sweep=swept(right=False, best_mm=130.4, true_mm=100.0))]
    found = words(scores=scores)
    assert says(found, "fits best where it really stood in 2 of 3 trials; 2 of them could have erred to both sides")
    assert says(found, "c: the fulcrum fits best at 130 mm, but stood at 100 mm.")
    assert not says(found, "a: the fulcrum")
    assert not says(words(), "fulcrum fits best")


def test_a_sweep_all_of_whose_walks_failed_has_no_number():
    found = words(scores=[score("a", "held out", sweep=swept(right=False, best_mm=math.nan))])
    assert says(found, "every walk failed") and not says(found, "nan")


def test_the_bench_decides_whether_it_is_still_that_foot():
    assert says(words(), "No bench was given")
    near, far = words(measured=bench(0.5)), words(measured=bench(1.5))
    assert says(near, "0.50 N/mm off") and says(near, "still the foot of the bench") and says(near, "heel +2.25 N/mm")
    assert says(far, "1.50 N/mm off") and says(far, "another foot") and not says(far, "still the foot")
    assert not says(words(measured=bench(heel=(None, None))), "heel")


def test_noise_that_was_assumed_too_small_is_told_by_series():
    found = words(solution(ratios=(0.5, 1.0, 2.34)))
    assert says(found, "Residuals are 0.5 to 2.3 times that noise")
    assert says(found, "intervals are told too small: soft2 vertical (2.3 times).")
    assert not says(words(solution(ratios=(0.5, 1.0))), "too small")


def test_what_the_data_tell_is_counted_without_what_belongs_to_one_trial():
    found = words(solution(uncertainty=told(unidentified=("contact.heel.force", "curve.knee_angle_r.0",
                                                         "trial.soft.height"))))
    assert says(found, "1 of 3 free parameters that all trials share are told by the data")
    assert says(found, "1 directions are told less than by the prior")
    assert says(found, "Not identified, mostly what was believed before: contact.heel.force.")
    assert not says(words(), "Not identified")


def test_parameters_at_bounds_and_pairs_are_named():
    found = words(solution(uncertainty=told(
        at_bound=("offset.height",), together=(("offset.height", "contact.heel.force", -0.97),
                                               ("offset.height", "trial.soft.height", 0.99)))))
    assert says(found, "Ended at a bound, their errors mean nothing: offset.height.")
    assert says(found, "Known only together: offset.height and contact.heel.force (-0.97).")
    assert not says(found, "trial.soft.height")
    assert not says(words(), "Ended at a bound") and not says(words(), "Known only together")


def test_searches_that_ended_alike_are_counted():
    found = words(solution(searches=[searched(10.0), searched(11.5), searched(14.0)]))
    assert says(found, "2 of 3 searches ended alike (cost within 2 of 10.0).")
    assert not says(found, "did not converge")


def test_a_lower_search_that_did_not_converge_is_told():
    found = words(solution(searches=[searched(10.0), searched(6.0, success=False), searched(9.5, success=False)]))
    assert says(found, "1 of 3 searches ended alike") and says(found, "2 did not converge")
    assert says(found, "got to a lower cost, 6.0: allow more iterations")
    assert not says(words(solution(searches=[searched(10.0), searched(9.5, success=False)])), "allow more iterations")


@pytest.mark.parametrize("measured", [None, bench()])
def test_the_papers_fit_is_told_to_know_nothing_of_its_errors(measured):
    paper = solution(fulcrums=(0.1,))
    paper.end = PaperEnd(state=None, values={}, initial_values={}, converged=True, stopped_by="it stayed within 0.1 N")
    paper.message = paper.end.stopped_by
    found = words(paper, measured=measured)
    assert says(found, "to the resultant force alone") and says(found, "It ended so: it stayed within 0.1 N.")
    assert not any(says(found, part) for part in ("searches", "told by the data", "times that noise"))
    assert says(found, "one stiffness does not identify")


def test_all_is_said_in_whole_sentences():
    scores = [score("a", "held out", 0.04, null=0.03, floor=0.05, sweep=swept(right=False))]
    rows = (LeftOut(kind="trial", left_out=("a",), grf_rmse_bw=0.03, cop_rmse_fl=0.1),)
    for sentence in words(solution(fulcrums=(0.1,), ratios=(3.0,)), scores=scores, left_out=rows, measured=bench()):
        assert sentence.endswith("."), sentence
        assert "nan" not in sentence and "None" not in sentence
