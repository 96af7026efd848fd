"""What is told of a session: its walks beside the null model, what the setting does, what to record
next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import stdtrit

from vsf_drake.base.errors import InputError
from vsf_drake.base.sentences import say
from vsf_drake.fit.table import FitTable
from vsf_drake.model.contact_file import FittedContact
from vsf_drake.model.setting import AtSetting, moves
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial
from vsf_drake.sessions.plan import PlanRow
from vsf_drake.walks.answer import AnswerTable, answer_of, answer_sentences
from vsf_drake.walks.between_settings import settings_of
from vsf_drake.walks.prediction import LAYERS, PHYSICS, TrialLayers
from vsf_drake.walks.quantities import known, mean

FITTED, HELD_OUT, LEFT_OUT = "fitted", "held out", "left out"
LIKED_WALKS = 3
"""Walks of a setting with which its spread is told with some certainty (a choice: two degrees of
freedom)."""


@dataclass(frozen=True, kw_only=True)
class SessionWalk(AtSetting):
    """One walk.

    Attributes:
        role: FITTED, HELD_OUT, or LEFT_OUT, which `why` explains.
        mark, expected_error_bw, verdict: of the recording, as `check` has them.
        physics_bw, error_bw: of the force predicted by the fitted foot alone and by the layer to
            believe (body weights, root mean square over stance); of a held-out walk.
        null_bw: of the harder null model: with the measured times of stance or with those that the
            physics predicts, whichever is nearer.
    """

    file: str
    label: str
    role: str
    mark: str | None = None
    expected_error_bw: float | None = None
    verdict: str = ""
    physics_bw: float | None = None
    error_bw: float | None = None
    null_bw: float | None = None
    why: str = ""


@dataclass(frozen=True, kw_only=True)
class FitOutcome:
    """What a session keeps of its fit."""

    success: bool
    message: str
    headline: tuple[str, ...]
    layer: str  # to believe
    layers: Mapping[str, Mapping[str, float | None]]
    """by walk: the error (BW) in each layer, and that of the harder null ("null")"""
    answer: AnswerTable | None
    effect: tuple[str, ...]  # what the setting does, in sentences


@dataclass(frozen=True, kw_only=True)
class StepTime:
    """One step of the work."""

    name: str
    seconds: float  # wall time
    kept: bool  # whether it was done before


@dataclass(frozen=True, kw_only=True)
class SessionTable:
    """A session in numbers: `session.json`."""

    folder: str
    person: str
    side: str
    synthetic: bool
    success: bool
    verdict: str
    sentences: tuple[str, ...]  # the fit's, each with "! " in front that is a warning
    next: tuple[str, ...]  # what to record next
    walks: tuple[SessionWalk, ...]
    layer: str
    effect: tuple[str, ...]
    answer: AnswerTable | None
    files: tuple[PlanRow, ...]
    chosen: tuple[str, ...]  # which walks were fitted, and why
    notes: tuple[str, ...]
    steps: tuple[StepTime, ...]
    pages: Mapping[str, str]  # by title, relative to the session's folder
    provenance: Mapping[str, Any]


def outer_walks(trials: Sequence[Trial]) -> list[int]:
    """Numbers of the walks to fit: of the softest and of the stiffest setting that with the least
    expected error of its recording, of one setting one walk; all others can judge."""
    settings = settings_of(np.array([trial.fulcrum_m for trial in trials]))

    def expected(i: int) -> tuple[float, int]:
        mark = trials[i].judged
        return (0.0 if mark is None else mark.expected_error_bw, i)

    return [min(map(int, own), key=expected) for own in settings[:: len(settings) - 1 or 1]]


def outcome_of(
    table: FitTable, contact: FittedContact | None, trials: Sequence[Trial]
) -> FitOutcome:
    """What a fit of these trials, fitted and held out, came to."""
    answer = None
    effect: tuple[str, ...] = ()
    if contact is not None and moves(trials[0].model.foot):
        try:
            answer = answer_of([trial_with(trial, contact) for trial in trials]).table()
            effect = tuple(answer_sentences(answer))
        except InputError as error:
            effect = tuple(say("session", "no_effect", why=error))
    rows = () if table.layers is None else table.layers.trials
    layer = PHYSICS
    for name in LAYERS:
        if any(row.error_in(name) is not None for row in rows):
            layer = name
    return FitOutcome(
        success=table.success,
        message=table.message,
        headline=table.headline or table.verdict,
        layer=layer,
        layers={row.label: _errors(row) for row in rows},
        answer=answer,
        effect=effect,
    )


def _errors(row: TrialLayers) -> dict[str, float | None]:
    nulls = known([row.null_bw, row.null_model_predicted_times_grf_rmse_bw])
    return {layer: row.error_in(layer) for layer in LAYERS} | {"null": min(nulls, default=None)}


def judged_walks(walks: Sequence[SessionWalk], outcome: FitOutcome) -> list[SessionWalk]:
    """The walks with their errors, those that are predictions."""
    told = []
    for walk in walks:
        errors = outcome.layers.get(walk.label, {}) if walk.role == HELD_OUT else {}
        told.append(
            replace(
                walk,
                physics_bw=errors.get(PHYSICS),
                error_bw=errors.get(outcome.layer),
                null_bw=errors.get("null"),
            )
        )
    return told


def verdict_of(walks: Sequence[SessionWalk], outcome: FitOutcome, synthetic: bool) -> str:
    """The session in one sentence or two, the harder null beside the error."""
    held = [walk for walk in walks if walk.error_bw is not None]
    gains = np.array(
        [
            walk.null_bw - walk.error_bw
            for walk in held
            if walk.error_bw is not None and walk.null_bw is not None
        ]
    )
    free = len(gains) - 1
    half_bw = None
    if free > 0:
        half_bw = float(stdtrit(free, 0.975) * gains.std(ddof=1) / np.sqrt(len(gains)))
    return " ".join(
        say(
            "session",
            "verdict",
            success=outcome.success,
            message=outcome.message.rstrip("."),
            layer=outcome.layer,
            held=len(held),
            error_bw=mean(walk.error_bw for walk in held),
            null_bw=mean(walk.null_bw for walk in held),
            gains=gains.tolist(),
            gain_bw=float(gains.mean()) if gains.size else None,
            half_bw=half_bw,
            synthetic=synthetic,
        )
    )


def what_next(walks: Sequence[SessionWalk], *, bench: bool) -> list[str]:
    """What to record next, most useful first, in sentences."""
    usable = [walk for walk in walks if walk.role != LEFT_OUT]
    positions = np.array([walk.fulcrum_mm for walk in usable if walk.fulcrum_mm is not None])
    settings = {
        round(float(positions[own].mean()), 1): len(own)
        for own in settings_of(1e-3 * positions)
        if len(own)
    }
    return say(
        "session",
        "next",
        settings=settings,
        on_passive=len(usable) - len(positions),
        few={mm: count for mm, count in settings.items() if count < LIKED_WALKS},
        bench=bench,
        held=any(walk.role == HELD_OUT for walk in walks),
        doubtful=[walk for walk in usable if walk.mark == "doubtful"],
        unusable=[walk for walk in walks if walk.role == LEFT_OUT],
        wanted=LIKED_WALKS,
    )
