"""What the fit was to reach, beside what it reached."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from contact_fit_study.cases import TIERS


@dataclass(frozen=True, kw_only=True)
class Target:
    """A number of the results and its limit.

    Attributes:
        what: in words. key: in a tier's results; with `worst`, the worst of the held-out trials is
            meant.
        limits: by tier, in the result's unit; at_least: it is the least, not the most.
        scale, digits, unit: for showing.
    """

    what: str
    key: str
    limits: Mapping[str, float]
    unit: str = ""
    scale: float = 1.0
    digits: int = 2
    worst: bool = False
    at_least: bool = False

    def measured(self, results: Mapping[str, Any]) -> float | None:
        """Of a tier's results."""
        value: float | None = (
            results.get("held_out", {}).get(self.key, {}).get("worst")
            if self.worst
            else results.get(self.key)
        )
        return value

    def met(self, tier: str, results: Mapping[str, Any]) -> bool:
        value, limit = self.measured(results), self.limits[tier]
        return value is not None and (value >= limit if self.at_least else value <= limit)

    def shown(self, value: float | None) -> str:
        return "failed" if value is None else f"{self.scale * value:.{self.digits}f}"


def _both(limit: float) -> dict[str, float]:
    return dict.fromkeys(TIERS, limit)


def _each(exact: float, laboratory: float) -> dict[str, float]:
    return {"exact": exact, "laboratory": laboratory}


_BW, _FL = "% body weight", "% foot length"
TARGETS = (
    Target(
        what="one trial, fitted: resultant",
        key="one_trial_grf_rmse_bw",
        limits=_both(0.04),
        unit=_BW,
        scale=100,
    ),
    Target(
        what="one trial, fitted: R²",
        key="one_trial_grf_r2",
        limits=_both(0.98),
        digits=4,
        at_least=True,
    ),
    Target(
        what="held out: resultant",
        key="held_out_grf_rmse_bw",
        limits=_each(0.02, 0.05),
        unit=_BW,
        scale=100,
    ),
    Target(
        what="held out: fore-aft force",
        key="held_out_fore_aft_rmse_bw",
        limits={"laboratory": 0.045},
        unit=_BW,
        scale=100,
    ),
    Target(
        what="held out: centre of pressure",
        key="held_out_cop_rmse_fl",
        limits=_each(0.025, 0.05),
        unit=_FL,
        scale=100,
    ),
    Target(
        what="held out: impulse",
        key="held_out_impulse_rmse_bws",
        limits={"laboratory": 0.02},
        unit="BW s",
        digits=4,
    ),
    Target(
        what="held out: stance time, the worst trial",
        key="held_out_stance_time_error_s",
        limits={"laboratory": 0.03},
        unit="s",
        digits=4,
        worst=True,
    ),
    Target(
        what=(
            "fulcrum found by a sweep, of 9; six are at an end of its travel, where no error "
            "outwards shows"
        ),
        key="fulcrum_sweep_correct",
        limits=_each(9, 8),
        digits=0,
        at_least=True,
    ),
    Target(what="bench", key="bench_rmse_n_per_mm", limits=_each(0.7, 1.37), unit="N/mm"),
    Target(
        what="time for one trial, all starts",
        key="one_trial_wall_s",
        limits=_both(60.0),
        unit="s",
        digits=0,
    ),
    Target(
        what="time for the pair, all starts", key="wall_s", limits=_both(180.0), unit="s", digits=0
    ),
)


def text_table(results: Mapping[str, Any]) -> str:
    """Target, measured, met or not, for every tier that there is; null model and floor beside the
    resultant."""
    lines = []
    for tier in (name for name in TIERS if name in results):
        found = results[tier]
        lines.append(f"{tier} tier{'':<36}{'target':>10}{'measured':>12}")
        for target in (t for t in TARGETS if tier in t.limits and t.key in found):
            limit = f"{'>=' if target.at_least else '<='} {target.shown(target.limits[tier])}"
            beside = _beside(target, found)
            lines.append(
                f"  {target.what:<40}{limit:>12}{target.shown(target.measured(found)):>12} "
                f"{target.unit:<14}{'met' if target.met(tier, found) else 'MISSED':>8}{beside}"
            )
    return "\n".join(lines)


def _beside(target: Target, found: Mapping[str, Any]) -> str:
    held = found.get("held_out", {})
    if target.key not in held or target.worst:
        return ""
    said = f"   worst {target.shown(held[target.key]['worst'])} ({held[target.key]['worst_trial']})"
    if target.key == "held_out_grf_rmse_bw":
        said += (
            f"; null model {target.shown(found['null_model_grf_rmse_bw'])}, floor "
            f"{target.shown(found['floor_grf_rmse_bw'])}"
        )
    return said


def markdown_table(results: Mapping[str, Any]) -> str:
    """The same for docs/guide/fit.md: measured, with the targets in parentheses."""
    rows = ["| fitted to one soft and one stiff walk | exact | laboratory |", "|---|---|---|"]
    for target in TARGETS:
        cells = [_cell(target, tier, results[tier]) for tier in TIERS]
        rows.append(
            f"| {target.what}{', ' * bool(target.unit)}{target.unit} | {' | '.join(cells)} |"
        )
        if target.key == "held_out_grf_rmse_bw":
            for what, key in (
                ("null model", "null_model_grf_rmse_bw"),
                ("nearest single curve", "stretched_null_grf_rmse_bw"),
                ("floor", "floor_grf_rmse_bw"),
            ):
                cells = [target.shown(results[tier][key]) for tier in TIERS]
                rows.append(f"| {what} of the same, {target.unit} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _cell(target: Target, tier: str, found: Mapping[str, Any]) -> str:
    shown = target.shown(target.measured(found))
    if tier not in target.limits:
        return shown
    missed = "" if target.met(tier, found) else ", missed"
    return (
        f"{shown} ({'≥' if target.at_least else '≤'} {target.shown(target.limits[tier])}{missed})"
    )
