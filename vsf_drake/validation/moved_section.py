"""One walk with the fulcrum elsewhere, its motion kept: what the ground does, and the keel at its
most loaded."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vsf_drake.base.errors import SimulationError
from vsf_drake.base.progress import Progress, part_of
from vsf_drake.laws.keel import chain
from vsf_drake.model.parameters import FootParameters
from vsf_drake.model.setting import AtSetting
from vsf_drake.plants.foot import keel_joint_positions, sole_height
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import Walk, Walker, trial_request
from vsf_drake.validation.study import FITTED, Section, Study, StudyWalk
from vsf_drake.validation.walking_curves import walk_curves
from vsf_drake.walks.between_settings import between_settings
from vsf_drake.walks.comparison import compare, rmse
from vsf_drake.walks.fulcrum_sweep import SWEEP_STEP_S, sweep_positions
from vsf_drake.walks.null_model import several_settings

SHOWN_POSITIONS = 7
"""Of the fulcrum, the nearest of them being where the walk had it."""
BETWEEN = "other walks, interpolated between settings"


@dataclass(frozen=True, kw_only=True)
class DrawnFoot:
    """What a drawing of the foot from its side needs, mm in the keel frame K."""

    pylon_x_mm: float
    mount_z_mm: float  # where the pylon begins
    rear_x_mm: float  # of the foam base
    front_x_mm: float
    keel_thickness_mm: float
    foam_mm: float  # thickness, below the keel


@dataclass(frozen=True, kw_only=True)
class MovedTable(AtSetting):
    """The walk of the arrays, and whose measured curves are its null model there: BETWEEN settings,
    or those of one walk."""

    label: str
    null_label: str | None
    drawn: DrawnFoot
    synthetic: bool


def moved_section(study: Study, *, progress: Progress | None = None) -> Section[MovedTable]:
    """The study's shown walk over the carriage, p positions; one whose walk fails is left out.

    Arrays, none where no stance lies inside the walk's window: `fulcrum_mm` (p,); for Q resultant
    (BW) and, where it was measured, cop (FL) `Q_model` (p, 101) and `Q_measured`, `Q_null` (101,);
    at the instant of the largest load ahead of the carriage `keel_mm` (p, k, 2), x and z in K of
    the keel from A to its tip, and `load` (p, 2), that load (N) and its place (mm along the unbent
    keel).
    """
    part_of(progress)("moving the fulcrum of one walk", 0.0)
    walk = study.shown
    foot = walk.trial.model.foot
    curves = {one.label: walk_curves(one) for one in study.walks}
    own = curves[walk.label]
    names = [name for name in ("resultant", "cop") if name in own]
    rows = []
    for x, result in moved_walks(walk).items() if own else ():
        comparison = compare(result, walk.recorded.prosthetic_plate)
        found = walk_curves(dataclasses.replace(walk, result=result, comparison=comparison))
        keel_mm, load = _most_loaded_keel(result, foot)
        rows.append(
            {
                "fulcrum_mm": 1e3 * x,
                "keel_mm": keel_mm,
                "load": load,
                **{f"{name}_model": found[name][1] for name in names},
            }
        )
    arrays = {
        key: np.array([row[key] for row in rows], dtype=float) for key in (rows[0] if rows else ())
    }
    others = [one for one in study.walks if one is not walk and curves[one.label]]
    others = [one for one in others if one.role == FITTED] or others
    between = several_settings(one.trial.fulcrum_m for one in others)
    if own and not between:
        others = sorted(
            others, key=lambda one: rmse(curves[one.label]["resultant"][0], own["resultant"][0])
        )[:1]
    for name in names:
        arrays[f"{name}_measured"] = own[name][0]
        if others and all(name in curves[one.label] for one in others):
            arrays[f"{name}_null"] = between_settings(
                np.array([one.trial.fulcrum_m for one in others]),
                np.array([curves[one.label][name][0] for one in others]),
                walk.trial.fulcrum_m,
            )
    null_label = others[0].label if others else None
    return Section(
        arrays=arrays,
        table=MovedTable(
            label=walk.label,
            **vars(walk.setting),
            null_label=BETWEEN if between else null_label,
            drawn=DrawnFoot(
                pylon_x_mm=1e3 * foot.pylon_x_m,
                mount_z_mm=1e3 * (foot.build_height_m + sole_height(foot)),
                rear_x_mm=1e3 * foot.heel_x_m,
                front_x_mm=1e3 * (foot.heel_x_m + foot.length_m),
                keel_thickness_mm=1e3 * foot.keel.thickness_m,
                foam_mm=1e3 * foot.foam_thickness_m,
            ),
            synthetic=study.synthetic,
        ),
    )


@lru_cache(maxsize=1)
def moved_walks(walk: StudyWalk) -> dict[float, WalkResult]:
    """A walk with its motion, by the fulcrum's position (m) over the carriage, the walk's own among
    them; without a position whose walk fails."""
    trial = walk.trial
    own_m = round(trial.fulcrum_m, 6)
    positions = np.round(sweep_positions(trial, SHOWN_POSITIONS), 6)
    positions[np.argmin(np.abs(positions - own_m))] = own_m
    walker = Walker(trial.subject, trial.model)
    others = walker.walk_each(
        [
            trial_request(trial, fulcrum_m=float(x), step_s=SWEEP_STEP_S)
            for x in np.unique(positions)
            if x != own_m
        ]
    )
    results = {}
    for x in np.unique(positions).tolist():
        if x == own_m:
            results[x] = walk.result
            continue
        other = next(others)
        if isinstance(other, SimulationError):
            continue
        if not isinstance(other, Walk):
            raise other
        results[x] = walker.result(other, trial, trial.offsets, energy=False)
    return results


def _most_loaded_keel(result: WalkResult, foot: FootParameters) -> tuple[np.ndarray, list[float]]:
    """The keel (mm) and its load (N, mm), as `moved_section` has them."""
    spheres_mm = np.concatenate([zone.x_mm for zone in foot.zones])
    ahead = spheres_mm > 1e3 * foot.fulcrum.foremost_m
    loads = result.sphere_normal_n[:, ahead]
    i = int(np.argmax(loads.sum(axis=1)))
    # the toe up is positive
    bends = [
        column for column, name in enumerate(result.coordinate_names) if name.startswith("keel_")
    ]
    starts = np.array([0.0, *keel_joint_positions(foot.keel)])
    c, s, x, z = chain(starts, result.q[i, bends])
    last = sum(foot.keel.element_lengths_m) - starts[-1]
    keel_mm = 1e3 * np.column_stack(
        [np.append(x, x[-1] + last * c[-1]), np.append(z, z[-1] + last * s[-1])]
    )
    load_n = loads[i].sum()
    return keel_mm, [load_n, loads[i] @ spheres_mm[ahead] / max(load_n, 1e-9)]
