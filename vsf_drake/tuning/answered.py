"""A walk at a setting that was not recorded: the person's own answer, walked by the fitted contact.

The motion is interpolated between the recorded settings (`walks.answer`), the force comes from the
contact that was fitted to the person, in layers (`walks.prediction`). Loads are those of the layer
of the momentum, of the recorded walks as of the predicted one, so that a difference between them is
one of setting and motion, not of method.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.base.errors import SimulationError
from vsf_drake.base.progress import Progress
from vsf_drake.base.sentences import say
from vsf_drake.model.contact_file import FittedContact
from vsf_drake.model.model_file import check_fulcrum
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walker
from vsf_drake.tuning.costs import TRACKING, value_of
from vsf_drake.tuning.options import TuningOptions, design_variables
from vsf_drake.tuning.problem import TrialTuning
from vsf_drake.tuning.sweep import outcomes
from vsf_drake.walks.answer import Answer, AnswerTable, answer_of, answer_sentences
from vsf_drake.walks.comparison import walking_direction
from vsf_drake.walks.between_settings import between_settings, settings_of
from vsf_drake.walks.momentum import FIT_STEP_S, MomentumCorrection, corrected, with_corrections
from vsf_drake.walks.prediction import LayeredWalk, layers_in
from vsf_drake.walks.prediction import predict as predict_layers

NOT_OF_A_WALK = ("consistency", TRACKING)
"""Costs that compare a walk with another one, or with its plate."""


@dataclass(frozen=True, kw_only=True)
class SettingWalk:
    """What one walk, recorded or predicted, loads the person with.

    `outcomes` are GIVEN_OUTCOMES (`tuning.quantities`) without the change of the force, `costs`
    GIVEN_COSTS of a walk by itself; `height_m` to `alignment_rad` in `correction`.
    """

    label: str
    fulcrum_mm: float
    outcomes: Mapping[str, float]
    costs: Mapping[str, float]
    correction: MomentumCorrection
    converged: bool


@dataclass(frozen=True, kw_only=True)
class SettingTable:
    """A predicted setting in numbers: `predict.json`."""

    fulcrum_mm: float
    recorded_setting: bool  # whether walks were recorded there
    stance_s: float
    answer: AnswerTable
    predicted: SettingWalk
    recorded: tuple[SettingWalk, ...]
    between: Mapping[str, float]
    """of each outcome and cost what lies between those of the recorded settings, without a walk"""
    spread: Mapping[str, float]
    """of each, standard deviation between walks of one setting; empty where none was walked
    twice"""
    layers: tuple[str, ...]
    synthetic: bool
    sentences: tuple[str, ...]
    notes: tuple[str, ...]
    provenance: Mapping[str, Any]

    def seen(self, name: str) -> bool | None:
        """Whether an outcome or cost differs between the outer settings by more than twice what
        the spread makes by chance; None where no spread is known."""
        if name not in self.spread:
            return None
        groups = settings_of(np.array([1e-3 * walk.fulcrum_mm for walk in self.recorded]))
        soft, stiff = (
            [_number(self.recorded[i], name) for i in groups[end].tolist()] for end in (0, -1)
        )
        chance = self.spread[name] * np.sqrt(1.0 / len(soft) + 1.0 / len(stiff))
        return bool(abs(np.mean(stiff) - np.mean(soft)) > 2.0 * chance)


@dataclass(frozen=True, kw_only=True, eq=False)
class SettingPrediction:
    """A person at a setting that was not recorded: motion (`trial`, strike at 0 s), force in layers
    (`walk`), loads (`table`)."""

    table: SettingTable
    answer: Answer
    trial: Trial
    walk: LayeredWalk

    @property
    def sentences(self) -> tuple[str, ...]:
        """The prediction in words, and what is doubtful in it."""
        return self.table.sentences


def predict(
    trials: Sequence[Trial],
    contact: FittedContact,
    *,
    fulcrum_m: float,
    step_s: float = DEFAULT_STEP_S,
    progress: Progress | None = None,
) -> SettingPrediction:
    """Motion, force and loads of a person at a setting between two recorded ones.

    Args:
        trials: walks of the person at two settings or more, as recorded; better two of each, which
            tell the spread.
        contact: fitted to this person. fulcrum_m: from the keel's posterior end, m.

    InputError: what `answer_of` refuses; a contact that was fitted to somebody else; a setting
    outside of the recorded ones. SimulationError: a walk fails.
    """
    show = progress or (lambda text, share: None)
    answer = answer_of([trial_with(trial, contact) for trial in trials])
    check_fulcrum(fulcrum_m, answer.like.model.foot, where="fulcrum_m")
    trial = answer.trial_at(fulcrum_m)
    walker = Walker(trial.subject, trial.model)
    walk = predict_layers(trial, contact, walker=walker, step_s=step_s)
    told = [
        (trial_with(one, contact), own.label) for one, own in zip(trials, answer.walks, strict=True)
    ]
    walks = []
    for i, (one, label) in enumerate([*told, (trial, trial.name)]):
        show(f"walking {label}", i / (len(told) + 1))
        walks.append(_walked(walker, one, label, contact, step_s))
    *recorded, predicted = walks
    positions = np.array([own.fulcrum_m for own in answer.walks])
    names = [*predicted.outcomes, *predicted.costs]
    values = np.array([[_number(one, name) for name in names] for one in recorded])
    free = len(recorded) - len(answer.settings)
    within = [values[own] - values[own].mean(axis=0) for own in answer.settings]
    spread = np.sqrt(np.sum(np.concatenate(within) ** 2, axis=0) / free) if free else []
    table = SettingTable(
        fulcrum_mm=1e3 * fulcrum_m,
        recorded_setting=bool(
            len(settings_of(np.append(positions, fulcrum_m))) == len(answer.settings)
        ),
        stance_s=answer.stance_s(fulcrum_m),
        answer=answer.table(),
        predicted=predicted,
        recorded=tuple(recorded),
        between=dict(
            zip(names, between_settings(positions, values, fulcrum_m).tolist(), strict=True)
        ),
        spread=dict(zip(names, spread, strict=False)),
        layers=layers_in(contact),
        synthetic=trial.synthetic,
        sentences=(),
        notes=trial.notes,
        provenance=provenance(trial.inputs),
    )
    sentences = (*say("predicted", t=table), *answer_sentences(table.answer))
    return SettingPrediction(
        table=dataclasses.replace(table, sentences=sentences),
        answer=answer,
        trial=trial,
        walk=walk,
    )


def _walked(
    walker: Walker, trial: Trial, label: str, contact: FittedContact, step_s: float
) -> SettingWalk:
    """A trial that has the fitted contact at its own setting, as momentum corrects it."""
    correction = MomentumCorrection(believed=False, why_not="bias")
    if contact.momentum is not None:
        heading = walking_direction(walker.walk_trial(trial, step_s=FIT_STEP_S))
        correction = corrected(walker, trial, contact.momentum, heading=heading, errors={})
    base: dict[str, float] = {}
    if correction.believed:
        base = with_corrections(
            base,
            trial,
            np.array(
                [
                    correction.height_m,
                    correction.hip_flexion_rad,
                    correction.knee_angle_rad,
                    correction.alignment_rad,
                ]
            ),
        )
    options = TuningOptions(step_s=step_s, support_width_m=0.0)
    (fulcrum,) = design_variables(options, [trial.model.foot])
    part = TrialTuning(walker, trial, label, (fulcrum,), options)
    (found,) = part.at_each(part.own[None], step_s=step_s, base=base, sites=True)
    if isinstance(found, SimulationError):
        raise found
    told = outcomes(part, found)
    return SettingWalk(
        label=label,
        fulcrum_mm=1e3 * trial.fulcrum_m,
        outcomes={name: value for name, value in told.items() if name != "force_change"},
        costs={
            name: value_of(terms)
            for name, terms in found.terms.items()
            if name not in NOT_OF_A_WALK
        },
        correction=correction,
        converged=bool(found.walk.record.converged.all()),
    )


def _number(walk: SettingWalk, name: str) -> float:
    return {**walk.outcomes, **walk.costs}[name]
