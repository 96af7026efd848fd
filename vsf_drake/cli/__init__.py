"""The command line: `vsf-drake bench`, `simulate`, `validate`. One module a command; importing it adds the command."""

from vsf_drake.cli import bench, simulate, validate
from vsf_drake.cli.app import app, main

__all__ = ["app", "bench", "main", "simulate", "validate"]
