# What a type checker sees of `__init__.py`: the names, and no others.
from vsf_drake.base.files import resource
from vsf_drake.device.bench_metrics import bench_table
from vsf_drake.device.bench_protocol import bench_protocol
from vsf_drake.device.foot_from_curves import foot_from_curves
from vsf_drake.engines.certificate.run import certify
from vsf_drake.fit.problem import ContactFit
from vsf_drake.fit.solution import solve as fit_contact
from vsf_drake.model.contact_file import load_contact
from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import FootParameters, ModelParameters
from vsf_drake.motion.trial import load_trial
from vsf_drake.plants import (
    FootHandles,
    WiredFoot,
    add_foot,
    add_fulcrum_drive,
    add_fulcrum_slider,
    wire_foot,
)
from vsf_drake.sessions.run import session
from vsf_drake.simulation.batch import WalkCase, simulate_batch
from vsf_drake.simulation.bench import run_bench
from vsf_drake.simulation.stepped import make_stepped_leg, make_stepped_person
from vsf_drake.simulation.walk import simulate_trial
from vsf_drake.tuning.answered import predict
from vsf_drake.tuning.problem import StiffnessTuning
from vsf_drake.tuning.solve import solve as tune_stiffness
from vsf_drake.validation.study import make_study
from vsf_drake.walks.metrics import walk_metrics
from vsf_drake.walks.offsets import fit_offsets
from vsf_drake.walks.recorded_walk import with_contact as trial_with

__all__ = [
    "ContactFit",
    "FootHandles",
    "FootParameters",
    "Ground",
    "GroundPatch",
    "ModelParameters",
    "StiffnessTuning",
    "WalkCase",
    "WiredFoot",
    "add_foot",
    "add_fulcrum_drive",
    "add_fulcrum_slider",
    "bench_protocol",
    "bench_table",
    "certify",
    "fit_contact",
    "fit_offsets",
    "foot_from_curves",
    "load_contact",
    "load_model",
    "load_trial",
    "make_stepped_leg",
    "make_stepped_person",
    "make_study",
    "predict",
    "resource",
    "run_bench",
    "session",
    "simulate_batch",
    "simulate_trial",
    "trial_with",
    "tune_stiffness",
    "walk_metrics",
    "wire_foot",
]
__version__: str
