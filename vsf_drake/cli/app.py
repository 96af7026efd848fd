"""What the commands share: the application, what they say, their progress bar and common
options."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text
from typer.core import TyperCommand

from vsf_drake import __version__
from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import user_path
from vsf_drake.base.schema import SEED
from vsf_drake.cli.options import PlaceOptions, named_as_options
from vsf_drake.simulation.options import LawOptions

if TYPE_CHECKING:
    from vsf_drake.model.parameters import ModelParameters
    from vsf_drake.motion.trial import Trial


class PlainCommand(TyperCommand):
    """A command whose help names arguments without their Python types."""

    def get_params(self, ctx: Any) -> Any:
        """The parameters, for reading and for help."""
        params = super().get_params(ctx)
        for param in params:
            if param.param_type_name == "argument":
                # some versions of Typer write list[Path]
                vars(param)["display_type_rich"] = lambda ctx: None
        return params

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Arguments, options, and below them the options of a panel of their own."""
        panels: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for param in self.get_params(ctx):
            told = param.get_help_record(ctx)
            if told is not None:
                panel = getattr(param, "rich_help_panel", None) or "Options"
                heading = "Arguments" if param.param_type_name == "argument" else panel
                panels.setdefault(heading, []).append(told)
        for heading, rows in panels.items():
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)


app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="A variable-stiffness foot prosthesis on the bench and under a walking person.",
)
console = Console(markup=False, highlight=False, emoji=False)
errors = Console(stderr=True, markup=False, highlight=False, emoji=False)
"""What they print may hold a user's names: nothing in it is markup."""

COLUMNS = 80  # of a line of results on a terminal: its usual width
FILE_COLUMNS = 10_000  # of a table in a file: what none has
INTERRUPTED = 130  # what Typer ends with after Ctrl-C

path = user_path  # a path that a user gave, with ~ expanded
Out = Annotated[Path, typer.Option(parser=path, help="Folder for the results; created if needed.")]
OptionalOut = Annotated[
    Path | None, typer.Option(parser=path, help="Folder for the results; created if needed.")
]
Model = Annotated[
    Path | None,
    typer.Option(
        parser=path,
        help=(
            "Model file (YAML) instead of the nominal one, such as "
            "package://vsf_drake/soft_support.yaml."
        ),
    ),
]
Contact = Annotated[
    Path | None,
    typer.Option(parser=path, help="File that `fit` wrote; its values replace the model's."),
]
Trials = Annotated[
    list[Path], typer.Argument(parser=path, metavar="TRIAL.yaml...", help="Trial manifests.")
]
FolderOrTrials = Annotated[
    list[Path],
    typer.Argument(
        parser=path,
        metavar="TRIAL.yaml...|FOLDER",
        help="Trial manifests, or a folder of them such as `import` and `session` write.",
    ),
]
Workers = Annotated[int | None, typer.Option(help="Processes. Default: one per core.", min=1)]
Seed = Annotated[int, typer.Option(help=SEED, min=0)]


def say(line: str) -> None:
    """A line; a terminal breaks it between words but for where things are written, a file nowhere.
    One that begins with "! " stands out."""
    console.print(
        line,
        style="bold yellow" if line.startswith("! ") else None,
        soft_wrap=not console.is_terminal or line.startswith("written to "),
    )


def warn(line: str) -> None:
    """A line that stands out."""
    say(f"! {line}")


def fail(line: str) -> None:
    """An error that is not the end yet."""
    errors.print(f"error: {line}", style="red", soft_wrap=True)


def interrupted(line: str) -> NoReturn:
    """Ends the command after an interrupt, saying what is left."""
    errors.print(f"interrupted{line}", soft_wrap=True)
    raise SystemExit(INTERRUPTED) from KeyboardInterrupt()


def print_text(template: str, /, **facts: Any) -> None:
    """Prints what `templates/TEMPLATE.txt.j2` makes of a command's results, line by line; "! "
    makes one stand out.

    On a terminal a line of more than COLUMNS goes on, indented, in the next one; only a word that
    is longer itself stays whole. Elsewhere every line and every row of a table is one. A table is
    `{% call table("heading", ..., title="", right=[1]) %}`, a line a row, with │ between its cells;
    one that no narrow screen cuts is `{% call columns(right=[1]) %}`.
    """
    from vsf_drake.base.sentences import text_templates

    tables: list[Table | str] = []

    def rows_of(text: str) -> list[tuple[bool, list[str]]]:
        return [
            (line.startswith("! "), [cell.strip() for cell in line.removeprefix("! ").split("│")])
            for line in text.split("\n")
            if line.strip()
        ]

    def table(
        *headings: str, caller: Callable[[], str], title: str = "", right: Collection[int] = ()
    ) -> str:
        made = Table(title=title or None)
        for i, name in enumerate(headings):
            made.add_column(
                name,
                justify="right" if i in right else "left",
                overflow="ellipsis" if i else "fold",
            )
        for stands_out, cells in rows_of(caller()):
            made.add_row(*map(Text, cells), style="bold yellow" if stands_out else None)
        tables.append(made)
        return f"\f{len(tables) - 1}\n"

    def columns(caller: Callable[[], str], right: Collection[int] = (), gap: int = 1) -> str:
        rows = [cells for _, cells in rows_of(caller())]
        wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
        tables.append(
            "\n".join(
                (gap * " ")
                .join(
                    cell.rjust(wide[i]) if i in right else cell.ljust(wide[i])
                    for i, cell in enumerate(cells)
                )
                .rstrip()
                for cells in rows
            )
        )
        return f"\f{len(tables) - 1}\n"

    def one_cell(value: Any) -> Any:  # a name may hold anything, and ends neither cell nor line
        return (
            value.rstrip("\n").replace("\n", " ").replace("│", "|")
            if isinstance(value, str)
            else value
        )

    pages = text_templates("cli/templates", "engines/templates", "wording").overlay(
        finalize=one_cell
    )
    text = pages.get_template(f"{template}.txt.j2").render(facts, table=table, columns=columns)
    for line in filter(None, text.split("\n")):
        made = tables[int(line[1:])] if line.startswith("\f") else None
        if isinstance(made, Table):
            if not console.is_terminal:
                console.width = FILE_COLUMNS
            console.print(made)
        elif made or not console.is_terminal:
            say(made or line)
        else:
            say(
                "\n".join(
                    textwrap.wrap(
                        line,
                        COLUMNS,
                        subsequent_indent="  ",
                        break_long_words=False,
                        break_on_hyphens=False,
                    )
                )
            )


def needed(out: Path | None) -> Path:
    """The folder for the results, without which a command that may do without it cannot go on."""
    if out is None:
        raise InputError("is missing", where="--out", right="Name the folder for the results")
    return out


def model_of(path: Path | None, contact: Path | None = None) -> ModelParameters:
    """The model of a file, or the nominal one in the contact's shell, with the fitted contact of
    another."""
    from vsf_drake.base.files import resource
    from vsf_drake.model.contact_file import fitted_model, load_contact
    from vsf_drake.model.model_file import load_model

    model = load_model(path or resource("models/nominal.yaml"))
    if contact is None:
        return model
    return fitted_model(model, load_contact(contact), file=contact, in_its_shell=path is None)


def place_of(asked: PlaceOptions, model: Path | None) -> float:
    """Where the fulcrum is to stand (m from A) in the device of a file, or the nominal one."""
    from vsf_drake.model.parameters import MID_FULCRUM_MM
    from vsf_drake.simulation.fulcrum_place import fulcrum_place

    device = model_of(model).foot
    return fulcrum_place(
        asked.fulcrum, device, default_m=1e-3 * MID_FULCRUM_MM, where="--fulcrum-mm"
    )


def manifests_of(paths: Iterable[Path]) -> list[Path]:
    """The manifests, those in a folder in its place: of a session's results those that it
    imported."""
    from vsf_drake.motion.manifest import keys_of
    from vsf_drake.report.session_page import IMPORT_FOLDER

    found = []
    for given in paths:
        if not given.is_dir():
            found.append(given)
            continue
        inner = given / IMPORT_FOLDER
        folder = inner if inner.is_dir() else given
        there = []
        for file in sorted(folder.glob("*.yaml")):
            keys = keys_of(file)
            if "subject" in keys and keys & {"kinematics", "markers"}:
                there.append(file)
        require(
            there,
            "holds no trial manifests",
            right="Name a folder that `import` or `session` wrote; recordings become one by "
            "`vsf-drake session`",
            file=given,
        )
        found += there
    return found


def read_trials(paths: list[Path], contact: Path | None, *, law: str | None = None) -> list[Trial]:
    """The trials of manifests, with the fitted contact if there is one, under a contact law."""
    from vsf_drake.motion.trial import load_trial

    return fitted_trials(map(load_trial, paths), contact, law=law)


def fitted_trials(
    trials: Iterable[Trial], contact: Path | None, *, law: str | None = None
) -> list[Trial]:
    """The trials with the fitted contact if there is one, under a contact law."""
    from vsf_drake.model.contact_file import load_contact
    from vsf_drake.walks.recorded_walk import with_contact

    if contact is not None:
        fitted = load_contact(contact)
        trials = [with_contact(trial, fitted, file=contact) for trial in trials]
    return under(law, trials)


def under(law: str | None, trials: Iterable[Trial]) -> list[Trial]:
    """The trials with the contact law of --law."""
    from vsf_drake.motion.fitted_trial import under_law

    with named_as_options(LawOptions):
        return [under_law(trial, law) for trial in trials]


def input_hashes(model: Path | None, contact: Path | None) -> dict[str, str]:
    """SHA-256 of the files that a model comes from, by the names under which results have them."""
    from vsf_drake.base.files import sha256

    of_model = {} if model is None else {f"model: {model.name}": sha256(model)}
    return contact_hash(contact) | of_model


def contact_hash(path: Path | None) -> dict[str, str]:
    """SHA-256 of a fitted contact, by the name under which results have it; none for None."""
    from vsf_drake.base.files import sha256

    return {} if path is None else {f"contact: {path.name}": sha256(path)}


def check_contact_use(contact: Path | None, *, fit_offsets: bool) -> None:
    """Raises InputError for a fitted contact together with --fit-offsets."""
    require(
        contact is None or not fit_offsets,
        "cannot go with --contact, whose fit has found the offsets already",
        "--fit-offsets",
        "Leave one of them out",
    )


@contextmanager
def progress() -> Iterator[Callable[[str, float], None]]:
    """A bar that disappears when done; called with what is being done and the finished fraction of
    it."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=errors, transient=True) as bar:
        task = bar.add_task("preparing", total=1.0)
        yield lambda what, fraction: bar.update(task, description=what, completed=fraction)


def _version(asked: bool) -> None:
    if asked:
        console.print(__version__)
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass
