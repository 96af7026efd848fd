"""Studies of the embedded trials as the tests of the validation take them, and sections of a saved
validation."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from command_line import read_json

from vsf_drake.base.files import read_npz, record, resource
from vsf_drake.validation.run import SHIPPED, tables
from vsf_drake.validation.study import Section, Study, StudyOptions, make_study
from vsf_drake.walks.embedded import embedded_contact, embedded_trials


@cache
def embedded_study(*, quick: bool = True, tier: str = "laboratory") -> Study:
    """One walk a setting (all nine if not `quick`), with the stored contact; no bench file."""
    return make_study(
        embedded_trials(tier, quick=quick),
        contact=embedded_contact(tier),
        options=StudyOptions(quick=quick, workers=1),
    )


@cache
def saved_section(folder: Path, name: str) -> Section[Any]:
    """A section of the validation in `folder`, as it comes back from disk."""
    saved = read_json(folder / "validation.json")["sections"][name]
    arrays = {
        key.removeprefix(f"{name}__"): array
        for key, array in read_npz(folder / "validation.npz").items()
        if key.startswith(f"{name}__")
    }
    return Section(
        table=record(tables()[name], saved["table"]), arrays=arrays, missing=tuple(saved["missing"])
    )


@cache
def shipped_section(name: str) -> Section[Any]:
    """A section that comes with the package."""
    saved = read_json(resource(f"{SHIPPED}/{name}.json"))
    return Section(
        table=record(tables()[name], saved["table"]),
        arrays=read_npz(resource(f"{SHIPPED}/{name}.npz")),
        missing=tuple(saved["missing"]),
    )
