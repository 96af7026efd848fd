"""What `validation.json` and `validation.npz` hold: a finished study as plain values and arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.validation.run import Finished
from vsf_drake.analysis.validation.study import Study
from vsf_drake.files import plain
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import provenance


def validation_content(
    study: Study, finished: Mapping[str, Finished], *, exact: Study | None = None
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Content and arrays ("section/name") of a validation.

    Args:
        finished: its sections, of `run_sections`.
        exact: the same walks without errors of measurement, where there are such.
    """
    tables = {name: None if one.section is None else one.section.table for name, one in finished.items()}
    trials = [{
        "height_mm": 1e3 * walk.trial.offsets.height_m, "fore_aft_mm": 1e3 * walk.trial.offsets.fore_aft_m,
        "alignment_deg": math.degrees(walk.trial.offsets.alignment_rad), "label": walk.label, "name": walk.trial.name,
        "file": walk.trial.path.name, "role": walk.role, "fulcrum_mm": walk.fulcrum_mm,
        "synthetic": walk.trial.synthetic, "doubts": " ".join(walk.doubts) or None,
        "window_s": [walk.trial.start_s, walk.trial.end_s], "unconverged_steps": walk.result.unconverged_steps}
        for walk in study.walks]
    contact = study.contact
    content: dict[str, Any] = plain({
        "title": f"Validation: {study.walks[0].trial.subject.name or 'a walking person'}",
        "first_line": first_line(study), "synthetic": study.synthetic,
        "sections": {name: {"table": tables[name], "missing": list(one.section.missing) if one.section else [],
                            "wall_s": one.wall_s, "failure": one.failure} for name, one in finished.items()},
        "options": to_plain(study.options) | {"step_s": study.options.step_s},
        "contact": "none was fitted; the offsets of the prosthesis were fitted to each trial's plate"
        if contact is None else f"{study.contact_name}, fitted to {', '.join(trial.name for trial in contact.trials)} "
                                f"(strategy {contact.strategy})",
        "failed": [list(pair) for pair in study.failed], "notes": _notes(study, finished), "trials": trials,
        "provenance": provenance(
            dict(study.inputs) | {f"exact, {name}": digest for name, digest in (exact.inputs if exact else {}).items()},
            seed=study.options.seed),
        "summary": summary_rows({name: table for name, table in tables.items() if table})})
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


# What the validation comes to: its main figures beside the paper's and beside what is asked of this model.
#
# Published: McGeehan, Adamczyk, Nichols and Hahn 2021, doi 10.1115/1.4050456.


@dataclass(frozen=True, kw_only=True)
class _Line:
    """A line of the summary: `key` is where the value stands, "section/key/key", `paper` the published figure in words,
    `most` and `least` what the value may be; `form` and `scale` are of the value as it is shown."""

    what: str
    key: str
    unit: str
    form: str = "{:z.2f}"
    scale: float = 1.0
    paper: str = ""
    most: float | None = None
    least: float | None = None


_REMAINDER = "energy/ledger_remainder_share_max"
_LINES = (
    _Line(what="Bench: R² of stiffness over fulcrum positions", key="bench/stiffness_r2", unit="", form="{:.4f}",
          paper="0.98", least=0.98),
    _Line(what="Bench: RMSE of stiffness", key="bench/stiffness_rmse_n_per_mm", unit="N/mm", paper="1.37", most=1.37),
    _Line(what="Bench: RMSE of mid-range displacement", key="bench/mid_range_rmse_mm", unit="mm", paper="0.45",
          most=0.45),
    _Line(what="Standing: mass predicted less mass known, largest", key="standing/worst_mass_error", unit="%",
          scale=100.0, paper="-2.6"),
    _Line(what="Fitted walks: resultant GRF, RMSE, mean", key="walking/fitted/grf_rmse_bw", unit="% BW", scale=100.0,
          paper="5.3", most=0.053),
    _Line(what="Held-out walks: resultant GRF, RMSE, mean", key="walking/held_out/grf_rmse_bw", unit="% BW",
          scale=100.0, paper="10 to 14", most=0.10),
    _Line(what="Held-out walks: resultant GRF, RMSE, worst", key="walking/held_out/grf_rmse_bw_worst", unit="% BW",
          scale=100.0, paper="14", most=0.14),
    _Line(what="Held-out walks: null model (a stretched measured curve), mean",
          key="walking/held_out/null_model_grf_rmse_bw", unit="% BW", scale=100.0),
    _Line(what="Held-out walks: CoP, RMSE, mean", key="walking/held_out/cop_rmse_fl", unit="% foot length",
          scale=100.0, paper="5.7 to 9.5", most=0.095),
    _Line(what="Held-out walks: impulse, RMSE, mean", key="walking/held_out/impulse_rmse_bws", unit="BW s",
          form="{:.4f}", paper="0.01 to 0.05", most=0.05),
    _Line(what="Joint angles: tracking, RMSE", key="walking/angle_rmse_deg", unit="°", form="{:.1e}", paper="1.9",
          most=0.01),
    _Line(what="Joint angles: phase lag, largest", key="walking/angle_lag_ms", unit="ms", form="{:.1e}"),
    _Line(what="Stance time: correlation over trials", key="walking/stance_r", unit="", form="{:.3f}"),
    _Line(what="Energy: ledger's remainder over stored energy, worst trial", key=_REMAINDER, unit="%", scale=100.0,
          most=0.01),
)
_ANSWERS = (("energy/softer_stores_more", "A softer setting stores more energy, as measured on the real device"),
            ("energy/softer_returns_more", "A softer setting returns more energy, as measured on the real device"))


def summary_rows(sections: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of the summary: what, value (as its section holds it), shown, unit, paper, asked, met.

    Args:
        sections: their tables by name; what is not there gives a row with an unknown value.
    """
    def found(key: str) -> Any:
        value: Any = sections
        for part in key.split("/"):
            value = value.get(part) if isinstance(value, Mapping) else None
        return value

    rows = []
    fitted = bool(found("bench/contact_on_bench"))
    for line in _LINES:
        value, what = found(line.key), line.what
        limit, relation = (line.most, "at most") if line.most is not None else (line.least, "at least")
        met = None if value is None or limit is None else bool(
            value <= limit if line.most is not None else value >= limit)
        if fitted and line.key.startswith("bench/"):
            what += " (fitted to a bench)"
        if line.key == _REMAINDER and value is not None:
            what += f" (in steps of {1e3 * sections['energy']['step_s']:g} ms)"
        text = None if value is None else line.form.format(line.scale * value)
        rows.append({"what": what, "key": line.key, "value": value, "unit": line.unit, "paper": line.paper or None,
                     "shown": line.form.format(0.0) if text and not float(text) else text,  # a zero has no sign
                     "asked": None if limit is None else f"{relation} {line.scale * limit:g}", "met": met})
    for key, what in _ANSWERS:
        value = found(key)
        rows.append({"what": what, "key": key, "value": value, "unit": "", "paper": None, "asked": "yes", "met": value,
                     "shown": None if value is None else "yes" if value else "no"})
    return rows
