"""A prediction in three layers, of a walk whose plate is not used.

*Physics*: the fitted foot under the recorded motion. *Momentum*: the same, corrected for this trial
so that the foot carries the person while the intact foot swings (`momentum`). *Person*: the
person's own curve, as the fitted trials' plates show it, with what the other two say is different
about this walk (`person_curve`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vsf_drake.base.sentences import say
from vsf_drake.model.contact_file import FittedContact, MomentumBias, PersonCurve, PersonWalk
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.model.setting import AtSetting
from vsf_drake.motion.fitted_trial import fingerprint, trial_with
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import Walk, Walker
from vsf_drake.walks.between_settings import between_settings
from vsf_drake.walks.comparison import (
    Comparison,
    compare,
    partner,
    percent_instants,
    resample,
    rmse,
    walking_direction,
)
from vsf_drake.walks.metrics import stance_curve, walk_metrics
from vsf_drake.walks.momentum import (
    MomentumCorrection,
    bias_of,
    corrected,
    with_corrections,
)
from vsf_drake.walks.null_model import KnownCurve, NullErrors, null_errors, stretched
from vsf_drake.walks.person_curve import (
    FORCES,
    PersonForce,
    SeenWalk,
    laid,
    measured,
    seen,
    spread,
)
from vsf_drake.walks.phases import PhaseErrors, mean_phases, phase_errors
from vsf_drake.walks.quantities import IN_LATE_STANCE, JUDGED, NULL, STRETCHED, mean
from vsf_drake.walks.recorded_walk import with_contact

PHYSICS, MOMENTUM, PERSON = LAYERS = ("physics", "momentum", "person")
SAME_BW = 1e-3
"""Plates whose forces over stance differ by less (body weights, root mean square), one of them
scaled to the other, measured the same steps (a choice). The same differ by 1e-6 at most; the two
walks most alike of a synthetic person of data/sessions by 14e-3, on one day by 15e-3."""
SAME_MASS = 0.05
"""By which share the body weights may differ that the forces of the same steps were divided by (a
choice): a mass that was weighed again, rounded, or taken with other clothes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LayeredWalk:
    """A trial's walk in layers, made without its plate.

    Attributes:
        results: by layer, of the physics and with the person's momentum (the same where the
            correction is not believed).
        seen: what the walk tells to the person's curve.
        person: the force by the person's own curve; None where the contact has none.
    """

    results: Mapping[str, WalkResult]
    correction: MomentumCorrection
    seen: SeenWalk
    person: PersonForce | None


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
class TrialLayers(NullErrors, AtSetting):
    """One trial in layers, by SCORES (what was not learned from any plate has none), beside the
    null model of the other fitted trials' curves: with the measured times of stance, and the harder
    one also with those that the physics predicts."""

    label: str
    fitted: bool
    layers: Mapping[str, Mapping[str, float | None]]
    null_model_predicted_times_grf_rmse_bw: float | None
    correction: MomentumCorrection
    phases: tuple[PhaseErrors, ...]  # of the person's layer; none without it

    def error_in(self, layer: str) -> float | None:
        """The error that it is judged by in this layer."""
        return self.layers[layer][JUDGED]


@dataclass(frozen=True, kw_only=True)
class LayerTable:
    """A fit's predictions in layers, and what its plates taught."""

    trials: tuple[TrialLayers, ...]
    momentum: MomentumBias | None
    person_curve: PersonCurve | None

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

    @property
    def held_out(self) -> list[TrialLayers]:
        """The trials that were not fitted; all where there is none."""
        return [row for row in self.trials if not row.fitted] or [*self.trials]

    @property
    def phases(self) -> tuple[PhaseErrors, ...]:
        """Means over the trials that were not fitted; none without one: the curve holds the plates
        of the fitted ones."""
        return mean_phases(row.phases for row in self.trials if not row.fitted)

    def teach(self, contact: FittedContact) -> FittedContact:
        """The contact with what the plates taught."""
        return replace(contact, momentum=self.momentum, person_curve=self.person_curve)


def predict(
    trial: Trial,
    contact: FittedContact,
    *,
    walker: Walker,
    step_s: float,
    errors: Mapping[str, float] | None = None,
) -> LayeredWalk:
    """A trial that has the fitted contact (`trial_with`) in layers; of its plates nothing is used.

    `walker` is of its subject and model. `errors` are further variables of its walk, by name, of
    which the layers know nothing.

    Raises:
        SimulationError: the walk of the physics fails.
    """
    errors = errors or {}
    bias = contact.momentum
    walk, physics = _walked(walker, trial, errors, step_s)
    correction = (
        MomentumCorrection(believed=False, why_not="bias")
        if bias is None
        else corrected(walker, trial, bias, heading=walking_direction(physics), errors=errors)
    )
    momentum = physics
    if correction.believed:
        values = with_corrections(errors, trial, correction.values)
        _, momentum = _walked(walker, trial, values, step_s)
    own = seen(walk, physics, momentum, trial, correction)
    curve = contact.person_curve
    return LayeredWalk(
        results={PHYSICS: physics, MOMENTUM: momentum},
        correction=correction,
        seen=own,
        person=None if curve is None else laid(curve, own),
    )


def compared(walk: LayeredWalk, plate: PlateRecording | None) -> dict[str, Comparison]:
    """By layer that the walk has, beside the plate under its prosthetic foot, if there is one."""
    found = {layer: compare(result, plate) for layer, result in walk.results.items()}
    if walk.person is not None:
        found[PERSON] = _by_person(found[MOMENTUM], walk.person)
    return found


def _by_person(c: Comparison, person: PersonForce) -> Comparison:
    """A comparison of the same walk with the person's layer in place of the model."""
    stances = []
    for item in c.stances:
        at = percent_instants(item.measured)
        cop_m = np.column_stack([np.interp(at, person.time_s, own) for own in person.cop_m.T])
        cop_m[np.isnan(item.model_cop).any(axis=1)] = np.nan
        stances.append(replace(item, model=partner(item.measured, person.stances), model_cop=cop_m))
    return replace(
        c,
        model=resample(c.time_s, person.time_s, person.force_n),
        stances=tuple(stances),
        model_stances=person.stances,
    )


def learned(
    contact: FittedContact, trials: Sequence[Trial], *, walker: Walker, step_s: float
) -> FittedContact:
    """The contact with what the plates of the trials that it was fitted to, as recorded, teach the
    other two layers."""
    applied = {fingerprint(trial): trial_with(trial, contact) for trial in trials}
    contact = replace(contact, momentum=bias_of(walker, applied), person_curve=None)
    told = []
    for text, trial in applied.items():
        own = predict(trial, contact, walker=walker, step_s=step_s).seen
        on_plate = measured(own, trial.prosthetic_plate, text)
        if on_plate is not None:
            told.append((own, on_plate))
    if not told:
        return contact
    walks, on_plates = zip(*told, strict=True)
    return replace(contact, person_curve=spread(PersonCurve(walks=on_plates), walks))


def layers_in(contact: FittedContact) -> tuple[str, ...]:
    """The layers that a contact has."""
    return LAYERS if contact.person_curve is not None else LAYERS[:2]


def layers_of(
    trial: Trial, label: str, contact: FittedContact, *, walker: Walker, step_s: float
) -> TrialLayers:
    """A recorded trial in layers, beside its plate, if it has one, and the null model; raises what
    `predict` and `with_contact` do."""
    walk = predict(with_contact(trial, contact), contact, walker=walker, step_s=step_s)
    return judged(walk, trial, label, contact)


def judged(walk: LayeredWalk, trial: Trial, label: str, contact: FittedContact) -> TrialLayers:
    """A walk in layers beside the plate of its recorded trial, if it has one, and the null
    model."""
    own = recording_of(trial, contact)
    weight = trial.subject.mass_kg * GRAVITY
    comparisons = compared(walk, trial.plate)
    scores = {layer: dict.fromkeys(SCORES) for layer in LAYERS}
    for layer, comparison in comparisons.items():
        result = walk.results.get(layer, walk.results[MOMENTUM])
        found = walk_metrics(result, trial.plate, comparison=comparison)
        scores[layer] = {name: getattr(found, name) for name in SCORES}
    others = _others(contact, own)
    known = [KnownCurve(one.fulcrum_m, _resultant_bw(one)) for one in others]
    null = null_errors(comparisons[PHYSICS], weight, known, trial.fulcrum_m)
    late = null_errors(comparisons[PHYSICS], weight, known, trial.fulcrum_m, predicted=True)
    between = _null_curve(others, trial.fulcrum_m)
    return TrialLayers(
        label=label,
        fitted=own in {one.fingerprint for one in contact.trials},
        **vars(trial.setting),
        layers=scores,
        correction=walk.correction,
        **vars(null),
        null_model_predicted_times_grf_rmse_bw=late.null_bw,
        phases=()
        if walk.person is None or trial.plate is None
        else phase_errors(comparisons[PHYSICS], comparisons[PERSON], walk.person, between, weight),
    )


def layer_curves(walk: LayeredWalk, trial: Trial, contact: FittedContact) -> dict[str, np.ndarray]:
    """Forces (BW, fore-aft, lateral, vertical) of a walk in layers on even instants `time_s` (n,),
    to be drawn: `plate` (n, 3), NaN without one; by layer; `half_width` (n, 4) of the person's
    interval, by SPREADS; `null`, the null model over the measured times of stance, and
    `null_predicted`, over those that the physics predicts. What is not known is not among them."""
    found = compared(walk, trial.plate)
    physics = found[PHYSICS]
    weight = walk.seen.weight_n
    curves = {"time_s": physics.time_s, "plate": physics.measured / weight}
    curves |= {layer: one.model / weight for layer, one in found.items()}
    person = walk.person
    if person is not None and person.half_width_n is not None:
        curves["half_width"] = resample(physics.time_s, person.time_s, person.half_width_n) / weight
    null_bw = _null_curve(_others(contact, recording_of(trial, contact)), trial.fulcrum_m)
    if null_bw is not None:
        for name, predicted in (("null", False), ("null_predicted", True)):
            null = stretched(physics, null_bw, predicted=predicted)
            if np.nan_to_num(null).any():  # on a stance that was seen from strike to lift-off
                curves[name] = null
    return curves


def recording_of(trial: Trial, contact: FittedContact) -> str:
    """The fingerprint of the recording that a trial is: that of a fitted one whose steps its plate
    measured, though file, window, the way from markers to angles, or the body's mass within
    SAME_MASS may be others; else its own."""
    own = fingerprint(trial)
    curve = contact.person_curve
    if trial.plate is None or curve is None or own in {one.fingerprint for one in contact.trials}:
        return own
    force_bw = stance_curve(trial.plate, subject_mass_kg=trial.subject.mass_kg)
    if force_bw is None:
        return own
    for one in curve.walks:
        known_bw = _resultant_bw(one)
        ratio = float(force_bw @ known_bw / (known_bw @ known_bw))
        if abs(ratio - 1.0) < SAME_MASS and rmse(force_bw, ratio * known_bw) < SAME_BW:
            return one.fingerprint
    return own


def _resultant_bw(walk: PersonWalk) -> np.ndarray:
    """(101,) over stance, as its plate measured it."""
    forces_bw = np.array([getattr(walk, name) for name in FORCES])
    resultant_bw: np.ndarray = np.linalg.norm(forces_bw, axis=0)
    return resultant_bw


def _others(contact: FittedContact, own: str) -> list[PersonWalk]:
    """The fitted walks but the one of this fingerprint."""
    curve = contact.person_curve
    return [one for one in curve.walks if one.fingerprint != own] if curve else []


def _null_curve(others: Sequence[PersonWalk], fulcrum_m: float) -> np.ndarray | None:
    """(101, 3) BW of the null model; None without another walk."""
    if not others:
        return None
    return between_settings(
        np.array([one.fulcrum_m for one in others]),
        np.array([[getattr(one, name) for name in FORCES] for one in others]).swapaxes(1, 2),
        fulcrum_m,
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
    return LayerTable(trials=rows, momentum=contact.momentum, person_curve=contact.person_curve)


def layer_sentences(table: LayerTable) -> list[str]:
    """Which layer the held-out trials earn, and what keeps the others from it."""
    rows = table.held_out
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
    )


def _walked(
    walker: Walker, trial: Trial, values: Mapping[str, float], step_s: float
) -> tuple[Walk, WalkResult]:
    walk = walker.walk_trial(trial, values=values, step_s=step_s)
    return walk, walker.result(walk, trial, trial.offsets, energy=False)
