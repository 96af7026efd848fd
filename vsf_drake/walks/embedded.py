"""The synthetic trials that come with the package, their contact and their bench."""

from __future__ import annotations

from pathlib import Path

from vsf_drake.base.files import resource, sha256

SETTINGS = ("low", "medium", "high")  # of the embedded trials
REPEATS = 3
TIERS = ("laboratory", "exact")
_EMBEDDED = "data/reference_subject"


def embedded_trials(tier: str = TIERS[0], *, quick: bool = False) -> tuple[Path, ...]:
    """Manifests of the trials that ship with the package, three a setting; one a setting if
    `quick`.

    All are synthetic, and say so. The tier `exact` is without errors of measurement, `laboratory`
    has them.
    """
    if tier not in TIERS:
        raise ValueError(f"there is no tier {tier!r}; there are {', '.join(TIERS)}")
    numbers = (2,) if quick else range(1, REPEATS + 1)
    return tuple(
        resource(f"{_EMBEDDED}/{tier}/{setting}_{number}.yaml")
        for setting in SETTINGS
        for number in numbers
    )


def embedded_contact(tier: str = TIERS[0]) -> Path:
    """The contact that was fitted to low_1 and high_1 of a tier of the embedded trials, and to
    their bench."""
    return resource(f"{_EMBEDDED}/{tier}/contact.yaml")


def embedded_contact_beside(manifest: str | Path) -> Path | None:
    """The embedded contact of the tier that a manifest stands in; None where it is none of the
    embedded ones."""
    beside = Path(manifest).with_name("contact.yaml")
    return (
        beside
        if beside.is_file() and sha256(beside) in map(sha256, map(embedded_contact, TIERS))
        else None
    )


def embedded_bench() -> Path:
    """Load-displacement curves of the embedded trials' foot: the virtual laboratory's,
    synthetic."""
    return resource(f"{_EMBEDDED}/bench_curves.csv")
