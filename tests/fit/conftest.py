"""Recordings of the reference subject that fits are tested with, and fits of few parameters."""

from __future__ import annotations

import pytest
from made_fit import recording

from vsf_drake.base.files import resource
from vsf_drake.device.bench_lines import load_measured_bench
from vsf_drake.fit.options import ContactFitOptions
from vsf_drake.fit.parameters import standard_parameters
from vsf_drake.fit.problem import ContactFit
from vsf_drake.model.bench_curves import load_bench_file
from vsf_drake.simulation.walk import Walker


@pytest.fixture(scope="session")
def soft():
    return recording("low_1")


@pytest.fixture(scope="session")
def stiff():
    return recording("high_1")


@pytest.fixture(scope="session")
def fit_walker(soft):
    return Walker(soft.subject, soft.model)


@pytest.fixture(scope="session")
def measured_bench():
    return load_bench_file(resource("data/reference_subject/bench.yaml"))


@pytest.fixture(scope="session")
def bench_curves():
    """The same foot's curves: stiffness and mid-range displacement."""
    return load_measured_bench(resource("data/reference_subject/bench_curves.csv"))


@pytest.fixture(scope="session")
def few_free(fit_walker, soft):
    """A fit of the standard parameters, of which only the named ones are free."""

    def make(*names, trials=(soft,), bench=None, labels=None, **options):
        labels = labels or [trial.path.stem for trial in trials]
        parameters = standard_parameters(fit_walker.variables, "right", labels)
        frozen = [name for name in parameters.by_name if name not in names]
        return ContactFit(
            trials,
            walker=fit_walker,
            bench=bench,
            labels=labels,
            options=ContactFitOptions(**options),
            parameters=parameters.changed(frozen, frozen=True),
        )

    return make
