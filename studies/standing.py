"""Standing still: does the ground carry the person's weight, and how much of it is under the
prosthesis?

The subject of McGeehan et al. (2021) on either side at the softest and the stiffest setting, and
with a prosthesis 10 mm shorter and longer than the intact leg; the pelvis as free as stays up, and
held upright.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from vsf_drake.base.files import plain, resource, write_json
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.simulation.results import standing_table
from vsf_drake.simulation.standing import simulate_standing

FULCRUMS_M = (0.066, 0.151)
LENGTH_DIFFERENCES_M = (-0.010, 0.0, 0.010)


def main() -> None:
    """Stands every person at every setting and writes one table."""
    parser = argparse.ArgumentParser(
        description="Standing still: what the ground carries, and under which foot."
    )
    parser.add_argument("--out", type=Path, default=Path("results/standing"))
    parser.add_argument("--quick", action="store_true", help="one second instead of ten")
    arguments = parser.parse_args()
    model = load_model(resource("models/nominal.yaml"))
    rows = []
    for side in ("right", "left"):
        for difference in LENGTH_DIFFERENCES_M if side == "right" else (0.0,):
            subject = person(side, difference, model)
            for fulcrum_m in FULCRUMS_M:
                for upright in (False, True):
                    standing = simulate_standing(
                        subject,
                        model,
                        fulcrum_m=fulcrum_m,
                        upright=upright,
                        duration_s=1.0 if arguments.quick else 10.0,
                    )
                    table = plain(standing_table(standing))
                    del table["series"]
                    rows.append(
                        {**table, "prosthesis_longer_mm": 1e3 * difference, "upright": upright}
                    )
                    print(line(rows[-1]))
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_json(arguments.out / "standing.json", {"standing": rows})


def person(side: str, difference_m: float, model: ModelParameters) -> Subject:
    """Male, 78.0 kg, 1.81 m, the prosthesis longer than the intact knee to sole by
    `difference_m`."""
    subject = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side=side)
    length = scale_body(subject, model.foot, model.socket).prosthesis_length
    return dataclasses.replace(subject, prosthesis_length_m=length + difference_m)


def line(row: dict) -> str:
    """One row to read."""
    held = ", ".join(
        f"{name.removeprefix('pelvis_')} {value:.0f}" for name, value in row["held_nm"].items()
    )
    return (
        f"{row['prosthetic_side']:5s} {row['prosthesis_longer_mm']:+3.0f} mm  fulcrum "
        f"{row['fulcrum_mm']:3.0f} mm  mean {row['mean_vertical_n']:.1f} of "
        f"{row['weight_n']:.1f} N  prosthetic {row['prosthetic_share']:.0%}  list "
        f"{row['pelvis_deg']['list']:+.1f} deg  drift {row['drift_mm']:.2f} mm  held (N m) "
        f"{held or '-'}"
    )


if __name__ == "__main__":
    main()
