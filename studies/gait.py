"""One walk at several fulcrum positions: what would the same motion have done on a softer or a
stiffer foot?

Without a manifest it walks the embedded trial, which is synthetic.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from vsf_drake.base.files import write_json
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.embedded import embedded_trials
from vsf_drake.walks.metrics import walk_metrics
from vsf_drake.walks.offsets import fit_offsets

KEYS = (
    "grf_rmse_bw",
    "vertical_impulse_error",
    "cop_rmse_fl",
    "stance_model_s",
    "unconverged_steps",
)


def main() -> None:
    """Fits the offsets at the trial's own setting, then moves the fulcrum."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("trial", type=Path, nargs="?")
    parser.add_argument("--out", type=Path, default=Path("results/gait"))
    parser.add_argument("--quick", action="store_true", help="end points only")
    arguments = parser.parse_args()
    trial = load_trial(arguments.trial or embedded_trials("exact")[0])
    walker = Walker(trial.subject, trial.model)
    fit = fit_offsets(trial, walker=walker)
    rows = []
    for fulcrum_m in (0.066, 0.151) if arguments.quick else (0.066, 0.087, 0.108, 0.129, 0.151):
        walk = walker.walk(
            trial.trajectory,
            fulcrum_m=fulcrum_m,
            start_s=trial.start_s,
            end_s=trial.end_s,
            offsets=fit.offsets,
        )
        result = walker.result(walk, trial, fit.offsets)
        metrics = walk_metrics(result, trial.prosthetic_plate)
        keel = result.energy_j[:, result.energy_names.index("keel_strain")]
        rows.append(
            {"fulcrum_mm": 1e3 * fulcrum_m, "keel_energy_j": float(keel.max())}
            | {key: getattr(metrics, key) for key in KEYS}
        )
        print(
            "  ".join(
                f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                for key, value in rows[-1].items()
            )
        )
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_json(
        arguments.out / "gait.json",
        {"trial": trial.name, "synthetic": trial.synthetic, "settings": rows},
    )


if __name__ == "__main__":
    main()
