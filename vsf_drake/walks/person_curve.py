"""The person's own curve: what the plates of fitted walks measured, laid over another walk, with
what physics says is different about that one.

    F = base + NEED need + MODEL (M - M of the fitted walks),

over the stance that the model predicts, less how early and late it was in the fitted walks.

- base: the mean measured curve of each setting, linear over the fulcrum between settings.
- need: vertical m (a_com - g) in single support less that of the fitted walks (Legendre
  coefficients 0 to 2), from the motion alone; it fades over FADE of stance on either side.
- M: the fitted foot with the person's momentum, less the same foot on the fitted walks: a control
  variate, whose constant errors are the same on both sides and cancel.
- Strike and lift-off are the physics', and the more of the momentum's the more that had to correct:
  by c^2 / (c^2 + DOUBTED^2), c the root mean square of the corrections over their priors.
- Stances are aligned where the intact foot leaves the ground: by ALIGNED of the difference.

Where the momentum was not believed, need and M are left out. The centre of pressure is laid about
where the model's is on average.

NEED, MODEL, COP, ALIGNED and DOUBTED are choices made on two synthetic persons, on whom they are
flat: with NEED 0 to 0.5 and MODEL 0.3 to 0.6 the errors are within 0.4 % of body weight (`weights`
in studies/results/session_fit.json); a third was predicted with them. Learned by least squares from
six walks of a session, each left out in turn, and drawn halfway back to these, they were nearer on
the two by 0.06 and 0.02 % of body weight and farther on the third by 0.2: they stay as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legval

from vsf_drake.model.contact_file import PersonCurve, PersonWalk
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import Stance, find_stances, known_stances, overlap_s
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import Walk
from vsf_drake.walks.between_settings import between_settings, half_width, settings_of
from vsf_drake.walks.comparison import (
    FORCE_CUTOFF_HZ,
    PERCENT,
    filtered_while_loaded,
    partner,
    percent_instants,
    resample,
    uniform_grid,
    walk_axes,
    walking_direction,
)
from vsf_drake.walks.momentum import (
    PRIOR,
    TRIMMED_S,
    MomentumCorrection,
    coefficients,
    needed_force,
    swings,
)

FORCES = ("fore_aft_bw", "lateral_bw", "vertical_bw")
COPS = ("fore_aft_cop_m", "lateral_cop_m")
NEED = 0.25
MODEL = np.array([0.2, 0.1, 0.5])
"""Of what the model says is different, by FORCES."""
COP = 0.4
ALIGNED = 0.5
DOUBTED = 2.0
FADE = 10.0  # percent of stance
NEIGHBOURS = 10  # percent of stance on either side over which what was left out is averaged
SPREADS = ("fore_aft", "lateral", "vertical", "resultant")
COVERED = 0.8
"""Share of the instants that the interval is to hold."""


class Swing(NamedTuple):
    """A swing of the intact foot, by its motion alone."""

    lift_off_s: float
    start_s: float  # of the part without its ends, over which momentum is taken
    end_s: float
    needed_bw: np.ndarray  # (3,) what the ground must give vertically there, Legendre coefficients


class ModelStance(NamedTuple):
    """A stance of the model with the person's momentum, over its 0 ... 100 %."""

    stance: Stance
    force_bw: np.ndarray  # (101, 3) low-passed, in the walk's axes
    cop_m: np.ndarray  # (101, 2) likewise; NaN where the foot is not loaded


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenWalk:
    """What a walk tells without its plate."""

    fulcrum_m: float
    weight_n: float  # of the person
    time_s: np.ndarray  # (n,) even instants
    heading: np.ndarray  # (2,) unit vector of progression in W
    stances: list[Stance]  # by physics and momentum
    model: list[ModelStance]
    swings: list[Swing]
    believed: bool  # the momentum


@dataclass(frozen=True, kw_only=True, eq=False)
class PersonForce:
    """The force of the ground on the prosthetic foot by the person's own curve.

    Attributes:
        time_s: (n,) even instants.
        force_n: (n, 3) in the walk's axes (fore-aft, lateral to the left, vertical), zero between
            stances.
        cop_m: (n, 2) fore-aft and lateral along the same axes; NaN between stances.
        half_width_n: (n, 4) of the interval that holds 80 % of the instants, of the three
            components and of the resultant, by Student's t of so few walks; None where no setting
            was fitted twice.
        stances: as predicted; an end that the recording cuts lies where the fitted walks' duration
            puts it, and is marked as not seen.
        corrected: whether need and model were added.
    """

    time_s: np.ndarray
    force_n: np.ndarray
    cop_m: np.ndarray
    half_width_n: np.ndarray | None
    stances: tuple[Stance, ...]
    corrected: bool

    def columns(self) -> dict[str, np.ndarray]:
        """Its series (n,) by name and unit, as `person_force.csv` has them."""
        named = {"time_s": self.time_s}
        for names, values, unit in (
            (SPREADS[:3], self.force_n, "n"),
            (("cop_fore_aft", "cop_lateral"), self.cop_m, "m"),
            ([f"{name}_half_width" for name in SPREADS], self.half_width_n, "n"),
        ):
            if values is not None:
                named |= {f"{name}_{unit}": own for name, own in zip(names, values.T, strict=True)}
        return named


def seen(
    walk: Walk,
    physics: WalkResult,
    momentum: WalkResult,
    trial: Trial,
    correction: MomentumCorrection,
) -> SeenWalk:
    """Of a trial's walk by the physics, and its results by the physics and with the person's
    momentum, after its `correction` (the same where that was not believed)."""
    heading = walking_direction(physics)
    axes = walk_axes(heading)
    weight = trial.subject.mass_kg * GRAVITY
    needed = needed_force(walk)
    record = walk.record.time_s
    found = []
    for window in swings(walk):
        start, end = map(float, record[window][[0, -1]])
        legendre = coefficients(walk, [window], needed, trial, heading)[3:]
        found.append(Swing(start - TRIMMED_S, start, end, legendre))

    grid = uniform_grid(physics.time_s)
    rate = 1.0 / float(grid[1] - grid[0])
    by_physics, raw = (resample(grid, one.time_s, one.grf_W) for one in (physics, momentum))
    smooth = low_pass(raw, rate_hz=rate, cutoff_hz=FORCE_CUTOFF_HZ) @ axes.T / weight
    model = []
    for stance in find_stances(grid, raw[:, 2]):
        at = percent_instants(stance)
        cop_W = filtered_while_loaded(
            momentum.cop_W[:, :2], momentum.time_s, momentum.grf_W[:, 2], momentum.cop_W, at
        )
        model.append(ModelStance(stance, resample(at, grid, smooth), cop_W @ axes[:2, :2].T))
    doubt = np.mean((correction.values / PRIOR) ** 2) / DOUBTED**2
    share = float(doubt / (1.0 + doubt))
    stances = []
    for one in find_stances(grid, by_physics[:, 2]):
        other = partner(one, [own.stance for own in model]) or one
        start_s = one.start_s + share * (other.start_s - one.start_s)
        end_s = one.end_s + share * (other.end_s - one.end_s)
        stances.append(replace(one, start_s=start_s, end_s=end_s))
    return SeenWalk(
        fulcrum_m=trial.fulcrum_m,
        weight_n=weight,
        time_s=grid,
        heading=heading,
        stances=stances,
        model=model,
        swings=found,
        believed=correction.believed,
    )


def measured(walk: SeenWalk, plate: PlateRecording, fingerprint: str) -> PersonWalk | None:
    """A fitted walk beside the plate under its prosthetic foot; None where plate and model do not
    both show a stance from strike to lift-off."""
    axes = walk_axes(walk.heading)
    rate = 1.0 / float(np.median(np.diff(plate.time_s)))
    force_bw = (
        low_pass(plate.force_W, rate_hz=rate, cutoff_hz=min(FORCE_CUTOFF_HZ, 0.45 * rate))
        @ axes.T
        / walk.weight_n
    )
    rows = []
    for real in known_stances(plate):
        own = partner(real, walk.stances)
        model = _model_of(walk, real)
        if not (real.complete and own and own.complete and model and model.stance.complete):
            continue
        at = percent_instants(real)
        cop_m = (
            filtered_while_loaded(
                plate.cop_W[:, :2], plate.time_s, plate.force_W[:, 2], plate.cop_W, at
            )
            @ axes[:2, :2].T
        )
        swing = partner_swing(walk, real)
        share = 100.0 / real.duration_s
        rows.append(
            {
                "force": resample(at, plate.time_s, force_bw),
                "cop": _whole(cop_m - np.nanmean(model.cop_m, axis=0)),
                "model": model.force_bw,
                "model_cop": _whole(model.cop_m - np.nanmean(model.cop_m, axis=0)),
                "needed": np.full(3, np.nan) if swing is None else swing.needed_bw,
                "lift_off": np.array(
                    np.nan if swing is None else share * (swing.lift_off_s - real.start_s)
                ),
                "times": np.array(
                    [real.duration_s, own.start_s - real.start_s, own.end_s - real.end_s]
                ),
            }
        )
    if not rows:
        return None
    mean = {name: np.mean([row[name] for row in rows], axis=0) for name in rows[0]}
    told = {}
    for names, prefix, values in (
        (FORCES, "", mean["force"]),
        (COPS, "", mean["cop"]),
        (FORCES, "model_", mean["model"]),
        (COPS, "model_", mean["model_cop"]),
    ):
        for name, column in zip(names, values.T, strict=True):
            if np.isfinite(column).all() and (walk.believed or not prefix):
                told[prefix + name] = tuple(column.tolist())
    stance_s, strike_s, lift_off_s = mean["times"].tolist()
    seen_swing = bool(np.isfinite(mean["needed"]).all())
    return PersonWalk(
        fingerprint=fingerprint,
        fulcrum_m=walk.fulcrum_m,
        needed_bw=tuple(mean["needed"].tolist()) if seen_swing else None,
        intact_lift_off_percent=float(np.clip(mean["lift_off"], 0.0, 100.0))
        if seen_swing
        else None,
        stance_s=stance_s,
        strike_error_s=strike_s,
        lift_off_error_s=lift_off_s,
        **told,
    )


def laid(curve: PersonCurve, walk: SeenWalk) -> PersonForce:
    """The person's own curve over a walk whose plate is not used."""
    walks = curve.walks
    strike_s = float(np.mean([one.strike_error_s for one in walks]))
    lift_off_s = float(np.mean([one.lift_off_error_s for one in walks]))
    stances = []
    for one in walk.stances:
        start = one.start_s - strike_s
        end = one.end_s - lift_off_s
        if not one.whole:
            duration = _told(walks, ("stance_s",), walk.fulcrum_m)
            assert duration is not None
            start = start if one.starts else min(one.start_s, end - float(duration[0]))
            end = end if one.ends else max(one.end_s, start + float(duration[0]))
        stances.append(replace(one, start_s=start, end_s=end))
    return over(curve, walk, stances)


def over(curve: PersonCurve, walk: SeenWalk, stances: Sequence[Stance]) -> PersonForce:
    """The same over given stances, such as those that a plate measured."""
    walks = curve.walks
    instants = walk.time_s
    spreads = [getattr(curve, f"{name}_sd_bw") for name in SPREADS]
    positions = np.array([one.fulcrum_m for one in walks])
    force_bw = np.zeros((len(instants), 3))
    cop_m = np.full((len(instants), 2), np.nan)
    sd_bw = np.zeros((len(instants), len(SPREADS)))
    corrected = False
    for stance in stances:
        rows = (instants >= stance.start_s) & (instants <= stance.end_s)
        percent = 100.0 * (instants[rows] - stance.start_s) / stance.duration_s
        model = _model_of(walk, stance)
        whole = stance.whole and model is not None and model.stance.whole
        swing = partner_swing(walk, stance)

        # the same place in the fitted walks' stance
        theirs = percent
        lift_off = _told(walks, ("intact_lift_off_percent",), walk.fulcrum_m)
        if swing is not None and lift_off is not None:
            place = np.clip(float(lift_off[0]), 1.0, 99.0)
            own = 100.0 * (swing.lift_off_s - stance.start_s) / stance.duration_s
            aligned = np.clip(place + ALIGNED * (own - place), 1.0, 99.0)
            theirs = np.interp(percent, [0.0, aligned, 100.0], [0.0, place, 100.0])
        base = _told(walks, FORCES, walk.fulcrum_m)
        assert base is not None
        force_bw[rows] = _at(theirs, base)
        sd_bw[rows] = _at(theirs, np.array(spreads)) if None not in spreads else np.nan
        cop = _told(walks, COPS, walk.fulcrum_m)
        if not whole or model is None:
            continue
        foot = np.nanmean(model.cop_m, axis=0)
        if cop is not None:
            cop_m[rows] = foot + _at(theirs, cop)

        # what is different about this walk
        of_model = _told(walks, [f"model_{name}" for name in FORCES], walk.fulcrum_m)
        needed = _told(walks, ("needed_bw",), walk.fulcrum_m)
        if not walk.believed or of_model is None:
            continue
        corrected = True
        force_bw[rows] += MODEL * (_at(percent, model.force_bw.T) - _at(theirs, of_model))
        of_cop = _told(walks, [f"model_{name}" for name in COPS], walk.fulcrum_m)
        if cop is not None and of_cop is not None:
            own_cop = _whole(model.cop_m - foot)
            cop_m[rows] += COP * (_at(percent, own_cop.T) - _at(theirs, of_cop))
        if swing is not None and needed is not None:
            force_bw[rows, 2] += NEED * _faded(
                instants[rows], swing, swing.needed_bw - needed[0], 0.01 * FADE * stance.duration_s
            )
    half_width_n = None
    if None not in spreads and len(settings_of(positions)) < len(walks):
        # this walk has a spread of its own, beside that of the mean
        shares = [1.0, *between_settings(positions, np.eye(len(walks)), walk.fulcrum_m)]
        wide = half_width(positions, walk.weight_n, np.array(shares), covered=COVERED)
        half_width_n = wide * sd_bw
    return PersonForce(
        time_s=instants,
        force_n=walk.weight_n * force_bw,
        cop_m=cop_m,
        half_width_n=half_width_n,
        stances=tuple(stances),
        corrected=corrected,
    )


def spread(curve: PersonCurve, walks: Sequence[SeenWalk]) -> PersonCurve:
    """The curve with how far walks of one setting lie apart. Each of a setting that was fitted
    twice is told by all others, of k walks there by k - 1, so that its square is k / (k - 1) times
    theirs.
    `walks` are those of `curve.walks`.

    The momentum's bias knows the walk that is left out too. That does not make the interval too
    narrow: it moves the models of all walks alike, and the spread by less than 1 % on the synthetic
    persons where it was told anew without the walk."""
    positions = np.array([walk.fulcrum_m for walk in walks])
    squares = []
    for i, k in [(i, len(one)) for one in settings_of(positions) for i in one.tolist()]:
        if k == 1:
            continue
        own = curve.walks[i]
        others = tuple(one for one in curve.walks if one is not own)
        told = laid(PersonCurve(walks=others), walks[i])
        plate_bw = np.array([getattr(own, name) for name in FORCES]).T
        for stance in (one for one in walks[i].stances if one.complete):
            real = replace(
                stance,
                start_s=stance.start_s - own.strike_error_s,
                end_s=stance.end_s - own.lift_off_error_s,
            )
            force_bw = resample(percent_instants(real), told.time_s, told.force_n)
            off_bw = with_resultant(force_bw / walks[i].weight_n, plate_bw)
            squares.append((1.0 - 1.0 / k) * off_bw**2)
    if not squares:
        return curve
    mean = np.mean(squares, axis=0)
    rows = [
        mean[max(0, k - NEIGHBOURS) : k + NEIGHBOURS + 1].mean(axis=0) for k in range(len(PERCENT))
    ]
    sd_bw = dict(zip(SPREADS, np.sqrt(rows).T, strict=True))
    return replace(curve, **{f"{name}_sd_bw": tuple(sd.tolist()) for name, sd in sd_bw.items()})


def with_resultant(force: np.ndarray, plate: np.ndarray) -> np.ndarray:
    """(n, 4) what a force (n, 3) has over a plate's, by SPREADS."""
    resultants = (np.linalg.norm(one, axis=1) for one in (force, plate))
    return np.column_stack([force - plate, np.subtract(*resultants)])


def partner_swing(walk: SeenWalk, stance: Stance) -> Swing | None:
    """The intact foot's swing during a stance; None where none was seen."""
    own = [one for one in walk.swings if overlap_s(one, stance) > 0.0]
    return max(own, key=lambda one: overlap_s(one, stance), default=None)


def _model_of(walk: SeenWalk, stance: Stance) -> ModelStance | None:
    own = partner(stance, [one.stance for one in walk.model])
    return next((one for one in walk.model if one.stance is own), None)


def _told(walks: Sequence[PersonWalk], names: Sequence[str], fulcrum_m: float) -> np.ndarray | None:
    """(k, ...) what the fitted walks that know them all have under k names, at a fulcrum position;
    None where none does."""
    rows = [
        (one.fulcrum_m, np.array([getattr(one, name) for name in names]))
        for one in walks
        if all(getattr(one, name) is not None for name in names)
    ]
    if not rows:
        return None
    positions, values = zip(*rows, strict=True)
    return between_settings(np.array(positions), np.array(values), fulcrum_m)


def _at(percent: np.ndarray, curves: np.ndarray) -> np.ndarray:
    """(n, k) of curves (k, 101) over stance."""
    return np.column_stack([np.interp(percent, PERCENT, curve) for curve in curves])


def _whole(curve: np.ndarray) -> np.ndarray:
    """(101, k) with its unknown ends as the nearest that is known; unknown where nothing is."""
    known = np.isfinite(curve).all(axis=1)
    if not known.any():
        return curve
    return np.column_stack([np.interp(PERCENT, PERCENT[known], own) for own in curve[known].T])


def _faded(instants: np.ndarray, swing: Swing, legendre: np.ndarray, fade_s: float) -> np.ndarray:
    """(n,) a polynomial over a swing, going on beyond its ends as it is there and fading over
    `fade_s`."""
    place = 2.0 * (instants - swing.start_s) / (swing.end_s - swing.start_s) - 1.0
    beyond_s = np.maximum(swing.start_s - instants, instants - swing.end_s)
    share = np.clip(beyond_s / fade_s, 0.0, 1.0)
    return np.asarray(
        legval(np.clip(place, -1.0, 1.0), legendre) * 0.5 * (1.0 + np.cos(np.pi * share))
    )
