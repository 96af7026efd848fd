"""Where the files that ship with the package are: `models/` and `data/`."""

from __future__ import annotations

from pathlib import Path

from vsf_drake.errors import InputError

_PACKAGE = Path(__file__).resolve().parent


def resource(relative: str) -> Path:
    """Path of a shipped file or folder such as "models/nominal.yaml".

    It lies inside an installed package, and beside it in a checkout.

    Raises:
        InputError: there is no such file.
    """
    for home in (_PACKAGE, _PACKAGE.parent):
        if (home / relative).exists():
            return home / relative
    raise InputError("is not among the files of this package", file=relative)
