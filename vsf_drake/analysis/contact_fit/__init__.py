"""Fits contact, geometry and shared errors of motion to recorded trials, and says what the fit is worth.

    fit = ContactFit([load_trial("soft.yaml"), load_trial("stiff.yaml")], bench=load_bench_file("bench.yaml"))
    solution = solve(fit)
    judged = assess(solution, [load_trial("other.yaml")])
    save_contact(solution.contact(verdict(solution, judged)), "contact.yaml")

With `options=PaperOptions()` the fit is that of McGeehan et al. 2021, done as it is written.
"""

from vsf_drake.analysis.contact_fit.assessment import Assessment, assess, verdict
from vsf_drake.analysis.contact_fit.options import ContactFitOptions, FitNoise, PaperOptions
from vsf_drake.analysis.contact_fit.parameters import (
    FitParameter,
    FitParameters,
    standard_parameters,
)
from vsf_drake.analysis.contact_fit.problem import ContactFit
from vsf_drake.analysis.contact_fit.solution import ContactFitSolution, solve

__all__ = (
    "Assessment",
    "ContactFit",
    "ContactFitOptions",
    "ContactFitSolution",
    "FitNoise",
    "FitParameter",
    "FitParameters",
    "PaperOptions",
    "assess",
    "solve",
    "standard_parameters",
    "verdict",
)
