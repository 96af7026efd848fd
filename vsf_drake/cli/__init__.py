"""The command line: `bench`, `simulate`, `stand`, `validate`. One module a command; importing it adds the command."""

from vsf_drake.cli import bench, simulate, stand, validate
from vsf_drake.cli.app import app, main

__all__ = ["app", "bench", "main", "simulate", "stand", "validate"]
