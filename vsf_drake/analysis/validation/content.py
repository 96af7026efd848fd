"""What `validation.json` and `validation.npz` hold: a finished study as plain values and arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from vsf_drake.analysis.validation.run import Finished
from vsf_drake.analysis.validation.study import Study
from vsf_drake.analysis.validation.summary import summary_rows
from vsf_drake.json_file import plain
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.schema import to_plain
from vsf_drake.simulation.provenance import provenance


def validation_content(
    study: Study, finished: Mapping[str, Finished], *, exact: Study | None = None
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Content and arrays ("section/name") of a validation.

    Args:
        finished: its sections, of `run_sections`.
        exact: the same walks without errors of measurement, where there are such.
    """
    sections = {name: _section(one) for name, one in finished.items()}
    options = to_plain(study.options) | {"step_s": study.options.step_s}
    inputs = dict(study.inputs) | {f"exact, {name}": digest for name, digest in (exact.inputs if exact else {}).items()}
    subject = study.walks[0].trial.subject
    content: dict[str, Any] = plain({
        "title": f"Validation: {subject.name or 'a walking person'}", "first_line": first_line(study),
        "synthetic": study.synthetic, "sections": sections, "options": options, "contact": _contact(study),
        "failed": [list(pair) for pair in study.failed], "notes": _notes(study, finished),
        "trials": [_trial(walk) for walk in study.walks], "provenance": provenance(inputs, seed=study.options.seed),
        "summary": summary_rows({name: section["table"] for name, section in sections.items() if section["table"]})})
    arrays = {f"{name}/{key}": array for name, one in finished.items() if one.section
              for key, array in one.section.arrays.items()}
    return content, arrays


def first_line(study: Study) -> str:
    """Where the data come from, in one sentence."""
    synthetic = [walk.label for walk in study.walks if walk.trial.synthetic]
    if len(synthetic) == len(study.walks):
        walking = "Walking data are SYNTHETIC (a virtual laboratory's; nobody walked)"
    elif synthetic:
        walking = f"Walking data of {', '.join(synthetic)} are SYNTHETIC, those of the other trials are recorded"
    else:
        walking = "Walking data are recorded"
    if study.bench is None:
        return f"{walking}; bench end points are published, no bench curves were given."
    kind = "SYNTHETIC (a virtual laboratory's bench)" if study.bench.synthetic else "measured"
    return f"{walking}; bench end points are published, bench curves are {kind}."


def _section(one: Finished) -> dict[str, Any]:
    table = None if one.section is None else one.section.table
    missing = [] if one.section is None else list(one.section.missing)
    return {"table": table, "missing": missing, "wall_s": one.wall_s, "failure": one.failure}


def _trial(walk: Any) -> dict[str, Any]:
    offsets = walk.trial.offsets
    return {"height_mm": 1e3 * offsets.height_m, "fore_aft_mm": 1e3 * offsets.fore_aft_m,
            "alignment_deg": math.degrees(offsets.alignment_rad),
            "label": walk.label, "name": walk.trial.name, "file": walk.trial.path.name, "role": walk.role,
            "fulcrum_mm": walk.fulcrum_mm, "synthetic": walk.trial.synthetic, "doubts": " ".join(walk.doubts) or None,
            "window_s": [walk.trial.start_s, walk.trial.end_s], "unconverged_steps": walk.result.unconverged_steps}


def _contact(study: Study) -> str:
    if study.contact is None:
        return "none was fitted; the offsets of the prosthesis were fitted to each trial's plate"
    fitted = ", ".join(trial.name for trial in study.contact.trials)
    return f"{study.contact_name}, fitted to {fitted} (strategy {study.contact.strategy})"


def _notes(study: Study, finished: Mapping[str, Finished]) -> list[str]:
    notes = []
    if study.contact is None:
        notes.append("No contact was given: height, fore-aft place and alignment of the prosthesis were fitted to each "
                     "trial's own plate, so agreement with that plate is no prediction. `vsf-drake fit` makes one.")
    if study.bench_problem:
        notes.append(f"The bench file was not used: {study.bench_problem}")
    if len({walk.trial.subject for walk in study.walks}) > 1:
        notes.append("The trials are of more than one person; means over trials mix them.")
    if any(walk.trial.model != study.model for walk in study.walks):
        own = next(walk.label for walk in study.walks if walk.trial.model == study.model)
        notes.append(f"The trials have more than one model of the foot; what is no walk is of {own}'s.")
    prints: dict[str, list[str]] = {}
    for walk in study.walks:
        prints.setdefault(fingerprint(walk.recorded), []).append(walk.label)
    notes += [f"{' and '.join(labels)} are the same recording: means and deviations over trials count it "
              f"{len(labels)} times." for labels in prints.values() if len(labels) > 1]
    unconverged = [walk.label for walk in study.walks if not walk.result.converged]
    if unconverged:
        notes.append(f"Steps that did not converge are in the walks of {', '.join(unconverged)}: do not trust these.")
    notes += [f"The section {name.replace('_', ' ')} failed: {one.failure}" for name, one in finished.items()
              if one.section is None]
    return notes
