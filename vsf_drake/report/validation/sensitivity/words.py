"""Names, units and colours of the sensitivity chapter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Output:
    """How an output of the study is shown: its name, unit, scale of the stored value, and number format."""

    name: str
    unit: str
    scale: float = 1.0
    form: str = "{:.2f}"

    def shown(self, value: float | None, *, unit: bool = True) -> str:
        """The value in words; an en dash where it is unknown."""
        if value is None:
            return "–"
        return self.form.format(self.scale * value) + (f" {self.unit}" if unit else "")


OUTPUTS = {
    "grf_rmse_bw": Output("resultant GRF error", "% BW", 100.0, "{:.1f}"),
    "cop_rmse_fl": Output("CoP error", "% foot length", 100.0, "{:.2f}"),
    "cop_shift_mm": Output("mean CoP shift", "mm", 1.0, "{:.1f}"),
    "peak_vertical_bw": Output("peak vertical force", "% BW", 100.0, "{:.1f}"),
    "spring_stored_j": Output("energy stored", "J"),
    "spring_returned_j": Output("energy returned", "J"),
    "spring_return_ratio": Output("return ratio", "%", 100.0, "{:.2f}"),
    "keel_stored_j": Output("energy stored in the keel alone", "J"),
}
MAIN = ("grf_rmse_bw", "cop_rmse_fl", "spring_returned_j")
"""What the chapter draws."""
GROUPS = {  # colours of Okabe and Ito, told apart with any colour vision, and a hatch each for grey print
    "kinematics": ("#D55E00", ""), "geometry": ("#E69F00", "///"), "bushing": ("#009E73", "..."),
    "contact": ("#0072B2", "\\\\\\"), "friction": ("#56B4E9", "ooo"), "keel": ("#CC79A7", "xxx")}
_OTHER = ("0.5", "")


def look(group: str) -> dict[str, Any]:
    """Colour and hatch of a group's bars."""
    colour, hatch = GROUPS.get(group, _OTHER)
    return {"facecolor": colour, "hatch": hatch, "edgecolor": "black", "linewidth": 0.5}


def shown_outputs(rows_by_output: Mapping[str, Sequence[Any] | None]) -> list[str]:
    """The MAIN outputs of which there are rows."""
    return [name for name in MAIN if rows_by_output.get(name)]


def top(rows: Sequence[Mapping[str, Any]], key: str, most: int) -> list[Mapping[str, Any]]:
    """The rows with the largest values of `key`, falling."""
    return sorted(rows, key=lambda row: -row[key])[:most]
