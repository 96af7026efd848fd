"""How the setting of a foot is called, in one place: where its fulcrum stands, or, of a passive
foot, which has none, which foot it is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from vsf_drake.model.parameters import FootParameters

PASSIVE = "passive"  # what a passive foot is called that nobody named


def moves(foot: FootParameters) -> bool:
    """Whether `foot` has a fulcrum. A passive foot has none: its keel is clamped at one place."""
    return foot.fulcrum.rearmost_m < foot.fulcrum.foremost_m


@dataclass(frozen=True, kw_only=True)
class AtSetting:
    """The setting of a foot, as records have it."""

    fulcrum_mm: float | None
    """from the keel's posterior end A; None of a passive foot"""
    foot: str = ""
    """the name of a passive foot"""

    @property
    def setting(self) -> AtSetting:
        """The setting alone, by which records are grouped."""
        return AtSetting(fulcrum_mm=self.fulcrum_mm, foot=self.foot)

    @property
    def setting_cell(self) -> str:
        """For cells under a heading that has the unit: "108", or a passive foot's name."""
        return self.foot if self.fulcrum_mm is None else f"{self.fulcrum_mm:g}"

    @property
    def setting_short(self) -> str:
        """For legends and ticks: "108 mm", or a passive foot's name."""
        return self.foot if self.fulcrum_mm is None else f"{self.fulcrum_mm:g} mm"

    @property
    def setting_words(self) -> str:
        """For sentences and titles: "fulcrum 108 mm", or "foot NAME" of a passive foot."""
        return f"{'foot' if self.fulcrum_mm is None else 'fulcrum'} {self.setting_short}"

    @property
    def setting_order(self) -> tuple[float, str]:
        """By which settings are sorted: the softest first, passive feet by their names."""
        return self.fulcrum_mm or 0.0, self.foot


def setting_of(foot: FootParameters, fulcrum_m: float) -> AtSetting:
    """The setting of `foot` with its fulcrum at `fulcrum_m` (m from A)."""
    if moves(foot):
        return AtSetting(fulcrum_mm=round(1e3 * fulcrum_m, 9))
    return AtSetting(fulcrum_mm=None, foot=foot.name or PASSIVE)


def setting_column(settings: Iterable[AtSetting]) -> tuple[str, ...]:
    """The column of a table that tells the settings: their attribute, its heading, and of numbers
    their format. Where every foot has a fulcrum its place, where none has the foot's name, where
    they differ `setting_words`."""
    passive = {setting.fulcrum_mm is None for setting in settings}
    if len(passive) == 2:
        return "setting_words", "setting"
    return ("foot", "foot") if passive == {True} else ("fulcrum_mm", "fulcrum (mm)", "{:g}")
