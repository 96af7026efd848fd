"""Recordings of the reference subject that fits are tested with, and fits of few parameters."""

from __future__ import annotations

from dataclasses import replace

import pytest

from vsf_drake.analysis.contact_fit import ContactFit, ContactFitOptions
from vsf_drake.analysis.contact_fit.parameters import standard_parameters
from vsf_drake.analysis.validation.bench_lines import load_measured_bench
from vsf_drake.bench_curves import load_bench_file
from vsf_drake.files import resource
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker


def recording(name, tier="exact"):
    return load_trial(resource(f"data/reference_subject/{tier}/{name}.yaml"))


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


@pytest.fixture
def few_free(make_few_free):
    return make_few_free


@pytest.fixture(scope="session")
def make_few_free(fit_walker, soft):
    """A fit of the standard parameters, of which only the named ones are free."""
    def make(*names, trials=(soft,), bench=None, labels=None, **options):
        labels = labels or [trial.path.stem for trial in trials]
        parameters = standard_parameters(fit_walker.variables, "right", labels)
        frozen = [name for name in parameters.by_name if name not in names]
        return ContactFit(trials, walker=fit_walker, bench=bench, labels=labels,
                          parameters=parameters.changed(frozen, frozen=True),
                          options=replace(ContactFitOptions(), **options))

    return make
