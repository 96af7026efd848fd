"""What the commands share: the application, its consoles, its progress bar and common options."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from vsf_drake import __version__
from vsf_drake.errors import InputError
from vsf_drake.files import user_path

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False,
                  help="A variable-stiffness foot prosthesis on the bench and under a walking person.")
console = Console(markup=False, highlight=False, emoji=False)
errors = Console(stderr=True, markup=False, highlight=False, emoji=False)
"""What they print may hold a user's names: nothing in it is markup."""

INTERRUPTED = 130
"""What Typer ends with after Ctrl-C."""
Out = Annotated[Path, typer.Option(help="Folder for the results; created if needed.")]
Model = Annotated[Path | None, typer.Option(help="Model file (YAML) instead of the nominal one.")]
Contact = Annotated[Path | None, typer.Option(help="File of a contact fit, whose numbers replace the model's.")]


def model_of(path: Path | None, contact: Path | None = None) -> Any:
    """The model of a file, or the nominal one, with the fitted contact of another."""
    from vsf_drake.contact_file import load_contact, model_with
    from vsf_drake.files import resource
    from vsf_drake.model_file import load_model

    model = load_model(path or resource("models/nominal.yaml"))
    return model if contact is None else model_with(model, load_contact(contact).values, file=contact)


def contact_hash(path: Path | None) -> dict[str, str]:
    """SHA-256 of a fitted contact, by the name under which results have it; none for None."""
    from vsf_drake.files import sha256

    return {} if path is None else {f"contact: {path.name}": sha256(path)}


def file_of(path: Path | None) -> Path | None:
    """`path` with ~ expanded."""
    return None if path is None else user_path(path)


def check_contact_use(contact: Path | None, *, fit_offsets: bool) -> None:
    """Raises InputError for a fitted contact together with --fit-offsets."""
    if contact is not None and fit_offsets:
        raise InputError("cannot go with --contact, whose fit has found the offsets already", where="--fit-offsets",
                         right="Leave one of them out")


@contextmanager
def progress() -> Iterator[Callable[[str, float], None]]:
    """A bar that disappears when done; called with what is being done and the finished fraction of it."""
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=errors, transient=True) as bar:
        task = bar.add_task("preparing", total=1.0)
        yield lambda what, fraction: bar.update(task, description=what, completed=fraction)


def _version(asked: bool) -> None:
    if asked:
        console.print(__version__, highlight=False)
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it.")] = False,
) -> None:
    pass
