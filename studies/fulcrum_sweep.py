"""The resultant error of one walk over the whole travel of the fulcrum: is it smallest where the
fulcrum stood?

Without a manifest it walks the embedded trial at the middle setting, which is synthetic, with
geometric offsets that were fitted to another trial, at the softest setting: no position of this one
is favoured. `--quick` fits nothing. Finished walks are kept in the output folder: run it again
after an interruption, or with more positions, and only what is missing is simulated. `vsf-drake
sweep` does the same for any trials and variables.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.base.files import write_json
from vsf_drake.base.schema import to_plain
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.report import style as look
from vsf_drake.simulation.batch import DEFAULT_KEEP, WalkCase, WalkOutcome, simulate_batch
from vsf_drake.walks.comparison import PERCENT, Comparison, compare
from vsf_drake.walks.embedded import embedded_trials
from vsf_drake.walks.offsets import fit_offsets
from vsf_drake.walks.plate_score import plate_scorer
from vsf_drake.walks.sweep_table import scores

FIRST_MM, LAST_MM = 66.0, 151.0


def main() -> None:
    """Walks every position, writes the table and the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("trial", type=Path, nargs="?")
    parser.add_argument(
        "--offsets-from", type=Path, help="another trial of this person, to fit the offsets to"
    )
    parser.add_argument("--out", type=Path, default=Path("results/fulcrum_sweep"))
    parser.add_argument(
        "--quick", action="store_true", help="6 positions instead of 21, in this process"
    )
    parser.add_argument("--workers", type=int, help="processes; one a core unless given")
    arguments = parser.parse_args()
    embedded = {path.stem: path for path in embedded_trials("exact")}
    trial, other = load_trial(arguments.trial or embedded["medium_1"]), arguments.offsets_from
    if other is None and arguments.trial is None and not arguments.quick:
        other = embedded["low_1"]
    offsets = trial.offsets if other is None else fit_offsets(load_trial(other)).offsets
    positions_m = 1e-3 * np.round(np.linspace(FIRST_MM, LAST_MM, 6 if arguments.quick else 21), 3)
    outcomes = simulate_batch(
        [WalkCase(trial=trial, fulcrum_m=float(f), offsets=offsets) for f in positions_m],
        keep=(*DEFAULT_KEEP, "q"),
        score=plate_scorer,
        workers=1 if arguments.quick and arguments.workers is None else arguments.workers,
        cache=arguments.out / "walks",
        progress=True,
    )
    rows: list[dict[str, Any]] = []
    compared = []
    for position, outcome in zip(positions_m, outcomes, strict=True):
        if not outcome.ok:
            print(outcome.failure)
            continue
        compared.append((float(position), compare(_Kept(outcome), trial.prosthetic_plate)))
        rows.append({"fulcrum_mm": round(1e3 * float(position), 6), **scores(outcome)})
        print("  ".join(f"{key} {value:.4g}" for key, value in rows[-1].items()))
    if not rows:
        raise SystemExit("every walk failed")
    best = min(rows, key=lambda row: row["grf_rmse_bw"])["fulcrum_mm"]
    print(
        f"smallest resultant error at {best:g} mm; the fulcrum stood at "
        f"{1e3 * trial.fulcrum_m:g} mm"
    )
    write_json(
        arguments.out / "fulcrum_sweep.json",
        {
            "trial": trial.name,
            "synthetic": trial.synthetic,
            "offsets": to_plain(offsets),
            "offsets_fitted_to": None if other is None else Path(other).stem,
            "fulcrum_in_the_trial_mm": 1e3 * trial.fulcrum_m,
            "smallest_error_at_mm": best,
            "positions": rows,
            "failed": [o.failure for o in outcomes if not o.ok],
        },
    )
    with look.style():
        look.save_figure(figure(trial, rows, compared), arguments.out / "fulcrum_sweep")


class _Kept:
    """A finished walk, of which the coordinates were kept too, as `compare` reads it."""

    def __init__(self, outcome: WalkOutcome) -> None:
        self._outcome = outcome
        self.time_s, self.grf_W, self.cop_W = (outcome.arrays[name] for name in DEFAULT_KEEP)

    def column(self, name: str) -> np.ndarray:
        """(n,) history of one coordinate."""
        return self._outcome.arrays["q"][:, self._outcome.columns["q"].index(name)]


def figure(trial: Trial, rows: list[dict], compared: list[tuple[float, Comparison]]) -> Any:
    """Errors over the travel; vertical force and centre of pressure of a few positions beside what
    was measured."""
    made = look.new_figure(10.0, 3.6)
    errors, force, cop = made.subplots(1, 3)
    place = [row["fulcrum_mm"] for row in rows]
    errors.axvline(
        1e3 * trial.fulcrum_m, color="0.6", linewidth=5.0, alpha=0.5, label="in the trial"
    )
    errors.plot(
        place,
        [100 * row["grf_rmse_bw"] for row in rows],
        "o-",
        color="0.15",
        label="resultant force, % BW",
    )
    errors.plot(
        place,
        [100 * row["cop_rmse_fl"] for row in rows],
        "s--",
        color="0.5",
        label="centre of pressure, % FL",
    )
    errors.set_ylim(bottom=0.0)
    errors.legend()
    look.label(
        errors,
        x="fulcrum from the keel's posterior end (mm)",
        y="RMS error (%)",
        title="Error" + " (synthetic recording)" * trial.synthetic,
    )
    weight = trial.subject.mass_kg * GRAVITY
    shown = compared[:: max(1, (len(compared) - 1) // 5)]
    for number, (position, c) in enumerate(shown):
        if number == 0:
            force.plot(c.time_s, c.measured[:, 2] / weight, color="0.4", **look.MEASURED)
        line = {"color": look.colour_of(1e3 * position), **look.SIMULATED}
        force.plot(c.time_s, c.model[:, 2] / weight, **line)
        for stance in c.stances[:1]:
            start = np.nanmin(stance.measured_cop[:, 0])
            if number == 0:
                cop.plot(
                    PERCENT,
                    1e3 * (stance.measured_cop[:, 0] - start),
                    color="0.4",
                    label="force plate",
                    **look.MEASURED,
                )
            cop.plot(
                PERCENT,
                1e3 * (stance.model_cop[:, 0] - start),
                **line,
                label=look.name_of(round(1e3 * position, 3)),
            )
    cop.legend(loc="lower right")
    look.label(force, x="time (s)", y="vertical force (BW)", title="Force")
    look.label(
        cop, x="stance (%)", y="fore-aft, from its first point (mm)", title="Centre of pressure"
    )
    return made


if __name__ == "__main__":
    main()
