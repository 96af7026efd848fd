"""`vsf-drake validate`, the paper's study and more as a report; and `report`, which makes any
report again."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsf_drake.base.errors import InputError, SimulationError, require
from vsf_drake.base.schema import choice, option
from vsf_drake.cli.app import (
    Contact,
    Out,
    app,
    console,
    fail,
    interrupted,
    path,
    print_text,
    progress,
    say,
    warn,
)
from vsf_drake.cli.options import from_fields
from vsf_drake.cli.recordings import judged
from vsf_drake.validation.options import StudyOptions

if TYPE_CHECKING:
    from vsf_drake.validation.run import Finished


@dataclass(frozen=True, kw_only=True)
class StudyRequest:
    """What is asked of a validation beside its options."""

    bench: Path | None = option(
        None,
        "Measured load-displacement curves: CSV with fulcrum_mm, displacement_mm, load_n.",
    )
    against: str | None = choice(
        None,
        options=("published",),
        source="choice",
        metavar="published",
        help="Instead of the study: which published effects of stiffness the model reproduces.",
    )


@app.command()
@from_fields
def validate(
    trials: Annotated[
        list[Path] | None,
        typer.Argument(
            parser=path,
            metavar="[TRIAL.yaml...]",
            help="Trial manifests; without any, the embedded synthetic subject.",
        ),
    ] = None,
    out: Out = Path("results"),
    contact: Contact = None,
    *,
    request: StudyRequest,
    options: StudyOptions,
) -> None:
    """The paper's study and more, as one report: bench, standing, walking, energy, roll-over."""
    from vsf_drake.base.files import resource
    from vsf_drake.model.bench_curves import bench_doubts
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.validation.output import (
        UNFINISHED,
        VALIDATION,
        write_unfinished,
        write_validation,
    )
    from vsf_drake.validation.run import (
        NAMES,
        SHIPPED,
        SectionStore,
        first_line,
        run_sections,
        shipped_key,
        validation_content,
    )
    from vsf_drake.validation.study import make_study
    from vsf_drake.walks import embedded
    from vsf_drake.walks.quantities import JUDGED, quantity

    if request.against:
        _against_published(trials, out, contact, options)
        return
    VALIDATION.check(out)
    exact = None
    shipped = None
    with progress() as show:
        study = make_study(
            trials or embedded.embedded_trials(quick=options.quick),
            contact=contact or (None if trials else embedded.embedded_contact()),
            bench=request.bench or (None if trials else embedded.embedded_bench()),
            options=options,
            progress=show,
            judge=judged,
        )
        if not (trials or contact or options.quick):
            exact = make_study(
                embedded.embedded_trials("exact"),
                options=options,
                progress=show,
                contact=embedded.embedded_contact("exact"),
            )
            shipped = SectionStore(resource(SHIPPED), shipped_key(study))
    console.print(first_line(study))
    for sentence in bench_doubts(study.bench) if study.bench else ():
        warn(sentence)
    said: list[Path] = []
    earlier = (out / VALIDATION.table).is_file()
    if earlier:  # what is finished is not given up for what is not
        say(f"{out / PAGE} remains that of the earlier run until this command ends")

    def grown(finished: Mapping[str, Finished], to_come: list[str]) -> None:
        page = write_unfinished(
            *validation_content(study, finished, exact=exact), out, study=study, to_come=to_come
        )
        if not said:
            say(f"{page} can be opened; it grows until this command ends")
        said.append(page)

    try:
        with progress() as show:
            finished = run_sections(
                study,
                exact=exact,
                folder=out / UNFINISHED,
                shipped=shipped,
                grown=None if earlier else grown,
                progress=show,
            )
            show("writing the report", 0.99)
            content, arrays = validation_content(study, finished, exact=exact)
            write_validation(content, arrays, out, study=study)
    except KeyboardInterrupt:
        interrupted(
            f"; finished sections are in {out / UNFINISHED}: the same command goes on from them"
        )
    SectionStore(out / UNFINISHED, "").remove(NAMES)
    print_text("summary", **vars(content), percent=quantity(JUDGED).told)
    say(f"written to {out / PAGE}")
    unread = [f"{label}: {why}" for label, why in study.failed]
    failed = [
        f"the section {name} failed: {one.failure}"
        for name, one in finished.items()
        if one.section is None
    ]
    for line in (*unread, *failed):
        fail(line)
    if unread or failed:
        sys.exit(InputError.exit_code if unread else SimulationError.exit_code)


def _against_published(
    trials: list[Path] | None, out: Path, contact: Path | None, options: StudyOptions
) -> None:
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.validation.output import PUBLISHED, write_published
    from vsf_drake.validation.published_trends import published_trends
    from vsf_drake.validation.study import make_study
    from vsf_drake.walks import embedded

    PUBLISHED.check(out)
    with progress() as show:
        study = make_study(
            trials or embedded.embedded_trials("exact", quick=options.quick),
            options=options,
            progress=show,
            judge=judged,
            contact=contact or (None if trials else embedded.embedded_contact("exact")),
        )
        table = published_trends(study, progress=show)
        write_published(out, table)
    print_text("published", t=table)
    say(f"written to {out / PAGE}")
    if study.failed:
        sys.exit(InputError.exit_code)


@app.command()
def report(
    folder: Annotated[
        Path,
        typer.Argument(
            parser=path,
            help=(
                "Folder that `session`, `validate`, `tune`, `map`, `predict`, `compare` or "
                "`bench --protocol` wrote with --out."
            ),
        ),
    ],
    svg: Annotated[
        bool, typer.Option("--svg", help="Write the figures as SVG too, beside the PNG.")
    ] = False,
) -> None:
    """Makes a report again from its saved results; nothing is simulated."""
    from vsf_drake.report.certificate_page import CERTIFICATE
    from vsf_drake.report.compare_page import COMPARE
    from vsf_drake.report.map_page import MAP
    from vsf_drake.report.predict_page import PREDICT
    from vsf_drake.report.protocol_page import PROTOCOL
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.session_page import SESSION
    from vsf_drake.report.tuning.chapters import TUNING
    from vsf_drake.report.validation.output import PUBLISHED, VALIDATION

    kinds = (
        CERTIFICATE,
        COMPARE,
        TUNING,
        MAP,
        PREDICT,
        PROTOCOL,
        PUBLISHED,
        SESSION,
        VALIDATION,
    )
    found = [kind for kind in kinds if (folder / kind.table).exists() or kind.unfinished(folder)]
    require(
        found,
        "holds no results whose report can be made again",
        right=f"Name a folder that {', '.join(f'`{kind.command}`' for kind in kinds)} wrote; of "
        "another command, run that again",
        file=folder,
    )
    for sentence in found[0].remake(folder, svg=svg):
        warn(sentence)
    say(f"written to {folder / PAGE}")
