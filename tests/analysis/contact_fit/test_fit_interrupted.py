"""Ctrl-C ends a fit whatever solver is at work, and time left is told by the searches that ended."""

from __future__ import annotations

import importlib
from types import SimpleNamespace

import pytest

from vsf_drake.analysis.contact_fit import ContactFit, ContactFitOptions, solve
from vsf_drake.analysis.contact_fit.options import SOLVERS
from vsf_drake.analysis.contact_fit.solve import Search
from vsf_drake.files import resource
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker

searches = importlib.import_module("vsf_drake.analysis.contact_fit.solve")  # the package has a function of this name


@pytest.fixture(scope="module")
def trial():
    return load_trial(resource("data/reference_subject/exact/medium_1.yaml"))


@pytest.fixture(scope="module")
def walker(trial):
    return Walker(trial.subject, trial.model)


@pytest.mark.parametrize("solver", SOLVERS)
def test_ctrl_c_ends_a_fit_in_the_midst_of_any_solver(trial, walker, monkeypatch, solver):
    fit = ContactFit([trial], walker=walker, options=ContactFitOptions(solver=solver, starts=1, iterations=20))
    evaluate, count = fit.evaluate, 0

    def pressed_at_the_third(u, *, derivatives=True):
        nonlocal count
        count += 1
        if count == 3:
            raise KeyboardInterrupt
        return evaluate(u, derivatives=derivatives)

    monkeypatch.setattr(fit, "evaluate", pressed_at_the_third)
    with pytest.raises(KeyboardInterrupt):
        solve(fit)
    assert count == 3


def test_the_share_that_is_done_goes_by_the_time_of_searches_that_ended(trial, walker, monkeypatch):
    fit = ContactFit([trial], walker=walker, options=ContactFitOptions(starts=3))
    clock, told = SimpleNamespace(now=0.0), []

    def ten_seconds_long(_fit, start, progress):
        for i in range(1, 6):
            clock.now += 2.0
            progress(i, 1.0)
        return Search(start=start, u=start, start_cost=2.0, cost=1.0, success=True, message="", evaluations=5, failed=0)

    monkeypatch.setattr(searches, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    monkeypatch.setattr(searches, "_start", lambda fit, i: fit.parameters.start)
    monkeypatch.setattr(searches, "search", ten_seconds_long)
    searches.run_searches(fit, progress=lambda _, share: told.append((clock.now, share)))
    assert [share for _, share in told[5:]] == pytest.approx([now / 30.0 for now, _ in told[5:]])
