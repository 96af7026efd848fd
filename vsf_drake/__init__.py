"""A variable-stiffness foot prosthesis and the person who walks with it, in Drake.

    import vsf_drake as vsf

    foot       FootParameters, add_foot (FootHandles), wire_foot (WiredFoot), Ground, GroundPatch,
               add_fulcrum_drive, add_fulcrum_slider: the foot in a Drake diagram of your own
    stepped    make_stepped_leg, make_stepped_person: the implicit stepper as a Drake system
    bench      ModelParameters, run_bench, bench_table: load, displacement, stiffness
    any foot   foot_from_curves: a model from force-displacement curves of forefoot and heel;
               bench_protocol: a foot by the clauses of ISO/TS 16955, ISO 22675, AOPA
    a walk     load_trial, load_contact, trial_with, simulate_trial, walk_metrics
    to data    fit_offsets; ContactFit and fit_contact (`solve` of `vsf_drake.fit`)
    a setting  predict: motion, force and loads between recorded settings
    stiffness  StiffnessTuning and tune_stiffness (`vsf_drake.tuning.solve`)
    a session  session: from a folder of recordings to a verdict
    studies    make_study; WalkCase and simulate_batch: many walks at once
    engines    certify: do other engines compute the same foot?
    files      load_model; resource: a file that comes with the package

Each is loaded when it is first used. All else has its place in the modules below.
"""

_HOMES = {
    "ContactFit": "fit.problem",
    "FootHandles": "plants",
    "FootParameters": "model.parameters",
    "Ground": "model.ground",
    "GroundPatch": "model.ground",
    "ModelParameters": "model.parameters",
    "StiffnessTuning": "tuning.problem",
    "WalkCase": "simulation.batch",
    "WiredFoot": "plants",
    "add_foot": "plants",
    "add_fulcrum_drive": "plants",
    "add_fulcrum_slider": "plants",
    "bench_protocol": "device.bench_protocol",
    "bench_table": "device.bench_metrics",
    "certify": "engines.certificate.run",
    "fit_contact": "fit.solution:solve",
    "fit_offsets": "walks.offsets",
    "foot_from_curves": "device.foot_from_curves",
    "load_contact": "model.contact_file",
    "load_model": "model.model_file",
    "load_trial": "motion.trial",
    "make_stepped_leg": "simulation.stepped",
    "make_stepped_person": "simulation.stepped",
    "make_study": "validation.study",
    "predict": "tuning.answered",
    "resource": "base.files",
    "run_bench": "simulation.bench",
    "session": "sessions.run",
    "simulate_batch": "simulation.batch",
    "simulate_trial": "simulation.walk",
    "trial_with": "walks.recorded_walk:with_contact",
    "tune_stiffness": "tuning.solve:solve",
    "walk_metrics": "walks.metrics",
    "wire_foot": "plants",
}
__all__ = list(_HOMES)


def __getattr__(name: str) -> object:
    # itself most of what an import would take
    from importlib import import_module, metadata  # noqa: PLC0415

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
