"""Tables of the chapter on energy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsf_drake.report.pieces import Column, Grid
from vsf_drake.report.validation.energy.ledger_figure import WORDS

_LABEL = Column(key="label", heading="trial")
_FULCRUM = Column(key="fulcrum_mm", heading="fulcrum (mm)", form="{:g}")


def conditions_grid(table: Mapping[str, Any]) -> Grid:
    """Means and SD by fulcrum position."""
    shown = (("stored_j", "stored (J)", "{:.2f}", 1.0), ("keel_stored_j", "keel alone (J)", "{:.2f}", 1.0),
             ("returned_j", "returned (J)", "{:.2f}", 1.0), ("return_ratio", "return ratio (%)", "{:.1f}", 100.0),
             ("efficiency", "efficiency (%)", "{:.1f}", 100.0), ("lost_j", "lost in the foot (J)", "{:.2f}", 1.0),
             ("distal_peak_w", "peak distal power (W)", "{:.0f}", 1.0))
    columns = [_FULCRUM, Column(key="n", heading="stances", form="{:g}")]
    for key, heading, form, scale in shown:
        columns += [Column(key=key, heading=heading, form=form, scale=scale),
                    Column(key=f"{key}_sd", heading="SD", form=form, scale=scale)]
    return Grid(name="energy_conditions", columns=columns, rows=table["conditions"],
                caption="Energy of a stance by fulcrum position: mean over the stances and sample standard deviation "
                        "(none with one stance). All of it is simulated.")


def trials_grid(table: Mapping[str, Any]) -> Grid:
    """A row a stance."""
    return Grid(name="energy_trials", rows=table["trials"], columns=(
        _LABEL, Column(key="stance", heading="stance", form="{:g}"), _FULCRUM,
        Column(key="stored_j", heading="stored (J)", form="{:.2f}"),
        Column(key="stored_at_percent", heading="at (% stance)", form="{:.0f}"),
        Column(key="keel_at_most_j", heading="of it keel (J)", form="{:.2f}"),
        Column(key="fulcrum_at_most_j", heading="support (J)", form="{:.2f}"),
        Column(key="foam_at_most_j", heading="foam (J)", form="{:.2f}"),
        Column(key="returned_j", heading="returned (J)", form="{:.2f}"),
        Column(key="return_ratio", heading="return ratio (%)", form="{:.1f}", scale=100.0),
        Column(key="lost_j", heading="lost in the foot (J)", form="{:.2f}"),
        Column(key="distal_peak_w", heading="peak distal power (W)", form="{:.0f}"),
        Column(key="bench_j", heading="bench F²/2k (J)", form="{:.1f}")),
        caption="Energy by stance. Bench F²/2k: what the model would store in the testing machine, load at its load "
                "point and across the keel, at this stance's largest late vertical force; see the notes below.")


def moved_grid(table: Mapping[str, Any], key: str) -> Grid:
    """Every trial at every position, the load (`same_load`) or the motion (`same_motion`) kept."""
    kept = key == "same_load"
    columns = [_LABEL, _FULCRUM, Column(key="stored_j", heading="stored (J)", form="{:.2f}"),
               Column(key="returned_j", heading="returned (J)", form="{:.2f}"),
               Column(key="return_ratio", heading="return ratio (%)", form="{:.1f}", scale=100.0),
               Column(key="friction_loss_j", heading="friction (J)", form="{:.2f}"),
               Column(key="late_load_n", heading="late peak force (N)", form="{:.0f}"),
               Column(key="remainder_share", heading="remainder (% stored)", form="{:.2f}", scale=100.0)]
    if kept:
        columns += [Column(key="off_bw", heading="load off by (% BW)", form="{:.2f}", scale=100.0),
                    Column(key="height_mm", heading="pelvis moved by (mm)", form="{:.1f}")]
    what = ("Each trial's vertical force with the fulcrum elsewhere. Off by: root mean square over stance of what the "
            "force differs by from that at the trial's own position. Only the pelvis' height is changed, not the "
            "angles, which makes the foot slide more where it moves much." if kept else
            "Each trial's motion with the fulcrum elsewhere: the load is what the same motion then gives.")
    return Grid(name=f"energy_{key}", columns=columns, rows=table[key],
                caption=f"{what} In steps of {1e3 * table['moved_step_s']:g} ms.")


def ledger_grid(table: Mapping[str, Any]) -> Grid:
    """The ledger's terms at toe-off."""
    form = {"remainder": "{:.4f}"}
    columns = [_LABEL, *(Column(key=f"{name}_j", heading=f"{text} (J)", form=form.get(name, "{:.2f}"))
                         for name, text in WORDS.items())]
    columns.append(Column(key="remainder_share", heading="largest remainder (% stored)", form="{:.3f}", scale=100.0))
    return Grid(name="energy_ledger", columns=columns, rows=table["trials"],
                caption="The ledger from touch-down to toe-off: the first column is the sum of the others up to the "
                        "remainder. The last is the largest remainder at any instant of stance over stored energy. In "
                        f"steps of {1e3 * table['step_s']:g} ms.")


def convergence_grid(table: Mapping[str, Any]) -> Grid:
    """What twice the step changes."""
    return Grid(name="energy_convergence", rows=table["convergence"], columns=(
        _LABEL, _FULCRUM, Column(key="remainder_max_j", heading="remainder (J)", form="{:.4f}"),
        Column(key="coarse_remainder_max_j", heading="with twice the step (J)", form="{:.4f}"),
        Column(key="remainder_ratio", heading="ratio", form="{:.2f}"),
        Column(key="stored_j_change", heading="stored changes by (J)", form="{:+.4f}"),
        Column(key="returned_j_change", heading="returned (J)", form="{:+.4f}"),
        Column(key="lost_j_change", heading="lost (J)", form="{:+.4f}")),
        caption=f"What steps of {1e3 * table['coarse_step_s']:g} ms change against {1e3 * table['step_s']:g} ms. A "
                "first-order method's remainder doubles.")
