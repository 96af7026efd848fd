"""A prediction in three layers, of a walk whose plate was not used.

*Physics*: the fitted foot under the recorded motion. *Momentum*: the same, corrected for this trial
so that the foot carries the person while the intact foot swings (`momentum`). *Discrepancy*: with
what the fitted trials' plates tell beyond that (`discrepancy`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vsf_drake.base.sentences import say
from vsf_drake.model.contact_file import Discrepancy, DiscrepancyCurve, FittedContact, MomentumBias
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.fitted_trial import fingerprint, trial_with
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.comparison import PERCENT, Comparison, compare
from vsf_drake.walks.discrepancy import (
    CODE_SCALE,
    COMPONENTS,
    LEAST_SETTINGS,
    beside_the_plates,
    earned,
    over_percent,
    settings_of,
)
from vsf_drake.walks.metrics import stance_curve, walk_metrics
from vsf_drake.walks.momentum import (
    MomentumCorrection,
    bias_of,
    corrected,
    with_corrections,
)
from vsf_drake.walks.null_model import KnownCurve, NullErrors, null_errors
from vsf_drake.walks.quantities import IN_LATE_STANCE, JUDGED, NULL, STRETCHED, mean
from vsf_drake.walks.recorded_walk import with_contact

PHYSICS, MOMENTUM, DISCREPANCY = LAYERS = ("physics", "momentum", "discrepancy")


@dataclass(frozen=True, kw_only=True, eq=False)
class LayeredWalk:
    """A trial's walk in layers; each comparison holds the model of its layer."""

    comparisons: Mapping[str, Comparison]
    results: Mapping[str, WalkResult]
    """the discrepancy has that of the momentum: it moves no centre of pressure"""
    correction: MomentumCorrection
    added_bw: np.ndarray
    """(101, 3) what the fitted plates add over the model's stance; zeros without any"""


SCORES = (
    JUDGED,
    "vertical_rmse_bw",
    "fore_aft_rmse_bw",
    "medio_lateral_rmse_bw",
    "cop_rmse_fl",
    "cop_ml_rmse_fl",
)
"""How far one layer is off the plate (`metrics.Agreement`)."""


@dataclass(frozen=True, kw_only=True)
class TrialLayers(NullErrors):
    """One trial in layers, by SCORES (what was not learned from any plate has none), beside the
    null model of the other fitted trials' curves: with the measured times of stance, and the harder
    one also with those that the physics predicts."""

    label: str
    fitted: bool
    fulcrum_mm: float
    layers: Mapping[str, Mapping[str, float | None]]
    null_model_predicted_times_grf_rmse_bw: float | None
    correction: MomentumCorrection
    added_rms_bw: float  # root mean square of the discrepancy that was added

    def error_in(self, layer: str) -> float | None:
        """The error that it is judged by in this layer."""
        return self.layers[layer][JUDGED]


@dataclass(frozen=True, kw_only=True)
class LayerTable:
    """A fit's predictions in layers, and what its plates taught; `untried` where no setting was
    fitted twice."""

    trials: tuple[TrialLayers, ...]
    momentum: MomentumBias | None
    discrepancy: Discrepancy | None
    untried: bool

    def mean(self, layer: str, key: str = JUDGED, *, fitted: bool = False) -> float | None:
        """Mean of a layer's score over the held-out trials, or the fitted ones; None without
        one."""
        return mean(row.layers[layer][key] for row in self.trials if row.fitted == fitted)

    @property
    def earned(self) -> str | None:
        """The layer that is nearest to the held-out trials' plates, of equals the lower one; None
        without one."""
        errors = {layer: error for layer in LAYERS if (error := self.mean(layer)) is not None}
        return min(errors, key=lambda layer: errors[layer], default=None)

    def teach(self, contact: FittedContact) -> FittedContact:
        """The contact with what the plates taught."""
        return replace(contact, momentum=self.momentum, discrepancy=self.discrepancy)


def predict(
    trial: Trial,
    contact: FittedContact,
    *,
    walker: Walker,
    step_s: float,
    errors: Mapping[str, float] | None = None,
) -> LayeredWalk:
    """A trial that has the fitted contact (`trial_with`) in layers; `walker` is of its subject and
    model. `errors` are further variables of its walk, by name, of which the layers know nothing.

    Raises:
        SimulationError: the walk of the physics fails.
    """
    errors = errors or {}
    bias = contact.momentum
    physics, result = _compared(walker, trial, errors, step_s)
    correction = (
        MomentumCorrection(believed=False, why_not="bias")
        if bias is None
        else corrected(walker, trial, bias, heading=physics.heading, errors=errors)
    )
    second = physics, result
    if correction.believed:
        c = (
            correction.height_m,
            correction.hip_flexion_rad,
            correction.knee_angle_rad,
            correction.alignment_rad,
        )
        second = _compared(walker, trial, with_corrections(errors, trial, np.array(c)), step_s)
    third = second[0]
    weight = trial.subject.mass_kg * GRAVITY
    if contact.discrepancy is not None:
        third = replace(
            third, model=beside_the_plates(third, contact.discrepancy, trial.fulcrum_m, weight)
        )
    added = over_percent(third, (third.model - second[0].model) / weight)
    return LayeredWalk(
        comparisons=dict(zip(LAYERS, (physics, second[0], third), strict=True)),
        correction=correction,
        added_bw=np.zeros((len(PERCENT), 3)) if added is None else added,
        results=dict(zip(LAYERS, (result, second[1], second[1]), strict=True)),
    )


def learned(
    contact: FittedContact, trials: Sequence[Trial], *, walker: Walker, step_s: float
) -> FittedContact:
    """The contact with what the plates of the trials that it was fitted to, as recorded, teach the
    other two layers."""
    applied = {fingerprint(trial): trial_with(trial, contact) for trial in trials}
    contact = replace(contact, momentum=bias_of(walker, applied), discrepancy=None)
    curves = []
    for text, trial in applied.items():
        walk = predict(trial, contact, walker=walker, step_s=step_s).comparisons[MOMENTUM]
        weight = trial.subject.mass_kg * GRAVITY
        plate, model = (over_percent(walk, force / weight) for force in (walk.measured, walk.model))
        measured = stance_curve(trial.prosthetic_plate, subject_mass_kg=trial.subject.mass_kg)
        if plate is not None and model is not None and measured is not None:
            columns = {
                f"{whose}{name}": tuple(column.tolist())
                for whose, found in (("", plate - model), ("plate_", plate))
                for name, column in zip(COMPONENTS, found.T, strict=True)
            }
            curves.append(
                DiscrepancyCurve(
                    fingerprint=text,
                    fulcrum_m=trial.fulcrum_m,
                    measured_bw=tuple(measured.tolist()),
                    **columns,
                )
            )
    return replace(contact, discrepancy=earned(curves)) if curves else contact


def layers_in(contact: FittedContact) -> tuple[str, ...]:
    """The layers that a contact has: without a discrepancy the third would be the second again."""
    return LAYERS if contact.discrepancy is not None else LAYERS[:2]


def layers_of(
    trial: Trial, label: str, contact: FittedContact, *, walker: Walker, step_s: float
) -> TrialLayers:
    """A recorded trial in layers, beside its plate, if it has one, and the null model; raises what
    `predict` and `with_contact` do."""
    own = fingerprint(trial)
    weight = trial.subject.mass_kg * GRAVITY
    learned_of = contact.discrepancy
    walk = predict(with_contact(trial, contact), contact, walker=walker, step_s=step_s)
    scores = {layer: dict.fromkeys(SCORES) for layer in LAYERS}
    for layer in layers_in(contact):
        found = walk_metrics(walk.results[layer], trial.plate, comparison=walk.comparisons[layer])
        scores[layer] = {name: getattr(found, name) for name in SCORES}
    others = [
        KnownCurve(curve.fulcrum_m, np.array(curve.measured_bw))
        for curve in (learned_of.curves if learned_of else ())
        if curve.fingerprint != own
    ]
    null = null_errors(walk.comparisons[PHYSICS], weight, others, trial.fulcrum_m)
    late = null_errors(walk.comparisons[PHYSICS], weight, others, trial.fulcrum_m, predicted=True)
    return TrialLayers(
        label=label,
        fitted=own in {one.fingerprint for one in contact.trials},
        fulcrum_mm=1e3 * trial.fulcrum_m,
        layers=scores,
        correction=walk.correction,
        **vars(null),
        null_model_predicted_times_grf_rmse_bw=late.null_bw,
        added_rms_bw=float(np.sqrt(np.mean(np.sum(walk.added_bw**2, axis=1)))),
    )


def layer_table(
    contact: FittedContact,
    fitted: Sequence[Trial],
    held_out: Sequence[Trial],
    labels: Sequence[str],
    *,
    step_s: float,
) -> LayerTable:
    """What the trials that a contact was fitted to teach, and all trials, as recorded, in layers;
    labels of both."""
    applied = trial_with(fitted[0], contact)
    walker = Walker(applied.subject, applied.model)
    contact = learned(contact, fitted, walker=walker, step_s=step_s)
    rows = tuple(
        layers_of(trial, label, contact, walker=walker, step_s=step_s)
        for trial, label in zip([*fitted, *held_out], labels, strict=True)
    )
    curves = contact.discrepancy.curves if contact.discrepancy else ()
    return LayerTable(
        trials=rows,
        momentum=contact.momentum,
        discrepancy=contact.discrepancy,
        untried=all(len(one) < 2 for one in settings_of(np.array([c.fulcrum_m for c in curves]))),
    )


def layer_sentences(table: LayerTable) -> list[str]:
    """Which layer the held-out trials earn, and what keeps the others from it."""
    rows = [row for row in table.trials if not row.fitted] or [*table.trials]
    known = table.discrepancy
    positions = np.array([curve.fulcrum_m for curve in known.curves] if known else [])
    judged = [
        (row.error_in(table.earned), row.null_bw)
        for row in rows
        if table.earned and row.null_bw is not None
    ]
    nearer = [error < null for error, null in judged if error is not None and null is not None]
    return say(
        "prediction",
        t=table,
        rows=rows,
        nearer=nearer,
        **{
            name: mean(row.number(name) for row in rows)
            for name in (NULL, IN_LATE_STANCE, STRETCHED)
        },
        few_settings=len(settings_of(positions)) < LEAST_SETTINGS,
        code_scale=CODE_SCALE,
    )


def _compared(
    walker: Walker, trial: Trial, values: Mapping[str, float], step_s: float
) -> tuple[Comparison, WalkResult]:
    walk = walker.walk_trial(trial, values=values, step_s=step_s)
    result = walker.result(walk, trial, trial.offsets, energy=False)
    return compare(result, trial.plate), result
