"""Standing still: does the ground carry the person's weight, and how much of it is under the prosthesis?"""

from __future__ import annotations

import argparse
from pathlib import Path

from vsf_drake.analysis.json_file import write_json
from vsf_drake.model_file import load_model
from vsf_drake.parameters import Subject
from vsf_drake.resources import resource
from vsf_drake.simulation.standing import simulate_standing


def main() -> None:
    """Stands on either prosthetic side at the softest and the stiffest setting."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/standing"))
    parser.add_argument("--quick", action="store_true", help="one second instead of ten")
    arguments = parser.parse_args()
    model = load_model(resource("models/nominal.yaml"))
    rows = []
    duration = 1.0 if arguments.quick else 10.0
    for side in ("right", "left"):
        # The subject of McGeehan et al. (2021): male, 78.0 kg, 1.81 m.
        subject = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side=side)
        for fulcrum_m in (0.066, 0.151):
            standing = simulate_standing(subject, model, fulcrum_m=fulcrum_m, duration_s=duration)
            rows.append({
                "prosthetic_side": side, "fulcrum_mm": 1e3 * fulcrum_m, "weight_n": standing.weight_n,
                "mean_vertical_n": float(standing.vertical_n.mean()),
                "final_vertical_n": float(standing.vertical_n[-1]),
                "prosthetic_share": standing.prosthetic_share, "drift_mm": 1e3 * standing.drift_m})
            print("  ".join(f"{key} {value:.4g}" if isinstance(value, float) else str(value)
                            for key, value in rows[-1].items()))
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_json(arguments.out / "standing.json", {"standing": rows})


if __name__ == "__main__":
    main()
