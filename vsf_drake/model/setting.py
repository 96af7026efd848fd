"""How the setting of a foot is called, in one place: where its fulcrum stands, or, of a passive
foot, which has none, which foot it is."""

from __future__ import annotations

from collections.abc import Iterable

from vsf_drake.model.parameters import FootParameters

PASSIVE = "passive"  # what a passive foot is called that nobody named


def moves(foot: FootParameters) -> bool:
    """Whether `foot` has a fulcrum. A passive foot has none: its keel is clamped at one place."""
    return foot.fulcrum.rearmost_m < foot.fulcrum.foremost_m


def setting_short(foot: FootParameters, fulcrum_m: float) -> str:
    """For legends and ticks: "108 mm" (from A), or a passive foot's name."""
    return f"{1e3 * fulcrum_m:g} mm" if moves(foot) else foot.name or PASSIVE


def setting_words(foot: FootParameters, fulcrum_m: float) -> str:
    """For sentences and titles: "fulcrum 108 mm" (from A), or "foot NAME" of a passive foot."""
    return f"{'fulcrum' if moves(foot) else 'foot'} {setting_short(foot, fulcrum_m)}"


def setting_heading(feet: Iterable[FootParameters]) -> str:
    """Above a column of settings: "fulcrum (mm)" over numbers where every foot has a fulcrum,
    "foot" over `setting_short` where none has, "setting" over `setting_words` where they differ."""
    kinds = {moves(foot) for foot in feet}
    if len(kinds) == 2:
        return "setting"
    return "foot" if kinds == {False} else "fulcrum (mm)"
