"""Fits contact, geometry and shared errors of motion to recorded trials, and says what the fit is worth.

    fit = ContactFit([load_trial("soft.yaml"), load_trial("stiff.yaml")], bench=load_bench_file("bench.yaml"))
    solution = solve(fit)
    judged = assess(solution, [load_trial("other.yaml")])
    save_contact(solution.contact(verdict(solution, judged)), "contact.yaml")
"""

from vsf_drake.analysis.contact_fit.parameters import FitParameter, FitParameters, standard_parameters
from vsf_drake.analysis.contact_fit.problem import ContactFit, ContactFitOptions
from vsf_drake.analysis.contact_fit.recordings import FitNoise
from vsf_drake.analysis.contact_fit.scores import Assessment, verdict
from vsf_drake.analysis.contact_fit.solution import ContactFitSolution, solve
from vsf_drake.analysis.contact_fit.table import assess

__all__ = ("Assessment", "ContactFit", "ContactFitOptions", "ContactFitSolution", "FitNoise", "FitParameter",
           "FitParameters", "assess", "solve", "standard_parameters", "verdict")
