"""What the validation comes to: its main figures beside the paper's and beside what is asked of this model.

Published: McGeehan, Adamczyk, Nichols and Hahn 2021, doi 10.1115/1.4050456.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class _Line:
    """A line of the summary.

    Attributes:
        key: where the value stands, "section/key/key". unit, form, scale: of the value as it is shown.
        paper: the published figure in words, "" where none is published.
        most, least: what the value may be; None where nothing is asked.
    """

    what: str
    key: str
    unit: str
    form: str = "{:z.2f}"
    scale: float = 1.0
    paper: str = ""
    most: float | None = None
    least: float | None = None


_REMAINDER = "energy/ledger_remainder_share_max"
_LINES = (
    _Line(what="Bench: R² of stiffness over fulcrum positions", key="bench/stiffness_r2", unit="", form="{:.4f}",
          paper="0.98", least=0.98),
    _Line(what="Bench: RMSE of stiffness", key="bench/stiffness_rmse_n_per_mm", unit="N/mm", paper="1.37", most=1.37),
    _Line(what="Bench: RMSE of mid-range displacement", key="bench/mid_range_rmse_mm", unit="mm", paper="0.45",
          most=0.45),
    _Line(what="Standing: mass predicted less mass known, largest", key="standing/worst_mass_error", unit="%",
          scale=100.0, paper="-2.6"),
    _Line(what="Fitted walks: resultant GRF, RMSE, mean", key="walking/fitted/grf_rmse_bw", unit="% BW", scale=100.0,
          paper="5.3", most=0.053),
    _Line(what="Held-out walks: resultant GRF, RMSE, mean", key="walking/held_out/grf_rmse_bw", unit="% BW",
          scale=100.0, paper="10 to 14", most=0.10),
    _Line(what="Held-out walks: resultant GRF, RMSE, worst", key="walking/held_out/grf_rmse_bw_worst", unit="% BW",
          scale=100.0, paper="14", most=0.14),
    _Line(what="Held-out walks: null model (a stretched measured curve), mean",
          key="walking/held_out/null_model_grf_rmse_bw", unit="% BW", scale=100.0),
    _Line(what="Held-out walks: CoP, RMSE, mean", key="walking/held_out/cop_rmse_fl", unit="% foot length",
          scale=100.0, paper="5.7 to 9.5", most=0.095),
    _Line(what="Held-out walks: impulse, RMSE, mean", key="walking/held_out/impulse_rmse_bws", unit="BW s",
          form="{:.4f}", paper="0.01 to 0.05", most=0.05),
    _Line(what="Joint angles: tracking, RMSE", key="walking/angle_rmse_deg", unit="°", form="{:.1e}", paper="1.9",
          most=0.01),
    _Line(what="Joint angles: phase lag, largest", key="walking/angle_lag_ms", unit="ms", form="{:.1e}"),
    _Line(what="Stance time: correlation over trials", key="walking/stance_r", unit="", form="{:.3f}"),
    _Line(what="Energy: ledger's remainder over stored energy, worst trial", key=_REMAINDER, unit="%", scale=100.0,
          most=0.01),
)
_ANSWERS = (("energy/softer_stores_more", "A softer setting stores more energy, as measured on the real device"),
            ("energy/softer_returns_more", "A softer setting returns more energy, as measured on the real device"))


def summary_rows(sections: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of the summary: what, value (as its section holds it), shown, unit, paper, asked, met.

    Args:
        sections: their tables by name; what is not there gives a row with an unknown value.
    """
    rows = []
    fitted = bool(_found(sections, "bench/contact_on_bench"))
    for line in _LINES:
        value = _found(sections, line.key)
        limit = line.most if line.most is not None else line.least
        relation = "at most" if line.most is not None else "at least"
        met = None if value is None or limit is None else bool(
            value <= limit if line.most is not None else value >= limit)
        asked = "" if limit is None else f"{relation} {line.scale * limit:g}"
        what = line.what + (" (fitted to a bench)" if fitted and line.key.startswith("bench/") else "")
        if line.key == _REMAINDER and value is not None:
            what += f" (in steps of {1e3 * sections['energy']['step_s']:g} ms)"
        rows.append({"what": what, "key": line.key, "value": value, "unit": line.unit, "paper": line.paper or None,
                     "shown": None if value is None else _shown(line, value),
                     "asked": asked or None, "met": met})
    for key, what in _ANSWERS:
        value = _found(sections, key)
        shown = None if value is None else "yes" if value else "no"
        rows.append({"what": what, "key": key, "value": value, "unit": "", "paper": None, "shown": shown,
                     "asked": "yes", "met": value})
    return rows


def _shown(line: _Line, value: float) -> str:
    """The value as the line shows it, without the sign of a zero."""
    text = line.form.format(line.scale * value)
    return text if float(text) else line.form.format(0.0)


def _found(sections: Mapping[str, Mapping[str, Any]], key: str) -> Any:
    found: Any = sections
    for part in key.split("/"):
        if not isinstance(found, Mapping) or part not in found:
            return None
        found = found[part]
    return found
