"""`vsf-drake predict`: motion, force and loads of a person at a setting that was not recorded."""

from __future__ import annotations

from dataclasses import dataclass

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import option
from vsf_drake.cli.app import Contact, Out, Trials, app, contact_hash, print_text, progress, say
from vsf_drake.cli.options import PLACE, PLACES, from_fields, named_as_options
from vsf_drake.cli.recordings import AcceptUnusable, judged
from vsf_drake.simulation.options import StepOptions


@dataclass(frozen=True, kw_only=True)
class PredictRequest(StepOptions):
    """Which setting, and how."""

    fulcrum_mm: str | None = option(None, f"{PLACE}, between the recorded ones.", metavar=PLACES)


@app.command()
@from_fields
def predict(
    trials: Trials,
    out: Out,
    contact: Contact = None,
    *,
    asked: PredictRequest,
    accept_unusable: AcceptUnusable = False,
) -> None:
    """Predicts motion, force and loads at a setting between those at which the person was recorded.

    The motion is the person's own answer to the setting, from walks at two settings or more; the
    fitted contact walks it. It interpolates, and does not know how people adapt.
    """
    from vsf_drake.model.contact_file import load_contact
    from vsf_drake.model.model_file import check_movable
    from vsf_drake.motion.trial import load_trial
    from vsf_drake.report.predict_page import PREDICT, write_prediction
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.simulation.fulcrum_place import fulcrum_place
    from vsf_drake.tuning.answered import predict as predict_setting
    from vsf_drake.walks.recorded_walk import check_named_once

    if asked.fulcrum_mm is None:
        raise InputError(
            "is missing", where="--fulcrum-mm", right="Name the setting that is to be predicted"
        )
    if contact is None:
        raise InputError(
            "is missing",
            where="--contact",
            right="Fit it to this person's walks: vsf-drake fit TRIAL.yaml...",
        )
    PREDICT.check(out)
    check_named_once(trials)
    fitted = load_contact(contact)
    recorded = [load_trial(file) for file in trials]
    for trial in recorded:
        check_movable(
            trial.model.foot,
            "Of another foot nothing is predicted: `simulate` walks one",
            trial.path,
        )
    fulcrum_m = fulcrum_place(asked.fulcrum_mm, recorded[0].model.foot, where="--fulcrum-mm")
    read = judged(recorded, accept=accept_unusable)
    with progress() as show, named_as_options(PredictRequest, fulcrum_m="--fulcrum-mm"):
        found = predict_setting(
            read,
            fitted,
            fulcrum_m=fulcrum_m,
            step_s=1e-3 * asked.step_ms,
            inputs=contact_hash(contact),
            progress=show,
        )
        show("writing the page", 0.95)
        write_prediction(out, found)
    print_text("predict", t=found.table, rows=found.table.rows())
    say(f"written to {out / PAGE}")
