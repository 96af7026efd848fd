"""A variable-stiffness foot prosthesis and the person who walks with it, in Drake.

    import vsf_drake as vsf

    foot       FootParameters, add_foot, wire_foot: the foot in a Drake diagram of your own
    bench      ModelParameters, run_bench, bench_table: load, displacement, stiffness
    a walk     load_trial, load_contact, trial_with, simulate_trial, walk_metrics
    to data    fit_offsets; ContactFit and fit_contact (`vsf_drake.analysis.contact_fit.solve`)
    stiffness  StiffnessTuning and tune_stiffness (`vsf_drake.analysis.tuning.level1.solve`)
    studies    make_study; WalkCase and simulate_batch: many walks at once
    files      resource: a file that comes with the package

Each is loaded when it is first used. All else has its place in the modules below.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vsf_drake.analysis.bench_metrics import bench_table
    from vsf_drake.analysis.contact_fit import ContactFit
    from vsf_drake.analysis.contact_fit.solution import solve as fit_contact
    from vsf_drake.analysis.metrics import walk_metrics
    from vsf_drake.analysis.offsets import fit_offsets
    from vsf_drake.analysis.tuning.level1 import StiffnessTuning
    from vsf_drake.analysis.tuning.level1.solve import solve as tune_stiffness
    from vsf_drake.analysis.validation import make_study
    from vsf_drake.contact_file import load_contact
    from vsf_drake.files import resource
    from vsf_drake.motion.fitted_trial import trial_with
    from vsf_drake.motion.trial import load_trial
    from vsf_drake.parameters import FootParameters, ModelParameters
    from vsf_drake.plants import add_foot, wire_foot
    from vsf_drake.simulation.batch import WalkCase, simulate_batch
    from vsf_drake.simulation.bench import run_bench
    from vsf_drake.simulation.walk import simulate_trial

    __version__: str

_HOMES = {
    "ContactFit": "analysis.contact_fit", "FootParameters": "parameters", "ModelParameters": "parameters",
    "StiffnessTuning": "analysis.tuning.level1", "WalkCase": "simulation.batch", "add_foot": "plants",
    "bench_table": "analysis.bench_metrics", "fit_contact": "analysis.contact_fit:solve",
    "fit_offsets": "analysis.offsets", "load_contact": "contact_file", "load_trial": "motion.trial",
    "make_study": "analysis.validation", "resource": "files", "run_bench": "simulation.bench",
    "simulate_batch": "simulation.batch", "simulate_trial": "simulation.walk", "trial_with": "motion.fitted_trial",
    "tune_stiffness": "analysis.tuning.level1:solve", "walk_metrics": "analysis.metrics", "wire_foot": "plants",
}
__all__ = ["ContactFit", "FootParameters", "ModelParameters", "StiffnessTuning", "WalkCase", "add_foot", "bench_table",
           "fit_contact", "fit_offsets", "load_contact", "load_trial", "make_study", "resource", "run_bench",
           "simulate_batch", "simulate_trial", "trial_with", "tune_stiffness", "walk_metrics", "wire_foot"]

if not TYPE_CHECKING:  # a type checker is to refuse names that there are not
    def __getattr__(name: str) -> object:
        from importlib import import_module, metadata  # noqa: PLC0415 (itself most of what an import would take)

        if name == "__version__":
            value = metadata.version("vsf-drake")
        elif name in _HOMES:
            module, _, own_name = _HOMES[name].partition(":")
            value = getattr(import_module(f"vsf_drake.{module}"), own_name or name)
        else:
            raise AttributeError(f"module 'vsf_drake' has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
