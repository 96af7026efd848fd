"""Tables of contact fits, made up: with everything in them, and with names and numbers that are
hard to show."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from made_contact import made_person_walk
from made_results import make_plate, make_walk

from vsf_drake.base.files import resource
from vsf_drake.fit.assessment import LEFT_OUT, BenchRow, Beside, LeftOut, TrialCurves, TrialScore
from vsf_drake.fit.paper import PaperState
from vsf_drake.fit.solution import NoiseRatio
from vsf_drake.fit.solve import FitSearch, Pair, Uncertainty
from vsf_drake.fit.table import FitTable, FitTrialRow, ParameterRow, SmoothErrorRow
from vsf_drake.model.contact_file import PersonCurve
from vsf_drake.model.parameters import Subject
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.walks.fulcrum_sweep import swept
from vsf_drake.walks.metrics import walk_metrics
from vsf_drake.walks.momentum import MomentumCorrection
from vsf_drake.walks.person_curve import SPREADS
from vsf_drake.walks.phases import PHASES, PhaseErrors
from vsf_drake.walks.prediction import LAYERS, SCORES, LayerTable, TrialLayers

ODD = "<b>odd</b> $x_$ ü"
"""A label that is neither HTML nor a formula."""
POSITIONS = np.linspace(0.066, 0.151, 18)
METRICS = replace(
    walk_metrics(make_walk(), make_plate()),
    grf_rmse_bw=0.02,
    grf_r2=0.99,
    fore_aft_rmse_bw=0.01,
    cop_rmse_fl=0.03,
    cop_ml_rmse_fl=0.127,
    impulse_rmse_bws=0.004,
    stance_model_s=0.59,
    stance_measured_s=0.6,
    scored_window_s=((0.1, 1.1),),
    null_model_grf_rmse_bw=0.05,
    stretched_null_grf_rmse_bw=0.06,
    null_model_unknown="",
)


def recording(name: str) -> Trial:
    """A walk of the reference subject."""
    return load_trial(resource(f"data/reference_subject/exact/{name}.yaml"))


def made_curves(*, cop: bool = True) -> TrialCurves:
    """Model and plate of one trial."""
    time, centre = np.linspace(0.0, 1.2, 200), np.linspace(0.0, 0.9, 101)
    force = np.column_stack([0.1 * np.sin(5 * time), 0.0 * time, np.maximum(0.0, np.sin(3 * time))])
    return TrialCurves(
        time_s=time,
        measured_bw=force,
        model_bw=1.05 * force,
        cop_measured_fl=centre + 3.0,
        cop_model_fl=centre + 3.02 if cop else np.full(101, np.nan),
    )


def made_trial(
    label: str = "soft",
    role: str = "fitted",
    fulcrum_mm: float = 66.0,
    *,
    synthetic: bool = False,
    judged: bool = True,
    **changes: Any,
) -> FitTrialRow:
    """A row of a fit; `changes` are of its score."""
    errors = [*(0.02 + 2.0 * np.abs(POSITIONS[:-1] - 1e-3 * fulcrum_mm)), np.nan]
    score = TrialScore(
        **{
            "label": label,
            "role": role,
            "metrics": METRICS,
            "curves": made_curves(),
            "floor_grf_rmse_bw": 0.01,
            "sweep": replace(
                swept(POSITIONS, errors, true_m=1e-3 * fulcrum_mm), best_mm=fulcrum_mm, right=True
            ),
        }
        | changes
    )
    return FitTrialRow(
        label=label,
        file=f"{label}.yaml",
        role=role,
        synthetic=synthetic,
        fulcrum_mm=fulcrum_mm,
        notes=(),
        score=score if judged else None,
    )


def made_parameter(name: str, value: float = 0.5, **changes: Any) -> ParameterRow:
    """A row of a free parameter whose prior is 0 within 1."""
    row = ParameterRow(
        name=name,
        unit="m",
        value=value,
        start=0.0,
        interval_95=(value - 0.6, value + 0.6),
        share_of_prior=0.3,
        spread_over_starts=0.01,
        value_in_prior_sd=value,
        low=-4.0,
        high=4.0,
        prior_mean=0.0,
        interval_in_prior_sd=(value - 0.6, value + 0.6),
        prior_scale=1.0,
    )
    return replace(row, **changes)


def made_search(
    start_cost: float = 900.0, cost: float = 20.0, success: bool = True, message: str = "ftol"
) -> FitSearch:
    return FitSearch(
        start=np.zeros(5),
        u=np.zeros(5),
        start_cost=start_cost,
        cost=cost,
        success=success,
        message=message,
        evaluations=12,
        failed=0,
    )


PARAMETERS = (
    made_parameter("offset.height", 0.005),
    made_parameter("socket.tz.stiffness", 3.9, at_bound=True, unit="N/m"),
    made_parameter("contact.heel.force", -0.2, share_of_prior=0.9, unit="N"),
    made_parameter("curve.knee_angle_r.0", 0.1, unit="rad"),
    made_parameter("trial.soft.height", 0.0),
    ParameterRow(name="friction.mu_static", unit="1", value=0.5, start=0.5, frozen=True),
)
SEARCHES = (
    made_search(),
    made_search(np.inf, np.inf, False, "the walk fails where it starts"),
    made_search(2000.0, 19.0, False, "too many"),
)
BENCH = BenchRow(
    name="a foot",
    synthetic=False,
    max_load_n=600.0,
    fulcrum_mm=(66.0, 151.0),
    mid_range=None,
    stiffness=Beside(
        uncertainty=0.5,
        measured=(10.0, 32.0),
        model=(10.4, 31.0),
        heel_measured=65.0,
        heel_model=64.0,
        rmse=0.762,
    ),
)


def made_uncertainty(**changes: Any) -> Uncertainty:
    """Of the free ones of PARAMETERS."""
    names = tuple(row.name for row in PARAMETERS if not row.frozen)
    matrix = np.eye(5)
    matrix[0, 1] = matrix[1, 0] = -0.95
    made = Uncertainty(
        names=names,
        standard_error=np.full(5, 0.3),
        interval=np.zeros((5, 2)),
        share_of_prior=np.full(5, 0.3),
        correlation=matrix,
        singular_values=np.array([30.0, 4.0, 1.0, 0.2, 0.0]),
        at_bound=("socket.tz.stiffness",),
        unidentified=("contact.heel.force",),
        together=(Pair((names[0], names[1]), -0.95),),
    )
    return replace(made, **changes)


def made_layer_row(
    label: str,
    errors: tuple[float, float, float],
    *,
    fitted: bool = False,
    null: float | None = 0.03,
    **correction: Any,
) -> TrialLayers:
    """A trial whose scores are all `errors`, layer by layer; changes of its correction."""
    scores = {
        layer: dict.fromkeys(SCORES, error) for layer, error in zip(LAYERS, errors, strict=True)
    }
    return TrialLayers(
        label=label,
        fitted=fitted,
        fulcrum_mm=66.0,
        layers=scores,
        null_model_grf_rmse_bw=null,
        phases=made_phases(errors[2], null),
        null_model_predicted_times_grf_rmse_bw=null and null + 0.01,
        stretched_null_grf_rmse_bw=null and null + 0.02,
        null_model_unknown="" if null else "alone",
        correction=MomentumCorrection(**{"believed": True} | correction),
    )


def made_phases(error: float, null: float | None) -> tuple[PhaseErrors, ...]:
    """Everywhere the same errors, but in push-off twice the prediction's."""
    return tuple(
        PhaseErrors(
            phase=phase,
            component=component,
            person_bw=error * (2.0 if phase == "push-off" else 1.0),
            null_bw=null,
            null_predicted_times_bw=null and null + 0.01,
            in_interval=None,
        )
        for phase in PHASES
        for component in SPREADS
    )


def made_layers(*rows: TrialLayers, **changes: Any) -> LayerTable:
    """Trials in layers, and the person's own curve of two settings."""
    walks = tuple(made_person_walk(fingerprint="0" * 64, fulcrum_m=x) for x in (0.066, 0.151))
    return replace(
        LayerTable(
            trials=rows,
            momentum=None,
            person_curve=PersonCurve(walks=walks),
        ),
        **changes,
    )


def made_fit(**changes: Any) -> FitTable:
    """The table of a joint fit of two trials with a bench, judged by a third."""
    table = FitTable(
        strategy="joint",
        success=True,
        message="converged",
        synthetic=False,
        subject=Subject(
            name="Somebody", mass_kg=80.0, stature_m=1.8, sex="male", prosthetic_side="right"
        ),
        trials=(
            made_trial(),
            made_trial("stiff", fulcrum_mm=151.0),
            made_trial(
                ODD, "held out", 108.0, floor_grf_rmse_bw=None, curves=made_curves(cop=False)
            ),
        ),
        verdict=(
            "The fitted trials are left with 2.0 % body weight.",
            "Not <so> sure & so on.",
            "Ended at a bound: socket.tz.stiffness.",
        ),
        headline=(
            "The fitted trials are left with 2.0 % body weight.",
            "! Ended at a bound: socket.tz.stiffness.",
        ),
        bench=BENCH,
        left_out=(
            LeftOut(kind="trial", left_out=("soft",), scores={"grf_rmse_bw": 0.04}),
            LeftOut(
                kind="trial",
                left_out=("stiff",),
                scores=dict.fromkeys(LEFT_OUT),
                failed="the fit failed",
            ),
        ),
        parameters=PARAMETERS,
        curves=(SmoothErrorRow(coordinate="knee_angle_r", largest_deg=0.4),),
        uncertainty=made_uncertainty(),
        noise_ratios=(NoiseRatio("soft", "vertical", 0.4),),
        layers=made_layers(
            made_layer_row("soft", (0.02, 0.02, 0.01), fitted=True, height_m=0.0012),
            made_layer_row(ODD, (0.05, 0.041, 0.042), null=None, believed=False, why_not="window"),
        ),
        searches=SEARCHES,
        best_search=0,
        options={"starts": 3, "noise": {"vertical": 0.025}},
        wall_s=12.0,
        versions={"drake": "1.51"},
        inputs_sha256={"soft: soft.yaml": "0" * 64},
    )
    return replace(table, **changes)


def failed_fit(**changes: Any) -> FitTable:
    """What is left of it where the fit failed."""
    return made_fit(
        **{
            "success": False,
            "message": "no <search> converged",
            "verdict": (),
            "headline": (),
            "left_out": (),
            "parameters": (),
            "searches": SEARCHES[1:],
            "best_search": 1,
            "wall_s": None,
            "uncertainty": None,
            "curves": (),
            "layers": None,
            "noise_ratios": (),
            "bench": replace(BENCH, stiffness=None),
            "trials": (made_trial(judged=False),),
        }
        | changes
    )


def paper_fit(**changes: Any) -> FitTable:
    """A fit by the paper's procedure."""
    state = PaperState(
        stiffness=3.0,
        initial_objective_n2=100 * 120.0**2,
        objective_n2=100 * (100.0 / 3.0) ** 2,
        best=(),
        instants=100,
        history=tuple((i, 100 * (100.0 / i) ** 2, 0.1) for i in (1, 2, 3)),
        simulations=304,
        failed_simulations=2,
        wall_s=1.0,
    )
    row = ParameterRow(name="contact.heel.stiffness", unit="N/m^exponent", value=5e3, start=4e3)
    return made_fit(
        **{
            "strategy": "paper",
            "message": "converged in iteration 3",
            "paper": state,
            "searches": (),
            "best_search": None,
            "parameters": (row,),
            "left_out": (),
            "uncertainty": None,
            "curves": (),
            "noise_ratios": (),
        }
        | changes
    )
