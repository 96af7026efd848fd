"""A walk at a setting that was not recorded: the person's own answer, walked by the fitted contact.

The motion is interpolated between the recorded settings (`walks.answer`), the force comes from the
contact that was fitted to the person, in layers (`walks.prediction`). Loads are by inverse
dynamics: of the recorded walks under what their plates measured, of the predicted one under the
force by the person's own curve. A predicted walk is a mean, whose peaks are lower than those of the
walks that it is of: it is held against the mean walks of the recorded settings, and the recorded
walks tell the spread. Energy in the foot is that of the walk with the person's momentum.
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
from vsf_drake.tuning.costs import TRACKING, WalkLoads, value_of, walk_terms
from vsf_drake.tuning.options import TuningOptions, design_variables
from vsf_drake.tuning.problem import SettingOutcome, TrialTuning
from vsf_drake.tuning.quantities import GIVEN_COSTS, GIVEN_OUTCOMES
from vsf_drake.tuning.sweep import outcomes
from vsf_drake.walks.answer import Answer, AnswerTable, answer_of, answer_sentences
from vsf_drake.walks.between_settings import settings_of
from vsf_drake.walks.comparison import FORCE_CUTOFF_HZ, PERCENT
from vsf_drake.walks.momentum import FIT_STEP_S, MomentumCorrection, with_corrections
from vsf_drake.walks.person_curve import PersonForce
from vsf_drake.walks.prediction import LAYERS, PERSON, LayeredWalk, learned
from vsf_drake.walks.prediction import predict as predict_layers

Z = 1.96  # standard errors of a 95 % interval
MM = " mm"
FORCES = ("first_peak", "second_peak", "braking", "propulsion")
TOLD = {name: quantity for name, quantity in GIVEN_OUTCOMES.items() if name != "force_change"} | {
    "joint_load": GIVEN_COSTS["joint_load"]
}
"""Loads and costs of a walk; the other costs are outcomes, too."""
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
    correction: MomentumCorrection | None  # None of a recorded walk
    converged: bool


@dataclass(frozen=True, kw_only=True)
class LoadRow:
    """A load or cost at the outer recorded settings, means, and as predicted."""

    name: str
    label: str
    unit: str
    soft: float
    predicted: float
    stiff: float
    between: float  # linear between the recorded settings, without a walk
    spread: float | None
    seen: bool | None
    """whether the outer settings differ by more than Z standard errors; None without a spread"""


@dataclass(frozen=True, kw_only=True)
class SettingTable:
    """A predicted setting in numbers: `predict.json`."""

    fulcrum_mm: float
    recorded_setting: bool  # whether walks were recorded there
    stance_s: float
    answer: AnswerTable
    predicted: SettingWalk
    settings: tuple[SettingWalk, ...]
    """the mean walk of each recorded setting, softest first, made as the predicted one"""
    recorded: tuple[SettingWalk, ...]  # each walk, under what its plate measured
    spread: Mapping[str, float]
    """of each, standard deviation between walks of one setting; empty where none was walked
    twice"""
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
        places = np.array([walk.fulcrum_mm for walk in self.settings])
        walks = np.array([walk.fulcrum_mm for walk in self.recorded])
        nearest = np.abs(walks[:, None] - places).argmin(axis=1)
        soft, stiff = (np.sum(nearest == end) for end in (0, len(places) - 1))
        told = []
        for name, quantity in TOLD.items():
            values = np.array([_number(walk, name) for walk in self.settings])
            spread = self.spread.get(name)
            chance = None if spread is None else Z * spread * np.sqrt(1.0 / soft + 1.0 / stiff)
            told.append(
                LoadRow(
                    name=name,
                    label=quantity.label,
                    unit=quantity.unit,
                    soft=float(values[0]),
                    predicted=_number(self.predicted, name),
                    stiff=float(values[-1]),
                    between=float(np.interp(self.fulcrum_mm, places, values)),
                    spread=spread,
                    seen=None if chance is None else bool(abs(values[-1] - values[0]) > chance),
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
    vertical, of the plates by recorded setting (S, 101, 3), of each layer, and the half width of
    the last layer's 80 % interval (101, 4), the resultant's too"""

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
    jobs = [*applied, *map(answer.trial_at, answer.settings_m.tolist()), trial]
    walks = []
    for i, one in enumerate(jobs):
        show(f"walking {one.name}", i / len(jobs))
        walk = (
            predict_layers(one, contact, walker=walker, step_s=step_s) if one.plates == {} else None
        )
        walks.append(_walked(walker, one, walk, step_s))
    assert walk is not None
    recorded = walks[: len(applied)]
    *settings, predicted = walks[len(applied) :]
    positions = answer.fulcrum_m
    names = [*predicted.outcomes, *predicted.costs]
    spread = answer.spread_of(
        np.array([[_number(own, name) for name in names] for own in recorded])
    )
    arrays = _arrays(answer, fulcrum_m, walk)
    table = SettingTable(
        fulcrum_mm=1e3 * fulcrum_m,
        recorded_setting=len(settings_of(np.append(positions, fulcrum_m))) == len(answer.settings),
        stance_s=answer.stance_s(fulcrum_m),
        answer=answer.table(),
        predicted=predicted,
        settings=tuple(settings),
        recorded=tuple(recorded),
        spread={} if spread is None else dict(zip(names, spread.tolist(), strict=True)),
        force=_peaks(answer, arrays),
        synthetic=trial.synthetic,
        sentences=(),
        notes=trial.notes,
        provenance=provenance({**trial.inputs, **(inputs or {})}),
    )
    sentences = (*say("predicted", t=table, rows=table.rows()), *answer_sentences(table.answer))
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


def _walked(walker: Walker, trial: Trial, layers: LayeredWalk | None, step_s: float) -> SettingWalk:
    """A trial that has the fitted contact at its own setting, under what its plate measured; or, in
    layers, as momentum corrects it and under the force by the person's own curve."""
    base: dict[str, float] = {}
    correction = None if layers is None else layers.correction
    if correction is not None and correction.believed:
        c = (
            correction.height_m,
            correction.hip_flexion_rad,
            correction.knee_angle_rad,
            correction.alignment_rad,
        )
        base = with_corrections(base, trial, np.array(c))
    options = TuningOptions(step_s=step_s, support_width_m=0.0)
    (fulcrum,) = design_variables(options, [trial.model.foot])
    part = TrialTuning(walker, trial, trial.name, (fulcrum,), options)
    (found,) = part.at_each(part.own[None], step_s=step_s, base=base, sites=True)
    if isinstance(found, SimulationError):
        raise found
    if layers is None:
        found = _carrying(part, found, _plate_wrench(trial.prosthetic_plate, found))
    elif layers.person is not None:
        found = _carrying(part, found, _person_wrench(layers.person, found))
    told = outcomes(part, found)
    return SettingWalk(
        label=trial.name,
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


def _carrying(part: TrialTuning, found: SettingOutcome, ground: np.ndarray) -> SettingOutcome:
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


def _plate_wrench(plate: PlateRecording, found: SettingOutcome) -> np.ndarray:
    """(n, 6) on the walk's instants."""
    moment = np.cross(np.nan_to_num(plate.cop_W), plate.force_W)
    moment[:, 2] += np.nan_to_num(plate.free_moment_nm)
    wrench = np.column_stack([moment, plate.force_W])
    smooth = low_pass(wrench, rate_hz=1.0 / spacing(plate.time_s), cutoff_hz=FORCE_CUTOFF_HZ)
    return columns_at(found.frame.time_s, plate.time_s, smooth)


def _person_wrench(person: PersonForce, found: SettingOutcome) -> np.ndarray:
    """(n, 6) on the walk's instants, of a walk along W's x; the free moment is the model's."""
    at = found.frame.time_s
    loaded = np.isfinite(person.cop_m).all(axis=1)
    force = columns_at(at, person.time_s, person.force_n)
    cop = columns_at(at, person.time_s[loaded], person.cop_m[loaded])
    own = found.walk.prosthetic
    moment = np.cross(np.column_stack([cop, np.zeros(len(cop))]), force)
    moment[:, 2] += np.nan_to_num(own.free_moment_nm)
    return np.column_stack([moment, force])


def _number(walk: SettingWalk, name: str) -> float:
    return {**walk.outcomes, **walk.costs}[name]
