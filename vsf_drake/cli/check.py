"""`vsf-drake check`: how good are trials that have a manifest already?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.cli.app import Contact, Out, app, console, file_of, progress
from vsf_drake.cli.import_ import finish, print_checks
from vsf_drake.errors import InputError
from vsf_drake.files import user_path


@app.command()
def check(
    trials: Annotated[list[Path], typer.Argument(metavar="TRIAL.yaml...", help="Trial manifests.")],
    out: Out,
    contact: Contact = None,
) -> None:
    """Judges recorded trials without simulating: a mark, a number and a sentence for everything that can go wrong."""
    from vsf_drake.analysis.recording.examine import examine
    from vsf_drake.contact_file import load_contact
    from vsf_drake.motion.fitted_trial import trial_with
    from vsf_drake.motion.manifest import load_manifest
    from vsf_drake.motion.trial import load_trial
    from vsf_drake.report.import_outputs import CHECK, write_check

    out = user_path(out)
    CHECK.check(out)
    contact = file_of(contact)
    fitted = None if contact is None else load_contact(contact)
    items, failures = [], {}
    with progress() as show:
        for number, path in enumerate(trials):
            show(f"checking {path.name}", number / len(trials))
            try:
                trial, manifest = load_trial(user_path(path)), load_manifest(user_path(path))
                if fitted is not None:
                    trial = trial_with(trial, fitted, file=contact)
                items.append(examine(trial, cutoff_hz=None if manifest.already_filtered else manifest.marker_cutoff_hz,
                                     belt_speed_m_per_s=manifest.belt_speed_m_per_s))
            except InputError as error:
                if len(trials) == 1:
                    raise
                failures[str(path)] = str(error)
        if not items:
            raise InputError("none of the trials can be read:\n" + "\n".join(f"- {why}" for why in failures.values()))
        table = write_check(items, failures, out)
    print_checks(table)
    console.print(f"written to {out}; read check.html first", highlight=False, markup=False)
    finish(table)
