"""The command line, one module a command; importing a module adds its command."""

from vsf_drake.cli import (
    bench,
    check,
    export,
    fit,
    import_,
    report,
    schedule,
    show,
    simulate,
    stand,
    sweep,
    tune,
    validate,
)
from vsf_drake.cli.app import app, main

__all__ = ["app", "bench", "check", "export", "fit", "import_", "main", "report", "schedule", "show", "simulate",
           "stand", "sweep", "tune", "validate"]
