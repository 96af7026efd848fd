"""Walking: the paper's Table 3 and Figures 5 to 7 over the study's walks, and what the paper did not show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsf_drake.analysis.validation.study import FITTED, HELD_OUT, OFFSETS_FITTED, Progress, Section, Study
from vsf_drake.analysis.validation.walking.conditions import (
    LEAST_FOR_R,
    PUBLISHED,
    condition,
    pearson,
    setting_name,
    summary,
)
from vsf_drake.analysis.validation.walking.ensembles import QUANTITIES, Ensemble, Pair, ensembles, walk_curves
from vsf_drake.analysis.validation.walking.fulcrum_positions import sweep_study
from vsf_drake.analysis.validation.walking.regions import LEAST_WALKS, SPM, differing_regions, spm_version
from vsf_drake.analysis.validation.walking.rows import angle_rows, pooled, walk_rotations, walk_row
from vsf_drake.json_file import plain

ROLES = (HELD_OUT, FITTED, OFFSETS_FITTED)
POOLED = "all"


def walking_section(study: Study, *, progress: Progress | None = None) -> Section:
    """Every number of Table 3, per walk and per condition, and curves.

    Table:
        rows: a walk each (`rows.walk_row`), by fulcrum position.
        conditions: a fulcrum position each (`conditions.condition`), softest first, with the paper's numbers.
        held_out, fitted, offsets_fitted: means and worst (`conditions.summary`) or None.
        angle_rmse_deg, angle_worst_deg, angle_r2, angle_lag_ms, angle_recording_rmse_deg (`rows.pooled`) and
            `angles`, a row a rotation.
        stance_r, stance_n: Pearson's over all walks.
        sweeps_right, sweeps: how many fulcrum sweeps name the right position, of how many that name one.
        sweep_failures: by walk, how many positions of its sweep have no error.
        difference_method, spm1d: what found the regions, and its version; `differences`: one a group and quantity
            (`regions.differing_regions`), with `group` (index in `conditions`, or "all") and `quantity`.
        units: of the curves. paper: what is published.
    Arrays (101 points of the measured stance; G is the index in `conditions` or "all", Q one of QUANTITIES):
        `walk_I_Q_measured`, `walk_I_Q_model` of row I; `group_G_Q_measured_mean`, `_measured_sd`, `_model_mean`,
        `_model_sd`, and the arrays of `differing_regions` likewise.
    """
    say = progress or (lambda what, fraction: None)
    failures: dict[str, list[str]] = {}
    sweeps = sweep_study(study, progress=lambda what, f: say(what, 0.8 * f), failures=failures)
    say("comparing curves", 0.8)
    rotations = {walk.label: walk_rotations(walk) for walk in study.walks}
    rows = [walk_row(walk, rotations[walk.label], sweeps[walk.label]) for walk in study.walks]
    curves = {walk.label: walk_curves(walk) for walk in study.walks}
    conditions = [condition(x, [row for row in rows if row["fulcrum_mm"] == x], ROLES) for x in study.conditions()]
    arrays = {f"walk_{i}_{name}_{side}": curve for i, walk in enumerate(study.walks)
              for name, pair in curves[walk.label].items()
              for side, curve in zip(("measured", "model"), pair, strict=True)}
    differences = _differences(conditions, curves, study.options.seed, arrays)
    table = {
        "rows": rows, "conditions": conditions, **_summaries(rows),
        **pooled([r for own in rotations.values() for r in own]), "angles": angle_rows(rotations),
        "sweeps": sum(row["sweep"]["right"] is not None for row in rows),
        "sweeps_right": sum(row["sweep"]["right"] is True for row in rows),
        "sweep_failures": {label: len(reasons) for label, reasons in failures.items()},
        "spm1d": spm_version(), "difference_method": next((d["method"] for d in differences if d["method"]), None),
        "differences": differences, "units": QUANTITIES, "paper": PUBLISHED, "quick": study.options.quick,
        "synthetic": any(walk.trial.synthetic for walk in study.walks), "contact": study.contact_name or None}
    say("comparing curves", 1.0)
    return Section(table=plain(table), arrays=arrays, missing=tuple(
        [*_missing(study, rows, conditions, curves, table), *_failed_sweeps(failures, rows)]))


def _summaries(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {role.replace(" ", "_"): summary([row for row in rows if row["role"] == role])
                             for role in ROLES}
    found["stance_r"], found["stance_n"] = pearson(rows, "stance_measured_s", "stance_model_s")
    return found


def _differences(
    conditions: Sequence[Mapping[str, Any]], curves: Mapping[str, Mapping[str, Pair]], seed: int,
    arrays: dict[str, np.ndarray]
) -> list[dict[str, Any]]:
    """Regions of every group and quantity; the curves of each join `arrays`."""
    groups: dict[Any, Mapping[str, Ensemble]] = {
        i: ensembles({label: curves[label] for label in own["labels"]}) for i, own in enumerate(conditions)}
    if len(conditions) > 1:
        groups[POOLED] = ensembles(curves)
    found = []
    for i, (group, quantities) in enumerate(groups.items()):
        for name, ensemble in quantities.items():
            table, more = differing_regions(ensemble, seed=(seed, i, list(QUANTITIES).index(name)))
            arrays |= {f"group_{group}_{name}_{key}": value for key, value in (ensemble.arrays() | more).items()}
            found.append({"group": group, "quantity": name, "unit": QUANTITIES[name], "labels": ensemble.labels}
                         | table)
    return found


def _missing(
    study: Study, rows: Sequence[Mapping[str, Any]], conditions: Sequence[Mapping[str, Any]],
    curves: Mapping[str, Mapping[str, Pair]], table: Mapping[str, Any]
) -> list[str]:
    found = []
    walked = {setting_name(own["fulcrum_mm"]) for own in conditions}
    gone = [f"{name} ({own['fulcrum_mm']:g} mm)" for name, own in PUBLISHED["conditions"].items()
            if name not in walked]
    if gone:
        found.append(f"No walk at the paper's setting {' or '.join(gone)}: its rows of Table 3 are not there.")
    single = [f"{own['fulcrum_mm']:g} mm" for own in conditions if own["all"]["n"] == 1]
    if single:
        found.append(f"One walk only at {', '.join(single)}: no standard deviation and no band.")
    whole = {label: own for label, own in curves.items() if own}
    for text, names in (
            ("no stance lies inside the time window as a whole: stance time and curves over stance are not known",
             [label for label in curves if label not in whole]),
            ("the plate has no centre of pressure, so that its errors are not known",
             [w.label for w in study.walks if not w.recorded.prosthetic_plate.has_cop]),
            ("no medio-lateral force was measured",
             [label for label, own in whole.items() if "medio_lateral" not in own]),
            ("no free moment was measured", [label for label, own in whole.items() if "free_moment" not in own]),
            ("there is no other walk to make a null model of",
             [row["label"] for row in rows if row["null_model_grf_rmse_bw"] is None])):
        if names:
            found.append(f"{', '.join(names)}: {text}.")
    if table["stance_r"] is None:
        found.append(f"The correlation of stance times needs {LEAST_FOR_R} walks with a whole stance that differ; "
                     f"there {'is' if table['stance_n'] == 1 else 'are'} {table['stance_n']}.")
    few = [f"{own['fulcrum_mm']:g} mm" for own in conditions if own["all"]["n"] < LEAST_WALKS]
    if few:
        found.append(f"Where on the curve model and measurement differ was not tested at {', '.join(few)}: that needs "
                     f"{LEAST_WALKS} walks.")
    if table["difference_method"] not in (None, SPM):
        found.append("Statistical parametric mapping was not done: spm1d is not installed (`pip install "
                     "vsf-drake[spm]`). Pointwise bootstrap bands stand in.")
    if study.options.quick:
        found.append("The short form sweeps the fulcrum over six positions only, in every walk.")
    return found


def _failed_sweeps(failures: Mapping[str, Sequence[str]], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """What of the sweeps is not there."""
    if not failures:
        return []
    total = sum(len(row["sweep"]["fulcrum_mm"]) for row in rows)
    lost = ", ".join(f"{label} {len(reasons)}" for label, reasons in failures.items())
    first = " ".join(next(iter(failures.values()))[0].split())[:300].rstrip(".")
    count = sum(map(len, failures.values()))
    return [f"{count} of the {total} walks with the fulcrum elsewhere could not be scored ({lost}). The first: "
            f"{first}."]
