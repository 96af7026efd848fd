"""A walk at a setting that was not recorded: the person's own answer, walked by the fitted contact.

The motion is interpolated between the recorded settings (`walks.answer`), the force comes from the
contact that was fitted to the person, in layers (`walks.prediction`). Loads are those of every
recorded walk as the answer moves it to the setting, by inverse dynamics under its plate, moved
likewise: a mean walk would have lower peaks than the walks that it is the mean of. Energy in the
foot is that of the fitted foot under the moved motion.
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
from vsf_drake.model.parameters import PELVIS_TRANSLATIONS
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import columns_at, low_pass, spacing
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.reactions import SOCKET, follow
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walker
from vsf_drake.tuning.costs import WalkLoads, value_of, walk_terms
from vsf_drake.tuning.options import TuningOptions, design_variables
from vsf_drake.tuning.problem import SettingOutcome, TrialTuning
from vsf_drake.tuning.quantities import GIVEN_COSTS, GIVEN_OUTCOMES
from vsf_drake.tuning.sweep import outcomes
from vsf_drake.walks.answer import Answer, AnswerTable, answer_of, answer_sentences
from vsf_drake.walks.between_settings import (
    SETTING_M,
    between_settings,
    half_width,
    settings_of,
    spread_of,
)
from vsf_drake.walks.comparison import FORCE_CUTOFF_HZ, PERCENT
from vsf_drake.walks.momentum import FIT_STEP_S, MomentumCorrection
from vsf_drake.walks.prediction import LAYERS, PERSON, LayeredWalk, learned
from vsf_drake.walks.prediction import predict as predict_layers

MM = " mm"
FORCES = ("first_peak", "second_peak", "braking", "propulsion")
TOLD = {name: quantity for name, quantity in GIVEN_OUTCOMES.items() if name != "force_change"} | {
    "joint_load": GIVEN_COSTS["joint_load"]
}
"""Loads and costs of a walk; the other costs are outcomes, too."""


@dataclass(frozen=True, kw_only=True)
class SettingWalk:
    """What one walk, as recorded or as moved to a setting, loads the person with, by name in
    TOLD."""

    label: str
    fulcrum_mm: float
    loads: Mapping[str, float]
    converged: bool


@dataclass(frozen=True, kw_only=True)
class LoadRow:
    """A load or cost at the outer recorded settings and as predicted, means over walks."""

    name: str
    label: str
    unit: str
    soft: float
    predicted: float
    stiff: float
    between: float  # linear between the recorded settings, without a walk
    spread: float | None
    seen: bool | None
    """whether the outer settings differ by more than the 95 % interval of that difference; None
    without a spread"""


@dataclass(frozen=True, kw_only=True)
class SettingTable:
    """A predicted setting in numbers: `predict.json`."""

    fulcrum_mm: float
    recorded_setting: bool  # whether walks were recorded there, within SETTING_M
    stance_s: float
    answer: AnswerTable
    recorded: tuple[SettingWalk, ...]
    moved: tuple[SettingWalk, ...]  # the same walks at this setting
    correction: MomentumCorrection  # of the mean walk
    converged: bool  # the mean walk
    force: Mapping[str, Mapping[str, float]]
    """FORCES of the predicted walk by layer, the one to believe last, body weights; and of the
    recorded settings, softest first, by their position ("66 mm")."""
    synthetic: bool
    sentences: tuple[str, ...]
    notes: tuple[str, ...]
    provenance: Mapping[str, Any]

    @property
    def layer(self) -> str:
        """The layer to believe."""
        return [name for name in self.force if not name.endswith(MM)][-1]

    def rows(self) -> list[LoadRow]:
        """Loads and costs beside the recorded settings'."""
        positions = np.array([1e-3 * walk.fulcrum_mm for walk in self.recorded])
        groups = settings_of(positions)
        shares = np.zeros(len(positions))
        shares[groups[0]] = -1.0 / len(groups[0])
        shares[groups[-1]] = 1.0 / len(groups[-1])
        told = []
        for name, quantity in TOLD.items():
            values = np.array([walk.loads[name] for walk in self.recorded])
            means = [float(values[own].mean()) for own in groups]
            within = spread_of(positions, values)
            spread = seen = None
            if within is not None:
                spread = float(within)
                seen = abs(means[-1] - means[0]) > half_width(positions, spread, shares)
            told.append(
                LoadRow(
                    name=name,
                    label=quantity.label,
                    unit=quantity.unit,
                    soft=means[0],
                    predicted=float(np.mean([walk.loads[name] for walk in self.moved])),
                    stiff=means[-1],
                    between=float(np.interp(self.fulcrum_mm, self.answer.settings_mm, means)),
                    spread=spread,
                    seen=seen,
                )
            )
        return told


@dataclass(frozen=True, kw_only=True, eq=False)
class SettingPrediction:
    """A person at a setting that was not recorded: motion (`trial`, strike at 0 s), force in layers
    (`walk`), loads (`table`)."""

    table: SettingTable
    answer: Answer
    trial: Trial
    walk: LayeredWalk
    arrays: Mapping[str, np.ndarray]
    """`predict.npz`: over shares of stance (n,) coordinates (m) by recorded setting (S, n, m), as
    predicted (n, m) and their spread (n, m), in degrees and m, the pelvis's place that of the
    pylon's end; over 0 to 100 % of stance the force (101, 3) in body weights, fore-aft, lateral,
    vertical, of the plates by recorded setting (S, 101, 3), of each layer, of the null
    (`null_predicted`: the plates between the settings, no walk), and the half width of the last
    layer's 80 % interval (101, 4), the resultant's too"""

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
    inputs: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> SettingPrediction:
    """Motion, force and loads of a person at a setting between two recorded ones.

    Args:
        trials: walks of the person at two settings or more, as recorded; better two of each, which
            tell the spread.
        contact: fitted to this person. fulcrum_m: from the keel's posterior end, m.
        inputs: SHA-256 by name of further files that the prediction comes from.

    InputError: what `answer_of` refuses; a contact that was fitted to somebody else; a setting
    outside of the recorded ones. SimulationError: a walk fails.
    """
    show = progress or (lambda text, share: None)
    applied = [trial_with(trial, contact) for trial in trials]
    answer = answer_of(applied)
    check_fulcrum(fulcrum_m, answer.like.model.foot, where="fulcrum_m")
    trial = answer.trial_at(fulcrum_m)
    walker = Walker(trial.subject, trial.model)
    show("learning from the plates", 0.0)
    contact = learned(contact, trials, walker=walker, step_s=FIT_STEP_S)
    walk = predict_layers(trial, contact, walker=walker, step_s=step_s)
    walks: list[SettingWalk] = []
    for place in (None, fulcrum_m):
        for i, one in enumerate(answer.walks):
            show(f"walking {one.label}", (i + len(walks)) / (2 * len(answer.walks)))
            at = one.fulcrum_m if place is None else place
            walks.append(_walked(walker, answer.moved(i, at), step_s))
    arrays = _arrays(answer, fulcrum_m, walk)
    table = SettingTable(
        fulcrum_mm=1e3 * fulcrum_m,
        recorded_setting=bool(np.abs(answer.fulcrum_m - fulcrum_m).min() <= SETTING_M),
        stance_s=answer.stance_s(fulcrum_m),
        answer=answer.table(),
        recorded=tuple(walks[: len(answer.walks)]),
        moved=tuple(walks[len(answer.walks) :]),
        correction=walk.correction,
        converged=all(result.converged for result in walk.results.values()),
        force=_peaks(answer, arrays),
        synthetic=trial.synthetic,
        sentences=(),
        notes=trial.notes,
        provenance=provenance({**trial.inputs, **(inputs or {})}),
    )
    sentences = (
        *say("predicted", t=table, rows=table.rows(), near_mm=1e3 * SETTING_M),
        *answer_sentences(table.answer),
    )
    return SettingPrediction(
        table=dataclasses.replace(table, sentences=sentences),
        answer=answer,
        trial=trial,
        walk=walk,
        arrays=arrays,
    )


def _arrays(answer: Answer, fulcrum_m: float, walk: LayeredWalk) -> dict[str, np.ndarray]:
    """See `SettingPrediction.arrays`."""
    weight = walk.seen.weight_n
    unit = np.array(
        [1.0 if name in PELVIS_TRANSLATIONS else np.degrees(1.0) for name in answer.names]
    )
    spread = answer.spread_of(answer.values)
    forces = np.array(
        [_resampled(100.0 * answer.share, one.force_n, 0.0, 100.0) for one in answer.walks]
    )
    found = {
        "share": answer.share,
        "recorded": unit * np.array([answer.values[own].mean(axis=0) for own in answer.settings]),
        "predicted": unit * answer.at(fulcrum_m),
        "plates": np.array([forces[own].mean(axis=0) for own in answer.settings]) / weight,
    }
    if spread is not None:
        found["spread"] = unit * spread
    found["null_predicted"] = between_settings(answer.fulcrum_m, forces, fulcrum_m) / weight
    for name, result in walk.results.items():
        rate_hz = 1.0 / result.step_s
        force = low_pass(result.grf_W, rate_hz=rate_hz, cutoff_hz=FORCE_CUTOFF_HZ) / weight
        stance = _whole(find_stances(result.time_s, result.grf_W[:, 2]))
        if stance is not None:
            found[name] = _resampled(result.time_s, force, *stance.span)
    person = walk.person
    stance = _whole(person.stances) if person else None
    if person and stance:
        found[PERSON] = _resampled(person.time_s, person.force_n / weight, *stance.span)
        if person.half_width_n is not None:
            wide = person.half_width_n / weight
            found["half_width"] = _resampled(person.time_s, wide, *stance.span)
    return found


def _whole(stances: Sequence[Stance]) -> Stance | None:
    """The stance that begins at 0 s, or about then."""
    return min(stances, key=lambda stance: abs(stance.start_s), default=None)


def _resampled(at: np.ndarray, values: np.ndarray, start: float, end: float) -> np.ndarray:
    """(101, k) from start to end."""
    return columns_at(start + PERCENT / 100.0 * (end - start), at, values)


def _peaks(answer: Answer, arrays: Mapping[str, np.ndarray]) -> dict[str, dict[str, float]]:
    """FORCES of the recorded settings and of the layers."""
    settings = {
        f"{1e3 * at:g}{MM}": force
        for at, force in zip(answer.settings_m, arrays["plates"], strict=True)
    }
    layers = {name: arrays[name] for name in LAYERS if name in arrays}
    half = PERCENT <= 50.0
    return {
        name: {
            "first_peak": float(force[half, 2].max()),
            "second_peak": float(force[~half, 2].max()),
            "braking": float(force[:, 0].min()),
            "propulsion": float(force[:, 0].max()),
        }
        for name, force in (settings | layers).items()
    }


def carried(
    walker: Walker, trial: Trial, options: TuningOptions
) -> tuple[TrialTuning, SettingOutcome]:
    """A trial that has the fitted contact, at its own setting and under what its plate
    measured; SimulationError where it cannot be walked."""
    (fulcrum, *_) = design_variables(options, [trial.model.foot])
    part = TrialTuning(walker, trial, trial.name, (fulcrum,), options)
    (found,) = part.at_each(part.own[None], step_s=options.step_s, sites=True)
    if isinstance(found, SimulationError):
        raise found
    return part, carrying(part, found, plate_wrench(trial.prosthetic_plate, found.frame.time_s))


def _walked(walker: Walker, trial: Trial, step_s: float) -> SettingWalk:
    part, found = carried(walker, trial, TuningOptions(step_s=step_s, support_width_m=0.0))
    told = outcomes(part, found) | {"joint_load": value_of(found.terms["joint_load"])}
    return SettingWalk(
        label=trial.name,
        fulcrum_mm=1e3 * trial.fulcrum_m,
        loads={name: told[name] for name in TOLD},
        converged=bool(found.walk.record.converged.all()),
    )


def carrying(part: TrialTuning, found: SettingOutcome, ground: np.ndarray) -> SettingOutcome:
    """The same motion under another load of the ground, (n, 6) moment (N m) about W's origin and
    force (N). Joints and socket carry the difference as if nothing below them had mass:

        tau_k = tau_k of the model - S_k . (ground - ground of the model),

    S_k the motion of a unit rate of coordinate k."""
    walk = found.walk
    tree = walk.mechanism.tree
    joints = [tree.index(name) for name in part.joints]
    socket = walk.mechanism.spring_index[SOCKET].tolist()
    motion = follow(
        tree,
        walk.record.q,
        walk.record.v,
        bodies=[0],
        coordinates=[*joints, *socket],
        inside=np.zeros(len(tree.body_names), dtype=bool),
    )
    loads = found.loads
    more = np.einsum("nki,ni->nk", motion.joints, ground - loads.ground[..., 0])[..., None]
    loads = WalkLoads(
        ground[..., None],
        loads.joints - more[:, : len(joints)],
        loads.socket - more[:, len(joints) :],
    )
    terms = walk_terms(found.frame, loads, part.options)
    return SettingOutcome(terms, walk, loads, found.frame)


def plate_wrench(plate: PlateRecording, time_s: np.ndarray) -> np.ndarray:
    """(n, 6) at the instants (n,): moment (N m) about W's origin and force (N)."""
    moment = np.cross(np.nan_to_num(plate.cop_W), plate.force_W)
    moment[:, 2] += np.nan_to_num(plate.free_moment_nm)
    wrench = np.column_stack([moment, plate.force_W])
    smooth = low_pass(wrench, rate_hz=1.0 / spacing(plate.time_s), cutoff_hz=FORCE_CUTOFF_HZ)
    return columns_at(time_s, plate.time_s, smooth)
